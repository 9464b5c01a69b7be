"""Adaptive sampling: closed forms, skipped cells, budgets, and errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_closed_forms import CONDUCTOR, ball, body, sphere

import radarcore as rc

C = 299_792_458.0
BAND = np.linspace(57e9, 64e9, 15)

to_finest_cells = pytest.mark.filterwarnings("ignore:adaptive sampling ended at its finest cells")
"""Edges leave more than the lowest floors open whatever the cells: these are halved six times at most."""


WAVEFORM = rc.Waveform(start_frequency=57e9, slope=14e12, sample_rate=1e6, num_samples=501)
"""One chirp over the band."""


def default(bodies: list[rc.Body], pattern: rc.GaussianPattern | None = None, **options: Any) -> rc.Simulator:
    """Antennas at one place, isotropic by default, 1 W."""
    return rc.Simulator(rc.Scene(bodies), rc.Radar(WAVEFORM, pattern=pattern), **({"tolerance": 1e-6} | options))


def simulator(bodies: list[rc.Body], **options: Any) -> rc.Simulator:
    """With a floor far below the echoes."""
    fine = {"rcs_floor": 1e-5, "ray_budget": np.inf, "resolution": 64, "tolerance": 1e-9}
    return default(bodies, **fine | {"field_of_view_deg": (60.0, 60.0)} | options)


def spectrum(sim: rc.Simulator) -> NDArray[np.complex128]:
    """H over the band, path by path."""
    paths = sim.paths()
    weights = (sim.radar.waveform.center_frequency / BAND[:, None]) ** paths.order[0]
    turns = np.exp(-2j * np.pi * BAND[:, None] * paths.delay[0])
    spectrum: NDArray[np.complex128] = (weights * turns) @ paths.amplitude[0]
    return spectrum


def db(ratio: Any) -> Any:
    return 20.0 * np.log10(np.abs(ratio))


def rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


@to_finest_cells
@pytest.mark.parametrize(
    ("rcs_floor", "most_rays", "bound_db", "bound_phase"), [(1e-5, 60_000, 0.3, 0.04), (1e-7, 320_000, 0.15, 0.015)]
)
@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_sphere_has_its_closed_form_over_the_band(
    radius: float, rcs_floor: float, most_rays: int, bound_db: float, bound_phase: float
) -> None:
    sim = simulator([ball(radius)], rcs_floor=rcs_floor)
    ratio = spectrum(sim) / [sphere(radius, 1.0, f) for f in BAND]
    assert rms(db(ratio)) <= bound_db
    assert rms(np.angle(ratio)) <= bound_phase
    assert whole(sim).frame().stats["rays_cast"] <= most_rays


def whole(sim: rc.Simulator) -> rc.Simulator:
    """Simulator of the same scene that leaves out nothing that is known."""
    fresh = sim.with_radar(sim.radar)
    vars(fresh)["_engines"] = fresh._new_engines(reuse_tiles=False, skip_empty=False)
    return fresh


@to_finest_cells
def test_an_oblique_wall_does_not_echo_and_takes_no_more_rays_than_the_base_grid() -> None:
    wall = body(rc.shapes.plate(6.0, 6.0), 3.0, yaw_deg=50.0)
    beamwidth = np.rad2deg(np.sqrt(4.0 * np.log(2.0) * 0.08))
    pattern = rc.GaussianPattern(0.0, beamwidth, beamwidth)
    for rcs_floor in (1e-3, 1e-5):
        sim = simulator([wall], pattern=pattern, rcs_floor=rcs_floor)
        mirror = C / BAND / (8.0 * np.pi * 3.0)
        assert db(rms(spectrum(sim) / mirror)) <= -75.0
        stats = whole(sim).frame().stats
        assert stats["rays_cast"] == 64 * 64
        assert stats["paths"] <= 50


@pytest.mark.filterwarnings("ignore:field_of_view_deg. expected degrees")
@pytest.mark.parametrize("tilts", [(20.0, 20.0), (30.0, 25.0), (10.0, 15.0)])
def test_corners_of_a_flat_surface_have_its_echo_over_the_band(tilts: tuple[float, float]) -> None:
    """No edge has its nearest point in view: only the four corners contribute, with a field ~ 1 / frequency^2."""
    pitch, distance = 2.0 * np.tan(np.deg2rad(1.5)) / 8, 9.0
    normal = rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, *np.deg2rad(tilts)]).rotation @ [-1.0, 0.0, 0.0]

    def on_plane(u: Any, v: Any) -> NDArray[np.float64]:
        """Points of the plane seen at ``(1, u, v)``."""
        directions = np.stack(np.broadcast_arrays(1.0, u, v), axis=-1)
        points: NDArray[np.float64] = directions * (distance * normal[0] / (directions @ normal))[..., None]
        return points

    (u0, u1), (v0, v1) = pitch * np.array([[-3, 2], [-2, 3]])
    mesh = rc.Mesh(on_plane(np.array([u0, u1, u1, u0]), np.array([v0, v0, v1, v1])), [[0, 1, 2], [0, 2, 3]])
    view = {"field_of_view_deg": (3.0, 3.0), "resolution": 8, "rcs_floor": 1e-6}
    sim = simulator([rc.Body(mesh, material=CONDUCTOR)], **view)
    # Two at each corner: the ends of two edges.
    assert sim.paths().order[0].tolist() == [2] * 8
    # Physical optics over the solid angle, by Gauss and Legendre: without a frequency but in the phase.
    x, weight = np.polynomial.legendre.leggauss(200)
    u, v = 0.5 * (u0 + u1 + (u1 - u0) * x[:, None]), 0.5 * (v0 + v1 + (v1 - v0) * x)
    solid = 0.25 * (u1 - u0) * (v1 - v0) * np.outer(weight, weight) / (1.0 + u**2 + v**2) ** 1.5
    waveform = sim.radar.waveform
    tau = 2.0 * np.linalg.norm(on_plane(u, v), axis=-1).ravel() / C
    times = waveform.sample_times[::20]
    turns = waveform.start_frequency * tau + waveform.slope * tau * (times[:, None] - 0.5 * tau)
    expected = 1j / (4.0 * np.pi) * (np.exp(2j * np.pi * turns) @ solid.ravel())
    got = sim.frame().cube[0, 0, ::20]
    # A power too few or too many is 3 % of the echo; the curvature of the wave over a cell is less than half a percent.
    assert np.linalg.norm(got - expected) <= 5e-3 * np.linalg.norm(expected)


@to_finest_cells
def test_samples_in_a_frame_are_those_of_the_paths() -> None:
    sim = simulator([body(rc.shapes.plate(0.2, 0.2), 1.0, yaw_deg=15.0)])
    paths = sim.paths()
    assert set(paths.order[0].tolist()) == {1, 2}
    waveform = sim.radar.waveform
    times = waveform.sample_times[::10]
    tau = paths.delay[0][:, None]
    turns = waveform.start_frequency * tau + waveform.slope * tau * times - 0.5 * waveform.slope * tau**2
    weights = (waveform.center_frequency / (waveform.start_frequency + waveform.slope * times)) ** paths.order[0][
        :, None
    ]
    expected = (paths.amplitude[0].conj()[:, None] * weights * np.exp(2j * np.pi * turns)).sum(axis=0)
    np.testing.assert_allclose(sim.frame().cube[0, 0, ::10], expected, atol=1e-9 * np.abs(paths.amplitude).max())


def test_a_matt_surface_that_stretches_returns_as_much_as_one_of_its_size() -> None:
    def power(side: float, scale: float) -> float:
        plate = rc.shapes.plate(side, side)
        stretched = None if scale == 1.0 else lambda _: scale * plate.vertices
        target = rc.Body(
            plate, material=rc.Material.lambertian(0.5), motion=rc.Pose([2.0, 0.0, 0.0]), deformation=stretched
        )
        return float((np.abs(simulator([target]).paths().amplitude) ** 2).sum())

    assert power(0.2, 2.0) == pytest.approx(power(0.4, 1.0), rel=0.01)


def test_fast_sampling_is_that_of_a_tenfold_floor_and_casts_fewer_rays() -> None:
    # The plate is so bright that no floor is lowered.
    pose = rc.Pose.from_rpy([2.0, 0.8, 0.0], [0.0, 0.0, np.arctan2(0.8, 2.0)])
    bodies = [body(rc.shapes.sphere(0.3), 1.5), rc.Body(rc.shapes.plate(0.4, 0.4), motion=pose)]
    fast, fine = default(bodies, sampling="fast").frame(), default(bodies).frame()
    assert fast.stats["rays_cast"] < 0.9 * fine.stats["rays_cast"]
    np.testing.assert_array_equal(fast.cube, default(bodies, rcs_floor=0.1).frame().cube)


def test_small_body_far_away_is_found_between_the_rays_of_the_base_grid() -> None:
    for y in (0.0, 0.05, 0.1):
        ball = rc.Body(rc.shapes.sphere(0.025), material=CONDUCTOR, motion=rc.Pose([6.0, y, 0.03]))
        distance = np.linalg.norm([6.0, y, 0.03])
        ratio = rms(spectrum(default([ball]))) / rms([sphere(0.025, distance, f) for f in BAND])
        assert abs(db(ratio)) <= 1.0


def test_budget_is_kept_and_said_once() -> None:
    sim = default([ball(0.2)], rcs_floor=1e-7, ray_budget=30_000, field_of_view_deg=(60.0, 60.0))
    with pytest.warns(UserWarning, match="adaptive sampling ended at its finest cells or its ray_budget") as warned:
        frames = [sim.frame(0.0), sim.frame(0.1)]
    assert len(warned) == 1
    assert frames[0].stats["cells_not_split"] > 0
    exact = np.array([sphere(0.2, 1.0, f) for f in BAND])
    assert rms(spectrum(sim) / exact - 1.0) < 0.1
    assert default([ball(0.2)]).frame().stats["cells_not_split"] == 0
