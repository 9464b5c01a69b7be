"""Depth images: what the rays of a pinhole camera at the sensor hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DepthImage:
    """What every pixel of an image hit; row 0 on top (+z), column 0 on the left (+y).

    Attributes
    ----------
    distance : (rows, columns) float64
        Along the ray from the centre of the array [m]; inf where nothing was hit.
    cos_incidence : (rows, columns) float64
        Cosine of the angle between ray and surface normal; 0 where nothing was hit.
    reflectance : (rows, columns) float64
        Power that the material returns, mirror-like and diffuse, over incident power; 0 where nothing was hit.
    body : (rows, columns) int32
        Number of the body in the scene; -1 where nothing was hit.
    directions : (rows, columns, 3) float64
        Unit directions of the rays in sensor axes.
    surface_distance : (rows, columns) float64
        Like `distance`, but to the smooth surface that the facets of a mesh stand for: what the radar's delays follow.
        Facets lie behind it by up to their sagitta, which is an error of phase; see `Mesh`.
    normals : (rows, columns, 3) float64
        Unit normals of that surface towards the sensor, in sensor axes; 0 where nothing was hit.
    field_of_view_deg : (float, float)
        Horizontal and vertical angle of the image [degrees].
    time : float
        Time the image was taken [s].
    """

    distance: NDArray[np.float64]
    cos_incidence: NDArray[np.float64]
    reflectance: NDArray[np.float64]
    body: NDArray[np.int32]
    directions: NDArray[np.float64]
    surface_distance: NDArray[np.float64]
    normals: NDArray[np.float64]
    field_of_view_deg: tuple[float, float]
    time: float

    @property
    def points(self) -> NDArray[np.float64]:
        """Hit points in sensor axes about the centre of the array, (num_hits, 3) [m], row by row."""
        is_hit = self.body >= 0
        return self.distance[is_hit, None] * self.directions[is_hit]
