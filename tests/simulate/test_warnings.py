"""What a simulator refuses at its first frame, and what it warns of once."""

from __future__ import annotations

import pickle
import re
import warnings
from collections.abc import Callable

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=60.1e9, sample_rate=2e6, num_samples=32, num_chirps=4, chirp_interval=3e-4
)
RADAR = rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]])
PLATE = rc.shapes.plate(0.3, 0.3)


def simulator(*bodies: rc.Body | rc.PointTarget, motion: rc.Pose | None = None) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), RADAR, radar_motion=motion, resolution=32)


def body(mesh: rc.Mesh, motion: rc.Pose | rc.Linear | None = None, name: str = "part") -> rc.Body:
    return rc.Body(mesh, motion=motion, name=name)


FIRST: dict[str, Callable[[rc.Simulator], object]] = {
    "frame": lambda sim: sim.frame(0.0),
    "paths": lambda sim: sim.paths(0.0),
    "record": lambda sim: sim.record(0.0, 0.1, 10.0, progress=False),
}


@pytest.mark.parametrize("first", FIRST.values(), ids=FIRST)
@pytest.mark.parametrize(
    ("part", "message"),
    [
        (body(rc.shapes.box([0.3, 0.3, 0.3])), "expected the antennas outside of every body .* inside 'part'"),
        (body(PLATE), "expected all antennas at least 1 mm from every surface .* got 0 mm to 'part'"),
        (
            body(PLATE, rc.Pose([0.5e-3, 0.0, 0.0])),
            "expected all antennas at least 1 mm from every surface .* got 0.5 mm to 'part'",
        ),
        (
            rc.PointTarget([0.0, 2.5e-3, 0.0], name="part"),
            "expected all antennas at least 1 mm from every surface .* got 0 mm to 'part'",
        ),
    ],
    ids=["inside", "touching", "too near", "point"],
)
def test_antennas_in_or_at_a_body_are_refused(
    part: rc.Body | rc.PointTarget, message: str, first: Callable[[rc.Simulator], object]
) -> None:
    sim = simulator(part)
    for _ in range(2):
        with pytest.raises(ValueError, match=f"radar_motion: {message}"):
            first(sim)


def test_antennas_in_what_a_body_deforms_into_are_refused() -> None:
    box = rc.shapes.box([0.3, 0.3, 0.3])
    reaching = rc.Body(box, motion=rc.Pose([1.0, 0.0, 0.0]), deformation=lambda _: box.vertices - [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="expected the antennas outside of every body"):
        simulator(reaching).frame(0.0)
    leaving = rc.Body(box, deformation=lambda _: box.vertices - [-1.0, 0.0, 0.0])
    assert simulator(leaving).frame(0.0).stats["rays_hit"] > 0


def test_antennas_in_a_room_or_beside_a_body_are_not() -> None:
    mount = rc.Pose([1.0, 2.0, 3.0], rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.3, 0.2, 0.1]).rotation)
    room = body(rc.shapes.box([4.0, 4.0, 4.0]), mount)
    plate = body(PLATE, mount @ rc.Pose([2e-3, 0.0, 0.0]), "plate")
    assert simulator(room, plate, motion=mount).frame().stats["rays_hit"] > 0


def warned(run: Callable[[], object]) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run()
    assert {warning.filename for warning in caught} <= {__file__}
    return [str(warning.message) for warning in caught]


def test_body_beyond_the_largest_velocity_is_said_once() -> None:
    fast = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[1.1 * WAVEFORM.max_velocity, 0.0, 0.0])
    sim = simulator(body(PLATE, rc.Pose([3.0, 1.0, 0.0]), "still"), body(PLATE, fast, "part"))
    (said,) = warned(lambda: [sim.frame(time) for time in (0.0, 0.05)])
    assert said.startswith("'part' has a radial speed of 4.58 m/s, beyond max_velocity 4.16 m/s of the waveform")
    slow = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[0.9 * WAVEFORM.max_velocity, 0.0, 0.0])
    assert warned(lambda: simulator(body(PLATE, slow)).frame(0.0)) == []


@pytest.mark.parametrize(
    ("position", "where"),
    [([-3.0, 0.0, 0.0], "3 m, azimuth 180 and elevation 0"), ([0.5, 0.0, 3.0], "3.041 m, azimuth 0 and elevation 81")],
)
def test_scene_of_which_nothing_is_seen_says_where_the_nearest_body_is(position: list[float], where: str) -> None:
    parts = body(PLATE, rc.Pose([-9.0, 0.0, 0.0]), "far"), body(PLATE, rc.Pose(position), "part")
    for run in (
        lambda sim: [sim.frame(time) for time in (0.0, 0.1)],
        lambda sim: sim.record(0.0, 0.2, 10.0, progress=False),
    ):
        sim = simulator(*parts)
        (said,) = warned(lambda run=run, sim=sim: run(sim))
        assert said.startswith(f"no body is seen: the middle of the nearest, 'part', lies at {where} degrees from")


