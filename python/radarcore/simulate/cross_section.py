"""Radar cross-sections of bodies far away."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check
from radarcore.geometry.mesh import Mesh
from radarcore.simulate.settings import check_max_bounces
from radarcore.simulate.synthesis import check_threads


def rcs(
    mesh: Mesh,
    frequency: float,
    directions: ArrayLike,
    *,
    receiver: ArrayLike | None = None,
    max_bounces: int = 1,
    polarization: str | ArrayLike | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Far-field radar cross-sections of a perfectly conducting mesh.

    By physical optics after up to `max_bounces` reflections, docs/theory.md eqs. (7) to (9), with a plane wave: neither
    edges nor creeping waves.

    Parameters
    ----------
    mesh : Mesh
    frequency : float
        Frequency [Hz].
    directions : (direction, 3) or (3,) array_like
        Unit vectors from the object to the radar, in the mesh's axes.
    receiver : (direction, 3) or (3,) array_like, optional
        Unit vectors from the object to a receiver elsewhere; default: monostatic.
    max_bounces : int
        Largest number of reflections of a path.
    polarization : None, "vertical", "horizontal" or (3,) array_like
        Direction of the field of both antennas: along z, across z, or a unit vector in the mesh's axes; the part of it
        across the ray. None: antennas without a polarisation.
    threads : int, optional
        Threads to use; default: all cores. The result does not depend on it.

    Returns
    -------
    sigma : (direction,) float64
        Cross-sections [m^2].
    """
    if not isinstance(mesh, Mesh):
        raise TypeError(f"mesh: expected Mesh, got {type(mesh).__name__}")
    to_transmitter = _units("directions", directions)
    to_receiver = to_transmitter if receiver is None else _units("receiver", receiver)
    count = max(len(to_transmitter), len(to_receiver))
    both = []
    for name, units in (("directions", to_transmitter), ("receiver", to_receiver)):
        if len(units) not in (1, count):
            raise ValueError(f"{name}: expected shape ({count}, 3), got {units.shape}")
        both.append(np.ascontiguousarray(np.broadcast_to(units, (count, 3))))
    fields = None
    if polarization is not None:
        fields = _fields(polarization, both[0]), _fields(polarization, both[1])
    return _core.cross_sections(
        mesh._core,
        *both,
        frequency=check.positive("frequency", frequency, "Hz"),
        polarization=fields,
        max_bounces=check_max_bounces(max_bounces),
        threads=check_threads(threads),
    )


def _units(name: str, value: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(value)
    vectors = check.array(name, array[None] if array.ndim == 1 else array, (None, 3))
    lengths = np.linalg.norm(vectors, axis=1)
    if (abs(lengths - 1.0) > 1e-3).any():
        raise ValueError(f"{name}: expected unit vectors, got one of length {lengths[abs(lengths - 1.0).argmax()]:g}")
    units: NDArray[np.float64] = vectors / lengths[:, None]
    return units


def _fields(polarization: str | ArrayLike, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors along the fields of antennas in these directions, as far as they are across them."""
    if not isinstance(polarization, str):
        return np.ascontiguousarray(np.broadcast_to(_units("polarization", polarization), directions.shape))
    if polarization == "vertical":
        return np.tile([0.0, 0.0, 1.0], (len(directions), 1))
    if polarization != "horizontal":
        raise ValueError(f"polarization: expected 'vertical', 'horizontal' or a unit vector, got {polarization!r}")
    x, y, _ = directions.T
    across = np.stack([-y, x, 0.0 * x], axis=1)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.ascontiguousarray(np.where(length > 1e-9, across, [0.0, 1.0, 0.0]) / np.where(length > 1e-9, length, 1.0))
