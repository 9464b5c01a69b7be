"""The transmitted waveform: a frame of linear frequency ramps, and the axes that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import isclose
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, check, notice
from radarcore.radar import design
from radarcore.records import Twinned, sealed
from radarcore.units import SPEED_OF_LIGHT

_MAX_COUNT = 2**24
"""Largest number of samples or chirps of a frame: axes of this length still fit into memory."""

_WIDEST_BAND = 0.3
"""Sampled bandwidth over centre frequency: implausible above this ratio."""

_LONGEST_CHIRP = 0.1
"""Longest plausible chirp [s]; longer ones come from a sample rate in kilohertz, for example."""

_USUAL_RATE = 40.0
"""Highest default rate of frames back to back [Hz]."""

_LONGEST_INTERVAL = 2.0
"""Longer chirp intervals are implausible, such as microseconds in place of seconds [s]; a BGT60 has up to 1 s."""


@sealed
@dataclass(kw_only=True, eq=False)
class Waveform(Twinned):
    """A frame of FMCW chirps and its sampling.

    Time ``t = 0`` of a chirp is the start of its frequency ramp; sample ``n`` is taken at
    ``adc_delay + n / sample_rate``. Chirp ``m`` starts at ``chirp_times[m]`` after the start of the frame.

    Parameters
    ----------
    start_frequency : float
        Frequency at the start of the ramp [Hz].
    slope : float
        Slope of the ramp [Hz/s]; negative for a down-chirp, 0 for a CW radar, which measures velocities alone.
    sample_rate : float
        Samples per second of one receiver [Hz].
    num_samples : int
        Samples per chirp.
    num_chirps : int
        Chirps per frame.
    chirp_interval : float, optional
        From the start of one chirp to the start of the next [s]; default: back to back.
    frame_interval : float, optional
        From the start of one frame to the start of the next [s]; default: back to back.
    adc_delay : float
        From the start of the ramp to the first sample [s].
    chirp_times : (num_chirps,) array_like, optional
        Start of every ramp after the start of the frame [s], increasing, instead of `chirp_interval`
        (staggered or interleaved chirps). `chirp_interval` is then their mean spacing.

    Raises
    ------
    ValueError
        For numbers that are not finite, not positive where they must be, frequencies outside of 100 MHz to 3 THz, or
        chirps that overlap.

    Warns
    -----
    UserWarning
        For implausible values: a sampled band wider than 30 % of its centre frequency, ramps longer than 0.1 s, or a
        chirp interval above 1 s.

    See Also
    --------
    Waveform.design : From requirements: range, velocity, resolutions, rate.
    Waveform.from_sweep : From two frequencies.
    Radar : Takes it.

    Examples
    --------
    >>> wf = rc.Waveform(start_frequency=77e9, slope=20e12, sample_rate=5e6, num_samples=256, num_chirps=64)
    >>> print(f"bins of {wf.range_resolution:.2f} m up to {wf.max_range:.1f} m of real samples")
    bins of 0.15 m up to 18.7 m of real samples
    """

    start_frequency: float
    slope: float
    sample_rate: float
    num_samples: int
    num_chirps: int = 1
    chirp_interval: float = None  # type: ignore[assignment]  # __post_init__ puts the default in
    frame_interval: float = None  # type: ignore[assignment]  # __post_init__ puts the default in
    adc_delay: float = 0.0
    chirp_times: NDArray[np.float64] = field(default=None, repr=False)  # type: ignore[arg-type]  # likewise

    def __post_init__(self) -> None:
        self.start_frequency = check.frequency("start_frequency", self.start_frequency)
        self.slope = check.number("slope", self.slope, "Hz/s")
        self.sample_rate = check.positive("sample_rate", self.sample_rate, "Hz")
        self.num_samples = check.count("num_samples", self.num_samples, maximum=_MAX_COUNT)
        self.num_chirps = check.count("num_chirps", self.num_chirps, maximum=_MAX_COUNT)
        self.adc_delay = check.non_negative("adc_delay", self.adc_delay, "s")
        sweep = check.time("adc_delay + num_samples / sample_rate", self._sweep)
        stop = self.start_frequency + self.slope * sweep
        if not 0.0 < stop <= check.HIGHEST_FREQUENCY:
            raise ValueError(
                f"slope: expected a ramp above 0 and up to {check.HIGHEST_FREQUENCY:g} Hz for {sweep:g} s (adc_delay + "
                f"samples), got {stop:g} Hz after that at {self.slope:g} Hz/s"
            )

        self.chirp_times = self._starts(sweep)
        if self.num_chirps > 1 and self.chirp_interval > _LONGEST_INTERVAL:
            notice.warn(
                f"chirp_interval: expected at most {_LONGEST_INTERVAL:g} s, got {self.chirp_interval:g} s (60 us is "
                "60e-6)"
            )
        if self.frame_interval is None:
            self.frame_interval = self._default_frame_interval
        self.frame_interval = check.time("frame_interval", check.positive("frame_interval", self.frame_interval, "s"))
        if self.bandwidth > _WIDEST_BAND * self.center_frequency:
            notice.warn(
                f"slope: expected a sampled band of at most {100.0 * _WIDEST_BAND:g} % of its centre frequency "
                f"{self.center_frequency:.4g} Hz, got {self.bandwidth:.4g} Hz (slopes are in Hz/s: 20 MHz/us is 2e13)"
            )
        if sweep > _LONGEST_CHIRP and not self.is_cw:
            notice.warn(
                f"sample_rate: expected ramps of at most {_LONGEST_CHIRP:g} s, got {sweep:.4g} s for "
                f"{self.num_samples} samples at {self.sample_rate:g} Hz (2 MHz is 2e6)"
            )

    def _starts(self, sweep: float) -> NDArray[np.float64]:
        """Start of every chirp [s]; sets `chirp_interval` where it follows from the starts."""
        if self.chirp_times is None:
            name = "chirp_interval"
            interval = sweep if self.chirp_interval is None else self.chirp_interval
            self.chirp_interval = check.time("chirp_interval", check.positive("chirp_interval", interval, "s"))
            starts = self.chirp_interval * np.arange(self.num_chirps)
        else:
            name = "chirp_times"
            starts = check.array("chirp_times", self.chirp_times, (self.num_chirps,))
            check.time("chirp_times", starts.max())
            if starts[0] < 0.0:
                raise ValueError(f"chirp_times: expected times from 0 on [s], got {starts[0]:g}")
            check.in_order("chirp_times", starts)
            spacing = (starts[-1] - starts[0]) / (self.num_chirps - 1) if self.num_chirps > 1 else sweep
            self.chirp_interval = float(spacing)
        sampled = self.adc_delay + (self.num_samples - 1) / self.sample_rate
        if self.num_chirps > 1 and np.diff(starts).min() < sampled * (1.0 - 1e-9):
            raise ValueError(
                f"{name}: expected at least {sampled:g} s between chirps (adc_delay + samples), "
                f"got {np.diff(starts).min():g} s"
            )
        return check.frozen(starts)

    @classmethod
    def from_sweep(
        cls, *, start_frequency: float, stop_frequency: float, sample_rate: float, num_samples: int, **others: Any
    ) -> Waveform:
        """Waveform whose ramp starts at `start_frequency` and samples a band as wide as to `stop_frequency` [Hz].

        ``stop_frequency = start_frequency + slope * num_samples / sample_rate``; the other keywords are as in
        `Waveform`. A stop below the start is a down-chirp. An `adc_delay` shifts the sampled band by
        ``slope * adc_delay``, its width stays.

        See Also
        --------
        Waveform.design : From requirements: range, velocity, resolutions, rate.

        Examples
        --------
        >>> wf = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=128)
        >>> print(f"{wf.bandwidth / 1e9:g} GHz in {1e6 * wf.num_samples / wf.sample_rate:g} us")
        1 GHz in 64 us
        """
        start = check.frequency("start_frequency", start_frequency)
        stop = check.frequency("stop_frequency", stop_frequency)
        if start == stop:
            raise ValueError(f"stop_frequency: expected another frequency than start_frequency, got {stop:g} Hz")
        duration = check.count("num_samples", num_samples) / check.positive("sample_rate", sample_rate, "Hz")
        return cls(
            start_frequency=start,
            slope=(stop - start) / duration,
            sample_rate=sample_rate,
            num_samples=num_samples,
            **others,
        )

    @classmethod
    def design(
        cls,
        *,
        max_range: float | None = None,
        max_velocity: float | None = None,
        range_resolution: float | None = None,
        velocity_resolution: float | None = None,
        rate: float | None = None,
        start_frequency: float = 60e9,
        sample_rate: float = 2e6,
        num_samples: int | None = None,
        num_chirps: int | None = None,
        adc_delay: float = 0.0,
        idle_time: float = 0.0,
        num_tx: int = 1,
    ) -> Waveform:
        """Waveform that meets all requirements with the steepest slope, the fewest samples and the slowest chirps.

        Parameters
        ----------
        max_range, range_resolution : float
            Least `max_range` for real samples, and largest width of a range bin [m]; at least one of them. Default: the
            range of 128 samples at the resolution, or 128 samples for the range.
        max_velocity : float, optional
            Least `max_velocity` [m/s]; default: the shortest chirp interval.
        velocity_resolution : float, optional
            Width of a velocity bin [m/s]; default: 64 chirps, or what fits into the frame.
        rate : float, optional
            Frames per second [Hz]; default: frames back to back.
        start_frequency, sample_rate, num_samples, num_chirps, adc_delay
            As in `Waveform`.
        idle_time : float
            Time from the last sample of a chirp to the next ramp, at least [s].
        num_tx : int
            Transmitters that take turns within `chirp_interval` (`Schedule.tdm`).

        Raises
        ------
        ValueError
            For conflicting requirements: the message names one and its limit.

        See Also
        --------
        bgt60tr13c : The same requirements, of a real chip.
        Waveform.from_sweep : From two frequencies.

        Examples
        --------
        >>> wf = rc.Waveform.design(max_range=8.0, range_resolution=0.1, max_velocity=4.0, rate=40.0)
        >>> print(f"{wf.num_chirps} x {wf.num_samples} samples, {wf.max_range:.1f} m, {wf.max_velocity:.1f} m/s")
        64 x 160 samples, 8.0 m, 4.0 m/s
        """
        limits = design.Limits(
            sample_rate=check.positive("sample_rate", sample_rate, "Hz"),
            adc_delay=check.non_negative("adc_delay", adc_delay, "s"),
            idle_time=check.non_negative("idle_time", idle_time, "s"),
        )
        settings = design.keywords_for(
            limits,
            max_range=max_range,
            max_velocity=max_velocity,
            range_resolution=range_resolution,
            velocity_resolution=velocity_resolution,
            rate=rate,
            start_frequency=check.frequency("start_frequency", start_frequency),
            num_samples=num_samples,
            num_chirps=num_chirps,
            num_tx=num_tx,
        )
        return cls(**settings)

    def replace(self, **changes: Any) -> Waveform:
        """Copy of the waveform with some parameters changed.

        A new number of chirps or chirp interval replaces the chirp times except the first. Chirps and frames that were
        back to back stay so.

        See Also
        --------
        bgt60tr13c : Takes the same keywords.

        Examples
        --------
        >>> wf = rc.bgt60tr13c().waveform.replace(num_chirps=32)
        >>> wf.num_chirps
        32
        """
        check.keywords("Waveform.replace", changes, (each.name for each in fields(self)))
        delay = float(self.chirp_times[0])
        back_to_back = self._default_frame_interval - delay
        if self.frame_interval == back_to_back or (delay and isclose(self.frame_interval, back_to_back)):
            changes.setdefault("frame_interval", None)
        is_gapless = self.has_uniform_chirps and isclose(self.chirp_interval, self._sweep, rel_tol=1e-12)
        if is_gapless and "chirp_times" not in changes and {"num_samples", "sample_rate", "adc_delay"} & changes.keys():
            changes.setdefault("chirp_interval", None)
        is_new = bool({"num_chirps", "chirp_interval"} & changes.keys())
        if "chirp_times" in changes or not (is_new or (self.has_uniform_chirps and delay == 0.0)):
            return replace(self, **changes)
        waveform = replace(self, **changes | {"chirp_times": None})
        return waveform.delayed(delay) if delay else waveform

    def delayed(self, delay: float) -> Waveform:
        """Waveform whose chirps start later by a time [s]: of a sub-sequence after another, see `Radar`."""
        return replace(self, chirp_times=self.chirp_times + check.non_negative("delay", delay, "s"))

    def alternating(self) -> tuple[Waveform, Waveform]:
        """Waveforms of up- and down-chirps in turn over the same band, for ``Radar(waveform.alternating())``.

        The chirps of this waveform with even numbers, and its odd chirps falling from the end of the sampled band to
        its start (rising, if this waveform falls). There is an even number of them.

        See Also
        --------
        processing.up_down_velocity : Velocity from such chirps.
        Radar : Takes both.

        Examples
        --------
        >>> up, down = rc.bgt60tr13c().waveform.alternating()
        >>> up.num_chirps, up.slope == -down.slope
        (32, True)
        """
        require_range(self)
        if self.num_chirps % 2 != 0:
            raise ValueError(f"num_chirps: expected an even number for chirps in turn, got {self.num_chirps}")
        shared: dict[str, Any] = {"num_chirps": self.num_chirps // 2, "chirp_interval": None}
        sweep = 2.0 * self.adc_delay + self.num_samples / self.sample_rate
        return (
            replace(self, **shared, chirp_times=self.chirp_times[::2]),
            replace(
                self,
                **shared,
                chirp_times=self.chirp_times[1::2],
                start_frequency=self.start_frequency + self.slope * sweep,
                slope=-self.slope,
            ),
        )

    @property
    def _sweep(self) -> float:
        """Duration of a ramp, to the end of its last sample [s]."""
        return self.adc_delay + self.num_samples / self.sample_rate

    @property
    def _default_frame_interval(self) -> float:
        return float(self.chirp_times[-1]) + max(self.chirp_interval, self._sweep)

    @cached_property
    def has_uniform_chirps(self) -> bool:
        """True when the chirps follow each other at `chirp_interval`."""
        if self.chirp_times is None:
            return True
        uniform = self.chirp_times[0] + self.chirp_interval * np.arange(self.num_chirps)
        return bool(np.abs(self.chirp_times - uniform).max() <= 1e-9 * self.chirp_interval)

    @property
    def is_cw(self) -> bool:
        """True without a ramp: velocities are measured, ranges are not."""
        return self.slope == 0.0

    @property
    def bandwidth(self) -> float:
        """Sampled bandwidth [Hz]: ``abs(slope) * num_samples / sample_rate``."""
        return abs(self.slope) * self.num_samples / self.sample_rate

    @property
    def center_frequency(self) -> float:
        """Centre of the sampled band [Hz]; its wavelength scales point targets and velocities."""
        return self.start_frequency + self.slope * (self.adc_delay + self.num_samples / (2.0 * self.sample_rate))

    @property
    def wavelength(self) -> float:
        """Wavelength at the centre of the sampled band [m]."""
        return SPEED_OF_LIGHT / self.center_frequency

    @property
    def range_resolution(self) -> float:
        """Width of a range bin [m], ``c / (2 bandwidth)``; inf for a CW radar."""
        return np.inf if self.is_cw else SPEED_OF_LIGHT / (2.0 * self.bandwidth)

    @property
    def max_range(self) -> float:
        """Largest unambiguous range [m]: ``c sample_rate / (4 abs(slope))`` of real samples, of I/Q samples twice that.

        A waveform does not know its receiver: this is the range of real samples; `Radar.max_unambiguous_range` is the
        range of the radar's own. Inf for a CW radar.
        """
        return np.inf if self.is_cw else SPEED_OF_LIGHT * self.sample_rate / (4.0 * abs(self.slope))

    @property
    def velocity_resolution(self) -> float:
        """Width of a velocity bin [m/s], ``wavelength / (2 num_chirps chirp_interval)``."""
        return self.wavelength / (2.0 * self.num_chirps * self.chirp_interval)

    @property
    def max_velocity(self) -> float:
        """Largest unambiguous velocity, towards or away [m/s]: ``wavelength / (4 chirp_interval)``."""
        return self.wavelength / (4.0 * self.chirp_interval)

    @property
    def sample_times(self) -> NDArray[np.float64]:
        """Time of every sample after the start of its ramp [s], (num_samples,); includes `adc_delay`."""
        return self.adc_delay + np.arange(self.num_samples) / self.sample_rate

    @cached_property
    def duration(self) -> float:
        """Duration from the start of the first ramp to the last sample of the last chirp [s]."""
        return float(self.chirp_times[-1] + self.sample_times[-1])

    @property
    def middle(self) -> float:
        """Time from the start of the frame to the middle between the first ramp's start and the last one's end [s]."""
        return 0.5 * (float(self.chirp_times[0]) + self.duration)

    def delay_times(self, num_nodes: int) -> NDArray[np.float64]:
        """Chebyshev times of the first kind on ``[0, duration]``, increasing [s], (num_nodes,).

        Delays given at these times to `beat_signal` are interpolated by the polynomial through them.
        """
        n = check.count("num_nodes", num_nodes)
        angles = np.pi * (2 * np.arange(n)[::-1] + 1) / (2 * n)
        times: NDArray[np.float64] = 0.5 * self.duration * (1.0 + np.cos(angles))
        return times

    def range_axis(self, num_bins: int | None = None) -> NDArray[np.float64]:
        """Range of every bin of a range transform of length `num_bins` [m], (num_bins,).

        Bin k lies at ``k c sample_rate / (2 abs(slope) num_bins)``. A real receiver has the first
        ``num_bins // 2 + 1`` of them. Default: `num_samples`. A ValueError for a CW radar.

        See Also
        --------
        range_profile : Transform that has these ranges.

        Examples
        --------
        >>> wf = rc.bgt60tr13c().waveform
        >>> wf.range_axis(256)[:3].round(3)
        array([0.   , 0.079, 0.157])
        """
        require_range(self)
        n = self.num_samples if num_bins is None else check.count("num_bins", num_bins)
        return np.arange(n, dtype=np.float64) * (SPEED_OF_LIGHT * self.sample_rate / (2.0 * abs(self.slope) * n))

    def velocity_axis(self, num_bins: int | None = None) -> NDArray[np.float64]:
        """Velocity of every bin of a Doppler transform of length `num_bins` [m/s], (num_bins,).

        Increasing, zero at index ``num_bins // 2``, receding positive. Default: `num_chirps`.

        See Also
        --------
        range_doppler : Transform that has these velocities.

        Examples
        --------
        >>> wf = rc.bgt60tr13c(num_chirps=4).waveform
        >>> wf.velocity_axis().round(2)
        array([-4.13, -2.06,  0.  ,  2.06])
        """
        n = self.num_chirps if num_bins is None else check.count("num_bins", num_bins)
        return (np.arange(n, dtype=np.float64) - n // 2) * (self.wavelength / (2.0 * n * self.chirp_interval))

    @cached_property
    def _core(self) -> _core.Waveform:
        """Counterpart in the core."""
        return _core.Waveform(
            start_frequency=self.start_frequency,
            slope=self.slope,
            sample_rate=self.sample_rate,
            adc_delay=self.adc_delay,
            num_samples=self.num_samples,
            chirp_times=self.chirp_times,
        )

    def to_dict(self) -> dict[str, Any]:
        """Parameters as plain numbers and lists, for JSON; `Waveform(**dict)` restores them."""
        names = ("start_frequency", "slope", "sample_rate", "num_samples", "num_chirps", "chirp_interval")
        values: dict[str, Any] = {name: getattr(self, name) for name in (*names, "frame_interval", "adc_delay")}
        if not (self.has_uniform_chirps and self.chirp_times[0] == 0.0):
            values["chirp_times"] = self.chirp_times.tolist()
        return values

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Waveform) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((self.start_frequency, self.slope, self.sample_rate, self.num_samples, self.num_chirps))


def require_range(waveform: Waveform) -> None:
    """Refuse a CW radar with a ValueError: its samples say nothing of range."""
    if waveform.is_cw:
        raise ValueError("waveform: expected a ramp, as a CW radar (slope = 0 Hz/s) measures no range")


def frame_rate(waveform: Waveform) -> float:
    """The radar's own frame rate [Hz]: one frame per frame interval, at most 40 Hz for frames back to back."""
    rate = 1.0 / waveform.frame_interval
    is_back_to_back = waveform.frame_interval == waveform.replace(frame_interval=None).frame_interval
    return min(rate, _USUAL_RATE) if is_back_to_back else rate
