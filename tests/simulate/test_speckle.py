"""Matt surfaces: expected power, its distribution, and phases that stay with the surface, in pixels and in cells."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest
from test_closed_forms import lambertian_disc

import radarcore as rc

SAMPLINGS: dict[str, dict[str, Any]] = {
    "footprint": {"sampling": "footprint", "resolution": 64},
    "adaptive": {"sampling": "adaptive", "rcs_floor": 1e-3},
}
WHITE = rc.Material.lambertian(1.0)
TONE = rc.Waveform(start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1)
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=128, num_chirps=64, chirp_interval=300e-6
)


def matt(mesh: rc.Mesh, motion: Any) -> rc.Body:
    return rc.Body(mesh, material=WHITE, motion=rc.Pose(motion) if isinstance(motion, list) else motion)


def simulator(bodies: list[rc.Body], waveform: rc.Waveform = TONE, **options: Any) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), rc.Radar(waveform), **options)


def expected_power(paths: rc.Paths) -> float:
    """Mean over all phases that surface points may have [W]: paths of one phase, of one point, add up like fields."""
    amplitude = paths.amplitude[0]
    _, points = np.unique(np.round(1e9 * np.angle(amplitude)), return_inverse=True)
    fields = amplitude * np.exp(-2j * np.pi * 60e9 * paths.delay[0])
    sums = np.bincount(points, fields.real) + 1j * np.bincount(points, fields.imag)
    return float((np.abs(sums) ** 2).sum())


# Mesh, distance of its centre, field of view, mean power on paper. Pixels of the small disc become finer than the
# patches that share a phase.
TARGETS = {
    "disc b=0.1 d=1": (lambda: rc.shapes.disc(0.1), 1.0, 13.0, 1.557552e-09),
    "disc b=0.02 d=1": (lambda: rc.shapes.disc(0.02), 1.0, 2.5, lambertian_disc(0.02, 1.0)),
    "sphere a=0.3 D=2": (lambda: rc.shapes.sphere(0.3, subdivisions=5), 2.0, 18.0, 7.656712e-10),
}


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.parametrize(
    "levels",
    [
        [{"sampling": "footprint", "resolution": 64 * 2**n} for n in range(4)],
        [{"sampling": "adaptive", "rcs_floor": 1e-3 / 4.0**n} for n in range(5)],
    ],
    ids=["footprint", "adaptive"],
)
def test_expected_power_changes_by_less_than_a_tenth_of_a_db_from_level_to_level(
    levels: list[dict[str, Any]], name: str
) -> None:
    mesh, x, field_of_view_deg, on_paper = TARGETS[name]
    body, window = matt(mesh(), [x, 0.0, 0.0]), (field_of_view_deg, field_of_view_deg)
    powers = [
        expected_power(simulator([body], field_of_view_deg=window, **options).paths()) / on_paper for options in levels
    ]
    assert np.abs(10.0 * np.log10(powers)).max() < 0.1
    assert np.abs(np.diff(10.0 * np.log10(powers))).max() < 0.1


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_intensity_is_exponentially_distributed_over_seeds(sampling: str) -> None:
    disc = matt(rc.shapes.disc(0.1), [1.0, 0.0, 0.0])
    options: dict[str, Any] = SAMPLINGS[sampling] | {"field_of_view_deg": (13.0, 13.0)}
    sim = simulator([disc], **options | {"resolution": 32})
    samples = [replace(sim, seed=seed).frame().cube[0, 0, 0] for seed in range(400)]
    intensity = np.abs(samples) ** 2 / lambertian_disc(0.1, 1.0)
    # Kolmogorov and Smirnov's distance to 1 - exp(-x), its mean included: beyond this in one of a thousand cases.
    assert kstest(intensity, "expon").statistic < 1.95 / np.sqrt(len(intensity))


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_matt_plate_that_recedes_is_one_line_of_doppler(sampling: str) -> None:
    velocity = 8.37 * WAVEFORM.velocity_resolution  # 1.08 m/s, between two bins
    assert velocity == pytest.approx(1.0, abs=0.1)
    plate = matt(rc.shapes.plate(0.1, 0.1), rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[velocity, 0.0, 0.0]))
    frame = simulator([plate], WAVEFORM, field_of_view_deg=(10.0, 10.0), **SAMPLINGS[sampling]).frame()
    power = np.abs(rc.range_doppler(frame.cube, WAVEFORM)[0]) ** 2
    row, _ = np.unravel_index(power.argmax(), power.shape)
    assert abs(WAVEFORM.velocity_axis()[row] - velocity) <= 0.5 * WAVEFORM.velocity_resolution
    # Beyond the window of Hann; phases tossed in every chirp would be noise above -30 dB.
    is_far = np.abs(np.arange(len(power)) - row) >= 10
    assert 10.0 * np.log10(power[is_far].max() / power.max()) <= -65.0


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_speckle_of_what_rests_is_the_same_in_every_frame_whatever_moves_beside_it(sampling: str) -> None:
    rests = matt(rc.shapes.plate(0.2, 0.2), [2.0, 0.2, 0.0])
    moves = matt(rc.shapes.sphere(0.05), rc.Linear(rc.Pose([1.5, -0.4, 0.0]), velocity=[0.0, 0.5, 0.3]))
    sim = simulator([rests, moves], field_of_view_deg=(40.0, 40.0), **SAMPLINGS[sampling])
    first, later = sim.paths(0.0), sim.paths(0.4)
    of_rests = [paths.body[0] == 0 for paths in (first, later)]
    assert of_rests[0].sum() > 50
    for name in ("delay", "amplitude"):
        kept, again = (getattr(paths, name)[0, those] for paths, those in zip((first, later), of_rests, strict=True))
        np.testing.assert_array_equal(kept, again)
        assert not np.array_equal(getattr(first, name)[0, ~of_rests[0]], getattr(later, name)[0, ~of_rests[1]])


def test_speckle_moves_with_its_body_from_frame_to_frame() -> None:
    # 25 mm farther in the next of 40 frames per second: the phase follows the distance, 62.9 rad.
    velocity = np.array([1.0, 0.0, 0.0])
    plate = matt(rc.shapes.plate(0.1, 0.1), rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=velocity))
    options: dict[str, Any] = SAMPLINGS["adaptive"] | {"field_of_view_deg": (10.0, 10.0)}
    product = power = 0.0
    for seed in range(8):
        sim = simulator([plate], seed=seed, **options)
        first, later = (
            (paths.amplitude[0] * np.exp(-2j * np.pi * 60e9 * paths.delay[0])).sum()
            for paths in (sim.paths(0.0), sim.paths(0.025))
        )
        way = 2.0 * 0.025 * TONE.start_frequency / 299_792_458.0  # [turns]
        product += later * np.conj(first) * np.exp(2j * np.pi * way)
        power += abs(first) * abs(later)
    assert abs(product) / power > 0.99
    assert abs(np.angle(product)) < 0.1


@pytest.mark.parametrize("sampling", ["adaptive", "footprint"])
def test_bodies_of_equal_meshes_have_speckle_of_their_own(sampling: str) -> None:
    # Mirror images of each other: with equal speckle their echoes would be equal, and add up to four times the power.
    plate = rc.shapes.plate(0.3, 0.3)
    places = [rc.Pose([2.0, 0.5, 0.0]), rc.Pose([2.0, -0.5, 0.0])]

    both = [matt(plate, place) for place in places]
    options: dict[str, Any] = {"sampling": sampling, "field_of_view_deg": (40.0, 30.0), "resolution": 64}
    alone = [expected_power(simulator([body], **options).paths()) for body in both]
    sim = simulator(both, **options)
    cubes = [replace(sim, seed=seed).frame().cube for seed in range(60)]
    # Three standard deviations of the mean of 60 exponentially distributed intensities.
    assert np.mean(np.abs(cubes) ** 2) == pytest.approx(sum(alone), rel=3.0 / np.sqrt(60.0))
    # Other bodies change nothing of that.
    other = rc.Body(rc.shapes.sphere(0.05), material=rc.Material(0.0), motion=rc.Pose([3.0, 0.0, 0.7]))
    cubes = [simulator(bodies, **options).frame().cube for bodies in (both, [other, *both])]
    np.testing.assert_allclose(cubes[1], cubes[0], atol=1e-4 * np.abs(cubes[0]).max())
