"""A walking person: 16 rigid segments that follow the gait model along a path, as spheroids or as real meshes.

Segment lengths are fractions of the body height and volumes come from masses and densities: R. Drillis, R. Contini,
"Body segment parameters" (1966), and W. T. Dempster, "Space requirements of the seated operator" (1955), both as in
D. A. Winter, "Biomechanics and Motor Control of Human Movement".
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose, as_pose
from radarcore.models.people import gait
from radarcore.models.people.path import FloorPath
from radarcore.models.recent import Recent
from radarcore.models.robots.data import through_obj
from radarcore.models.robots.links import human_joints, human_links
from radarcore.motion.protocol import Motion
from radarcore.scene.body import Body
from radarcore.scene.library import materials
from radarcore.scene.material import Material

_Floats = NDArray[np.float64]

SEGMENTS = (
    *("pelvis", "trunk", "neck", "head"),
    *("left_thigh", "right_thigh", "left_shank", "right_shank", "left_foot", "right_foot"),
    *("left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm", "left_hand", "right_hand"),
)
"""Names of the rigid parts."""

HIP_HEIGHT = 0.530
"""Height of the hip joints over body height."""


class Human:
    """A walking person of 16 rigid segments, every one with its exact pose and velocity at any time.

    Legs, arms, pelvis and trunk move as in the walking model of Boulic, Magnenat-Thalmann and Thalmann (1990, see
    `radarcore.models.people.gait`), which depends on speed and height alone. The person stays upright, faces where the
    path leads and walks on straight before its first and after its last waypoint: in and out of a scene. Velocities,
    accelerations and their derivatives are continuous, in turns of the path too.

    The model does not pin the feet: at 1.4 m/s the sole on the floor slides at up to 0.5 m/s and rises by up to 2 cm,
    at running speeds by more. The lowest point of a cycle touches the floor z = 0. Nor does it lean into turns.

    Parameters
    ----------
    height : float
        Body height [m].
    speed : float
        Mean speed along the path [m/s], up to 3 hip heights (0.53 of the height) per second. At 0 the person stands at
        the first waypoint and faces the second.
    path : (n, 2) array_like
        Waypoints on the floor, x and y [m], at least two; corners between them are cut as `turn_radius` says.
    turn_radius : float
        Smallest radius of the turns of the path [m], see `radarcore.models.people.path.FloorPath`.
    start_time : float
        Time at which the pelvis is at the first waypoint [s].
    phase : float
        Phase of the gait at `start_time` in cycles of two steps: the right heel strikes at 0, the left one at 0.5.
    mass : float, optional
        Body mass [kg], for the volumes; default: that of 70 kg at 1.75 m, in proportion to the square of the height.

    Raises
    ------
    ValueError
        For a speed above the model's limit, and for a path with legs too short for its turns.
    """

    def __init__(
        self,
        *,
        height: float = 1.75,
        speed: float = 1.4,
        path: ArrayLike = ((0.0, 0.0), (10.0, 0.0)),
        turn_radius: float = 0.4,
        start_time: float = 0.0,
        phase: float = 0.0,
        mass: float | None = None,
    ) -> None:
        self.height = check.positive("height", height, "m")
        self.speed = check.non_negative("speed", speed, "m/s")
        fastest = gait.MAX_RELATIVE_SPEED * HIP_HEIGHT * self.height
        if self.speed > fastest:
            raise ValueError(
                f"speed: expected at most {fastest:.3g} m/s for a height of {self.height:g} m (3 hip heights per "
                f"second, where the walking model ends), got {self.speed:g}"
            )
        self.path = FloorPath(path, turn_radius)
        self.start_time = check.number("start_time", start_time, "s")
        self.phase = check.number("phase", phase)
        self.mass = 70.0 * (self.height / 1.75) ** 2 if mass is None else check.positive("mass", mass, "kg")
        self._spheroids = _spheroids(self.height, self.mass)
        self._figure = _Figure(self, _skeleton(self.height), _lowest_of(self._spheroids["foot"]))

    @property
    def relative_speed(self) -> float:
        """Speed in hip heights per second: the parameter of the gait [1/s]."""
        return min(self.speed / (HIP_HEIGHT * self.height), gait.MAX_RELATIVE_SPEED)

    @property
    def cycle_duration(self) -> float:
        """Duration of two steps [s]; inf when standing."""
        return gait.cycle_duration(self.relative_speed) if self.speed > 0.0 else float("inf")

    def segment_motion(self, name: str) -> Motion:
        """Motion of a segment, one of `SEGMENTS`.

        The origin is its upper joint: hip, knee and ankle of the leg, shoulder, elbow and wrist of the arm; midway
        between the hips for pelvis and trunk, between the shoulders for the neck, and the chin's height on the trunk's
        axis for the head. Upright, with legs and arms hanging, the axes are x forward, y left, z up.
        """
        return self._figure.motion(name)

    def link_poses_at(self, times: ArrayLike) -> _Floats:
        """``[rotation | position]`` of all `SEGMENTS` at several times [s], (n, segment, 3, 4), to the world."""
        return self._figure.link_poses_at(times)

    def link_rates_at(self, times: ArrayLike) -> _Floats:
        """Time derivatives of `link_poses_at`, (n, segment, 3, 4)."""
        return self._figure.link_rates_at(times)

    def bodies(self, material: Material | None = None, name: str = "human", *, subdivisions: int = 4) -> list[Body]:
        """The person as 16 closed spheroids with the volumes of the segments.

        Parameters
        ----------
        material : Material, optional
            Default: ``materials["skin"]``.
        name : str
            The bodies are called ``name/segment``, such as ``human/left_foot``.
        subdivisions : int
            Of every spheroid, as for `shapes.sphere`: ``20 * 4**subdivisions`` triangles.
        """
        unit = shapes.sphere(1.0, subdivisions=subdivisions)
        meshes = {
            kind: Mesh(unit.vertices * spheroid.semi_axes + spheroid.center, unit.triangles)
            for kind, spheroid in self._spheroids.items()
        }
        return self._figure.bodies({segment: meshes[_kind(segment)] for segment in SEGMENTS}, material, name)

    def mesh_bodies(self, material: Material | None = None, name: str = "human") -> list[Body]:
        """The person as 16 real meshes of a man, scaled to the height (extra `robots`; about 109 000 triangles).

        They are those of `robots.human_links`, moved by the same joint angles, with that man's own proportions: the
        joints of the limbs are within 0.1 m of those of `segment_motion`, pelvis and trunk have their origin at his
        waist. Parameters and names as for `bodies`.
        """
        rest, parts = _real_man()
        scale = self.height / max(float(vertices[:, 2].max()) for vertices, _ in parts.values())
        local = {segment: (scale * (vertices - rest[segment]), rows) for segment, (vertices, rows) in parts.items()}
        figure = _Figure(self, _real_skeleton(rest, scale), _lowest_of(local["right_foot"][0]))
        return figure.bodies({segment: through_obj(*arrays) for segment, arrays in local.items()}, material, name)

    def __repr__(self) -> str:
        return f"<Human: {self.height:g} m, {self.mass:.3g} kg, {self.speed:g} m/s along {self.path.length:.3g} m>"


class _Skeleton(NamedTuple):
    """Places of the joints, (3,) each [m]; those of limbs on the left side, the right one mirrors them."""

    waist: _Floats
    """From midway between the hips, in the axes of the pelvis: where the trunk turns."""
    hip: _Floats
    """From the same point, in the same axes."""
    knee: _Floats
    """From the hip, in the axes of the thigh."""
    ankle: _Floats
    """From the knee, in the axes of the shank."""
    neck: _Floats
    """From the waist, in the axes of the trunk."""
    head: _Floats
    """From the waist, in the axes of the trunk."""
    shoulder: _Floats
    """From the waist, in the axes of the trunk."""
    elbow: _Floats
    """From the shoulder, in the axes of the upper arm."""
    wrist: _Floats
    """From the elbow, in the axes of the forearm."""


class _Spheroid(NamedTuple):
    """Shape of a segment in its own coordinates."""

    center: _Floats
    semi_axes: _Floats


class _Figure:
    """A skeleton that walks as a person does: poses and rates of all segments, together and one by one."""

    def __init__(self, human: Human, skeleton: _Skeleton, lowest: _Support) -> None:
        self._human = human
        # Positions from the axes of all segments: (segment and axis, segment).
        carried = _WAYS[:, :, None, None] * np.eye(len(SEGMENTS))[_CARRIERS][:, :, None] * _offsets(skeleton)[:, None]
        self._reach = carried.sum(axis=1).reshape(len(SEGMENTS), -1).T
        self._hip_height = HIP_HEIGHT * human.height
        self._lift = 0.0
        # The highest floor that no sole of a cycle is under, sampled to about 1e-6 m.
        turns, root = self._gait(np.linspace(0.0, 1.0, _LIFT_PHASES), 1)
        foot = self._maps(turns, root)[0, :, SEGMENTS.index("right_foot")]
        self._lift = -float((foot[:, 2, 3] + lowest(foot[:, 2, :3])).min())
        # The simulator asks segment after segment for the same times.
        self.poses, self.rates = Recent(self.link_poses_at), Recent(self.link_rates_at)

    def motion(self, name: str) -> Motion:
        """Motion of a segment; a `Pose` when the person stands."""
        index = SEGMENTS.index(check.choice("name", name, SEGMENTS))
        motion = _SegmentMotion(self, index)
        return motion if self._human.speed > 0.0 else motion.at(0.0)

    def bodies(self, meshes: dict[str, Mesh], material: Material | None, name: str) -> list[Body]:
        """Bodies of the segments' meshes."""
        material = materials["skin"] if material is None else material
        return [
            Body(meshes[segment], material=material, motion=self.motion(segment), name=f"{name}/{segment}")
            for segment in SEGMENTS
        ]

    def link_poses_at(self, times: ArrayLike) -> _Floats:
        """``[rotation | position]`` of all segments in the world at several times [s], (n, segment, 3, 4)."""
        return np.ascontiguousarray(self._along_the_path(times, 1)[0])

    def link_rates_at(self, times: ArrayLike) -> _Floats:
        """Their time derivatives, (n, segment, 3, 4)."""
        return np.ascontiguousarray(self._along_the_path(times, 2)[1])

    def _along_the_path(self, times: ArrayLike, orders: int) -> _Floats:
        """Maps of all segments to the world, (orders, n, segment, 3, 4)."""
        human = self._human
        elapsed = np.asarray(times, dtype=np.float64) - human.start_time
        turns, root = self._gait(human.phase + elapsed / human.cycle_duration, orders)
        place, heading, curvature = human.path.points_at(human.speed * elapsed)
        turns[0, :, 0] += heading[:, None]
        # The root sways about its place on the path, in axes that turn with the heading.
        sway = root[..., 0] + 1j * root[..., 1]
        if orders > 1:
            turn_rate = human.speed * curvature
            turns[1, :, 0] += turn_rate[:, None]
            sway[1] += human.speed + 1j * turn_rate * sway[0]
        on_floor = np.exp(1j * heading) * sway
        on_floor[0] += place
        root[..., 0], root[..., 1] = on_floor.real, on_floor.imag
        return self._maps(turns, root)

    def _maps(self, turns: _Floats, root: _Floats) -> _Floats:
        """Maps of all segments (orders, n, segment, 3, 4) from angles as of `_gait` and the root (orders, n, 3).

        The first axis holds the value and, with two orders, the time derivative.
        """
        maps = np.empty((*turns.shape[:2], 3, len(SEGMENTS), 4))  # order, time, row, segment, column
        # Rz Rx Ry, the first two rows as one of complex numbers.
        (cz, cx, cy), (sz, sx, sy) = np.cos(turns[0]).swapaxes(0, 1), np.sin(turns[0]).swapaxes(0, 1)
        across = np.empty((*cz.shape, 3), dtype=np.complex128)
        across[..., 0], across[..., 1], across[..., 2] = cy + 1j * (sx * sy), 1j * cx, sy - 1j * (sx * cy)
        forward = cz + 1j * sz
        across *= forward[..., None]
        axes = maps[..., :3]
        axes[0, :, 0], axes[0, :, 1] = across.real, across.imag
        axes[0, :, 2, :, 0], axes[0, :, 2, :, 1], axes[0, :, 2, :, 2] = -cx * sy, sx, cx * cy
        if len(turns) > 1:
            # Angular velocity: about the vertical, about x turned by it, about the segment's own y axis.
            about_z, about_x, about_y = (turns[1, :, angle, :, None] for angle in range(3))
            level = about_x * forward[..., None] + about_y * across[..., 1:2]
            upright = about_z + about_y * sx[..., None]
            height = axes[0, :, 2]
            rate = 1j * (upright * across - level * height)
            axes[1, :, 0], axes[1, :, 1] = rate.real, rate.imag
            axes[1, :, 2] = level.real * axes[0, :, 1] - level.imag * axes[0, :, 0]
        # Origins lie fixed in the axes of other segments, which carry them.
        maps[..., 3] = root[..., None] + axes.reshape(*axes.shape[:3], -1) @ self._reach
        return maps.swapaxes(2, 3)

    def _gait(self, phase: _Floats, orders: int) -> tuple[_Floats, _Floats]:
        """Angles about z, x and y (orders, n, 3, segment) [rad] and the root (orders, n, 3) [m] of straight walking.

        Every segment turns by ``Rz Rx Ry``: the limbs swing about the y axis of pelvis or trunk, so that their angles
        add up. The root lacks even motion.
        """
        human = self._human
        if human.speed > 0.0:
            angles, root = gait.posture(phase, human.relative_speed, orders)
            angles[1:] /= human.cycle_duration
            root[1:] /= human.cycle_duration
        else:
            angles, root = np.zeros((orders, len(phase), len(_STANDING))), np.zeros((orders, len(phase), 3))
            angles[0] = _STANDING
        turns = (angles @ _TURNS.reshape(len(_STANDING), -1)).reshape(*angles.shape[:-1], *_TURNS.shape[1:])
        root = self._hip_height * root
        root[0, ..., 2] += self._hip_height + self._lift
        return turns, root


