"""Field of view: the default of the antennas, sectors of wide ones, and bodies outside of a chosen one."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

CONDUCTOR = rc.materials["perfect_conductor"]
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=1.5e13, sample_rate=2e6, num_samples=128, num_chirps=4, chirp_interval=3e-4
)
ISOTROPIC = rc.Radar(WAVEFORM)

BGT60 = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=128, chirp_interval=300e-6)
BEAM = rc.GaussianPattern(3.5, beamwidth_azimuth_deg=65.0, beamwidth_elevation_deg=40.0)


def towards(azimuth_deg: float, elevation_deg: float = 0.0, distance: float = 1.0) -> NDArray[np.float64]:
    """Position in a direction."""
    az, el = np.deg2rad([azimuth_deg, elevation_deg])
    return distance * np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])


def looking_back(azimuth_deg: float, elevation_deg: float = 0.0, distance: float = 1.0) -> rc.Pose:
    """Pose of what stands ahead, after a turn of the world about the sensor: first up, then to the left."""
    turn = rc.Pose.from_rpy([0.0, 0.0, 0.0], np.deg2rad([0.0, -elevation_deg, azimuth_deg]))
    return turn @ rc.Pose([distance, 0.0, 0.0])


def conductor(mesh: rc.Mesh, pose: rc.Pose, name: str = "body") -> rc.Body:
    return rc.Body(mesh, material=CONDUCTOR, motion=pose, name=name)


def simulator(bodies: list[Any], radar: rc.Radar = ISOTROPIC, **options: Any) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), radar, **options)


def echo(sim: rc.Simulator) -> NDArray[np.complex128]:
    """Phasor of every channel at the centre of the band."""
    paths = sim.paths()
    turns = np.exp(-2j * np.pi * sim.radar.waveform.center_frequency * paths.delay)
    echoes: NDArray[np.complex128] = (paths.amplitude * turns).sum(axis=-1)
    return echoes


def db(ratio: Any) -> Any:
    return 20.0 * np.log10(np.abs(ratio))


# ---------------------------------------------------------------- what antennas see


def test_gaussian_beam_is_seen_to_where_both_ways_are_20_db_down() -> None:
    # 2 x 12.04 dB (angle / width)^2 of both ways.
    expected = 2.0 * np.array([65.0, 40.0]) * np.sqrt(20.0 / (80.0 * np.log10(2.0)))
    got = np.array(BGT60.field_of_view_deg)
    assert (got >= expected).all()
    assert (got <= expected + 2.0).all()


def test_narrow_beam_is_not_lost_between_samples() -> None:
    pattern = rc.GaussianPattern(40.0, 0.3, 0.6)
    horizontal, vertical = rc.Radar(WAVEFORM, pattern=pattern).field_of_view_deg
    width = 2.0 * np.sqrt(20.0 / (80.0 * np.log10(2.0)))
    assert 0.3 * width <= horizontal <= 0.5 * width
    assert 0.6 * width <= vertical <= 1.2 * width


def aimed(azimuth_deg: float, elevation_deg: float = 0.0) -> rc.TabulatedPattern:
    """A beam that is 20 dB down on both ways at 14.1 degrees from its peak."""
    angles = np.arange(-90.0, 91.0)
    gains = -0.05 * (angles[:, None] - azimuth_deg) ** 2 - 0.05 * (angles - elevation_deg) ** 2
    return rc.TabulatedPattern.from_degrees(angles, angles, np.maximum(gains, -90.0))


def test_tilted_beam_makes_a_centred_field_of_view_that_holds_it() -> None:
    horizontal, vertical = rc.Radar(WAVEFORM, pattern=aimed(30.0, -10.0)).field_of_view_deg
    # A degree to the next sample.
    assert 2.0 * 44.1 <= horizontal <= 2.0 * 45.5
    assert 2.0 * 24.1 <= vertical <= 2.0 * 30.0  # z/x of directions to the side is larger than tan(elevation)


def test_pairs_see_what_both_of_their_antennas_see() -> None:
    radar = rc.Radar(WAVEFORM, tx_patterns=[aimed(20.0)], rx_patterns=[aimed(-20.0)])
    # The product of both is centred, as narrow as either.
    assert 28.2 <= radar.field_of_view_deg[0] <= 32.0


# ---------------------------------------------------------------- the default


def test_default_is_what_the_antennas_see_in_whole_tiles_and_is_told() -> None:
    sim = simulator([conductor(rc.shapes.sphere(0.1), rc.Pose([2.0, 0.0, 0.0]))], BGT60)
    seen, view = np.array(BGT60.field_of_view_deg), np.array(sim.view_deg)
    assert sim.field_of_view_deg is None
    assert (view >= seen).all()
    assert (view <= seen + 6.0).all()
    assert sim.frame().stats["field_of_view_deg"] == sim.view_deg
    assert "{:.4g} x {:.4g} degrees>".format(*sim.view_deg) in repr(sim)
    recorded = sim.record(0.0, 0.01, progress=False).source
    assert recorded["field_of_view_deg"] == list(sim.view_deg)
    # The same angles and cells, given, are the same simulation.
    again = dataclasses.replace(sim, field_of_view_deg=recorded["field_of_view_deg"])
    for same in (again, dataclasses.replace(again, resolution=tuple(recorded["resolution"]))):
        np.testing.assert_array_equal(same.frame().cube, sim.frame().cube)
    assert sim.with_radar(ISOTROPIC).view_deg == (150.0, 150.0)


def test_within_60_degrees_cells_are_those_of_a_field_of_60_degrees() -> None:
    bodies = [
        conductor(rc.shapes.sphere(0.1), rc.Pose([2.0, 0.7, -0.3]), "sphere"),
        conductor(rc.shapes.plate(0.2, 0.1), rc.Pose.from_rpy([1.5, -0.5, 0.2], [0.0, 0.1, 0.3]), "plate"),
    ]
    wide, narrow = simulator(bodies), simulator(bodies, field_of_view_deg=(60.0, 60.0))
    assert wide.frame().stats["rays_cast"] == narrow.frame().stats["rays_cast"]
    np.testing.assert_allclose(echo(wide), echo(narrow), rtol=1e-6)


def test_scene_file_without_angles_has_the_default(tmp_path: Path) -> None:
    from radarcore.scenefile.load import load_scene

    path = tmp_path / "scene.toml"
    path.write_text('[radar]\npreset = "bgt60tr13c"\n[run]\nstop = 0.1\n')
    simulation = load_scene(path)
    assert simulation.run.field_of_view_deg is None
    assert simulation.simulator().view_deg == simulator([], BGT60).view_deg


def test_depth_images_are_one_plane_of_at_most_110_degrees_unless_angles_are_given() -> None:
    wall = conductor(rc.shapes.plate(100.0, 100.0), rc.Pose([1.0, 0.0, 0.0]))
    image = simulator([wall]).depth_image()
    assert image.field_of_view_deg == (110.0, 110.0)
    np.testing.assert_allclose(image.distance * image.directions[..., 0], 1.0, rtol=1e-6)
    given = simulator([wall], field_of_view_deg=(140.0, 30.0)).depth_image()
    assert given.field_of_view_deg == (140.0, 30.0)
    narrow = rc.Radar(WAVEFORM, pattern=BEAM)
    assert simulator([wall], narrow).depth_image().field_of_view_deg == (110.0, simulator([], narrow).view_deg[1])


# ---------------------------------------------------------------- sectors

SIDES = [(70.0, 0.0), (-70.0, 0.0), (0.0, 70.0), (0.0, -70.0), (60.0, 40.0)]
SEAMS = [(45.3, 0.0), (-45.3, 10.0), (0.0, 45.3), (45.3, 35.0), (65.0, 42.2)]
TILES: dict[str, Any] = {"rcs_floor": 1e-4}
PIXELS: dict[str, Any] = {"sampling": "footprint", "resolution": 3200}
SPHERE, PLATE = rc.shapes.sphere(0.1), rc.shapes.plate(0.15, 0.1)


@pytest.mark.parametrize(
    ("mesh", "options", "directions"),  # millions of pixels see one direction of a kind
    [
        (SPHERE, TILES, SIDES + SEAMS),
        (SPHERE, PIXELS, [(70.0, 0.0), (-45.3, 10.0)]),
        (PLATE, TILES, SIDES + SEAMS),
        (PLATE, PIXELS, [(0.0, -70.0), (65.0, 42.2)]),
    ],
)
def test_bodies_aside_and_on_seams_echo_as_ahead(mesh: rc.Mesh, options: dict[str, Any], directions: Any) -> None:
    ahead = simulator([conductor(mesh, looking_back(0.0, 0.0, 2.0))], **options).frame().cube
    most_db, most_rad, distance = (0.6, 0.1, 1.9) if mesh is SPHERE else (0.2, 0.02, 2.0)
    for direction in directions:
        frame = simulator([conductor(mesh, looking_back(*direction, 2.0))], **options).frame()
        ratio = frame.cube[0, 0, 64] / ahead[0, 0, 64]  # in the middle of a ramp
        assert abs(db(ratio)) <= most_db, direction
        assert abs(np.angle(ratio)) <= most_rad, direction
        truth = frame.truth
        assert truth is not None
        assert truth.range[0] == pytest.approx(distance, abs=1e-3)
        shown = towards(*np.rad2deg([truth.azimuth[0], truth.elevation[0]]).tolist())
        assert np.linalg.norm(shown - towards(*direction)) <= 0.01


@pytest.mark.parametrize(
    ("polarization", "angles"), [(None, (45.3, 0.0)), ("vertical", (70.0, 0.0)), ("horizontal", (0.0, -70.0))]
)
def test_corner_aside_and_on_a_seam_echoes_as_ahead_to_every_polarisation(
    polarization: str | None, angles: tuple[float, float]
) -> None:
    radar = rc.Radar(WAVEFORM, polarization=polarization, rx=[[0.0, 0.0, 0.0]])
    echoes = []
    for direction in ((0.0, 0.0), angles):
        # Two reflections by a corner of glass, where both polarisations differ.
        corner = rc.Body(
            rc.shapes.dihedral(0.1), material=rc.Material.dielectric(4.0), motion=looking_back(*direction, 2.0)
        )
        echoes.append(echo(simulator([corner], radar, max_bounces=2, resolution=800)).item())
    assert abs(db(echoes[1] / echoes[0])) <= 0.5  # cells at the sides are twice as wide


def test_matt_points_on_a_seam_count_once() -> None:
    matt = rc.Material.lambertian(0.8)
    numbers = []
    for angles in ((0.0, 0.0), (45.3, 0.0), (45.3, 35.0)):
        plate = rc.Body(rc.shapes.plate(0.4, 0.4), material=matt, motion=looking_back(*angles, 2.0))
        sim = simulator([plate])
        powers_of_points = np.abs(sim.paths().amplitude) ** 2
        numbers.append((np.count_nonzero(powers_of_points), powers_of_points.sum()))
    counts, powers = np.array(numbers).T
    assert (counts == counts[0]).all()  # all points of the plate are visible, and none twice
    np.testing.assert_allclose(powers, powers[0], rtol=1e-3)


@pytest.mark.parametrize("options", [{}, {"sampling": "footprint", "resolution": 200}], ids=["adaptive", "footprint"])
@pytest.mark.parametrize("max_bounces", [1, 2])
def test_tiles_of_all_sectors_are_taken_over(options: dict[str, Any], max_bounces: int) -> None:
    mesh = rc.shapes.sphere(0.2)
    still = [
        conductor(mesh, rc.Pose(towards(*angles, 2.0)), f"ball {number}")
        for number, angles in enumerate([(45.3, 0.0), (-70.0, 0.0), (0.0, 70.0)])
    ]
    moving = rc.Body(
        rc.shapes.dihedral(0.2), material=CONDUCTOR, motion=rc.Linear(looking_back(46.0, 20.0, 2.0), velocity=[0, 2, 0])
    )
    sim = simulator([*still, moving], max_bounces=max_bounces, **options)
    first, second = sim.frame(0.0), sim.frame(0.1)
    assert second.stats["tiles_reused"] > 0
    assert second.stats["rays_cast"] < first.stats["rays_cast"]
    np.testing.assert_array_equal(second.cube, dataclasses.replace(sim, threads=1).frame(0.1).cube)


def test_budget_is_that_of_all_sectors() -> None:
    ball = rc.shapes.sphere(0.5)
    bodies = [conductor(ball, rc.Pose(towards(angle, 0.0, 1.2)), f"ball {angle}") for angle in (-65.0, 0.0, 65.0)]
    most = 69_000
    sim = simulator(bodies, rcs_floor=1e-6, ray_budget=most)
    with pytest.warns(UserWarning, match="its finest cells or its ray_budget"):
        frame = sim.frame()
    assert frame.stats["cells_not_split"] > 0
    assert frame.stats["rays_cast"] <= 2 * most  # with rays of tried cells
    # The corners of the grid are in no plane.
    rows, columns = sim.num_cells
    with pytest.raises(ValueError, match=r"ray_budget: expected at least the (\d+) rays") as refused:
        simulator(bodies, ray_budget=1000)
    assert 0.5 * rows * columns < int(str(refused.value).split()[5]) < 0.9 * rows * columns


@pytest.mark.filterwarnings("ignore:.*has a radial speed")
def test_turning_body_aside_is_cast_in_parts() -> None:
    mesh = rc.shapes.plate(0.1, 0.1)
    frames = []
    for angle in (0.0, 70.0):
        spin = rc.Linear(looking_back(angle, 0.0, 2.0), angular_velocity=[0.0, 0.0, 300.0])
        frames.append(
            simulator([rc.Body(mesh, material=CONDUCTOR, motion=spin)], rcs_floor=1e-4, retrace_deg=3.0).frame()
        )
    assert frames[0].stats["casts"] == frames[1].stats["casts"] > 1
    power = [float((np.abs(frame.cube) ** 2).sum()) for frame in frames]
    assert abs(10.0 * np.log10(power[1] / power[0])) <= 0.5


# ---------------------------------------------------------------- bodies beyond a chosen field of view


def beside(angle_deg: float, name: str = "ball") -> rc.Body:
    return conductor(rc.shapes.sphere(0.1), rc.Pose(towards(angle_deg, 0.0, 2.0)), name)


def test_body_in_the_beam_outside_of_the_chosen_field_of_view_is_warned_of_once() -> None:
    sim = simulator([beside(0.0, "ahead"), beside(40.0), beside(45.0, "other")], BGT60, field_of_view_deg=(60.0, 60.0))
    expected = r"'ball' \(and 1 more\) lies in the beam .* azimuth 40 .*\(60, 60\): it returns nothing"
    with pytest.warns(UserWarning, match=expected) as found:
        frames = [sim.frame(), sim.frame(0.1), *sim.record(0.0, 0.05, progress=False).frames()]
    assert len(frames) == 4
    assert len(found) == 1
    assert found[0].filename == __file__


@pytest.mark.parametrize(
    ("angles", "options"),
    [
        ((40.0, 20.0), {}),  # the default
        ((0.0, 28.0), {"field_of_view_deg": (60.0, 60.0)}),  # inside
        ((32.0,), {"field_of_view_deg": (60.0, 60.0)}),  # partly inside
        ((80.0, 180.0), {"field_of_view_deg": (60.0, 60.0)}),  # outside of the beam
        ((100.0,), {}),
    ],
)
def test_no_warning_otherwise(angles: tuple[float, ...], options: dict[str, Any]) -> None:
    bodies: list[Any] = [beside(angle, f"ball {angle}") for angle in angles]
    bodies.append(rc.PointTarget(towards(20.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulator(bodies, BGT60, **options).frame()


# ---------------------------------------------------------------- point targets

POINTS = [  # azimuth and elevation [degrees], field of view, whether it shows them, and the warning
    (0.0, 0.0, None, True, None),
    (55.0, 0.0, None, True, None),
    (70.0, 0.0, None, False, "no body is seen: .* 'p', lies at 2 m, azimuth 70 and elevation 0 degrees"),
    (180.0, 0.0, None, False, "no body is seen: .* 'p', lies at 2 m, azimuth 180 and elevation 0 degrees"),
    (0.0, 90.0, None, False, "no body is seen: .* elevation 90 degrees"),
    (29.0, 0.0, (60.0, 60.0), True, None),
    (31.0, 0.0, (60.0, 60.0), False, "'p' lies in the beam .* azimuth 31 .*: its truth is NaN"),
    (0.0, -31.0, (60.0, 60.0), False, "'p' lies in the beam .* elevation -31 degrees"),
    # The vertical angle has the tangent z/x, larger than the elevation beside the axis; z/y on the side of a wide view.
    (50.0, 29.0, (120.0, 70.0), False, None),
    (50.0, 22.0, (120.0, 70.0), True, None),
    (100.0, 0.0, (150.0, 60.0), False, None),
]


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg", "view", "is_shown", "warning"), POINTS)
def test_truth_of_points_outside_of_the_field_of_view_is_nan(
    azimuth_deg: float, elevation_deg: float, view: Any, is_shown: bool, warning: str | None
) -> None:
    point = rc.PointTarget(towards(azimuth_deg, elevation_deg, 2.0), name="p")
    seen = [] if view is None else [beside(0.0)]
    sim = simulator([point, *seen], rc.Radar(BGT60.waveform, pattern=BEAM), field_of_view_deg=view)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        truths = [sim.frame().truth, sim.frame(0.1).truth, next(sim.record(0.0, 0.02, progress=False).frames()).truth]
    for truth in truths:
        assert truth is not None
        got = [truth.range[0], truth.velocity[0], *np.rad2deg([truth.azimuth[0], truth.elevation[0]])]
        expected = [2.0, 0.0, azimuth_deg, elevation_deg] if is_shown else [np.nan] * 4
        np.testing.assert_allclose(got, expected, atol=1e-9)
        assert np.isfinite(truth.range[1:]).all()
    assert len(caught) == (warning is not None)
    if warning:
        assert re.search(warning, str(caught[0].message))
        assert caught[0].filename == __file__
