"""Errors of a simulator at its first frame, and its single warnings."""

from __future__ import annotations

import pickle
import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=60.1e9, sample_rate=2e6, num_samples=32, num_chirps=4, chirp_interval=3e-4
)
RADAR = rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]])
PLATE = rc.shapes.plate(0.3, 0.3)


def simulator(*bodies: rc.Body | rc.PointTarget | rc.Interferer, motion: rc.Pose | None = None) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), RADAR, radar_motion=motion, resolution=32)


def body(mesh: rc.Mesh, motion: Any = None, name: str = "part") -> rc.Body:
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


def plate(position: list[float], name: str = "part", **motion: Any) -> rc.Body:
    return body(PLATE, rc.Linear(rc.Pose(position), **motion), name)


def approaching(share: float) -> rc.Body:
    """A plate at a share of the largest velocity."""
    return plate([2.0, 0.0, 0.0], velocity=[share * WAVEFORM.max_velocity, 0.0, 0.0])


def vibrating(time: float) -> rc.Pose:
    return rc.Pose([2.0 + 1e-3 * np.sin(2.0 * np.pi * 40.0 * time / WAVEFORM.duration), 0.0, 0.0])


def beyond(name: str, distance: float, limit: float, **target: Any) -> tuple[rc.Simulator, list[str]]:
    """A point beyond the largest range of a receiver."""
    radar = rc.Radar(WAVEFORM, receiver=None if name == "none" else rc.Receiver(output=name))
    scene = rc.Scene([rc.PointTarget([1.0, 0.0, 0.0]), rc.PointTarget([distance, 0.0, 0.0], **target)])
    message = rf"the scene reaches to {distance:.2f} m, beyond max_unambiguous_range {limit:.2f} m"
    return rc.Simulator(scene, radar, resolution=32), [message] if distance > limit and not target else []


FAR, HALF = RADAR.max_unambiguous_range, 0.5 * RADAR.max_unambiguous_range
BEHIND = plate([-9.0, 0.0, 0.0], "far")
UNSEEN = "no body is seen: the middle of the nearest, 'part', lies at "
SENDER = rc.Radar(WAVEFORM.replace(slope=0.0), tx_power_dbm=60.0)
SAID: dict[str, tuple[rc.Simulator, list[str]]] = {
    "fast": (
        simulator(plate([3.0, 1.0, 0.0], "still"), approaching(1.1)),
        [r"'part' has a radial speed of 4\.58 m/s, beyond max_velocity 4\.16 m/s of the waveform"],
    ),
    "slow": (simulator(approaching(0.9)), []),
    "behind": (simulator(BEHIND, plate([-3.0, 0.0, 0.0])), [UNSEEN + "3 m, azimuth 180 and elevation 0 degrees from"]),
    "above": (simulator(BEHIND, plate([0.5, 0.0, 3.0])), [UNSEEN + r"3\.041 m, azimuth 0 and elevation 81 degrees"]),
    "no body": (simulator(), []),
    "empty mesh": (
        simulator(plate([3.0, 0.0, 0.0]), body(rc.Mesh([], []), name="empty")),
        ["the mesh of 'empty' has no triangles: it returns nothing"],
    ),
    "nothing else": (simulator(body(rc.Mesh([], []))), ["no body is seen: none of them has a surface"]),
    # No path of the small ball comes back.
    **{
        f"far ball of {radius} m": (
            rc.Simulator(
                rc.Scene([body(rc.shapes.sphere(radius, subdivisions=4), rc.Pose([2000.0, 0.0, 0.0]))]), RADAR
            ),
            [r"the scene reaches to 1999\.\d\d m, beyond max_unambiguous_range 47\.97 m of the radar: "],
        )
        for radius in (0.1, 1.0)
    },
    "far point": beyond("none", FAR + 0.5, FAR),
    "far point of I/Q": beyond("iq", FAR + 0.5, FAR),
    "far point of a real receiver": beyond("real", HALF + 0.5, HALF),
    "near point": beyond("real", HALF - 0.01, HALF),
    "far point without an echo": beyond("none", 2.0 * FAR, FAR, rcs=0.0),
    "fast vibration": (
        simulator(body(rc.shapes.sphere(0.05), vibrating)),
        ["phases .fast motion of 'part', .* are interpolated within a frame with an error of", "has a radial speed"],
    ),
    "interferer": (
        simulator(rc.Interferer(SENDER, rc.Pose([0.5, 0.0, 0.0]))),
        ["received with -2 dBm: real receivers compress"],
    ),
}


@pytest.mark.parametrize("case", SAID)
def test_doubtful_scenes_raise_one_warning(case: str) -> None:
    sim, messages = SAID[case]
    for run in (
        lambda sim: [sim.frame(time) for time in (0.0, 0.1)],
        lambda sim: sim.record(0.0, 0.2, 10.0, progress=False),
    ):
        said = warned(lambda run=run: run(replace(sim)))
        assert len(said) == len(messages), said
        assert all(re.search(message, text) for message, text in zip(messages, said, strict=True)), said


def test_recordings_and_cross_sections_raise_warnings_of_their_own() -> None:
    long = rc.Simulator(rc.Scene(), rc.Radar(WAVEFORM.replace(num_chirps=90)), resolution=8)
    (said,) = warned(lambda: long.record(0.0, 0.05, 40.0, progress=False))
    assert re.match(r"frames of 26\.\d\d ms overlap at 40 frames per second", said)
    (said,) = warned(lambda: rc.rcs(rc.Mesh([], []), 60e9, azimuth_deg=0.0))
    assert said == "target: expected a mesh with triangles, got none: its cross-section is 0"
    # Bodies that come into view later raise no warning; bodies that leave it do.
    passing = simulator(plate([2.0, -3.0, 0.0], velocity=[0.0, 30.0, 0.0]))
    assert not [text for text in warned(lambda: passing.record(0.0, 0.2, 10.0, progress=False)) if "seen" in text]
    leaving = plate([2.0, 0.0, 0.0], velocity=[0.0, 4.0, 0.0])
    narrow = rc.Simulator(rc.Scene([leaving]), RADAR, resolution=32, field_of_view_deg=(60.0, 60.0))
    (said,) = warned(lambda: narrow.record(0.0, 0.5, 10.0, progress=False))
    assert said.startswith("'part' lies in the beam")


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
