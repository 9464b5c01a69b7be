"""CSV files of Motive, in all versions: known motions come back, gaps as gaps, lengths in metres, z up."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from doubles.motive_files import MARKERS, motive_file
from radarcore.adapters.optitrack import CapturedBody, MotionCapture, read_motive_csv, write_motive_csv

TIMES = 2.5 + np.arange(60) / 120.0
HIDDEN = {"radar": list(range(20, 40)), "person": [5]}


def radar_pose(t: float) -> rc.Pose:
    return rc.Pose.from_rpy([0.1 * np.sin(5.0 * t), 0.2, 1.2 + 0.1 * t], [0.2, -0.3, t])


def person_pose(t: float) -> rc.Pose:
    return rc.Pose.from_rpy([2.0 - t, 0.5, 0.9], [0.0, 0.1 * np.sin(7.0 * t), 2.0 * t])


BODIES = {"radar": radar_pose, "person": person_pose}

VARIANTS: dict[str, dict[str, Any]] = {
    "1.21": {"version": "1.21"},
    "1.21 without missing cells at the end": {"version": "1.21", "keep_trailing": False},
    "1.23": {"version": "1.23"},
    "1.23 in centimetres": {"version": "1.23", "unit": "Centimeters"},
    "1.24 with time code": {"version": "1.24", "time_code": True, "first_frame": 300},
    "1.25 with parents in millimetres": {"version": "1.25", "parent": True, "unit": "Millimeters"},
    "1.25 bones": {"version": "1.25", "kind": "Bone", "time_code": True, "parent": True},
}


@pytest.fixture
def take(tmp_path: Path) -> Path:
    return motive_file(tmp_path / "t1.csv", BODIES, TIMES)


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=VARIANTS.keys())
def test_known_motions_come_back(variant: dict[str, Any], tmp_path: Path) -> None:
    capture = read_motive_csv(motive_file(tmp_path / "t1.csv", BODIES, TIMES, hidden=HIDDEN, **variant))
    assert capture.names == ("radar", "person")
    assert (capture.take, capture.start_time) == ("t1", "2019-09-18 04.30.02.695 PM")
    assert capture.frame_rate == pytest.approx(120.0)
    np.testing.assert_allclose(capture.time, TIMES, atol=5e-7)  # six digits
    for name, motion in BODIES.items():
        seen = np.setdiff1d(np.arange(60), HIDDEN[name])
        body = capture[name]
        np.testing.assert_array_equal(np.flatnonzero(body.is_tracked), seen)
        assert np.isnan(body.position[~body.is_tracked]).all()
        assert np.isnan(body.rotation[~body.is_tracked]).all()
        # Nine digits of metres or less.
        expected = [motion(t) for t in TIMES[seen]]
        np.testing.assert_allclose(body.position[seen], [pose.position for pose in expected], atol=1e-9)
        np.testing.assert_allclose(body.rotation[seen], [pose.rotation for pose in expected], atol=4e-9)
        np.testing.assert_allclose(body.mean_marker_error[seen], 0.000214, atol=1e-9)
        first, *_ = (places for label, places in capture.body_markers.items() if label.startswith(name))
        np.testing.assert_allclose(first[seen], [pose.apply(MARKERS[0]) for pose in expected], atol=1e-9)
        assert np.isnan(first[~body.is_tracked]).all()
    np.testing.assert_allclose(capture.markers["Unlabeled 1189"], [[1.0, 2.0, 3.0]] * 60, atol=1e-6)


def test_gaps_of_the_capture_are_gaps_of_the_trajectory(tmp_path: Path) -> None:
    capture = read_motive_csv(motive_file(tmp_path / "t1.csv", BODIES, TIMES, hidden=HIDDEN))
    radar = capture.trajectory("radar", clock_offset=10.0)
    np.testing.assert_allclose(radar.gaps, [[10.0 + TIMES[19], 10.0 + TIMES[40]]], atol=1e-6)
    with pytest.raises(ValueError, match=r"within a gap of this Trajectory, from 12\.658333 to 12\.833333 s"):
        radar.at(10.0 + TIMES[30])
    assert capture.trajectory("radar", max_gap=None).gaps.shape == (0, 2)
    # One missing frame is bridged: cubics over 1/60 s of 0.1 rad at 7 rad/s are off by 0.1 (7/60)^4 / 100.
    person = capture.trajectory("person")
    assert person.gaps.shape == (0, 2)
    expected = person_pose(TIMES[5])
    np.testing.assert_allclose(person.at(TIMES[5]).position, expected.position, atol=1e-6)
    np.testing.assert_allclose(person.at(TIMES[5]).rotation, expected.rotation, atol=1e-5)


@pytest.mark.parametrize("axes", ["z_up", "z_up_world", "unchanged"])
def test_turning_bodies_turn_in_the_right_sense(axes: str, tmp_path: Path) -> None:
    # Counted from above, a body that turns to the left by 2 rad/s, at (1, 2, 3) m.
    bodies = {"top": lambda t: rc.Pose.from_rpy([1.0, 2.0, 3.0], [0.0, 0.0, 2.0 * t])}
    motion = read_motive_csv(motive_file(tmp_path / "t1.csv", bodies, TIMES), axes=axes).trajectory("top")
    pose, rate = motion.at(2.7), motion.rate_at(2.7)
    turning = rate[:, :3] @ pose.rotation.T  # angular velocity, as the matrix of omega x
    up = {"z_up": 2, "z_up_world": 2, "unchanged": 1}[axes]
    expected = np.zeros(3)
    expected[up] = 2.0
    # Times have six digits: steps of 8.3 ms are off by 0.5 us.
    np.testing.assert_allclose([turning[2, 1], turning[0, 2], turning[1, 0]], expected, atol=2.0 * 1e-6 * 120.0)
    np.testing.assert_allclose(pose.position, [1.0, 3.0, -2.0] if axes == "unchanged" else [1.0, 2.0, 3.0], atol=1e-9)


def test_body_at_rest_has_the_axes_that_were_asked_for(tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", {"still": lambda _: rc.Pose()}, TIMES)
    np.testing.assert_allclose(read_motive_csv(path)["still"].rotation[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(read_motive_csv(path, axes="unchanged")["still"].rotation[0], np.eye(3), atol=1e-12)
    # Its own y axis, up in Motive, is up in the world.
    turned = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    np.testing.assert_allclose(read_motive_csv(path, axes="z_up_world")["still"].rotation[0], turned, atol=1e-12)


@pytest.mark.parametrize("num_bytes", [1, 40, 700])
def test_truncated_file_is_read_up_to_its_last_whole_frame(num_bytes: int, take: Path) -> None:
    whole = take.read_bytes()
    take.write_bytes(whole[: -2 - num_bytes])
    if num_bytes == 1:  # the last line has all cells: its last number may be shorter, but none is missing
        assert len(read_motive_csv(take)) == 60
        return
    number = 60 - whole[-2 - num_bytes :].count(b"\r\n")
    with pytest.warns(UserWarning, match=rf"t1.csv: expected 60 frames, got {number}: the file is truncated after 2.9"):
        capture = read_motive_csv(take)
    np.testing.assert_allclose(capture.time, TIMES[:number], atol=5e-7)
    assert capture["person"].is_tracked.all()


def test_missing_unit_can_be_given(tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", BODIES, TIMES, unit=None)
    there = read_motive_csv(path, length_unit="millimeters")["person"].position
    np.testing.assert_allclose(1000.0 * there, read_motive_csv(path, length_unit="meters")["person"].position)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (rb"Frame,Time \(Seconds\)", b"F,T", "expected a line that begins with 'Frame', got none: truncated"),
        (b",Position,Position", b",Place,Place", "expected a column 'Position X' of Rigid Body 'radar', got none"),
        (b"Position,Mean Marker", b"Place,Mean Marker", "expected a column 'Position Z' of Rigid Body 'radar', got no"),
        (b",Z,W,", b",Z,,", "a column 'Rotation W' of Rigid Body 'radar', got none; export the take with quaternions"),
        (b",Type,", b",Kind,", r"expected a line labelled 'Type', got \['kind', 'name', 'id'\]"),
        (b"\r\n7,2.558333,", b"\r\n7,2.558333,x", "line 15: expected numbers, got 'x"),
        (b"\r\n7,2.558333,", b"\r\n7,2.558333,inf", "line 15: expected numbers, got 'inf"),
        (b"Format Version", b"x" * 140_000, "t1.csv: expected text in cells between commas, got something else"),
        (b"\r\n7,2.558333,", b"\r\n7,,", r"line 15: expected a time in the second cell, got none"),
        (b"\r\n7,2.558333,", b"\r\n7,1.0,", r"Time: expected increasing times \[s\], got 2.55 and then 1 at index 7"),
        (b"Quaternion", b"XYZ", "expected the Rotation Type Quaternion, got 'XYZ'; export the take with"),
        (b"Global", b"Local", "expected the Coordinate Space Global, got 'Local'"),
        (b"Meters", b"Feet", "expected Length Units Meters, Centimeters or Millimeters, got 'feet'"),
        (b"Length Units", b"Lengths", r"expected 'Length Units' in the first line, got none; give length_unit="),
        (b"Format Version,1.23,", b"", "expected 'Format Version' in the first line .* got 'Take Name'"),
        (b",", b";", "expected 'Format Version' in the first line and commas"),
        (b",", b"\t", "expected 'Format Version' in the first line and commas"),
        (rb"(?s)\n0,2\.5.*", b"\n", "t1.csv: expected frames below the line 'Frame', got none"),
        (rb"(?s).*", b"", "t1.csv: expected 'Format Version' in the first line"),
    ],
)
def test_damaged_file_is_an_error_that_names_the_place(old: bytes, new: bytes, message: str, take: Path) -> None:
    damaged, number = re.subn(old, new, take.read_bytes())
    assert number > 0
    take.write_bytes(damaged)
    with pytest.raises(ValueError, match=message):
        read_motive_csv(take)


def test_warning_names_types_that_are_not_read(take: Path) -> None:
    lines = take.read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("Frame"))
    kinds, names = (next(k for k in range(head) if lines[k].startswith(f",{label},")) for label in ("Type", "Name"))
    added = {kinds: 2 * ",Trained Markerset Bone" + ",Force Plate", names: 2 * ",hand:Wrist" + ",plate 1"}
    added[head - 1], added[head] = 2 * ",Position" + ",Fx", ",X,Y,"
    take.write_text("".join(line + added.get(k, "") + "\n" for k, line in enumerate(lines)))
    left_out = r"left out: Trained Markerset Bone \(hand:Wrist\), Force Plate \(plate 1\)$"
    with pytest.warns(UserWarning, match=rf"t1.csv: expected types Rigid Body, Bone, .*; {left_out}"):
        assert read_motive_csv(take).names == ("radar", "person")


def test_mark_of_the_encoding_is_left_out(take: Path) -> None:
    take.write_text("\ufeff" + take.read_text())
    assert read_motive_csv(take).names == ("radar", "person")


def test_wrong_requests_are_errors_that_name_them(tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", BODIES, TIMES, hidden={"radar": list(range(59))})
    capture = read_motive_csv(path)
    with pytest.raises(KeyError, match=r"no body 'persn' in the capture; did you mean 'person'\?"):
        capture["persn"]
    with pytest.raises(ValueError, match=r"name: expected a body .* seen in at least two frames, got 'radar', in 1"):
        capture.trajectory("radar")
    with pytest.raises(ValueError, match="axes: expected"):
        read_motive_csv(path, axes="y_up")
    with pytest.raises(ValueError, match="length_unit: expected 'meters', as the file says, got 'centimeters'"):
        read_motive_csv(path, length_unit="centimeters")
    with pytest.raises(FileNotFoundError):
        read_motive_csv(tmp_path / "t2.csv")


@pytest.mark.parametrize("axes", ["z_up", "z_up_world", "unchanged"])
def test_saved_capture_is_read_back(axes: str, tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", BODIES, TIMES, hidden=HIDDEN)
    capture = read_motive_csv(path, axes=axes)
    write_motive_csv(tmp_path / "again.csv", capture, axes=axes)
    again = read_motive_csv(tmp_path / "again.csv", axes=axes)
    assert (again.names, again.take, again.start_time) == (capture.names, capture.take, capture.start_time)
    assert again.frame_rate == capture.frame_rate
    np.testing.assert_array_equal(again.time, capture.time)
    for name in BODIES:
        np.testing.assert_allclose(again[name].position, capture[name].position, atol=1e-9)
        np.testing.assert_allclose(again[name].quaternion, capture[name].quaternion, atol=2e-9)
        np.testing.assert_allclose(again[name].mean_marker_error, capture[name].mean_marker_error, atol=1e-9)
    for group in ("markers", "body_markers"):
        places, expected = getattr(again, group), getattr(capture, group)
        assert list(places) == list(expected)
        for name in expected:
            np.testing.assert_allclose(places[name], expected[name], atol=1e-9)
    with pytest.raises(FileExistsError, match="got a file; overwrite=True replaces it"):
        write_motive_csv(tmp_path / "again.csv", capture)


def test_body_with_a_quaternion_of_zeros_was_not_seen(tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", {"still": lambda _: rc.Pose()}, TIMES[:3])
    path.write_bytes(re.sub(rb"2\.508333,(0\.0+,){3}1\.0", b"2.508333,0,0,0,0", path.read_bytes()))
    np.testing.assert_array_equal(read_motive_csv(path)["still"].is_tracked, [True, False, True])


@pytest.mark.filterwarnings("ignore:t1.csv. expected")
def test_damaged_bytes_are_errors_of_the_file_or_another_take(tmp_path: Path) -> None:
    path = motive_file(tmp_path / "t1.csv", BODIES, TIMES[:4], hidden=HIDDEN)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    num_refused = 0
    for _ in range(150):
        damaged = bytearray(whole)
        for place in rng.integers(len(whole), size=2):
            damaged[place] = rng.choice(np.frombuffer(b'\r\n,"\x00\xff0-.a', np.uint8))
        path.write_bytes(damaged)
        try:
            read_motive_csv(path)
        except ValueError as error:
            num_refused += 1
            assert str(error).startswith("t1.csv")  # noqa: PT017  # not all of them are damaged
    assert 0 < num_refused < 150


def test_captures_of_other_systems_are_checked() -> None:
    there = np.zeros((2, 3))
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    body = CapturedBody(there, quaternion, np.zeros(2))
    there[0] = 1.0
    assert (body.position == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        body.position[0] = 1.0
    assert MotionCapture(np.array([0.0, 1.0]), {"cart": body}).trajectory("cart", max_gap=None).at(0.5) == rc.Pose()
    with pytest.raises(ValueError, match=r"quaternion: expected shape \(2, 4\), got \(2, 3\)"):
        CapturedBody(there, there, np.zeros(2))
    with pytest.raises(ValueError, match="bodies: expected 3 poses, one per time, got 2 of 'cart'"):
        MotionCapture(np.arange(3.0), {"cart": body})
    with pytest.raises(ValueError, match=r"markers\['m'\]: expected shape \(2, 3\), got \(3, 3\)"):
        MotionCapture(np.arange(2.0), {"cart": body}, {"m": np.zeros((3, 3))})
    with pytest.raises(ValueError, match=r"time: expected increasing times"):
        MotionCapture(np.zeros(2), {"cart": body})
