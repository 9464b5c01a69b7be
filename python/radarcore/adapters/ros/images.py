"""Depth images of ROS 1 and ROS 2, and their cameras."""

from __future__ import annotations

from typing import Any

import numpy as np

from radarcore import check, notice
from radarcore.adapters.planar_depth import PlanarDepth, decoded, radar_in_camera, unpacked
from radarcore.adapters.ros.stamps import header_nanoseconds, seconds
from radarcore.geometry.camera import Camera

_ENCODINGS = {"32FC1": ("f4", 1.0), "16UC1": ("u2", 1e-3)}
"""Numbers of an encoding, and the metres that are one of them (REP 118)."""


def from_ros_image(
    message: Any,
    *,
    camera: Camera | tuple[float, float] | None = None,
    camera_info: Any = None,
    frame: str = "optical",
    start_ns: int = 0,
) -> PlanarDepth:
    """Depth of a ROS 1 or ROS 2 ``sensor_msgs/Image``: 32FC1 in metres or 16UC1 in millimetres, top row first.

    Infinities of both signs and NaN (REP 117), and 0, are nothing. Whole millimetres are warned of: they are useless
    for phases.

    Parameters
    ----------
    message : sensor_msgs/Image
        Anything with its fields.
    camera : Camera or (float, float), optional
        Or the horizontal and vertical field of view [degrees]; to be preferred where they are known.
    camera_info : sensor_msgs/CameraInfo, optional
        In place of `camera`, see `from_camera_info`. Publishers differ in the principal point by half a pixel, 0.13
        degrees at 256 pixels and 60 degrees.
    frame : {"optical", "link"}
        Axes of the frame that the header names: an optical one (REP 103), or, for images that ``ros_gz`` bridges from
        Gazebo without ``optical_frame_id``, those of the link, x forward.
    start_ns : int
        Stamp that counts as time 0 [ns].

    See Also
    --------
    adapters.ros.from_camera_info : Camera of the image.
    adapters.ros.DepthImages : Images of a bag.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> pixels = np.full((48, 64), 2.0, np.float32)
    >>> layout = {"height": 48, "width": 64, "encoding": "32FC1", "is_bigendian": 0, "step": 256}
    >>> message = SimpleNamespace(data=pixels.tobytes(), **layout)
    >>> image = rc.adapters.ros.from_ros_image(message, camera=(60.0, 47.0))
    >>> print(image.depth.shape, image.depth[0, 0])
    (48, 64) 2.0
    """
    if message.encoding not in _ENCODINGS:
        raise ValueError(f"encoding: expected 32FC1 or 16UC1, got {message.encoding!r}")
    axes = radar_in_camera(check.choice("frame", frame, ("optical", "link"))).rotation
    kind, unit = _ENCODINGS[message.encoding]
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    order = ">" if message.is_bigendian else "<"
    metres = unit * unpacked("data", message.data, order + kind, rows, columns, int(message.step)).astype(np.float64)
    if camera is not None and camera_info is not None:
        raise ValueError("camera: expected either camera or camera_info, got both")
    if camera_info is not None:
        check_size(camera_info, message)
        camera = from_camera_info(camera_info)
    elif camera is None:
        raise ValueError("camera: expected either camera or camera_info, got neither")
    elif not isinstance(camera, Camera):
        camera = Camera.from_field_of_view(camera, rows, columns)
    if message.encoding == "16UC1":
        notice.warn(
            "encoding: 16UC1 has whole millimetres, 42 degrees of phase (rms) at 60 GHz and 53 at 77 GHz: good for "
            "range profiles alone; 32FC1 keeps the phase"
        )
    time_ns = header_nanoseconds(message)
    time = None if time_ns is None else seconds(time_ns, start_ns)
    frame_id = getattr(getattr(message, "header", None), "frame_id", None)
    return decoded(metres, np.inf, camera, axes, time, frame_id or None)


def from_camera_info(message: Any, *, centered: bool = False, rectified: bool = False) -> Camera:
    """Camera of a ROS 1 or ROS 2 ``sensor_msgs/CameraInfo``, of the image as it is sent: binned, and its window alone.

    Parameters
    ----------
    message : sensor_msgs/CameraInfo
        Its K and P count pixel centres at whole numbers, `Camera` at halves.
    centered : bool
        The principal point is the middle of the whole image, whatever the message says: simulators are seen to send
        (W - 1)/2, W/2 and (W + 1)/2 for it.
    rectified : bool
        The image is a rectified one: P counts, not K. Images that are not are warned of if there is a distortion.

    See Also
    --------
    Camera : What comes back.
    adapters.ros.from_ros_image : Takes the message as `camera_info`.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> k = [500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0]
    >>> rc.adapters.ros.from_camera_info(SimpleNamespace(width=640, height=480, k=k, d=[], p=[0.0] * 12))
    Camera(fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    """
    name, size, places = ("p", 12, (0, 5, 2, 6)) if rectified else ("k", 9, (0, 4, 2, 5))
    matrix = check.array("camera_info", _field(message, name), (size,))
    if not rectified and any(_field(message, "d")):
        notice.warn("camera_info: its distortion is not undone; send rectified images (rectified=True)")
    fx, fy, cx, cy = (float(matrix[place]) for place in places)
    if not (fx > 0.0 and fy > 0.0):
        raise ValueError(f"camera_info: expected focal lengths in {name.upper()}, got {fx:g} and {fy:g}: uncalibrated")

    x, y = (0.5 * message.width, 0.5 * message.height) if centered else (cx + 0.5, cy + 0.5)
    # The window is cut out first, then several pixels become one.
    window = getattr(message, "roi", None)
    left, top = (getattr(window, edge, 0) for edge in ("x_offset", "y_offset"))
    across, down = (max(int(getattr(message, name, 1)), 1) for name in ("binning_x", "binning_y"))
    return Camera(fx / across, fy / down, (x - left) / across, (y - top) / down)


def check_size(camera_info: Any, image: Any) -> None:
    """Refuse the camera of images of another size, as that of a topic beside the right one; zeros say nothing."""
    window = getattr(camera_info, "roi", None)
    told = []
    for side, axis in (("width", "x"), ("height", "y")):
        whole = int(getattr(window, side, 0)) or int(getattr(camera_info, side, 0))
        told.append(whole // max(int(getattr(camera_info, f"binning_{axis}", 1)), 1))
    size = [int(image.width), int(image.height)]
    if all(told) and told != size:
        raise ValueError(
            f"camera_info: expected that of images of {size[0]} x {size[1]} pixels, got one of {told[0]} x {told[1]}"
        )


def _field(message: Any, name: str) -> Any:
    """Field of a camera's message: ROS 2 has small letters, ROS 1 large ones."""
    return np.asarray(getattr(message, name, getattr(message, name.upper(), ())))
