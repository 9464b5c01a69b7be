"""Depth images of every source, encoded here by independent code: all decoders give the same points."""

from __future__ import annotations

import struct
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
import rosbags_types
from radarcore.adapters import gazebo, images, ros
from radarcore.adapters.ros.bags import typed

ROWS, COLUMNS = 24, 40
NEAR, FAR = 0.1, 10.0
FOVY = np.deg2rad(50.0)
FOVX = 2.0 * np.arctan(np.tan(0.5 * FOVY) * COLUMNS / ROWS)
FOCAL = 0.5 * ROWS / np.tan(0.5 * FOVY)

# A plane at 4 m with a hole at its lower right edge, and a ball up on the left so that every flip shows.
BALL, RADIUS = np.array([2.5, 0.7, 0.4]), 0.35


def scene() -> NDArray[np.float64]:
    """Planar depth of the scene [m], infinite in the hole, ray by ray."""
    depth = np.full((ROWS, COLUMNS), 4.0)
    for i in range(ROWS):
        for j in range(COLUMNS):
            ray = np.array([1.0, -(j + 0.5 - COLUMNS / 2) / FOCAL, -(i + 0.5 - ROWS / 2) / FOCAL])
            a, b, c = ray @ ray, ray @ BALL, BALL @ BALL - RADIUS**2
            if b * b - a * c > 0.0:
                depth[i, j] = (b - np.sqrt(b * b - a * c)) / a
    depth[-4:, -5:] = np.inf
    return depth


SCENE = scene()
AT_FAR = np.where(np.isfinite(SCENE), SCENE, FAR)
HEADER = SimpleNamespace(seq=3, stamp=SimpleNamespace(sec=12, nanosec=500_000_000), frame_id="camera_optical_frame")
INFO = SimpleNamespace(k=[FOCAL, 0.0, (COLUMNS - 1) / 2, 0.0, FOCAL, (ROWS - 1) / 2, 0.0, 0.0, 1.0])


def packed(values: NDArray[np.float64], code: str, padding: int = 0) -> bytes:
    """Rows of numbers one after the other, with some bytes of rubbish behind each."""
    rows = [struct.pack(f"{code[0]}{len(row)}{code[1]}", *row) for row in values.tolist()]
    return b"".join(row + b"\xa5" * padding for row in rows)


def ros_image(encoding: str, order: str = "<", padding: int = 0, nothing: float | None = None) -> SimpleNamespace:
    if encoding == "32FC1":
        values, kind, size = np.where(np.isfinite(SCENE), SCENE, np.inf if nothing is None else nothing), "f", 4
    else:
        values, kind, size = np.round(1e3 * np.where(np.isfinite(SCENE), SCENE, 0.0)).astype(int), "H", 2
    return SimpleNamespace(
        header=HEADER,
        height=ROWS,
        width=COLUMNS,
        encoding=encoding,
        is_bigendian=int(order == ">"),
        step=COLUMNS * size + padding,
        data=packed(values, order + kind, padding),
    )


def gz_image(nothing: float = np.inf, padding: int = 0) -> SimpleNamespace:
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=12, nsec=500_000_000)),
        width=COLUMNS,
        height=ROWS,
        step=4 * COLUMNS + padding,
        pixel_format_type=13,
        data=packed(np.where(np.isfinite(SCENE), SCENE, nothing), "<f", padding),
    )


def gz_named() -> SimpleNamespace:
    """An image whose header names its frame, as in a gz.msgs.Image."""
    image = gz_image(-np.inf)
    image.header.data = [SimpleNamespace(key="frame_id", value=["robot/camera_link"])]
    return image


def ros_message(world: str, *args: Any) -> Any:
    """A sensor_msgs/Image in rosbags' types, as it comes out of a bag."""
    message = typed(rosbags_types.typestore(world), "sensor_msgs/msg/Image", ros_image(*args))
    return rosbags_types.through_bytes(world, message)