class _SegmentMotion:
    """Motion of one segment: the `member` of a `group` whose poses are worked out together."""

    def __init__(self, group: _Figure, member: int) -> None:
        self.group, self.member = group, member

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> _Floats:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return self.group.poses(np.asarray(times, dtype=np.float64))[:, self.member]

    def rate_at(self, time: float) -> _Floats:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        rate: _Floats = self.rates_at([time])[0]
        return rate

    def rates_at(self, times: ArrayLike) -> _Floats:
        """Time derivatives of ``[rotation | position]`` at several times [s], (n, 3, 4)."""
        return self.group.rates(np.asarray(times, dtype=np.float64))[:, self.member]


# Angles of the gait as its speed goes to zero [degrees]: shoulders and elbows.
_STANDING = np.array([*2 * (0.0, 0.0, 0.0, 3.0, 3.0), *4 * (0.0,)])


def _turns() -> _Floats:
    """Angles of all segments about z, x and y as sums of the angles of the gait, (angle of the gait, 3, segment)."""
    *limbs, roll, torsion, thorax, lean = np.deg2rad(np.eye(len(_STANDING)))
    hip, knee, ankle, shoulder, elbow = np.array([limbs[:5], limbs[5:]]).swapaxes(0, 1)
    about_z, about_x, about_y = turns = np.zeros((3, len(SEGMENTS), len(_STANDING)))
    pelvis_and_legs, trunk_and_arms = [0, *range(4, 10)], [1, 2, 3, *range(10, 16)]
    about_z[pelvis_and_legs], about_z[trunk_and_arms] = -torsion, -thorax
    about_x[pelvis_and_legs] = roll
    about_y[trunk_and_arms] = -lean
    # Limbs, left and right; the knee bends backwards, the hand is stiff in the wrist.
    about_y[4:6] = -hip
    about_y[6:8] = knee - hip
    about_y[8:10] = knee - hip - ankle
    about_y[10:12] -= shoulder
    about_y[12:14] -= shoulder + elbow
    about_y[14:16] -= shoulder + elbow
    return np.moveaxis(turns, -1, 0).copy()


