"""Which chirps of a frame can be followed from one cast of rays."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.waveform import Waveform
from radarcore.scene.scene import Scene


def turn_rates(
    poses: NDArray[np.float64], rates: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How fast bodies turn as the sensor sees them: by their own rotation, or because it passes by.

    Parameters
    ----------
    poses, rates : (body, 3, 4) array
        Maps of body coordinates to those of the sensor [m], and their rates [m/s].
    corners : (body, 8, 3) array
        Of the boxes round the bodies [m].

    Returns
    -------
    rates : (body,) array
        Of the direction, in the axes of the body, to the sensor from that corner of its box for which it turns fastest,
        or from the nearest point of the box where the sensor is outside [rad/s].
    """
    turn, place = poses[..., :3], poses[..., 3]
    sensor = -np.einsum("bij,bi->bj", turn, place)
    nearest = np.clip(sensor, corners.min(axis=1), corners.max(axis=1))
    is_outside = (nearest != sensor).any(axis=-1, keepdims=True)
    corners = np.concatenate([corners, np.where(is_outside, nearest, corners[:, 0])[:, None]], axis=1)
    velocity = -np.einsum("bij,bi->bj", rates[..., :3], place) - np.einsum("bij,bi->bj", turn, rates[..., 3])
    offsets = sensor[:, None] - corners
    distances = np.maximum(np.linalg.norm(offsets, axis=-1), np.finfo(float).tiny)
    along = np.einsum("bj,bcj->bc", velocity, offsets) / distances
    across = np.sqrt(np.maximum((velocity**2).sum(axis=-1)[:, None] - along**2, 0.0))
    fastest: NDArray[np.float64] = (across / distances).max(axis=-1, initial=0.0)
    return fastest


def corners(scene: Scene) -> NDArray[np.float64]:
    """Corners of the boxes round the meshes of a scene, (body, 8, 3) in body coordinates [m]."""
    ends = [
        np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]) if len(mesh.vertices) else np.zeros((2, 3))
        for mesh in (body.mesh for body in scene.parts.meshed)
    ]
    picks = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3)
    return np.array([end[picks, np.arange(3)] for end in ends], dtype=np.float64).reshape(-1, 8, 3)


def blocks(waveform: Waveform, turn_rate: float, most: float) -> list[slice]:
    """Chirps that follow each other, within which nothing turns by more than `most` [rad] from the middle on.

    They are parts of the frame of the same duration, an odd number of them, so that one has its middle; a chirp is not
    cut.
    """
    starts = waveform.chirp_times
    first, last = float(starts[0]), waveform.duration
    number = int(min(max(1.0, np.ceil(0.5 * turn_rate * (last - first) / most)), 2.0 * waveform.num_chirps))
    number += 1 - number % 2
    ends = np.searchsorted(starts, np.linspace(first, last, number + 1)[1:-1] - 1e-9 * (last - first))
    ends = np.unique([0, *ends, waveform.num_chirps]).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


def waveform_of(waveform: Waveform, chirps: slice) -> Waveform:
    """A waveform of some chirps alone; the first of them starts at its time 0."""
    times = waveform.chirp_times[chirps]
    if len(times) == waveform.num_chirps:
        return waveform
    return waveform.replace(num_chirps=len(times), chirp_times=times - times[0])