def ros_info(world: str) -> Any:
    """A sensor_msgs/CameraInfo in rosbags' types, whose matrix has a large letter in ROS 1."""
    letters = {"d": [0.0] * 5, "k": INFO.k, "r": [0.0] * 9, "p": [0.0] * 12}
    window = dict.fromkeys(("x_offset", "y_offset", "height", "width", "do_rectify"), 0)
    sizes = {"height": ROWS, "width": COLUMNS, "binning_x": 0, "binning_y": 0}
    fields = {"header": HEADER, "distortion_model": "plumb_bob", "roi": window, **sizes, **letters}
    fields |= {name.upper(): values for name, values in letters.items()}
    message = typed(rosbags_types.typestore(world), "sensor_msgs/msg/CameraInfo", fields)
    return rosbags_types.through_bytes(world, message)


def coppelia(options: int) -> images.PlanarDepth:
    values = AT_FAR if options & 1 else (AT_FAR - NEAR) / (FAR - NEAR)
    data = b"".join(struct.pack(f"<{COLUMNS}f", *values[i]) for i in reversed(range(ROWS)))
    return images.from_coppeliasim(data, (COLUMNS, ROWS), angle=FOVX, near=NEAR, far=FAR, options=options, time=12.5)


def renderer() -> images.PlanarDepth:
    return images.from_mujoco_renderer(AT_FAR.astype(np.float32), fovy_deg=np.rad2deg(FOVY), far=FAR, time=12.5)


def pixels() -> images.PlanarDepth:
    reversed_z = np.where(np.isfinite(SCENE), (NEAR * FAR / AT_FAR - NEAR) / (FAR - NEAR), 0.0)
    upside_down = np.flipud(reversed_z).astype(np.float32)
    return images.from_mujoco_pixels(upside_down, fovy_deg=np.rad2deg(FOVY), near=NEAR, far=FAR, time=12.5)


def bullet() -> images.PlanarDepth:
    # OpenGL: clip = P (0, 0, -z, 1), window depth = (ndc + 1)/2, in 24 bits.
    clip, w = (FAR + NEAR) / (FAR - NEAR) * AT_FAR - 2.0 * FAR * NEAR / (FAR - NEAR), AT_FAR
    window = np.round((clip / w + 1.0) / 2.0 * (2**24 - 1)) / (2**24 - 1)
    return images.from_pybullet(window.astype(np.float32), fov_deg=np.rad2deg(FOVY), near=NEAR, far=FAR, time=12.5)


# Quantisation [m]: single precision, a z-buffer of 24 bits at 4 m (integration of 1/z), millimetres.
SINGLE, BITS_24, MILLIMETRES = 1e-6, 0.6 * 16.0 * 10.0 / 2**24 + 1e-5, 0.5e-3 + 1e-9
SOURCES: dict[str, tuple[Any, float]] = {
    "mujoco renderer": (renderer, SINGLE),
    "mujoco pixels": (pixels, 2e-6),
    "pybullet": (bullet, BITS_24),
    "coppeliasim metres": (lambda: coppelia(1), SINGLE),
    "coppeliasim fractions": (lambda: coppelia(0), 2e-6),
    "gz": (lambda: images.from_gz_image(gz_image(), horizontal_fov=FOVX), SINGLE),
    "gz padded": (lambda: images.from_gz_image(gz_image(-np.inf, 12), horizontal_fov=FOVX), SINGLE),
    "gz named": (lambda: gazebo.from_gz_image(gz_named(), horizontal_fov=FOVX), SINGLE),
    "ros 32FC1": (lambda: images.from_ros_image(ros_image("32FC1"), camera_info=INFO), SINGLE),
    "ros 32FC1 big endian, NaN": (
        lambda: images.from_ros_image(ros_image("32FC1", ">", 8, np.nan), camera_info=INFO),
        SINGLE,
    ),
    "ros 32FC1 too near": (
        lambda: images.from_ros_image(ros_image("32FC1", nothing=-np.inf), camera=np.rad2deg([FOVX, FOVY])),
        SINGLE,
    ),
    "ros 16UC1": (lambda: images.from_ros_image(ros_image("16UC1"), camera_info=INFO), MILLIMETRES),
    "ros 16UC1 big endian, padded": (
        lambda: images.from_ros_image(ros_image("16UC1", ">", 6), camera_info=INFO),
        MILLIMETRES,
    ),
} | {
    f"{world} {args} of rosbags": (
        lambda world=world, args=args: ros.from_ros_image(ros_message(world, *args), camera_info=ros_info(world)),
        MILLIMETRES if args[0] == "16UC1" else SINGLE,
    )
    for world in rosbags_types.WORLDS
    for args in (("32FC1",), ("16UC1", ">", 2))
}


