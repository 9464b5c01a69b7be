"""Paths on the floor: straight legs between waypoints, joined by turns with smooth curvature."""

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

# Turns below this angle [rad] are omitted: the jump of the heading is below the precision of poses.
_NO_TURN = 1e-9
# Largest turn [rad]: a sharper turn needs legs of infinite length.
_TURN_BACK = 0.999 * pi

# Degree of the Chebyshev series of positions along half a turn; its error is 1e-16 of the length for 180 degrees.
_DEGREE = 64


def _half_turn(num_flat: int) -> tuple[_Floats, _Floats]:
    """Chebyshev series of curvature (up to 1) and heading, its integral (up to 1/2), over half a turn of unit length.

    The curvature is a smoothstep with `num_flat` vanishing derivatives at both ends.
    """
    steepness = chebyshev.chebint(_interpolated(lambda u: (1.0 - u**2) ** num_flat, 2 * num_flat).real, lbnd=-1.0)
    curvature = steepness / steepness.sum()  # every Chebyshev polynomial is 1 at the end
    return curvature, 0.5 * chebyshev.chebint(curvature, lbnd=-1.0)


def _interpolated(function: Callable[[_Floats], _Floats | _Phasors], degree: int) -> _Phasors:
    """Chebyshev series of a function on [-1, 1], (degree + 1,)."""
    points = chebyshev.chebpts1(degree + 1)
    return np.asarray(np.linalg.solve(chebyshev.chebvander(points, degree), function(points)), dtype=np.complex128)


_CURVATURE, _HEADING = _half_turn(4)

# Straight lines and halves of turns. The anchor of a piece is its end without curvature: anchor, position and heading
# belong to this end. The path leads away from the anchor (forward = 1) or towards it (-1).
_PIECE = np.dtype(
    [
        ("start", float),  # distance along the path at which the piece begins [m]
        ("anchor", float),  # distance along the path [m]
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

    A turn at each corner consists of two mirrored halves: the curvature rises by a smoothstep from zero to
    ``1 / turn_radius`` and falls again. Curvature and its first four derivatives are continuous. At constant speed,
    velocity, angular velocity and their derivatives are then continuous too. Real walking paths are close to clothoids,
    whose curvature rises linearly over a turn of the same length: G. Arechavaleta, J.-P. Laumond, H. Hicheur, A.
    Berthoz, "An optimality principle governing human walking", IEEE Trans. Robotics 24 (2008) 5-14. Before the first
    and after the last waypoint the path continues straight without end.

    Parameters
    ----------
    waypoints : (n, 2) array_like
        Corners of the path, x and y [m], at least two. Turns cut the corners, so the path meets only the first and the
        last waypoint.
    turn_radius : float
        Smallest radius of the turns [m]. A right-angle turn uses 1.8 radii of each leg.

    Raises
    ------
    ValueError
        If legs are too short for their turns, as always for a turn of 180 degrees. The message names the leg and the
        length needed.
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
            raise ValueError(f"path: expected successive waypoints to differ, got the same at {k} and {k + 1}")

        # Length of both legs used by every turn; zero at both ends of the path.
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
                    f"path: the turn of {degrees(abs(turns[sharpest])):.0f} degrees at waypoint {sharpest} is too long "
                    f"for the leg from waypoint {k} to {k + 1}: expected at least {needed:.3g} m, got {leg:.3g}; "
                    "give a smaller turn_radius, or more waypoints (180 degrees: two right angles)"
                )

        # A straight piece along every leg, then the two halves of the turn at its end.
        pieces: list[tuple[float, float, complex, float, float, float, float]] = []
        distance = 0.0
        for k, leg in enumerate(legs):
            ahead = complex(legs[k] / abs(leg))
            pieces.append((distance, distance, complex(corners[k] + room[k] * ahead), headings[k], 1.0, 0.0, 1.0))
            distance += float(abs(leg)) - room[k] - room[k + 1]
            if turn := turns[k + 1]:
                length = abs(turn) * radius  # half of the turn; the mean curvature is half of the largest
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
        """Positions x + i y [m], headings [rad] and curvatures [1/m] at distances (n,) along the path [m]."""
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
    """Deviation of half a turn from its initial line: a Chebyshev series over the half's length, scaled to 1."""
    bend = _interpolated(lambda u: np.exp(1j * turn * chebyshev.chebval(u, _HEADING)) - 1.0, _DEGREE - 1)
    return np.asarray(0.5 * chebyshev.chebint(bend, lbnd=-1.0))


def _room(turn: float, radius: float) -> float:
    """Length of each leg used by a turn [m]."""
    if turn == 0.0:
        return 0.0
    angle = abs(turn)
    middle = angle * radius * (1.0 + complex(_bend(angle).sum()))
    # The normal in the middle of the turn goes through the corner.
    return middle.real + middle.imag * tan(0.5 * angle) if angle < _TURN_BACK else inf
