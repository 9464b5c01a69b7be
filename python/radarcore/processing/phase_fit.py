"""Least squares of the phase of one echo over the samples of a frame: maximum likelihood in white noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MOST_STEPS = 30
"""Gauss-Newton steps; five are usual, more where real samples interfere with their mirror image."""

_SMALL_STEP = 1e-7
"""Rms change of the phase [rad] after which nothing more is gained: noise at 100 dB is larger."""

_LARGEST_STEP = 0.7
"""Rms change of the phase [rad] up to which a step is taken in full: beyond, the phase is not linear enough."""

Array = NDArray[np.float64]
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
    total = weights.sum(axis=axes)
    mean = (weights * gradients).sum(axis=axes) / total
    centred = gradients - np.expand_dims(mean, axes)
    scale = np.sqrt((weights * centred**2).sum(axis=(-2, -1)) / weights.sum())
    centred /= scale[:, None, None]
    weighted = weights * centred
    curvature = np.einsum("pmn,qmn->mpq", weighted, centred)  # (chirp, p, p)

    is_real = not np.iscomplexobj(samples)
    parameters = np.array(start, dtype=np.float64)
    turn = np.exp(-1j * phase(parameters))
    amplitude: NDArray[np.complex128] | None = None
    power = np.zeros(1)
    for _ in range(_MOST_STEPS):
        # Turn the echo to phase 0: what is left varies by the error of the parameters.
        turned = samples * turn
        if is_real:
            turned *= 2.0
            if amplitude is not None:
                turned -= amplitude.conj() * turn**2
        found = (weights * turned).sum(axis=axes) / total  # (channel,) or (channel, chirp)
        has_mirror = not is_real or amplitude is not None
        amplitude = np.expand_dims(found, axes)
        power = np.abs(amplitude) ** 2
        if not has_mirror:
            continue  # the first step of real samples only finds the amplitudes

        # One Gauss-Newton step.
        score = np.einsum("pmn,kmn->p", weighted, (amplitude.conj() * turned).imag)
        per_chirp_power = np.broadcast_to(power[..., 0], turned.shape[:2]).sum(axis=0)
        matrix = np.einsum("m,mpq->pq", per_chirp_power, curvature)
        try:
            step = np.linalg.solve(matrix, score)
        except np.linalg.LinAlgError:  # no echo at all
            break
        size = float(np.sqrt(np.mean(step**2)))
        parameters += step / scale * min(1.0, _LARGEST_STEP / max(size, _SMALL_STEP))
        turn = np.exp(-1j * phase(parameters))
        if size <= _SMALL_STEP:
            break
    num_free = samples.shape[0] * (samples.shape[1] if per_chirp else 1)
    assert amplitude is not None  # the loop has run
    echo = amplitude * turn.conj()
    return PhaseFit(parameters, float(power.mean()), num_free, echo.real if is_real else echo)
