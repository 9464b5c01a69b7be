"""Depth images of bags become frames with ranges and velocities known on paper."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.depth import DepthImages, frame_images
from radarcore.adapters.ros.poses import to_pose_stamped
from ros_bags import FORMATS, START_NS, header_of

ROWS, COLUMNS, FOCAL = 48, 64, 60.0
DISTANCE, RADIUS, SPEED = 1.5, 0.2, 0.8
"""Of a ball in front of the camera that comes closer."""
EVERY_NS = 25_000_000
NUM_IMAGES = 6

RADAR = rc.bgt60tr13c(num_chirps=32, frame_interval=EVERY_NS * 1e-9)


def depth_of(center: float) -> NDArray[np.float32]:
    """Depth along the optical axis of a ball on it; infinite beside it (REP 117)."""
    v, u = ((np.arange(n) - (n - 1) / 2) / FOCAL for n in (ROWS, COLUMNS))
    a = 1.0 + u[None, :] ** 2 + v[:, None] ** 2
    root = center**2 - a * (center**2 - RADIUS**2)
    return np.where(root > 0.0, (center - np.sqrt(np.maximum(root, 0.0))) / a, np.inf).astype(np.float32)


def image_of(time_ns: int, pixels: NDArray[Any], encoding: str = "32FC1") -> dict[str, Any]:
    return {
        "header": header_of(time_ns, "camera_depth_optical_frame"),
        "height": ROWS,
        "width": COLUMNS,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": pixels.itemsize * COLUMNS,
        "data": np.ascontiguousarray(pixels).view(np.uint8),
    }


def info_of(time_ns: int) -> dict[str, Any]:
    k = np.array([FOCAL, 0.0, (COLUMNS - 1) / 2, 0.0, FOCAL, (ROWS - 1) / 2, 0.0, 0.0, 1.0])
    window = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    info = {"header": header_of(time_ns), "height": ROWS, "width": COLUMNS, "distortion_model": "plumb_bob"}
    r, p = np.eye(3).ravel(), np.zeros(12)
    info |= {"d": np.zeros(5), "k": k, "r": r, "p": p, "binning_x": 0, "binning_y": 0, "roi": window}
    return info


def write_depth(path: Path, kind: str = "mcap", numbers: Any = range(NUM_IMAGES)) -> Path:
    with BagWriter(path, kind) as bag:
        bag.write("/camera/depth/camera_info", info_of(START_NS), START_NS, type="sensor_msgs/msg/CameraInfo")
        for k in numbers:
            stamp = START_NS + k * EVERY_NS
            image = image_of(stamp, depth_of(DISTANCE - SPEED * 1e-9 * k * EVERY_NS))
            bag.write("/camera/depth/image_raw", image, stamp + 4_000_000, type="sensor_msgs/msg/Image")
            color = image_of(stamp, np.zeros((ROWS, COLUMNS), np.uint8), "mono8")
            bag.write("/camera/color/image_raw", color, stamp, type="sensor_msgs/msg/Image")
    return path


def frames_of(path: Path, rate: float, **options: Any) -> list[tuple[rc.Frame, int]]:
    """Frames with the numbers of those left out before each."""
    found = []
    with BagReader(path) as bag:
        for pair in frame_images(DepthImages(bag, **options), rate):
            frame = rc.frame_from_depth(
                pair.image.depth,
                1.0,
                RADAR,
                camera=pair.image.camera,
                planar=True,
                previous=pair.previous.depth,
                interval=pair.interval,
                time=pair.time,
                image_time=pair.image.time,
            )
            found.append((frame, pair.num_lost))
    return found


def check_ball(frame: rc.Frame) -> None:
    peak, wf = rc.strongest_peak(frame), RADAR.waveform
    assert peak is not None
    nearest = DISTANCE - RADIUS - SPEED * (frame.time + 0.5 * wf.chirp_times[-1])
    assert abs(peak.range - nearest) < 0.1 * wf.range_resolution
    assert abs(peak.velocity + SPEED) < 0.1 * wf.velocity_resolution


@pytest.mark.parametrize("kind", FORMATS)
def test_depth_images_become_frames_with_the_range_and_velocity_of_the_ball(tmp_path: Path, kind: str) -> None:
    frames = [frame for frame, _ in frames_of(write_depth(tmp_path / "bag", kind), 40.0)]
    # A velocity needs two images; the images give the frame interval.
    np.testing.assert_allclose([frame.time for frame in frames], 0.025 * np.arange(1, NUM_IMAGES), atol=1e-12)
    for frame in frames:
        check_ball(frame)


@pytest.mark.filterwarnings("ignore:.* intervals of images are")
def test_frames_without_images_are_left_out_and_counted(tmp_path: Path) -> None:
    """Of images 0 ... 3 and 23 ... 25, with 0.5 s between them, frames need two that are at most 0.2 s old."""
    found = frames_of(write_depth(tmp_path / "bag", numbers=[0, 1, 2, 3, 23, 24, 25]), 40.0)
    numbers = [round(frame.time / 0.025) for frame, _ in found]
    # Images 3 and 24 hold for 0.2 s, 23 has none before it.
    assert numbers == [*range(1, 12), 24, 25]
    gaps = [after - before - 1 for before, after in itertools.pairwise([0, *numbers])]
    assert [num_lost for _, num_lost in found] == gaps


def test_another_rate_takes_the_newest_image(tmp_path: Path) -> None:
    frames = frames_of(write_depth(tmp_path / "bag"), 80.0, topic="camera/depth/image_raw", camera=(56.145, 43.603))
    np.testing.assert_allclose([frame.time for frame, _ in frames], 0.025 + np.arange(9) / 80.0, atol=1e-12)
    # Pixels go on at their range rate between two images: ranges fall steadily.
    for frame, _ in frames:
        check_ball(frame)


COLOR = "/camera/color/image_raw"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"topic": "/camera/dept/image_raw"},
            r"topic: no topic '/camera/dept/image_raw' in .*; did you mean '/camera/d",
        ),
        ({"topic": COLOR}, f"topic: expected depth images, 32FC1 or 16UC1, in .*, got mono8 of '{COLOR}'"),
        (
            {"info_topic": COLOR},
            f"info_topic: expected sensor_msgs/msg/CameraInfo, got .*/Image of '{COLOR}'",
        ),
        ({"info_topic": COLOR, "camera": (56.0, 43.0)}, "info_topic: expected none together with a camera"),
    ],
)
def test_wrong_topics_are_refused(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with BagReader(write_depth(tmp_path / "bag")) as bag, pytest.raises(ValueError, match=message):
        DepthImages(bag, **options)


def refused(path: Path, message: str) -> None:
    with BagReader(path) as bag, pytest.raises(ValueError, match=message):
        DepthImages(bag)


def test_a_bag_without_depth_says_what_it_has(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    with BagWriter(bag) as written:
        written.write("/pose", to_pose_stamped(rc.Pose(), time_ns=1, types=written.types), 1)
    refused(bag, r"topic: expected a topic of sensor_msgs/msg/Image in .*, got none; there are /pose \(geometry")
    with BagWriter(bag, overwrite=True) as written:
        color = image_of(1, np.zeros((ROWS, COLUMNS), np.uint8), "mono8")
        written.write("/color", color, 1, type="sensor_msgs/msg/Image")
    refused(bag, "expected depth images, 32FC1 or 16UC1, in .*, got mono8 of '/color'")
    with BagWriter(bag, overwrite=True) as written:
        info = info_of(1) | {"width": 2 * COLUMNS}
        written.write("/depth/camera_info", info, 1, type="sensor_msgs/msg/CameraInfo")
        written.write("/depth/image", image_of(1, depth_of(DISTANCE)), 1, type="sensor_msgs/msg/Image")
    refused(bag, f"camera_info: expected a camera of {COLUMNS} x {ROWS} pixels, got one of {2 * COLUMNS}")
