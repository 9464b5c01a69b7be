"""Motions for programs that have a pose now and not a function of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.geometry.pose import Pose, checked_maps, not_a_pose, transforms
from radarcore.geometry.rotation import (
    Matrix,
    cross_matrix,
    inverse_rate_jacobian,
    rate_jacobian,
    rotation_vectors,
    rotations_about,
)
from radarcore.motion.linear import FASTEST_TURN, ConstantTwist
from radarcore.motion.protocol import LinkMotion, Links
from radarcore.motion.series import LONG_STEP, steps_between, warn_of_milliseconds
from radarcore.records import sealed
from radarcore.units import SPEED_OF_LIGHT

KEPT = 256
"""Updates that are kept: a quarter of a second of a program that takes a thousand steps per second."""

_FAR_BEFORE = 0.1
"""Time before the first update from which on there is no pose [s]: frames and differences reach less far back."""

_LONG_AFTER = 1.0
"""Time after the newest update from which on a moving body is doubtful [s]."""

_NEVER = -np.inf

_SAME_TIME = 1e-9
"""Times that are nearer are the same [s]."""


@sealed
class LiveGroup(Links):
    """Several bodies whose poses a running program gives, all by one call, step by step.

    After the newest update every body continues at its velocity and angular velocity; a frame that starts then uses
    them. Between updates it follows a cubic through the poses and rates of both: a frame that starts before the newest
    update uses the later updates. The last 256 updates are stored.

    Parameters
    ----------
    num_bodies : int

    Attributes
    ----------
    motions : tuple of Motion
        Motions of the bodies, for ``Body(motion=...)``; also ``group[0]``.

    See Also
    --------
    Live : One body.
    Body : Takes each of the motions.

    Examples
    --------
    >>> group = rc.LiveGroup(2)
    >>> group.update(0.0, [rc.Pose([1.0, 0.0, 0.0]), rc.Pose([2.0, 0.0, 0.0])], velocities=[[0, 0, 0], [1, 0, 0]])
    >>> group[1].at(0.5).position
    array([2.5, 0. , 0. ])
    """

    def __init__(self, num_bodies: int) -> None:
        self._num_bodies = check.count("num_bodies", num_bodies)
        self.motions: tuple[LinkMotion, ...] = tuple(LinkMotion(self, number) for number in range(self._num_bodies))
        self._known = History()

    def update(
        self,
        time: float,
        poses: ArrayLike | Sequence[Pose],
        *,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
    ) -> None:
        """Poses of all bodies at a time.

        Parameters
        ----------
        time : float
            After the update before, or the same, which is then replaced [s].
        poses : (body, 4, 4) or (body, 3, 4) array_like, or sequence of Pose
            Body to world.
        velocities : (body, 3) array_like, optional
            Of the bodies' origins, in world axes [m/s]. Default, and rows of NaN: the difference to the update before.
        angular_velocities : (body, 3) array_like, optional
            In world axes [rad/s]. Default, and rows of NaN: the difference to the update before, less than half a turn.

        See Also
        --------
        Live.update : Of one body.

        Examples
        --------
        >>> group = rc.LiveGroup(2)
        >>> group.update(0.0, np.tile(np.eye(4), (2, 1, 1)), velocities=[[0, 0, 0], [1, 0, 0]])
        >>> group.newest
        0.0
        """
        number = self._num_bodies
        at = check.time("time", time)
        if isinstance(poses, Sequence) and any(isinstance(pose, Pose) for pose in poses):
            poses = [_map_of(cast(Pose, pose)) for pose in poses]
        maps = checked_maps("poses", cast(ArrayLike, poses), number)
        linear, no_linear = _rates("velocities", velocities, number, SPEED_OF_LIGHT, "m/s")
        angular, no_angular = _rates("angular_velocities", angular_velocities, number, FASTEST_TURN, "rad/s")
        self._known.add(Update(at, maps, Rates(linear, angular), np.array([no_linear, no_angular])))

    def clear(self) -> None:
        """Forget all updates: time may start again, as after a reset of the program."""
        self._known.updates = ()

    @property
    def newest(self) -> float:
        """Time of the newest update [s]; minus infinity before the first."""
        return self._known.updates[-1].time if self._known.updates else _NEVER

    def link_poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` of all bodies at times (n,) [s], (n, body, 3, 4)."""
        return poses_at(*self._known.of(times))

    def link_poses_and_rates_at(self, times: ArrayLike) -> Matrix:
        """`link_poses_at` and their time derivatives, (2, n, body, 3, 4)."""
        known = self._known.of(times)
        return np.array([poses_at(*known), rates_at(*known)])

    def __len__(self) -> int:
        return self._num_bodies

    def __getitem__(self, number: int) -> LinkMotion:
        return self.motions[check.index("number", number, self._num_bodies)]

    def __repr__(self) -> str:
        return f"<LiveGroup of {self._num_bodies} bodies: {self._known}>"


