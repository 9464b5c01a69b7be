"""Least squares of the phase of one echo over the samples of a frame: maximum likelihood in white noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.detection.peaks import between_cells, local_maxima, parabolic_peak
from radarcore.processing.estimation.bounds import beat_times, carrier
from radarcore.processing.spectra.spectra import fast_spectrum, spectrum
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

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


_PADDING = 2
"""Cells per bin; a parabola through three of them ends well within the main lobe."""

Limits = tuple[float, float]


def search_doppler(
    frame: NDArray[Any], waveform: Waveform, ranges: Limits, velocities: Limits, window: Window, doppler_window: Window
) -> tuple[float, float] | None:
    """Range at the middle of the frame [m] and velocity [m/s] of the strongest local maximum within limits, or None."""
    num_range, num_velocity = _PADDING * waveform.num_samples, _PADDING * waveform.num_chirps
    transformed = spectrum(
        frame,
        waveform,
        window=window,
        doppler_window=doppler_window,
        num_range_bins=num_range,
        num_velocity_bins=num_velocity,
    )
    power = _power(transformed).sum(axis=0)  # (doppler, range)
    is_iq = np.iscomplexobj(frame)
    is_peak = local_maxima(power, is_iq=is_iq)

    def measure(row: Any, column: Any) -> tuple[Any, Any]:
        # beat = slope delay + doppler, with the Doppler frequency at the middle of the chirp, as in eq. (1).
        beat = np.sign(waveform.slope) * column * (waveform.sample_rate / num_range)
        doppler = (row - num_velocity // 2) / (num_velocity * waveform.chirp_interval)
        shift = beat - doppler
        velocity = 0.5 * SPEED_OF_LIGHT * doppler / (carrier(waveform) - shift)
        return 0.5 * SPEED_OF_LIGHT * shift / waveform.slope, velocity

    rows, columns = np.ogrid[: power.shape[0], : power.shape[1]]
    distance, velocity = measure(rows, columns)
    is_peak &= (distance >= ranges[0]) & (distance <= ranges[1])
    is_peak &= (velocity >= velocities[0]) & (velocity <= velocities[1])
    if not is_peak.any():
        return None
    row, column = map(int, np.unravel_index(np.argmax(np.where(is_peak, power, -1.0)), power.shape))
    (row_offset, column_offset), _ = between_cells(power, row, column, is_iq=is_iq)
    found = measure(row + row_offset, column + column_offset)
    return float(found[0]), float(found[1])


def search_beat(
    frame: NDArray[Any], waveform: Waveform, ranges: Limits, fastest: float, window: Window
) -> tuple[float, float, float] | None:
    """Mean beat frequency of the strongest echo [Hz], its changes [Hz/s], or None.

    The changes, from chirp to chirp and within a chirp, are those of one velocity up to `fastest`. Powers of chirps are
    added along the migration of every velocity, whatever their phases. Limits are of the range that the beat frequency
    alone tells.
    """
    slow, fast = beat_times(waveform)
    num_bins = _PADDING * waveform.num_samples
    bin_width = waveform.sample_rate / num_bins
    is_iq = np.iscomplexobj(frame)

    # Velocities apart by one cell of migration over the frame, or by one cycle of the phase within a chirp.
    per_velocity = 2.0 * abs(waveform.slope) / SPEED_OF_LIGHT  # change of the beat frequency from chirp to chirp
    cells = per_velocity * np.ptp(slow) / bin_width
    cycles = 2.0 * per_velocity * np.ptp(fast) ** 2
    count = int(np.ceil(fastest * max(cells, cycles)))
    velocities = np.linspace(-fastest, fastest, 2 * count + 1) if count > 0 else np.zeros(1)

    # One transform per cycle within a chirp: mostly one in all.
    rates = np.round(velocities * cycles) / max(cycles, 1e-300) if fastest * cycles > 0.5 else np.zeros(len(velocities))
    best: tuple[float, Array, float] | None = None
    cell = np.arange(num_bins if is_iq else num_bins // 2 + 1)
    apparent = 0.5 * SPEED_OF_LIGHT / abs(waveform.slope) * bin_width * cell
    within = (apparent >= ranges[0]) & (apparent <= ranges[1])
    if not within.any():
        return None
    for rate in np.unique(rates):
        power = _dechirped_power(frame, waveform, rate, window, num_bins)  # (chirp, cell)
        for velocity in velocities[rates == rate]:
            moved = np.round(per_velocity * velocity * slow / bin_width).astype(np.intp)  # (chirp, 1)
            summed = np.take_along_axis(power, (cell + moved) % num_bins, axis=1).sum(axis=0)
            highest = float(summed[within].max())
            if highest > 0.0 and (best is None or highest > best[0]):
                best = highest, summed, float(velocity)
    if best is None:
        return None

    # A parabola through the cells about the highest one.
    _, summed, velocity = best
    k = int(np.argmax(np.where(within, summed, -1.0)))
    below, above = summed[(k - 1) % len(summed) if is_iq else abs(k - 1)], summed[(k + 1) % len(summed)]
    level = np.log(np.maximum([below, summed[k], above], 1e-30 * summed[k]))
    sign = np.sign(waveform.slope)
    frequency = sign * bin_width * (k + parabolic_peak(*level)[0])
    change = sign * per_velocity * velocity
    return float(frequency), float(change), float(2.0 * change)


def noise_power(frame: NDArray[Any], waveform: Waveform) -> float:
    """Power of the noise per sample, from the median power of all cells of the range-Doppler map (Hann windows).

    Echoes are in a few cells. The power of noise is exponentially distributed: its median is ``ln 2`` of its mean.
    """
    profile: NDArray[Any] = fast_spectrum(frame, waveform, window="hann", num_bins=None)
    weights = window_weights("window", "hann", waveform.num_samples)
    gain = float((weights**2).sum())
    if waveform.num_chirps > 3:
        slow_weights = window_weights("doppler_window", "hann", waveform.num_chirps)
        profile = np.fft.fft(profile * slow_weights[:, None], axis=-2)
        gain *= float((slow_weights**2).sum())
    if not np.iscomplexobj(frame) and profile.shape[-1] > 4:
        profile = profile[..., 1:-1]  # the first and last cell of real samples are real, or have twice the noise
    median = float(np.median(_power(profile)))
    return median / (gain * float(np.log(2.0)))


def _dechirped_power(frame: NDArray[Any], waveform: Waveform, velocity: float, window: Window, num_bins: int) -> Array:
    """Power (chirp, cell) over channels, without the change of the frequency within a chirp of a velocity."""
    if velocity == 0.0:
        power: Array = _power(fast_spectrum(frame, waveform, window=window, num_bins=num_bins)).sum(axis=0)
        if np.iscomplexobj(frame):
            return power
        both: Array = np.concatenate([power, power[:, -2:0:-1]], axis=1)  # of negative frequencies
        return both
    fast = beat_times(waveform)[1]
    turn = np.exp(-2j * np.pi * (2.0 * waveform.slope * velocity / SPEED_OF_LIGHT) * fast**2)
    dechirped: Array = _power(fast_spectrum(frame * turn, waveform, window=window, num_bins=num_bins)).sum(axis=0)
    return dechirped


def _power(values: NDArray[Any]) -> Array:
    return np.asarray(np.square(values.real, dtype=np.float64) + np.square(values.imag, dtype=np.float64))
