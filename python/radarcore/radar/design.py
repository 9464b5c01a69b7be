"""Settings of a waveform from requirements: range, velocity, resolutions and rate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from radarcore import check
from radarcore.units import SPEED_OF_LIGHT

_NUM_SAMPLES, _NUM_CHIRPS = 128, 64
"""Default numbers of samples and chirps."""

_ROUNDING = 1e-9
"""Relative rounding error of a number."""

_UNITS = {
    "max_range": "m",
    "max_velocity": "m/s",
    "range_resolution": "m",
    "velocity_resolution": "m/s",
    "rate": "Hz",
}
"""Units of the requirements."""

REQUIREMENTS = tuple(_UNITS)
"""Names of the requirements."""

_LEAST = ("range_resolution", "velocity_resolution")
"""Requirements with a lower limit; the others have an upper limit."""


class RequirementError(ValueError):
    """Error for a requirement that cannot be met.

    Parameters
    ----------
    requirement : str
        Its name.
    possible : float
        Limit of the requirement.
    beside : str
        The other settings behind this limit.
    got : float
    """

    def __init__(self, requirement: str, possible: float, beside: str, got: float) -> None:
        super().__init__(requirement, possible, beside, got)
        self.requirement: str = requirement
        self.possible: float = possible

    def __str__(self) -> str:
        requirement, possible, beside, got = self.args
        is_least = requirement in _LEAST
        # Four digits, rounded to the possible side.
        step = 10.0 ** (math.floor(math.log10(possible)) - 3) if 0.0 < possible < math.inf else 1.0
        number = step * (math.ceil if is_least else math.floor)(possible / step) if possible < math.inf else possible
        side = "at least" if is_least else "at most"
        return f"{requirement}: expected {side} {number:.6g} {_UNITS[requirement]}{beside}, got {got:g}"


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a radar.

    Parameters
    ----------
    sample_rate : float
        Samples per second [Hz].
    frequencies : (float, float)
        Lowest and highest frequency from the start of a ramp to the end of its samples [Hz].
    max_samples, max_chirps : int
        Largest numbers per chirp and per frame.
    max_slope : float
        Steepest slope [Hz/s].
    slope_step : float
        Step of slopes [Hz/s]; 0: any.
    adc_delay : float
        From the start of the ramp to the first sample [s].
    idle_time : float
        From the end of the samples to the next ramp, at least [s].
    timer_rounding : (float, float)
        Rounding of times, relative and absolute [s].
    """

    sample_rate: float
    frequencies: tuple[float, float] = (0.0, math.inf)
    max_samples: int = 2**24
    max_chirps: int = 2**24
    max_slope: float = math.inf
    slope_step: float = 0.0
    adc_delay: float = 0.0
    idle_time: float = 0.0
    timer_rounding: tuple[float, float] = (0.0, 0.0)

    def longest(self, interval: float) -> float:
        """Longest that an interval can become by the rounding of timers [s]."""
        relative, absolute = self.timer_rounding
        return interval * (1.0 + relative) + absolute

    def shortened(self, interval: float) -> float:
        """Interval that does not become longer than a given one [s]."""
        relative, absolute = self.timer_rounding
        return (interval - absolute) / (1.0 + relative)


def keywords_for(
    limits: Limits,
    *,
    start_frequency: float | None = None,
    default_start: float = 60e9,
    num_samples: int | None = None,
    num_chirps: int | None = None,
    default_bandwidth: float | None = None,
    default_interval: float | None = None,
    num_tx: int = 1,
    **given: float | None,
) -> dict[str, Any]:
    """Keywords of a waveform that meets all requirements, see `Waveform.design`; a RequirementError names a conflict.

    `given` are the requirements. `default_start`, `default_bandwidth` and `default_interval`: first frequency [Hz],
    sampled band [Hz] and time from chirp to chirp [s] unless requirements determine them.
    """
    requirements = {
        name: check.positive(name, given[name], unit) for name, unit in _UNITS.items() if given.get(name) is not None
    }
    if num_samples is not None:
        num_samples = check.count("num_samples", num_samples, maximum=limits.max_samples)
    if num_chirps is not None:
        num_chirps = check.count("num_chirps", num_chirps, maximum=limits.max_chirps)
    chirp = _chirp(limits, requirements, num_samples, start_frequency, default_start, default_bandwidth)
    times = _times(limits, requirements, num_chirps, chirp, default_interval, check.count("num_tx", num_tx))
    return {"sample_rate": limits.sample_rate, "adc_delay": limits.adc_delay, **chirp, **times}


