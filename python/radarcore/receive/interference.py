"""Chirps of other radars in a receiver: mixed with its own chirps, filtered, sampled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.waveform import Waveform
from radarcore.receive.filters import LowPass

_SAMPLES_AT_ONCE = 2**16
"""Samples that are worked on together: their arrays stay in cache."""

_ALIKE = 1e-3
"""Difference of beat frequencies at several receivers, over the cut-off, at which they have one filter response."""

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chirps:
    """Chirps that another radar transmits, in the time of our clock.

    Attributes
    ----------
    starts : (sent,) float64
        Starts of the ramps after the start of our frame [s], increasing.
    phases : (sent,) float64
        Phase of its oscillator at these times [turns].
    start_frequency, slope : float
        [Hz], [Hz/s].
    duration : float
        Of a ramp [s]; between ramps nothing is transmitted.
    """

    starts: Floats
    phases: Floats
    start_frequency: float
    slope: float
    duration: float


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Ways of transmitted chirps to receivers, at the starts of the receiver's chirps.

    Attributes
    ----------
    delay : (receiver, path, chirp) float64
        From transmitter to receiver [s].
    delay_rate : (receiver, path, chirp) float64
        Rate of change of the delay [s/s].
    amplitude : (receiver, path, chirp) complex128
        Without the phase of propagation [sqrt(W)].
    sent_after : (path,) float64
        Time from `Chirps.starts` to the chirps of the transmitter of the path [s].
    """

    delay: Floats
    delay_rate: Floats
    amplitude: Complex
    sent_after: Floats


def beat_of_chirps(
    chirps: Chirps,
    arrivals: Arrivals,
    waveform: Waveform,
    starts: Floats,
    low_pass: LowPass,
    strongest: float | None = None,
) -> tuple[Complex, NDArray[np.bool_]]:
    """Samples of chirps of another radar that a receiver mixes with its own chirps.

    A chirp that arrives with the phase ``phi(t - tau)`` has the beat phase ``psi = phi_own(t) - phi(t - tau)`` in the
    convention of echoes. Its frequency sweeps with the difference of the slopes. The response of the low-pass filter to
    it is exact, for any slopes, while more than -80 dB of the strongest path pass the filter; beyond it is zero:
    transmitters that are switched on or off there make no click. Our ramps are taken to have begun before their start
    for as long as the filter settles. Receivers at which the beat frequencies are equal within a thousandth of the
    cut-off have one response to their mean.

    Parameters
    ----------
    chirps : Chirps
    arrivals : Arrivals
    waveform : Waveform
        Of the receivers.
    starts : (chirp,) float64
        Starts of the receivers' own chirps after the start of the frame [s].
    low_pass : LowPass
    strongest : float, optional
        Amplitude of the strongest path [sqrt(W)]; default: of these.

    Returns
    -------
    samples : (receiver, chirp, sample) complex128
        [sqrt(W)].
    is_hit : (chirp,) bool
        True for own chirps in which the difference was within the filter's passband.
    """
    magnitude = np.abs(arrivals.amplitude)
    least = max(float(magnitude.max(initial=0.0)) if strongest is None else strongest, np.finfo(np.float64).tiny)
    samples = np.zeros((len(magnitude), len(starts) * waveform.num_samples), dtype=np.complex128)
    is_hit = np.zeros(len(starts), dtype=np.bool_)
    for group in _alike(chirps, arrivals, low_pass):
        delay, rate = (values[group].mean(axis=0) for values in (arrivals.delay, arrivals.delay_rate))
        lag = delay + arrivals.sent_after[:, None] - starts  # (path, chirp)
        band = low_pass.band(magnitude[group].max(axis=0, initial=0.0) / least)
        beats = _Beats.of(chirps, lag, rate, band, waveform, starts, low_pass)
        is_hit[beats.chirp[beats.passes(low_pass.cutoff)]] = True
        for beat, sample in beats.blocks(waveform, low_pass):
            times, path, chirp = waveform.sample_times[sample], beats.path[beat], beats.chirp[beat]
            values, place = beats.filtered(beat, times, low_pass), chirp * waveform.num_samples + sample
            for receiver in group:
                # Contribution of the receiver's own delay to the phase of the mean, [turns] and [Hz].
                more, faster = (arrivals.delay[receiver] - delay), (arrivals.delay_rate[receiver] - rate)
                amplitude = arrivals.amplitude[receiver].conj()[path, chirp]
                if len(group) > 1:
                    shift = beats.arriving[beat] * more[path, chirp]
                    drift = (beats.arriving[beat] * faster[path, chirp] + chirps.slope * more[path, chirp]) * times
                    amplitude = amplitude * np.exp(2j * np.pi * ((shift + drift) % 1.0))
                np.add.at(samples[receiver], place, amplitude * values)
    return samples.reshape(len(samples), len(starts), waveform.num_samples), is_hit


