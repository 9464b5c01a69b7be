"""Least squares of the phase of one echo over the samples of a frame: maximum likelihood in white noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.processing.estimation.bounds import beat_times
from radarcore.processing.spectra.noise import noise_level
from radarcore.processing.spectra.spectra import both_windows, fast_spectrum, powers, transformed
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

_MOST_STEPS = 12
"""Largest number of Gauss-Newton steps; four are usual, more if the echo interferes with its mirror image or others."""

_SMALL_STEP = 1e-6
"""Rms phase change of the last step [rad]; the remaining error is smaller."""

_LARGEST_STEP = 0.7
"""Largest rms phase change of a step [rad]; longer steps are shortened, because the phase is not linear enough."""

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Phase = Callable[[Array], Array]
"""Phase [rad] as a function of the parameters (p,): (chirp, sample) for all channels, or (channel, chirp, sample)."""


@dataclass(frozen=True, eq=False)
class PhaseFit:
    """Parameters and power of an echo.

    Attributes
    ----------
    parameters : (p,) float64
    power : float
        Squared magnitude of the amplitude, mean over channels and chirps, including the noise in it.
    num_free : int
        Number of fitted amplitudes.
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

    Amplitudes are free, one per channel, or per channel and chirp. The fit solves the normal equations of weighted
    least squares with the amplitudes eliminated (variable projection; Golub, Pereyra, SIAM J. Numer. Anal. 1973). In
    real samples, twice the echo is ``a e^{j psi} + conj(a) e^{-j psi}``. Each step subtracts the second part, the
    mirror image, with the previous amplitudes. This converges to the exact least squares of the real samples.

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
    # Centred gradients, scaled to an rms of 1 rad: parameters of different units share one matrix.
    axes = (-1,) if per_chirp else (-2, -1)
    mean = (weights * gradients).sum(axis=axes, keepdims=True) / weights.sum(axis=axes, keepdims=True)
    centred = gradients - mean
    scale = np.sqrt((weights * centred**2).sum(axis=(-2, -1)) / weights.sum())
    centred /= scale[:, None, None]
    weighted = weights * centred
    curvature = np.einsum("pmn,qmn->mpq", weighted, centred)  # (chirp, p, p)

    # Twice the real samples: their echo is then the I/Q echo plus its conjugate, the mirror image.
    is_real = not np.iscomplexobj(samples)
    values = np.moveaxis(samples, 0, 1).astype(np.complex128) * (2.0 if is_real else 1.0)  # (chirp, channel, sample)
    total = weights.sum(axis=1, keepdims=True)

    def amplitudes(turn: Complex, before: Complex) -> Complex:
        """Weighted means (chirp, channel) without the mirror image of the previous amplitudes."""
        turned = weights[:, None] * turn
        sums = np.einsum("mcn,mcn->mc", values, turned)
        if is_real:
            sums -= before.conj() * (turned * turn).sum(axis=-1)
        return np.asarray(sums / total) if per_chirp else np.broadcast_to(sums.sum(axis=0) / total.sum(), sums.shape)

    parameters = np.array(start, dtype=np.float64)
    turn = _turn(phase(parameters))
    amplitude = amplitudes(turn, np.zeros(values.shape[:2], np.complex128))
    for _ in range(_MOST_STEPS):
        # The echo rotated to phase 0, times its conjugate amplitude: errors of the parameters make it vary.
        amplitude = amplitudes(turn, amplitude)
        turned = amplitude.conj()[..., None] * turn
        error = (turned * (values - turned if is_real else values)).sum(axis=1).imag
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
    fitted = np.moveaxis(amplitude[..., None] * turn.conj(), 1, 0)
    num_free = samples.shape[0] * (samples.shape[1] if per_chirp else 1)
    power = float((np.abs(amplitude) ** 2).mean())
    return PhaseFit(parameters, power, num_free, fitted.real if is_real else fitted)


def _turn(phase: Array) -> Complex:
    """``exp(-1j * phase)`` with the chirps first: (chirp, channel or 1, sample)."""
    phase = phase[:, None] if phase.ndim == 2 else np.moveaxis(phase, 0, 1)
    # Modulo one turn, float32 suffices and is ten times faster; its error of 1e-7 rad is at -140 dB.
    turns = phase * (0.5 / np.pi)
    reduced = ((turns - np.rint(turns)) * (2.0 * np.pi)).astype(np.float32)
    turn = np.empty(phase.shape, dtype=np.complex128)
    turn.real, turn.imag = np.cos(reduced), -np.sin(reduced)
    return turn


