"""Decoded depth images, and the radar's axes in camera axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from radarcore import check
from radarcore.geometry.camera import Camera
from radarcore.geometry.pose import Pose

Matrix = NDArray[np.float64]

# A depth that is this close to the far plane is the far plane.
_FAR_MARGIN = 1e-6

OPENGL_AXES = check.frozen(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]))
"""Radar axes in the axes of MuJoCo's and PyBullet's cameras: x right, y up, looking along -z."""

COPPELIASIM_AXES = check.frozen(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
"""Radar axes in the axes of a vision sensor: x to the left of the image, y up, z forward."""

GZ_AXES = check.frozen(np.eye(3))
"""Radar axes in the axes of a Gazebo link: the same."""

ROS_OPTICAL_AXES = check.frozen(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]))
"""Radar axes in the axes of an optical frame (REP 103): x right, y down, z forward."""

_AXES = {"optical": ROS_OPTICAL_AXES, "link": GZ_AXES, "opengl": OPENGL_AXES, "coppeliasim": COPPELIASIM_AXES}


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
    frame_id : str, optional
        Frame of the camera, if the source names it.

    See Also
    --------
    frame_from_depth : Frame from the image.
    adapters.ros.from_ros_image : One of the decoders that make it.

    Examples
    --------
    >>> image = rc.adapters.images.from_mujoco_renderer(np.full((48, 64), 2.0), fovy_deg=45.0, far=10.0)
    >>> radar = rc.bgt60tr13c(num_chirps=16)
    >>> frame = rc.frame_from_depth(image.depth, 0.5, radar, camera=image.camera, planar=True)
    >>> print(f"{rc.strongest_peak(frame).range:.1f} m")
    2.0 m
    """

    depth: Matrix
    camera: Camera
    axes: Matrix
    time: float | None = None
    frame_id: str | None = None

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


def radar_in_camera(frame: str) -> Pose:
    """Pose of a radar that sits at a camera and looks where it looks, in the camera's frame.

    ``rc.Attached(camera_motion, radar_in_camera("optical"))`` is the motion of the radar.

    Parameters
    ----------
    frame : {"optical", "link", "opengl", "coppeliasim"}
        Axes of the camera's frame: ``"optical"``, of a ROS frame that ends in ``_optical_frame``: x right, y down,
        z forward (REP 103); ``"link"``, of a link of Gazebo or ROS: x forward, y left, z up, as the radar itself;
        ``"opengl"``, of MuJoCo and PyBullet: x right, y up, looking along -z; ``"coppeliasim"``, of a vision sensor:
        x left, y up, z forward.

    See Also
    --------
    Attached : Motion of a radar on a camera.
    adapters.ros.TransformTree.radar_motion : The motion itself, from TF.

    Examples
    --------
    >>> pose = rc.adapters.ros.radar_in_camera("optical")
    >>> pose.apply([1.0, 0.0, 0.0]).tolist()  # ahead is z in an optical frame
    [0.0, 0.0, 1.0]
    """
    return Pose(rotation=_AXES[check.choice("frame", frame, tuple(_AXES))])


def decoded(
    metres: NDArray[Any], far: float, camera: Camera, axes: Matrix, time: float | None, frame_id: str | None = None
) -> PlanarDepth:
    """Decoded image; depths not between zero and the far plane are no return."""
    depth = metres.astype(np.float64)
    is_valid = np.isfinite(depth) & (depth > 0.0) & (depth < far * (1.0 - _FAR_MARGIN))
    at = None if time is None else check.number("time", time, "s")
    return PlanarDepth(np.where(is_valid, depth, np.inf), camera, axes, at, frame_id)


def unpacked(name: str, data: Any, kind: DTypeLike, rows: int, columns: int, step: int) -> NDArray[Any]:
    """Numbers (rows, columns) of a buffer with `step` bytes per row."""
    dtype = np.dtype(kind)
    size = dtype.itemsize
    if step < columns * size:
        raise ValueError(f"step: expected at least {columns * size} bytes for {columns} columns, got {step}")
    raw = _bytes(data)
    # The last row need not be padded.
    needed = (rows - 1) * step + columns * size
    if raw.size < needed:
        raise ValueError(f"{name}: expected {needed} bytes for {rows} rows of {step}, got {raw.size}")
    return np.ndarray((rows, columns), dtype, np.ascontiguousarray(raw), strides=(step, size))


def centered(name: str, angle: float, pixels: int, shape: tuple[int, ...]) -> Camera:
    """Camera with a number of square pixels over its angle [rad], and its axis in the middle."""
    if check.positive(name, angle, "rad") >= np.pi:
        raise ValueError(f"{name}: expected an angle below pi [rad], got {angle!r}; degrees? np.deg2rad")
    focal_length = 0.5 * pixels / np.tan(0.5 * angle)
    return Camera(focal_length, focal_length, 0.5 * shape[1], 0.5 * shape[0])


def _bytes(data: ArrayLike | bytes) -> NDArray[np.uint8]:
    if isinstance(data, bytes | bytearray | memoryview):
        return np.frombuffer(data, np.uint8)
    return np.asarray(data, np.uint8)
