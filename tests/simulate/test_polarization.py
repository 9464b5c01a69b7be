"""Echoes of dielectrics, rough or smooth, and what polarised antennas get of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import radarcore as rc

GLASS = rc.Material.dielectric(2.25)
CONDUCTOR = rc.materials["perfect_conductor"]

sphere = cache(rc.shapes.sphere)


def fresnel(eps: complex, cosine: Any) -> tuple[Any, Any]:
    """r_TE and r_TM of a half-space."""
    q = np.sqrt(eps - 1.0 + np.square(cosine) + 0j)
    return (cosine - q) / (cosine + q), (eps * cosine - q) / (eps * cosine + q)


def mean(te: Any, tm: Any) -> Any:
    """Reflection coefficient of the mean power of both polarisations, at the phase of TE."""
    return te / np.abs(te) * np.sqrt(0.5 * (np.abs(te) ** 2 + np.abs(tm) ** 2))


def waveform(frequency: float = 60e9) -> rc.Waveform:
    return rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)


def echo(
    material: rc.Material,
    *,
    polarization: Any = None,
    antennas: Any = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    size: float = 0.2,
    **options: Any,
) -> complex:
    """Phasor of a plate at 1 m, at one frequency."""
    plate = rc.Body(rc.shapes.plate(size, size), material=material, motion=rc.Pose([1.0, 0.0, 0.0]))
    radar = rc.Radar(waveform(), tx=[antennas[0]], rx=[antennas[1]], polarization=polarization)
    settings: dict[str, Any] = {"resolution": 128, "field_of_view_deg": (15.0, 15.0), "tolerance": 1e-9} | options
    return complex(np.conj(rc.Simulator(rc.Scene([plate]), radar, **settings).frame().cube[0, 0, 0]))


@pytest.mark.parametrize("name", ["wood", "concrete", "skin", "metal"])
def test_every_polarisation_sees_the_same_of_a_plate_at_normal_incidence(name: str) -> None:
    material = rc.materials[name]
    scalar, vertical = echo(material), echo(material, polarization="vertical")
    # The plate is seen at up to 8 degrees: its rim differs between polarisations by sin^4 = 4e-4, and
    # not at all where turning the square plate by 90 degrees exchanges them.
    for polarization in ("vertical", "horizontal", [0.0, 0.6, 0.8]):
        assert echo(material, polarization=polarization) == pytest.approx(scalar, rel=5e-4)
    for polarization in ("horizontal", [0.0, 1.0, 0.0]):
        assert echo(material, polarization=polarization) == pytest.approx(vertical, rel=1e-5)


def bistatic(degrees: float) -> Any:
    """Antennas that see a plate at 1 m as each other's mirror image at an angle of incidence."""
    side = np.tan(np.deg2rad(degrees))
    return (0.0, -side, 0.0), (0.0, side, 0.0)


@pytest.mark.filterwarnings("ignore:tx, rx. expected antennas within")
@pytest.mark.parametrize("degrees", [20.0, 45.0, 65.0])
def test_plate_between_two_antennas_reflects_at_half_the_angle_between_them(degrees: float) -> None:
    te, tm = fresnel(2.25, np.cos(np.deg2rad(degrees)))
    for polarization, expected in ((None, mean(te, tm)), ("vertical", te), ("horizontal", -tm)):
        settings: dict[str, Any] = {"polarization": polarization, "antennas": bistatic(degrees), "resolution": 256}
        ratio = -echo(GLASS, **settings) / echo(CONDUCTOR, **settings)
        # The angle varies by 6 degrees over the plate, evenly about the mirror point.
        assert abs(ratio - expected) <= 0.01


def image(polarization: Any, **keywords: Any) -> rc.DepthImage:
    material = rc.Material.dielectric(2.25, **keywords)
    wall = rc.Body(rc.shapes.plate(40.0, 40.0), material=material, motion=rc.Pose([2.0, 0.0, 0.0]))
    radar = rc.Radar(waveform(), polarization=polarization)
    return rc.Simulator(rc.Scene([wall]), radar, resolution=63, field_of_view_deg=(120.0, 120.0)).depth_image()


