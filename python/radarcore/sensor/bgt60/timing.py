"""Limits, timers, delays and frequencies as the chip counts them, rounded as the vendor's host does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from radarcore.radar.bgt60_chip import CLOCK


class LimitError(ValueError):
    """Error for a value beyond the chip's limits; argument and text are separate, as radars rename some arguments."""

    def __init__(self, argument: str, text: str) -> None:
        super().__init__(argument, text)
        self.argument = argument
        self.text = text

    def __str__(self) -> str:
        return f"{self.argument}: {self.text}"


def within(name: str, value: int, low: int, high: int, unit: str = "") -> None:
    """Refuse a value outside of its limits."""
    if not low <= value <= high:
        raise LimitError(name, out_of_range(value, low, high, unit))


def out_of_range(value: float, low: float, high: float, unit: str = "") -> str:
    """Text about a value outside of its limits."""
    nearest = text_of(low if value < low else high, unit)
    return (
        f"expected {text_of(low, unit)} to {text_of(high, unit)}, got {text_of(value, unit)}; the nearest is {nearest}"
    )


_PREFIXES = {
    "Hz": ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, "")),
    "s": ((1.0, ""), (1e-3, "m"), (1e-6, "u")),
}


def text_of(value: float, unit: str) -> str:
    """A number with its unit; times of whole cycles and whole Hz are exact."""
    if unit not in _PREFIXES:
        return f"{value} {unit}".rstrip()
    prefixes = _PREFIXES[unit]
    scale, prefix = next((pair for pair in prefixes if abs(value) >= pair[0]), prefixes[-1])
    return f"{value / scale:.12g} {prefix}{unit}"


# Limits.
_MIN_RATE, _MAX_RATE = 78201, 4_000_000  # [Hz], dividers 1023 and 20
_MAX_SCALE = 30  # of the counters of delays
_INIT = 3604 + 563  # to wake from idle
_WAKE_UP = 79883  # to wake from deep sleep, before the time from idle
# The host compares with these times of its timing model, in float32 [s].
_IDLE_TIME = float(np.float32(520875) * np.float32(1e-10))
_WAKE_TIME = float(np.float32(9985375) * np.float32(1e-10))
# Times beyond a limit by less than their own rounding to float32 are taken for it.
_TIME_ROUNDING = 2.0**-23


def timer_cycles(counter: int, scale: int) -> int:
    """Cycles that a timer of a counter and its scale takes (Strata, scaled timers)."""
    return (counter << scale + 3) + scale + 3 if counter else 1


def scaled_timer(cycles: int) -> tuple[int, int]:
    """Counter and scale of the timer that comes nearest to a number of cycles, as the vendor's host finds it."""
    if cycles < 7:
        return 0, 0
    best, error = (255, _MAX_SCALE), None
    for scale in range(_MAX_SCALE + 1):
        counter = (cycles - scale - 3 >> scale + 2) + 1 >> 1
        if counter > 255:
            continue
        e = abs(timer_cycles(counter, scale) - cycles)
        if error is not None and e > error:
            break
        best, error = (counter, scale), e
    return best


@dataclass(frozen=True)
class Delay:
    """Power mode and timer of the chip after a chirp or a frame."""

    mode: int  # 0 stays on, 1 idle, 2 deep sleep
    counter: int
    scale: int

    @property
    def field(self) -> int:
        """Bit field of PLL1_7 and of CCR1."""
        return self.mode << 9 | self.counter << 11 | self.scale << 19

    @property
    def cycles(self) -> int:
        """Cycles of the delay, waking included."""
        return timer_cycles(self.counter, self.scale) + (0, _INIT, _INIT + _WAKE_UP)[self.mode]


_LONGEST_DELAY = Delay(2, 255, _MAX_SCALE).cycles


def delay_of(rest: float) -> Delay:
    """Delay that fills `rest` [s]: the deepest sleep there is time for, and a timer (Strata, repetition times)."""
    mode = 0
    if rest >= _IDLE_TIME:
        mode, rest = 1, rest - _IDLE_TIME
        # Taken from the remaining time, as the host does.
        if rest >= _WAKE_TIME:
            mode, rest = 2, rest - _WAKE_TIME
    # The host counts in steps of 100 ps; 125 steps are one cycle; halves are rounded up.
    steps = int(rest / 1e-10)
    return Delay(mode, *scaled_timer((2 * steps + 125) // 250))


def rest_of(name: str, time: float, cycles: int, why: str) -> float:
    """Remainder of a time after a number of cycles [s], in the float32 of the host."""
    least, most = cycles / CLOCK, (cycles + _LONGEST_DELAY) / CLOCK
    if time < least * (1.0 - _TIME_ROUNDING):
        shortest = text_of(least, "s")
        text = f"expected at least {shortest} {why}, got {text_of(time, 's')}; the nearest is {shortest}"
        raise LimitError(name, text)
    if time > most * (1.0 + _TIME_ROUNDING):
        text = f"expected at most {text_of(most, 's')} (the longest timer), got {text_of(time, 's')}; the nearest is "
        raise LimitError(name, text + text_of(most, "s"))
    return max(float(np.float32(time)) - least, 0.0)


def rate_of(divider: int) -> float:
    """Sample rate of a number of cycles per sample, in the whole Hz that the vendor's host reads back."""
    return float((160_000_000 // divider + 1) // 2)


def divider_of(sample_rate: float) -> int:
    """Cycles per sample."""
    rate = math.trunc(sample_rate)
    if not _MIN_RATE <= rate <= _MAX_RATE:
        raise LimitError("sample_rate", out_of_range(sample_rate, _MIN_RATE, _MAX_RATE, "Hz"))
    return (160_000_000 // rate + 1) // 2


def step_of(start: int, end: int, length: int) -> int:
    """Step per cycle of a ramp from start to end [kHz] in `length` cycles, rounded as the host does."""
    width = pll_steps(end) - pll_steps(start)
    magnitude = (2 * abs(width) // length + 1) // 2
    return magnitude if width > 0 else -magnitude


def pll_steps(khz: int) -> int:
    """Steps of the PLL above 61.44 GHz; a step has 640 MHz / 2**20, so 1024 of them are 625 kHz."""
    return (2048 * khz + 625) // 1250 - (96 << 20)


def frequency_of(steps: int) -> float:
    """Frequency of the PLL [Hz]."""
    return 640e6 * (96 + steps / (1 << 20))
