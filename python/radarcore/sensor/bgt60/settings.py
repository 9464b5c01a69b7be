"""The chip BGT60TR13C: its settings and the registers that hold them, as far as one rising or falling ramp needs.

Names of registers and fields follow the data sheet. Rounding equals the vendor's host, so equal settings give equal
registers (Strata, from parameters to registers). The clock has 80 MHz; times in registers count its cycles.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from radarcore import check
from radarcore.radar.bgt60_chip import (
    CLOCK,
    FIRST_SAMPLE,
    HIGHEST_FREQUENCY,
    LEAD,
    LONGEST_RAMP,
    LOWEST_FREQUENCY,
    MAX_CHIRPS,
    MAX_SAMPLES,
)
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.bgt60_receiver import HIGHPASS_CUTOFFS, gain_stages, highpass_index
from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60 import registers as reg
from radarcore.sensor.bgt60.registers import PLL_RANGE, image_of
from radarcore.sensor.bgt60.timing import (
    Delay,
    LimitError,
    delay_of,
    divider_of,
    frequency_of,
    out_of_range,
    pll_steps,
    rate_of,
    rest_of,
    step_of,
    text_of,
    within,
)
from radarcore.sensor.interface import check_single_ramp

ADC_DELAY = FIRST_SAMPLE / CLOCK
"""Time from the start of a chirp's band to its first sample [s]: 3.1125 us."""

NUM_RX = 3
IF_GAINS_DB = (18, 23, 28, 30, 33, 35, 38, 40, 43, 45, 48, 50, 55, 60)
"""Gains of the baseband [dB]."""
_MIN_KHZ, _MAX_KHZ = round(LOWEST_FREQUENCY / 1e3), round(HIGHEST_FREQUENCY / 1e3)
_MAX_FRAMES = 4094
MAX_SLICE_SIZE = 8192
"""Samples of a slice that leave the host half the memory's time to fetch it."""

