"""Two waves in the channels of one cell: maximum-likelihood directions, their covariance and the residual."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.angles.plane_wave import Array, blocks_of, nearest_to_front, within
from radarcore.products import product

_NUM_STEPS = 12
"""Largest number of scoring steps."""

_SMALL_STEP = 1e-6
"""Iteration stops after a step below this [grid points]."""

_LEAST_APART = 0.02
"""Least share of a wave's power outside of the other wave; below, both directions count as one."""

_REGULAR = 1e-9
"""Least eigenvalue of inverted matrices, relative to the number of channels."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


class Pairs(NamedTuple):
    """Two waves per cell, the stronger one first."""

    sines: _Reals  # (cell, wave, 2)
    power: _Reals  # (cell, wave), per channel
    covariance: _Reals
    """Of the sines of both, (cell, wave, 2, 2), for noise of 1 per channel; large for an unobservable one."""
    residual: _Reals  # (cell,), power over all channels


def pairs_of(waves: _Complexes, array: Array, first: _Reals) -> Pairs:
    """Best fit of two plane waves to the channels (cell, channel), from the direction `first` of the single best wave.

    The second direction starts at the largest residual. Fisher's scoring then moves both directions, with the
    amplitudes eliminated. The inverse of its matrix is the Cramer-Rao bound (Stoica and Nehorai, MUSIC, maximum
    likelihood, and Cramer-Rao bound, 1989, eq. 4.1).
    """
    sines = np.stack([first, _beside(waves, array, first)], axis=1)
    sines, step = nearest_to_front(sines, array.ambiguities), np.tile(array.step, 2)
    for _ in range(_NUM_STEPS):
        information, score, _, _ = _linearised(waves, array, sines)
        moved = np.linalg.solve(information, score[..., None])[..., 0]
        moved = np.clip(moved, -step, step)
        sines = within(sines + moved.reshape(sines.shape), 1.0)
        if not (np.abs(moved) > _SMALL_STEP * step).any():
            break
    information, _, power, residual = _linearised(waves, array, sines)
    inverse = 0.5 * np.linalg.inv(information)
    covariance = np.stack([inverse[:, :2, :2], inverse[:, 2:, 2:]], axis=1)
    cells, order = np.arange(len(waves))[:, None], (-power).argsort(axis=1)
    return Pairs(sines[cells, order], power[cells, order], covariance[cells, order], residual)


def _beside(waves: _Complexes, array: Array, known: _Reals) -> _Reals:
    """Grid sines of the second wave that explains most of the residual of a wave in a known direction, (cell, 2)."""
    number = len(array.x)
    wave = np.exp(-1j * array.phases(known))
    unexplained = waves - wave * (np.vecdot(wave, waves) / number)[:, None]
    best, largest = np.zeros_like(known), np.full(len(waves), -1.0)
    for cells, undone in blocks_of(array, len(waves)):
        common = np.abs(product(wave, undone) / number) ** 2
        power = np.abs(product(unexplained, undone)) ** 2 / np.maximum(1.0 - common, _LEAST_APART)
        power[:, np.vecdot(cells, cells) > 1.0] = 0.0
        highest = power.argmax(axis=1)
        level = power[np.arange(len(waves)), highest]
        best[level > largest] = cells[highest][level > largest]
        largest = np.maximum(largest, level)
    return best


def _linearised(waves: _Complexes, array: Array, sines: _Reals) -> tuple[_Reals, _Reals, _Reals, _Reals]:
    """Information matrix (cell, 4, 4), score (cell, 4), powers (cell, 2) and residual (cell,) of both waves."""
    number = len(array.x)
    both = np.exp(-1j * array.phases(sines)).mT  # (cell, channel, wave)
    gram = both.conj().mT @ both + _REGULAR * number * np.eye(2)
    amplitude = np.linalg.solve(gram, both.conj().mT @ waves[..., None])
    residual = waves - (both @ amplitude)[..., 0]

    # Derivatives by the sines, projected orthogonally to the amplitudes.
    slopes = np.broadcast_to(array.slopes(sines), (*sines.shape[:2], number, 2)).swapaxes(1, 2)
    slopes = (-1j * slopes * (both * amplitude.mT)[..., None]).reshape(*waves.shape, 4)
    slopes = slopes - both @ np.linalg.solve(gram, both.conj().mT @ slopes)
    information = (slopes.conj().mT @ slopes).real
    least = _REGULAR * np.trace(information, axis1=1, axis2=2)[:, None, None]
    information = information + np.diag(~np.array(2 * array.observable)) + least * np.eye(4)
    score = (slopes.conj().mT @ residual[..., None])[..., 0].real
    power = np.square(np.abs(amplitude[..., 0]))
    return information, score, power, np.square(np.abs(residual)).sum(axis=1)