_TURNS = _turns()

# The segment that carries the origin of each of SEGMENTS: where that is, is fixed in the carrier's axes.
_CARRIERS = np.array([0, 0, 1, 1, 0, 0, 4, 5, 6, 7, 1, 1, 10, 11, 12, 13])


def _ways() -> _Floats:
    """Whose steps lead from midway between the hips to the origin of each segment: 1 for those, else 0."""
    ways = np.eye(len(SEGMENTS))
    for segment, carrier in enumerate(_CARRIERS):
        if carrier > 0:  # what the pelvis carries begins midway between the hips, not at its origin
            ways[segment] += ways[carrier]
    return ways


_WAYS = _ways()

# Phases at which the height of the soles is compared.
_LIFT_PHASES = 2048

_Support = Callable[[_Floats], _Floats]
"""Smallest product of directions (n, 3) with the points of a shape, (n,)."""


def _lowest_of(shape: _Spheroid | _Floats) -> _Support:
    """Support of a spheroid, or of points (m, 3), against their direction."""
    if isinstance(shape, _Spheroid):
        return lambda down: np.asarray(down @ shape.center - np.linalg.norm(down * shape.semi_axes, axis=-1))
    from scipy.spatial import ConvexHull

    corners = shape[ConvexHull(shape).vertices]
    return lambda down: np.asarray((down @ corners.T).min(axis=-1))


