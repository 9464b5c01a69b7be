"""A walking or standing figure of rigid segments: poses of all segments from the joint angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.models.people import gait, standing
from radarcore.models.people.path import FloorPath
from radarcore.motion.protocol import LinkMotion, Links, Motion
from radarcore.scene.body import Body
from radarcore.scene.library import materials
from radarcore.scene.material import Material

Floats = NDArray[np.float64]

SEGMENTS = (
    *("pelvis", "trunk", "neck", "head"),
    *("left_thigh", "right_thigh", "left_shank", "right_shank", "left_foot", "right_foot"),
    *("left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm", "left_hand", "right_hand"),
)
"""Names of the rigid parts."""

HIP_HEIGHT = 0.530
"""Height of the hip joints over body height."""


Support = Callable[[Floats], Floats]
"""Smallest product of directions (n, 3) with the points of a shape, (n,)."""

_LIFT_PHASES = 2048
"""Number of phases of a cycle to sample the height of the soles."""


@dataclass(frozen=True, eq=False)
class Walk:
    """A person's walk along a path; the fields are parameters of `Human`."""

    height: float
    speed: float
    path: FloorPath
    start_time: float
    phase: float
    breathing: float | None = None

    @property
    def is_static(self) -> bool:
        """True for a standing person without breathing."""
        return self.speed == 0.0 and self.breathing is None

    @property
    def relative_speed(self) -> float:
        """Speed in hip heights per second: the parameter of the gait [1/s]."""
        return min(self.speed / (HIP_HEIGHT * self.height), gait.MAX_RELATIVE_SPEED)

    @property
    def cycle_duration(self) -> float:
        """Duration of two steps [s]; inf when standing."""
        return gait.cycle_duration(self.relative_speed) if self.speed > 0.0 else float("inf")


class Skeleton(NamedTuple):
    """Positions of the joints, (3,) each [m]; limbs of the left side, which the right side mirrors."""

    waist: Floats
    """Centre of the trunk's rotations, from midway between the hips, in the axes of the pelvis."""
    hip: Floats
    """Left hip, from midway between the hips, in the axes of the pelvis."""
    knee: Floats
    """Knee, from the hip, in the axes of the thigh."""
    ankle: Floats
    """Ankle, from the knee, in the axes of the shank."""
    neck: Floats
    """Neck, from the waist, in the axes of the trunk."""
    head: Floats
    """Head, from the waist, in the axes of the trunk."""
    shoulder: Floats
    """Shoulder, from the waist, in the axes of the trunk."""
    elbow: Floats
    """Elbow, from the shoulder, in the axes of the upper arm."""
    wrist: Floats
    """Wrist, from the elbow, in the axes of the forearm."""