_ALWAYS = {
    **dict.fromkeys((reg.CSI_0, reg.CSI_1, reg.CSI_2, reg.CSDS_0, reg.CSDS_1, reg.CSDS_2), 0),
    **dict.fromkeys((reg.PLL1_4, reg.PLL1_5, reg.PLL1_6, reg.RFT1, reg.SDFT0), 0),
    **dict.fromkeys((reg.CSC2, reg.CSC3, reg.CSC4), 0x000480),
    **dict.fromkeys((reg.PLL2_7, reg.PLL3_7, reg.PLL4_7), 0x000100),
    reg.PACR1: 0xE967FD,
    reg.PACR2: 0x0805B4,
    reg.CSCI: 0x000BE0,
    reg.CSCDS: 0x000B60,
    reg.CSC1: 0x000490,
    reg.CCR3: 0x787E1E,
    reg.MAIN: 0x1E8270,
}


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the chip; the defaults are those at power-up.

    Any finite numbers are taken. `registers_of` refuses what the chip cannot do, `achieved` says what it makes of the
    rest.

    Parameters
    ----------
    start_frequency, end_frequency : float
        Frequency 3.1125 us before the first sample, and one sample after the last [Hz], from 58 to 63.5 GHz. An end
        below the start is a falling ramp.
    sample_rate : float
        Sample rate of one receiver [Hz].
    num_samples : int
        Samples per chirp.
    num_chirps : int
        Chirps per frame.
    chirp_time : float
        From one chirp to the next [s].
    frame_time : float
        From one frame to the next [s].
    rx_mask : int
        Receivers in use: 1, 2 and 4 are RX1, RX2 and RX3.
    tx_power_level : int
        Power of the transmitter, from 0 to 31.
    is_transmitting : bool
        False: the transmitter is off.
    if_gain_db : int
        Gain of the baseband [dB], from 18 to 60.
    highpass_cutoff : float
        Cutoff of the baseband's high-pass [Hz]; the nearest of `HIGHPASS_CUTOFFS` is taken.
    num_frames : int
        Frames until the chip stops; 0: endless.
    has_test_pattern : bool
        True: the chip sends its test pattern in place of the samples of RX1, see `registers.test_pattern`.

    Raises
    ------
    TypeError, ValueError
        For a value that is no number, or not finite.
    """

    start_frequency: float = 58e9
    end_frequency: float = 63.5e9
    sample_rate: float = 2e6
    num_samples: int = 64
    num_chirps: int = 64
    chirp_time: float = 0.0005911249900236726
    frame_time: float = 0.07726884633302689
    rx_mask: int = 7
    tx_power_level: int = 31
    is_transmitting: bool = True
    if_gain_db: int = 23
    highpass_cutoff: float = 80e3
    num_frames: int = 0
    has_test_pattern: bool = False

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.type == "float":
                value = check.number(entry.name, value)
            elif entry.type == "int":
                value = check.count(entry.name, value, -sys.maxsize)
            else:
                value = check.flag(entry.name, value)
            object.__setattr__(self, entry.name, value)

    @property
    def rx_indices(self) -> tuple[int, ...]:
        """Receivers in use, ascending from 0."""
        return tuple(i for i in range(NUM_RX) if self.rx_mask >> i & 1)

    @property
    def frame_size(self) -> int:
        """Samples of a frame, all receivers together."""
        return len(self.rx_indices) * self.num_chirps * self.num_samples

    @classmethod
    def from_radar(
        cls,
        radar: Radar,
        *,
        tx_power_level: int = 31,
        if_gain_db: int = 23,
        highpass_cutoff: float = 80e3,
        is_transmitting: bool = True,
        has_test_pattern: bool = False,
    ) -> Settings:
        """Settings that sample the band of a radar's waveform.

        The first sample comes 3.1125 us after `start_frequency`, whatever the radar's ``adc_delay`` is: the band is
        kept, from the frequency at the first sample over ``num_samples`` samples. Where the chip's sample rate is
        another one, so is the slope.

        Parameters
        ----------
        radar : Radar
            One TX; RX at places of ``bgt60tr13c()`` (within 0.1 mm) in the order of that, or any three. The chirps
            must be evenly spaced from 0. Patterns, power and receiver are not looked at.
        tx_power_level, if_gain_db, highpass_cutoff, is_transmitting, has_test_pattern
            As in `Settings`.

        Raises
        ------
        ValueError
            For a radar that the chip cannot be; the message has the nearest that it can.
        """
        check.instance("radar", radar, Radar)
        waveform = radar.waveform
        check_single_ramp(radar)
        rate = CLOCK / divider_of(waveform.sample_rate)
        first = waveform.start_frequency + waveform.slope * waveform.adc_delay
        slope = waveform.slope * (rate / waveform.sample_rate)
        settings = cls(
            start_frequency=first - slope * ADC_DELAY,
            end_frequency=first + slope * (waveform.num_samples / rate),
            sample_rate=waveform.sample_rate,
            num_samples=waveform.num_samples,
            num_chirps=waveform.num_chirps,
            chirp_time=waveform.chirp_interval,
            frame_time=waveform.frame_interval,
            rx_mask=_rx_mask(radar),
            tx_power_level=tx_power_level,
            if_gain_db=if_gain_db,
            highpass_cutoff=highpass_cutoff,
            is_transmitting=is_transmitting,
            has_test_pattern=has_test_pattern,
        )
        # A limit of the chip is reported in the words of the radar.
        try:
            _plan(settings)
        except LimitError as error:
            raise LimitError(_NAMES_OF_RADAR.get(error.argument, error.argument), error.text) from None
        return settings

    def to_radar(self) -> Radar:
        """The radar that the chip is with these settings, antennas and receiver as in ``bgt60tr13c()``.

        For `achieved` settings it is exact: the slope follows the ramp's steps, the rate is 80 MHz / divider
        (`sample_rate` is in whole Hz).

        Raises
        ------
        ValueError
            For equal start and end, and for a sample rate or receivers that the chip does not have.
        """
        within("rx_mask", self.rx_mask, 1, 7)
        divider = divider_of(self.sample_rate)
        sweep = (FIRST_SAMPLE + divider * self.num_samples) / CLOCK
        radar = bgt60tr13c(
            start_frequency=self.start_frequency,
            slope=(self.end_frequency - self.start_frequency) / sweep,
            sample_rate=CLOCK / divider,
            num_samples=self.num_samples,
            num_chirps=self.num_chirps,
            chirp_interval=self.chirp_time,
            frame_interval=self.frame_time,
            adc_delay=ADC_DELAY,
        )
        rx, power = radar.rx[list(self.rx_indices)], radar.tx_power_dbm
        return Radar(
            radar.waveform, tx=radar.tx, rx=rx, pattern=radar.pattern, tx_power_dbm=power, receiver=radar.receiver
        )


_NAMES_OF_RADAR = {
    "start_frequency": "start_frequency (3.1125 us before the first sample)",
    "end_frequency": "slope (the ramp's end, one sample after the last)",
    "chirp_time": "chirp_interval",
    "frame_time": "frame_interval",
}


class _Plan(NamedTuple):
    """Settings in the chip's whole numbers: frequencies in steps of the PLL, times in cycles."""

    divider: int
    start: int
    step: int
    ramp_time: int  # in 8 cycles
    chirp_end: Delay
    frame_end: Delay
    chirp_time: int
    frame_time: int


