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

_MOST_DELAYS = 8
"""Most delays, beside zero, at which phase noise is drawn."""


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
    """Increasing delays at which the phase noise of echoes is drawn [s]; between them and zero it is linear.

    One suffices where the phase noise hardly turns within the longest delay: ``sin(pi f tau)`` is then linear. Empty
    without phase noise.
    """
    if receiver.phase_noise is None:
        return np.zeros(0)
    band = 0.5 * waveform.sample_rate
    longest = (1.0 if receiver.output == "real" else 2.0) * band / abs(waveform.slope or np.inf)
    longest = longest or _CONTINUOUS_WAVE_DELAY
    number = 1
    while number < min(_MOST_DELAYS, ceil(10.0 * band * longest)):
        number *= 2
    return longest * np.arange(1, number + 1) / number


def phase_noise_shares(receiver: Receiver, waveform: Waveform, delay: ArrayLike) -> NDArray[np.float64]:
    """Shares that the delays of `phase_noise_delays` have in the phase noise of echoes of other delays [s].

    Rows are the delays that are drawn; linear between them and zero, and those of the last beyond it.
    """
    nodes = np.concatenate([[0.0], phase_noise_delays(receiver, waveform)])
    shares: NDArray[np.float64] = np.empty((len(nodes) - 1, *np.shape(delay)))
    for k in range(len(shares)):
        shares[k] = np.interp(np.asarray(delay, np.float64), nodes, np.eye(len(nodes))[k + 1])
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
    while receiver.high_pass is not None and steps < _MOST_STEPS:
        if steps * receiver.high_pass >= _STEPS_PER_CORNER * farthest:
            break
        steps *= 2
    delay = np.linspace(0.0, longest, steps + 1)
    # Samples are TX times the conjugate of RX, so that of an amplitude; shares are real.
    gain = filter_gain(receiver, waveform.slope * delay).conj()
    rows = np.concatenate([gain[None], phase_noise_shares(receiver, waveform, delay) * gain])
    return rows, longest * SPEED_OF_LIGHT
