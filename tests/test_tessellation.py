"""Coarse meshes of curved bodies against the bodies themselves: tubes and spheres, in pixels and in cells."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import radarcore as rc
from test_adaptive import BAND, db, rms, spectrum
from test_bounces import BALL, RADIUS, SENSOR, image_of, phasors, reflected_by_ball, wall
from test_closed_forms import CONDUCTOR, sphere

# As fine as it takes for what is seen 16 degrees wide at 1 m: what is left are the meshes.
SAMPLINGS: dict[str, dict[str, Any]] = {
    "footprint": {"sampling": "footprint", "resolution": 384},
    "adaptive": {"sampling": "adaptive", "rcs_floor": 1e-5},
}
WAVEFORM = rc.Waveform(start_frequency=57e9, slope=14e12, sample_rate=1e6, num_samples=501)

TUBE_RADIUS, FILLET, LENGTH = 0.06, 0.005, 0.2
ASPECTS_DEG = (0.0, 30.0, 45.0, 90.0)
"""From the side, onto the fillet in between, onto the cap."""
NOISE = 1e-4  # [m], rms along every axis


@cache
def tube(segments: int, steps: int, *, seed: int | None = None, shading: str = "smooth") -> rc.Mesh:
    """A round rod along z with filleted rims, as CAD programs export it; the seed is that of noise on its vertices.

    Its side is one long quad per segment, a fillet as many rings of narrow ones as it has steps, and a cap a fan of
    slivers from one vertex of its rim.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, steps + 1)
    radius = TUBE_RADIUS - FILLET + FILLET * np.sin(angle)
    height = -0.5 * LENGTH + FILLET * (1.0 - np.cos(angle))
    radius, height = np.concatenate([radius, radius[::-1]]), np.concatenate([height, -height[::-1]])
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
    # Turned about its axis by less than half a segment: what is symmetric is a special case.
    rotation = Rotation.from_euler("zy", [5.0, aspect_deg], degrees=True).as_matrix()
    target = rc.Body(mesh, material=CONDUCTOR, motion=rc.Pose([1.0, 0.0, 0.0], rotation))
    sim = rc.Simulator(rc.Scene([target]), rc.Radar(WAVEFORM), field_of_view_deg=(16.0, 16.0), **options)
    return float(db(rc.range_profile(sim.frame().cube, WAVEFORM, num_bins=4096)).max())


def peaks_db(mesh: rc.Mesh, **options: Any) -> NDArray[np.float64]:
    return np.array([strongest_peak_db(mesh, aspect_deg, **options) for aspect_deg in ASPECTS_DEG])


def test_tube_is_closed_and_has_the_volume_of_its_solid() -> None:
    mesh = tube(32, 8)
    report = rc.mesh_report(mesh)
    assert (report.num_parts, report.num_open_edges, report.num_inconsistent_edges) == (1, 0, 0)
    # A fillet takes a square less a quarter of a disc, round the rim (Pappus); a polygon lacks (2 pi / n)^2 / 6.
    centroid = TUBE_RADIUS - FILLET + FILLET * 2.0 / (3.0 * (4.0 - np.pi))
    taken = FILLET**2 * (1.0 - 0.25 * np.pi) * 2.0 * np.pi * centroid
    solid = np.pi * TUBE_RADIUS**2 * LENGTH - 2.0 * taken
    assert mesh.volume / solid == pytest.approx(1.0 - (2.0 * np.pi / 32) ** 2 / 6.0, abs=5e-4)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_tube_of_32_segments_echoes_as_a_fine_one(sampling: str) -> None:
    options = SAMPLINGS[sampling]
    fine = peaks_db(tube(512, 32), **options)
    smooth = peaks_db(tube(32, 8), **options) - fine
    assert np.abs(smooth).max() <= 0.5
    assert rms(smooth) <= 0.3
    # Facets alone are off by their sagitta, 0.3 mm: 0.75 rad there and back.
    flat = peaks_db(tube(32, 8, shading="flat"), **options) - fine
    assert rms(flat) >= 1.0


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_noise_on_vertices_changes_peaks_little_more_than_those_of_flat_facets(sampling: str) -> None:
    options = SAMPLINGS[sampling] | ({} if sampling == "footprint" else {"rcs_floor": 1e-3})
    change = {}
    for shading in ("smooth", "flat"):
        clean = peaks_db(tube(32, 8, shading=shading), **options)
        change[shading] = rms(
            [peaks_db(tube(32, 8, seed=seed, shading=shading), **options) - clean for seed in range(4)]
        )
    assert change["flat"] > 0.3
    assert change["smooth"] <= change["flat"] + 1.0


@pytest.mark.parametrize(("subdivisions", "bound_db", "bound_phase"), [(2, 0.5, 0.2), (3, 0.3, 0.06)])
@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_coarse_sphere_is_a_sphere_in_the_mean_over_its_turns(
    subdivisions: int, bound_db: float, bound_phase: float, sampling: str
) -> None:
    # 320 and 1280 facets, up to 1.8 and 0.46 mm inside the sphere of 10 cm: 4.6 and 1.2 rad there and back. What is
    # left are area-weighted normals that lean off the radius, by 0.9 and 0.4 degrees (rms).
    mesh, expected = rc.shapes.sphere(0.1, subdivisions=subdivisions), [sphere(0.1, 1.0, f) for f in BAND]
    options = SAMPLINGS[sampling] | ({"resolution": 256} if sampling == "footprint" else {"rcs_floor": 1e-4})
    ratios = []
    for rotation in Rotation.random(16, rng=np.random.default_rng(0)).as_matrix():
        ball = rc.Body(mesh, material=CONDUCTOR, motion=rc.Pose([1.0, 0.0, 0.0], rotation))
        sim = rc.Simulator(rc.Scene([ball]), rc.Radar(WAVEFORM), field_of_view_deg=(14.0, 14.0), **options)
        ratios.append(spectrum(sim) / expected)
    assert rms(db(ratios)) <= bound_db
    assert rms(np.angle(ratios)) <= bound_phase


@pytest.mark.parametrize(
    "view",
    [
        {"resolution": (96, 1280), "field_of_view_deg": (94.0, 12.0)},
        {"resolution": 512, "field_of_view_deg": (6.2, 6.2)},
    ],
    ids=["over the wall to the ball", "over the ball to the wall"],
)
def test_ghost_of_a_coarse_sphere_is_that_of_a_sphere(view: dict[str, Any]) -> None:
    # Wall and ball as in the tests of several reflections. An antenna that receives what it sends gets it both ways.
    mesh, expected = rc.shapes.sphere(RADIUS, subdivisions=2), 2.0 * reflected_by_ball(SENSOR, image_of(SENSOR))
    waveform = rc.Waveform(start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1)
    ratio = {}
    for shading in ("smooth", "flat"):
        coarse = rc.Mesh(mesh.vertices, mesh.triangles, shading=shading)
        scene = rc.Scene([rc.Body(coarse, material=CONDUCTOR, motion=rc.Pose(BALL)), wall()])
        one, two = (
            rc.Simulator(scene, rc.Radar(waveform), sampling="footprint", max_bounces=n, **view).paths() for n in (1, 2)
        )
        paths = rc.Paths(*(values[:, one.delay.shape[1] :] for values in vars(two).values()))
        ratio[shading] = phasors(paths).sum() / expected
    assert abs(db(ratio["smooth"])) <= 0.4
    assert abs(np.angle(ratio["smooth"])) <= 0.1
    assert abs(ratio["flat"] - 1.0) >= 0.5
