"""Filters of the baseband, and what they and the delay of echoes make of amplitudes."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

_FARTHEST_BEAT = 4.0
"""Largest beat frequency with a gain of its own [sample rates]; those beyond share that gain."""

_STEPS_PER_CORNER = 64
"""Least steps of the responses up to the high-pass: linear interpolation is then exact to 1e-4."""

_LEAST_STEPS, _MOST_STEPS = 2**11, 2**17

_CONTINUOUS_WAVE_DELAY = 1e-6
"""Longest delay of a radar without a sweep, which has no largest range [s]."""

_STRAIGHT = 0.07
"""Phase noise is proportional to the delay up to this many turns of the highest offset within the longest delay."""

_MOST_TURNS = 64.0
"""Largest number of turns of the highest offset within the longest drawn delay: 9.6 km at 2 MHz."""

_STEPS_PER_TURN = 64
"""Smallest number of steps of the responses per turn of phase noise: linear interpolation is then exact to 1e-3."""


def filter_gain(receiver: Receiver, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex gain of high-pass and low-pass at frequencies of any sign [Hz]."""
    gain = low_pass_gain(receiver, frequency)
    if receiver.high_pass is not None:
        s = 1j * np.asarray(frequency) / receiver.high_pass
        for pole in _poles(receiver.high_pass_order):
            gain = gain * (s / (s - pole))
    return gain


def low_pass_gain(receiver: Receiver, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex gain of the low-pass at frequencies of any sign [Hz]."""
    gain = np.ones(np.shape(frequency), np.complex128)
    if receiver.low_pass is not None:
        s = 1j * np.asarray(frequency) / receiver.low_pass
        for pole in _poles(receiver.low_pass_order):
            gain = gain * (-pole / (s - pole))
    return gain


def _poles(order: int) -> NDArray[np.complex128]:
    """Poles of the Butterworth filter of an order, at 1 rad/s."""
    poles: NDArray[np.complex128] = np.exp(0.5j * np.pi * (1.0 + (2.0 * np.arange(order) + 1.0) / order))
    return poles


def phase_noise_delays(receiver: Receiver, waveform: Waveform) -> NDArray[np.float64]:
    """Increasing delays at which the phase noise of echoes is drawn [s]; empty without phase noise.

    Between them and zero it follows the polynomial through them, whose variance is within 1 % of the integral of
    ``2 L(f) 4 sin^2(pi f tau)`` up to half the sample rate. Chebyshev times: polynomials of a degree above
    ``pi f tau`` follow ``exp(2j pi f tau)``. The longest delay is the delay of the largest range, at most the ramp.
    """
    if receiver.phase_noise is None:
        return np.zeros(0)
    band = 0.5 * waveform.sample_rate
    longest = _CONTINUOUS_WAVE_DELAY
    if not waveform.is_cw:
        largest_beat = (1.0 if receiver.output == "real" else 2.0) * band
        sweep = waveform.adc_delay + waveform.num_samples / waveform.sample_rate
        longest = min(largest_beat / abs(waveform.slope), max(sweep, _CONTINUOUS_WAVE_DELAY))
    turns = min(band * longest, _MOST_TURNS)
    longest = turns / band
    number = 1 if turns <= _STRAIGHT else ceil(np.pi * turns + 2.5 * turns ** (1.0 / 3.0) + 1.0)
    delays: NDArray[np.float64] = longest * np.sin(0.5 * np.pi * np.arange(1, number + 1) / number) ** 2
    return delays


def phase_noise_shares(receiver: Receiver, waveform: Waveform, delay: ArrayLike) -> NDArray[np.float64]:
    """Shares that the delays of `phase_noise_delays` have in the phase noise of echoes of other delays [s].

    Rows are the drawn delays: Lagrange polynomials in barycentric form. Echoes beyond the last delay have its noise.
    """
    nodes = np.concatenate([[0.0], phase_noise_delays(receiver, waveform)])
    if len(nodes) == 1:
        return np.zeros((0, *np.shape(delay)))
    weights = np.where(np.arange(len(nodes)) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] *= 0.5
    away = np.minimum(np.asarray(delay, np.float64), nodes[-1]) - nodes.reshape(-1, *np.ones(np.ndim(delay), int))
    terms = weights.reshape(away.shape[:1] + (1,) * (away.ndim - 1)) / np.where(away == 0.0, 1.0, away)
    is_node = (away == 0.0).any(axis=0)
    shares: NDArray[np.float64] = np.where(is_node, away == 0.0, terms / terms.sum(axis=0))[1:]
    return shares


def responses(receiver: Receiver, waveform: Waveform) -> tuple[NDArray[np.complex128], float] | None:
    """Gains of the amplitudes of echoes over the length of their paths, (1 + delay, step), and the longest length [m].

    The first row holds the filters. The others, one for every delay of `phase_noise_delays`, are those times the share
    that this delay has in the phase noise of an echo. None if there is neither.
    """
    delays = phase_noise_delays(receiver, waveform)
    if len(delays) == 0 and receiver.high_pass is None and receiver.low_pass is None:
        return None
    farthest = _FARTHEST_BEAT * waveform.sample_rate
    longest = farthest / abs(waveform.slope) if waveform.slope else _CONTINUOUS_WAVE_DELAY
    steps = _LEAST_STEPS
    least = 0.0 if receiver.high_pass is None else _STEPS_PER_CORNER * farthest / receiver.high_pass
    if len(delays) > 0:
        longest = min(longest, 8.0 * delays[-1])  # for ramps with almost no slope
        least = max(least, _STEPS_PER_TURN * 0.5 * waveform.sample_rate * longest)
    while steps < min(least, _MOST_STEPS):
        steps *= 2
    delay = np.linspace(0.0, longest, steps + 1)
    # Samples are TX times the conjugate of RX, so that of an amplitude; shares are real.
    gain = filter_gain(receiver, waveform.slope * delay).conj()
    rows = np.concatenate([gain[None], phase_noise_shares(receiver, waveform, delay) * gain])
    return rows, longest * SPEED_OF_LIGHT
