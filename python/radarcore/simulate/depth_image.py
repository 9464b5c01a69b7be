"""Depth images of a pinhole camera at the sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.simulate.view import one_plane


@dataclass(frozen=True, eq=False)
class DepthImage:
    """Nearest surface at every pixel; row 0 on top (+z), column 0 on the left (+y).

    Attributes
    ----------
    distance : (rows, columns) float64
        Along the ray from the centre of the array [m]; inf where nothing was hit.
    cos_incidence : (rows, columns) float64
        Cosine of the angle between ray and surface normal; 0 where nothing was hit.
    reflectance : (rows, columns) float64
        Power that the material returns, specular and diffuse, over incident power, at the pixel's angle of incidence
        and to the radar's polarisation; 0 where nothing was hit.
    body : (rows, columns) int32
        Index of the body in the scene; -1 where nothing was hit.
    directions : (rows, columns, 3) float64
        Unit directions of the rays in sensor axes.
    surface_distance : (rows, columns) float64
        Like `distance`, but to the smooth surface that the facets of a mesh approximate, which sets the radar's delays.
        Facets lie behind it by up to their sagitta, an error of phase; see `Mesh`.
    normals : (rows, columns, 3) float64
        Unit normals of the smooth surface towards the sensor, in sensor axes; 0 where nothing was hit.
    field_of_view_deg : (float, float)
        Horizontal and vertical angle of the image [degrees].
    time : float
        Time of the image [s].

    See Also
    --------
    Simulator.depth_image : Makes one.
    frame_from_depth : Frame from such an image.
    plot.depth_image : Picture of it.

    Examples
    --------
    >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Pose([1.0, 0.0, 0.0]))
    >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(), resolution=33, field_of_view_deg=(20, 20))
    >>> image = simulator.depth_image()
    >>> print(f"{image.distance.shape} pixels, {len(image.points)} hits, the nearest at {image.distance.min():.3f} m")
    (33, 33) pixels, 1009 hits, the nearest at 0.800 m
    """

    distance: NDArray[np.float64]
    cos_incidence: NDArray[np.float64]
    body: NDArray[np.int32]
    surface_distance: NDArray[np.float64]
    normals: NDArray[np.float64]
    field_of_view_deg: tuple[float, float]
    time: float
    _reflectance: Callable[[DepthImage], NDArray[np.float64]] = field(repr=False)

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """Unit directions of the rays, see the attributes."""
        rows, columns, du, dv, axis_column, axis_row = one_plane(self.field_of_view_deg, *self.distance.shape)
        u, v = np.meshgrid((axis_column - np.arange(columns) - 0.5) * du, (axis_row - np.arange(rows) - 0.5) * dv)
        towards = np.stack([np.ones_like(u), u, v], axis=-1)
        unit: NDArray[np.float64] = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        return unit

    @cached_property
    def reflectance(self) -> NDArray[np.float64]:
        """Power reflectance at the pixels, see the attributes."""
        return self._reflectance(self)

    @property
    def points(self) -> NDArray[np.float64]:
        """Hit points in sensor axes about the centre of the array, (num_hits, 3) [m], row by row."""
        is_hit = self.body >= 0
        return self.distance[is_hit, None] * self.directions[is_hit]

    def __getstate__(self) -> dict[str, Any]:
        # The materials are not pickled: keep the array.
        return {**self.__dict__, "reflectance": self.reflectance, "_reflectance": None}