def _skeleton(height: float) -> _Skeleton:
    """Joints by body height, Drillis and Contini."""
    _, y, z = height * np.eye(3)
    return _Skeleton(
        waist=0.0 * z,
        hip=0.0955 * y,
        knee=-0.245 * z,
        ankle=-0.246 * z,
        neck=0.288 * z,
        head=0.340 * z,
        shoulder=0.1295 * y + 0.288 * z,
        elbow=-0.186 * z,
        wrist=-0.146 * z,
    )


def _offsets(skeleton: _Skeleton) -> _Floats:
    """Origins of the segments from those of their carriers, in the carriers' axes, (segment, 3) [m]."""
    waist, hip, knee, ankle, neck, head, shoulder, elbow, wrist = skeleton
    limbs = np.array([[joint, joint * [1.0, -1.0, 1.0]] for joint in (hip, knee, ankle, shoulder, elbow, wrist)])
    return np.concatenate([[waist, waist, neck, head], limbs.reshape(-1, 3)])


def _spheroids(height: float, mass: float) -> dict[str, _Spheroid]:
    """Spheroids by kind of segment: lengths by body height, volumes by mass over density."""

    def volume(fraction: float, density: float) -> float:
        return fraction * mass / density

    def along_z(upper: float, lower: float, volume: float, half_width: float | None = None) -> _Spheroid:
        """_Spheroid between two heights, of revolution unless a half-width is given (all over body height)."""
        half_length = 0.5 * (upper - lower) * height
        section = volume / (4.0 / 3.0 * pi * half_length)
        across = sqrt(section) if half_width is None else half_width * height
        center = np.array([0.0, 0.0, 0.5 * (upper + lower) * height])
        return _Spheroid(center, np.array([section / across, across, half_length]))

    # Wider than deep: between the breadths of chest (0.174) and shoulders (0.259).
    trunk = along_z(0.288, 0.0, volume(0.355, 1030.0), half_width=0.108)
    # As wide as the hips are apart and as deep as the trunk; its height follows, 0.13 of the body's.
    depth, breadth = trunk.semi_axes[0], 0.0955 * height
    pelvis_height = volume(0.142, 1030.0) / (4.0 / 3.0 * pi * depth * breadth)
    # From the heel, a quarter of its length behind the ankle, to the toe, and from the sole up.
    length, breadth_foot = 0.5 * 0.152 * height, 0.5 * 0.055 * height
    foot_height = volume(0.0145, 1100.0) / (4.0 / 3.0 * pi * length * breadth_foot)
    return {
        "pelvis": _Spheroid(np.zeros(3), np.array([depth, breadth, pelvis_height])),
        "trunk": trunk,
        # A fifth of head and neck is the neck, which reaches into head and trunk by half of its length.
        "neck": along_z(0.078, -0.026, volume(0.2 * 0.081, 1110.0)),
        "head": along_z(0.130, 0.0, volume(0.8 * 0.081, 1110.0)),
        "thigh": along_z(0.0, -0.245, volume(0.100, 1050.0)),
        "shank": along_z(0.0, -0.246, volume(0.0465, 1090.0)),
        "foot": _Spheroid(
            np.array([0.5 * length, 0.0, foot_height - 0.039 * height]),
            np.array([length, breadth_foot, foot_height]),
        ),
        "upper_arm": along_z(0.0, -0.186, volume(0.028, 1070.0)),
        "forearm": along_z(0.0, -0.146, volume(0.016, 1130.0)),
        "hand": along_z(0.0, -0.108, volume(0.006, 1160.0)),
    }


