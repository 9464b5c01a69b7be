"""Depth images of simulators and robots, decoded: one function per source, one result.

Everybody delivers depth along the optical axis, in other numbers, row orders and marks for "nothing there". None of the
programs is imported: buffers are arrays or bytes, messages anything with the right attributes.

========================================= ======================= =========== ===============
source                                    numbers                 row 0       nothing there
========================================= ======================= =========== ===============
`from_mujoco_renderer`                    metres                  top         far plane
`from_mujoco_pixels` (mjr_readPixels)     reversed z-buffer       bottom      0
`from_pybullet`                           z-buffer                top         far plane
`from_coppeliasim`                        metres or fractions     bottom      far plane
`from_gz_image`                           metres, float32         top         inf, -inf
`from_ros_image`                          32FC1 m, 16UC1 mm       top         inf, nan, 0
========================================= ======================= =========== ===============
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.camera import Camera, warn_of_radians

Matrix = NDArray[np.float64]

# A depth that is this close to the far plane is the far plane.
_FAR_MARGIN = 1e-6

DEPTH_MAPS = ("zero_far", "zero_near")
"""Depths that ``mjr_readPixels`` has as 0."""

_GZ_R_FLOAT32 = 13
"""gz.msgs.PixelFormatType."""

OPENGL_AXES = check.frozen(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]))
"""Radar axes in those of MuJoCo's and PyBullet's cameras: x right, y up, looking along -z."""

COPPELIASIM_AXES = check.frozen(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
"""Radar axes in those of a vision sensor: x to the left of the image, y up, z forward."""

GZ_AXES = check.frozen(np.eye(3))
"""Radar axes in those of a Gazebo link: the same."""

ROS_OPTICAL_AXES = check.frozen(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]))
"""Radar axes in those of an optical frame (REP 103): x right, y down, z forward."""


@dataclass(frozen=True, eq=False)
class PlanarDepth:
    """A decoded depth image; row 0 on top, column 0 on the left.

    Use: ``frame_from_depth(image.depth, reflectance, radar, camera=image.camera, planar=True)``.

    Attributes
    ----------
    depth : (rows, columns) float64
        Along the optical axis [m]; inf where there is nothing.
    camera : Camera
    axes : (3, 3) float64
        Radar axes in the source's camera axes, as columns: ``R_world_radar = R_world_camera @ axes``.
    time : float, optional
        Time of the image [s], if the source says it.
    """

    depth: Matrix
    camera: Camera
    axes: Matrix
    time: float | None = None

    @property
    def valid(self) -> NDArray[np.bool_]:
        """True for pixels with a finite depth, (rows, columns)."""
        return np.isfinite(self.depth)

    @property
    def points(self) -> Matrix:
        """Seen points in radar axes, (num_valid, 3) [m], row by row."""
        u, v = np.meshgrid(*self.camera.plane(*self.depth.shape))
        directions = np.stack([np.ones_like(u), u, v], axis=-1)
        points: Matrix = self.depth[self.valid, None] * directions[self.valid]
        return points


def from_mujoco_renderer(depth: ArrayLike, *, fovy_deg: float, far: float, time: float | None = None) -> PlanarDepth:
    """Image of ``mujoco.Renderer`` with depth rendering: metres, top row first.

    `fovy_deg`: the camera's vertical angle; `far`: ``model.vis.map.zfar * model.stat.extent`` [m].
    """
    metres = _image("depth", depth)
    return _decoded(metres, _far(far), _camera_by_height(fovy_deg, metres.shape, "fovy_deg"), OPENGL_AXES, time)


def from_mujoco_pixels(
    buffer: ArrayLike,
    *,
    fovy_deg: float,
    near: float,
    far: float,
    depth_map: str = "zero_far",
    time: float | None = None,
) -> PlanarDepth:
    """Depth of ``mjr_readPixels``, bottom row first.

    `depth_map`: ``MjrContext.readDepthMap``. ``mjDEPTH_ZEROFAR``, as `mujoco.Renderer` sets it, is a reversed z-buffer
    with 0 at the far plane; ``mjDEPTH_ZERONEAR``, the default of a new context, is 1 there and a hundred times coarser.
    """
    is_reversed = check.choice("depth_map", depth_map, DEPTH_MAPS) == "zero_far"
    d = _fractions("buffer", buffer)[::-1]
    n, f = _near_and_far(near, far)
    metres = n * f / (n + (d if is_reversed else 1.0 - d) * (f - n))
    return _decoded(metres, f, _camera_by_height(fovy_deg, d.shape, "fovy_deg"), OPENGL_AXES, time)


def from_pybullet(
    buffer: ArrayLike, *, fov_deg: float, near: float, far: float, time: float | None = None
) -> PlanarDepth:
    """Depth of ``getCameraImage``: z-buffer from 0 to 1, top row first.

    `fov_deg`: the vertical angle of ``computeProjectionMatrixFOV``.
    """
    d = _fractions("buffer", buffer)
    n, f = _near_and_far(near, far)
    metres = f * n / (f - (f - n) * d)
    return _decoded(metres, f, _camera_by_height(fov_deg, d.shape, "fov_deg"), OPENGL_AXES, time)


def from_coppeliasim(
    data: bytes,
    resolution: tuple[int, int],
    *,
    angle: float,
    near: float,
    far: float,
    options: int = 0,
    time: float | None = None,
) -> PlanarDepth:
    """Depth of ``sim.getVisionSensorDepth(handle, options)``, both its results; bottom row first.

    `angle`: ``sim.visionfloatparam_perspective_angle`` [rad], that of the larger side; `near` and `far`: the clipping
    planes [m]; bit 0 of `options`: metres instead of fractions of near to far.
    """
    sides = check.array("resolution", resolution, (2,))
    columns, rows = (check.count("resolution", int(side)) for side in sides)
    n, f = _near_and_far(near, far)
    values = _unpacked("data", data, "<f4", rows, columns, 4 * columns)[::-1].astype(np.float64)
    metres = values if check.count("options", options, 0) & 1 else n + values * (f - n)
    width = check.positive("angle", angle, "rad")
    if width >= np.pi:
        raise ValueError(f"angle: expected an angle below pi [rad], got {angle!r}; degrees? np.deg2rad")
    camera = _centered(0.5 * max(rows, columns) / np.tan(0.5 * width), metres.shape)
    return _decoded(metres, f, camera, COPPELIASIM_AXES, time)


def from_gz_image(message: Any, *, horizontal_fov: float) -> PlanarDepth:
    """Depth image of a Gazebo camera (``gz.msgs.Image``, R_FLOAT32): metres, top row first.

    `horizontal_fov` [rad]. Infinities of both signs, beyond the far sphere and before the near plane, are nothing.
    """
    if int(message.pixel_format_type) != _GZ_R_FLOAT32:
        raise ValueError(f"pixel_format_type: expected R_FLOAT32 (13), got {message.pixel_format_type}")
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    metres = _unpacked("data", message.data, "<f4", rows, columns, int(message.step))
    width = check.positive("horizontal_fov", horizontal_fov, "rad")
    if width >= np.pi:
        raise ValueError(
            f"horizontal_fov: expected an angle below pi [rad], got {horizontal_fov!r}; degrees? np.deg2rad"
        )
    camera = _centered(0.5 * columns / np.tan(0.5 * width), metres.shape)
    return _decoded(metres, np.inf, camera, GZ_AXES, _stamp(message))


def from_ros_image(
    message: Any, *, camera: Camera | tuple[float, float] | None = None, camera_info: Any = None
) -> PlanarDepth:
    """Depth of a ROS 1 or ROS 2 ``sensor_msgs/Image``: 32FC1 in metres or 16UC1 in millimetres, top row first.

    Give `camera`, or its horizontal and vertical field of view [degrees], where they are known; else `camera_info`, a
    ``sensor_msgs/CameraInfo`` whose K counts pixel centres at whole numbers. Publishers differ in that by half a pixel,
    0.13 degrees at 256 pixels and 60 degrees.
    """
    units = {"32FC1": ("f4", 1.0), "16UC1": ("u2", 1e-3)}
    if message.encoding not in units:
        raise ValueError(f"encoding: expected 32FC1 or 16UC1, got {message.encoding!r}")
    kind, unit = units[message.encoding]
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    order = ">" if message.is_bigendian else "<"
    metres = unit * _unpacked("data", message.data, order + kind, rows, columns, int(message.step)).astype(np.float64)
    if (camera is None) == (camera_info is None):
        raise ValueError(
            f"camera: expected either camera or camera_info, got {'neither' if camera is None else 'both'}"
        )
    if camera_info is not None:
        k = check.array("camera_info", np.asarray(getattr(camera_info, "k", getattr(camera_info, "K", ()))), (9,))
        camera = Camera(k[0], k[4], k[2] + 0.5, k[5] + 0.5)
    elif not isinstance(camera, Camera):
        camera = Camera.from_field_of_view(camera, rows, columns)  # type: ignore[arg-type]  # not None here
    return _decoded(metres, np.inf, camera, ROS_OPTICAL_AXES, _stamp(message))


def _decoded(metres: NDArray[Any], far: float, camera: Camera, axes: Matrix, time: float | None) -> PlanarDepth:
    """Decoded image; depths not between zero and the far plane are no return."""
    depth = metres.astype(np.float64)
    is_valid = np.isfinite(depth) & (depth > 0.0) & (depth < far * (1.0 - _FAR_MARGIN))
    at = None if time is None else check.number("time", time, "s")
    return PlanarDepth(np.where(is_valid, depth, np.inf), camera, axes, at)


def _image(name: str, value: ArrayLike) -> Matrix:
    image = np.asarray(value)
    if image.dtype.kind != "f":
        raise TypeError(f"{name}: expected floating-point numbers, got {image.dtype}")
    if image.ndim != 2 or image.size == 0:
        raise ValueError(f"{name}: expected shape (rows, columns), got {image.shape}")
    return image.astype(np.float64)


def _fractions(name: str, value: ArrayLike) -> Matrix:
    """Checked z-buffer, from 0 to 1."""
    image = _image(name, value)
    if not ((image >= 0.0) & (image <= 1.0)).all():
        raise ValueError(f"{name}: expected numbers from 0 to 1, got {image[~((image >= 0.0) & (image <= 1.0))][0]:g}")
    return image


def _unpacked(name: str, data: Any, kind: str, rows: int, columns: int, step: int) -> NDArray[Any]:
    """Numbers (rows, columns) of a buffer with `step` bytes per row."""
    size = np.dtype(kind).itemsize
    if step < columns * size:
        raise ValueError(f"step: expected at least {columns * size} bytes for {columns} columns, got {step}")
    # The last row need not be padded.
    raw = (
        np.frombuffer(data, np.uint8)
        if isinstance(data, bytes | bytearray | memoryview)
        else np.asarray(data, np.uint8)
    )
    needed = (rows - 1) * step + columns * size
    if raw.size < needed:
        raise ValueError(f"{name}: expected {needed} bytes for {rows} rows of {step}, got {raw.size}")
    padded = np.zeros(rows * step, np.uint8)
    padded[: min(raw.size, rows * step)] = raw.ravel()[: rows * step]
    return np.ascontiguousarray(padded.reshape(rows, step)[:, : columns * size]).view(kind)


def _camera_by_height(angle_deg: float, shape: tuple[int, ...], name: str) -> Camera:
    angle = check.positive(name, angle_deg, "degrees")
    if angle >= 180.0:
        raise ValueError(f"{name}: expected an angle below 180 degrees, got {angle_deg!r}")
    warn_of_radians(name, angle)
    return _centered(0.5 * shape[0] / np.tan(0.5 * np.deg2rad(angle)), shape)


def _centered(focal_length: float, shape: tuple[int, ...]) -> Camera:
    """Camera with square pixels and its axis in the middle."""
    return Camera(focal_length, focal_length, 0.5 * shape[1], 0.5 * shape[0])


def _far(far: float) -> float:
    return check.positive("far", far, "m")


def _near_and_far(near: float, far: float) -> tuple[float, float]:
    n, f = check.positive("near", near, "m"), _far(far)
    if f <= n:
        raise ValueError(f"far: expected more than near {n:g} m, got {f:g} m")
    return n, f


def _stamp(message: Any) -> float | None:
    """Time of a message's header [s]; ROS 1, ROS 2 and Gazebo name its parts differently."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return None
    seconds = getattr(stamp, "sec", getattr(stamp, "secs", None))
    nanoseconds = getattr(stamp, "nanosec", getattr(stamp, "nsecs", getattr(stamp, "nsec", None)))
    return None if seconds is None else float(seconds) + 1e-9 * float(nanoseconds or 0)
