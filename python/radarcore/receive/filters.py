"""Filters of the baseband: their effect on the amplitudes of delayed echoes, and their exact response to chirps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.radar.radar import Radar
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


def filter_gain(receiver: Receiver, frequency: ArrayLike) -> NDArray[np.complex128]:
    """Complex gain of high-pass and low-pass at frequencies of any sign [Hz]."""
    gain = low_pass_gain(receiver, frequency)
    if receiver.high_pass is not None:
        s = 1j * np.asarray(frequency) / receiver.high_pass
        for pole in _poles(receiver.high_pass_order):
            gain = gain * (s / (s - pole))
    return gain


def low_pass_gain(receiver: Receiver, frequency: ArrayLike) -> NDArray[np.complex128]:
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
    # Samples are TX times the conjugate of RX, hence the conjugate of an amplitude; shares are real.
    gain = filter_gain(receiver, waveform.slope * delay).conj()
    rows = np.concatenate([gain[None], phase_noise_shares(receiver, waveform, delay) * gain])
    return rows, longest * SPEED_OF_LIGHT


_SETTLED = 1e-4
"""Gain below which frequencies, and what is left after the settling time, are nothing beside the passband."""

_FAR = 50.0
"""Squared argument of w above which five terms of its series are exact to 1e-7."""

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LowPass:
    """Butterworth low-pass filter in front of the ADC, of either part of the beat signal.

    Parameters
    ----------
    cutoff : float
        Frequency of half the power [Hz].
    order : int
        Number of poles, 1 to 16: partial fractions of higher ones cancel each other.
    """

    cutoff: float
    order: int = 4

    @cached_property
    def poles(self) -> Complex:
        """Poles in the left half plane [rad/s], (pole,)."""
        angles = np.pi * (2.0 * np.arange(self.order) + self.order + 1.0) / (2.0 * self.order)
        poles: Complex = 2.0 * np.pi * self.cutoff * np.exp(1j * angles)
        return poles

    @cached_property
    def residues(self) -> Complex:
        """Residues of the transfer function at the poles [rad/s], (pole,); its gain at 0 Hz is 1."""
        rate = 2.0 * np.pi * self.cutoff
        apart = (self.poles[:, None] - self.poles) / rate + np.eye(self.order)
        residues: Complex = rate / apart.prod(axis=1)
        return residues

    def band(self, amplitude: Floats) -> Floats:
        """Frequencies [Hz] above which amplitudes are below -80 dB of 1; zero if they already were."""
        attenuation = np.maximum(amplitude / _SETTLED, 1.0)
        band: Floats = self.cutoff * (attenuation**2 - 1.0) ** (0.5 / self.order)
        return band

    @cached_property
    def settling_time(self) -> float:
        """Time [s] after which -80 dB are left of what was."""
        return log(_SETTLED) / float(self.poles.real.max())

    def modes(self, frequency: Floats, slope: Floats) -> Complex:
        """Response of every pole to a chirp, where its frequency is `frequency` [Hz], relative to the chirp.

        The chirp ``exp j psi(u)`` has a quadratic phase, and has been on for as long as the filter remembers. A pole p
        holds ``y' = p y + exp j psi``. With ``q = -p u + j psi``, whose derivatives are ``q'`` and the constant
        ``b = 2 pi j slope``, ``y = F exp j psi`` solves that if ``F' + q' F = 1``. The solution without anything from
        before the chirp came by has the Faddeeva function w (Abramowitz, Stegun, eqs. 7.1.3 and 7.1.20):
        ``F = -+ sqrt(pi / (2 b)) / j w(-+ q' / sqrt(2 b))``, with the upper sign for rising chirps. The free decay of
        the filter after a fast chirp is part of it.

        Parameters
        ----------
        frequency, slope : (n,) float64
            [Hz], [Hz/s].

        Returns
        -------
        modes : (n, pole) complex128
            Their sum is the response of the filter; the gain, if the slope is zero.
        """
        rate = 2j * np.pi * frequency[:, None] - self.poles  # q'
        inverse = 1.0 / rate
        b = 2j * np.pi * slope[:, None]

        # Far from the pole the asymptotic series of w, a tone's response 1 / q' first. Free decay is beyond it.
        ratio = b * inverse**2
        modes: Complex = inverse * (1.0 + ratio * (1.0 + ratio * (3.0 + ratio * (15.0 + 105.0 * ratio))))
        passed = np.sign(slope[:, None]) * rate.imag
        decay = rate.real * passed / np.maximum(np.abs(b), np.finfo(np.float64).tiny)
        is_near = (np.abs(ratio) * 2.0 * _FAR > 1.0) | ((passed > 0.0) & (decay < -log(_SETTLED)))
        if is_near.any():
            from scipy.special import wofz  # takes longer to load than the rest

            rows, _ = np.nonzero(is_near)
            sign, root = -np.sign(slope)[rows], np.sqrt(4j * np.pi * slope)[rows]
            modes[is_near] = sign * np.sqrt(np.pi) / (1j * root) * wofz(sign * rate[is_near] / root)
        return self.residues * modes


def low_pass_of(radar: Radar) -> LowPass:
    """Low-pass of the radar's receiver; one at half the sample rate for a receiver that has no filter set."""
    receiver = radar.receiver
    if receiver is None or receiver.low_pass is None:
        return LowPass(0.5 * radar.waveform.sample_rate)
    return LowPass(receiver.low_pass, receiver.low_pass_order)
