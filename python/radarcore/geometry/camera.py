"""Camera of a depth image: directions of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.records import sealed

_LIKE_RADIANS = (0.25, 2.0)
"""Fields of view that are implausible in degrees: 15 to 115 degrees have such values in radians."""


@sealed
@dataclass(unsafe_hash=True)
class Camera:
    """Pinhole camera that looks along +x; row 0 of its images is on top (+z), column 0 on the left (+y).

    The centre of the pixel in row i and column j lies at (j + 1/2, i + 1/2). OpenCV and ROS put it at (j, i): add 1/2
    to their cx and cy.

    Parameters
    ----------
    fx, fy : float
        Focal lengths [pixels], to the right and down.
    cx, cy : float
        Principal point, from the left and top edge of the image [pixels]; half its size when centred.

    See Also
    --------
    frame_from_depth : Frame of the radar from a depth image.
    DepthImage : Depth image of a simulated scene.

    Examples
    --------
    >>> camera = rc.Camera(fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    >>> u, v = camera.plane(rows=480, columns=640)
    >>> print(f"{np.rad2deg(np.arctan(u[0])):.1f} degrees to the left")
    32.6 degrees to the left
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        self.fx, self.fy = check.positive("fx", self.fx, "pixels"), check.positive("fy", self.fy, "pixels")
        self.cx, self.cy = check.number("cx", self.cx, "pixels"), check.number("cy", self.cy, "pixels")

    @classmethod
    def from_field_of_view(cls, field_of_view_deg: tuple[float, float], rows: int, columns: int) -> Camera:
        """Camera of a centred image with a horizontal and a vertical angle [degrees].

        See Also
        --------
        frame_from_depth : Takes the two angles in place of a camera.

        Examples
        --------
        >>> camera = rc.Camera.from_field_of_view((90.0, 60.0), rows=48, columns=64)
        >>> print(f"{camera.fx:.1f} {camera.fy:.1f} {camera.cx:.1f} {camera.cy:.1f}")
        32.0 41.6 32.0 24.0
        """
        angles = checked_field_of_view(field_of_view_deg)
        half_width, half_height = 0.5 * columns, 0.5 * rows
        tangents = np.tan(0.5 * np.deg2rad(angles))
        return cls(float(half_width / tangents[0]), float(half_height / tangents[1]), half_width, half_height)

    def plane(self, rows: int, columns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Plane coordinates u = y/x of the columns, (columns,), and v = z/x of the rows, (rows,)."""
        u = (self.cx - (np.arange(columns, dtype=np.float64) + 0.5)) / self.fx
        v = (self.cy - (np.arange(rows, dtype=np.float64) + 0.5)) / self.fy
        return u, v

    def slant(self, rows: int, columns: int) -> NDArray[np.float64]:
        """Distance along the ray over planar depth, (rows, columns)."""
        u, v = self.plane(rows, columns)
        slant: NDArray[np.float64] = np.sqrt(1.0 + u**2 + v[:, None] ** 2)
        return slant


def checked_field_of_view(field_of_view_deg: tuple[float, float]) -> tuple[float, float]:
    """Horizontal and vertical angle, with a warning of values in radians."""
    angles = check.array("field_of_view_deg", field_of_view_deg, (2,))
    if (angles <= 0.0).any() or (angles >= 180.0).any():
        raise ValueError(f"field_of_view_deg: expected angles between 0 and 180 degrees, got {angles.tolist()}")
    horizontal, vertical = angles.tolist()
    warn_of_radians("field_of_view_deg", horizontal, vertical)
    return horizontal, vertical


def warn_of_radians(name: str, *angles_deg: float) -> None:
    """Warn of angles of a field of view [degrees] that are narrow and read like radians.

    Those are whole degrees as radians, or numbers of few digits; views that are fitted to a far target are neither.
    """
    if all(_reads_like_radians(angle) for angle in angles_deg):
        got = " and ".join(f"{angle:g}" for angle in angles_deg)
        notice.warn(f"{name}: expected degrees, got a view of {got}; radians? np.rad2deg makes degrees of them")


def _reads_like_radians(angle: float) -> bool:
    degrees = float(np.rad2deg(angle))
    is_written = angle == round(angle, 3) or abs(degrees - round(degrees)) < 1e-3
    return _LIKE_RADIANS[0] <= angle < _LIKE_RADIANS[1] and is_written