class Figure(Links):
    """A walking or standing skeleton: poses and rates of all segments, together or individually."""

    def __init__(self, walk: Walk, skeleton: Skeleton, lift: float) -> None:
        self._walk = walk
        # Positions along the axes of the carrying segments: (segment, carrier, axis).
        carried = _CHAINS[:, :, None, None] * np.eye(len(SEGMENTS))[_CARRIERS][:, :, None] * _offsets(skeleton)[:, None]
        self._carried = carried.sum(axis=1)
        self._reach = _reach(self._carried)
        self._hip_height = HIP_HEIGHT * walk.height
        self._lift = lift
        self._leg = float((skeleton.knee + skeleton.ankle)[2])
        self._sway_phases = standing.random_phases(walk.phase, *walk.path.waypoints[0])

    def motion(self, name: str) -> Motion:
        """Motion of a segment; a `Pose` when the person is static."""
        index = SEGMENTS.index(check.choice("name", name, SEGMENTS))
        motion = LinkMotion(self, index)
        return motion.at(0.0) if self._walk.is_static else motion

    def bodies(self, meshes: dict[str, Mesh], material: Material | None, name: str) -> list[Body]:
        """Bodies of the segments' meshes."""
        material = materials["skin"] if material is None else material
        return [
            Body(meshes[segment], material=material, motion=self.motion(segment), name=f"{name}/{segment}")
            for segment in SEGMENTS
        ]

    def link_poses_at(self, times: ArrayLike) -> Floats:
        """``[rotation | position]`` of all segments in the world at several times [s], (n, segment, 3, 4)."""
        return np.ascontiguousarray(self._along_the_path(times, 1)[0])

    def link_poses_and_rates_at(self, times: ArrayLike) -> Floats:
        """`link_poses_at` and their time derivatives, (2, n, segment, 3, 4)."""
        return np.ascontiguousarray(self._along_the_path(times, 2))

    def lowest_sole(self, lowest: Support) -> float:
        """Height over the floor of the lowest point of a foot in a cycle, sampled to about 1e-6 m [m]."""
        reach, sums = _reach(self._carried[_LEG][:, _LEG]), _SEGMENT_ANGLES[:, :, _LEG]
        foot = _maps(*self._gait(np.linspace(0.0, 1.0, _LIFT_PHASES), 1, sums), reach)[0, :, -1]
        return float((foot[:, 2, 3] + lowest(foot[:, 2, :3])).min())

    def _along_the_path(self, times: ArrayLike, orders: int) -> Floats:
        """Maps of all segments to the world, (orders, n, segment, 3, 4)."""
        walk = self._walk
        elapsed = check.numbers("times", times) - walk.start_time
        turns, root = self._gait(walk.phase + elapsed / walk.cycle_duration, orders, _SEGMENT_ANGLES)
        chest = self._sway(elapsed, turns, root)
        place, heading, curvature = walk.path.points_at(walk.speed * elapsed)
        turns[0, :, 0] += heading[:, None]
        # The root sways about its place on the path, in axes that rotate with the heading.
        sway = root[..., 0] + 1j * root[..., 1]
        if orders > 1:
            turn_rate = walk.speed * curvature
            turns[1, :, 0] += turn_rate[:, None]
            sway[1] += walk.speed + 1j * turn_rate * sway[0]
        on_floor = np.exp(1j * heading) * sway
        on_floor[0] += place
        root[..., 0], root[..., 1] = on_floor.real, on_floor.imag
        maps = _maps(turns, root, self._reach)
        if chest is not None:
            forward, trunk = maps[:, :, _TRUNK, :, 0], maps[:, :, _TRUNK, :, 3]
            trunk += chest[0, :, None] * forward
            trunk[1:] += chest[1:, :, None] * forward[0]
        return maps

    def _sway(self, elapsed: Floats, turns: Floats, root: Floats) -> Floats | None:
        """Add the sway of a standing person to angles and root; return the chest's displacement (orders, n) [m]."""
        walk = self._walk
        if walk.speed > 0.0 or walk.breathing is None:
            return None
        lean, roll, chest = standing.posture(elapsed, walk.breathing, self._sway_phases, len(turns))
        turns[:, :, 2, _ABOVE_THE_FEET] += lean[..., None]
        turns[:, :, 1, _BETWEEN_HIPS_AND_FEET] += roll[..., None]
        # The ankles stay in place. Hips are the upper ends of the legs, which rotate about the ankles by Rx Ry.
        (cx, sx), (cy, sy) = ((np.cos(angle[0]), np.sin(angle[0])) for angle in (roll, lean))
        root[0] -= self._leg * np.stack([sy, -sx * cy, cx * cy - 1.0], axis=-1)
        for rate, along, about in zip(root[1:], lean[1:], roll[1:], strict=True):
            turned = [along * cy, along * sx * sy - about * cx * cy, -along * cx * sy - about * sx * cy]
            rate -= self._leg * np.stack(turned, axis=-1)
        return np.asarray(chest)

    def _gait(self, phase: Floats, orders: int, sums: Floats) -> tuple[Floats, Floats]:
        """Angles about z, x and y (orders, n, 3, segment) [rad] and the root (orders, n, 3) [m] of straight walking.

        Every segment rotates by ``Rz Rx Ry``. The limbs swing about the y axis of pelvis or trunk, so that their angles
        add up with the coefficients `sums`, see `_SEGMENT_ANGLES`. The root excludes the uniform forward motion.
        """
        walk = self._walk
        if walk.speed > 0.0:
            angles, root = gait.posture(phase, walk.relative_speed, orders)
            angles[1:] /= walk.cycle_duration
            root[1:] /= walk.cycle_duration
        else:
            angles, root = np.zeros((orders, len(phase), len(_STANDING))), np.zeros((orders, len(phase), 3))
            angles[0] = _STANDING
        turns = (angles @ sums.reshape(len(_STANDING), -1)).reshape(*angles.shape[:-1], *sums.shape[1:])
        root = self._hip_height * root
        root[0, ..., 2] += self._hip_height + self._lift
        return turns, root


