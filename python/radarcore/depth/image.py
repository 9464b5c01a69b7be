"""Pixels of a depth image, and checks of the arguments that they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.depth import surfaces
from radarcore.geometry.camera import Camera


@dataclass(frozen=True, eq=False)
class Image:
    """Surface at every pixel; arrays (rows, columns), without a return where the distance is infinite."""

    camera: Camera
    distance: NDArray[np.float64]
    normals: NDArray[np.float64]
    reflection: NDArray[np.complex128]
    albedo: NDArray[np.float64]
    body: NDArray[np.int32]
    range_rate: NDArray[np.float64]

    def thinned(self, max_points: int | None) -> Image:
        """Image of evenly spaced rows and columns with at most `max_points` pixels; each covers more."""
        rows, columns = self.distance.shape
        if max_points is None or rows * columns <= max_points:
            return self
        step = int(np.sqrt(rows * columns / max_points))
        while max(1, rows // step) * max(1, columns // step) > max_points:
            step += 1
        chosen = [_middle_ones(length, step) for length in (rows, columns)]
        parts = {name: getattr(self, name)[tuple(chosen)] for name in vars(self) if name != "camera"}
        camera = _every(self.camera, step, chosen[0].start, chosen[1].start)
        return replace(self, camera=camera, **parts)


def depths(name: str, value: ArrayLike, scale: float | None, shape: tuple[int, ...] | None = None) -> NDArray[Any]:
    """Image of real numbers of any type [m], infinite and NaN ones kept; integers need the metres per unit."""
    try:
        image = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise TypeError(f"{name}: expected numbers of shape (rows, columns): {error}") from None
    if image.dtype.kind not in "iuf":
        raise TypeError(f"{name}: expected real numbers [m], got {image.dtype}")
    if image.ndim != 2 or image.size == 0 or (shape is not None and image.shape != shape):
        raise ValueError(f"{name}: expected shape {'(rows, columns)' if shape is None else shape}, got {image.shape}")
    if scale is not None:
        metres: NDArray[Any] = image * np.asarray(scale, image.dtype if image.dtype.kind == "f" else np.float64)
        return metres
    if image.dtype.kind != "f":
        raise TypeError(
            f"{name}: expected floating-point numbers [m], or scale with integers (1e-3 for millimetres), "
            f"got {image.dtype}"
        )
    return image


def returns(depth: NDArray[Any], limit: float) -> NDArray[np.float64]:
    """Depths as f64, infinite where nothing returns."""
    values = depth.astype(np.float64)
    return np.where(np.isfinite(values) & (values > 0.0) & (values < limit), values, np.inf)


def bodies_of(
    body: ArrayLike | None, twists: ArrayLike | None, shape: tuple[int, ...]
) -> tuple[NDArray[np.int32], int]:
    """Body of every pixel, and number of bodies."""
    num_moved = None if twists is None else len(np.atleast_1d(np.asarray(twists)))
    if body is None:
        if num_moved not in (None, 1):
            raise ValueError("body: expected the body of every pixel with the twists of several bodies, got none")
        return np.zeros(shape, np.int32), 1
    numbers = np.asarray(body)
    if numbers.dtype.kind not in "iu":
        raise TypeError(f"body: expected integers, got {numbers.dtype}")
    if numbers.shape != shape:
        raise ValueError(f"body: expected shape {shape}, got {numbers.shape}")
    num_bodies = int(numbers.max(initial=-1)) + 1
    if num_moved is not None and num_bodies > num_moved:
        raise ValueError(f"body: expected numbers below {num_moved}, one per twist, got {num_bodies - 1}")
    return np.maximum(numbers, -1).astype(np.int32), num_bodies if num_moved is None else num_moved


def fractions(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Image of numbers from 0 to 1; grey levels count as fractions of the largest."""
    given = np.asarray(value)
    largest = float(np.iinfo(given.dtype).max) if given.dtype in (np.uint8, np.uint16) else 1.0
    fraction = check.numbers(name, given) / largest
    if fraction.shape not in ((), shape):
        raise ValueError(f"{name}: expected one number or shape {shape}, got {fraction.shape}")
    is_wrong = ~((fraction >= 0.0) & (fraction <= 1.0 + 1e-9))
    if is_wrong.any():
        raise ValueError(f"{name}: expected numbers from 0 to 1, got {fraction[is_wrong].flat[0]:g}")
    return np.broadcast_to(fraction, shape)


def normals_of(
    normals: ArrayLike | None, ray: NDArray[np.float64], camera: Camera, noise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit normals towards the sensor, zero where there is none."""
    if normals is None:
        if min(ray.shape) < 2:
            raise ValueError(f"normals: expected normals with an image of {ray.shape[0]} x {ray.shape[1]} pixels")
        return surfaces.normals(ray, camera, noise)
    given = check.numbers("normals", normals)
    if given.shape != (*ray.shape, 3):
        raise ValueError(f"normals: expected shape {(*ray.shape, 3)}, got {given.shape}")
    length = np.linalg.norm(given, axis=-1, keepdims=True)
    is_usable = np.isfinite(length) & (length > 0.0)
    unit = np.divide(given, length, out=np.zeros_like(given), where=is_usable)
    u, v = camera.plane(*ray.shape)
    faces_away = unit[..., 0] + unit[..., 1] * u + unit[..., 2] * v[:, None] > 0.0
    facing: NDArray[np.float64] = np.where(faces_away[..., None], -unit, unit)
    return facing


def _middle_ones(length: int, step: int) -> slice:
    """Slice of every `step`-th of `length` indices, centred: both ends skip the same number."""
    count = max(1, length // step)
    first = (length - ((count - 1) * step + 1)) // 2
    return slice(first, first + (count - 1) * step + 1, step)


def _every(camera: Camera, step: int, row: int, column: int) -> Camera:
    """Camera of every `step`-th pixel in both directions, from a row and a column on."""
    return Camera(
        camera.fx / step,
        camera.fy / step,
        (camera.cx - column - 0.5) / step + 0.5,
        (camera.cy - row - 0.5) / step + 0.5,
    )
