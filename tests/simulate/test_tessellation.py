"""Coarse meshes of curved bodies against the bodies themselves: turned parts and spheres, in pixels and in cells."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from test_adaptive import BAND, WAVEFORM, db, rms, spectrum
from test_closed_forms import CONDUCTOR, sphere

import radarcore as rc

# Fine enough for a width of 16 degrees at 1 m: the residual comes from the meshes.
SAMPLINGS: dict[str, dict[str, Any]] = {
    "footprint": {"sampling": "footprint", "resolution": 384},
    "adaptive": {"rcs_floor": 1e-5},
}
TUBE_RADIUS, FILLET, LENGTH = 0.06, 0.005, 0.2
ASPECTS_DEG = (0.0, 30.0, 45.0, 90.0)
"""From the side, onto the fillet in between, onto the cap."""
NOISE = 1e-4  # [m], rms along every axis


@cache
def tube(segments: int, steps: int, *, seed: int | None = None, shading: str = "smooth") -> rc.Mesh:
    """A round rod along z with filleted rims, as CAD programs export it; the seed draws the noise on its vertices.

    A cylinder is one long quad per segment, a fillet one ring of narrow ones per step, and a cap a fan of
    slivers from one vertex of its rim.
    """
    angle = np.deg2rad(np.linspace(0.0, 90.0, steps + 1))
    upper_radius = TUBE_RADIUS - FILLET + FILLET * np.cos(angle)
    upper_height = 0.5 * LENGTH - FILLET + FILLET * np.sin(angle)
    radius, height = np.append(upper_radius[::-1], upper_radius), np.append(-upper_height[::-1], upper_height)
    turn = 2.0 * np.pi * np.arange(segments) / segments
    x, y = np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn))
    vertices = np.stack([x, y, np.outer(height, np.ones(segments))], axis=-1).reshape(-1, 3)

    this = np.arange(segments)
    beside = (this + 1) % segments
    triangles = []
    for first in segments * np.arange(len(radius) - 1):
        above = first + segments
        triangles.append(np.stack([first + this, first + beside, above + beside], axis=1))
        triangles.append(np.stack([first + this, above + beside, above + this], axis=1))
    rim = np.arange(1, segments - 1)
    bottom, top = np.zeros_like(rim), np.full_like(rim, len(vertices) - segments)
    triangles += [np.stack([bottom, rim + 1, rim], axis=1), np.stack([top, top + rim, top + rim + 1], axis=1)]
    if seed is not None:
        vertices = vertices + np.random.default_rng(seed).normal(0.0, NOISE, vertices.shape)
    return rc.Mesh(vertices, np.concatenate(triangles), shading=shading)


def strongest_peak_db(mesh: rc.Mesh, aspect_deg: float, **options: Any) -> float:
    """Level of the strongest peak in the range profile of a mesh at 1 m whose axis is tilted towards the radar."""
    # Turned about its axis by less than half a segment, because symmetry is a special case.
    rotation = Rotation.from_euler("zy", [5.0, aspect_deg], degrees=True).as_matrix()
    target = rc.Body(mesh, material=CONDUCTOR, motion=rc.Pose([1.0, 0.0, 0.0], rotation))
    sim = rc.Simulator(rc.Scene([target]), rc.Radar(WAVEFORM), field_of_view_deg=(16.0, 16.0), **options)
    return float(db(np.abs(rc.range_profile(sim.frame().cube, WAVEFORM, num_bins=4096)).max()))


def peaks_db(mesh: rc.Mesh, **options: Any) -> NDArray[np.float64]:
    return np.array([strongest_peak_db(mesh, aspect_deg, **options) for aspect_deg in ASPECTS_DEG])


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_coarse_tube_echoes_as_a_fine_one(sampling: str) -> None:
    options = SAMPLINGS[sampling]
    fine = peaks_db(tube(512, 32), **options)
    # The requirement is 2 dB, 1 dB rms.
    assert np.abs(peaks_db(tube(32, 8), **options) - fine).max() <= 0.2
    # Facets alone are off by their sagitta, 0.3 mm and more: 0.75 rad there and back.
    assert rms(peaks_db(tube(32, 8, shading="flat"), **options) - fine) >= 0.8


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_noise_on_vertices_changes_each_peak_little_more_than_on_flat_facets(sampling: str) -> None:
    # Both are compared in the same pixels and cells, which may be coarser than where a mesh is compared with its solid.
    options = SAMPLINGS[sampling] | ({"resolution": 256} if sampling == "footprint" else {"rcs_floor": 1e-4})
    change = {}
    for shading in ("smooth", "flat"):
        clean = peaks_db(tube(32, 8, shading=shading), **options)
        noisy = [peaks_db(tube(32, 8, seed=seed, shading=shading), **options) for seed in range(3)]
        change[shading] = np.abs(np.array(noisy) - clean)
    assert rms(change["flat"]) > 0.3
    assert (change["smooth"] <= change["flat"] + 1.0).all()
    assert rms(change["smooth"]) <= rms(change["flat"]) + 0.1


@pytest.mark.parametrize(("subdivisions", "bound_db", "bound_phase"), [(2, 0.5, 0.2), (3, 0.3, 0.06)])
@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_coarse_sphere_is_a_sphere_however_it_is_turned(
    subdivisions: int, bound_db: float, bound_phase: float, sampling: str
) -> None:
    # 320 and 1280 facets, up to 1.8 and 0.46 mm inside the sphere of 10 cm: 4.6 and 1.2 rad there and back. With
    # area-weighted normals, which lean off the radius, some turns are off by more.
    mesh, expected = rc.shapes.sphere(0.1, subdivisions=subdivisions), [sphere(0.1, 1.0, f) for f in BAND]
    options = SAMPLINGS[sampling] | ({"resolution": 192} if sampling == "footprint" else {})
    # Normals belong to the mesh and not to the rays: cells see every second turn.
    turns = Rotation.random(8, rng=np.random.default_rng(0)).as_matrix()
    for rotation in turns if sampling == "footprint" else turns[::2]:
        ball = rc.Body(mesh, material=CONDUCTOR, motion=rc.Pose([1.0, 0.0, 0.0], rotation))
        sim = rc.Simulator(rc.Scene([ball]), rc.Radar(WAVEFORM), field_of_view_deg=(14.0, 14.0), **options)
        ratio = spectrum(sim) / expected
        assert np.abs(db(ratio)).max() <= bound_db
        assert np.abs(np.angle(ratio)).max() <= bound_phase
