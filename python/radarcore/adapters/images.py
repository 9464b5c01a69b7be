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

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.adapters.depth import COPPELIASIM_AXES as COPPELIASIM_AXES
from radarcore.adapters.depth import GZ_AXES as GZ_AXES
from radarcore.adapters.depth import OPENGL_AXES as OPENGL_AXES
from radarcore.adapters.depth import ROS_OPTICAL_AXES as ROS_OPTICAL_AXES
from radarcore.adapters.depth import Matrix, centered, decoded, unpacked
from radarcore.adapters.depth import PlanarDepth as PlanarDepth
from radarcore.adapters.gazebo import from_gz_image as from_gz_image
from radarcore.adapters.ros.depth import from_ros_image as from_ros_image
from radarcore.geometry.camera import Camera, warn_of_radians

__all__ = [
    "COPPELIASIM_AXES",
    "DEPTH_MAPS",
    "GZ_AXES",
    "OPENGL_AXES",
    "ROS_OPTICAL_AXES",
    "PlanarDepth",
    "from_coppeliasim",
    "from_gz_image",
    "from_mujoco_pixels",
    "from_mujoco_renderer",
    "from_pybullet",
    "from_ros_image",
]


def __dir__() -> list[str]:
    """Public names, for completion."""
    return __all__


DEPTH_MAPS = ("zero_far", "zero_near")
"""Depths that ``mjr_readPixels`` has as 0."""


def from_mujoco_renderer(depth: ArrayLike, *, fovy_deg: float, far: float, time: float | None = None) -> PlanarDepth:
    """Image of ``mujoco.Renderer`` with depth rendering: metres, top row first.

    `fovy_deg`: the camera's vertical angle; `far`: ``model.vis.map.zfar * model.stat.extent`` [m].

    See Also
    --------
    adapters.images.from_mujoco_pixels : Of ``mjr_readPixels``.
    adapters.mujoco.DepthView : Draws depth, bodies and their motion.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> image = rc.adapters.images.from_mujoco_renderer(np.full((48, 64), 2.0), fovy_deg=45.0, far=10.0)
    >>> print(image.depth.max(), image.valid.mean())
    2.0 1.0
    """
    metres = _image("depth", depth)
    camera = _camera_by_height(fovy_deg, metres.shape, "fovy_deg")
    return decoded(metres, check.positive("far", far, "m"), camera, OPENGL_AXES, time)


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

    See Also
    --------
    adapters.images.from_mujoco_renderer : Of ``mujoco.Renderer``.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> image = rc.adapters.images.from_mujoco_pixels(np.full((48, 64), 0.5), fovy_deg=45.0, near=1.0, far=3.0)
    >>> print(f"{image.depth[0, 0]:.3f} m")  # n f / (n + (f - n) / 2)
    1.500 m
    """
    is_reversed = check.choice("depth_map", depth_map, DEPTH_MAPS) == "zero_far"
    d = _fractions("buffer", buffer)[::-1]
    n, f = _near_and_far(near, far)
    metres = n * f / (n + (d if is_reversed else 1.0 - d) * (f - n))
    return decoded(metres, f, _camera_by_height(fovy_deg, d.shape, "fovy_deg"), OPENGL_AXES, time)


def from_pybullet(
    buffer: ArrayLike, *, fov_deg: float, near: float, far: float, time: float | None = None
) -> PlanarDepth:
    """Depth of ``getCameraImage``: z-buffer from 0 to 1, top row first.

    `fov_deg`: the vertical angle of ``computeProjectionMatrixFOV``.

    See Also
    --------
    adapters.images.from_mujoco_pixels : Another z-buffer.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> image = rc.adapters.images.from_pybullet(np.full((48, 64), 0.5), fov_deg=60.0, near=1.0, far=3.0)
    >>> print(f"{image.depth[0, 0]:.3f} m")  # n f / (f - (f - n) / 2)
    1.500 m
    """
    d = _fractions("buffer", buffer)
    n, f = _near_and_far(near, far)
    metres = f * n / (f - (f - n) * d)
    return decoded(metres, f, _camera_by_height(fov_deg, d.shape, "fov_deg"), OPENGL_AXES, time)


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

    `angle`: ``sim.visionfloatparam_perspective_angle`` [rad], of the larger side; near and `far`: the clipping
    planes [m]; bit 0 of `options`: metres instead of fractions of near to far.

    See Also
    --------
    adapters.coppeliasim.VisionSensor.image : Asks CoppeliaSim for it.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> data = np.full(64 * 48, 0.5, "<f4").tobytes()
    >>> image = rc.adapters.images.from_coppeliasim(data, (64, 48), angle=1.0, near=0.1, far=10.1)
    >>> print(f"{image.depth[0, 0]:.2f} m")
    5.10 m
    """
    sides = check.array("resolution", resolution, (2,))
    columns, rows = (check.count("resolution", int(side)) for side in sides)
    n, f = _near_and_far(near, far)
    values = unpacked("data", data, "<f4", rows, columns, 4 * columns)[::-1].astype(np.float64)
    metres = values if check.count("options", options, 0) & 1 else n + values * (f - n)
    camera = centered("angle", angle, max(rows, columns), metres.shape)
    return decoded(metres, f, camera, COPPELIASIM_AXES, time)


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


def _camera_by_height(angle_deg: float, shape: tuple[int, ...], name: str) -> Camera:
    angle = check.positive(name, angle_deg, "degrees")
    if angle >= 180.0:
        raise ValueError(f"{name}: expected an angle below 180 degrees, got {angle_deg!r}")
    warn_of_radians(name, angle)
    return centered(name, np.deg2rad(angle), shape[0], shape)


def _near_and_far(near: float, far: float) -> tuple[float, float]:
    n, f = check.positive("near", near, "m"), check.positive("far", far, "m")
    if f <= n:
        raise ValueError(f"far: expected more than near {n:g} m, got {f:g} m")
    return n, f
