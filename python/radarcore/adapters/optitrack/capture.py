"""Recorded motion capture: poses of bodies and places of markers over time, and Motive's axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.pose import as_pose, transforms
from radarcore.geometry.rotation import rotations_of
from radarcore.motion.trajectory import Trajectory

Array = NDArray[np.float64]

AXES = ("z_up", "z_up_world", "unchanged")
"""Ways to turn Motive's axes.

``"z_up"``: world and body axes alike, (x, -z, y) for (x, y, z); a body that Motive says is not turned is not turned.
``"z_up_world"``: the world's axes alone; bodies keep their own axes in Motive.
``"unchanged"``: as they came, as of a stream whose up axis is set to z.
"""

_HALF = np.sqrt(0.5)
_UNCHANGED = np.eye(4)
_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_POSITIONS = {"z_up": _UP, "z_up_world": _UP, "unchanged": _UNCHANGED[:3, :3]}
"""Motive's positions in the world of radarcore, by the choice of axes."""

_QUATERNIONS = {
    # q_R q q_R^-1, where q_R turns by 90 degrees about x: the rotation vector is turned.
    "z_up": np.block([[np.eye(1), np.zeros((1, 3))], [np.zeros((3, 1)), _UP]]),
    # q_R q
    "z_up_world": _HALF * np.array([[1, -1, 0, 0], [1, 1, 0, 0], [0, 0, 1, -1], [0, 0, 1, 1]]),
    "unchanged": _UNCHANGED,
}
"""Motive's quaternions, order (w, x, y, z), in the world of radarcore."""


def positions_of(positions: Array, axes: str) -> Array:
    """Positions (..., 3) of Motive, in the world of radarcore."""
    return np.asarray(positions @ _POSITIONS[check.choice("axes", axes, AXES)].T)


def quaternions_of(quaternions: Array, axes: str) -> Array:
    """Quaternions (..., 4), order (w, x, y, z), of bodies in Motive, in the world of radarcore."""
    return np.asarray(quaternions @ _QUATERNIONS[check.choice("axes", axes, AXES)].T)


def motive_positions(positions: Array, axes: str) -> Array:
    """Positions (..., 3) in the world of radarcore, in Motive's world: inverse of `positions_of`."""
    return np.asarray(positions @ _POSITIONS[check.choice("axes", axes, AXES)])


def motive_quaternions(quaternions: Array, axes: str) -> Array:
    """Quaternions (..., 4), order (w, x, y, z), of radarcore's poses, as Motive has them."""
    return np.asarray(quaternions @ _QUATERNIONS[check.choice("axes", axes, AXES)])


@dataclass(frozen=True, eq=False)
class CapturedBody:
    """Poses of a rigid body, or of a bone of a skeleton, over time; NaN where it was not seen.

    Attributes
    ----------
    position : (n, 3) float64
        Origin of the body in the world [m].
    quaternion : (n, 4) float64
        Order (w, x, y, z), body axes to the world.
    mean_marker_error : (n,) float64
        Mean distance of the seen markers from their places on the body [m]; NaN where the source does not say.

    See Also
    --------
    adapters.optitrack.MotionCapture : Bodies with their times.

    Examples
    --------
    >>> track = np.array([[2.0, 0.0, 1.0], [1.9, 0.0, 1.0], [1.8, 0.0, 1.0]])
    >>> ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-4))
    >>> ball.is_tracked.tolist(), ball.rotation.shape
    ([True, True, True], (3, 3, 3))
    """

    position: Array
    quaternion: Array
    mean_marker_error: Array

    def __post_init__(self) -> None:
        number = len(np.atleast_1d(self.position))
        for name, shape in (("position", (number, 3)), ("quaternion", (number, 4)), ("mean_marker_error", (number,))):
            object.__setattr__(self, name, _values(name, getattr(self, name), shape))

    @property
    def is_tracked(self) -> NDArray[np.bool_]:
        """True where the pose is known, (n,)."""
        is_tracked: NDArray[np.bool_] = np.isfinite(self.position.sum(axis=1) + self.quaternion.sum(axis=1))
        return is_tracked

    @property
    def rotation(self) -> Array:
        """Body axes in the world, as columns, (n, 3, 3); NaN where the pose is not known."""
        is_tracked = self.is_tracked
        rotation = np.full((len(is_tracked), 3, 3), np.nan)
        known = self.quaternion[is_tracked]
        rotation[is_tracked] = rotations_of(known / np.linalg.norm(known, axis=1, keepdims=True))
        return rotation


