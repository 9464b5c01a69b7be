"""Multi-target tracking: detections of frames in, tracks out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.motion.group import Motions, sensor_state
from radarcore.motion.protocol import AT_REST, AnyMotion, SensorState, as_motion
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.cluster import (
    connected,
    coordinates,
    covariances,
    groups,
    levels,
    pairs_within,
    periods_of,
    wrapped,
)
from radarcore.processing.tracking.front import leads, likelihood
from radarcore.processing.tracking.kalman import (
    SHORTEST_RANGE,
    Array,
    Expected,
    Indices,
    assign,
    begin,
    cartesian,
    expect,
    over_ground,
    predict,
    smoothed,
    to_sensor,
    to_world,
    update,
    white_acceleration,
)
from radarcore.processing.tracking.people import EXTENT, Labels, Mask, People
from radarcore.processing.tracking.static_map import StaticMap
from radarcore.processing.tracking.tracks import Track, Tracks, TrackState, tracks_of
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.records import sealed

_KNOWN_WITHIN = 1.0 / 6.0
"""The period of a velocity is known if the expected velocity has at most this standard deviation [periods]: 3 sigma."""

_LOST = np.pi**2 / 3.0
"""Variance of an angle that may be any [rad^2]."""

_VAGUE = 0.5**2
"""Variance of an angle with which no track begins [rad^2]: a place would be anywhere on an arc."""

_OBJECT_HITS = 5, 8
"""Detections and frames that confirm a static object, whatever the settings: wrong directions repeat themselves."""

_SLOW = 0.5
"""Speed of a track that may have stopped since [m/s]."""

_AWAY = 1.0
"""A track that begins within this distance of a held one and leaves it farther behind is the same person [m]."""

_UPRIGHT = 0.98
"""Least cosine of the tilt of a sensor that tracks in the plane: 11 degrees."""


@sealed
@dataclass(kw_only=True)
class TrackerSettings:
    """Settings of a tracker: how targets move, how well they are detected, when tracks begin and end.

    Parameters
    ----------
    targets : "points" or "people"
        Targets are small, or as large as people: all detections within a body's extent of a person are one measurement,
        and only moving detections begin tracks. Then `gate`, `cluster_distance`, `cluster_velocity`, `extent` and
        `velocity_extent` have no effect.
    acceleration_density : float
        Power spectral density of the acceleration of targets [m^2/s^3]: their velocity changes by
        ``sqrt(acceleration_density * t)`` in a time t, one standard deviation.
    max_speed : float
        Largest speed of targets [m/s]. No track begins with more; the velocity across the line of sight begins as
        unknown within it.
    velocity_ambiguity : float, optional
        Period of the measured velocities [m/s], ``2 * Waveform.max_velocity``: a velocity counts as the nearest one to
        its expected value. Default: of frames, the period of their radar; of `Detections`, none.
    gate : float
        Probability that a detection of a target lies within the gate of its track, from 0 to 1.
    confirm_hits, confirm_frames : int
        A track is confirmed with so many detections within so many frames from its first on, that one included; it ends
        as soon as it cannot be any more.
    max_missed : int
        Frames in a row without a detection that a confirmed track outlives. Lost frames do not count.
    max_gap : float, optional
        Longest time between two detections of a track [s]; default: any.
    cluster_distance, cluster_velocity : float or None
        Detections within both [m, m/s] of each other are one target, see `cluster`; None: any. Both None: every
        detection is one of its own.
    deviations : (4,) array_like
        Standard deviations of range [m], velocity [m/s], azimuth and elevation [rad] for detections without a
        covariance.
    extent : float
        Standard deviation of the place on a target from which echoes come [m]: adds to that of detections.
    velocity_extent : float
        Standard deviation of the velocities of its parts [m/s]: likewise.
    num_dimensions : 1, 2 or 3, optional
        Range alone; the plane, by azimuth; space, by elevation too. Default: by what the first detections tell.

    See Also
    --------
    track : Takes them as keywords.
    Tracker : Likewise.

    Examples
    --------
    >>> settings = rc.processing.TrackerSettings(max_speed=2.0, confirm_hits=2, confirm_frames=3)
    >>> rc.Tracker(max_speed=2.0, confirm_hits=2, confirm_frames=3).settings == settings
    True
    """

    targets: str = "points"
    acceleration_density: float = 1.0
    max_speed: float = 3.0
    velocity_ambiguity: float | None = None
    gate: float = 0.999
    confirm_hits: int = 3
    confirm_frames: int = 5
    max_missed: int = 10
    max_gap: float | None = None
    cluster_distance: float | None = 0.3
    cluster_velocity: float | None = 1.0
    deviations: ArrayLike = (0.05, 0.2, 0.1, 0.1)
    extent: float = 0.05
    velocity_extent: float = 0.1
    num_dimensions: int | None = None

    def __post_init__(self) -> None:
        check.choice("targets", self.targets, ("points", "people"))
        positive = {"acceleration_density": "m^2/s^3", "max_speed": "m/s"}
        optional = {"velocity_ambiguity": "m/s", "max_gap": "s", "cluster_distance": "m", "cluster_velocity": "m/s"}
        for name, unit in (positive | optional).items():
            if getattr(self, name) is not None or name in positive:
                setattr(self, name, check.positive(name, getattr(self, name), unit))
        for name, unit in {"extent": "m", "velocity_extent": "m/s"}.items():
            setattr(self, name, check.non_negative(name, getattr(self, name), unit))
        self.gate = check.number("gate", self.gate)
        if not 0.0 < self.gate < 1.0:
            raise ValueError(f"gate: expected a probability between 0 and 1, got {self.gate:g}")
        self.confirm_hits = check.count("confirm_hits", self.confirm_hits)
        self.confirm_frames = check.count("confirm_frames", self.confirm_frames)
        if self.confirm_frames < self.confirm_hits:
            raise ValueError(
                f"confirm_frames: expected at least confirm_hits = {self.confirm_hits}, got {self.confirm_frames}"
            )
        self.max_missed = check.count("max_missed", self.max_missed, 0)
        deviations = check.array("deviations", self.deviations, (4,))
        if (deviations <= 0.0).any():
            raise ValueError(f"deviations: expected positive numbers, got {deviations.tolist()}")
        self.deviations = tuple(deviations.tolist())
        if self.num_dimensions is not None and check.count("num_dimensions", self.num_dimensions) > 3:
            raise ValueError(f"num_dimensions: expected 1, 2 or 3, got {self.num_dimensions}")


class TrackerKeywords(TypedDict, total=False):
    """Fields of `TrackerSettings` as keywords of `Tracker` and `track`."""

    targets: str
    acceleration_density: float
    max_speed: float
    velocity_ambiguity: float | None
    gate: float
    confirm_hits: int
    confirm_frames: int
    max_missed: int
    max_gap: float | None
    cluster_distance: float | None
    cluster_velocity: float | None
    deviations: ArrayLike
    extent: float
    velocity_extent: float
    num_dimensions: int | None


class Tracker:
    """Track targets frame by frame.

    Each update clusters the detections, predicts all tracks to their time, gates and assigns, updates the detected
    tracks, confirms or ends tracks, and begins new ones from unassigned detections.

    Parameters
    ----------
    motion : Motion, optional
        Of the sensor, as in `Simulator`, or live; evaluated at the times of the detections. Tracks are then in its
        world frame, where targets at rest keep their positions while the sensor moves. Default: the sensor is at rest,
        and its frame is the world.
    static_map : StaticMap, optional
        Known surfaces in that world, for ``targets="people"``. Static detections elsewhere then begin tracks of
        standing people and unknown objects. If a person stops near a surface, the track stays there without detections
        until another begins within 1 m and moves farther away. Positions without an elevation are at sensor height.
    **settings
        Fields of `TrackerSettings`.

    Attributes
    ----------
    settings : TrackerSettings
    time : float
        Of the newest detections [s]; -inf before the first.
    num_dimensions : int or None
        Of space: 1, 2 or 3. None until detections determine it.
    num_begun : int
        Tracks begun, confirmed or not; also the next id.

    See Also
    --------
    track : Tracks of a whole recording.
    processing.TrackerSettings : The settings.

    Examples
    --------
    >>> tracker = rc.Tracker(confirm_hits=2)
    >>> for k in range(3):
    ...     found = rc.Detections([2.0 - 0.025 * k], [-0.5], [0.0], [np.nan], [20.0], time=0.05 * k)
    ...     states = tracker.update(found)
    >>> print(f"{states[0].range:.2f} m, {states[0].velocity:+.2f} m/s, {states[0].is_confirmed}")
    1.95 m, -0.52 m/s, True
    """

    _state: Array
    _covariance: Array
    _lives: list[_Life]

    def __init__(
        self,
        motion: AnyMotion | None = None,
        static_map: StaticMap | None = None,
        **settings: Unpack[TrackerKeywords],
    ) -> None:
        self.settings: TrackerSettings = TrackerSettings(**settings)
        self._map = static_map
        if static_map is not None:
            check.instance("static_map", static_map, StaticMap)
            if self.settings.targets != "people":
                raise ValueError(f'static_map: expected targets="people", got {self.settings.targets!r}')
        self._motion = None if motion is None else Motions([as_motion("motion", motion)])
        self._sensor = AT_REST
        self.time: float = -np.inf
        self.num_dimensions = self.settings.num_dimensions
        self.num_begun: int = 0
        self._periods = periods_of(self.settings.velocity_ambiguity)
        self._people = People(self._periods, static_map)
        self._lives = []

    def update(self, detections: Detections) -> list[TrackState]:
        """States of all targets after the detections of a frame.

        Parameters
        ----------
        detections : Detections
            At a later time than those before. Values that are NaN are left out, and angles of a variance above
            pi^2 / 3, which may be any. Those that lack one of the coordinates but the velocity, or have an angle with a
            standard deviation above 0.5 rad, begin no track.

        Returns
        -------
        states : list of TrackState
            By id; of confirmed tracks and of those that are not yet.

        Raises
        ------
        TypeError, ValueError
            For anything but detections at a later time; the tracks are then as before.

        See Also
        --------
        processing.TrackState : What comes back, one for each target.
        detect : Detections of a frame.

        Examples
        --------
        >>> tracker = rc.Tracker()
        >>> found = rc.Detections([2.0, 3.0], [-0.5, 0.0], [0.0, 0.5], [np.nan, np.nan], [20.0, 15.0], time=0.1)
        >>> [round(state.range, 2) for state in tracker.update(found)]
        [2.01, 3.02]
        """
        check.instance("detections", detections, Detections)
        if not detections.time > self.time:
            raise ValueError(
                f"detections: expected those of a later time than {self.time:.15g} s, got {detections.time:.15g} s"
            )
        values, covariance = coordinates(detections), covariances(detections)
        variance = covariance.diagonal(axis1=1, axis2=2)
        if ((variance < 0.0) | (variance == np.inf)).any():
            raise ValueError(f"detections: expected finite variances from 0 on, got {np.unique(variance)}")

        sensor = AT_REST if self._motion is None else sensor_state(self._motion, detections.time)
        self._choose_dimensions(values, sensor)
        values[:, 2:][variance[:, 2:] > _LOST] = np.nan  # as at the horizon of an array
        self._predict(detections.time, sensor)
        if self.num_dimensions is None:
            return []
        told = self.num_dimensions + 1
        values, covariance = values[:, :told], self._with_usual_errors(covariance[:, :told, :told])
        expected = expect(self._state, self._covariance)
        labels, moves, is_known = self._labels(values, covariance, expected)
        objects, found = groups(values, levels(detections), covariance, labels, self._periods[:told])
        measured, noise = found.values, found.covariance + self._extents(found.values)
        nearest = _nearest(values, covariance, objects, len(measured))

        innovation = wrapped(measured - expected.value[:, None], self._periods[:told])
        spread = expected.spread
        innovation[~(spread[:, 1, 1] <= (_KNOWN_WITHIN * self._periods[1]) ** 2), :, 1] = np.nan
        if self.settings.targets == "people":
            object_of = np.full(len(self._lives) + len(labels) + 1, -1)  # by label, the last of those without one
            object_of[labels] = objects
            (tracks,) = (object_of[: len(self._lives)] >= 0).nonzero()
            chosen = object_of[tracks]
        else:
            tracks, chosen = assign(innovation, spread, noise, self.settings.gate)
        self._state[tracks], self._covariance[tracks] = update(
            self._state[tracks],
            self._covariance[tracks],
            innovation[tracks, chosen],
            expected.jacobian[tracks],
            noise[chosen] + expected.second_order[tracks],
        )
        is_static = np.ones(len(measured), dtype=bool)
        is_static[objects[(objects >= 0) & moves]] = False
        found_by_track = zip(nearest[chosen].tolist(), is_static[chosen].tolist(), strict=True)
        echoes = dict(zip(tracks.tolist(), found_by_track, strict=True))
        for index, life in enumerate(self._lives):
            life.count(self.time, *echoes.get(index, (None, life.is_static)))
        self._look_for_hidden(values[is_known, 0])
        self._keep([life.is_held or not life.is_over(self.settings.max_missed) for life in self._lives])
        is_new = np.ones(len(measured), dtype=bool)
        is_new[chosen] = False
        if is_new.any():
            is_new &= ~(found.covariance.diagonal(axis1=1, axis2=2)[:, 2:] > _VAGUE).any(axis=1)
            self._begin(measured[is_new], noise[is_new], nearest[is_new], is_static[is_new])
        return self._states()

    def _look_for_hidden(self, ranges: Array) -> None:
        """Mark tracks that known surfaces at some ranges may hide, and hold the ones of people who stop there."""
        if self._map is None or not self._lives:
            return
        relative, rates = cartesian(self._state)
        places = relative @ self._sensor.pose[:, :3].T + self._sensor.pose[:, 3]
        speeds = np.linalg.norm(rates @ self._sensor.pose[:, :3].T + self._sensor.velocity, axis=1)
        is_near, is_behind = self._map.conceals(places, self._sensor, ranges), self._map.shades(places, self._sensor)
        rows = zip(self._lives, is_near.tolist(), is_behind.tolist(), speeds.tolist(), strict=True)
        for life, near, behind, speed in rows:
            life.is_observable = not (near or behind)
            stops = life.is_held or (life.missed > 0 and speed < _SLOW)  # a limb that moves later does not end the hold
            life.is_held = life.is_confirmed and near and stops
            if life.is_held:
                life.missed, life.seen = min(life.missed, 1), self.time
        self._end_held(places)

    def _end_held(self, places: Array) -> None:
        """End held tracks of people who left unseen: a track began beside them since, and is elsewhere now."""
        is_away = np.linalg.norm(places[:, None] - places, axis=2) > _AWAY
        for life, away in zip(self._lives, is_away.tolist(), strict=True):
            if life.beside is None:
                life.beside = [other for other in compress(self._lives, ~np.array(away)) if other.is_held]
            for other in life.beside if life.is_confirmed else ():
                if other.is_held and other.missed > 0 and away[self._lives.index(other)]:
                    other.is_held, other.missed = False, self.settings.max_missed + 1

    def _labels(self, values: Array, covariance: Array, expected: Expected) -> Labels:
        """Object of each detection; of people the first objects are the tracks."""
        s = self.settings
        if s.targets == "people":
            is_confirmed = np.array([life.is_confirmed for life in self._lives], dtype=bool)
            return self._people.labels(values, covariance, expected, is_confirmed, self.time, self._sensor)
        if s.cluster_distance is None and s.cluster_velocity is None:
            labels = np.arange(len(values))
        else:
            pairs = pairs_within(values, s.cluster_distance, s.cluster_velocity, self._periods[: values.shape[1]])
            labels = connected(len(values), pairs)
        return Labels(labels, np.ones(len(values), dtype=bool), np.zeros(len(values), dtype=bool))

    def _with_usual_errors(self, covariance: Array) -> Array:
        """Covariances of detections, with the usual errors where detections do not tell theirs."""
        unknown = np.isnan(covariance.diagonal(axis1=1, axis2=2))
        if not unknown.any():
            return covariance
        number = covariance.shape[1]
        usual = np.diag(np.square(self.settings.deviations))[:number, :number]
        return np.where(unknown[:, :, None] | unknown[:, None, :], usual, covariance)

    def _extents(self, values: Array) -> Array:
        """Covariance that targets add to measurements: echoes come from anywhere on them."""
        s = self.settings
        is_person = s.targets == "people"
        deviations = EXTENT if is_person else np.array([s.extent, s.velocity_extent, s.extent, s.extent])
        extents = np.empty(values.shape)
        extents[:] = deviations[: values.shape[1]]
        extents[:, 2:] /= np.fmax(values[:, :1], max(deviations[2], SHORTEST_RANGE))
        return np.square(extents)[:, :, None] * np.eye(values.shape[1])

    def _choose_dimensions(self, measured: Array, sensor: SensorState) -> None:
        """Dimensions of space that the first detections tell, which must place them in the world."""
        number = self.num_dimensions
        if number is None and len(measured) > 0:
            has_azimuth, has_elevation = (bool(np.isfinite(measured[:, k]).any()) for k in (2, 3))
            number = 1 + has_azimuth * (1 + has_elevation)
        if number == 1 and (self._motion is not None or self._map is not None):
            name = "static_map" if self._motion is None else "motion"
            raise ValueError(f"{name}: expected detections with azimuths, which have places in the world, got ranges")
        if number == 2 and sensor.pose[2, 2] < _UPRIGHT:
            tilt = np.degrees(np.arccos(max(float(sensor.pose[2, 2]), -1.0)))
            raise ValueError(
                f"motion: expected an upright sensor for tracks in the plane, got one that is tilted by {tilt:.0f} "
                "degrees; num_dimensions=3 takes detections with elevations"
            )
        self.num_dimensions = number
        length = 2 * (number or 1)
        if not self._lives:
            self._state, self._covariance = np.zeros((0, length)), np.zeros((0, length, length))

    def _predict(self, time: float, sensor: SensorState) -> None:
        """Tracks at the time of a frame, but those that were last seen too long before."""
        if self.settings.max_gap is not None:
            self._keep([life.is_held or time - life.seen <= self.settings.max_gap for life in self._lives])
        if self._lives:
            d = self._state.shape[1] // 2
            motion = white_acceleration(time - self.time, self.settings.acceleration_density, d)
            known = self._state, self._covariance
            if self._motion is not None:  # targets go on in the world
                known = to_world(*known, self._sensor.pose, self._sensor.velocity)
            state, covariance = predict(*known, *motion)
            is_held = [life.is_held and life.missed > 0 for life in self._lives]
            if any(is_held):
                state[is_held, :d], state[is_held, d:] = known[0][is_held, :d], 0.0
                covariance[is_held] = known[1][is_held]
            if self._motion is not None:
                state, covariance = to_sensor(state, covariance, sensor.pose, sensor.velocity)
            self._state, self._covariance = state, covariance
        self.time, self._sensor = time, sensor

    def _keep(self, which: list[bool]) -> None:
        """Leave out all other tracks."""
        if not all(which):
            self._state, self._covariance = self._state[which], self._covariance[which]
            self._lives = list(compress(self._lives, which))

    def _begin(self, measured: Array, noise: Array, nearest: Array, is_static: Mask) -> None:
        """Begin tracks with detections."""
        # The period of a velocity is known if only one is within the largest speed.
        fastest, period = self.settings.max_speed, self._periods[1]
        own = self._sensor.pose[:, :3].T @ self._sensor.velocity
        velocity = wrapped(over_ground(measured, own), period)
        velocity[np.abs(velocity) >= period - fastest] = np.nan
        starts = ~(np.abs(velocity) > fastest) & (measured[:, 0] > SHORTEST_RANGE)
        starts &= np.isfinite(measured[:, 2:]).all(axis=1)
        if not starts.any():
            return
        measured[:, 1] = velocity
        # Velocities across are evenly distributed within the largest speed.
        state, covariance = begin(measured[starts], noise[starts], fastest / np.sqrt(3.0))
        if state.shape[1] > 2:
            state[:, state.shape[1] // 2 :] -= own[: state.shape[1] // 2]
        self._state = np.concatenate([self._state, state])
        self._covariance = np.concatenate([self._covariance, covariance])
        usual = self.settings.confirm_hits, self.settings.confirm_frames
        for echo, stands in zip(nearest[starts].tolist(), is_static[starts].tolist(), strict=True):
            life = _Life(self.num_begun, _OBJECT_HITS if stands else usual)
            life.count(self.time, echo, stands)
            self._lives.append(life)
            self.num_begun += 1

    def _states(self) -> list[TrackState]:
        """States of all tracks."""
        states, covariances = check.frozen(self._state.copy()), check.frozen(self._covariance.copy())
        return [
            TrackState(
                id=life.id,
                time=self.time,
                state=state,
                state_covariance=covariance,
                is_detected=life.missed == 0,
                is_confirmed=life.is_confirmed,
                is_static=life.is_static,
                is_observable=life.is_observable,
                num_hits=life.hits,
                nearest=life.nearest[0],
                nearest_deviation=life.nearest[1],
                seen=life.seen,
                sensor_pose=self._sensor.pose,
                sensor_velocity=self._sensor.velocity,
                sensor_age=self._sensor.age,
            )
            for life, state, covariance in zip(self._lives, states, covariances, strict=True)
        ]


def _nearest(values: Array, covariance: Array, objects: Indices, number: int) -> Array:
    """Range of the nearest detection of each object, and its standard deviation, (object, 2) [m]."""
    result = np.full((number, 2), np.nan)
    order = values[:, 0].argsort()[::-1]  # NaN first; the last one of an object is the nearest
    order = order[objects[order] >= 0]
    result[objects[order]] = np.array([values[order, 0], np.sqrt(covariance[order, 0, 0])]).T
    return result


@dataclass(slots=True, eq=False)
class _Life:
    """History of a track; of few, numbers are counted faster one by one than in arrays."""

    id: int
    needed: tuple[int, int]
    """Detections, and the frames within which they confirm it."""
    seen: float = -np.inf
    """Time of the newest detection [s]."""
    hits: int = 0
    """Detections."""
    age: int = 0
    """Frames from the first detection on, that one included."""
    missed: int = 0
    """Frames in a row without a detection."""
    is_confirmed: bool = False
    nearest: Sequence[float] = (np.nan, np.nan)
    """Range of the nearest detection in the newest frame, and its standard deviation [m]."""
    is_static: bool = False
    is_observable: bool = True
    is_held: bool = False
    """True for a person who stopped near a known surface; the place is kept in frames without a detection."""
    beside: list[_Life] | None = None
    """Held tracks near the place where it began; None in the first frame."""

    def count(self, time: float, nearest: Sequence[float] | None, is_static: bool) -> None:
        """Count a frame in which the target has detections, or None."""
        self.age += 1
        self.missed += 1
        self.nearest = nearest or (np.nan, np.nan)
        if nearest is not None:
            self.missed, self.seen = 0, time
            self.hits += 1
            self.is_static = is_static
            self.is_confirmed |= self.hits >= self.needed[0] and self.age <= self.needed[1]

    def is_over(self, max_missed: int) -> bool:
        """True if it cannot be confirmed any more, or has not been detected for too many frames."""
        if self.is_confirmed:
            return self.missed > max_missed
        return self.hits + max(self.needed[1] - self.age, 0) < self.needed[0]


def track(
    source: Recording | Iterable[Detections | Frame],
    *,
    detector: Callable[[Frame], Detections] | None = None,
    smooth: bool = False,
    separate_echoes: bool = False,
    motion: AnyMotion | None = None,
    static_map: StaticMap | None = None,
    **settings: Unpack[TrackerKeywords],
) -> Tracks:
    """Track the targets of a recording.

    An object that gives many detections, such as a person, is clustered first (`cluster`), and the centroids are
    tracked: by a Kalman filter for range and range rate, or by an extended one for positions and velocities where
    detections have angles. Detections are assigned to tracks as global nearest neighbours within their gates.

    Parameters
    ----------
    source : Recording or iterable of Detections or Frame
        In the order of time. Lost frames and uneven intervals are bridged by the motion model.
    detector : callable, optional
        Detections of a frame; default: `detect`.
    smooth : bool
        Estimate every state from all detections of the track, the later ones too (Rauch, Tung and Striebel), instead of
        from those until then. Tracks are the same, from the same detections; frames without one then lie between those
        before and after. So does `nearest` with `separate_echoes`.
    separate_echoes : bool
        Estimate `nearest` of people from the samples, where the echoes of each person are separated: it is known in
        frames without a detection too. Takes about 20 ms per person and frame; needs frames and ``targets="people"``.
        `nearest` stays the detection's where samples have no velocities or no noise, as of a CW radar.
    motion : Motion, optional
        Of the sensor, see `Tracker`; tracks are then in the world.
    static_map : StaticMap, optional
        Known surfaces, see `Tracker`.
    **settings
        Fields of `TrackerSettings`.

    Returns
    -------
    tracks : Tracks
        Those that were confirmed, each from its first to its last detection, or to the end of its hold.

    Raises
    ------
    TypeError, ValueError
        For settings and times that are refused by `TrackerSettings` and `Tracker.update`; for anything but detections
        and frames; for `separate_echoes` of detections, or of targets other than people.

    See Also
    --------
    processing.Tracks : What comes back.
    Tracker : Frame by frame, for live use.
    detect : Detections that are tracked.
    plot.tracks : Picture over time.

    Examples
    --------
    >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.0], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
    >>> tracks = rc.track(found)
    >>> len(tracks), tracks[0].range.round(2).tolist()
    (1, [2.01, 1.97, 1.95, 1.92, 1.89, 1.86])
    """
    targets = TrackerSettings(**settings).targets  # refused before work starts
    if check.flag("separate_echoes", separate_echoes) and targets != "people":
        raise ValueError('separate_echoes: needs targets="people"')
    if detector is not None and not callable(detector):
        raise TypeError(f"detector: expected a function of a frame, got {type(detector).__name__}")
    if not isinstance(source, Iterable | Recording):
        raise TypeError(
            f"source: expected Recording or an iterable of Detections or Frame, got {type(source).__name__}"
        )
    items = iter(source.frames() if isinstance(source, Recording) else source)
    first = next(items, None)
    if isinstance(first, Frame) and first.radar.waveform.has_uniform_chirps:
        settings.setdefault("velocity_ambiguity", 2.0 * first.radar.max_velocity)
    tracker = Tracker(motion, static_map, **settings)
    times, states, fronts = [], [], []
    for item in items if first is None else chain([first], items):
        found = item if not isinstance(item, Frame) else detect(item) if detector is None else detector(item)
        states.append(tracker.update(found))
        times.append(tracker.time)
        if separate_echoes:
            if not isinstance(item, Frame):
                raise ValueError(f"separate_echoes: needs frames, got {type(item).__name__}")
            background = tracker._people.background(tracker._sensor)
            people = [one for one in states[-1] if one.is_confirmed]
            fronts.append(
                {one.id: likelihood(item, one, [x for x in people if x is not one], background) for one in states[-1]}
            )
    tracks = tracks_of(times, states)
    if separate_echoes:
        tracks = replace(tracks, tracks=tuple(_with_front(one, fronts, smooth) for one in tracks))
    return _smoothed(tracks, tracker.settings.acceleration_density) if smooth else tracks


def _with_front(one: Track, fronts: Sequence[Mapping[int, Array | None]], smooth: bool) -> Track:
    """A track of a person with the nearest point of the body, or as it is if a frame does not allow it."""
    likelihoods = [each for frame in one.frame if (each := fronts[frame][one.id]) is not None]
    if len(likelihoods) < len(one.frame):
        return one
    lead, deviation = leads(np.array(likelihoods), smooth)
    return replace(one, nearest=one.range - lead, nearest_deviation=deviation)


def _smoothed(tracks: Tracks, density: float) -> Tracks:
    """Tracks with states by all of their detections."""
    kept = []
    for one in tracks:
        sensor = one.sensor_pose, one.sensor_velocity
        in_world = smoothed(one.time, *to_world(one.state, one.state_covariance, *sensor), density)
        state, covariance = to_sensor(*in_world, *sensor)
        kept.append(replace(one, state=state, state_covariance=covariance))
    return replace(tracks, tracks=tuple(kept))