def _plan(settings: Settings) -> _Plan:
    """Whole numbers of settings, or a LimitError with the nearest possible value."""
    n = settings.num_chirps
    within("num_chirps", n, 1, MAX_CHIRPS)
    within("rx_mask", settings.rx_mask, 1, 7)
    within("tx_power_level", settings.tx_power_level, 0, 31)
    within("num_frames", settings.num_frames, 0, _MAX_FRAMES)
    divider = divider_of(settings.sample_rate)
    start, step, ramp_time = _ramp(settings, divider)

    # Delays after every chirp, and after the frame.
    chirp = max(settings.num_samples * divider + 489, 8 * ramp_time + 213) + 4
    samples = f"{settings.num_samples} samples at {text_of(settings.sample_rate, 'Hz')}"
    chirp_end = delay_of(rest_of("chirp_time", settings.chirp_time, chirp, f"for {samples}"))
    chirps = n * chirp + (n - 1) * chirp_end.cycles
    interval = text_of((chirp + chirp_end.cycles) / CLOCK, "s")
    why = f"for {n} chirps every {interval}" if n > 1 else f"for a chirp of {samples}"
    frame_end = delay_of(rest_of("frame_time", settings.frame_time, chirps, why))
    chirp_time = chirp + chirp_end.cycles if n > 1 else chirp

    within("if_gain_db", settings.if_gain_db, IF_GAINS_DB[0], IF_GAINS_DB[-1], "dB")
    if settings.highpass_cutoff < 0.0:
        text = f"expected 0 Hz or more, got {text_of(settings.highpass_cutoff, 'Hz')}; the nearest is "
        raise LimitError("highpass_cutoff", text + text_of(HIGHPASS_CUTOFFS[0], "Hz"))
    return _Plan(divider, start, step, ramp_time, chirp_end, frame_end, chirp_time, chirps + frame_end.cycles)


