"""Which chirps of a frame can be followed from one cast of rays."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from radarcore.scene import Scene
from radarcore.waveform import Waveform


def turn_rates(
    poses: NDArray[np.float64], rates: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How fast bodies turn as the sensor sees them: by their own rotation, or because it passes by.

    Parameters
    ----------
    poses, rates : (body, 3, 4) array
        Maps of body coordinates to those of the sensor [m], and their rates [m/s].
    corners : (body, corner, 3) array
        Points of the bodies [m].

    Returns
    -------
    rates : (body,) array
        Of the direction, in the axes of the body, from that corner to the sensor for which it turns fastest [rad/s].
    """
    turn, place = poses[..., :3], poses[..., 3]
    sensor = -np.einsum("bij,bi->bj", turn, place)
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
        for mesh in (body.mesh for _, body in scene._meshed)
    ]
    picks = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(8, 3)
    return np.array([end[picks, np.arange(3)] for end in ends], dtype=np.float64).reshape(-1, 8, 3)


def blocks(waveform: Waveform, turn_rate: float, most: float) -> list[slice]:
    """Chirps that follow each other, within which nothing turns by more than `most` [rad] from the middle on.

    Their number is odd, so that one of them has the middle of the frame.
    """
    turn = 0.5 * turn_rate * waveform.duration
    number = min(max(1.0, np.ceil(turn / most)), waveform.num_chirps)
    odd = int(number) + 1 - int(number) % 2
    if odd > waveform.num_chirps:
        odd -= 2
    ends = np.round(np.linspace(0, waveform.num_chirps, max(1, odd) + 1)).astype(int).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


def waveform_of(waveform: Waveform, chirps: slice) -> Waveform:
    """A waveform of some chirps alone; the first of them starts at its time 0."""
    times = waveform.chirp_times[chirps]
    if len(times) == waveform.num_chirps:
        return waveform
    return waveform.replace(num_chirps=len(times), chirp_times=times - times[0])
