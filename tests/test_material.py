"""Materials against the published power reflection, and names that are nearly right."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc


@pytest.mark.parametrize(
    ("name", "level_db"),
    [
        # ITU-R P.2040-3 parameters at 60 GHz, half-space, normal incidence.
        ("concrete", -8.12),
        ("plasterboard", -12.17),
        ("wood", -15.32),
        ("glass", -7.31),
        ("ceiling_board", -20.19),
        ("chipboard", -12.63),
        ("floorboard", -10.03),
        ("marble", -6.87),
        ("perfect_conductor", 0.0),
        # Gabriel, Lau, Gabriel 1996, dry skin.
        ("skin", -4.23),
    ],
)
def test_power_reflection_at_60_ghz_is_the_published_one(name: str, level_db: float) -> None:
    material = rc.materials[name]
    # Half a unit of the table's last digit.
    assert abs(10.0 * np.log10(material.reflectance) - level_db) <= 0.0051
    assert material.reflectance == pytest.approx(abs(material.reflection) ** 2, rel=1e-15)
    assert material.albedo == 0.0
    assert material.reflection.real < 0.0  # denser than air: the field turns round


def test_metal_loses_seven_thousandths_of_a_db() -> None:
    # Good conductor: 1 - |Gamma|^2 = 4 Re(1 / sqrt(eps)), eps = -j 3.0e6, so -0.0071 dB.
    level_db = 10.0 * np.log10(rc.materials["metal"].reflectance)
    assert abs(level_db - -0.007) <= 0.0005


@pytest.mark.parametrize("eps", [1.0, 2.25, 5.24 - 0.3404j, 7.975 - 10.904j, 1.0 - 3e6j])
def test_dielectric_reflects_as_fresnel_says_at_normal_incidence(eps: complex) -> None:
    n = np.sqrt(complex(eps))  # refractive index n - jk
    assert n.real > 0.0
    expected = ((n.real - 1.0) ** 2 + n.imag**2) / ((n.real + 1.0) ** 2 + n.imag**2)
    assert rc.Material.dielectric(eps).reflectance == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert rc.Material.dielectric(2.25).reflection == pytest.approx(-0.2, rel=1e-14)  # glass, n = 1.5: 4 %


def test_lambertian_surface_has_no_mirror_image() -> None:
    matt = rc.Material.lambertian(0.3)
    assert (matt.reflection, matt.albedo, matt.reflectance) == (0.0, 0.3, 0.3)
    assert rc.Material() == rc.Material(-1.0, 0.0) == rc.materials["perfect_conductor"]


def test_library_is_a_mapping_that_cannot_be_changed() -> None:
    assert len(rc.materials) == len(list(rc.materials)) == len(dict(rc.materials)) >= 11
    assert "metal" in rc.materials
    assert "unobtainium" not in rc.materials
    assert rc.materials.get("unobtainium") is None
    assert all(isinstance(material, rc.Material) for material in rc.materials.values())
    assert "concrete" in repr(rc.materials)
    with pytest.raises(TypeError):
        rc.materials["metal"] = rc.Material()  # type: ignore[index]


@pytest.mark.parametrize(
    ("name", "near"),
    [("conrete", "'concrete'"), ("Metal", "'metal'"), ("woods", "'wood'"), ("plaster_board", "'plasterboard'")],
)
def test_unknown_name_is_an_error_that_names_near_ones(name: str, near: str) -> None:
    with pytest.raises(KeyError, match=f"no material '{name}'; did you mean .*{near}"):
        rc.materials[name]


@pytest.mark.parametrize("name", ["xyzzy", "", 7, None])
def test_name_like_no_other_is_an_error_that_lists_all(name: Any) -> None:
    with pytest.raises(KeyError, match=r"known: .*concrete.*metal"):
        rc.materials[name]


def test_all_the_power_and_no_more_may_come_back() -> None:
    assert rc.Material(0.6, 0.64).reflectance == pytest.approx(1.0, rel=1e-15)
    assert rc.Material(np.exp(1j), 0.0).reflectance == pytest.approx(1.0, rel=1e-15)
    with pytest.raises(ValueError, match=r"reflection, albedo: expected abs\(reflection\)\*\*2 \+ albedo.*got 1.01"):
        rc.Material(0.6, 0.65)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("make", "arguments", "error", "message"),
    [
        (rc.Material, (1.1,), ValueError, "reflection, albedo: expected.*at most 1, got 1.21"),
        (rc.Material, (0.0, 1.5), ValueError, "reflection, albedo: expected.*got 1.5"),
        (rc.Material, (0.0, -0.1), ValueError, "albedo: expected zero or a positive number, got -0.1"),
        (rc.Material, (0.0, NAN), ValueError, "albedo: expected a finite number, got nan"),
        (rc.Material, (0.0, "0.3"), TypeError, "albedo: expected a number, got '0.3'"),
        (rc.Material, (0.0, 0.1j), TypeError, "albedo: expected a number, got 0.1j"),
        (rc.Material, (NAN,), ValueError, "reflection: expected a finite number, got nan"),
        (rc.Material, (complex(0.0, INF),), ValueError, r"reflection: expected a finite number, got infj"),
        (rc.Material, ("metal",), TypeError, "reflection: expected a number, got 'metal'"),
        (rc.Material, ("-1",), TypeError, "reflection: expected a number, got '-1'"),
        (rc.Material, (None,), TypeError, "reflection: expected a number, got None"),
        (rc.Material, ([-1.0, 0.0],), TypeError, r"reflection: expected a number, got \[-1.0, 0.0\]"),
        (rc.Material, (True,), TypeError, "reflection: expected a number, got True"),
        (rc.Material.lambertian, (1.01,), ValueError, "reflection, albedo: expected.*got 1.01"),
        (rc.Material.lambertian, (-1.0,), ValueError, "albedo: expected zero or a positive"),
        (rc.Material.dielectric, (2.0 + 0.1j,), ValueError, r"permittivity: expected eps' - j eps''.*got \(2\+0.1j\)"),
        (rc.Material.dielectric, (0.0,), ValueError, "permittivity: expected.*got 0.0"),
        (rc.Material.dielectric, (NAN,), ValueError, "permittivity: expected.*got nan"),
        (rc.Material.dielectric, ("wood",), TypeError, "permittivity: expected a number, got 'wood'"),
        (rc.Material.dielectric, (None,), TypeError, "permittivity: expected a number, got None"),
    ],
)
def test_what_is_no_material_is_refused_with_its_name(
    make: Any, arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        make(*arguments)