def registers_of(settings: Settings, slice_size: int) -> dict[int, int]:
    """Registers of settings, by ascending address; MAIN without FRAME_START.

    Parameters
    ----------
    settings : Settings
    slice_size : int
        Samples after which the chip asks to be read, even; see `choose_slice_size`.

    Raises
    ------
    ValueError
        For a value beyond the chip's limits; the message has the nearest possible one.
    """
    size = check.count("slice_size", slice_size, -sys.maxsize)
    within("slice_size", size, 2, reg.FIFO_SIZE)
    if size % 2:
        raise LimitError("slice_size", f"expected an even number, got {size}; the nearest are {size - 1}, {size + 1}")
    plan = _plan(settings)
    divider = plan.divider
    rx, tx = settings.rx_mask, settings.is_transmitting
    values = {
        reg.ADC0: (0x210 if divider >= 28 else 0x010) | divider << 14,
        reg.SFCTL: (size // 2 - 1) | 1 << 13 | 1 << 20 | (reg.LFSR_EN if settings.has_test_pattern else 0),
        reg.SADC_CTRL: 0x010100 | _sadc_speed(settings.num_samples * divider),
        reg.CSU1_0: 0x100050
        | (1 if tx else 0)
        | (1 << 10 if rx & 0b101 else 0)
        | (1 << 11 if rx & 0b010 or tx else 0)
        | sum(3 << 12 + 2 * i for i in settings.rx_indices),
        reg.CSU1_1: 0x0FF400 | rx << 20 | (settings.tx_power_level if tx else 0),
        reg.CSU1_2: _baseband(settings),
        reg.CCR0: 0x11BC0E | 1 << 9,
        reg.CCR1: 10 | plan.frame_end.field,
        reg.CCR2: (settings.num_chirps - 1) << 12 | settings.num_frames,
        reg.PLL1_0: (plan.start - LEAD * plan.step) & 0xFFFFFF,
        reg.PLL1_1: plan.step & 0xFFFFFF,
        reg.PLL1_2: plan.ramp_time,
        reg.PLL1_3: settings.num_samples,
        reg.PLL1_7: 0x110 | plan.chirp_end.field,
    }
    return dict(sorted((_ALWAYS | values).items()))


def achieved(settings: Settings) -> Settings:
    """Settings as the chip realises them, in exact numbers.

    Times are whole cycles of the clock in the timers' steps: the chirp's and the frame's move by up to 6 cycles, or
    0.4 % of the delay after them. With a single chirp, `chirp_time` is its length. `end_frequency` is where the ramp's
    steps lead and may lie beyond 63.5 GHz by less than their rounding. `sample_rate` is ``80 MHz / divider`` in whole
    Hz, as the vendor's host reads it back.

    Achieved settings are realised without a change, but for times, which a host takes in float32: they can
    move by another 1e-7 of themselves.
    """
    plan = _plan(settings)
    first_gain, vga = gain_stages(settings.if_gain_db)
    return replace(
        settings,
        start_frequency=frequency_of(plan.start),
        end_frequency=frequency_of(plan.start + plan.step * (FIRST_SAMPLE + settings.num_samples * plan.divider)),
        sample_rate=rate_of(plan.divider),
        chirp_time=plan.chirp_time / CLOCK,
        frame_time=plan.frame_time / CLOCK,
        tx_power_level=settings.tx_power_level if settings.is_transmitting else 0,
        if_gain_db=first_gain + 5 * vga,
        highpass_cutoff=HIGHPASS_CUTOFFS[highpass_index(settings.highpass_cutoff)],
    )


def slice_size_of(registers: Mapping[int, int]) -> int:
    """Samples after which the chip asks to be read (SFCTL.FIFO_CREF)."""
    return 2 * ((image_of(registers)[reg.SFCTL] & 0x1FFF) + 1)


def choose_slice_size(settings: Settings) -> int:
    """Samples to read at once, so that frames and slices stay in step.

    One slice is one frame. Larger frames than `MAX_SLICE_SIZE` are cut into as few equal slices as possible. Above 200
    frames per second a slice holds several frames, down to 200 slices per second, if they fit. As slices hold pairs of
    samples, frames with an odd number of them are read by the two.

    Raises
    ------
    ValueError
        For settings beyond the chip's limits, and for odd frames of more than 4096 samples.
    """
    _plan(settings)
    frame = settings.frame_size
    pair = 2 if frame % 2 else 1
    fitting = MAX_SLICE_SIZE // (pair * frame) * pair
    if fitting:
        wanted = pair * math.ceil(1.0 / (200.0 * settings.frame_time * pair))
        return frame * min(wanted, fitting)
    if pair == 2:
        raise LimitError(
            "num_samples",
            f"expected an even number of samples in a frame of more than {MAX_SLICE_SIZE // 2}, got "
            f"{len(settings.rx_indices)} receivers x {settings.num_chirps} chirps x {settings.num_samples} samples; "
            f"take an even number of samples or chirps",
        )
    return next(size for size in range(MAX_SLICE_SIZE, 0, -2) if frame % size == 0)


def _ramp(settings: Settings, divider: int) -> tuple[int, int, int]:
    """Start frequency and step per cycle of the ramp, in steps of the PLL, and its length in 8 cycles."""
    # The ramp must end before its counter does.
    within("num_samples", settings.num_samples, 1, MAX_SAMPLES)
    length = settings.num_samples * divider + FIRST_SAMPLE
    ramp_time = -(-(length + LEAD) // 8)
    if 8 * ramp_time > LONGEST_RAMP:
        longest = LONGEST_RAMP - FIRST_SAMPLE - LEAD
        most, slowest = longest // divider, rate_of(longest // settings.num_samples)
        raise LimitError(
            "num_samples",
            f"expected 1 to {most} at {text_of(settings.sample_rate, 'Hz')} (ramps of at most 1.6383 ms), got "
            f"{settings.num_samples}; the nearest is {most}, or a sample_rate of at least {text_of(slowest, 'Hz')}",
        )

    # Frequencies, in kHz. A legal end stays legal after rounding to steps.
    start, end = (math.floor(f / 1e3 + 0.5) for f in (settings.start_frequency, settings.end_frequency))
    for name, khz, hertz in (
        ("start_frequency", start, settings.start_frequency),
        ("end_frequency", end, settings.end_frequency),
    ):
        legal = min(max(khz, _MIN_KHZ), _MAX_KHZ)
        if khz != legal and (name == "start_frequency" or step_of(start, khz, length) != step_of(start, legal, length)):
            raise LimitError(name, out_of_range(hertz, _MIN_KHZ * 1e3, _MAX_KHZ * 1e3, "Hz"))
    step = step_of(start, end, length)
    if not -PLL_RANGE <= pll_steps(start) - LEAD * step < PLL_RANGE:
        steepest = (PLL_RANGE + pll_steps(start)) // LEAD if step > 0 else -((PLL_RANGE - 1 - pll_steps(start)) // LEAD)
        nearest = text_of(round(frequency_of(pll_steps(start) + steepest * length), -3), "Hz")
        raise LimitError(
            "end_frequency",
            f"expected at {'most' if step > 0 else 'least'} {nearest} after {text_of(length / CLOCK, 's')} (the ramp "
            f"begins {text_of(LEAD / CLOCK, 's')} before start_frequency, within 56.32 to 66.56 GHz), got "
            f"{text_of(settings.end_frequency, 'Hz')}; the nearest is {nearest}, or take more samples",
        )
    return pll_steps(start), step, ramp_time


def _sadc_speed(sampling: int) -> int:
    """Averaging time of the sensor's ADC that fits into a number of cycles of sampling."""
    for least, oversampling, spread in (
        (5760, 3, 1),
        (3712, 3, 0),
        (720, 2, 1),
        (464, 2, 0),
        (360, 1, 1),
        (232, 1, 0),
        (180, 0, 1),
    ):
        if sampling >= least:
            return oversampling << 9 | spread << 11
    return 0


def _baseband(settings: Settings) -> int:
    """Filters and gains, the same for the three receivers."""
    cutoff = highpass_index(settings.highpass_cutoff)
    first, vga = gain_stages(settings.if_gain_db)
    each = cutoff | vga << 2
    return each | each << 5 | each << 10 | (7 << 20 if first == 18 else 0)


def _rx_mask(radar: Radar) -> int:
    """Receivers at the places of a radar's."""
    places = bgt60tr13c().rx
    for mask in range(1, 1 << NUM_RX):
        rows = places[[i for i in range(NUM_RX) if mask >> i & 1]]
        if rows.shape == radar.rx.shape and np.allclose(rows, radar.rx, rtol=0.0, atol=1e-4):
            return mask
    if len(radar.rx) == NUM_RX:
        return 7
    raise ValueError(
        f"rx: expected three antennas, or some of {places.tolist()} [m] in this order, got {radar.rx.tolist()}"
    )
