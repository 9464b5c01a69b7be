"""Distance between people and a robot, and the distance at which the robot has to stop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.motion.protocol import LinkMotion, poses_at
from radarcore.processing.tracking.kalman import SHORTEST_RANGE, Array, covariance_from_above
from radarcore.processing.tracking.tracks import TrackState
from radarcore.scene.body import Body


@dataclass(frozen=True, eq=False)
class Separation:
    """Distance between a person and a robot, seen from above.

    Parameters
    ----------
    track : int
        Number of the person's track.
    body : str
        Name of the nearest link.
    distance : float
        Between the nearest points of the person and of the link, in the horizontal plane [m]; 0 where they overlap.
    deviation : float
        Standard deviation of the person's place along the line between these points [m].
    age : float
        Time since the last detection of the person [s].
    required : float
        Protective separation distance [m].
    person_point, robot_point : (2,) float64
        Nearest points, x and y in the world [m].

    See Also
    --------
    separation : Makes them.

    Examples
    --------
    >>> near = rc.processing.Separation(0, "hand", 0.8, 0.05, 0.0, 1.2, np.array([1.0, 0.0]), np.array([0.2, 0.0]))
    >>> round(near.margin, 1), near.is_safe
    (-0.4, False)
    """

    track: int
    body: str
    distance: float
    deviation: float
    age: float
    required: float
    person_point: Array
    robot_point: Array

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
    reaction_time: float = 0.1,
    stopping_time: float = 0.3,
    stopping_distance: float | None = None,
    human_speed: float = 1.6,
    intrusion: float = 0.1,
    robot_uncertainty: float = 0.01,
    coverage: float = 3.0,
    body_radius: float = 0.3,
) -> list[Separation]:
    """Distances between people and a robot, and the required distances: speed and separation monitoring.

    The protective separation distance is ``S = Sh + Sr + Ss + C + Zd + Zr`` (ISO/TS 15066:2016, 5.5.4; today ISO
    10218-2:2025). The person walks on while the robot reacts and stops (Sh). The robot goes on while it reacts (Sr) and
    stops (Ss). C is the reach of a hand before it is seen. Zd and Zr are the uncertainties of the places of person and
    robot. The time since the last detection of the person counts as reaction time.

    Everything is seen from above: heights do not count, which makes distances too small rather than too large. A
    person is a disc about the track, and the nearest echo in front of it. A link is its convex hull. Use it to design
    and to compare: it is no safety function.

    Parameters
    ----------
    tracks : iterable of TrackState
        In the world of the robot, see ``Tracker(motion=...)``; unconfirmed tracks are left out.
    robot : sequence of Body
        Its links with their motions, such as ``arm.moving(...).bodies()``. The first call forms their hulls, which
        are kept.
    time : float, optional
        Time of the distance [s], not before the tracks; people go on to it at their velocities. Default: the time of
        the tracks.
    reaction_time : float
        From the frame to the command to stop [s].
    stopping_time : float
        From that command to standstill [s].
    stopping_distance : float, optional
        Distance that the robot travels meanwhile [m]; default: its speed times `stopping_time`.
    human_speed : float
        Speed of people towards the robot [m/s]; the track of a faster person counts with its speed.
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
        One per person, the smallest margin first; empty without a person.

    Raises
    ------
    ValueError
        For tracks without angles, a robot without links, bodies that deform, a time before the tracks, and numbers
        below 0.

    See Also
    --------
    Tracker : Tracks of people, frame by frame.
    processing.Separation : What comes back.

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
    bodies = _checked(robot)

    def required(person: _Person, link: _Link, away: Array, age: float) -> tuple[float, float]:
        """Required distance, and the deviation in it [m]."""
        waiting = reaction_time + age
        walking = max(human_speed, person.speed)
        approach = max(float((link.velocities @ away).max()), 0.0)
        way = approach * stopping_time if stopping_distance is None else stopping_distance
        deviation = float(np.sqrt(away @ person.covariance @ away))
        total = walking * (waiting + stopping_time) + approach * waiting + way
        return total + intrusion + coverage * deviation + robot_uncertainty, deviation

    links: dict[float, list[_Link]] = {}
    found = []
    for state in tracks:
        check.instance("tracks", state, TrackState)
        if not state.is_confirmed:
            continue
        now = state.time if time is None else check.time("time", time)
        if now < state.time:
            raise ValueError(f"time: expected {state.time:.9g} s, the time of the tracks, or later, got {now:.9g} s")
        links[now] = links.get(now) or _links(bodies, now)
        person = _person(state, now, body_radius)
        age = max(now - state.seen, 0.0)
        each = []
        for link in links[now]:
            for point, radius in person.discs:
                distance, away = _distance(link, point)
                limit, deviation = required(person, link, away, age)
                gap = max(distance - radius, 0.0)
                edge, place = point - min(radius, distance) * away, point - distance * away
                each.append(Separation(state.id, link.name, gap, deviation, age, limit, edge, place))
        found.append(min(each, key=lambda one: one.margin))
    return sorted(found, key=lambda one: one.margin)


