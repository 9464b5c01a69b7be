"""Deformations of meshes: positions and velocities of the vertices over time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.motion.protocol import derivative
from radarcore.motion.series import Ends, check_steps
from radarcore.records import sealed

Vertices = NDArray[np.float64]


@sealed
class Deformation:
    """Vertices at given times and a cubic spline through them.

    The spline is natural-ended, so velocities are continuous between the first and the last time; two times make a
    straight line.

    Parameters
    ----------
    times : (k,) array_like
        Increasing [s], at least two.
    vertices : (k, n, 3) array_like
        Positions in body coordinates [m], in the order of the mesh's vertices.
    extrapolate : "hold", "continue" or "error", optional
        Before the first and after the last time the vertices rest there, go on at the velocities that they have there,
        or raise a ValueError. Default: they rest.

    See Also
    --------
    Body : Takes it as `deformation`.
    Trajectory : Motion of a rigid body.

    Examples
    --------
    >>> plate = rc.shapes.plate(0.1, 0.1)
    >>> breath = rc.Deformation([0.0, 1.0], [plate.vertices, plate.vertices + [0.01, 0.0, 0.0]])
    >>> breath.rate_at(0.5)[0].round(3)
    array([0.01, 0.  , 0.  ])
    """

    def __init__(self, times: ArrayLike, vertices: ArrayLike, *, extrapolate: str | None = None) -> None:
        from scipy.interpolate import CubicSpline

        self.times: NDArray[np.float64] = check.increasing("times", times)
        self.vertices: NDArray[np.float64] = check.frozen(check.array("vertices", vertices, (len(self.times), None, 3)))
        self._spline = CubicSpline(self.times, self.vertices, bc_type="natural")
        steps = np.linalg.norm(np.diff(self.vertices, axis=0), axis=2).max(axis=1, initial=0.0)
        check_steps("times, vertices", self.times, steps)
        self._ends = Ends("Deformation", self.times, extrapolate)

    @property
    def extrapolate(self) -> str | None:
        """As given."""
        return self._ends.choice

    @property
    def num_vertices(self) -> int:
        """Vertices of the mesh."""
        return int(self.vertices.shape[1])

    def at(self, time: float) -> Vertices:
        """The vertices at a time [s], (n, 3) [m]."""
        inside, elapsed = self._ends.split(time)
        positions: Vertices = self._spline(inside) if inside < self.times[-1] else self.vertices[-1]
        return positions + elapsed * self._spline(inside, 1) if elapsed else positions

    def rate_at(self, time: float) -> Vertices:
        """Velocities of the vertices at a time [s], (n, 3) [m/s]; at the very ends the velocities of the spline."""
        inside, _ = self._ends.split(time)
        velocities: Vertices = self._spline(inside, 1) if self._ends.moves(time) else np.zeros_like(self.vertices[0])
        return velocities

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), extrapolate=self.extrapolate), (self.times, self.vertices)

    def __repr__(self) -> str:
        first, last = self.times[[0, -1]]
        return f"<Deformation: {self.num_vertices} vertices at {len(self.times)} times, {first:g} to {last:g} s>"


@sealed
class DeformationFunction:
    """Vertices given by a function of time, whose results are checked.

    Parameters
    ----------
    vertices : callable
        Maps a time [s] to positions (n, 3) in body coordinates [m].
    num_vertices : int
        Vertices of the mesh.
    velocities : callable, optional
        Maps a time [s] to velocities (n, 3) [m/s]; default: differences as of a motion given by a function.
    """

    def __init__(
        self,
        vertices: Callable[[float], ArrayLike],
        num_vertices: int,
        velocities: Callable[[float], ArrayLike] | None = None,
    ) -> None:
        self._vertices, self._velocities = vertices, velocities
        self.num_vertices: int = num_vertices

    def at(self, time: float) -> Vertices:
        """The vertices at a time [s], (n, 3) [m]."""
        return check.array(f"deformation at {time:g} s", self._vertices(time), (self.num_vertices, 3))

    def rate_at(self, time: float) -> Vertices:
        """Velocities of the vertices at a time [s], (n, 3) [m/s]."""
        if self._velocities is None:
            return derivative(self.at, time)
        return check.array(f"velocities at {time:g} s", self._velocities(time), (self.num_vertices, 3))


AnyDeformation = Deformation | DeformationFunction


def as_deformation(deformation: object, num_vertices: int) -> AnyDeformation:
    """The deformation of a mesh with a number of vertices, with functions wrapped, or an error."""
    if isinstance(deformation, Deformation | DeformationFunction):
        if deformation.num_vertices != num_vertices:
            raise ValueError(
                f"deformation: expected {num_vertices} vertices as the mesh has, got {deformation.num_vertices}"
            )
        return deformation
    if callable(deformation):
        return DeformationFunction(deformation, num_vertices)
    raise TypeError(f"deformation: expected Deformation or a function of time, got {type(deformation).__name__}")