def test_mesh_without_triangles_raises_a_warning() -> None:
    empty, plate = body(rc.Mesh([], []), name="empty"), body(PLATE, rc.Pose([3.0, 0.0, 0.0]), "plate")
    sim = simulator(plate, empty)
    assert warned(lambda: [sim.frame(time) for time in (0.0, 0.1)]) == [
        "the mesh of 'empty' has no triangles: it returns nothing"
    ]
    assert warned(lambda: simulator(empty).frame(0.0)) == ["no body is seen: none of them has a surface"]
    (said,) = warned(lambda: rc.rcs(rc.Mesh([], []), 60e9, azimuth_deg=0.0))
    assert said == "target: expected a mesh with triangles, got none: its cross-section is 0"


@pytest.mark.parametrize("radius", [0.1, 1.0])
def test_lone_body_beyond_the_largest_range_raises_a_warning(radius: float) -> None:
    """No path of the small one comes back."""
    sim = rc.Simulator(rc.Scene([body(rc.shapes.sphere(radius), rc.Pose([2000.0, 0.0, 0.0]))]), RADAR)
    (said,) = warned(lambda: [sim.frame(time) for time in (0.0, 0.1)])
    assert re.match(r"the scene reaches to 1999\.\d\d m, beyond max_unambiguous_range 47\.97 m of the radar: ", said)


@pytest.mark.parametrize(
    "part",
    [
        body(PLATE, rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0])),
        rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name="part"),
    ],
)
def test_times_since_1970_are_refused(part: rc.Body | rc.PointTarget) -> None:
    """At 0.5 m/s the body is 8.5e8 m away by then."""
    with pytest.raises(ValueError, match=r"1700000000 s, as times since 1970 are: 'part' has moved to 8.5e\+08 m by"):
        simulator(part).frame(1.7e9)
    still = simulator(body(PLATE, rc.Pose([3.0, 0.0, 0.0])))
    assert still.frame(1.7e9).time == 1.7e9


def test_body_that_comes_into_view_later_in_a_recording_is_not_missed() -> None:
    passing = rc.Linear(rc.Pose([2.0, -3.0, 0.0]), velocity=[0.0, 30.0, 0.0])
    sim = simulator(body(PLATE, passing))
    assert [said for said in warned(lambda: sim.record(0.0, 0.2, 10.0, progress=False)) if "seen" in said] == []
    assert warned(lambda: simulator().frame(0.0)) == []  # an empty scene is a scene
    assert np.isfinite(sim.frame(0.1).cube).all()


def plain(mesh: rc.Mesh) -> rc.Mesh:
    """A mesh of the same triangles that is no reflector."""
    return rc.Mesh(mesh.vertices, mesh.triangles)


REFLECTORS = {
    "dihedral": rc.shapes.dihedral(0.1),
    "trihedral": rc.shapes.trihedral(0.1),
    "square": rc.shapes.trihedral(0.1, shape="square"),
    "from another process": pickle.loads(pickle.dumps(rc.shapes.trihedral(0.1))),
}


@pytest.mark.parametrize("mesh", REFLECTORS.values(), ids=REFLECTORS)
@pytest.mark.parametrize("max_bounces", [1, 3])
def test_reflector_that_shows_its_back_raises_one_warning(mesh: rc.Mesh, max_bounces: int) -> None:
    """`look_at` turns +x to the radar; half a turn more turns the opening, towards -x, to it."""
    at = rc.Pose.look_at([2.0, 0.5, 0.1], target=[0.0, 0.0, 0.0])
    opened = at @ rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, np.pi])
    sidewards = at @ rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, 0.7 * np.pi])
    message = "'part' shows its back to the radar: a corner reflector opens towards -x"
    for motion, is_back in ((at, True), (opened, False), (sidewards, False)):
        parts = [body(mesh, motion), body(mesh, motion, "other")]
        sim = rc.Simulator(rc.Scene(parts), RADAR, resolution=32, max_bounces=max_bounces)
        caught = [said for said in warned(lambda sim=sim: [sim.frame(), sim.frame(0.1)]) if "back" in said]
        assert len(caught) == is_back
        assert all(said.startswith(message) for said in caught)
    # No warning behind the radar, or for a mesh that is no reflector.
    for away in (body(mesh, rc.Pose([-2.0, 0.0, 0.0])), body(plain(mesh), at)):
        assert not [said for said in warned(lambda away=away: simulator(away).frame()) if "back" in said]
