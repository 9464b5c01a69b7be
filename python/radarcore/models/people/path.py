"""Paths on the floor: straight legs between waypoints, joined by turns of continuous heading and curvature."""

from __future__ import annotations

from bisect import bisect_right
from cmath import exp, phase
from itertools import pairwise
from math import copysign, degrees, inf, pi, sqrt, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check

# Turns below this angle [rad] are left out: the heading jumps by less than any pose can show.
_NO_TURN = 1e-9
# From this angle on [rad] no legs are long enough.
_TURN_BACK = 0.999 * pi


class PathPoint(NamedTuple):
    """Where a path is at some distance from its start."""

    position: complex
    """x + i y [m]."""
    heading: float
    """Angle of the direction of travel from the x axis, anticlockwise [rad]."""
    curvature: float
    """Derivative of the heading by distance [1/m]; positive to the left."""


class _Piece(NamedTuple):
    """Straight line or clothoid: the curvature is proportional to the distance from one end."""

    start: float
    """Distance along the path at which the piece begins [m]."""
    anchor: float
    """Distance along the path of the end without curvature [m]."""
    position: complex
    """Position of that end [m]."""
    heading: float
    """Heading at that end [rad]."""
    forward: float
    """+1 when the path leads away from that end, -1 when towards it."""
    sharpness: float
    """Change of curvature per distance from that end [1/m^2]; positive when the path turns left."""

    def at(self, distance: float) -> PathPoint:
        away = self.forward * (distance - self.anchor)
        bend = self.forward * self.sharpness
        position = self.position + self.forward * exp(1j * self.heading) * _clothoid(away, bend)
        return PathPoint(position, self.heading + 0.5 * bend * away**2, self.sharpness * away)


class FloorPath:
    """A path through waypoints on the floor, by distance travelled.

    Corners are rounded by two clothoids, mirror images of each other: the curvature grows linearly from nothing to
    ``1 / turn_radius`` and falls again. Position, heading and curvature are continuous, so whatever follows the path at
    constant speed has a continuous velocity and angular velocity. People's own paths are close to clothoids: G.
    Arechavaleta, J.-P. Laumond, H. Hicheur, A. Berthoz, "An optimality principle governing human walking", IEEE Trans.
    Robotics 24 (2008) 5-14. Before the first and after the last waypoint the path is straight, without end.

    Parameters
    ----------
    waypoints : (n, 2) array_like
        Corners of the path, x and y [m], at least two. Turns cut them: only the first and the last are passed.
    turn_radius : float
        Smallest radius of the turns [m]. A right angle takes 1.9 times as much of each leg.

    Raises
    ------
    ValueError
        When legs are too short for their turns, as all are for turning right back; says which and by how much.
    """

    def __init__(self, waypoints: ArrayLike, turn_radius: float = 0.4) -> None:
        radius = check.positive("turn_radius", turn_radius, "m")
        self.waypoints = check.frozen(check.array("path", waypoints, (None, 2)))
        corners = self.waypoints[:, 0] + 1j * self.waypoints[:, 1]
        if len(corners) < 2:
            raise ValueError(f"path: expected at least two waypoints, got {len(corners)}")
        legs = np.diff(corners)
        if not legs.all():
            k = int((legs == 0).argmax())
            raise ValueError(f"path: expected waypoints apart from each other, got the same at {k} and {k + 1}")

        # How much of its two legs every turn takes; none at either end.
        headings = [phase(legs[0])]
        turns = [0.0]
        for before, after in pairwise(legs):
            turns.append(phase(after / before))
            headings.append(headings[-1] + turns[-1])
        turns = [turn if abs(turn) > _NO_TURN else 0.0 for turn in turns] + [0.0]
        room = [_room(turn, radius) for turn in turns]
        for k, leg in enumerate(np.abs(legs)):
            if (needed := room[k] + room[k + 1]) > leg:
                sharpest = k if room[k] > room[k + 1] else k + 1
                raise ValueError(
                    f"path: the turn of {degrees(abs(turns[sharpest])):.0f} degrees at waypoint {sharpest} takes more "
                    f"than the leg from waypoint {k} to {k + 1} has: expected at least {needed:.3g} m, got {leg:.3g}; "
                    "give a smaller turn_radius, or more waypoints to turn in steps (right back: two right angles)"
                )

        # A straight piece along every leg, then the two clothoids of the turn at its end.
        self._pieces: list[_Piece] = []
        distance = 0.0
        for k, leg in enumerate(legs):
            begin, end = corners[k] + room[k] * legs[k] / abs(leg), corners[k + 1] - room[k + 1] * legs[k] / abs(leg)
            self._pieces.append(_Piece(distance, distance, complex(begin), headings[k], 1.0, 0.0))
            distance += float(abs(leg)) - room[k] - room[k + 1]
            if turn := turns[k + 1]:
                # Half of the turn at a mean curvature of half its largest.
                length = abs(turn) * radius
                sharpness = copysign(1.0 / (radius * length), turn)
                out = corners[k + 1] + room[k + 1] * legs[k + 1] / abs(legs[k + 1])
                self._pieces.append(_Piece(distance, distance, complex(end), headings[k], 1.0, sharpness))
                distance += length
                last = distance + length
                self._pieces.append(_Piece(distance, last, complex(out), headings[k + 1], -1.0, sharpness))
                distance = last
        self._starts = [piece.start for piece in self._pieces]
        self.length = distance

    def at(self, distance: float) -> PathPoint:
        """Position, heading and curvature at a distance along the path [m]; straight on before 0 and after `length`."""
        return self._pieces[max(bisect_right(self._starts, distance) - 1, 0)].at(distance)

    length: float
    """Length from the first to the last waypoint [m]."""
    waypoints: NDArray[np.float64]
    """As given, (n, 2) [m]."""


def _clothoid(distance: float, sharpness: float) -> complex:
    """Position on a clothoid that starts along +x without curvature: the integral of ``exp(i sharpness u^2 / 2)``."""
    from scipy.special import fresnel

    if sharpness == 0.0:
        return complex(distance)
    scale = sqrt(pi / abs(sharpness))
    sine, cosine = fresnel(distance / scale)
    return scale * complex(cosine, sine if sharpness > 0.0 else -sine)


def _room(turn: float, radius: float) -> float:
    """Length of each leg that is cut off by a turn of two clothoids [m]."""
    if turn == 0.0:
        return 0.0
    angle = abs(turn)
    middle = _clothoid(angle * radius, 1.0 / (angle * radius**2))
    # The normal in the middle of the turn goes through the corner.
    return middle.real + middle.imag * tan(0.5 * angle) if angle < _TURN_BACK else inf
