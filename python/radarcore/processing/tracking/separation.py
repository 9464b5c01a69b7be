"""Distance between people and a robot, and the distance at which the robot has to stop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.motion.group import Motions
from radarcore.processing.tracking.kalman import SHORTEST_RANGE, Array, covariance_from_above
from radarcore.processing.tracking.tracks import TrackState
from radarcore.scene.body import Body


@dataclass(frozen=True, eq=False)
class Separation:
    """Distance between a person and a robot, seen from above.

    Parameters
    ----------
    track : int or None
        Number of the person's track; None for a place where a standing person would have none.
    body : str
        Name of the nearest link.
    distance : float
        Between the nearest points of the person and of the link, in the horizontal plane [m]; 0 where they overlap.
    deviation : float
        Standard deviation of the person's place along the line between these points [m].
    age : float
        Time since the last detection of the person [s]; 0 while the track is held near a surface, see `Tracker`.
    required : float
        Protective separation distance [m].
    person_point, robot_point : (2,) float64
        Nearest points, x and y in the world [m].
    is_observable : bool
        As of `TrackState`; False for a place without a track.

    See Also
    --------
    separation : Makes them.

    Examples
    --------
    >>> near = rc.processing.Separation(0, "hand", 0.8, 0.05, 0.0, 1.2, np.array([1.0, 0.0]), np.array([0.2, 0.0]))
    >>> round(near.margin, 1), near.is_safe
    (-0.4, False)
    """

    track: int | None
    body: str
    distance: float
    deviation: float
    age: float
    required: float
    person_point: Array
    robot_point: Array
    is_observable: bool = True

    @property
    def margin(self) -> float:
        """Distance beyond the required one [m]; negative where the robot has to stop."""
        return self.distance - self.required

    @property
    def is_safe(self) -> bool:
        """True if the distance is at least the required one."""
        return self.margin >= 0.0


def separation(
    tracks: Iterable[TrackState],
    robot: Sequence[Body],
    *,
    time: float | None = None,
    unobserved: ArrayLike | None = None,
    reaction_time: float = 0.1,
    stopping_time: float = 0.3,
    stopping_distance: float | None = None,
    human_speed: float = 1.6,
    intrusion: float = 0.1,
    robot_uncertainty: float = 0.01,
    coverage: float = 3.0,
    body_radius: float = 0.3,
) -> list[Separation]:
    """Actual and required distances between people and a robot: speed and separation monitoring.

    The protective separation distance is ``S = Sh + Sr + Ss + C + Zd + Zr`` (ISO/TS 15066:2016, 5.5.4; today ISO
    10218-2:2025). The person walks Sh while the robot reacts and stops. The robot travels Sr while it reacts and Ss
    while it stops. C is the reach of a hand before it is detected. Zd and Zr are the position uncertainties of person
    and robot. The time since the last detection of the person is added to the reaction time.

    Distances are horizontal. Ignoring heights makes them too small rather than too large. A person is a disc around the
    track, plus the nearest echo in front of it. A link is its convex hull. Use this for design and comparison: it is
    not a safety function.

    Parameters
    ----------
    tracks : iterable of TrackState
        In the robot's world frame, see ``Tracker(motion=...)``; unconfirmed tracks are ignored.
    robot : sequence of Body
        Its links with their motions, such as ``arm.moving(...).bodies()``. The first call computes and
        caches their hulls.
    time : float, optional
        Time of the distances [s], not before the tracks; people are extrapolated to it at constant velocity. Default:
        the time of the tracks. Without tracks, `unobserved` requires it.
    unobserved : (n, 3) array_like, optional
        Places in the world [m] where a standing person would give no track, see `StaticMap.are_observable`. Each counts
        as a person who stands there.
    reaction_time : float
        From the frame to the stop command [s].
    stopping_time : float
        From that command to standstill [s].
    stopping_distance : float, optional
        Distance that the robot travels in that time [m]; default: its speed times `stopping_time`.
    human_speed : float
        Speed of people towards the robot [m/s]; faster tracks use their own speed.
    intrusion : float
        C [m].
    robot_uncertainty : float
        Zr [m].
    coverage : float
        Zd in standard deviations of the track.
    body_radius : float
        Radius of the disc [m].

    Returns
    -------
    separations : list of Separation
        One per person, and one for the most critical `unobserved` place; smallest margin first.

    Raises
    ------
    ValueError
        For tracks without angles, a robot without links, bodies that deform, a time before the tracks, no time for
        `unobserved` without tracks, and numbers below 0.

    See Also
    --------
    Tracker : Tracks of people, frame by frame.
    processing.Separation : The result.

    Examples
    --------
    >>> tracker = rc.Tracker(confirm_hits=1, confirm_frames=1)
    >>> states = tracker.update(rc.Detections([2.0], [-0.5], [0.0], [np.nan], [20.0]))
    >>> hand = rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([0.5, 0.0, 1.0]), velocity=[0.25, 0.0, 0.0]))
    >>> [one] = rc.separation(states, [hand])
    >>> print(f"{one.distance:.2f} m, required {one.required:.2f} m: {one.is_safe}")
    1.10 m, required 1.06 m: True
    """
    for name, value, unit in (
        ("reaction_time", reaction_time, "s"),
        ("stopping_time", stopping_time, "s"),
        ("stopping_distance", 0.0 if stopping_distance is None else stopping_distance, "m"),
        ("human_speed", human_speed, "m/s"),
        ("intrusion", intrusion, "m"),
        ("robot_uncertainty", robot_uncertainty, "m"),
        ("coverage", coverage, ""),
        ("body_radius", body_radius, "m"),
    ):
        check.non_negative(name, value, unit)
    if not isinstance(robot, Iterable):
        raise TypeError(f"robot: expected a sequence of Body, got {type(robot).__name__}")
    links = _links(tuple(check.instance("robot", body, Body) for body in robot))
    states = [check.instance("tracks", state, TrackState) for state in tracks]
    people = [_person(state, time, body_radius) for state in states if state.is_confirmed]
    if unobserved is not None and len(places := check.array("unobserved", unobserved, (None, 3))) > 0:
        people.append(_unseen(places, people[0].time if people and time is None else time, body_radius))
    outlines: dict[float, tuple[Array, Array]] = {}
    found = []
    for person in people:
        extents, rates = outlines[person.time] = outlines.get(person.time) or links.outlines(person.time)
        distance, away = _distances(extents, person.places)

        # Required distances of all links from all discs.
        waiting = reaction_time + person.age
        walking = max(human_speed, person.speed) * (waiting + stopping_time)
        approach = np.maximum(links.extents(rates, away), 0.0)
        way = approach * stopping_time if stopping_distance is None else stopping_distance
        deviation = np.sqrt(np.vecdot(away @ person.covariance, away))
        limit = walking + approach * waiting + way + intrusion + coverage * deviation + robot_uncertainty

        gap = np.maximum(distance - person.radii, 0.0)
        link, disc = best = np.unravel_index((gap - limit).argmin(), gap.shape)
        lengths = distance[best] - gap[best], distance[best]  # to the edge of the disc, and to the link
        person_point, robot_point = (person.places[disc] - length * away[best] for length in lengths)
        found.append(
            Separation(
                track=person.track,
                body=links.names[link],
                distance=float(gap[best]),
                deviation=float(deviation[best]),
                age=person.age,
                required=float(limit[best]),
                person_point=person_point,
                robot_point=robot_point,
                is_observable=person.is_observable,
            )
        )
    return sorted(found, key=lambda one: one.margin)


class _Person(NamedTuple):
    """A person at a time, seen from above: the disc of a body, and perhaps the nearest echo in front of it."""

    track: int | None
    is_observable: bool
    time: float
    """[s]."""
    age: float
    """Time since the last detection [s]."""
    places: Array
    """Centres of the discs (disc, 2) [m]; of a person without a track one for each place."""
    radii: Array
    """(disc,) [m]."""
    speed: float
    """[m/s]."""
    covariance: Array
    """Of the place, (2, 2) [m^2]."""


def _person(state: TrackState, time: float | None, radius: float) -> _Person:
    """The disc of a person, and the nearest echo in front of it."""
    now = state.time if time is None else check.time("time", time)
    if now < state.time:
        raise ValueError(f"time: expected {state.time:.9g} s, the time of the tracks, or later, got {now:.9g} s")
    places, motion = [state.position], state.motion[:2]
    if np.isnan(places).any():
        raise ValueError("tracks: expected places, got ranges alone: detections without an azimuth")
    if np.isfinite(state.nearest):
        sensor = state.sensor_pose[:, 3]
        sight = places[0] - sensor
        places.append(sensor + state.nearest / max(float(np.linalg.norm(sight)), SHORTEST_RANGE) * sight)
    discs = np.array(places)[:, :2] + (now - state.time) * motion
    radii, speed = np.array([radius, 0.0])[: len(discs)], float(np.linalg.norm(motion))
    covariance = covariance_from_above(state.state_covariance, state.sensor_pose)
    age = max(now - state.seen, 0.0)
    return _Person(state.id, state.is_observable, now, age, discs, radii, speed, covariance)


def _unseen(places: Array, time: float | None, radius: float) -> _Person:
    """Somebody who stands at one of the places."""
    if time is None:
        raise ValueError("time: expected one for unobserved places without tracks, got None")
    now, radii = check.time("time", time), np.full(len(places), radius)
    return _Person(None, False, now, 0.0, places[:, :2], radii, 0.0, np.zeros((2, 2)))


class _Links:
    """The rigid links of a robot that have a surface: their convex hulls, and their motions."""

    def __init__(self, robot: Iterable[Body]) -> None:
        for body in robot:
            if body.deformation is not None:
                raise ValueError(f"robot: expected rigid links, got {body.name!r}, which deforms")
        bodies = [body for body in robot if len(body.mesh.triangles) > 0]
        if not bodies:
            raise ValueError("robot: expected links with surfaces, got none")
        self.names = [body.name or "" for body in bodies]
        self._hulls = [_corners(body.mesh) for body in bodies]
        self._motions = Motions([body.motion for body in bodies])

    def outlines(self, time: float) -> tuple[Array, Array]:
        """Extents of the links at a time in `_DIRECTIONS` (link, 128) [m], and rates of their maps (link, 2, 4)."""
        poses, rates = self._motions.poses_and_rates_at(np.array([time]))[:, 0, :, :2]
        return self.extents(poses, _DIRECTIONS), rates

    def extents(self, maps: Array, directions: Array) -> Array:
        """Largest coordinates (link, n) of the corners, by maps (link, 2, 4), along directions ([link,] n, 2)."""
        return np.array([(each @ hull).max(axis=1) for each, hull in zip(directions @ maps, self._hulls, strict=True)])


_links = lru_cache(maxsize=16)(_Links)
"""Links of the bodies of a robot, prepared once."""


def _distances(extents: Array, points: Array) -> tuple[Array, Array]:
    """Distances of points (n, 2) from outlines (link, n), 0 inside, and directions to the points (link, n, 2).

    A distance is the largest one by which a line separates both.
    """
    beyond = points @ _DIRECTIONS.T - extents[:, None]
    return np.maximum(beyond.max(axis=2), 0.0), _DIRECTIONS[beyond.argmax(axis=2)]


@lru_cache(maxsize=256)
def _corners(mesh: Mesh) -> Array:
    """Corners of the convex hull of a mesh, (4, corner), the last row 1; of a flat one all of its vertices."""
    from scipy.spatial import ConvexHull, QhullError  # here: importing radarcore imports numpy and nothing heavier

    corners = mesh.vertices
    with suppress(QhullError):
        corners = corners[ConvexHull(corners).vertices]
    return np.concatenate([corners.T, np.ones((1, len(corners)))])


_BEARINGS = 2.0 * np.pi * np.arange(128) / 128
_DIRECTIONS = np.stack([np.cos(_BEARINGS), np.sin(_BEARINGS)], axis=1)
"""Directions in which extents are known, (128, 2): distances are too small by up to 0.3 mm per metre."""