def test_reflectance_of_an_image_is_that_of_the_angle_and_the_polarisation() -> None:
    te, tm = fresnel(2.25, image(None).cos_incidence)
    scalar = np.abs(mean(te, tm)) ** 2
    # Roughness moves power from the mirror image to the diffuse part, no more.
    for keywords in ({}, {"roughness": 3e-4}, {"scattering": 0.7}):
        np.testing.assert_allclose(image(None, **keywords).reflectance, scalar, rtol=1e-9)
    vertical, horizontal = image("vertical").reflectance, image("horizontal").reflectance
    middle = 31  # rays that leave horizontally, and upright rays
    np.testing.assert_allclose(vertical[middle], np.abs(te[middle]) ** 2, rtol=1e-9)
    np.testing.assert_allclose(horizontal[middle], np.abs(tm[middle]) ** 2, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(vertical[:, middle], np.abs(tm[:, middle]) ** 2, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(horizontal[:, middle], np.abs(te[:, middle]) ** 2, rtol=1e-9)
    np.testing.assert_allclose(vertical, horizontal.T, rtol=1e-9)


@pytest.mark.filterwarnings("ignore:tx, rx. expected antennas within")
@pytest.mark.parametrize("polarization", [None, "vertical", [0.0, 0.6, 0.8]])
@pytest.mark.parametrize("sampling", ["footprint", "adaptive"])
def test_transmitter_and_receiver_may_change_places(sampling: str, polarization: Any) -> None:
    rough = rc.materials["concrete"].with_surface(roughness=3e-4)
    bodies = [
        rc.Body(
            rc.shapes.box((0.3, 0.5, 0.4)), material=rough, motion=rc.Pose.from_rpy([1.5, -0.3, 0.1], [0.2, 0.5, 0.3])
        ),
        rc.Body(sphere(0.2), material=rc.materials["skin"], motion=rc.Pose([1.2, 0.4, 0.0])),
        rc.Body(rc.shapes.plate(0.5, 0.5), material=rc.Material.lambertian(0.5), motion=rc.Pose([2.2, 0.0, 0.0])),
    ]
    one, other = [[0.0, -0.4, 0.1]], [[0.1, 0.3, 0.0]]
    there, back = (
        rc.Simulator(
            rc.Scene(bodies),
            rc.Radar(waveform(), tx=tx, rx=rx, polarization=polarization),
            sampling=sampling,
            resolution=64,
            rcs_floor=1e-3,
            tolerance=1e-12,
        )
        .paths()
        .amplitude
        for tx, rx in ((one, other), (other, one))
    )
    np.testing.assert_allclose(there, back, rtol=1e-9, atol=1e-9 * np.abs(there).max())


def test_material_follows_the_radars_band() -> None:
    plate = rc.Body(rc.shapes.plate(0.2, 0.2), material=rc.materials["skin"], motion=rc.Pose([1.0, 0.0, 0.0]))
    for frequency in (24e9, 60e9, 77e9):
        simulator = rc.Simulator(rc.Scene([plate]), rc.Radar(waveform(frequency)), resolution=3)
        reflection, _ = rc.materials["skin"].response(simulator.radar.waveform.center_frequency)
        assert simulator.depth_image().reflectance[1, 1] == pytest.approx(abs(reflection) ** 2, rel=1e-12)
        assert simulator.with_radar(rc.Radar(waveform(40e9))).depth_image().reflectance[1, 1] == pytest.approx(
            abs(rc.materials["skin"].response(40e9)[0]) ** 2, rel=1e-9
        )


@pytest.mark.parametrize("max_bounces", [1, 3])
def test_power_without_a_polarisation_is_the_mean_over_both(max_bounces: int) -> None:
    # Matt concrete at 70 degrees, where the fields of both polarisations have opposite signs.
    concrete = rc.materials["concrete"].with_surface(scattering=1.0)
    turned = rc.Pose.from_rpy([2.0, 0.0, 0.0], [0.0, 0.0, np.deg2rad(70.0)])
    scene = rc.Scene([rc.Body(rc.shapes.plate(0.3, 0.3), material=concrete, motion=turned)])

    def power(polarization: Any) -> float:
        radar = rc.Radar(waveform(), polarization=polarization)
        cubes = [rc.Simulator(scene, radar, seed=seed, max_bounces=max_bounces).frame().cube for seed in range(3)]
        return float(np.mean(np.abs(cubes) ** 2))

    both = 0.5 * (power("vertical") + power("horizontal"))
    assert 10.0 * np.log10(power(None) / both) == pytest.approx(0.0, abs=0.1)
