"""Vision sensors of CoppeliaSim: depth and grey images, and where they were taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.coppeliasim import decoders
from radarcore.adapters.images import PlanarDepth, from_coppeliasim
from radarcore.adapters.planar_depth import radar_in_camera
from radarcore.geometry.pose import Pose
from radarcore.motion.protocol import Motion

_METRES = 1
"""Option of ``sim.getVisionSensorDepth``: metres instead of fractions of near to far."""

_GREY = 1
"""Option of ``sim.getVisionSensorImg``: a byte per pixel."""

_NEAREST = 0.1
"""Near clipping plane before which a z-buffer of 24 bits is too coarse for phases of radar [m]."""

_BITS = 24


@dataclass(frozen=True, eq=False)
class VisionImage:
    """One look of a vision sensor; row 0 on top, column 0 on the left.

    Use: ``frame_from_depth(image.depth, image.grey, radar, camera=image.camera, planar=True, time=image.time)``.

    Attributes
    ----------
    planar : PlanarDepth
        The decoded depth image, with `points` and `valid`.
    grey : (rows, columns) uint8
        Grey image; `frame_from_depth` takes it for the power reflectance, as fractions of 255.
    pose : Pose
        Of a radar at the sensor: x axis along the line of sight, z axis up in the image.
    time : float
        Time of the simulation [s].

    See Also
    --------
    adapters.coppeliasim.VisionSensor.image : Makes one.
    frame_from_depth : Frame from it.

    Examples
    --------
    >>> buffer = np.full(12, 0.5, "<f4").tobytes()
    >>> planar = rc.adapters.images.from_coppeliasim(buffer, (4, 3), angle=1.0, near=0.1, far=10.1)
    >>> image = rc.adapters.coppeliasim.VisionImage(planar, np.full((3, 4), 200, np.uint8), rc.Pose(), time=0.5)
    >>> image.depth.shape, image.camera.cx
    ((3, 4), 2.0)
    """

    planar: PlanarDepth
    grey: NDArray[np.uint8]
    pose: Pose
    time: float

    @property
    def depth(self) -> NDArray[np.float64]:
        """Depth along the optical axis [m], (rows, columns); inf where there is nothing."""
        return self.planar.depth

    @property
    def camera(self) -> Any:
        """Pinhole camera of the image, `radarcore.Camera`."""
        return self.planar.camera


class VisionSensor:
    """A vision sensor of perspective type; `CoppeliaSim.vision_sensor` makes it.

    Parameters
    ----------
    sim : object
        The API `sim`.
    handle : int
        Of the sensor.
    path : str
        Its path, for messages.
    motion : Motion
        Of a radar at the sensor.

    Attributes
    ----------
    motion : Motion
        Motion of a radar at the sensor, for ``Simulator(radar_motion=...)``.
    near, far : float
        Clipping planes [m].
    angle : float
        Angle of the larger side of the image [rad].

    See Also
    --------
    adapters.coppeliasim.CoppeliaSim.vision_sensor : Makes one.
    adapters.images.from_coppeliasim : Decodes its buffers.

    Examples
    --------
    >>> # CoppeliaSim must be running.
    >>> with rc.adapters.coppeliasim.CoppeliaSim() as sim, sim.running():  # doctest: +SKIP
    ...     image = sim.vision_sensor("/camera").image()
    ...     print(image.depth.shape, image.camera)
    (128, 128) Camera(fx=110.9, fy=110.9, cx=64.0, cy=64.0)
    """

    def __init__(self, sim: Any, handle: int, path: str, motion: Motion) -> None:
        self._sim = sim
        self._handle = handle
        self.path: str = path
        self.motion: Motion = motion
        if not sim.getObjectInt32Param(handle, sim.visionintparam_perspective_operation):
            raise ValueError(f"{path}: expected a vision sensor of perspective type, got an orthographic one")
        self.near: float
        self.far: float
        self.angle: float
        self.near, self.far, self.angle = (
            float(sim.getObjectFloatParam(handle, parameter))
            for parameter in (
                sim.visionfloatparam_near_clipping,
                sim.visionfloatparam_far_clipping,
                sim.visionfloatparam_perspective_angle,
            )
        )
        if self.near < _NEAREST:
            error = _rounding(self.near, self.far)
            notice.warn(
                f"{path}: expected a near clipping plane at {_NEAREST:g} m or farther, got {self.near:g} m: depths of "
                f"3 m are rounded by {1e6 * error:.0f} um rms, {720.0 * error / 5e-3:.1f} degrees of phase at 60 GHz"
            )

    def image(self, *, metres: bool = True, handle: bool = False) -> VisionImage:
        """Image of the last step.

        Parameters
        ----------
        metres : bool
            Ask for metres; else for fractions of near to far, which older versions have alone.
        handle : bool
            Make the sensor look now, as it needs when it is marked "explicit handling".
        """
        sim, number = self._sim, self._handle
        if handle:
            sim.handleVisionSensor(number)
        options = _METRES if metres else 0
        time = check.number("time", sim.getSimulationTime(), "s")
        depth, resolution = sim.getVisionSensorDepth(number, options)
        planar = from_coppeliasim(
            depth, resolution, angle=self.angle, near=self.near, far=self.far, options=options, time=time
        )
        grey = decoders.from_grey_buffer(*sim.getVisionSensorImg(number, _GREY))
        pose = decoders.from_matrix(sim.getObjectMatrix(number, sim.handle_world))
        return VisionImage(planar, grey, pose @ radar_in_camera("coppeliasim"), time)


def _rounding(near: float, far: float) -> float:
    """Rms error of depths of 3 m from a z-buffer of 24 bits [m]: ``z^2 (f - n)/(f n 2^24)/sqrt(12)``."""
    return float(9.0 * (far - near) / (far * near * 2.0**_BITS) / np.sqrt(12.0))