@dataclass(frozen=True, eq=False)
class MotionCapture:
    """A take of motion capture.

    Attributes
    ----------
    time : (n,) float64
        From the start of the take in files [s], on the clock of the stream in live captures.
    bodies : mapping of str to CapturedBody
        Rigid bodies, and bones as ``skeleton:bone``, by name.
    markers : mapping of str to (n, 3) float64
        Places of markers as they were measured [m]; NaN where they were not seen.
    body_markers : mapping of str to (n, 3) float64
        Places of the markers of bodies as their poses say [m].
    frame_rate : float, optional
        Frames per second of the capture.
    start_time : str
        Text of the start time: local time of the recording computer, without a zone.
    take : str
        Name of the take.

    See Also
    --------
    adapters.optitrack.read_motive_csv : From a file.
    adapters.optitrack.MotionCaptureClient.record : Live.
    compare : Takes its trajectories as truth.

    Examples
    --------
    >>> track = np.array([[2.0, 0.0, 1.0], [1.9, 0.0, 1.0], [1.8, 0.0, 1.0]])
    >>> ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-4))
    >>> capture = rc.adapters.optitrack.MotionCapture(np.array([0.0, 0.1, 0.2]), {"ball": ball})
    >>> capture.names, capture.trajectory("ball", max_gap=None).at(0.1).position.tolist()
    (('ball',), [1.9, 0.0, 1.0])
    """

    time: Array
    bodies: Mapping[str, CapturedBody]
    markers: Mapping[str, Array] = field(default_factory=dict)
    body_markers: Mapping[str, Array] = field(default_factory=dict)
    frame_rate: float | None = None
    start_time: str = ""
    take: str = ""

    def __post_init__(self) -> None:
        time = check.in_order("time", check.array("time", self.time, (None,)))
        object.__setattr__(self, "time", time)
        for name, body in self.bodies.items():
            if len(body.position) != len(time):
                raise ValueError(
                    f"bodies: expected {len(time)} poses, one per time, got {len(body.position)} of {name!r}"
                )
        for group in ("markers", "body_markers"):
            places = {
                name: _values(f"{group}[{name!r}]", value, (len(time), 3))
                for name, value in getattr(self, group).items()
            }
            object.__setattr__(self, group, places)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = f", {self.time[0]:g} to {self.time[-1]:g} s" if len(self) else ""
        return f"MotionCapture({len(self)} frames{span}; {', '.join(self.names) or 'no bodies'})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(self.bodies)

    def __getitem__(self, name: str) -> CapturedBody:
        """The body of a name; a KeyError suggests near ones."""
        if name not in self.bodies:
            raise KeyError(f"no body {name!r} in the capture; {check.near_names(name, self.bodies)}")
        return self.bodies[name]

    def trajectory(
        self,
        name: str,
        *,
        clock_offset: float = 0.0,
        max_gap: float | None = 0.1,
        within_gaps: str = "error",
        extrapolate: str | None = None,
    ) -> Trajectory:
        """Motion of a body through the poses in which it was seen.

        Parameters
        ----------
        name : str
            Name of the body.
        clock_offset : float
            Added to the capture's times [s]: the other clock's time when the capture's clock shows 0.
        max_gap, within_gaps, extrapolate
            As for `Trajectory`. Times at which the body was not seen for longer than `max_gap` [s] are a gap; None
            bridges them all.

        See Also
        --------
        Trajectory : The result.
        processing.clock_offset : Offset of the clocks of camera and radar.

        Examples
        --------
        >>> track = np.array([[2.0, 0.0, 1.0], [1.9, 0.0, 1.0], [1.8, 0.0, 1.0]])
        >>> ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-4))
        >>> capture = rc.adapters.optitrack.MotionCapture(np.array([0.0, 0.1, 0.2]), {"ball": ball})
        >>> motion = capture.trajectory("ball", clock_offset=10.0, max_gap=None)
        >>> motion.at(10.1).position.tolist()
        [1.9, 0.0, 1.0]
        """
        body = self[name]
        seen = body.is_tracked
        if (num_seen := int(seen.sum())) < 2:
            raise ValueError(f"name: expected a body that was seen in at least two frames, got {name!r}, in {num_seen}")
        poses = [as_pose(one) for one in transforms(body.rotation[seen], body.position[seen])]
        times = self.time[seen] + check.number("clock_offset", clock_offset, "s")
        return Trajectory(times, poses, extrapolate=extrapolate, max_gap=max_gap, within_gaps=within_gaps)


def _values(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Values, NaN where they are not known, as a read-only copy."""
    values = np.array(value, dtype=np.float64)
    if values.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {values.shape}")
    return check.frozen(values)
