"""Static surfaces that are known, and classes of detections by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.geometry.mesh import Mesh
from radarcore.motion.group import Motions, sensor_state
from radarcore.motion.protocol import AT_REST, AnyMotion, SensorState, as_motion
from radarcore.processing.detection.detect import detect
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.cluster import NO_PERIOD, coordinates, covariances, wrapped
from radarcore.processing.tracking.kalman import Array, directions_of, over_ground
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scene.body import Body

CLASSES = ("moving", "known", "unknown")
"""Classes of detections: moving, static at a known surface, static elsewhere."""

_STATIC_SPEED = 0.1
"""Echoes up to this speed are static [m/s]."""

_SPACING = 0.1
"""Distance of neighbouring points of a surface [m]."""

_SHARE_OF_MOVING = 0.1
"""A map is learnt without people: moving detections in a larger share of the frames are doubtful."""


class StaticMap:
    """Points on the static surfaces of a place: walls, floor, table, machines.

    A person who stands still gives static echoes, as a wall does. Only a map of the known surfaces distinguishes them.

    Parameters
    ----------
    points : (n, 3) array_like
        In the world [m], about 0.1 m from each other.
    distance : float
        Static detections up to this far from a point are known [m].
    hidden_distance : float
        A person who stands still up to this far from a point may be lost among the echoes of the surface [m].

    See Also
    --------
    Tracker : Takes it, and gives tracks to unknown static objects.

    Examples
    --------
    >>> wall = rc.Body(rc.shapes.plate(4.0, 3.0), motion=rc.Pose([3.0, 0.0, 1.5]))
    >>> known = rc.processing.StaticMap.of([wall])
    >>> known.distances([[2.0, 0.0, 1.0]]).round(1).tolist()
    [1.0]
    >>> found = rc.Detections([3.0, 2.0, 1.5], [0.0, 0.0, -0.8], [0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [30.0, 30.0, 30.0])
    >>> known.classify(found).tolist()
    ['known', 'unknown', 'moving']
    """

    def __init__(self, points: ArrayLike, *, distance: float = 0.3, hidden_distance: float = 0.5) -> None:
        from scipy.spatial import cKDTree  # here: importing radarcore imports numpy and nothing heavier

        self.points: Array = check.frozen(_thinned(check.array("points", points, (None, 3))))
        self.distance: float = check.positive("distance", distance, "m")
        self.hidden_distance: float = check.non_negative("hidden_distance", hidden_distance, "m")
        self._tree = cKDTree(self.points)

    @classmethod
    def of(
        cls, bodies: Iterable[Body], *, time: float = 0.0, distance: float = 0.3, hidden_distance: float = 0.5
    ) -> StaticMap:
        """Map of the surfaces of given bodies, where their motions have them at a time [s].

        Examples
        --------
        >>> len(rc.processing.StaticMap.of([rc.Body(rc.shapes.box([1.0, 1.0, 1.0]))]).points)
        1352
        """
        if not isinstance(bodies, Iterable):
            raise TypeError(f"bodies: expected an iterable of Body, got {type(bodies).__name__}")
        points, when = [np.zeros((0, 3))], check.time("time", time)
        for body in bodies:
            check.instance("bodies", body, Body)
            points.append(body.motion.at(when).apply(_surface(body.mesh)))
        return cls(np.concatenate(points), distance=distance, hidden_distance=hidden_distance)

    @classmethod
    def learnt(
        cls,
        source: Recording | Iterable[Detections | Frame],
        motion: AnyMotion | None = None,
        *,
        distance: float = 0.3,
        hidden_distance: float = 0.5,
    ) -> StaticMap:
        """Map of the static detections of some seconds without people.

        Echoes of walls move with the sensor: let it move as it will later. About 5 s are enough.

        Parameters
        ----------
        source : Recording or iterable of Detections or Frame
        motion : Motion, optional
            Of the sensor, see `Tracker`.
        distance, hidden_distance : float
            As of `StaticMap` [m].

        Examples
        --------
        >>> wall = rc.Detections([3.0], [0.0], [0.0], [0.0], [30.0])
        >>> rc.processing.StaticMap.learnt([wall]).points.tolist()
        [[3.0, 0.0, 0.0]]
        """
        how = None if motion is None else Motions([as_motion("motion", motion)])
        points, num_moving, num_frames = [np.zeros((0, 3))], 0, 0
        for item in source.frames() if isinstance(source, Recording) else source:
            found = detect(item) if isinstance(item, Frame) else item
            check.instance("source", found, Detections)
            sensor = AT_REST if how is None else sensor_state(how, found.time)
            values = coordinates(found)
            moves = is_moving(values, covariances(found), sensor)
            num_frames, num_moving = num_frames + 1, num_moving + bool(moves.any())
            places = places_of(values[~moves], sensor)
            points.append(places[np.isfinite(places).all(axis=1)])
        if num_moving > _SHARE_OF_MOVING * num_frames:
            notice.warn(f"source: expected nobody, got moving detections in {num_moving} of {num_frames} frames")
        return cls(np.concatenate(points), distance=distance, hidden_distance=hidden_distance)

    def distances(self, places: ArrayLike) -> Array:
        """Distances of places (n, 3) in the world from the nearest point [m]; inf without one."""
        where = check.array("places", places, (None, 3))
        return np.asarray(self._tree.query(where)[0])

    def classify(self, detections: Detections, motion: AnyMotion | None = None) -> NDArray[np.str_]:
        """Class of each detection: "moving", "known" or "unknown", the latter two static.

        A static detection is known if a point of the map is within `distance` of any place where it may be by twice
        the deviations of its angles.

        Parameters
        ----------
        detections : Detections
        motion : Motion, optional
            Of the sensor, see `Tracker`.
        """
        check.instance("detections", detections, Detections)
        how = None if motion is None else Motions([as_motion("motion", motion)])
        sensor = AT_REST if how is None else sensor_state(how, detections.time)
        values, covariance = coordinates(detections), covariances(detections)
        known = np.where(self.are_known(values, covariance, sensor, [2.0])[0], 1, 2)
        return np.array(CLASSES)[np.where(is_moving(values, covariance, sensor), 0, known)]

    def are_observable(
        self,
        places: ArrayLike,
        detections: Detections,
        motion: AnyMotion | None = None,
        *,
        body_radius: float = 0.3,
    ) -> NDArray[np.bool_]:
        """True for places where a person who stands gives detections of their own; elsewhere nobody may be seen.

        False where the body comes within `hidden_distance` of a point or within `distance` of the range of a known
        detection, behind points, and behind the sensor. No other limit of the field of view counts.

        Parameters
        ----------
        places : (n, 3) array_like
            In the world [m], at the height of the trunk.
        detections : Detections
            Of the frame.
        motion : Motion, optional
            Of the sensor, see `Tracker`.
        body_radius : float
            Radius of a person about the place [m].

        See Also
        --------
        separation : Treats the other places as people.

        Examples
        --------
        >>> wall = rc.Body(rc.shapes.plate(4.0, 3.0), motion=rc.Pose([3.0, 0.0, 0.0]))
        >>> found = rc.Detections([3.0], [0.0], [0.0], [0.0], [40.0])
        >>> places = [[2.1, 0.0, 0.0], [2.3, 0.0, 0.0], [2.1, 1.9, 0.0], [3.9, 0.0, 0.0]]
        >>> rc.processing.StaticMap.of([wall]).are_observable(places, found).tolist()
        [True, False, False, False]
        """
        where, radius = check.array("places", places, (None, 3)), check.non_negative("body_radius", body_radius, "m")
        ranges = detections.range[self.classify(detections, motion) == "known"]
        sensor = AT_REST if motion is None else sensor_state(Motions([as_motion("motion", motion)]), detections.time)
        is_observable = (where - sensor.pose[:, 3]) @ sensor.pose[:, 0] > 0.0
        is_observable[is_observable] = ~self.conceals(where[is_observable], sensor, ranges, radius)
        is_observable[is_observable] = ~self.shades(where[is_observable], sensor)
        return np.asarray(is_observable)

    def conceals(self, places: Array, sensor: SensorState, ranges: Array, radius: float = 0.0) -> NDArray[np.bool_]:
        """True for places near the surfaces or at one of the ranges of their echoes, whose cell would be shared."""
        differences = np.abs(np.linalg.norm(places - sensor.pose[:, 3], axis=1)[:, None] - ranges)
        is_near = self._tree.query(places, distance_upper_bound=self.hidden_distance + radius)[0] < np.inf
        return np.asarray(is_near | (np.fmin.reduce(differences, axis=1, initial=np.inf) <= self.distance + radius))

    def shades(self, places: Array, sensor: SensorState) -> NDArray[np.bool_]:
        """True for places behind a surface: a point is within `_SPACING` of the line of sight.

        A surface on which the sensor is mounted does not count.
        """
        sight = places - sensor.pose[:, 3]
        longest = np.linalg.norm(sight, axis=1).max(initial=0.0)
        steps = np.linspace(0.0, 1.0, int(np.ceil(longest / _SPACING)) + 1)
        lines = sensor.pose[:, 3] + steps[:, None] * sight[:, None]
        is_near = self._tree.query(lines, distance_upper_bound=_SPACING)[0] < np.inf  # (place, step)
        return np.asarray((np.logical_or.accumulate(~is_near, axis=1) & is_near).any(axis=1))

    def are_known(
        self, values: Array, covariance: Array, sensor: SensorState, coverages: Sequence[float]
    ) -> NDArray[np.bool_]:
        """True for detections within some numbers of deviations of a known surface, (coverage, detection).

        The deviations are of the angles; ranges differ by `distance` at most.
        """
        places, where = places_of(values, sensor), sensor.pose[:, 3]
        deviations = np.multiply.outer(coverages, _angle_deviations(covariance))
        reaches = self.distance + np.where(np.isnan(places[:, 0]), 1.0, deviations) * values[:, 0]
        places = np.where(np.isnan(places), where, places)  # without an azimuth: anywhere around the sensor
        gaps = np.full(len(values), np.inf)
        for index in np.flatnonzero(np.isfinite(values[:, 0])):
            near = self.points[self._tree.query_ball_point(places[index], reaches[:, index].max())]
            is_in_range = np.abs(np.linalg.norm(near - where, axis=1) - values[index, 0]) <= self.distance
            gaps[index] = np.linalg.norm(near[is_in_range] - places[index], axis=1).min(initial=np.inf)
        return np.asarray(gaps <= reaches)


def is_moving(values: Array, covariance: Array, sensor: SensorState, period: float = NO_PERIOD) -> NDArray[np.bool_]:
    """True for detections that move over the ground, by more than errors of their angles explain."""
    own = sensor.pose[:, :3].T @ sensor.velocity
    limit = np.full(len(values), _STATIC_SPEED)
    if own.any():
        limit += 2.0 * _angle_deviations(covariance) * np.sqrt(own @ own)
    return np.asarray(np.abs(wrapped(over_ground(values, own), period)) > limit)


def _angle_deviations(covariance: Array) -> Array:
    """Larger deviation of azimuth and elevation (detection,) [rad]; 0 where neither is given."""
    variances = np.fmax.reduce(covariance.diagonal(axis1=1, axis2=2)[:, 2:], axis=1, initial=0.0)
    return np.asarray(np.sqrt(variances))


def places_of(values: Array, sensor: SensorState) -> Array:
    """Places of detections in the world (detection, 3) [m]."""
    places: Array = values[:, :1] * directions_of(values) @ sensor.pose[:, :3].T + sensor.pose[:, 3]
    return places


def _surface(mesh: Mesh) -> Array:
    """Points on the triangles of a mesh, nearer to each other than `_SPACING`."""
    corners = mesh.vertices[mesh.triangles]  # (triangle, corner, axis)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    steps = np.maximum(np.ceil(longest / _SPACING), 1.0).astype(np.int64)
    points = [mesh.vertices[:0]]
    for number in np.unique(steps):
        first, second = np.triu_indices(number + 1)
        weights = np.stack([first, second - first, number - second], axis=1) / number
        points.append((weights @ corners[steps == number]).reshape(-1, 3))
    return np.concatenate(points)


def _thinned(points: Array) -> Array:
    """One of all points in each cube of half the spacing."""
    _, first = np.unique(np.floor(points / (0.5 * _SPACING)), axis=0, return_index=True)
    return points[np.sort(first)]
