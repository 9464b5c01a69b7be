"""Descriptions are read-only: derived values would not follow a changed attribute."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc

PLATE = rc.shapes.plate(0.2, 0.2)
POSES = [rc.Pose(), rc.Pose([1.0, 0.0, 0.0])]
RADAR = rc.bgt60tr13c()
SCENE = rc.Scene([rc.Body(PLATE, motion=rc.Pose([0.5, 0.0, 0.0])), rc.PointTarget([0.8, 0.0, 0.0])])
FRAME = rc.Simulator(rc.Scene(), rc.Radar(RADAR.waveform)).frame()
RECORDING = rc.Simulator(SCENE, RADAR, resolution=8).record(0.0, 0.2, 10.0, progress=False)

READ_ONLY: list[tuple[Any, str]] = [
    (rc.Simulator(SCENE, RADAR), "radar scene sampling"),
    (RADAR, "tx"),
    (RADAR.waveform, "slope"),
    (RADAR.pattern, "gain_db"),
    (RADAR.receiver, "output"),
    (SCENE, "bodies names bodys"),
    (SCENE.bodies[0], "material"),
    (rc.materials["metal"], "albedo"),
    (PLATE, "vertices shading crease_angle_deg"),
    (rc.Pose(), "position"),
    (rc.Linear(rc.Pose()), "velocity"),
    (rc.Trajectory([0.0, 1.0], POSES), "times poses"),
    (rc.Deformation([0.0, 1.0], [PLATE.vertices] * 2), "vertices"),
    (rc.Attached(rc.Pose()), "parent"),
    (rc.Live(), "newest"),
    (rc.LiveGroup(2), "motions"),
    (rc.models.Human(), "height"),
    (rc.models.Human().path, "waypoints"),
    (rc.models.RobotArm.ur10(), "joints"),
    (rc.models.RobotArm.ur10().moving(np.zeros(6)), "base"),
    (RECORDING, "cube"),
    (RECORDING.truth, "range"),
    (rc.Camera(1.0, 1.0, 0.5, 0.5), "fx"),
]

ARRAYS: dict[str, Callable[[], Any]] = {
    "antennas": lambda: RADAR.tx,
    "chirp times": lambda: RADAR.waveform.chirp_times,
    "vertices": lambda: PLATE.vertices,
    "triangles": lambda: PLATE.triangles,
    "position": lambda: rc.Pose().position,
    "times of poses": lambda: rc.Trajectory([0.0, 1.0], POSES).times,
    "points of a scene": lambda: SCENE.parts.positions,
    "times of frames": lambda: RECORDING.time,
    "truth": lambda: RECORDING.truth and RECORDING.truth.range,
    "truth of a frame": lambda: (truth := rc.Simulator(SCENE, RADAR, resolution=8).frame().truth) and truth.range,
}


def check_read_only(owner: Any, name: str) -> None:
    before = getattr(owner, name, None)
    for change in (lambda: setattr(owner, name, None), lambda: delattr(owner, name)):
        with pytest.raises(AttributeError, match=name):
            change()
    assert getattr(owner, name, None) is before or getattr(owner, name) == before


@pytest.mark.parametrize(("owner", "names"), READ_ONLY, ids=[type(owner).__name__ for owner, _ in READ_ONLY])
def test_attributes_are_read_only(owner: Any, names: str) -> None:
    for name in names.split():
        check_read_only(owner, name)


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_read_only(name: str) -> None:
    with pytest.raises(ValueError, match="read-only"):
        ARRAYS[name]()[...] = 0


def test_truth_is_a_copy() -> None:
    distance = np.ones(1)
    truth = rc.Truth(("a",), distance, distance, distance, distance)
    distance[0] = 2.0
    assert truth.range[0] == 1.0


@pytest.mark.parametrize("made", [SCENE, PLATE, rc.Trajectory([0.0, 1.0], POSES), rc.models.Human(), rc.LiveGroup(2)])
def test_what_is_read_only_can_be_pickled_and_stays_so(made: Any) -> None:
    with pytest.raises(AttributeError, match="read-only"):
        pickle.loads(pickle.dumps(made)).names = ()


@pytest.mark.parametrize(
    ("kind", "arguments", "name"),
    [
        (rc.Attached, (rc.Pose(),), "parent"),
        (rc.Live, (), "newest"),
        (rc.LiveGroup, (2,), "motions"),
        (rc.Linear, (rc.Pose(),), "velocity"),
        (rc.Mesh, (PLATE.vertices, PLATE.triangles), "vertices"),
        (rc.Scene, (), "bodies"),
        (rc.Trajectory, ([0.0, 1.0], POSES), "times"),
        (rc.models.Human, (), "height"),
    ],
)
def test_subclass_has_attributes_of_its_own_beside_those_that_are_read_only(
    kind: type, arguments: tuple[Any, ...], name: str
) -> None:
    class Labelled(kind):  # type: ignore[misc]  # a parameter
        def __init__(self) -> None:
            self.label = "first"
            super().__init__(*arguments)
            self.log = ["entry"]

    made = Labelled()
    made.log = [*made.log, made.label]
    del made.log
    check_read_only(made, name)


def test_frames_keep_their_samples_whatever_becomes_of_the_array() -> None:
    cube, codes = FRAME.cube.real.copy(), np.zeros(FRAME.cube.shape, np.uint16)
    frame = rc.Frame(cube, 0.0, FRAME.radar, raw=codes)
    cube += 1.0
    codes += np.uint16(1)
    assert frame.raw is not None
    assert not frame.raw.any()
    np.testing.assert_array_equal(frame.cube, FRAME.cube.real)
    part = RECORDING[1:]
    assert np.shares_memory(part[0].cube, RECORDING.cube)  # views, as they say
