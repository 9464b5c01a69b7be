"""A part of docs/accuracy.md: dense integration and its closed forms, all views of real meshes, and what is quiet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from page import ACCURACY as PAGE
from proof import corners, oblique, real_meshes
from proof.bounds import mesh_bounds
from proof.closed_forms import lambertian_sphere_power, sphere_echo, square_echo
from proof.dense import Dense, dense
from proof.measure import (
    FULL,
    SPEED_OF_LIGHT,
    TINY,
    WAVEFORM,
    conductor,
    frequencies,
    simulator,
    transfer_function,
)
from proof.real_meshes import (
    DEFAULT,
    Sampled,
    View,
    ViewResult,
    Way,
    profile_errors,
    sampled,
    view_errors,
)
from radarcore.models import Human, robots

needs_robots = pytest.mark.skipif(not robots.is_available(), reason=real_meshes.INSTALL_HINT)

FREQUENCIES = frequencies(real_meshes.WAVEFORM)
WAVENUMBERS = 2.0 * np.pi * FREQUENCIES / SPEED_OF_LIGHT

# Twice as far apart as on the page: 2 to 4 % off on real meshes, a tenth of the errors that are looked for.
PITCH, SHIFTS = 4e-4, 8


def integrated(scene: rc.Scene) -> Dense:
    return real_meshes.integrated(View("", "", scene, real_meshes.RADAR, rc.Pose()), PITCH, SHIFTS)


@cache
def views() -> dict[str, View]:
    """All views of the page by group and name."""
    return {f"{view.group}, {view.name}": view for view in real_meshes.views(FULL)}


@cache
def stored(name: str) -> Dense:
    reference = real_meshes.stored_reference(views()[name])
    assert reference is not None, "other meshes or poses: python benches/references.py --write"
    return reference


# --- dense integration ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "expected", "bound"),
    [
        # Rays are too far apart at the limb, which is a polygon even of 81 920 facets.
        (lambda: rc.shapes.sphere(0.1, subdivisions=6), lambda: sphere_echo(0.1, 1.0, WAVENUMBERS), 0.03),
        # Rays fall on either side of the rim to 0.4 mm: of 10 cm along each of two axes, and evenly in eight images.
        (lambda: rc.shapes.plate(0.2, 0.2), lambda: square_echo(0.2, 1.0, 0.0, WAVENUMBERS), 0.004),
    ],
    ids=["sphere", "plate"],
)
def test_dense_integration_is_the_closed_form(
    mesh: Callable[[], rc.Mesh], expected: Callable[[], NDArray[np.complex128]], bound: float
) -> None:
    got = integrated(rc.Scene([conductor(mesh(), 1.0)]))
    assert profile_errors(got.transfer_function, expected(), 0.0, 2.0).relative <= bound


def test_dense_integration_counts_reflection_gain_and_what_is_hidden() -> None:
    plate = rc.shapes.plate(0.2, 0.2)
    wall = rc.Body(rc.shapes.plate(6.0, 6.0), material=rc.Material(0.5), motion=rc.Pose([2.0, 0.0, 0.0]))
    bare, pattern = conductor(plate, 1.0), rc.GaussianPattern(16.0, 30.0, 30.0)
    alone, both = (
        dense(
            rc.Scene(bodies),
            rc.Radar(real_meshes.WAVEFORM, pattern=pattern),
            rc.Pose(),
            pitch=2e-3,
            shifts=2,
            background=background,
        )
        for bodies, background in (([bare], ()), ([bare, wall], (1,)))
    )
    assert (alone.nearest, both.nearest) == pytest.approx((1.0, 1.0), abs=1e-3)
    assert both.farthest == pytest.approx(2.0 / np.cos(np.deg2rad(30.0)) ** 2, rel=0.1)
    # A gain of 16 dB there and back is 39.8 in amplitude, less 4 ln 2 (5.7 / 30)^2 at the edges.
    isotropic = dense(rc.Scene([bare]), real_meshes.RADAR, rc.Pose(), pitch=2e-3, shifts=2)
    ratio = np.abs(alone.transfer_function).mean() / np.abs(isotropic.transfer_function).mean()
    assert ratio == pytest.approx(10.0**1.6, rel=0.1)
    # Before the wall's own echo, a mirror of -6 dB, nothing has changed.
    ranges = real_meshes.ranges()
    profiles = [np.abs(real_meshes.profile(x.transfer_function)) for x in (alone, both)]
    near, far = ranges < 1.5, (ranges > 1.5) & (ranges < 3.0)
    assert profiles[1][near].max() == pytest.approx(profiles[0][near].max(), rel=1e-3)
    assert profiles[1][far].max() > 100.0 * profiles[0][far].max()


def test_dense_integration_refuses_a_body_that_the_image_cuts() -> None:
    plate = rc.Body(rc.shapes.plate(0.2, 0.2), motion=rc.Pose([1.0, np.tan(np.deg2rad(30.0)), 0.0]), name="sign")
    with pytest.raises(ValueError, match="expected bodies within the field of view, got sign at its border"):
        dense(rc.Scene([plate]), real_meshes.RADAR, rc.Pose(), pitch=2e-3, shifts=2)


# --- errors of profiles --------------------------------------------------------------------------------------------


def point_at(distance: float) -> NDArray[np.complex128]:
    return np.exp(-2j * WAVENUMBERS * distance)


def test_profile_at_half_its_level_is_six_decibels_off_and_half_wrong() -> None:
    expected = point_at(1.0) + 0.2 * point_at(2.0)
    same, half = (profile_errors(scale * expected, expected, 0.5, 3.0) for scale in (1.0, 0.5))
    assert (same.strongest, same.peaks, same.relative, same.floor) == (0.0, 0.0, 0.0, -np.inf)
    assert (half.strongest, half.peaks, half.relative) == pytest.approx((-6.0206, 6.0206, 0.5), abs=1e-4)


def test_a_wrong_weak_peak_is_an_error_of_peaks_alone() -> None:
    expected = point_at(1.0) + 0.2 * point_at(2.0)
    errors = profile_errors(point_at(1.0) + 0.1 * point_at(2.0), expected, 0.5, 3.0)
    # Two peaks: one right, one 6 dB off. A tenth of an amplitude is missing, re root(1 + 0.04).
    assert (errors.strongest, errors.peaks) == pytest.approx((0.0, 6.0206 / np.sqrt(2.0)), abs=1e-3)
    assert errors.relative == pytest.approx(0.1 / np.sqrt(1.04), rel=1e-6)


def test_floor_is_the_level_of_echoes_where_there_are_none() -> None:
    # Every 1 cm, closer than a range bin, so that the false floor is even: as high as the sum of some within a bin.
    false = sum(point_at(r) for r in np.arange(1.5, 2.5, 0.01))
    level = np.abs(real_meshes.profile(false))[(real_meshes.ranges() > 1.7) & (real_meshes.ranges() < 2.3)]
    peak = np.abs(real_meshes.profile(point_at(1.0))).max()
    scale = 1e-3 * peak / np.sqrt(np.mean(level**2))
    errors = profile_errors(point_at(1.0) + scale * false, point_at(1.0), 1.7, 2.3)
    assert errors.floor == pytest.approx(-60.0, abs=0.1)
    assert abs(errors.strongest) < 1e-6


# --- real meshes ---------------------------------------------------------------------------------------------------

NAMES = [
    *(f"arm at 1.2 m, posture {number}" for number in (1, 2, 3, 4)),
    *(f"human at 2.5 m, heading {heading:g}°" for heading in real_meshes.HEADINGS_DEG),
    *(f"room with both, view {number}" for number in (1, 2)),
]


@needs_robots
def test_references_that_are_kept_are_those_of_the_views_of_the_page() -> None:
    assert list(views()) == NAMES
    for name in NAMES:
        reference = stored(name)
        halves = [real_meshes.profile(half) for half in reference.halves]
        assert np.linalg.norm(halves[0] - halves[1]) < 0.04 * np.linalg.norm(halves[0] + halves[1]), name


@needs_robots
@pytest.mark.parametrize(
    ("name", "pitch"), [("arm at 1.2 m, posture 4", 1.4 * PITCH), ("human at 2.5 m, heading 90°", PITCH)]
)
def test_reference_that_is_kept_is_the_dense_integration(name: str, pitch: float) -> None:
    reference, again = stored(name), real_meshes.integrated(views()[name], pitch, SHIFTS)
    errors = profile_errors(again.transfer_function, reference.transfer_function, again.nearest, again.farthest)
    assert errors.relative < 0.04
    assert abs(errors.strongest) < 0.05


@needs_robots
def test_moved_bodies_have_no_reference() -> None:
    view = views()[NAMES[4]]
    moved = replace(view, radar_motion=rc.Pose([0.0, 1e-4, 0.9]))
    assert real_meshes.stored_reference(moved) is None


@needs_robots
@pytest.mark.parametrize("name", NAMES)
def test_default_frame_of_every_view_is_as_exact_as_the_page_says(name: str) -> None:
    view, reference = views()[name], stored(name)
    errors = sampled(view, DEFAULT, reference).errors
    own = view_errors(PAGE.read_text(encoding="utf-8"))[name]
    # The page's own number, with what it is rounded to.
    assert abs(errors.strongest) <= 1.3 * abs(own.strongest) + 0.02
    assert errors.peaks <= 1.3 * own.peaks + 0.02
    assert errors.relative <= 1.3 * own.relative + 0.001
    assert errors.floor <= own.floor + 20.0 * np.log10(1.3) + 0.1
    # And its bounds.
    bounds = mesh_bounds([ViewResult(view.group, view.name, [Sampled(DEFAULT, 0, 0.0, errors)], [], 0.0, 0)])
    broken = [f"{bound.what}: {bound.quantity}" for bound in bounds if not bound.is_held]
    assert broken == []


@needs_robots
def test_a_lower_floor_brings_every_arm_and_human_nearer_to_the_reference() -> None:
    for name in NAMES[:8]:
        view, reference = views()[name], stored(name)
        coarse, fine = (sampled(view, Way("adaptive", "floor", floor), reference).errors for floor in (0.1, 1e-3))
        assert fine.relative < 0.75 * coarse.relative, name


@needs_robots
def test_footprints_of_a_real_mesh_converge_and_points_do_not_yet() -> None:
    name = "human at 2.5 m, heading 90°"
    relative = {
        (sampling, side): sampled(views()[name], Way(sampling, "pixels", side), stored(name)).errors.relative
        for sampling, side in (("footprint", 256), ("footprint", 1024), ("point", 512))
    }
    assert relative["footprint", 1024] <= 0.12
    assert relative["footprint", 1024] < 0.3 * relative["footprint", 256]
    assert relative["point", 512] >= 1.0


@needs_robots
def test_frames_of_a_real_mesh_are_the_sum_over_their_paths() -> None:
    # Walls have points of order 1, all else of order 0.
    view = views()["room with both, view 1"]
    sim = rc.Simulator(view.scene, view.radar, radar_motion=view.radar_motion, tolerance=1e-6, rcs_floor=1e-2)
    paths = sim.paths()
    assert {0, 1} <= set(paths.order[0].tolist())
    some = FREQUENCIES[::64, None]
    weights = (view.radar.waveform.center_frequency / some) ** paths.order[0]
    expected = (weights * np.exp(-2j * np.pi * some * paths.delay[0])) @ paths.amplitude[0]
    got = transfer_function(sim)[::64]
    # Samples have the residual video phase of pi S delay^2, up to 1.5e-5 rad in this room.
    np.testing.assert_allclose(got, expected, atol=2e-5 * np.linalg.norm(paths.amplitude[0]))


# --- corners, walls, Doppler, matt sphere --------------------------------------------------------------------------


@pytest.mark.parametrize("polarization", [None, "vertical", "horizontal"])
@pytest.mark.parametrize("name", corners.ON_PAPER)
def test_corner_of_few_rays_has_its_far_field_level_and_phase(name: str, polarization: str | None) -> None:
    mesh = rc.shapes.dihedral(0.1) if name == "dihedral" else rc.shapes.trihedral(0.1, shape=name.split()[0])
    run = replace(TINY, corner_side=128)
    on_paper = 10.0 * np.log10(corners.ON_PAPER[name])
    got = corners.corner(run, name, mesh, corners.FAR, polarization, "footprint", on_paper)
    assert got.level == pytest.approx(on_paper, abs=0.3)
    # 10 cm at 100 m: waves lag by k b^2 / d = 0.03 rad at the rims of the largest, and rims are staircases.
    assert got.phase == pytest.approx(0.0, abs=0.1)


def test_doppler_floor_is_that_of_the_window_whatever_the_sampling() -> None:
    # Those of one frame come first.
    levels = {row.sampling: row.level for row in islice(oblique.doppler_results(replace(TINY, chirps=128)), 3)}
    assert set(levels) == {"point", "footprint", "adaptive"}
    assert max(levels.values()) <= -65.0


def test_default_maps_of_a_walking_person_are_those_of_a_thousandfold_lower_floor() -> None:
    # A plate behind the person, so that the floor is the default one and not lowered by the strongest echo. Over what
    # moves: 8.2 % of the norm (rms of the steps), 10.2 % with four times the default floor.
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    radar = replace(radar, receiver=None)
    walker = Human(speed=1.3, path=[[3.2, -1.2], [2.2, 1.2]])
    scene = rc.Scene([*walker.bodies(subdivisions=3), conductor(rc.shapes.plate(1.0, 1.0), 5.0)])
    moves = np.abs(radar.waveform.velocity_axis()) > 0.4

    def maps(**options: Any) -> NDArray[np.complex128]:
        sim = rc.Simulator(scene, radar, radar_motion=rc.Pose([0.0, 0.0, 1.0]), **options)
        cubes = (sim.frame(0.1 + 0.2 * step).cube for step in range(6))
        return np.stack([rc.range_doppler(cube, radar.waveform)[:, moves].ravel() for cube in cubes])

    fine = maps(rcs_floor=1e-5, ray_budget=np.inf)
    errors = np.linalg.norm(maps() - fine, axis=1) / np.linalg.norm(fine, axis=1)
    assert np.sqrt(np.mean(errors**2)) < 0.09


def test_mean_power_of_a_matt_sphere_is_that_of_its_paths() -> None:
    on_paper = lambertian_sphere_power(1.0, 0.3, 2.0)
    assert on_paper * (SPEED_OF_LIGHT / 60e9 / WAVEFORM.wavelength) ** 2 == pytest.approx(7.656712e-10, rel=1e-6)
    ball = rc.Body(rc.shapes.sphere(0.3), material=rc.Material.lambertian(1.0), motion=rc.Pose([2.0, 0.0, 0.0]))
    paths = simulator(ball, sampling="footprint", resolution=256).paths()
    assert (np.abs(paths.amplitude) ** 2).sum() == pytest.approx(on_paper, rel=0.01)
