"""Exact surfaces of the accuracy tables: quadratures against closed forms, and frames of meshes against both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from proof import embree, real_meshes
from proof.bounds import SURFACE_BOUNDS
from proof.closed_forms import cylinder_echo, sphere_echo
from proof.dense import facets
from proof.exact import Arc, Ellipsoid, Line, ellipsoid_nodes, exact_echo, is_occluded, revolution_nodes
from proof.measure import FULL, SPEED_OF_LIGHT, conductor, frequencies
from proof.real_meshes import DEFAULT, RADAR, WAVEFORM, View, profile_errors, sampled
from proof.surfaces import FINE, SPAN, Dense, Target, targets

AHEAD, UPRIGHT = np.array([1.0, 0.0, 0.0]), np.eye(3)


def difference(got: NDArray[np.complex128], expected: NDArray[np.complex128]) -> float:
    return float(np.linalg.norm(got - expected) / np.linalg.norm(expected))


# Distances are counted in cells of 10 um, over which a phase turns by 0.028: a share of its square.
COUNTED = 4e-4


def test_quadratures_are_the_closed_forms_of_a_sphere_and_a_tube() -> None:
    expected = sphere_echo(0.1, 1.0, 2.0 * np.pi * frequencies(WAVEFORM) / SPEED_OF_LIGHT)
    ball = ellipsoid_nodes([Ellipsoid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))], AHEAD, UPRIGHT, 200)
    assert difference(exact_echo(ball, WAVEFORM), expected) < COUNTED
    # Two half-spheres, whose lit parts end between nodes.
    halves = [Arc((0.0, 0.0), 0.1, -0.5 * np.pi, 0.0), Arc((0.0, 0.0), 0.1, 0.0, 0.5 * np.pi)]
    turned = revolution_nodes(halves, AHEAD, UPRIGHT, 300)
    assert difference(exact_echo([turned], WAVEFORM), expected) < COUNTED
    side = revolution_nodes([Line((0.05, -0.15), (0.05, 0.15))], AHEAD, UPRIGHT, 300)
    # Of 64 frequencies.
    assert difference(exact_echo([side], WAVEFORM)[::8], cylinder_echo(0.05, 0.3, 1.0)) < COUNTED


def test_what_an_ellipsoid_hides_does_not_count() -> None:
    front, behind = Ellipsoid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1)), Ellipsoid((0.5, 0.0, 0.0), (0.1, 0.1, 0.1))
    both, alone = (
        exact_echo(ellipsoid_nodes(some, AHEAD, UPRIGHT, 100), WAVEFORM) for some in ([front, behind], [front])
    )
    np.testing.assert_array_equal(both, alone)
    # Seen from behind, in the opposite order: no body is on the line to the radar of points beside it.
    matrix = 0.1 * UPRIGHT
    points = np.array([[2.0, 0.0, 0.0], [2.0, 0.3, 0.0], [0.5, 0.0, 0.0], [2.0, 0.19, 0.0]])
    assert is_occluded(points, [(AHEAD, matrix)]).tolist() == [True, False, False, True]


@pytest.mark.parametrize("target", list(targets(FULL)), ids=lambda target: target.name)
def test_default_frame_of_any_mesh_holds_the_bounds_of_the_page(target: Target) -> None:
    expected = replace(target, num_nodes=300).echo()
    reference = Dense((expected, expected), 0, *SPAN)
    strongest, profile = next(bounds for kind, bounds in SURFACE_BOUNDS.items() if target.name.startswith(kind))
    for fineness in range(FULL.finenesses):
        view = View("", "", target.scene(fineness), RADAR, rc.Pose())
        errors = sampled(view, DEFAULT, reference).errors
        assert abs(errors.strongest) <= strongest
        assert 100.0 * errors.relative <= profile
        if target.name.endswith(" 20°") and fineness == 1:
            assert sampled(view, FINE, reference).errors.relative < errors.relative


@pytest.mark.skipif(not embree.is_available(), reason=embree.INSTALL_HINT)
def test_distances_of_embree_give_the_same_profile_of_facets() -> None:
    bodies = [conductor(rc.shapes.capsule(0.06, 0.4), 1.2), conductor(rc.shapes.sphere(0.1), 1.5)]
    view = View("", "", rc.Scene(bodies), RADAR, rc.Pose())
    ours, theirs = (real_meshes.integrated(view, 2e-3, 4, tracer) for tracer in (facets, embree.embree_facets))
    assert profile_errors(theirs.transfer_function, ours.transfer_function, *SPAN).relative < 2e-3
