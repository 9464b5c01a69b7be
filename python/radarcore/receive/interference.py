"""Chirps of other radars in a receiver: mixed with its own chirps, filtered, sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.waveform import Waveform
from radarcore.receive.low_pass import LowPass

_SAMPLES_AT_ONCE = 2**17
"""Samples that are worked on together: their arrays stay in cache."""

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chirps:
    """Chirps that another radar transmits, in the time of our clock.

    Attributes
    ----------
    starts : (sent,) float64
        Starts of the ramps after that of our frame [s], increasing.
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
    convention of echoes, the frequency of which sweeps with the difference of the slopes. The response of the low-pass
    filter to it is exact, for any slopes, while more than -80 dB of the strongest path pass the filter; beyond it is
    zero: transmitters that are switched on or off there make no click. Our ramps are taken to have begun before their
    start for as long as the filter settles.

    Parameters
    ----------
    chirps : Chirps
    arrivals : Arrivals
    waveform : Waveform
        Of the receiver.
    starts : (receiver, chirp) float64
        Starts of the receiver's own chirps after that of the frame [s].
    low_pass : LowPass
    strongest : float, optional
        Amplitude of the strongest path [sqrt(W)]; default: of these.

    Returns
    -------
    samples : (receiver, chirp, sample) complex128
        [sqrt(W)].
    is_hit : (receiver, chirp) bool
        True for chirps of the receiver in which the difference was within the filter's passband.
    """
    if strongest is None:
        strongest = float(np.abs(arrivals.amplitude).max(initial=0.0))
    beats = _Beats.of(chirps, arrivals, waveform, starts, low_pass, max(strongest, np.finfo(np.float64).tiny))
    samples = np.zeros((starts.size * waveform.num_samples,), dtype=np.complex128)
    is_hit = np.zeros(starts.shape, dtype=np.bool_)
    is_hit.ravel()[beats.place[beats.passes(low_pass.cutoff)]] = True

    # Which of their samples the beats reach, then these in blocks.
    rate = waveform.sample_rate
    first, last = ((time - waveform.adc_delay) * rate for time in (beats.begin, beats.end + low_pass.settling_time))
    low = np.clip(np.ceil(first), 0, waveform.num_samples).astype(np.int64)
    high = np.clip(np.floor(last) + 1, low, waveform.num_samples).astype(np.int64)
    blocks = np.cumsum(high - low) // _SAMPLES_AT_ONCE
    for block in np.split(np.arange(len(low)), np.flatnonzero(np.diff(blocks)) + 1):
        numbers = high[block] - low[block]
        beat = np.repeat(block, numbers)
        sample = np.arange(len(beat)) + np.repeat(low[block] - np.cumsum(numbers) + numbers, numbers)
        values = beats.filtered(beat, waveform.adc_delay + sample / rate, low_pass)
        np.add.at(samples, beats.place[beat] * waveform.num_samples + sample, values)
    return samples.reshape(*starts.shape, waveform.num_samples), is_hit


@dataclass(frozen=True, eq=False)
class _Beats:
    """Pairs of an own chirp and one that arrives during it: `amplitude` exp 2 pi j (c0 + c1 u + c2 u^2).

    u is the time since the start of the own chirp [s]; all arrays are (beat,).
    """

    place: NDArray[np.int64]
    """Index of receiver and chirp, receiver * num_chirps + chirp."""
    amplitude: Complex
    c0: Floats
    c1: Floats
    c2: Floats
    on: Floats
    off: Floats
    """Times from and to which the chirp is received."""
    clicks_on: NDArray[np.bool_]
    clicks_off: NDArray[np.bool_]
    """True where the difference is within the filter's band at these times."""
    begin: Floats
    end: Floats
    """Times from and to which its difference is within the filter's band, too."""

    @classmethod
    def of(
        cls,
        chirps: Chirps,
        arrivals: Arrivals,
        waveform: Waveform,
        starts: Floats,
        low_pass: LowPass,
        strongest: float,
    ) -> _Beats:
        # Chirps that arrive between the settling time before an own chirp and its last sample.
        lag = arrivals.delay + arrivals.sent_after[:, None] - starts[:, None, :]  # (receiver, path, chirp)
        last = float(waveform.sample_times[-1])
        settled = -low_pass.settling_time
        # Delays change by less than their rates times the duration of a ramp.
        slack = (np.abs(arrivals.delay_rate) * (last - settled)).ravel()
        flat = lag.ravel()
        lowest = np.searchsorted(chirps.starts, settled - chirps.duration - flat - slack, side="left")
        highest = np.searchsorted(chirps.starts, last - flat + slack, side="right")
        band = low_pass.band(np.abs(arrivals.amplitude.ravel()) / strongest)
        numbers = np.where(band > 0.0, highest - lowest, 0)
        pair = np.repeat(np.arange(len(flat)), numbers)
        sent = np.arange(len(pair)) + np.repeat(lowest - np.cumsum(numbers) + numbers, numbers)

        # Difference of the phases [turns]: own ramp minus the other one at g u - delayed.
        num_paths, num_chirps = lag.shape[1:]
        place = pair // (num_paths * num_chirps) * num_chirps + pair % num_chirps
        g, delayed = 1.0 - arrivals.delay_rate.ravel()[pair], flat[pair] + chirps.starts[sent]
        f, slope = chirps.start_frequency, chirps.slope
        c0 = (f - 0.5 * slope * delayed) * delayed - chirps.phases[sent]
        if waveform.is_cw:  # an oscillator that never starts again
            c0 += waveform.start_frequency * starts.ravel()[place]
        c1 = waveform.start_frequency - g * (f - slope * delayed)
        c2 = 0.5 * (waveform.slope - slope * g * g)

        # When the chirp is on, and when the difference is within the band of the filter.
        on, off, band = delayed / g, (delayed + chirps.duration) / g, band[pair]
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.array([-band - c1, band - c1]) / (2.0 * c2)
        always = np.where(np.abs(c1) <= band, np.inf, -np.inf)
        enter, leave = np.where(c2 == 0.0, [-always, always], np.sort(ends, axis=0))
        begin, end = np.maximum(np.maximum(on, enter), settled), np.minimum(np.minimum(off, leave), last)
        clicks_on, clicks_off = (np.abs(c1 + 2.0 * c2 * edge) < band for edge in (on, off))
        amplitude = arrivals.amplitude.ravel()[pair].conj()
        kept = begin < end
        all_of = (place, amplitude, c0 % 1.0, c1, c2, on, off, clicks_on, clicks_off, begin, end)
        return cls(*(values[kept] for values in all_of))

    def frequency(self, beat: NDArray[np.int64], times: Floats) -> Floats:
        """Difference of the frequencies [Hz] at times of some beats [s]."""
        found: Floats = self.c1[beat] + 2.0 * self.c2[beat] * times
        return found

    def passes(self, cutoff: float) -> NDArray[np.bool_]:
        """True for beats whose frequency is below a cut-off [Hz] at some time from the first sample on."""
        every = np.arange(len(self.place))
        low, high = self.frequency(every, np.maximum(self.begin, 0.0)), self.frequency(every, self.end)
        within: NDArray[np.bool_] = (np.minimum(low, high) < cutoff) & (np.maximum(low, high) > -cutoff)
        return within & (self.end > 0.0)

    def filtered(self, beat: NDArray[np.int64], times: Floats, low_pass: LowPass) -> Complex:
        """Beats behind the filter at some times [s]; `beat` has the index of each, in order."""
        # Since when the filter decays freely: from the switch-off of a chirp within the band on.
        held = np.where(self.clicks_off[beat], np.minimum(times, self.off[beat]), times)
        modes = self._modes(beat, held, low_pass)

        # What had to be there before the switch-on, and was not, decays.
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
        values: Complex = self.amplitude[beat] * modes.sum(axis=1)
        return values

    def _modes(self, beat: NDArray[np.int64], times: Floats, low_pass: LowPass) -> Complex:
        """Response of every pole at some times of beats, (time, pole), without switching."""
        turns = self.c0[beat] + (self.c1[beat] + self.c2[beat] * times) * times
        phasor = np.exp(2j * np.pi * (turns % 1.0))
        modes: Complex = low_pass.modes(self.frequency(beat, times), 2.0 * self.c2[beat]) * phasor[:, None]
        return modes
