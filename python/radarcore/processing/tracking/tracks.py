"""Tracks: what is known of each target over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.motion.protocol import STALE
from radarcore.processing.tracking.kalman import Array, cartesian, polar
from radarcore.recording.frame import Truth

_COLUMNS = (
    *("time", "state", "state_covariance", "is_detected", "is_confirmed", "is_static", "is_observable"),
    *("nearest", "nearest_deviation", "seen", "sensor_pose", "sensor_velocity", "sensor_age"),
)
"""Fields that `Track` has a row of for each `TrackState`."""

_Value = TypeVar("_Value", float, Array)


class _Coordinates(Generic[_Value]):
    """Coordinates of the state of a target: numbers of a `TrackState`, an array (row,) of a `Track`."""

    state: Array
    sensor_pose: Array
    sensor_velocity: Array

    @property
    def range(self) -> _Value:
        """Distance from the centre of the array [m]."""
        return self._polar[0][0]

    @property
    def velocity(self) -> _Value:
        """Range rate, receding positive [m/s]."""
        return self._polar[0][1]

    @property
    def azimuth(self) -> _Value:
        """Angle to the left [rad]; NaN if the radar does not tell it."""
        return self._polar[0][2]

    @property
    def elevation(self) -> _Value:
        """Angle up [rad]; NaN if the radar does not tell it."""
        return self._polar[0][3]

    @property
    def covariance(self) -> Array:
        """Of range, velocity, azimuth and elevation, ([row,] 4, 4), in their units; NaN for unknown angles."""
        return self._polar[1]

    @property
    def position(self) -> Array:
        """Place in the world of the sensor's motion, without one in the sensor frame, ([row,] 3) [m].

        NaN without angles; without an elevation in the plane of the sensor.
        """
        return self._in_world(0) + self.sensor_pose[..., 3]

    @property
    def motion(self) -> Array:
        """Rate of `position`, ([row,] 3) [m/s]."""
        return self._in_world(1) + self.sensor_velocity

    def _in_world(self, which: int) -> Array:
        """Place or velocity relative to the sensor, along the axes of the world."""
        turned: Array = (self.sensor_pose[..., :3] @ cartesian(self.state)[which][..., None])[..., 0]
        return turned

    @cached_property
    def _polar(self) -> tuple[list[_Value], Array]:
        """Range, velocity, azimuth and elevation, and their covariance."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class TrackState(_Coordinates[float]):
    """A target at one time.

    Parameters
    ----------
    id : int
        Number of the track: in the order in which tracks began, from 0.
    time : float
        Middle of the frame [s].
    state : (2 d,) float64
        Estimate of the filter in 1, 2 or 3 dimensions d: range and range rate, or place and velocity relative to the
        sensor, along its axes [m, m/s].
    state_covariance : (2 d, 2 d) float64
        Of `state`.
    is_detected : bool
        Whether the frame had a detection of the target; the state is a prediction otherwise.
    is_confirmed : bool
        Whether the track had been detected often enough by then to be believed.
    is_static : bool
        Whether all of its newest detections were static, as of a person who stands or of an unknown object; False
        unless targets are people.
    is_observable : bool
        False near a known surface of the `StaticMap`, behind it, and at the range of its echo: a person who stands
        still there may give no detections of their own.
    num_hits : int
        Detections of the target until then.
    nearest, nearest_deviation : float
        Range of the nearest of its detections in the frame, and the standard deviation of that detection [m]; NaN if
        it has none. `range` is at their centroid. With ``track(..., separate_echoes=True)`` of the nearest point of a
        body, predicted where it sends no echo.
    seen : float
        Time of the newest detection of the target [s], or of the newest frame that held its place without one.
    sensor_pose : (3, 4) float64
        ``[rotation | position]`` of the sensor at that time, to the world; of a tracker without a motion the identity.
    sensor_velocity : (3,) float64
        Of the sensor, in world axes [m/s].
    sensor_age : float
        Time since the newest update of a live motion of the sensor [s]; 0 of other motions.

    See Also
    --------
    Tracker.update : Makes them.
    Tracks.at : States of a recording at one time.

    Examples
    --------
    >>> state = rc.Tracker().update(rc.Detections([2.0], [-0.5], [0.0], [np.nan], [20.0]))[0]
    >>> state.id, round(state.range, 2), state.num_hits, state.is_confirmed
    (0, 2.01, 1, False)
    """

    id: int
    time: float
    state: Array
    state_covariance: Array
    is_detected: bool
    is_confirmed: bool
    is_static: bool
    is_observable: bool
    num_hits: int
    nearest: float
    nearest_deviation: float
    seen: float
    sensor_pose: Array
    sensor_velocity: Array
    sensor_age: float

    @property
    def is_stale(self) -> bool:
        """True if the newest update of the sensor's live motion is more than 0.1 s old: places may be off."""
        return self.sensor_age > STALE

    @cached_property
    def _polar(self) -> tuple[list[float], Array]:
        values, covariances = polar(self.state[None], self.state_covariance[None])
        return values[0].tolist(), covariances[0]