@pytest.mark.parametrize("source", SOURCES)
def test_all_sources_give_the_same_points(source: str) -> None:
    decode, quantum = SOURCES[source]
    with pytest.warns(UserWarning, match="16UC1 .* 42 degrees") if quantum == MILLIMETRES else nullcontext():
        image = decode()
    assert image.depth.dtype == np.float64
    assert image.time == 12.5
    np.testing.assert_array_equal(image.valid, np.isfinite(SCENE))
    np.testing.assert_allclose(image.depth[image.valid], SCENE[image.valid], rtol=0, atol=quantum)
    assert np.isinf(image.depth[~image.valid]).all()
    np.testing.assert_allclose([image.camera.fx, image.camera.fy], FOCAL, rtol=1e-12)
    np.testing.assert_allclose([image.camera.cx, image.camera.cy], [COLUMNS / 2, ROWS / 2], rtol=1e-12)

    # The plane is a plane, the ball is up on the left.
    points = image.points
    is_plane = points[:, 0] > 3.0
    np.testing.assert_allclose(points[is_plane, 0], 4.0, rtol=0, atol=quantum)
    assert 10 < (~is_plane).sum() < 200
    assert (points[~is_plane, 1:] > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(points[~is_plane] - BALL, axis=1), RADIUS, rtol=0, atol=2.0 * quantum)


def test_tall_image_of_coppeliasim_has_its_angle_upright() -> None:
    data = struct.pack("<6f", *[1.0] * 6)
    image = images.from_coppeliasim(data, (2, 3), angle=np.pi / 2, near=0.1, far=10.0, options=1)
    assert image.camera == rc.Camera(1.5 / np.tan(np.pi / 4), 1.5 / np.tan(np.pi / 4), 1.0, 1.5)


@pytest.mark.parametrize(
    ("frame", "forward", "left", "up"),
    [
        ("opengl", [0, 0, -1], [-1, 0, 0], [0, 1, 0]),
        ("coppeliasim", [0, 0, 1], [1, 0, 0], [0, 1, 0]),
        ("link", [1, 0, 0], [0, 1, 0], [0, 0, 1]),
        ("optical", [0, 0, 1], [-1, 0, 0], [0, -1, 0]),
    ],
)
def test_radar_at_a_camera_looks_where_the_camera_looks(frame: str, forward: Any, left: Any, up: Any) -> None:
    camera = rc.Pose([1.0, 2.0, 3.0], rc.Pose.from_rpy([0, 0, 0], [0.3, -0.2, 1.1]).rotation)
    radar = camera @ ros.radar_in_camera(frame)
    for axis, in_camera in zip(np.eye(3), (forward, left, up), strict=True):
        np.testing.assert_allclose(radar.apply(axis), camera.apply(in_camera), rtol=0, atol=1e-15)


def test_images_name_their_frame() -> None:
    assert gazebo.from_gz_image(gz_named(), horizontal_fov=FOVX).frame_id == "robot/camera_link"
    image = ros.from_ros_image(ros_image("32FC1"), camera_info=INFO)
    assert image.frame_id == "camera_optical_frame"
    np.testing.assert_array_equal(image.axes, images.ROS_OPTICAL_AXES)
    bridged = ros.from_ros_image(ros_image("32FC1"), camera_info=INFO, frame="link")
    np.testing.assert_array_equal(bridged.axes, images.GZ_AXES)


def test_times_of_images_count_from_the_given_stamp() -> None:
    start = 12_000_000_000
    assert ros.from_ros_image(ros_image("32FC1"), camera_info=INFO, start_ns=start).time == 0.5
    assert gazebo.from_gz_image(gz_image(), horizontal_fov=FOVX, start_ns=start).time == 0.5
