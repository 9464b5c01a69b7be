"""Poses and twists of several bodies that are known at some times: before, between and after these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry.pose import Matrix, cross_matrix, rotation_vectors, rotations_about, transforms
from radarcore.motion.linear import FASTEST_TURN
from radarcore.motion.uniform import Uniform
from radarcore.units import SPEED_OF_LIGHT


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
        Rates of the past: where they were not given, those of a parabola through the neighbours.
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
    def continued(self) -> Uniform:
        """Motion at constant rates, from the time of the update on; of the past, also before it."""
        return Uniform(self.maps[..., :3], self.maps[..., 3], *self.past)

    @property
    def past(self) -> Rates:
        """Rates, as well as they are known."""
        return self.rates_before or self.rates


def followed(before: Update, update: Update) -> tuple[Update, Update]:
    """An update and the one before it, with differences for the rates that were not given."""
    interval = update.time - before.time
    if not (update.unknown.any() or before.unknown.any()):
        return before, replace(update, interval=interval)
    turned = rotation_vectors(update.maps[..., :3] @ np.swapaxes(before.maps[..., :3], -1, -2))
    differences = (update.maps[..., 3] - before.maps[..., 3]) / interval, turned / interval
    check.below("poses", differences[0], SPEED_OF_LIGHT, "m/s from the update before")
    check.below("poses", differences[1], FASTEST_TURN, "rad/s from the update before")
    # The slope in the middle of two differences is that of the parabola; a first update has one neighbour.
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

    Rotations are turns from those of the first update, whose rotation vectors are cubics.

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
        self._length, self._at = (end - start)[segments, None, None], segments
        self._s = (times - start[segments])[:, None, None] / self._length
        # Poses and rates at both ends of every segment, (segment, end, body, ...).
        maps = np.array([[update.maps for update in pair] for pair in pairs])
        velocities, turning = np.moveaxis(np.array([[update.past for update in pair] for pair in pairs]), 2, 0)
        self._rotations, positions = maps[:, 0, :, :, :3], maps[..., 3]
        turn = rotation_vectors(maps[:, 1, :, :, :3] @ np.swapaxes(self._rotations, -1, -2))
        bend = (_inverse_jacobian(turn) @ turning[:, 1, :, :, None])[..., 0]
        # Position and rotation vector side by side, (segment, body, 6): values at both ends, then rates.
        self._first = np.concatenate([positions[:, 0], 0.0 * turn], axis=-1)
        self._last = np.concatenate([positions[:, 1], turn], axis=-1)
        self._leaving = np.concatenate([velocities[:, 0], turning[:, 0]], axis=-1)
        self._arriving = np.concatenate([velocities[:, 1], bend], axis=-1)

    def poses(self) -> Matrix:
        """``[rotation | position]`` at the times, (n, body, 3, 4)."""
        s, r = self._s, 1.0 - self._s
        values = self._sum((1.0 + 2.0 * s) * r**2, s**2 * (3.0 - 2.0 * s), s * r**2, -(s**2) * r)
        return transforms(self._turned(values[..., 3:]), values[..., :3])

    def rates(self) -> Matrix:
        """Time derivatives of `poses`."""
        s, r = self._s, 1.0 - self._s
        slopes = self._sum(-6.0 * s * r, 6.0 * s * r, r * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)) / self._length
        turn = self._sum((1.0 + 2.0 * s) * r**2, s**2 * (3.0 - 2.0 * s), s * r**2, -(s**2) * r)[..., 3:]
        angular = (_jacobian(turn) @ slopes[..., 3:, None])[..., 0]
        return transforms(cross_matrix(angular) @ self._turned(turn), slopes[..., :3])

    def _sum(self, first: Matrix, last: Matrix, leaving: Matrix, arriving: Matrix) -> Matrix:
        """Hermite's form: weights of the values and, times the length, of the rates at both ends."""
        total: Matrix = leaving * self._leaving[self._at] + arriving * self._arriving[self._at]
        total *= self._length
        total += first * self._first[self._at] + last * self._last[self._at]
        return total

    def _turned(self, turn: Matrix) -> Matrix:
        rotations = rotations_about(turn.reshape(-1, 3)).reshape(*turn.shape, 3)
        turned: Matrix = rotations @ self._rotations[self._at]
        return turned


def _jacobian(turn: Matrix) -> Matrix:
    """Angular velocity over the rate of a rotation vector (..., 3), (..., 3, 3).

    Chirikjian, Stochastic Models, Information Theory, and Lie Groups, vol. 2, eq. (10.86): the left Jacobian.
    """
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe, a2 = np.where(small, 1.0, angle), angle**2
    by_cross = np.where(small, 0.5 - a2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    by_square = np.where(small, 1.0 / 6.0 - a2 / 120.0, (safe - np.sin(safe)) / safe**3)
    cross = cross_matrix(turn)
    jacobian: Matrix = np.eye(3) + by_cross * cross + by_square * (cross @ cross)
    return jacobian


def _inverse_jacobian(turn: Matrix) -> Matrix:
    """Inverse of `_jacobian`, up to a full turn."""
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe, a2 = np.where(small, 1.0, angle), angle**2
    by_square = np.where(small, 1.0 / 12.0 + a2 / 720.0, 1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)))
    cross = cross_matrix(turn)
    inverse: Matrix = np.eye(3) - 0.5 * cross + by_square * (cross @ cross)
    return inverse


def poses_at(updates: Sequence[Update], times: Matrix) -> Matrix:
    """``[rotation | position]`` at times (n,) [s], (n, body, 3, 4).

    Before the first and after the last update motion goes on at the rates there.
    """
    last = updates[-1]
    if times.min(initial=np.inf) >= last.time:
        return last.continued.poses_at(times - last.time)
    return _pieces(updates, times, lambda end, elapsed: end.poses_at(elapsed), Between.poses)


def rates_at(updates: Sequence[Update], times: Matrix) -> Matrix:
    """Time derivatives of `poses_at`."""
    last = updates[-1]
    if times.min(initial=np.inf) >= last.time:
        return last.continued.rates_at(times - last.time)
    return _pieces(updates, times, lambda end, elapsed: end.rates_at(elapsed), Between.rates)


def _pieces(
    updates: Sequence[Update],
    times: Matrix,
    of_end: Callable[[Uniform, Matrix], Matrix],
    of_segments: Callable[[Between], Matrix],
) -> Matrix:
    """Poses or rates at times, before the first update, between updates, and after the last: (time, body, 3, 4)."""
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
