"""Paths on the floor: straight legs between waypoints, joined by turns whose curvature rises and falls smoothly."""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from math import degrees, inf, pi, tan

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.records import sealed

_Floats = NDArray[np.float64]
_Phasors = NDArray[np.complex128]

# Turns below this angle [rad] are left out: the heading jumps by less than any pose can show.
_NO_TURN = 1e-9
# Largest turn [rad]: beyond it no legs are long enough.
_TURN_BACK = 0.999 * pi

# Degree of the Chebyshev series of positions along half of a turn: 1e-16 of the length of a turn right back.
_DEGREE = 64


def _half_turn(num_flat: int) -> tuple[_Floats, _Floats]:
    """Chebyshev series over half of a turn of unit length: curvature and its integral, the heading, up to 1 and 1/2.

    The curvature rises by a smoothstep, with `num_flat` derivatives that vanish at both ends.
    """
    steepness = chebyshev.chebint(_interpolated(lambda u: (1.0 - u**2) ** num_flat, 2 * num_flat).real, lbnd=-1.0)
    curvature = steepness / steepness.sum()  # every Chebyshev polynomial is 1 in the end
    return curvature, 0.5 * chebyshev.chebint(curvature, lbnd=-1.0)


def _interpolated(function: Callable[[_Floats], _Floats | _Phasors], degree: int) -> _Phasors:
    """Chebyshev series of a function on [-1, 1], (degree + 1,)."""
    points = chebyshev.chebpts1(degree + 1)
    return np.asarray(np.linalg.solve(chebyshev.chebvander(points, degree), function(points)), dtype=np.complex128)


_CURVATURE, _HEADING = _half_turn(4)

# Straight lines, and halves of turns. The path leads away from that end of a piece which has no curvature (forward =
# 1), or towards it (-1); the anchor is that end's distance along the path, position and heading are those there.
_PIECE = np.dtype(
    [
        ("start", float),  # distance along the path at which the piece begins [m]
        ("anchor", float),  # [m]
        ("position", complex),  # [m]
        ("heading", float),  # [rad]
        ("forward", float),
        ("turn", float),  # angle of the whole turn, positive to the left; 0 for a straight line [rad]
        ("length", float),  # of half of the turn [m]
    ]
)


@sealed
class FloorPath:
    """A path through waypoints on the floor, by distance travelled.

    Corners are rounded by turns of two halves, mirror images of each other: the curvature rises by a smoothstep from
    nothing to ``1 / turn_radius`` and falls again. Curvature and its first four derivatives are continuous, and so are
    the velocity, the angular velocity and their derivatives of whatever follows the path at constant speed. People's
    own paths are close to clothoids, whose curvature rises linearly over a turn of the same length: G. Arechavaleta,
    J.-P. Laumond, H. Hicheur, A. Berthoz, "An optimality principle governing human walking", IEEE Trans. Robotics 24
    (2008) 5-14. Before the first and after the last waypoint the path is straight, without end.

    Parameters
    ----------
    waypoints : (n, 2) array_like
        Corners of the path, x and y [m], at least two. Turns cut them: only the first and the last are passed.
    turn_radius : float
        Smallest radius of the turns [m]. A right angle takes 1.8 times as much of each leg.

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

        # Length that every turn takes of its two legs; zero at either end.
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

        # A straight piece along every leg, then the two halves of the turn at its end.
        pieces: list[tuple[float, float, complex, float, float, float, float]] = []
        distance = 0.0
        for k, leg in enumerate(legs):
            ahead = complex(legs[k] / abs(leg))
            pieces.append((distance, distance, complex(corners[k] + room[k] * ahead), headings[k], 1.0, 0.0, 1.0))
            distance += float(abs(leg)) - room[k] - room[k + 1]
            if turn := turns[k + 1]:
                length = abs(turn) * radius  # half of the turn at a mean curvature of half its largest
                begin = complex(corners[k + 1] - room[k + 1] * ahead)
                end = complex(corners[k + 1] + room[k + 1] * legs[k + 1] / abs(legs[k + 1]))
                pieces.append((distance, distance, begin, headings[k], 1.0, turn, length))
                last = distance + 2.0 * length
                pieces.append((distance + length, last, end, headings[k + 1], -1.0, turn, length))
                distance = last
        self._pieces = np.array(pieces, dtype=_PIECE)
        self._bends = np.array([_bend(turn) for turn in (self._pieces["forward"] * self._pieces["turn"]).tolist()])
        self.length = distance

    def points_at(self, distances: ArrayLike) -> tuple[_Phasors, _Floats, _Floats]:
        """Positions x + i y [m], headings [rad] and curvatures [1/m] at several distances (n,) [m]."""
        distance = np.asarray(distances, dtype=np.float64)
        number = np.maximum(np.searchsorted(self._pieces["start"], distance, side="right") - 1, 0)
        piece = self._pieces[number]
        forward, turn, length, heading = (piece[field] for field in ("forward", "turn", "length", "heading"))
        away = forward * (distance - piece["anchor"])
        bend, curvature, direction = 0.0, np.zeros_like(heading), heading
        if turn.any():
            part = np.minimum(np.maximum(away / length, 0.0), 1.0)
            orders = np.cos(np.arccos(2.0 * part - 1.0)[:, None] * np.arange(_DEGREE + 1))
            bend = length * (orders * self._bends[number]).sum(axis=1)
            curvature = turn / length * (orders[:, : len(_CURVATURE)] @ _CURVATURE)
            direction = heading + forward * turn * (orders[:, : len(_HEADING)] @ _HEADING)
        return piece["position"] + forward * np.exp(1j * heading) * (away + bend), direction, curvature

    length: float
    """Length from the first to the last waypoint [m]."""
    waypoints: NDArray[np.float64]
    """Waypoints as given, (n, 2) [m]."""


@lru_cache(maxsize=256)
def _bend(turn: float) -> _Phasors:
    """Deviation of half a turn from the line it begins on: a Chebyshev series over its length, a unit length."""
    bend = _interpolated(lambda u: np.exp(1j * turn * chebyshev.chebval(u, _HEADING)) - 1.0, _DEGREE - 1)
    return np.asarray(0.5 * chebyshev.chebint(bend, lbnd=-1.0))


def _room(turn: float, radius: float) -> float:
    """Length of each leg that is cut off by a turn [m]."""
    if turn == 0.0:
        return 0.0
    angle = abs(turn)
    middle = angle * radius * (1.0 + complex(_bend(angle).sum()))
    # The normal in the middle of the turn goes through the corner.
    return middle.real + middle.imag * tan(0.5 * angle) if angle < _TURN_BACK else inf