def _maps(turns: Floats, root: Floats, reach: Floats) -> Floats:
    """Maps of segments (orders, n, segment, 3, 4) from the angles and root of `Figure._gait` and `_reach`.

    The first axis holds the value and, with two orders, the time derivative.
    """
    maps = np.empty((*turns.shape[:2], 3, turns.shape[-1], 4))  # order, time, row, segment, column
    axes = maps[..., :3]
    (cz, cx, cy), (sz, sx, sy) = np.cos(turns[0]).swapaxes(0, 1)[..., None], np.sin(turns[0]).swapaxes(0, 1)[..., None]
    # Rows of Rx Ry, then Rz.
    first = np.concatenate([cy, np.zeros_like(cy), sy], axis=-1)
    second = np.concatenate([sx * sy, cx, -sx * cy], axis=-1)
    axes[0, :, 0], axes[0, :, 1] = cz * first - sz * second, sz * first + cz * second
    axes[0, :, 2] = np.concatenate([-cx * sy, sx, cx * cy], axis=-1)
    if len(turns) > 1:
        # Angular velocity: about the vertical, about the rotated x axis, about the segment's y axis.
        about_z, about_x, about_y = turns[1].swapaxes(0, 1)
        angular = about_y[:, None] * axes[0, ..., 1]
        angular[:, 0] += about_x * cz[..., 0]
        angular[:, 1] += about_x * sz[..., 0]
        angular[:, 2] += about_z
        # Its cross product with the three axes.
        after, last = [1, 2, 0], [2, 0, 1]
        axes[1] = angular[:, after, :, None] * axes[0][:, last] - angular[:, last, :, None] * axes[0][:, after]
    # Origins are fixed in the axes of the carrying segments.
    maps[..., 3] = root[..., None] + axes.reshape(*axes.shape[:3], -1) @ reach
    return maps.swapaxes(2, 3)


def lift_of(walk: Walk, skeleton: Skeleton, lowest: Support) -> float:
    """Lift of the hips over `HIP_HEIGHT` so that the lowest point of the soles touches the floor [m]."""
    return -Figure(walk, skeleton, 0.0).lowest_sole(lowest)


# Angles of the gait in the limit of zero speed [degrees]: shoulders and elbows.
_STANDING = np.array([*2 * (0.0, 0.0, 0.0, 3.0, 3.0), *4 * (0.0,)])


def _segment_angles() -> Floats:
    """Coefficients of segment angles about z, x and y as sums of gait angles, (gait angle, 3, segment)."""
    *limbs, roll, torsion, thorax, lean = np.deg2rad(np.eye(len(_STANDING)))
    hip, knee, ankle, shoulder, elbow = np.array([limbs[:5], limbs[5:]]).swapaxes(0, 1)
    about_z, about_x, about_y = turns = np.zeros((3, len(SEGMENTS), len(_STANDING)))
    pelvis_and_legs, trunk_and_arms = [0, *range(4, 10)], [1, 2, 3, *range(10, 16)]
    about_z[pelvis_and_legs], about_z[trunk_and_arms] = -torsion, -thorax
    about_x[pelvis_and_legs] = roll
    about_y[trunk_and_arms] = -lean
    # Left and right limbs; the knee bends backwards, the wrist is rigid.
    about_y[4:6] = -hip
    about_y[6:8] = knee - hip
    about_y[8:10] = knee - hip - ankle
    about_y[10:12] -= shoulder
    about_y[12:14] -= shoulder + elbow
    about_y[14:16] -= shoulder + elbow
    return np.moveaxis(turns, -1, 0).copy()


_SEGMENT_ANGLES = _segment_angles()

# Carrier of each of SEGMENTS: the segment in whose axes its origin is fixed.
_CARRIERS = np.array([0, 0, 1, 1, 0, 0, 4, 5, 6, 7, 1, 1, 10, 11, 12, 13])


_TRUNK = SEGMENTS.index("trunk")
_ABOVE_THE_FEET = [k for k, name in enumerate(SEGMENTS) if not name.endswith("foot")]
_BETWEEN_HIPS_AND_FEET = [k for k, name in enumerate(SEGMENTS) if name.endswith(("thigh", "shank"))]

_LEG = [SEGMENTS.index(name) for name in ("pelvis", "right_thigh", "right_shank", "right_foot")]
"""The right foot and its carriers."""


def _reach(carried: Floats) -> Floats:
    """Matrix from the axes of all segments to the positions of segments, (segment and axis, segment)."""
    return np.ascontiguousarray(carried.reshape(len(carried), -1).T)


def _chains() -> Floats:
    """Chain of carriers from midway between the hips to each segment, (segment, segment): 1 in the chain, else 0."""
    chains = np.eye(len(SEGMENTS))
    for segment, carrier in enumerate(_CARRIERS):
        if carrier > 0:  # the pelvis carries segments from midway between the hips, not from its origin
            chains[segment] += chains[carrier]
    return chains


_CHAINS = _chains()


def _offsets(skeleton: Skeleton) -> Floats:
    """Origin of each segment relative to its carrier's origin, in the carrier's axes, (segment, 3) [m]."""
    waist, hip, knee, ankle, neck, head, shoulder, elbow, wrist = skeleton
    limbs = np.array([[joint, joint * [1.0, -1.0, 1.0]] for joint in (hip, knee, ankle, shoulder, elbow, wrist)])
    return np.concatenate([[waist, waist, neck, head], limbs.reshape(-1, 3)])
