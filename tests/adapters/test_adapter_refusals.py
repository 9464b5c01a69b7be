"""Images, messages and files of other programs that are refused, and extras that are missing."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters import coppeliasim, images, ros
from radarcore.adapters.mujoco import spec_from_urdf
from radarcore.adapters.rerun import Viewer
from radarcore.adapters.ros.frames import from_frame_message, to_frame_message
from recordings import frame, sensor_frame

Row = tuple[Callable[[], object], type[Exception], str]

SCENE = rc.Detections([2.5, 7.3, 1.0, 2.0], [0.0] * 4, [0.3] * 4, [0.1] * 4, [9.9] * 4)


def with_fields(whole: Any, **fields: Any) -> SimpleNamespace:
    return SimpleNamespace(**(vars(whole) | fields))


# Depth images.


def of_ros(**fields: Any) -> images.PlanarDepth:
    """A float image of 24 x 40 pixels with some changed fields."""
    size = {"height": 24, "width": 40, "step": 160, "data": bytes(3840)}
    image = SimpleNamespace(**(size | {"encoding": "32FC1", "is_bigendian": 0} | fields))
    return images.from_ros_image(image, camera=fields.get("camera", (60, 40)))


def of_gz(horizontal_fov: float = 1.0, **fields: Any) -> images.PlanarDepth:
    size = {"height": 24, "width": 40, "step": 160, "data": bytes(3840)}
    return images.from_gz_image(
        SimpleNamespace(**(size | {"pixel_format_type": 13} | fields)), horizontal_fov=horizontal_fov
    )


def of_coppelia(data: bytes, **options: Any) -> images.PlanarDepth:
    return images.from_coppeliasim(data, (2, 2), **({"angle": 1.0, "near": 0.1, "far": 10.0} | options))


IMAGES: list[Row] = [
    (lambda: of_ros(encoding="rgb8"), ValueError, "encoding: expected 32FC1"),
    (lambda: of_ros(step=100), ValueError, "step: expected at least 160"),
    (lambda: of_ros(data=b"1234"), ValueError, "data: expected 3840 bytes"),
    (lambda: of_ros(camera=None), ValueError, "camera: expected either .* got neither"),
    (lambda: of_gz(pixel_format_type=1), ValueError, r"pixel_format_type: expected R_FLOAT32 \(13\), got L_INT8 \(1\)"),
    (lambda: of_gz(4.0), ValueError, "horizontal_fov: expected an angle"),
    (lambda: of_coppelia(b"12"), ValueError, "data: expected 16 bytes"),
    (lambda: of_coppelia(bytes(16), near=2.0, far=1.0), ValueError, "far: expected more than near"),
    (
        lambda: images.from_pybullet(np.full((2, 2), 1.5), fov_deg=60, near=0.1, far=1),
        ValueError,
        "buffer: .* 0 to 1",
    ),
    (lambda: images.from_pybullet([[1, 0]], fov_deg=60, near=0.1, far=1), TypeError, "buffer: expected floating"),
    (lambda: images.from_mujoco_renderer(np.ones((2, 2)), fovy_deg=180, far=1), ValueError, "fovy_deg: expected an"),
    (lambda: ros.radar_in_camera("up"), ValueError, "frame: expected one of 'optical', 'link', 'opengl', 'coppelia"),
    (lambda: coppeliasim.CoppeliaSim("no such name!"), ValueError, "host: expected the name or address of a machine"),
    (lambda: coppeliasim.from_grey_buffer(bytes(12), [4, 4]), ValueError, "data: expected 16 bytes for 4 x 4 grey pi"),
    (lambda: coppeliasim.from_matrix(np.zeros(12)), ValueError, "rotation: expected a rotation matrix"),
    (lambda: coppeliasim.from_shape_viz([{"vertices": [0.0]}]), ValueError, "items: expected 'indices' in item 0, got"),
]


# Messages of ROS.


def cloud(**fields: Any) -> SimpleNamespace:
    return with_fields(ros.to_point_cloud(SCENE), **fields)


def stamped(frame_id: str, *, wxyz: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)) -> SimpleNamespace:
    message = ros.to_pose_stamped(rc.Pose(), time_ns=0, frame_id=frame_id)
    message.pose.orientation = SimpleNamespace(**dict(zip("wxyz", wxyz, strict=True)))
    return message


def joints(*names: str, positions: tuple[float, ...] = (0.1,), time_ns: int = 0) -> SimpleNamespace:
    header = ros.to_pose_stamped(rc.Pose(), time_ns=time_ns).header
    return SimpleNamespace(header=header, name=list(names), position=list(positions), velocity=[], effort=[])


APART = [joints(name, time_ns=k) for k, name in enumerate(["shoulder", "shoulder", "finger", "finger"])]


def info(k: list[float]) -> SimpleNamespace:
    return SimpleNamespace(width=640, height=480, k=k, d=[], p=[0.0] * 12)


def of_frame(**fields: Any) -> rc.Frame:
    return from_frame_message(with_fields(to_frame_message(sensor_frame(0)), **fields))


STRANGE = [SimpleNamespace(name=name, offset=0, datatype=9, count=1) for name in "xyz"]
MESSAGES: list[Row] = [
    (lambda: ros.from_point_cloud(cloud(), velocity="doppler"), ValueError, "velocity: expected a field 'doppler'"),
    (lambda: ros.from_point_cloud(cloud(data=b"12")), ValueError, "data: expected 80 bytes for 1 rows of 80, got 2"),
    (lambda: ros.from_point_cloud(cloud(row_step=10)), ValueError, "step: expected at least 80 bytes for 4 columns"),
    (lambda: ros.from_point_cloud(cloud(point_step=10)), ValueError, "point_step: expected room for 'z' at 8, got 10"),
    (lambda: ros.from_point_cloud(cloud(fields=STRANGE)), ValueError, "datatype: expected 1 to 8"),
    (lambda: ros.to_point_cloud(SCENE, frame_id="cam_optical_frame"), ValueError, "frame_id: .* x forward .*REP 103"),
    (lambda: ros.to_radar_scan(SCENE, frame_id="/radar"), ValueError, "frame_id: expected a name without a slash"),
    (lambda: ros.to_radar_scan(SCENE, time_ns=10**19), ValueError, "time_ns: expected nanoseconds within"),
    (lambda: ros.to_radar_scan(SCENE, types={}), ValueError, "types: expected 'radar_msgs/msg/RadarReturn' .*DEFINIT"),
    (lambda: ros.to_pose_stamped(rc.Pose(), time_ns=0, types=3), TypeError, "types: expected a mapping or a function"),
    (lambda: ros.to_map_image(np.ones(3), time_ns=0), ValueError, r"values: expected shape \(doppler, range\)"),
    (lambda: ros.to_map_image(np.ones((2, 2)) * 1j, time_ns=0), TypeError, "values: expected real numbers"),
    (lambda: ros.from_map_image(SimpleNamespace(encoding="mono8")), ValueError, "encoding: expected 32FC1, got 'mono"),
    (lambda: ros.from_pose(stamped("a", wxyz=(0.0,) * 4)), ValueError, "orientation: expected a quaternion, got zer"),
    (lambda: ros.pose_series([]), ValueError, "messages: expected at least one, got none"),
    (lambda: ros.pose_series([stamped("a"), stamped("b")]), ValueError, "expected poses in one frame, got 'a', 'b'"),
    (lambda: ros.pose_series([SimpleNamespace(pose=stamped("a").pose)]), ValueError, "header: expected a stamp, got n"),
    (lambda: ros.joint_series([joints("elbow")], ["wrist"]), ValueError, "names: no joint 'wrist'; there is elbow"),
    (lambda: ros.joint_series([joints("a", positions=())]), ValueError, "expected at least one with positions, got n"),
    (lambda: ros.joint_series(APART, ["shoulder", "finger"]), ValueError, "got shoulder, finger without a common tim"),
    (lambda: ros.joint_series([joints("a", "b")]), ValueError, "position: expected 2 values, one per name, got 1"),
    (lambda: ros.from_camera_info(info([0.0] * 9)), ValueError, "expected focal lengths in K, got 0 and 0: uncalib"),
    (lambda: ros.from_camera_info(info([1.0] * 8)), ValueError, r"camera_info: expected shape \(9,\)"),
    (lambda: of_frame(settings="x"), ValueError, "settings: Expecting value: line 1"),
    (lambda: of_frame(settings="{}"), ValueError, "settings: expected format 'radarcore recording', got None"),
    (lambda: of_frame(dtype="int8"), ValueError, "dtype: expected one of 'uint16', 'float32', .*, got 'int8'"),
    (lambda: of_frame(data=bytes(383)), ValueError, r"data: expected 384 bytes for \(3, 4, 16\) samples, got 383"),
    (lambda: of_frame(shape=[3, 4, 8], data=bytes(192)), ValueError, r"cube: expected shape \(3, 4, 16\)"),
    (lambda: of_frame(data=np.full(384, 255, np.uint8)), ValueError, "codes: expected 0 to 4095, got 65535"),
    (
        lambda: of_frame(settings=to_frame_message(frame(0)).settings, truth=[1.0]),
        ValueError,
        "truth: expected 8 numbers for",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), [*IMAGES, *MESSAGES])
def test_what_does_not_fit_names_its_field(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


# Files, and extras.


@pytest.mark.parametrize(
    ("name", "content", "error", "message"),
    [
        ("a.mcap", b"", ValueError, "expected a ROS 1 bag, or an MCAP or SQLite bag of ROS 2, got an empty file"),
        ("a.bag", b"#ROSBAG V1.2\n", ValueError, "expected a ROS 1 bag, or an MCAP or SQLite bag of ROS 2, got anoth"),
        ("a.db3", b"SQLite format 3\0" + bytes(200), ValueError, r"expected a whole bag, got a damaged one \("),
        ("a", None, ValueError, r"expected a bag, got a folder without \.mcap, \.db3, \.bag files"),
        ("none", ..., FileNotFoundError, "no such bag"),
    ],
)
def test_files_that_are_no_bags_are_refused_in_one_line(
    tmp_path: Path, name: str, content: Any, error: type[Exception], message: str
) -> None:
    pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")
    path = tmp_path / name
    if content is None:
        path.mkdir()
    elif content is not ...:
        path.write_bytes(content)
    with pytest.raises(error, match=message) as raised:
        ros.BagReader(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("module", "extra", "call"),
    [
        ("rosbags", "ros", lambda path: ros.BagReader(path)),
        ("mujoco", "mujoco", lambda path: spec_from_urdf(path / "a.urdf")),
        ("coppeliasim_zmqremoteapi_client", "coppelia", lambda path: coppeliasim.CoppeliaSim()),
        ("rerun", "rerun", lambda path: Viewer(path / "run.rrd")),
    ],
)
def test_missing_extra_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, extra: str, call: Callable[[Path], object]
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"pip install radarcore\[{extra}\]"):
        call(tmp_path)
