"""Field of view: image planes of the core that cover it, each with axes of its own, and their pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Angles = tuple[float, float]
"""Horizontal and vertical angle of a field of view [degrees]."""

MOST_OF_A_PLANE = 110.0
"""Widest angle of one image plane [degrees]. Beyond it pixels far from the axis would become small and oblique."""

MOST_OF_ANTENNAS = 150.0
"""Widest angle of the default field of view [degrees]."""

CELLS_AT_60 = 128
"""Cells of the base grid of adaptive sampling across 60 degrees."""

_CELL = 2.0 * np.tan(np.deg2rad(30.0)) / CELLS_AT_60
"""Width of these cells in the plane at distance 1."""

_TILE = 8
"""Cells of a tile along either side."""

_SEAM = 14 * _TILE * _CELL
"""Half width of the front plane beside others: whole tiles, about 45 degrees."""

_COARSER = 2
"""Width of cells in the side planes relative to the front plane. Cells at the border of the front plane subtend half
the angle of cells in its middle."""

Plane = tuple[int, int, float, float, float, float]
"""Image plane as the core has it: rows, columns, width and height of a pixel at distance 1, column and row of the
axis."""

Rotation = list[list[float]]
"""Rows of the rotation from the axes of the sensor to the axes of a sector."""

FRONT: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
_LEFT: Rotation = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
_RIGHT: Rotation = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
_TOP: Rotation = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
_BOTTOM: Rotation = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]


@dataclass(frozen=True)
class Axis:
    """Pixels along the horizontal or the vertical axis of a field of view.

    Up to 110 degrees there is one plane. Beyond, planes are sides of a box about the sensor: the front, and the sides
    to the left and to the right, or the top and the bottom.

    Attributes
    ----------
    front : float
        Half width of the front plane at distance 1.
    num_front : int
        Pixels of the front plane.
    edge : float or None
        Tangent of half the angle, where there are planes at the sides.
    num_side : int
        Pixels of either plane at the sides.
    """

    front: float
    num_front: int
    edge: float | None = None
    num_side: int = 0

    @classmethod
    def of(cls, angle_deg: float, number: int | None, cells_at_60: int, narrowest: float) -> Axis:
        """Pixels over an angle: the given number, or the resolution in the middle of a number across 60 degrees.

        Angles below `narrowest` [degrees] have its number of pixels.
        """
        half = float(np.tan(np.deg2rad(0.5 * angle_deg)))
        width = _CELL * CELLS_AT_60 / cells_at_60
        if angle_deg <= MOST_OF_A_PLANE:
            by_angle = cells_at_60 * min(max(angle_deg, narrowest), 60.0) / 60.0
            return cls(half, _whole(max(by_angle, 2.0 * half / width)) if number is None else number)
        front, side = _whole(2.0 * _SEAM / width), _whole((1.0 / _SEAM - 1.0 / half) / (_COARSER * width))
        if number is not None:
            side = max(1, round(number * side / (front + 2 * side)))
            front = max(1, number - 2 * side)
        return cls(_SEAM, front, half, side)

    @property
    def number(self) -> int:
        """Pixels across the whole angle."""
        return self.num_front + 2 * self.num_side

    @property
    def num_across_sides(self) -> int:
        """Pixels along this axis of planes at the sides of the other axis."""
        return max(1, (self.num_front + 1) // _COARSER)


@dataclass(frozen=True)
class Sectors:
    """Image planes that cover a field of view without gaps or overlaps."""

    horizontal: Axis
    vertical: Axis

    @classmethod
    def of(
        cls,
        field_of_view_deg: Angles,
        number: tuple[int, int] | None,
        cells_at_60: int = CELLS_AT_60,
        narrowest: float = 0.0,
    ) -> Sectors:
        """Planes over two angles. `number`: rows and columns; see `Axis.of`."""
        rows, columns = (None, None) if number is None else number
        both = zip(field_of_view_deg, (columns, rows), strict=True)
        return cls(*(Axis.of(angle, pixels, cells_at_60, narrowest) for angle, pixels in both))

    @property
    def shape(self) -> tuple[int, int]:
        """Pixels across the vertical and the horizontal angle."""
        return self.vertical.number, self.horizontal.number

    @property
    def num_pixels(self) -> int:
        """Pixels of all planes."""
        return sum(rows * columns for rows, columns, *_ in self.planes)

    @property
    def rotations(self) -> list[Rotation]:
        """Rotations to the axes of the planes, the front first."""
        sides = [_LEFT, _RIGHT] if self.horizontal.edge else []
        return [FRONT, *sides, *([_TOP, _BOTTOM] if self.vertical.edge else [])]

    @property
    def planes(self) -> list[Plane]:
        """The planes, in the order of the rotations."""
        h, v = self.horizontal, self.vertical
        planes = [_plane((v.num_front, h.num_front), (-h.front, h.front), (-v.front, v.front))]
        if h.edge is not None:
            # u = y/x of the left plane is -x/y of the sensor.
            near, far, half = 1.0 / h.front, 1.0 / h.edge, v.front / h.front
            shape = (v.num_across_sides, h.num_side)
            planes.append(_plane(shape, (-near, -far), (-half, half)))
            planes.append(_plane(shape, (far, near), (-half, half)))
        if v.edge is not None:
            # v = z/x of the top plane is -x/z of the sensor.
            near, far, half = 1.0 / v.front, 1.0 / v.edge, h.front / v.front
            shape = (v.num_side, h.num_across_sides)
            planes.append(_plane(shape, (-half, half), (-near, -far)))
            planes.append(_plane(shape, (-half, half), (far, near)))
        return planes


def is_outside(points: NDArray[np.float64], field_of_view_deg: Angles) -> NDArray[np.bool_]:
    """True for convex bodies (..., point, 3) in the sensor frame that are outside of a field of view."""
    x, y, z = np.moveaxis(points, -1, 0)
    horizontal, vertical = 0.5 * np.deg2rad(field_of_view_deg)
    along = x if horizontal <= 0.5 * np.deg2rad(MOST_OF_A_PLANE) else np.maximum(x, np.abs(y))
    beyond = [
        *(sign * y * np.cos(horizontal) > x * np.sin(horizontal) for sign in (-1.0, 1.0)),
        *(sign * z * np.cos(vertical) > along * np.sin(vertical) for sign in (-1.0, 1.0)),
    ]
    outside: NDArray[np.bool_] = np.any([side.all(axis=-1) for side in beyond], axis=0)
    return outside


def one_plane(field_of_view_deg: Angles, rows: int, columns: int) -> Plane:
    """Plane of a pinhole camera."""
    width, height = np.tan(0.5 * np.deg2rad(field_of_view_deg)).tolist()
    return _plane((rows, columns), (-width, width), (-height, height))


def whole_tiles(angle_deg: float) -> float:
    """Angle widened to whole tiles of the base grid [degrees], at most 150."""
    half = np.tan(np.deg2rad(0.5 * min(angle_deg, MOST_OF_ANTENNAS)))
    if angle_deg <= MOST_OF_A_PLANE:
        tile = _TILE * _CELL
        half = tile * np.ceil(half / tile - 1e-9)
        return min(2.0 * float(np.rad2deg(np.arctan(half))), MOST_OF_A_PLANE)
    tile = _TILE * _CELL * _COARSER
    rest = 1.0 / _SEAM - tile * np.ceil((1.0 / _SEAM - 1.0 / half) / tile - 1e-9)
    return min(2.0 * float(np.rad2deg(np.arctan2(1.0, rest))), MOST_OF_ANTENNAS)


def _plane(shape: tuple[int, int], u: tuple[float, float], v: tuple[float, float]) -> Plane:
    """Plane of rows and columns over ranges of its coordinates."""
    rows, columns = shape
    du, dv = (u[1] - u[0]) / columns, (v[1] - v[0]) / rows
    # From the left and from the top; exactly in the middle where the plane is centred.
    axis_column = 0.5 * columns if u[0] == -u[1] else u[1] / du
    axis_row = 0.5 * rows if v[0] == -v[1] else v[1] / dv
    return rows, columns, du, dv, axis_column, axis_row


def _whole(count: float) -> int:
    return max(1, int(np.ceil(count - 1e-9)))
