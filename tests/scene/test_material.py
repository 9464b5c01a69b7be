"""Materials against published numbers and Fresnel's equations, and names that are nearly right."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.scene.material import ColeCole


def test_metal_loses_seven_thousandths_of_a_db() -> None:
    # Good conductor: 1 - |Gamma|^2 = 4 Re(1 / sqrt(eps)), eps = -j 3.0e6, so -0.0071 dB.
    metal = rc.materials["metal"]
    assert abs(10.0 * np.log10(metal.reflectance) - -0.007) <= 0.0005
    assert metal.reflectance == pytest.approx(abs(metal.reflection) ** 2, rel=1e-15)


@pytest.mark.parametrize("eps", [1.0, 2.25, 5.24 - 0.3404j, 7.975 - 10.904j, 1.0 - 3e6j])
def test_dielectric_reflects_as_fresnel_says_at_normal_incidence(eps: complex) -> None:
    n = np.sqrt(complex(eps))  # refractive index n - jk
    assert n.real > 0.0
    expected = ((n.real - 1.0) ** 2 + n.imag**2) / ((n.real + 1.0) ** 2 + n.imag**2)
    assert rc.Material.dielectric(eps).reflectance == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert rc.Material.dielectric(2.25).reflection == pytest.approx(-0.2, rel=1e-14)  # glass, n = 1.5: 4 %


def permittivity(name: str, frequency: float = 60e9) -> complex:
    law = rc.materials[name].permittivity
    assert law is not None
    return law if isinstance(law, complex) else law.at(frequency)


def fresnel(eps: complex, cosine: Any) -> tuple[Any, Any]:
    """r_TE and r_TM of a half-space."""
    q = np.sqrt(eps - 1.0 + np.square(cosine) + 0j)
    return (cosine - q) / (cosine + q), (eps * cosine - q) / (eps * cosine + q)


@pytest.mark.parametrize(
    ("name", "eps"),
    [
        ("concrete", 5.240 - 0.3404j),
        ("plasterboard", 2.730 - 0.1193j),
        ("wood", 1.990 - 0.1134j),
        ("glass", 6.310 - 0.2597j),
        ("ceiling_board", 1.480 - 0.0269j),
        ("chipboard", 2.580 - 0.1585j),
        ("floorboard", 3.660 - 0.3335j),
        ("marble", 7.074 - 0.0731j),
        ("brick", 3.910 - 0.0137j),
        ("plywood", 2.710 - 0.0989j),
        ("abs", 2.70 * (1 - 0.008j)),
        ("pmma", 2.61 * (1 - 0.010j)),
        ("pom", 2.73 * (1 - 0.006j)),
        ("pvc", 2.71 * (1 - 0.006j)),
        ("nylon", 3.00 * (1 - 0.018j)),
        ("polystyrene", 2.505 * (1 - 0.00025j)),
        ("ptfe", 2.05 * (1 - 0.0005j)),
        ("pla", 2.84 - 0.043j),
    ],
)
def test_permittivity_at_60_ghz_is_the_published_one(name: str, eps: complex) -> None:
    got = permittivity(name)
    assert abs(got.real - eps.real) <= 0.00051  # half a unit of the table's last digit
    assert abs(got.imag - eps.imag) <= 0.000051


@pytest.mark.parametrize(
    ("frequency", "eps", "reflectance"),
    [(57e9, 8.340 - 11.335j, 0.3848), (60e9, 7.975 - 10.904j, 0.3776), (64e9, 7.555 - 10.371j, 0.3683)],
)
def test_skin_follows_its_relaxations(frequency: float, eps: complex, reflectance: float) -> None:
    got = permittivity("skin", frequency)
    assert abs(got.real - eps.real) <= 0.00051
    assert abs(got.imag - eps.imag) <= 0.00051
    reflection, _ = rc.materials["skin"].response(frequency)
    assert abs(abs(reflection) ** 2 - reflectance) <= 0.000051


def test_every_entry_has_its_source_and_the_frequencies_it_is_known_for() -> None:
    for name, material in rc.materials.items():
        if name == "perfect_conductor":
            assert (material.source, material.valid_frequency) == (None, None)
            assert material.is_valid_at(1e15)
            continue
        assert material.name == name
        assert material.source
        assert material.valid_frequency is not None
        lowest, highest = material.valid_frequency
        assert material.is_valid_at(lowest)
        assert material.is_valid_at(highest)
        assert not material.is_valid_at(1.01 * highest)
        assert not material.is_valid_at(0.99 * lowest)
    assert rc.materials["marble"].valid_frequency == (1e9, 60e9)
    assert "P.2040" in str(rc.materials["brick"].source)
    assert "Gabriel" in str(rc.materials["skin"].source)


COSINES = np.linspace(0.0, 1.0, 201)[1:]


@pytest.mark.parametrize("name", sorted(set(rc.materials) - {"perfect_conductor"}))
def test_library_reflects_as_fresnel_says_at_every_angle(name: str) -> None:
    material, f = rc.materials[name], 61e9
    te, tm = fresnel(permittivity(name, f), COSINES)
    # Without a polarisation the mean power, at the phase of TE.
    mean = te / abs(te) * np.sqrt(0.5 * (abs(te) ** 2 + abs(tm) ** 2))
    for polarization, expected in ((None, mean), ("te", te), ("tm", -tm)):
        reflection, albedo = material.response(f, COSINES, polarization=polarization)
        np.testing.assert_allclose(reflection, expected, rtol=0, atol=1e-13)
        assert (albedo == 0.0).all()


def surfaces() -> list[rc.Material]:
    """The library smooth, rough, scattering and as slabs."""
    made = [rc.Material(-1.0), rc.Material.lambertian(1.0)]
    for name in sorted(set(rc.materials) - {"perfect_conductor"}):
        material = rc.materials[name]
        made += [material, material.with_surface(roughness=3e-4), material.with_surface(scattering=0.5)]
        made += [material.with_surface(thickness=d) for d in (1e-4, 2.3e-3, 0.02)]
        made.append(material.with_surface(roughness=1e-3, thickness=2.3e-3))
    return made


@pytest.mark.parametrize("polarization", [None, "te", "tm"])
def test_no_material_returns_more_than_a_conductor(polarization: str | None) -> None:
    cosines = np.concatenate([[0.0, 1e-12, 1e-6], COSINES])
    for material in surfaces():
        for frequency in np.linspace(57e9, 64e9, 8).tolist():
            reflection, albedo = material.response(frequency, cosines, polarization=polarization)
            assert (albedo >= 0.0).all()
            assert (np.abs(reflection) ** 2 + albedo <= 1.0 + 1e-12).all(), material


def test_what_conducts_without_end_is_a_perfect_conductor() -> None:
    for polarization in (None, "te", "tm"):
        reflection, albedo = rc.Material.dielectric(1.0 - 1e20j).response(60e9, COSINES, polarization=polarization)
        np.testing.assert_allclose(reflection, -1.0, rtol=0, atol=1e-7)  # 2 / (cos |n|), n = 1e10
        assert (albedo == 0.0).all()


def test_slab_of_half_a_wavelength_is_not_there_and_of_a_quarter_reflects_most() -> None:
    wavelength, eps = 299_792_458.0 / 60e9, 2.5
    for degrees in (0.0, 30.0, 60.0):
        cosine = np.cos(np.deg2rad(degrees))
        inside = np.sqrt(eps - np.sin(np.deg2rad(degrees)) ** 2)
        slabs = (rc.Material.dielectric(eps, thickness=part * wavelength / inside) for part in (0.5, 0.25))
        half, quarter = (slab.response(60e9, cosine, polarization="te")[0] for slab in slabs)
        r, _ = fresnel(eps, cosine)
        assert abs(half) < 1e-14
        assert quarter == pytest.approx(2.0 * r / (1.0 + r * r), rel=1e-13)


def test_slab_that_absorbs_is_a_half_space() -> None:
    skin = rc.materials["skin"]
    reflection, _ = skin.with_surface(thickness=0.02).response(60e9, COSINES)
    np.testing.assert_allclose(reflection, skin.response(60e9, COSINES)[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("height", "level_db"), [(100e-6, -0.27), (200e-6, -1.10), (300e-6, -2.47), (500e-6, -6.87)])
def test_rough_surface_keeps_the_known_part_and_scatters_the_rest(height: float, level_db: float) -> None:
    smooth = rc.materials["concrete"]
    rough = smooth.with_surface(roughness=height)
    assert abs(20.0 * np.log10(abs(rough.reflection / smooth.reflection)) - level_db) <= 0.0051
    assert rough.reflectance == pytest.approx(smooth.reflectance, rel=1e-13)
    # g = (2 k sigma cos)^2: at 60 degrees a quarter of it.
    at_sixty, albedo = rough.response(60e9, 0.5)
    reference = smooth.response(60e9, 0.5)[0]
    level_db_at_sixty = 20.0 * np.log10(abs(at_sixty / reference))
    assert abs(level_db_at_sixty - level_db / 4.0) <= 0.0051
    assert abs(at_sixty) ** 2 + albedo == pytest.approx(abs(reference) ** 2, rel=1e-13)


def test_effective_roughness_scatters_its_part_at_every_angle() -> None:
    smooth = rc.materials["concrete"]
    reflection, albedo = smooth.with_surface(scattering=0.6).response(60e9, COSINES)
    reference = smooth.response(60e9, COSINES)[0]
    np.testing.assert_allclose(reflection, 0.8 * reference, rtol=1e-13)
    np.testing.assert_allclose(albedo, 0.36 * np.abs(reference) ** 2, rtol=1e-13)


def test_constant_material_is_the_same_at_every_angle_frequency_and_polarisation() -> None:
    for polarization in (None, "te", "tm"):
        reflection, albedo = rc.Material(0.3 - 0.4j, 0.5).response(77e9, COSINES, polarization=polarization)
        assert (reflection == 0.3 - 0.4j).all()
        assert (albedo == 0.5).all()


RADAR = rc.Radar(rc.Waveform(start_frequency=61e9, slope=1e12, sample_rate=1e6, num_samples=2))


def wall(name: str) -> rc.Body:
    return rc.Body(rc.shapes.plate(1.0, 1.0), material=rc.materials[name], motion=rc.Pose([2.0, 0.0, 0.0]))


def test_extrapolation_warns_once_per_simulator() -> None:
    scene = rc.Scene([wall("plywood"), wall("plywood"), wall("brick"), wall("concrete")])
    view: Any = {"resolution": 4, "field_of_view_deg": (60.0, 60.0)}
    for _ in range(2):
        simulator = rc.Simulator(scene, RADAR, **view)
        with pytest.warns(UserWarning, match=r"materials: extrapolated to 61 GHz") as caught:
            simulator.frame()
        assert [str(w.message) for w in caught] == [
            "materials: extrapolated to 61 GHz: plywood (known at 1 to 40 GHz), brick (known at 1 to 40 GHz)"
        ]
        assert caught[0].filename == __file__
        simulator.frame()  # warnings are errors here
        simulator.paths()
        simulator.depth_image()
    with pytest.warns(UserWarning, match="pmma .known at 11 GHz"):
        rc.Simulator(rc.Scene([wall("pmma")]), RADAR, **view).depth_image()
    rc.Simulator(rc.Scene(map(wall, ("concrete", "skin", "marble", "pla"))), RADAR, **view).frame()


def test_lambertian_surface_has_no_mirror_image() -> None:
    matt = rc.Material.lambertian(0.3)
    assert (matt.reflection, matt.albedo, matt.reflectance) == (0.0, 0.3, 0.3)
    assert rc.Material() == rc.Material(-1.0, 0.0) == rc.materials["perfect_conductor"]


def test_library_is_a_mapping_that_cannot_be_changed() -> None:
    assert len(rc.materials) == len(list(rc.materials)) == len(dict(rc.materials)) == 21
    assert "metal" in rc.materials
    assert "unobtainium" not in rc.materials
    assert rc.materials.get("unobtainium") is None
    assert all(isinstance(material, rc.Material) for material in rc.materials.values())
    assert "concrete" in repr(rc.materials)
    with pytest.raises(TypeError):
        rc.materials["metal"] = rc.Material()  # type: ignore[index]


@pytest.mark.parametrize(
    ("name", "near"),
    [("conrete", "'concrete'"), ("Metal", "'metal'"), ("polystyrol", "'polystyrene'")],
)
def test_unknown_name_is_an_error_that_names_near_ones(name: str, near: str) -> None:
    with pytest.raises(KeyError, match=f"no material '{name}'; did you mean .*{near}"):
        rc.materials[name]


def test_all_the_power_and_no_more_may_come_back() -> None:
    assert rc.Material(0.6, 0.64).reflectance == pytest.approx(1.0, rel=1e-15)
    assert rc.Material(np.exp(1j), 0.0).reflectance == pytest.approx(1.0, rel=1e-15)
    with pytest.raises(ValueError, match=r"reflection, albedo: expected abs\(reflection\)\*\*2 \+ albedo.*got 1.01"):
        rc.Material(0.6, 0.65)


@pytest.mark.parametrize(
    ("make", "arguments", "error", "message"),
    [
        (rc.Material, (1.1,), ValueError, "reflection, albedo: expected.*at most 1, got 1.21"),
        (rc.Material, (complex(1e308, 1e308),), ValueError, "reflection, albedo: expected.*at most 1, got inf"),
        (rc.Material.dielectric, (2.0 + 0.1j,), ValueError, r"permittivity: expected eps' - j eps''.*got \(2\+0.1j\)"),
        (rc.Material.dielectric, (0.0,), ValueError, "permittivity: expected.*got 0.0"),
        (rc.materials["wood"].response, (60e9, 1.5), ValueError, "cos_incidence: expected cosines from 0 to 1, got 1"),
        (ColeCole, (4.0, ((32.0, -7e-12, 1.0),)), ValueError, r"relaxations: expected steps .*got \(32.0, -7e-12"),
        (ColeCole, (4.0, ((32.0, 7e-12, 1.5),)), ValueError, "exponents up to 1"),
        (rc.materials["perfect_conductor"].with_surface, (), ValueError, "permittivity: expected a dielectric, got"),
        (
            partial(rc.Material.dielectric, 2.5, scattering=0.5, roughness=1e-4),
            (),
            ValueError,
            "scattering: expected either scattering or roughness",
        ),
        (
            partial(rc.Material.dielectric, 2.5, valid_frequency=(60e9, 1e9)),
            (),
            ValueError,
            r"valid_frequency: expected lowest and highest frequency \[Hz\]",
        ),
        (
            partial(rc.Material().response, polarization="vertical"),
            (60e9,),
            ValueError,
            "polarization: expected None, 'te' or 'tm', got 'vertical'",
        ),
    ],
)
def test_what_is_no_material_is_refused_with_its_name(
    make: Any, arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        make(*arguments)
