"""Least squares of the phase of one echo over the samples of a frame: maximum likelihood in white noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MOST_STEPS = 12
"""Gauss-Newton steps; four are usual, more where the echo interferes with its mirror image or with other echoes."""

_SMALL_STEP = 1e-6
"""Rms change of the phase [rad] after which nothing more is gained: the last step has made less of an error."""

_LARGEST_STEP = 0.7
"""Rms change of the phase [rad] up to which a step is taken in full: beyond, the phase is not linear enough."""

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Phase = Callable[[Array], Array]
"""Phase (chirp, sample) [rad] of the parameters (p,), of one channel for all or (channel, chirp, sample)."""


@dataclass(frozen=True, eq=False)
class PhaseFit:
    """Parameters and power of an echo.

    Attributes
    ----------
    parameters : (p,) float64
    power : float
        Squared magnitude of the amplitude, mean over channels and chirps; with the part of the noise that is in it.
    num_free : int
        Amplitudes that were fitted.
    echo : (channel, chirp, sample)
        The fitted samples.
    """

    parameters: Array
    power: float
    num_free: int
    echo: NDArray[Any]


def fit_phase(
    samples: NDArray[Any], phase: Phase, gradients: Array, start: Array, weights: Array, *, per_chirp: bool
) -> PhaseFit:
    """Fit ``amplitude * exp(1j * phase(parameters))``, or its real part to real samples.

    Amplitudes are free, one per channel, or per channel and chirp. From the normal equations of weighted least
    squares with the amplitudes eliminated (variable projection; Golub, Pereyra, SIAM J. Numer. Anal. 1973). Of real
    samples, twice the echo is ``a e^{j psi} + conj(a) e^{-j psi}``; the second part, the mirror image, is taken off
    with the amplitudes of the step before, which ends at the exact least squares of the real samples.

    Parameters
    ----------
    samples : (channel, chirp, sample)
    phase : function
    gradients : (p, chirp, sample) float64
        Derivatives of the phase [rad], nearly constant.
    start : (p,) float64
        Parameters within the main lobe of the echo.
    weights : (chirp, sample) float64
    per_chirp : bool
        Amplitudes are free from chirp to chirp.
    """
    # Centred gradients of a rms of 1 rad, so that parameters of different units can stand in one matrix.
    axes = (-1,) if per_chirp else (-2, -1)
    mean = (weights * gradients).sum(axis=axes, keepdims=True) / weights.sum(axis=axes, keepdims=True)
    centred = gradients - mean
    scale = np.sqrt((weights * centred**2).sum(axis=(-2, -1)) / weights.sum())
    centred /= scale[:, None, None]
    weighted = weights * centred
    curvature = np.einsum("pmn,qmn->mpq", weighted, centred)  # (chirp, p, p)

    is_real = not np.iscomplexobj(samples)
    echo = _Turned(samples, weights, per_chirp)
    parameters = np.array(start, dtype=np.float64)
    turn = _turn(phase(parameters))
    amplitude = echo.amplitude(turn, None)
    for _ in range(_MOST_STEPS):
        # The echo turned to phase 0, times its conjugate amplitude: what varies is the error of the parameters.
        amplitude = echo.amplitude(turn, amplitude)
        error = echo.product(turn, amplitude).imag
        score = np.einsum("pmn,mn->p", weighted, error)
        matrix = np.einsum("m,mpq->pq", (np.abs(amplitude) ** 2).sum(axis=1), curvature)
        try:
            step = np.linalg.solve(matrix, score)
        except np.linalg.LinAlgError:  # no echo at all
            break
        size = float(np.sqrt(np.mean(step**2)))
        parameters += step / scale * min(1.0, _LARGEST_STEP / max(size, _SMALL_STEP))
        turn = _turn(phase(parameters))
        if size <= _SMALL_STEP:
            break
    fitted = np.moveaxis(amplitude[..., None] * (turn if turn.ndim == 3 else turn[:, None]).conj(), 1, 0)
    num_free = samples.shape[0] * (samples.shape[1] if per_chirp else 1)
    power = float((np.abs(amplitude) ** 2).mean())
    return PhaseFit(parameters, power, num_free, fitted.real if is_real else fitted)


class _Turned:
    """Sums over samples that are turned by a phase, (chirp, sample) for all channels or (chirp, channel, sample)."""

    def __init__(self, samples: NDArray[Any], weights: Array, per_chirp: bool) -> None:
        self._is_real = not np.iscomplexobj(samples)
        # Twice the real samples: their echo is then the I/Q one and its conjugate.
        self._samples = np.moveaxis(samples, 0, 1).astype(np.complex128) * (2.0 if self._is_real else 1.0)
        self._weights = weights
        self._per_chirp = per_chirp

    def amplitude(self, turn: Complex, before: Complex | None) -> Complex:
        """Amplitudes (chirp, channel) by weighted means; `before`: those that make the mirror image of real samples."""
        weights = self._weights if turn.ndim == 2 else self._weights[:, None]
        weighted = weights * turn
        if turn.ndim == 2:
            sums = np.einsum("mcn,mn->mc", self._samples, weighted)
        else:
            sums = (self._samples * weighted).sum(axis=-1)
        if self._is_real and before is not None:
            sums -= before.conj() * (weighted * turn).sum(axis=-1).reshape(len(sums), -1)
        total = self._weights.sum(axis=-1, keepdims=True)
        if self._per_chirp:
            return np.asarray(sums / total)
        return np.broadcast_to(sums.sum(axis=0) / total.sum(), sums.shape)

    def product(self, turn: Complex, amplitude: Complex) -> Complex:
        """Conjugate amplitudes times turned samples without mirror images, added over channels, (chirp, sample)."""
        conjugate = amplitude.conj()
        if turn.ndim == 2:
            found = turn * np.einsum("mc,mcn->mn", conjugate, self._samples)
            mirror = turn**2 * (conjugate**2).sum(axis=1, keepdims=True)
        else:
            found = (conjugate[..., None] * self._samples * turn).sum(axis=1)
            mirror = (conjugate[..., None] ** 2 * turn**2).sum(axis=1)
        return np.asarray(found - mirror if self._is_real else found)


def _turn(phase: Array) -> Complex:
    """``exp(-1j * phase)``, with the chirps in front."""
    phase = phase if phase.ndim == 2 else phase[0] if len(phase) == 1 else np.moveaxis(phase, 0, 1)
    # Modulo one turn the phase fits into float32, whose functions are ten times faster; 1e-7 rad are at -140 dB.
    turns = phase * (0.5 / np.pi)
    reduced = ((turns - np.rint(turns)) * (2.0 * np.pi)).astype(np.float32)
    turn = np.empty(phase.shape, dtype=np.complex128)
    turn.real, turn.imag = np.cos(reduced), -np.sin(reduced)
    return turn