def _kind(segment: str) -> str:
    """Name of a segment without its side."""
    return segment.removeprefix("left_").removeprefix("right_")


# Segments that the links of the real man belong to; the mesh of the neck is part of his head's link.
_REAL_LINKS = {
    "middle_pelvis": "pelvis",
    "middle_abdomen": "trunk",
    "middle_thorax": "trunk",
    "middle_head": "head",
    "upperleg": "thigh",
    "lowerleg": "shank",
    "foot": "foot",
    "upperarm": "upper_arm",
    "lowerarm": "forearm",
    "hand": "hand",
}


def _real_segment(link: str) -> str:
    """Segment of a mesh of the real man, by its name ``link/mesh``."""
    body, _, mesh = link.partition("/")
    if mesh == "neck_mesh":
        return "neck"
    side = body.split("_")[0] + "_" if body.startswith(("left_", "right_")) else ""
    return side + _REAL_LINKS[body.removeprefix(side)]


@cache
def _real_man() -> tuple[dict[str, _Floats], dict[str, tuple[_Floats, NDArray[np.int64]]]]:
    """Origins (3,) and meshes of the segments of the real man, standing upright on the floor [m]."""
    origins = human_joints()
    rest: dict[str, _Floats] = {}
    meshes: dict[str, list[tuple[_Floats, NDArray[np.int64]]]] = {segment: [] for segment in SEGMENTS}
    for link in human_links():
        segment = _real_segment(link.name)
        rest.setdefault(segment, origins[link.name.split("/")[0]])
        before = sum(len(vertices) for vertices, _ in meshes[segment])
        placed = link.vertices @ link.pose[:3, :3].T + link.pose[:3, 3]
        meshes[segment].append((placed, link.triangles + before))
    return rest, {
        segment: (np.concatenate([v for v, _ in parts]), np.concatenate([rows for _, rows in parts]))
        for segment, parts in meshes.items()
    }


def _real_skeleton(rest: dict[str, _Floats], scale: float) -> _Skeleton:
    """Joints of the real man from the origins of his segments."""
    hips, waist = 0.5 * (rest["left_thigh"] + rest["right_thigh"]), rest["trunk"]
    return _Skeleton(
        waist=scale * (waist - hips),
        hip=scale * (rest["left_thigh"] - hips),
        knee=scale * (rest["left_shank"] - rest["left_thigh"]),
        ankle=scale * (rest["left_foot"] - rest["left_shank"]),
        neck=scale * (rest["neck"] - waist),
        head=scale * (rest["head"] - waist),
        shoulder=scale * (rest["left_upper_arm"] - waist),
        elbow=scale * (rest["left_forearm"] - rest["left_upper_arm"]),
        wrist=scale * (rest["left_hand"] - rest["left_forearm"]),
    )