def _chirp(
    limits: Limits,
    requirements: dict[str, float],
    num_samples: int | None,
    start_frequency: float | None,
    default_start: float,
    default_bandwidth: float | None,
) -> dict[str, Any]:
    """Start, slope and number of samples of a chirp."""
    rate, (lowest, highest) = limits.sample_rate, limits.frequencies
    widest = highest - (lowest if start_frequency is None else start_frequency)
    max_range, resolution = requirements.get("max_range"), requirements.get("range_resolution")
    shared = _with(requirements, ("max_range",), limits)
    most = limits.max_samples if num_samples is None else num_samples
    usual = min(_NUM_SAMPLES, most) if num_samples is None else num_samples

    # The slope: as steep as the range allows, which makes the shortest chirps.
    if max_range is not None:
        slope = _stepped(limits, min(SPEED_OF_LIGHT * rate / (4.0 * max_range), limits.max_slope), math.floor)
        if slope <= 0.0:
            farthest = SPEED_OF_LIGHT * rate / (4.0 * limits.slope_step)
            raise RequirementError("max_range", farthest, f" at {_hertz(rate)}", max_range)
    elif resolution is not None:
        # The more samples, the less of the band is lost before the first. Steps of slopes take up to 0.1 %.
        band = SPEED_OF_LIGHT / (2.0 * resolution)
        spare = 0.999 * widest - band
        fewest = limits.adc_delay * rate * band / spare if spare > 0.0 else math.inf
        slope = _resolving(limits, resolution, math.ceil(max(usual, min(fewest, most))))
    elif default_bandwidth is not None:
        slope = _stepped(limits, default_bandwidth * rate / usual, math.floor)
    else:
        raise ValueError("range_resolution: expected it or max_range, got neither")

    # Samples: the number for the resolution, or fewer than the default if the band is too narrow.
    fitting = min(most, _fitting(limits, slope, widest))
    needed = min(usual, fitting) if resolution is None else _needed(limits, resolution, slope)
    if resolution is not None and needed > fitting:
        if max_range is None:
            slope = _stepped(limits, min(widest / (limits.adc_delay + most / rate), limits.max_slope), math.floor)
            fitting = min(most, _fitting(limits, slope, widest))
        finest = SPEED_OF_LIGHT * rate / (2.0 * slope * fitting) if fitting * slope > 0.0 else math.inf
        raise RequirementError("range_resolution", finest, shared, resolution)
    needed = max(needed, num_samples or 1)
    if needed > fitting:
        raise ValueError(f"num_samples: expected at most {fitting} in a band of {widest:g} Hz{shared}, got {needed}")
    sweep = slope * (limits.adc_delay + needed / rate)
    start = min(default_start, highest - sweep) if start_frequency is None else start_frequency
    return {"start_frequency": start, "slope": slope, "num_samples": needed}


def _resolving(limits: Limits, resolution: float, num_samples: int) -> float:
    """Least slope whose samples resolve a distance [Hz/s]; at most the steepest."""
    slope = _stepped(limits, SPEED_OF_LIGHT * limits.sample_rate / (2.0 * resolution * num_samples), math.ceil)
    return slope if slope <= limits.max_slope else _stepped(limits, limits.max_slope, math.floor)


def _needed(limits: Limits, resolution: float, slope: float) -> int:
    """Least number of samples that resolve a distance."""
    return math.ceil(SPEED_OF_LIGHT * limits.sample_rate / (2.0 * resolution * slope) * (1.0 - _ROUNDING))


def _fitting(limits: Limits, slope: float, widest: float) -> int:
    """Largest number of samples of a ramp within a band [Hz]."""
    if widest == math.inf:
        return limits.max_samples
    return max(0, math.floor(limits.sample_rate * (widest / slope - limits.adc_delay) * (1.0 + _ROUNDING)))