@sealed
class Live(LinkMotion):
    """A motion whose pose a running program gives, step by step; `LiveGroup` has many in one call.

    After the newest update the body continues at its velocity and angular velocity. Between updates it follows a cubic
    through the poses and rates of both. The last 256 updates are stored. `Simulator.frame` without a time starts at the
    newest update.

    See Also
    --------
    LiveGroup : Many bodies in one call.
    Simulator.frame : Frame at the newest update.
    Trajectory : Motion through poses that are known before.

    Examples
    --------
    >>> hand = rc.Live()
    >>> hand.update(0.0, rc.Pose([1.0, 0.0, 0.0]), velocity=[0.5, 0.0, 0.0])
    >>> hand.at(0.1).position
    array([1.05, 0.  , 0.  ])
    """

    def __init__(self) -> None:
        self._group = LiveGroup(1)
        super().__init__(self._group, 0)

    def update(
        self,
        time: float,
        pose: Pose | ArrayLike,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None:
        """The pose at a time.

        Parameters
        ----------
        time : float
            After the update before, or the same, which is then replaced [s].
        pose : Pose, or (4, 4) or (3, 4) array_like
            Body to world.
        velocity : (3,) array_like, optional
            Of the pose's origin, in world axes [m/s]. Default: the difference to the update before.
        angular_velocity : (3,) array_like, optional
            In world axes [rad/s]. Default: the difference to the update before, less than half a turn.

        See Also
        --------
        Pose.from_matrix : Pose from a homogeneous matrix.
        Simulator.frame : Frame at the newest update.

        Examples
        --------
        >>> hand = rc.Live()
        >>> hand.update(0.0, rc.Pose([1.0, 0.0, 0.0]))
        >>> hand.update(0.1, rc.Pose([1.1, 0.0, 0.0]))
        >>> hand.rate_at(0.1)[:, 3].round(3)
        array([1., 0., 0.])
        """
        placed = pose if isinstance(pose, Pose) else Pose.from_matrix(pose)
        rates = [
            None if value is None else check.array(name, value, (3,))[None]
            for name, value in (("velocity", velocity), ("angular_velocity", angular_velocity))
        ]
        self._group.update(time, _map_of(placed)[None], velocities=rates[0], angular_velocities=rates[1])

    def clear(self) -> None:
        """Forget all updates: time may start again, as after a reset of the program."""
        self._group.clear()

    def __repr__(self) -> str:
        return f"<Live: {self._group._known}>"


class History:
    """The stored updates, replaced as a whole: a concurrent reader sees the updates of one moment."""

    def __init__(self) -> None:
        self.updates: tuple[Update, ...] = ()
        self._has_warned = False
        self._warned_of_milliseconds = False

    def add(self, update: Update) -> None:
        """One more update."""
        earlier = self.updates
        if earlier and abs(update.time - earlier[-1].time) <= _SAME_TIME:
            earlier = earlier[:-1]
        if earlier and update.time < earlier[-1].time:
            raise ValueError(
                f"time: expected {earlier[-1].time:.9g} s, the time of the newest update, or later, got "
                f"{update.time:.9g} s; clear() forgets the updates of a run before"
            )
        newest = with_finite_differences(earlier[-1], update) if earlier else (update,)
        self.updates = (*earlier[max(0, len(earlier) - KEPT + 1) : -1], *newest)
        if newest[-1].interval > LONG_STEP and not self._warned_of_milliseconds:
            step = steps_between(np.array([one.maps for one in newest])).max(axis=1)
            self._warned_of_milliseconds = warn_of_milliseconds("time", np.array([newest[-1].interval]), step)

    def of(self, times: ArrayLike) -> tuple[tuple[Update, ...], Matrix]:
        """Updates for poses at times (n,) [s], and these; or an error if there are none."""
        updates, wanted = self.updates, check.numbers("times", times)
        if not updates:
            raise ValueError("Live: expected an update before any pose is asked for, got none; see Live.update")
        if (first := wanted.min(initial=np.inf)) < updates[0].time - _FAR_BEFORE:
            raise ValueError(
                f"time: expected {updates[0].time:.9g} s, the first update of this Live motion that is kept, or later, "
                f"got {first:.9g} s"
            )
        elapsed = wanted.max(initial=-np.inf) - updates[-1].time
        if elapsed > _LONG_AFTER and updates[-1].moves and not self._has_warned:
            self._has_warned = True
            notice.warn(
                f"a Live motion is asked for {elapsed:.3g} s after its newest update, at {updates[-1].time:.9g} s: it "
                "continues at its velocity there"
            )
        return updates, wanted

    def __str__(self) -> str:
        if not self.updates:
            return "no update yet"
        return f"{len(self.updates)} updates, the newest at {self.updates[-1].time:g} s"


def _map_of(pose: Pose) -> Matrix:
    """``[rotation | position]``, (3, 4)."""
    if not isinstance(pose, Pose):
        raise not_a_pose("poses", "Pose", pose)
    return transforms(pose.rotation, pose.position)


def _rates(
    name: str, values: ArrayLike | None, number: int, most: float, unit: str
) -> tuple[Matrix, NDArray[np.bool_]]:
    """Checked rates (body, 3), zero where they are unknown, and which those are, (body,)."""
    if values is None:
        return np.zeros((number, 3)), np.ones(number, dtype=np.bool_)
    given = check.numbers(name, values, (number, 3))
    unknown: NDArray[np.bool_] = np.asarray(np.isnan(given).all(axis=-1))
    rates = check.array(name, np.where(unknown[:, None], 0.0, given), (number, 3))
    if (largest := float(np.abs(rates).max(initial=0.0))) >= most:
        raise ValueError(f"{name}: expected less than {most:.0e} {unit}, got {largest:g}")
    return rates, unknown


class Rates(NamedTuple):
    """Velocities and angular velocities in world axes, (body, 3) each [m/s], [rad/s]."""

    velocities: Matrix
    angular_velocities: Matrix


@dataclass(frozen=True, eq=False)
class Update:
    """Poses and rates at one time.

    Attributes
    ----------
    time : float
        [s].
    maps : (body, 3, 4) float64
        ``[rotation | position]``, to the world.
    rates : Rates
        As given, or the difference to the update before.
    unknown : (2, body) bool
        True for velocities, and for angular velocities, that were not given.
    interval : float
        Time since the update before [s]; 0 of the first.
    rates_before : Rates, optional
        Rates of the past: where none were given, from a parabola through the neighbours.
    """

    time: float
    maps: Matrix
    rates: Rates
    unknown: NDArray[np.bool_]
    interval: float = 0.0
    rates_before: Rates | None = None

    @cached_property
    def moves(self) -> bool:
        """True if any body moves."""
        return any(values.any() for values in self.rates)

    @cached_property
    def continued(self) -> ConstantTwist:
        """Motion at constant rates, from the time of the update on; of the past, also before it."""
        return ConstantTwist(self.maps[..., :3], self.maps[..., 3], *self.past)

    @property
    def past(self) -> Rates:
        """Rates, as well as they are known."""
        return self.rates_before or self.rates


def with_finite_differences(before: Update, update: Update) -> tuple[Update, Update]:
    """An update and the one before it, with differences for the rates that were not given."""
    interval = update.time - before.time
    if not (update.unknown.any() or before.unknown.any()):
        return before, replace(update, interval=interval)
    turned = rotation_vectors(update.maps[..., :3] @ np.swapaxes(before.maps[..., :3], -1, -2))
    differences = (update.maps[..., 3] - before.maps[..., 3]) / interval, turned / interval
    check.below("poses", differences[0], SPEED_OF_LIGHT, "m/s from the update before")
    check.below("poses", differences[1], FASTEST_TURN, "rad/s from the update before")
    # The slope in the middle of two differences is the slope of the parabola; a first update has one neighbour.
    share = before.interval / (before.interval + interval) if before.interval > 0.0 else 1.0
    middle = [
        np.where(rows[:, None], (1.0 - share) * rate + share * difference, rate)
        for rows, rate, difference in zip(before.unknown, before.rates, differences, strict=True)
    ]
    own = [
        np.where(rows[:, None], difference, rate)
        for rows, rate, difference in zip(update.unknown, update.rates, differences, strict=True)
    ]
    return replace(before, rates_before=Rates(*middle)), replace(update, rates=Rates(*own), interval=interval)


class Between:
    """Cubic motions between updates and the next ones, with the poses and rates of both.

    Rotations are relative to the first update, with cubics as rotation vectors.

    Parameters
    ----------
    pairs : sequence of (Update, Update)
        Segments.
    segments : (n,) int
        Segment that each time is in.
    times : (n,) float64
        [s].
    """

    def __init__(self, pairs: Sequence[tuple[Update, Update]], segments: NDArray[np.intp], times: Matrix) -> None:
        start, end = np.array([[update.time for update in pair] for pair in pairs]).T
        length = (end - start)[:, None, None]
        # Poses and rates at both ends of every segment, (segment, end, body, ...).
        maps = np.array([[update.maps for update in pair] for pair in pairs])
        velocities, turning = np.moveaxis(np.array([[update.past for update in pair] for pair in pairs]), 2, 0)
        rotations, positions = maps[:, 0, :, :, :3], maps[..., 3]
        turn = rotation_vectors(maps[:, 1, :, :, :3] @ np.swapaxes(rotations, -1, -2))
        bend = (inverse_rate_jacobian(turn) @ turning[:, 1, :, :, None])[..., 0]
        # Cubics of position and rotation vector side by side, (power, time, body, 6), by values and rates at both ends.
        first = np.concatenate([positions[:, 0], 0.0 * turn], axis=-1)
        leaving = np.concatenate([velocities[:, 0], turning[:, 0]], axis=-1)
        arriving = np.concatenate([velocities[:, 1], bend], axis=-1)
        mean = np.concatenate([positions[:, 1] - positions[:, 0], turn], axis=-1) / length
        square, cube = (3.0 * mean - 2.0 * leaving - arriving) / length, (leaving + arriving - 2.0 * mean) / length**2
        self._cubics = np.array([first, leaving, square, cube])[:, segments]
        self._rotations, self._elapsed = rotations[segments], (times - start[segments])[:, None, None]

    def poses(self) -> Matrix:
        """``[rotation | position]`` at the times, (n, body, 3, 4)."""
        first, leaving, square, cube = self._cubics
        values = first + self._elapsed * (leaving + self._elapsed * (square + self._elapsed * cube))
        return transforms(rotations_about(values[..., 3:]) @ self._rotations, values[..., :3])

    def rates(self) -> Matrix:
        """Time derivatives of `poses`."""
        _, leaving, square, cube = self._cubics
        turn = (self._elapsed * (leaving + self._elapsed * (square + self._elapsed * cube)))[..., 3:]
        slopes = leaving + self._elapsed * (2.0 * square + 3.0 * self._elapsed * cube)
        angular = (rate_jacobian(turn) @ slopes[..., 3:, None])[..., 0]
        return transforms(cross_matrix(angular) @ rotations_about(turn) @ self._rotations, slopes[..., :3])


def poses_at(updates: Sequence[Update], times: Matrix) -> Matrix:
    """Poses (time, body, 3, 4) at times [s]."""
    return _values_at(updates, times, ConstantTwist.poses_at, Between.poses)


def rates_at(updates: Sequence[Update], times: Matrix) -> Matrix:
    """Time derivatives of `poses_at`."""
    return _values_at(updates, times, ConstantTwist.rates_at, Between.rates)


def _values_at(
    updates: Sequence[Update],
    times: Matrix,
    of_end: Callable[[ConstantTwist, Matrix], Matrix],
    of_segments: Callable[[Between], Matrix],
) -> Matrix:
    """Values before the first update, between updates, and after the last one."""
    found = np.empty((len(times), *updates[0].maps.shape))
    place = np.searchsorted([update.time for update in updates], times, side="right")
    for number, end in ((0, updates[0]), (len(updates), updates[-1])):
        if (some := place == number).any():
            found[some] = of_end(end.continued, times[some] - end.time)
    if (some := (place > 0) & (place < len(updates))).any():
        used, segments = np.unique(place[some], return_inverse=True)
        pairs = [(updates[number - 1], updates[number]) for number in used.tolist()]
        found[some] = of_segments(Between(pairs, segments, times[some]))
    return found
