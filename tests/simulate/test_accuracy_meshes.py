"""Tables of benches/results/accuracy.md: dense integration, all views of real meshes, echoes that vanish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from page import ACCURACY as PAGE
from proof import real_meshes
from proof.bounds import mesh_bounds
from proof.closed_forms import sphere_echo, square_echo
from proof.dense import Dense
from proof.measure import (
    FULL,
    SPEED_OF_LIGHT,
    conductor,
    frequencies,
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
from radarcore.models import robots

needs_robots = pytest.mark.skipif(not robots.is_available(), reason=real_meshes.INSTALL_HINT)

FREQUENCIES = frequencies(real_meshes.WAVEFORM)
WAVENUMBERS = 2.0 * np.pi * FREQUENCIES / SPEED_OF_LIGHT

# Twice the spacing of the page: errors of 2 to 4 % on real meshes, a tenth of the bounds.
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
        # Rays are too sparse at the limb, which is a polygon even of 81 920 facets.
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
def test_reference_that_is_kept_is_the_dense_integration() -> None:
    name = "arm at 1.2 m, posture 4"
    reference, again = stored(name), real_meshes.integrated(views()[name], 1.4 * PITCH, SHIFTS)
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


# --- corners, walls, Doppler, matt sphere --------------------------------------------------------------------------
