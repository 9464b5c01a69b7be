"""Labels of frames: truth, boxes and joints, with answers on paper."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

import radarcore as rc
from radarcore.dataset import JOINTS, Labels, dims_of, labels_of
from radarcore.dataset.labels import Labelled
from radarcore.models.people.figure import SEGMENTS

RADAR = rc.bgt60tr13c(num_chirps=16)
MIDDLE = 0.5 * RADAR.waveform.duration
SENSOR = rc.Pose.from_rpy([0.3, -0.4, 1.1], [0.1, -0.2, 0.7])
EVERYTHING = Labels(boxes=True, visibility=True, joints=True, cells=True)


def labelled(simulator: rc.Simulator, names: list[str], settings: Labels, time: float = 0.0) -> dict[str, Labelled]:
    return labels_of(simulator, simulator.frame(time), names, settings)


def walker() -> rc.models.Human:
    return rc.models.Human(height=1.8, speed=0.8, path=[[4.0, 0.3], [1.0, 0.0]])


def test_truth_is_that_of_the_frame_in_the_order_of_the_names() -> None:
    scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-1.0, 0.0, 0.0], name=name) for name in ("cat", "dog")])
    simulator = rc.Simulator(scene, RADAR)
    frame = simulator.frame(0.25)
    labels = labels_of(simulator, frame, ["dog", "bird", "cat"])
    assert frame.truth is not None
    for name in ("range", "velocity", "azimuth", "elevation"):
        dog, bird, cat = labels[f"true_{name}"].values
        assert [cat, dog] == getattr(frame.truth, name).tolist()
        assert np.isnan(bird)


def test_truth_of_a_person_is_that_of_the_nearest_visible_part() -> None:
    simulator = rc.Simulator(rc.Scene(walker().bodies(name="eve")), RADAR, radar_motion=rc.Pose([0.0, 0.0, 1.0]))
    frame = simulator.frame(0.5)
    labels = labels_of(simulator, frame, ["eve"])
    assert frame.truth is not None
    nearest = np.nanargmin(frame.truth.range)
    assert labels["true_range"].values == np.nanmin(frame.truth.range)
    assert labels["true_velocity"].values == frame.truth.velocity[nearest]


def test_box_of_a_rotated_cuboid_is_that_on_paper() -> None:
    """In the axes of a sensor that is somewhere else; at the middle of the frame."""
    yaw, size, velocity = np.deg2rad(30.0), np.array([0.4, 0.2, 0.1]), np.array([-1.0, 0.5, 0.2])
    local = rc.Pose.from_rpy([2.0, 0.1, -0.2], [0.0, 0.0, yaw])
    motion = rc.Linear(SENSOR @ local, velocity=SENSOR.rotation @ velocity)
    body = rc.Body(rc.shapes.box(size), motion=motion, name="box")
    simulator = rc.Simulator(rc.Scene([body]), RADAR, radar_motion=SENSOR)
    labels = labelled(simulator, ["box"], Labels(boxes=True), time=0.1)
    cos, sin = np.cos(yaw), np.sin(yaw)
    expected = [0.4 * cos + 0.2 * sin, 0.4 * sin + 0.2 * cos, 0.1]
    np.testing.assert_allclose(labels["box_size"].values, [expected], atol=1e-12)
    center = local.position + (0.1 + MIDDLE) * velocity
    np.testing.assert_allclose(labels["box_center"].values, [center], atol=1e-12)


def test_box_of_a_body_that_deforms_is_that_of_its_vertices() -> None:
    plate = rc.shapes.plate(0.2, 0.2)
    breath = rc.Deformation([0.0, 1.0], [plate.vertices, plate.vertices * 3.0])
    body = rc.Body(plate, motion=rc.Pose([2.0, 0.0, 0.0]), deformation=breath, name="chest")
    labels = labelled(rc.Simulator(rc.Scene([body]), RADAR), ["chest"], Labels(boxes=True), time=0.5)
    factor = 1.0 + 2.0 * (0.5 + MIDDLE)
    np.testing.assert_allclose(labels["box_size"].values, [[0.0, 0.2 * factor, 0.2 * factor]], atol=1e-12)


def test_box_of_several_parts_is_around_them_all_and_that_of_a_point_the_point() -> None:
    parts = [rc.Body(rc.shapes.box(0.1), motion=rc.Pose([2.0, y, 0.0]), name=f"pair/{y}") for y in (-0.3, 0.5)]
    point = rc.PointTarget([3.0, 0.0, 0.1], name="point")
    labels = labelled(rc.Simulator(rc.Scene([*parts, point]), RADAR), ["pair", "point", "cat"], Labels(boxes=True))
    center, size = labels["box_center"].values, labels["box_size"].values
    np.testing.assert_allclose(center[:2], [[2.0, 0.1, 0.0], [3.0, 0.0, 0.1]], atol=1e-12)
    np.testing.assert_allclose(size[:2], [[0.1, 0.9, 0.1], [0.0, 0.0, 0.0]], atol=1e-12)
    assert np.isnan([center[2], size[2]]).all()


def test_joints_are_those_of_the_model_seen_from_the_sensor() -> None:
    person = walker()
    sensor = rc.Pose.from_rpy([0.0, 0.0, 1.0], [0.0, 0.1, 0.2])
    scene = rc.Scene([*person.bodies(name="eve", subdivisions=1), rc.PointTarget([3.0, 1.0, 0.0], name="lamp")])
    simulator = rc.Simulator(scene, RADAR, radar_motion=sensor)
    joints = labelled(simulator, ["lamp", "eve"], Labels(joints=True), time=0.4)["joint_position"]
    assert joints.dims == ("body", "joint", "xyz")
    assert tuple(joints.attrs["joints"]) == JOINTS
    assert np.isnan(joints.values[0]).all()
    for joint, segment in {"left_knee": "left_shank", "right_wrist": "right_hand", "head": "head"}.items():
        expected = sensor.inverse().apply(person.segment_motion(segment).at(0.4 + MIDDLE).position)
        np.testing.assert_allclose(joints.values[1, JOINTS.index(joint)], expected, atol=1e-9)


def test_segments_with_labels_of_their_own_have_the_joints_in_the_row_of_the_pelvis() -> None:
    names = [f"eve/{segment}" for segment in SEGMENTS]
    simulator = rc.Simulator(rc.Scene(walker().bodies(name="eve", subdivisions=1)), RADAR)
    labels = labelled(simulator, names, Labels(joints=True))
    whole = labelled(simulator, ["eve"], Labels(joints=True))
    found = np.isfinite(labels["joint_position"].values).all(axis=(1, 2))
    assert [name for name, has in zip(names, found, strict=True) if has] == ["eve/pelvis"]
    np.testing.assert_array_equal(labels["joint_position"].values[found], whole["joint_position"].values)


def test_labels_have_the_layout_that_was_announced() -> None:
    scene = rc.Scene([*walker().bodies(name="eve", subdivisions=1), rc.PointTarget([3.0, 1.0, 0.0], name="lamp")])
    names = ["lamp", "eve", "cat"]
    labels = labelled(rc.Simulator(scene, RADAR), names, EVERYTHING)
    layouts = dims_of(RADAR, names, EVERYTHING)
    assert list(labels) == list(layouts)
    for name, layout in layouts.items():
        values = labels[name].values
        found = (labels[name].dims, values.shape, values.dtype, labels[name].attrs)
        assert found == tuple(layout)
        assert {"units", "long_name"} <= layout.attrs.keys()


def test_labels_off_are_not_there() -> None:
    simulator = rc.Simulator(rc.Scene([rc.PointTarget([3.0, 1.0, 0.0], name="lamp")]), RADAR)
    assert labelled(simulator, ["lamp"], Labels(truth=False)) == {}
    assert list(labelled(simulator, ["lamp"], Labels(truth=False, visibility=True))) == ["visibility"]


def test_an_empty_scene_has_labels_of_nothing() -> None:
    simulator = rc.Simulator(rc.Scene(), RADAR)
    labels = labels_of(simulator, simulator.frame(0.0), ["cat"], EVERYTHING)
    assert (labels["strongest_body"].values == -1).all()
    assert np.isnan(labels["visibility"].values).all()
    assert np.isnan(labels["box_size"].values).all()


def test_labels_do_not_keep_the_simulator() -> None:
    simulator = rc.Simulator(rc.Scene([rc.PointTarget([3.0, 1.0, 0.0], name="lamp")]), RADAR)
    labelled(simulator, ["lamp"], EVERYTHING)
    alive = weakref.ref(simulator)
    del simulator
    gc.collect()
    assert alive() is None


def test_labels_of_a_frame_do_not_depend_on_those_before() -> None:
    bodies = walker().bodies(name="eve", subdivisions=1)
    simulators = [rc.Simulator(rc.Scene(bodies), RADAR, radar_motion=rc.Pose([0.0, 0.0, 1.0])) for _ in range(2)]
    labelled(simulators[0], ["eve"], EVERYTHING, time=0.1)
    first, second = (labelled(each, ["eve"], EVERYTHING, time=0.6) for each in simulators)
    for name, label in first.items():
        np.testing.assert_array_equal(label.values, second[name].values)


TWO = np.array([[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0]])
RADARS = {
    "two waveforms": rc.Radar(RADAR.waveform.alternating()),
    "no sweep": rc.Radar(RADAR.waveform.replace(slope=0.0)),
    "staggered": rc.Radar(RADAR.waveform.replace(chirp_times=1e-3 * np.array([0, 1, 2, 4, 5, 7, *range(8, 18)]))),
    "all at once": rc.Radar(RADAR.waveform, tx=TWO, schedule=rc.Schedule.ddm()),
    "in turn": rc.Radar(RADAR.waveform, tx=TWO, schedule=rc.Schedule.tdm()),
    "one chirp": rc.Radar(RADAR.waveform.replace(num_chirps=1)),
    "phase noise": rc.Radar(RADAR.waveform, receiver=rc.Receiver(phase_noise=[(1e5, -80.0)], noise_figure_db=10.0)),
}


@pytest.mark.parametrize("name", RADARS)
def test_labels_are_there_for_every_kind_of_radar(name: str) -> None:
    rough, ahead = rc.Material.lambertian(0.5), rc.Pose([2.0, 0.0, 0.0])
    plate = rc.Body(rc.shapes.plate(0.4, 0.4), material=rough, motion=ahead, name="plate")
    wall = rc.Body(rc.shapes.plate(1.0, 2.0), motion=rc.Pose([1.0, -0.5, 0.0]), name="wall")
    simulator = rc.Simulator(rc.Scene([plate, wall]), RADARS[name])
    settings = Labels(boxes=True, visibility=True, joints=True, cells=name in ("in turn", "one chirp", "phase noise"))
    labels = labelled(simulator, ["plate", "wall"], settings)
    np.testing.assert_allclose(labels["visibility"].values, [0.5, 1.0], atol=0.03)
    np.testing.assert_allclose(labels["box_center"].values[0], [2.0, 0.0, 0.0], atol=1e-12)
    if settings.cells:
        assert {0, 1} <= {*labels["strongest_body"].values.ravel()}


def test_labels_of_live_motions_are_those_of_the_frame() -> None:
    """Between updates bodies go on with the velocity that they have."""
    pose = rc.Live()
    pose.update(0.0, rc.Pose([2.0, 0.0, 0.0]), velocity=[1.0, 0.0, 0.0])
    simulator = rc.Simulator(rc.Scene([rc.Body(rc.shapes.box(0.2), motion=pose, name="cart")]), RADAR)
    for time in (0.0, 0.5):
        pose.update(time, rc.Pose([2.0 + time, 0.0, 0.0]), velocity=[1.0, 0.0, 0.0])
        labels = labelled(simulator, ["cart"], EVERYTHING, time=time)
        np.testing.assert_allclose(labels["box_center"].values, [[2.0 + time + MIDDLE, 0.0, 0.0]], atol=1e-9)
        assert labels["true_range"].values == pytest.approx(1.9 + time + MIDDLE, abs=1e-4)
        assert labels["visibility"].values == 1.0