_PADDING = 2
"""Cells per bin; the parabola through three cells then ends well within the main lobe."""

Limits = tuple[float, float]


def search_beat(
    frame: NDArray[Any], waveform: Waveform, ranges: Limits, fastest: float, window: Window
) -> tuple[float, float, float] | None:
    """Mean beat frequency of the strongest echo [Hz], its changes [Hz/s], or None.

    Both changes, from chirp to chirp and within a chirp, correspond to one velocity up to `fastest`. The powers of the
    chirps are added incoherently along the migration of every velocity. Limits apply to the apparent range, without
    correction for the Doppler shift.
    """
    slow, fast = beat_times(waveform)
    num_bins = _PADDING * waveform.num_samples
    bin_width = waveform.sample_rate / num_bins
    is_iq = np.iscomplexobj(frame)

    # The velocity step is one cell of migration over the frame, or one cycle of phase within a chirp.
    per_velocity = 2.0 * abs(waveform.slope) / SPEED_OF_LIGHT  # change of the beat frequency from chirp to chirp
    cells = per_velocity * np.ptp(slow) / bin_width
    cycles = 2.0 * per_velocity * np.ptp(fast) ** 2
    count = int(np.ceil(fastest * max(cells, cycles)))
    velocities = np.linspace(-fastest, fastest, 2 * count + 1) if count > 0 else np.zeros(1)

    # One transform per cycle within a chirp, usually a single one.
    rates = np.round(velocities * cycles) / max(cycles, 1e-300) if fastest * cycles > 0.5 else np.zeros(len(velocities))
    powers_of = {rate: _dechirped_power(frame, waveform, rate, window, num_bins) for rate in set(rates)}
    cell = np.arange(num_bins if is_iq else num_bins // 2 + 1)
    moved = [np.round(per_velocity * velocity * slow / bin_width).astype(np.intp) for velocity in velocities]
    sums = np.array(
        [
            np.take_along_axis(powers_of[rate], (cell + cells) % num_bins, axis=1).sum(axis=0)
            for rate, cells in zip(rates, moved, strict=True)
        ]
    )
    apparent = 0.5 * SPEED_OF_LIGHT / abs(waveform.slope) * bin_width * cell
    within = np.where((apparent >= ranges[0]) & (apparent <= ranges[1]), sums, 0.0)
    best, highest = np.unravel_index(within.argmax(), within.shape)
    if within[best, highest] == 0.0:
        return None
    offset, _ = _core.between_cells(sums[best, None], np.array([[0, highest]]), is_cyclic=is_iq)
    sign = np.sign(waveform.slope)
    change = sign * per_velocity * velocities[best]
    return float(sign * bin_width * (highest + offset[0, 1])), float(change), float(2.0 * change)


def noise_power(frame: NDArray[Any], waveform: Waveform) -> float:
    """Power of the noise per sample, from the median power of the cells of its map (Hann windows).

    Echoes fill only a few cells. Up to three chirps have no window over slow time.
    """
    fast = window_weights("window", "hann", waveform.num_samples)
    slow = window_weights("doppler_window", "hann" if waveform.num_chirps > 3 else None, waveform.num_chirps)
    windowed = frame * both_windows(fast, slow, waveform.num_chirps, frame.real.dtype)
    cells = transformed(windowed, waveform, waveform.num_samples, waveform.num_chirps)
    if not np.iscomplexobj(frame) and cells.shape[-1] > 4:
        cells = cells[..., 1:-1]  # the first and last cells of real samples are real or have twice the noise
    return noise_level(powers(cells)) / float((fast**2).sum() * (slow**2).sum())


def _dechirped_power(frame: NDArray[Any], waveform: Waveform, velocity: float, window: Window, num_bins: int) -> Array:
    """Power (chirp, cell) summed over channels, after compensation of a velocity's chirp rate."""
    fast = beat_times(waveform)[1]
    turn = np.exp(-2j * np.pi * (2.0 * waveform.slope * velocity / SPEED_OF_LIGHT) * fast**2)
    power: Array = powers(fast_spectrum(frame * turn, waveform, window=window, num_bins=num_bins)).sum(axis=0)
    return power