def _alike(chirps: Chirps, arrivals: Arrivals, low_pass: LowPass) -> list[NDArray[np.int64]]:
    """Receivers by groups of the same filter response: all, or each alone."""
    every = np.arange(len(arrivals.delay))
    if arrivals.delay.size == 0:
        return []
    delay, rate = (float(np.ptp(values, axis=0).max()) for values in (arrivals.delay, arrivals.delay_rate))
    difference = abs(chirps.slope) * delay + chirps.start_frequency * rate
    return [every] if difference <= _ALIKE * low_pass.cutoff else list(every[:, None])


@dataclass(frozen=True, eq=False)
class _Beats:
    """Pairs of an own chirp and one that arrives during it, of phase c0 + c1 u + c2 u^2 [turns].

    u is the time since the start of the own chirp [s]; all arrays are (beat,).
    """

    path: NDArray[np.int64]
    chirp: NDArray[np.int64]
    """Indices of the path and of the own chirp."""
    arriving: Floats
    """Frequency with which the chirp arrives at u = 0 [Hz]: a longer delay turns the beat by it."""
    c0: Floats
    c1: Floats
    c2: Floats
    on: Floats
    off: Floats
    """Times from and to which the chirp is received."""
    clicks_on: NDArray[np.bool_]
    clicks_off: NDArray[np.bool_]
    """True where the difference is within the band of interest at these times."""
    begin: Floats
    end: Floats
    """Times from and to which the chirp is received with a difference within that band."""

    @classmethod
    def of(
        cls,
        chirps: Chirps,
        lag: Floats,
        delay_rate: Floats,
        band: Floats,
        waveform: Waveform,
        starts: Floats,
        low_pass: LowPass,
    ) -> _Beats:
        """Beats of paths whose chirps arrive `lag` [s] after `Chirps.starts`, in the time of each own chirp.

        `band`: largest difference of frequencies of interest [Hz]. All three are (path, chirp).
        """
        # Chirps that arrive between the settling time before an own chirp and its last sample.
        last, settled = float(waveform.sample_times[-1]), -low_pass.settling_time
        # Delays change by less than their rates times the duration of a ramp.
        slack = (np.abs(delay_rate) * (last - settled)).ravel()
        flat = lag.ravel()
        lowest = np.searchsorted(chirps.starts, settled - chirps.duration - flat - slack, side="left")
        highest = np.searchsorted(chirps.starts, last - flat + slack, side="right")
        pair, sent = _ranges(lowest, np.where(band.ravel() > 0.0, highest, lowest))

        # Difference of the phases [turns]: own ramp minus the other one at g u - delayed.
        path, chirp = np.divmod(pair, len(starts))
        g, delayed = 1.0 - delay_rate.ravel()[pair], flat[pair] + chirps.starts[sent]
        f, slope = chirps.start_frequency, chirps.slope
        c0 = (f - 0.5 * slope * delayed) * delayed - chirps.phases[sent]
        if waveform.is_cw:  # an oscillator that never starts again
            c0 += waveform.start_frequency * starts[chirp]
        arriving = f - slope * delayed
        c1 = waveform.start_frequency - g * arriving
        c2 = 0.5 * (waveform.slope - slope * g * g)

        # When the chirp is on, and when the difference is within the band.
        on, off, within = delayed / g, (delayed + chirps.duration) / g, band.ravel()[pair]
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.array([-within - c1, within - c1]) / (2.0 * c2)
        always = np.where(np.abs(c1) <= within, np.inf, -np.inf)
        enter, leave = np.where(c2 == 0.0, [-always, always], np.sort(ends, axis=0))
        begin, end = np.maximum(np.maximum(on, enter), settled), np.minimum(np.minimum(off, leave), last)
        clicks_on, clicks_off = (np.abs(c1 + 2.0 * c2 * edge) < within for edge in (on, off))
        kept = begin < end
        all_of = (path, chirp, arriving, c0 % 1.0, c1, c2, on, off, clicks_on, clicks_off, begin, end)
        return cls(*(values[kept] for values in all_of))

    def passes(self, cutoff: float) -> NDArray[np.bool_]:
        """True for beats whose frequency is below a cut-off [Hz] at some time from the first sample on."""
        low, high = (self.c1 + 2.0 * self.c2 * times for times in (np.maximum(self.begin, 0.0), self.end))
        within: NDArray[np.bool_] = (np.minimum(low, high) < cutoff) & (np.maximum(low, high) > -cutoff)
        return within & (self.end > 0.0)

    def blocks(self, waveform: Waveform, low_pass: LowPass) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Indices of beats and of the samples that they reach, ringing included, in blocks of some samples."""
        first, last = (
            (time - waveform.adc_delay) * waveform.sample_rate
            for time in (self.begin, self.end + low_pass.settling_time)
        )
        low = np.clip(np.ceil(first), 0, waveform.num_samples).astype(np.int64)
        high = np.clip(np.floor(last) + 1, low, waveform.num_samples).astype(np.int64)
        ends = np.cumsum(high - low) // _SAMPLES_AT_ONCE
        for block in np.split(np.arange(len(low)), np.flatnonzero(np.diff(ends)) + 1):
            beat, sample = _ranges(low[block], high[block])
            yield block[beat], sample

    def filtered(self, beat: NDArray[np.int64], times: Floats, low_pass: LowPass) -> Complex:
        """Beats behind the filter at some times [s]; `beat` has the index of each, in order."""
        # Since when the filter decays freely: from the switch-off of a chirp within the band on.
        held = np.where(self.clicks_off[beat], np.minimum(times, self.off[beat]), times)
        modes = self._modes(beat, held, low_pass)

        # The missing signal before the switch-on decays.
        clicks = self.clicks_on[beat] & (times - self.on[beat] < low_pass.settling_time)
        if clicks.any():
            some = beat[clicks]
            first = np.flatnonzero(np.diff(some, prepend=-1))
            at_start = self._modes(some[first], self.on[some[first]], low_pass)
            since = (held[clicks] - self.on[some])[:, None]
            row = np.cumsum(np.diff(some, prepend=some[:1]) > 0)
            modes[clicks] -= at_start[row] * np.exp(low_pass.poles * since)
        decays = times > held
        modes[decays] *= np.exp(low_pass.poles * (times - held)[decays, None])
        values: Complex = modes.sum(axis=1)
        return values

    def _modes(self, beat: NDArray[np.int64], times: Floats, low_pass: LowPass) -> Complex:
        """Response of every pole at some times of beats, (time, pole), without switching."""
        turns = self.c0[beat] + (self.c1[beat] + self.c2[beat] * times) * times
        phasor = np.exp(2j * np.pi * (turns % 1.0))
        frequency, slope = self.c1[beat] + 2.0 * self.c2[beat] * times, 2.0 * self.c2[beat]
        modes: Complex = low_pass.modes(frequency, slope) * phasor[:, None]
        return modes


def _ranges(low: NDArray[np.int64], high: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of ranges and the numbers in them, from `low` to below `high`, one after another."""
    numbers = high - low
    index = np.repeat(np.arange(len(low)), numbers)
    return index, np.arange(len(index)) + np.repeat(low - np.cumsum(numbers) + numbers, numbers)
