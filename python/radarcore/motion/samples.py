"""Motions through poses at the same times, which are interpolated segment by segment."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.rotation import Matrix, rotation_vectors
from radarcore.motion.live import Between, Rates, Update
from radarcore.motion.protocol import LinkMotion, Links


class Samples(Links):
    """Motions through maps at the same times; at rest before the first and after the last.

    Parameters
    ----------
    times : (k,) float64
        At least two, increasing [s].
    is_cubic : bool
        True: splines, with continuous velocities. False: positions are linear, and rotations turn at constant rates.
    """

    def __init__(self, times: Matrix, is_cubic: bool) -> None:
        self._times, self._is_cubic = times, is_cubic
        self._maps: list[Matrix] = []

    def add(self, maps: Matrix) -> LinkMotion:
        """Motion through ``[rotation | position]``, (k, 3, 4)."""
        self._maps.append(check.finite("transform", maps))
        return LinkMotion(self, len(self._maps) - 1)

    def link_poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` of all motions at times (n,) [s], (n, motion, 3, 4)."""
        return self._between(np.asarray(times)).poses()

    def link_poses_and_rates_at(self, times: ArrayLike) -> Matrix:
        """`link_poses_at` and their time derivatives, (2, n, motion, 3, 4)."""
        wanted = np.asarray(times)
        between = self._between(wanted)
        is_moving = (self._times[0] <= wanted) & (wanted <= self._times[-1])
        return np.array([between.poses(), between.rates() * is_moving[:, None, None, None]])

    def _between(self, times: Matrix) -> Between:
        inside = np.clip(times, self._times[0], self._times[-1])
        numbers = np.searchsorted(self._times[1:-1], inside, side="right")
        used, segments = np.unique(numbers, return_inverse=True)
        return Between([self._pairs[k] for k in used.tolist()], segments, inside)

    @cached_property
    def _pairs(self) -> list[tuple[Update, Update]]:
        """Segments between samples, with the rates at both of their ends."""
        from scipy.interpolate import CubicSpline  # takes longer to load than the rest

        maps, steps = np.stack(self._maps, axis=1), np.diff(self._times)[:, None, None]
        turned = rotation_vectors(maps[1:, ..., :3] @ np.swapaxes(maps[:-1, ..., :3], -1, -2))
        slopes = np.concatenate([np.diff(maps[..., 3], axis=0), turned], axis=-1) / steps
        leaving = arriving = slopes
        if self._is_cubic:
            # Rates of a natural spline at the samples; for rotations, of the sum of the steps from sample to sample.
            sums = np.concatenate([0.0 * slopes[:1], np.cumsum(slopes * steps, axis=0)])
            rates = CubicSpline(self._times, sums, bc_type="natural")(self._times, 1)
            leaving, arriving = rates[:-1], rates[1:]
        known = np.zeros((2, maps.shape[1]), dtype=np.bool_)

        def update(k: int, rates: Matrix) -> Update:
            return Update(float(self._times[k]), maps[k], Rates(rates[:, :3], rates[:, 3:]), known)

        return [(update(k, leaving[k]), update(k + 1, arriving[k])) for k in range(len(slopes))]