class _Person(NamedTuple):
    """A person at a time, seen from above."""

    discs: list[tuple[Array, float]]
    """Centres (2,) and radii [m]."""
    speed: float
    """[m/s]."""
    covariance: Array
    """Of the place, (2, 2) [m^2]."""


class _Link(NamedTuple):
    """A link at a time, seen from above."""

    name: str
    extents: Array
    """Of its outline in `_DIRECTIONS`, from the origin (128,) [m]."""
    velocities: Array
    """Of the corners of its hull, (corner, 2) [m/s]."""


def _person(state: TrackState, time: float, radius: float) -> _Person:
    """The disc of a person, and the nearest echo in front of it."""
    place = state.position
    if np.isnan(place).any():
        raise ValueError("tracks: expected places, got ranges alone: detections without an azimuth")
    ahead = (time - state.time) * state.motion[:2]
    discs = [(place[:2] + ahead, radius)]
    if np.isfinite(state.nearest):
        sensor = state.sensor_pose[:, 3]
        sight = place - sensor
        echo = sensor + state.nearest / max(float(np.linalg.norm(sight)), SHORTEST_RANGE) * sight
        discs.append((echo[:2] + ahead, 0.0))
    covariance = covariance_from_above(state.state_covariance, state.sensor_pose)
    return _Person(discs, float(np.linalg.norm(state.motion[:2])), covariance)


def _checked(robot: Sequence[Body]) -> list[Body]:
    """The rigid links that have a surface, whose hulls are formed before anybody comes near."""
    if not isinstance(robot, Iterable):
        raise TypeError(f"robot: expected a sequence of Body, got {type(robot).__name__}")
    bodies = []
    for body in robot:
        check.instance("robot", body, Body)
        if body.deformation is not None:
            raise ValueError(f"robot: expected rigid links, got {body.name!r}, which deforms")
        if len(body.mesh.triangles) > 0:
            _corners(body.mesh)
            bodies.append(body)
    if not bodies:
        raise ValueError("robot: expected links with surfaces, got none")
    return bodies


def _links(robot: Sequence[Body], time: float) -> list[_Link]:
    """The hulls of the links of a robot; one arm's links are placed together."""
    arms: dict[int, tuple[Array, Array]] = {}
    links = []
    for body in robot:
        motion = body.motion
        if isinstance(motion, LinkMotion):
            if id(motion.group) not in arms:
                arms[id(motion.group)] = motion.group.link_poses_at([time])[0], motion.group.link_rates_at([time])[0]
            pose, rate = (maps[motion.member] for maps in arms[id(motion.group)])
        else:
            pose, rate = poses_at(motion, [time])[0], np.asarray(motion.rate_at(time))
        places, velocities = (_corners(body.mesh) @ each[:2, :3].T + each[:2, 3] for each in (pose, rate))
        links.append(_Link(body.name or "", (places @ _DIRECTIONS).max(axis=0), velocities))
    return links


@lru_cache(maxsize=256)
def _corners(mesh: Mesh) -> Array:
    """Corners of the convex hull of a mesh, (corner, 3); of a flat one all of its vertices."""
    from scipy.spatial import ConvexHull, QhullError  # here: importing radarcore imports numpy and nothing heavier

    try:
        return np.asarray(mesh.vertices[ConvexHull(mesh.vertices).vertices])
    except QhullError:
        return mesh.vertices


_BEARINGS = 2.0 * np.pi * np.arange(128) / 128
_DIRECTIONS = np.stack([np.cos(_BEARINGS), np.sin(_BEARINGS)])
"""Directions in which extents are known, (2, 128): distances are too small by up to 0.3 mm per metre."""


def _distance(link: _Link, point: Array) -> tuple[float, Array]:
    """Distance of a point from a convex outline, 0 inside, and the direction from the nearest point to it.

    It is the largest distance by which a line separates them.
    """
    beyond = point @ _DIRECTIONS - link.extents
    best = int(beyond.argmax())
    return max(float(beyond[best]), 0.0), _DIRECTIONS[:, best]