def _times(
    limits: Limits,
    requirements: dict[str, float],
    num_chirps: int | None,
    chirp: dict[str, Any],
    default_interval: float | None,
    num_tx: int,
) -> dict[str, Any]:
    """Number of chirps, chirp interval and frame interval."""
    sampled: float = chirp["num_samples"] / limits.sample_rate
    centre: float = chirp["start_frequency"] + chirp["slope"] * (limits.adc_delay + 0.5 * sampled)
    wavelength = SPEED_OF_LIGHT / centre
    shortest = num_tx * (limits.adc_delay + sampled + limits.idle_time)
    speed, resolution, rate = (requirements.get(name) for name in ("max_velocity", "velocity_resolution", "rate"))
    frame = math.inf if rate is None else 1.0 / rate
    beside = _with(requirements, ("range_resolution", "max_range"), limits)

    # From chirp to chirp.
    usual = _NUM_CHIRPS if num_chirps is None else num_chirps
    if speed is not None:
        longest = wavelength / (4.0 * speed)
        if longest < shortest * (1.0 - _ROUNDING):
            turns = "" if num_tx == 1 else f" and {num_tx} transmitters in turn"
            raise RequirementError("max_velocity", wavelength / (4.0 * shortest), beside + turns, speed)
        interval = limits.shortened(longest)
    elif resolution is not None:
        interval = limits.longest(wavelength / (2.0 * resolution * usual))
    else:
        interval = shortest if default_interval is None else num_tx * default_interval
    # Faster where the usual number of chirps would not fit into the frame; where that is still too slow, it is refused.
    interval = max(shortest, min(interval, limits.shortened(frame / usual)))

    # Chirps: the number for the resolution, or the default, or fewer if the frame is too short.
    least = 1 if speed is None and resolution is None else 2
    most = limits.max_chirps
    if rate is not None:
        most = min(most, math.floor(frame / limits.longest(interval) * (1.0 + _ROUNDING)))
        if most < least:
            chirps = "a single chirp" if least == 1 else "two chirps"
            raise RequirementError("rate", 1.0 / (least * limits.longest(interval)), f" for {chirps}{beside}", rate)
    needed = min(_NUM_CHIRPS, most)
    if resolution is not None:
        shortened = limits.shortened(interval)
        needed = max(least, math.ceil(wavelength / (2.0 * resolution * shortened) * (1.0 - _ROUNDING)))
        allowed = most if num_chirps is None else min(most, num_chirps)
        if needed > allowed:
            shared = _with(requirements, ("rate", "max_velocity"), limits, at_rate=False)
            chirps = "" if num_chirps is None else f" and num_chirps = {num_chirps}"
            finest = wavelength / (2.0 * allowed * shortened)
            raise RequirementError("velocity_resolution", finest, shared + chirps, resolution)
    if num_chirps is not None:
        needed = num_chirps
    if rate is not None and needed > most:
        highest = 1.0 / (needed * limits.longest(interval))
        shared = _with({"num_chirps": needed} | requirements, ("num_chirps", "range_resolution", "max_range"), limits)
        raise RequirementError("rate", highest, shared, rate)
    return {"num_chirps": needed, "chirp_interval": interval, "frame_interval": None if rate is None else frame}


def _stepped(limits: Limits, slope: float, rounding: Callable[[float], int]) -> float:
    """Slope in steps, rounded down or up."""
    if limits.slope_step == 0.0:
        return slope
    towards = _ROUNDING if rounding is math.floor else -_ROUNDING
    return float(limits.slope_step * rounding(slope / limits.slope_step + towards))


def _with(requirements: dict[str, float], names: tuple[str, ...], limits: Limits, *, at_rate: bool = True) -> str:
    """Text of the other requirements behind a limit."""
    named = [name for name in names if name in requirements]
    given = [f"{name} = {requirements[name]:g} {_UNITS.get(name, '')}".rstrip() for name in named]
    text = f" with {' and '.join(given)}" if given else ""
    return f"{text} at {_hertz(limits.sample_rate)}" if at_rate else text


def _hertz(rate: float) -> str:
    return f"{rate / 1e6:g} MHz"
