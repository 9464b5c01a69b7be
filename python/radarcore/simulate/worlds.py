"""Many worlds at once: one scene, whose bodies and radar are placed differently in each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.pose import checked_maps
from radarcore.motion.linear import FASTEST_TURN, ConstantTwist
from radarcore.recording.frame import Truth
from radarcore.scene.scene import Scene
from radarcore.units import SPEED_OF_LIGHT

Array = NDArray[np.float64]


class Worlds(NamedTuple):
    """Frames of several worlds at one time.

    Attributes
    ----------
    cube : (world, channel, chirp, sample) float32, float64, complex64 or complex128
        Samples as in `Frame.cube`; functions such as `range_doppler` and `range_profile` take them with the radar.
    truth : Truth
        Arrays (world, body).
    """

    cube: NDArray[Any]
    truth: Truth


class Placements:
    """Poses of bodies, points and sensor in every world; bodies that are not named are where the scene has them.

    Parameters are those of `Simulator.worlds`.
    """

    def __init__(
        self,
        scene: Scene,
        poses: ArrayLike,
        velocities: ArrayLike | None,
        angular_velocities: ArrayLike | None,
        bodies: tuple[str, ...],
    ) -> None:
        parts = scene.parts
        if parts.deforming or scene.interferers:
            raise ValueError("worlds: expected a scene without deforming bodies and interferers; `frame` takes them")
        if unknown := [name for name in bodies if name not in scene.names]:
            near = check.near_names(unknown[0], scene.names)
            raise ValueError(f"bodies: expected names of the scene's bodies, got {unknown[0]!r}{near}")
        given = np.asarray(poses)
        worlds, placed = given.shape[:2] if given.ndim == 4 else (0, 0)
        if worlds == 0 or placed not in (len(bodies), len(bodies) + 1):
            shape = f"(world, {len(bodies)}, 4, 4), or one more for the radar"
            raise ValueError(f"poses: expected shape {shape}, got {given.shape}")
        self.number = worlds
        maps = checked_maps("poses", given.reshape(-1, *given.shape[2:]), worlds * placed)
        rates = (
            np.zeros((worlds * placed, 3))
            if values is None
            else check.below(name, check.array(name, values, (worlds, placed, 3)), most, unit).reshape(-1, 3)
            for name, values, most, unit in (
                ("velocities", velocities, SPEED_OF_LIGHT, "m/s"),
                ("angular_velocities", angular_velocities, FASTEST_TURN, "rad/s"),
            )
        )
        self._moving = ConstantTwist(maps[:, :, :3], maps[:, :, 3], *rates)
        # The core counts bodies with meshes, then the sensor, then points.
        sensor = len(parts.mesh_numbers)
        rows = {int(number): row for row, number in enumerate(parts.mesh_numbers)}
        rows |= {int(number): sensor + 1 + row for row, number in enumerate(parts.point_numbers)}
        self.rows: list[int] = [*(rows[scene.names.index(name)] for name in bodies), *[sensor] * (placed - len(bodies))]

    def at(self, times: Array) -> Array:
        """Poses at times [s], (time, world, body, 3, 4); bodies are the `rows` of the core."""
        return self._moving.poses_at(times).reshape(len(times), self.number, -1, 3, 4)
