"""Detections of people: a body gives many echoes, with the velocities of trunk, arms and legs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.direction import angles
from radarcore.motion.protocol import SensorState
from radarcore.processing.tracking.cluster import connected, pairs_within, wrapped
from radarcore.processing.tracking.kalman import Array, Expected, Indices
from radarcore.processing.tracking.static_map import StaticMap, is_moving, places_of

EXTENT = np.array([0.1, 0.4, 0.15, 0.3])
"""Standard deviations of the centroid of the echoes of a body: range [m], velocity [m/s], across and up [m]."""

NEARER, _FARTHER, _WIDTH = 0.5, 0.8, 0.5
"""Echoes come from this much before, behind and beside the track [m]; feet are below, and so farther."""

_STANDING = 0.3
"""Static echoes of a person come from this much around the track [m]."""

LIMB_SPEED = 3.0
"""Limbs move at up to this speed relative to the trunk [m/s]."""

SPEED_SCALE = 1.0
"""A difference of velocities of this [m/s] weighs as much as a distance of a body's extent."""

_MEMORY = 2.0
"""Static echoes are remembered for this time [s]."""

NUM_REPEATS = 3
"""With this number of remembered echoes a place belongs to the background."""

_PLACE = np.array([0.1, 0.1])
"""Half the size of such a place: range [m], azimuth [rad]."""


Mask = NDArray[np.bool_]


class Labels(NamedTuple):
    """Objects that detections belong to, (detection,) each."""

    objects: Indices
    """Index of a track, of people; numbers from there on are new objects, and -1 is none."""
    moves: Mask
    """True for detections that move over the ground."""
    is_known: Mask
    """True for static detections that may be at a known surface."""


class People:
    """Assigns detections to bodies, and remembers where static things are beside them: walls and posts."""

    def __init__(self, periods: Array, static_map: StaticMap | None) -> None:
        self._periods, self._map = periods, static_map
        self._times, self._places = np.zeros(0), np.zeros((0, 3))

    def labels(
        self,
        values: Array,
        covariance: Array,
        expected: Expected,
        is_confirmed: Mask,
        time: float,
        sensor: SensorState,
    ) -> Labels:
        """Body of each detection. Static ones begin bodies if a map says that no known surface is there.

        Parameters
        ----------
        values, covariance : (detection, n), (detection, n, n) float64
            Range [m], velocity [m/s], and perhaps azimuth and elevation [rad].
        expected : Expected
            Of the tracks.
        is_confirmed : (track,) bool
            Confirmed tracks choose first, then the others by age.
        time : float
            Of the frame [s].
        sensor : SensorState
        """
        number, periods = len(is_confirmed), self._periods[: values.shape[1]]
        moves = is_moving(values, covariance, sensor, self._periods[1])
        difference = wrapped(values - expected.value[:, None], periods)
        along, speed = difference[..., 0], difference[..., 1]
        across = np.zeros(along.shape)
        if values.shape[1] > 2:
            variance = covariance[:, 2, 2] + expected.covariance[:, 2, 2, None]
            uncertainty = 2.0 * values[:, 0] * np.sqrt(variance)
            across = np.fmax(np.abs(values[:, 0] * difference[..., 2]) - uncertainty, 0.0)  # 0 of an unknown azimuth

        # Moving echoes of the whole body, static ones near the trunk of a person who is known.
        is_near = (along > -NEARER) & (along < _FARTHER) & (across < _WIDTH)
        stands = (np.abs(along) < _STANDING) & (across < _STANDING) & ~moves
        is_known = np.zeros(len(values), dtype=bool)
        if self._map is None:
            stands &= is_confirmed[:, None]
            is_background = self._is_background(values, sensor) if stands.any() else is_known
            is_unknown = is_known
        else:
            is_background, may_be_known = self._map.are_known(values, covariance, sensor, [0.0, 2.0])
            is_known = ~moves & may_be_known
            is_unknown = ~moves & ~is_known
        self._remember(values[~moves & ~is_unknown & ~stands.any(axis=0)], time, sensor)
        is_own = is_near & moves & (np.abs(speed) < LIMB_SPEED) | stands & ~is_background
        labels = np.full(len(values), -1)
        if number > 0:
            squares = (along / NEARER) ** 2 + (across / _WIDTH) ** 2 + np.fmax((speed / SPEED_SCALE) ** 2, 0.0)
            order = np.where(is_confirmed, 0, 1 + np.arange(number))
            costs = np.where(is_own, squares + 1e3 * order[:, None], np.inf)
            labels = np.where(is_own.any(axis=0), costs.argmin(axis=0), -1)

        # New bodies begin with other echoes.
        is_new = (moves | is_unknown) & ~is_near.any(axis=0)
        if is_new.any():
            pairs = pairs_within(values[is_new, :3], _FARTHER, None, periods)
            labels[is_new] = number + connected(int(is_new.sum()), pairs)
        return Labels(labels, moves, is_known)

    def background(self, sensor: SensorState) -> Array:
        """Range [m] and velocity [m/s] of remembered echoes, (echo, 2), as the sensor now sees their places."""
        relative = self._places - sensor.pose[:, 3]
        distance = np.linalg.norm(relative, axis=1)
        return np.stack([distance, -relative @ sensor.velocity / distance], axis=1)

    def _is_background(self, values: Array, sensor: SensorState) -> Mask:
        """True for detections at places that had static echoes before."""
        relative = (self._places - sensor.pose[:, 3]) @ sensor.pose[:, :3]
        azimuth, _ = angles(relative)
        remembered = np.stack([np.linalg.norm(relative, axis=1), azimuth], axis=1)
        here = values[:, [0, 2]] if values.shape[1] > 2 else np.stack([values[:, 0], np.zeros(len(values))], axis=1)
        is_here = ~(np.abs(wrapped(here[:, None] - remembered, self._periods[[0, 2]])) > _PLACE)
        num_here: Indices = is_here.all(axis=2).sum(axis=1)
        return num_here >= NUM_REPEATS

    def _remember(self, values: Array, time: float, sensor: SensorState) -> None:
        """Add static detections of a frame whose directions are known, and forget old ones."""
        places = places_of(values, sensor)
        places = places[np.isfinite(places).all(axis=1)]
        is_recent = self._times > time - _MEMORY
        self._times = np.concatenate([self._times[is_recent], np.full(len(places), time)])
        self._places = np.concatenate([self._places[is_recent], places])