@dataclass(frozen=True, eq=False)
class Track(_Coordinates[Array]):
    """A target from its first detection to its last one or to the end of its hold, one row per frame.

    Parameters
    ----------
    id : int
        Number of the track, by which `Tracks` are in order.
    frame : (row,) int
        Index of the frame, one after the other.
    time : (row,) float64
        Middle of the frame [s].
    state, state_covariance : (row, 2 d), (row, 2 d, 2 d) float64
        As in `TrackState`.
    is_detected, is_confirmed, is_static, is_observable : (row,) bool
        As in `TrackState`.
    nearest, nearest_deviation : (row,) float64
        As in `TrackState` [m].
    seen, sensor_pose, sensor_velocity, sensor_age : (row,), (row, 3, 4), (row, 3), (row,) float64
        As in `TrackState`.

    See Also
    --------
    track : Makes them.
    Tracks : All of a recording.
    processing.TrackState : One at one time.

    Examples
    --------
    >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.0], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
    >>> target = rc.track(found)[0]
    >>> target.num_hits, target.position[-1].round(2).tolist(), target.longest_gap
    (6, [1.86, 0.0, 0.0], 0)
    """

    id: int
    frame: NDArray[np.int64]
    time: Array
    state: Array
    state_covariance: Array
    is_detected: NDArray[np.bool_]
    is_confirmed: NDArray[np.bool_]
    is_static: NDArray[np.bool_]
    is_observable: NDArray[np.bool_]
    nearest: Array
    nearest_deviation: Array
    seen: Array
    sensor_pose: Array
    sensor_velocity: Array
    sensor_age: Array

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def deviation(self) -> Array:
        """Standard deviations of range, velocity, azimuth and elevation, (row, 4)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def num_hits(self) -> int:
        """Frames with a detection of the target."""
        return int(self.is_detected.sum())

    @property
    def longest_gap(self) -> int:
        """Most frames in a row without a detection."""
        hits = np.flatnonzero(self.is_detected)
        return int(np.diff(hits).max(initial=1)) - 1

    @cached_property
    def _polar(self) -> tuple[list[Array], Array]:
        values, covariances = polar(self.state, self.state_covariance)
        return list(values.T), covariances


@dataclass(frozen=True, eq=False)
class Tracks(Sequence[Track]):
    """Confirmed tracks in the order in which they began, with the times of the frames.

    Parameters
    ----------
    time : (frame,) float64
        Middle of every frame [s], those without a track too.
    tracks : sequence of Track

    See Also
    --------
    track : Makes them.
    assign_to_truth : Bodies that they follow.
    plot.tracks_from_above : Picture of their ways.

    Examples
    --------
    >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.0], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
    >>> tracks = rc.track(found)
    >>> [target.id for target in tracks], len(tracks.time)
    ([0], 6)
    """

    time: Array
    tracks: tuple[Track, ...]

    def __len__(self) -> int:
        return len(self.tracks)

    def __getitem__(self, index: Any) -> Any:
        """Track at an index (not its id: tracks that were never confirmed have ids too), or several by a slice."""
        return self.tracks[index]

    def __iter__(self) -> Iterator[Track]:
        return iter(self.tracks)

    def __repr__(self) -> str:
        spans = (f"{track.id}: frames {track.frame[0]} to {track.frame[-1]}" for track in self.tracks)
        return f"Tracks({len(self.time)} frames; {', '.join(spans) or 'no tracks'})"

    def at(self, frame: int) -> list[TrackState]:
        """States of the targets in a frame, by its index; negative ones count from the end.

        See Also
        --------
        processing.TrackState : What comes back.

        Examples
        --------
        >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.0], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
        >>> [round(state.range, 2) for state in rc.track(found).at(-1)]
        [1.86]
        """
        index = check.index("frame", frame, len(self.time))
        rows = [(track, int(np.searchsorted(track.frame, index))) for track in self.tracks]
        return [_row(track, row) for track, row in rows if row < len(track) and track.frame[row] == index]


def tracks_of(times: Sequence[float], frames: Sequence[Sequence[TrackState]]) -> Tracks:
    """Tracks of the states in every frame: those that were confirmed, up to their last detection."""
    rows: dict[int, list[tuple[int, TrackState]]] = {}
    for index, states in enumerate(frames):
        for state in states:
            rows.setdefault(state.id, []).append((index, state))
    tracks = []
    for number, found in sorted(rows.items()):
        if not found[-1][1].is_confirmed:
            continue
        last = max(k for k, (_, state) in enumerate(found) if state.seen == state.time)
        kept = [state for _, state in found[: last + 1]]
        tracks.append(
            Track(
                id=number,
                frame=np.array([index for index, _ in found[: last + 1]]),
                **{name: np.array([getattr(state, name) for state in kept]) for name in _COLUMNS},
            )
        )
    return Tracks(np.array(times, dtype=np.float64), tuple(tracks))


def assign_to_truth(tracks: Tracks, truth: Truth, *, max_distance: float = 0.5) -> dict[int, str | None]:
    """Body that each track follows: that whose range is nearest over the frames of the track, in the median.

    Where track and truth both have angles, the distance is that of the points in space, otherwise that of the ranges.

    Parameters
    ----------
    tracks : Tracks
        Of the frames of the truth.
    truth : Truth
        Arrays (frame, body).
    max_distance : float
        Largest distance [m]; a track that is farther from all bodies follows none.

    Returns
    -------
    bodies : dict
        Name of the body, or None, by the id of the track. Several tracks may follow one body, one after the other.

    See Also
    --------
    track : Tracks of a recording.
    compare : Errors against the truth.
    Truth : Where bodies are.

    Examples
    --------
    >>> rc.assign_to_truth(rc.track(recording), recording.truth)
    {0: 'ball'}
    """
    check.instance("tracks", tracks, Tracks)
    check.instance("truth", truth, Truth)
    if truth.range.shape != (expected := (len(tracks.time), len(truth.names))):
        raise ValueError(f"truth: expected arrays of shape {expected}, got {truth.range.shape}")
    limit = check.positive("max_distance", max_distance, "m")
    return {track.id: _nearest_body(track, truth, limit) for track in tracks}


def _nearest_body(track: Track, truth: Truth, limit: float) -> str | None:
    """Name of the body nearest to a track in the median, over the frames in which both are known."""
    seen = truth[int(track.frame[0]) : int(track.frame[-1]) + 1]
    apart = np.abs(seen.range - track.range[:, None])
    if not np.isnan(track.azimuth).any():
        elevation = np.where(np.isnan(track.elevation)[:, None], 0.0, seen.elevation)
        points = seen.range[..., None] * unit_vectors(seen.azimuth, elevation)
        distance = np.linalg.norm(points - cartesian(track.state)[0][:, None], axis=2)
        apart = np.where(np.isnan(distance), apart, distance)
    medians = [np.median(body[~np.isnan(body)]) if np.isfinite(body).any() else np.inf for body in apart.T]
    best = int(np.argmin(medians)) if medians else -1
    return truth.names[best] if best >= 0 and medians[best] <= limit else None


def _row(track: Track, row: int) -> TrackState:
    """State of a track in one of its rows."""
    return TrackState(
        id=track.id,
        time=float(track.time[row]),
        state=track.state[row],
        state_covariance=track.state_covariance[row],
        is_detected=bool(track.is_detected[row]),
        is_confirmed=bool(track.is_confirmed[row]),
        is_static=bool(track.is_static[row]),
        is_observable=bool(track.is_observable[row]),
        num_hits=int(track.is_detected[: row + 1].sum()),
        nearest=float(track.nearest[row]),
        nearest_deviation=float(track.nearest_deviation[row]),
        seen=float(track.seen[row]),
        sensor_pose=track.sensor_pose[row],
        sensor_velocity=track.sensor_velocity[row],
        sensor_age=float(track.sensor_age[row]),
    )
