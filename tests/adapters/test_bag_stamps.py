"""Bag stamps that are not the times of the poses: repairs and warnings, for a cart at -0.5 m/s."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters.ros import (
    BagMotions,
    BagReader,
    BagWriter,
    DepthImages,
    pose_series,
    to_map_image,
    to_pose_stamped,
    to_transforms,
)
from ros_bags import POSE, START_NS, header_of, pose_of

JOINTS = "sensor_msgs/msg/JointState"
PERIOD, NUM, SPEED = 0.025, 161, -0.5
TRUE = np.arange(NUM) * PERIOD


def place(times: Any) -> Any:
    return 3.0 + SPEED * np.asarray(times)


def write_cart(path: Path, stamps: Any, places: Any, recorded: Any = None, start: int = START_NS) -> Path:
    """Poses on ``/cart``: stamps and times of recording [s] after `start`; a stamp of None is zero."""
    recorded = stamps if recorded is None else recorded
    with BagWriter(path) as bag:
        for stamp, time, x in zip(stamps, recorded, places, strict=True):
            head = header_of(0 if stamp is None else start + round(stamp * 1e9))
            bag.write(
                "/cart", {"header": head, "pose": pose_of([x, 0.0, 0.0])}, START_NS + round(time * 1e9), type=POSE
            )
    return path


def cart_of(path: Path) -> tuple[Any, tuple[float, float] | None, list[str]]:
    """Motion of the cart, its span, and the warnings."""
    with BagReader(path) as bag, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recorded = BagMotions(bag)
        motion = recorded.motion("/cart")
        return motion, recorded.span, [str(entry.message) for entry in caught]


RNG = np.random.default_rng(5)
BUNCHED = np.ceil(TRUE / 0.1 - 1e-9) * 0.1 + 50e-6 * (np.arange(-1, NUM - 1) % 4)
"""Reception times of four poses every 0.1 s, with intervals of 50 us."""
JITTER = np.sort(TRUE + RNG.uniform(0.0, 0.03, NUM))
SLIGHT = TRUE + RNG.uniform(0.0, 0.005, NUM)
HICCUP = np.where(np.arange(NUM) == 80, TRUE + 0.024, TRUE)
IRREGULAR = np.cumsum(RNG.uniform(0.002, 0.05, NUM))
GAP = TRUE + 1.5 * (np.arange(NUM) >= 100)
LATE = np.r_[0:80, 84, 85, 80:84, 86:NUM]
"""Order of arrival with some late messages."""


@pytest.mark.parametrize(
    ("stamps", "true", "expected", "error"),
    [
        # (stamps, times of the poses, parts of the warning, error of the speed [m/s])
        (
            BUNCHED,
            TRUE,
            ["with bunches or jitter (intervals 5e-05 to 0.0998 s, 0.025 s", "up to 0.0749 s earlier"],
            5e-3,
        ),
        (JITTER, TRUE, ["give speeds of", "regular times replace them"], 5e-3),
        (SLIGHT, TRUE, ["give speeds of", "regular times replace them, up to 0.00"], 5e-3),
        (HICCUP, TRUE, ["intervals 0.001 to 0.049 s", "give speeds of 12.5 m/s (0.5", "up to 0.024 s earlier"], 1e-9),
        (BUNCHED + GAP - TRUE, GAP, ["with bunches", "no messages from"], 5e-3),
        (IRREGULAR, IRREGULAR, [], 1e-6),
        (GAP, GAP, ["no messages from 2.475 to 4 s"], 1e-9),
        (TRUE[LATE], TRUE[LATE], [], 1e-9),
    ],
)
def test_reception_times_do_not_shake_the_motion(
    tmp_path: Path, stamps: Any, true: Any, expected: list[str], error: float
) -> None:
    motion, _, messages = cart_of(write_cart(tmp_path / "bag", stamps, place(true), recorded=np.arange(NUM) * PERIOD))
    text = "\n".join(messages)
    assert all(one in text for one in expected)
    assert len(messages) == len({one.partition(":")[2][:10] for one in messages}) <= len(expected)
    for time in np.linspace(0.2, 3.8, 301).tolist():
        assert motion.rate_at(time)[0, 3] == pytest.approx(SPEED, abs=error)
        assert motion.at(time).position[0] == pytest.approx(place(time + stamps[0]), abs=error)


def test_irregular_poses_with_irregular_stamps_keep_them_with_a_warning(tmp_path: Path) -> None:
    """Noise of 5 cm over intervals of 1 ms: the right times are unknown."""
    times = np.concatenate([[t, t + 0.001] for t in np.cumsum(RNG.uniform(0.02, 0.2, 60))])
    places = place(times) + 0.05 * (np.arange(120) % 2) * np.repeat(RNG.uniform(0.5, 1.0, 60), 2)
    motion, _, messages = cart_of(write_cart(tmp_path / "bag", times, places, recorded=times))
    assert len(messages) == 1
    assert "they are kept, and velocities are wrong there" in messages[0]
    assert motion.at(float(times[7] - times[0])).position[0] == pytest.approx(places[7])


@pytest.mark.parametrize("unset", [range(21), range(0, 21, 3), [0], [7]], ids=["all", "some", "first", "one"])
def test_stamps_of_zero_become_times_of_recording(tmp_path: Path, unset: Any) -> None:
    times = np.arange(21) * 0.05
    stamps: list[Any] = times.tolist()
    for k in unset:
        stamps[k] = None
    # Recorded 0.2 s late: the times of recording are corrected by the delay of the other messages.
    delay = 0.0 if len(unset) == 21 else 0.2
    motion, span, messages = cart_of(write_cart(tmp_path / "bag", stamps, place(times), recorded=times + delay))
    assert messages == [
        f"/cart: header stamps of {len(unset)} of 21 messages are zero; times of recording replace them"
    ]
    first = 0.05 if stamps[0] is None and len(unset) < 21 else 0.0  # the first stamp of the bag is time 0
    assert span == pytest.approx((-first, 1.0 - first))
    np.testing.assert_allclose(motion.rate_at(0.5)[:, 3], [SPEED, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(motion.at(0.5).position[0], place(0.5 + first), atol=1e-9)


def test_a_simulated_clock_may_start_at_zero(tmp_path: Path) -> None:
    times = np.arange(21) * 0.05
    motion, span, messages = cart_of(write_cart(tmp_path / "bag", times, place(times), recorded=times + 7.0, start=0))
    assert (span, messages) == ((0.0, 1.0), [])
    np.testing.assert_allclose(motion.rate_at(0.5)[:, 3], [SPEED, 0.0, 0.0], atol=1e-9)


def test_bare_messages_without_stamps_are_refused(tmp_path: Path) -> None:
    messages = [to_pose_stamped(rc.Pose([place(t), 0.0, 0.0]), time_ns=0) for t in TRUE[:5]]
    with pytest.raises(
        ValueError, match="messages: expected stamps in headers, got zero in 5 of 5 messages; give mess"
    ):
        pose_series(messages)
    path = write_cart(tmp_path / "bag", [None] * 5, place(TRUE[:5]), recorded=TRUE[:5])
    with BagReader(path) as bag, pytest.warns(UserWarning, match="5 of 5 messages are zero"):
        series = pose_series(bag.messages("/cart"))
    np.testing.assert_allclose(series.times(START_NS), TRUE[:5], atol=1e-9)


@pytest.mark.parametrize("shift", [0.003, 0.0, -40.0], ids=["reset", "loop", "far back"])
def test_a_second_run_is_left_out_with_a_warning(tmp_path: Path, shift: float) -> None:
    times = np.arange(21) * 0.05
    stamps, recorded = np.r_[times, times + shift] + 50.0, np.r_[times, times + 2.0]
    places = np.r_[place(times), place(times) + 2.0]
    motion, span, messages = cart_of(write_cart(tmp_path / "bag", stamps, places, recorded=recorded))
    assert span == (0.0, 1.0)
    assert len(messages) == 1
    assert f"/cart: stamps go back by {1.0 - shift:g} s after message 21, by a reset, a loop" in messages[0]
    assert "the 21 of 42 messages from there on are left out" in messages[0]
    for time in np.linspace(0.0, 1.0, 101).tolist():
        assert motion.rate_at(time)[0, 3] == pytest.approx(SPEED, abs=1e-9)


def test_repeated_stamps_with_other_poses_raise_a_warning(tmp_path: Path) -> None:
    times = np.repeat(np.arange(11) * 0.1, 2)
    for name, places, expected in (("same", place(times), 0), ("other", place(times) + 0.01 * (np.arange(22) % 2), 1)):
        motion, _, messages = cart_of(write_cart(tmp_path / name, times, places, recorded=np.arange(22) * 0.05))
        assert messages == expected * ["/cart: 11 of 22 messages repeat a stamp with other values; left out"]
        np.testing.assert_allclose(motion.rate_at(0.55)[:, 3], [SPEED, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("fault", ["nan", "no quaternion"])
def test_invalid_poses_are_gaps(tmp_path: Path, fault: str) -> None:
    """On a topic of poses, and in TF."""
    with BagWriter(tmp_path / "bag") as bag:
        for k in range(21):
            time = START_NS + k * 50_000_000
            x = place(0.05 * k) if k != 7 or fault != "nan" else np.nan
            pose = pose_of([x, 0.0, 0.0], (0.0, 0.0, 0.0, 0.0 if k == 7 and fault != "nan" else 1.0))
            bag.write("/cart", {"header": header_of(time), "pose": pose}, time, type=POSE)
            turned = {"translation": pose["position"], "rotation": pose["orientation"]}
            transform = {"header": header_of(time), "child_frame_id": "cart", "transform": turned}
            bag.write("/tf", {"transforms": [transform]}, time, type="tf2_msgs/msg/TFMessage")
    with BagReader(tmp_path / "bag") as read:
        recorded = BagMotions(read)
        for motion in (recorded.motion("/cart"), recorded.motion("/tf", frame="cart")):
            for when in (0.3, 0.35, 0.4):
                np.testing.assert_allclose(motion.rate_at(when)[:, 3], [SPEED, 0.0, 0.0], atol=1e-9)
        with pytest.raises(ValueError, match="gap"):
            recorded.motion("/cart", max_gap=0.08).at(0.35)


def test_a_frame_with_two_parents_leaves_the_others_usable(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for k in range(21):
            time, types = START_NS + k * 50_000_000, bag.types
            cart, cup = {"cart": rc.Pose([place(0.05 * k), 0.0, 0.0])}, {"cup": rc.Pose([0.0, 0.0, 0.1])}
            bag.write("/tf", to_transforms(cart, time_ns=time, frame_id="map", types=types), time)
            parent = "table" if k < 10 else "cart"
            bag.write("/tf", to_transforms(cup, time_ns=time, frame_id=parent, types=types), time)
    with BagReader(tmp_path / "bag") as read:
        recorded = BagMotions(read)
        np.testing.assert_allclose(recorded.motion("/tf", frame="cart").rate_at(0.5)[0, 3], SPEED, atol=1e-9)
        with pytest.raises(ValueError, match="expected one parent of 'cup', got 'table' and 'cart'"):
            recorded.motion("/tf", frame="cup")


@pytest.mark.parametrize(
    ("stamps", "times", "expected"),
    [
        ([None] * 6, np.arange(6) * 0.1, "header stamps are zero; times of recording replace them"),
        (
            [0.0, 0.1, 0.2, 0.2, 0.0, 0.3],
            [0.0, 0.1, 0.2, 0.3],
            "images with stamps not later than the image before are left out",
        ),
        (
            [0.0, 0.001, 0.2, 0.201, 0.4, 0.401],
            None,
            "intervals of images are 0.001 to 0.199 s, 0.0802 s on average; if the",
        ),
    ],
)
def test_stamps_of_depth_images_are_repaired_with_a_warning(
    tmp_path: Path, stamps: Any, times: Any, expected: str
) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for k, stamp in enumerate(stamps):
            time_ns = 0 if stamp is None else START_NS + round(stamp * 1e9)
            image = to_map_image(np.full((4, 6), 2.0 - 0.1 * k), time_ns=time_ns, types=bag.types)
            bag.write("/camera/depth", image, START_NS + k * 100_000_000)
    with BagReader(tmp_path / "bag") as read, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = [image.time for image in DepthImages(read, camera=(60.0, 45.0))]
    assert len(caught) == 1
    assert expected in str(caught[0].message)
    np.testing.assert_allclose(np.array(found), stamps if times is None else times, atol=1e-9)


def test_joints_of_two_publishers_are_merged(tmp_path: Path) -> None:
    """An arm at 40 Hz, and its gripper 3 ms later with one NaN."""
    with BagWriter(tmp_path / "bag") as bag:
        for k in range(41):
            for delay, state in ((0.0, {"a": 1.0, "b": 2.0}), (0.003, {"grip": 0.4})):
                time = k * PERIOD + delay
                sent = [np.nan if k == 20 and name == "grip" else np.sin(rate * time) for name, rate in state.items()]
                message = {"name": list(state), "position": np.array(sent), "velocity": [], "effort": []}
                stamp = START_NS + round(time * 1e9)
                bag.write("/joint_states", message | {"header": header_of(stamp)}, stamp, type=JOINTS)
    with BagReader(tmp_path / "bag") as read:
        recorded = BagMotions(read)
        times, angles = recorded.joints()
        chosen, few = recorded.joints(names=["grip", "a"])
    assert angles.shape == (40, 3)  # not the first, before which the gripper is not known
    # Splines of cubes: a fourth derivative of 0.4^4, the interval of 25 ms, and a hole of 50 ms; natural ends.
    np.testing.assert_allclose(angles, np.sin(np.outer(times, [1.0, 2.0, 0.4])), atol=2e-6)
    np.testing.assert_array_equal(few, angles[:, [2, 0]])
    np.testing.assert_array_equal(chosen, times)
    assert all(later > earlier for earlier, later in pairwise(times.tolist()))
