"""Numbers of the chip BGT60TR13C that its preset and its driver share: band, clock, and the times of a chirp."""

from __future__ import annotations

from radarcore import check
from radarcore.radar.design import Limits

CLOCK = 80e6
"""Frequency of the chip's clock [Hz]."""

LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 58e9, 63.5e9
"""Band of the ramps, from `FIRST_SAMPLE` cycles before the first sample to one sample after the last [Hz]."""

MAX_SAMPLES = 4095
"""Largest number of samples of a chirp."""

MAX_CHIRPS = 4096
"""Largest number of chirps of a frame."""

MIN_DIVIDER, MAX_DIVIDER = 20, 1023
"""Cycles per sample."""

FIRST_SAMPLE = 249
"""Cycles from the start of the band, when power is on, to the first sample (T_SSTART)."""

LEAD = 150
"""Cycles from the start of the ramp to the start of the band (T_PAEN - T_START)."""

LONGEST_RAMP = 8 * 0x3FFF
"""Most cycles of a ramp: RTU has 14 bits."""

PLL_STEP = 640e6 / 2**20
"""Smallest step of the frequency per cycle [Hz]."""

_STEEPEST = 8.5e14
"""Slope at which the ramp, which leads the band, begins at the lowest frequency of the PLL, 56.32 GHz [Hz/s]."""

IDLE_TIME = (624 - FIRST_SAMPLE) / CLOCK
"""Time from the samples of a chirp to the next at the soonest, the rounding of ramps to 8 cycles included [s]."""

_TIMER_ROUNDING, _TIMER_CYCLES = 0.004, 8
"""Rounding of timers: of the time they take, and cycles."""


def divider_of(sample_rate: float) -> int:
    """Cycles per sample at the sample rate of the chip next to one [Hz]."""
    rate = check.positive("sample_rate", sample_rate, "Hz")
    divider = round(CLOCK / min(max(rate, 1.0), CLOCK))
    if not MIN_DIVIDER <= divider <= MAX_DIVIDER:
        slowest, fastest = CLOCK / MAX_DIVIDER, CLOCK / MIN_DIVIDER
        raise ValueError(f"sample_rate: expected {slowest:.5g} to {fastest:g} [Hz] of a BGT60TR13C, got {rate:g}")
    return divider


def limits(divider: int) -> Limits:
    """Limits of the chip at a number of cycles per sample."""
    longest = (LONGEST_RAMP - FIRST_SAMPLE - LEAD) // divider
    return Limits(
        sample_rate=CLOCK / divider,
        frequencies=(LOWEST_FREQUENCY, HIGHEST_FREQUENCY),
        max_samples=min(MAX_SAMPLES, longest),
        max_chirps=MAX_CHIRPS,
        max_slope=_STEEPEST,
        slope_step=PLL_STEP * CLOCK,
        adc_delay=FIRST_SAMPLE / CLOCK,
        idle_time=IDLE_TIME,
        timer_rounding=(_TIMER_ROUNDING, _TIMER_CYCLES / CLOCK),
    )
