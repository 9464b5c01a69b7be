"""The chip BGT60TR13C: its settings and the registers that hold them, as far as one rising or falling ramp needs.

Names of registers and fields are those of the data sheet. All rounding is that of the vendor's host, so that the
registers of the same settings are the same (Strata, from parameters to registers). The clock has 80 MHz; times in
registers count its cycles.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from radarcore import check
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar

CLOCK = 80e6
"""Frequency of the chip's clock [Hz]."""

ADC_DELAY = 249 / CLOCK
"""From the start of a chirp's band to its first sample [s]: 3.1125 us."""

FIFO_SIZE = 16384
"""Samples that the chip's memory holds."""

MAX_SLICE_SIZE = 8192
"""Samples of a slice that leave the host half the memory's time to fetch it."""

# Addresses.
MAIN, ADC0, CHIP_ID, STAT1, PACR1, PACR2, SFCTL, SADC_CTRL = range(0x08)
CSI_0, CSI_1, CSI_2, CSCI, CSDS_0, CSDS_1, CSDS_2, CSCDS, CSU1_0, CSU1_1, CSU1_2 = range(0x08, 0x13)
CSC1, CSC2, CSC3, CSC4 = 0x16, 0x1D, 0x24, 0x2B
CCR0, CCR1, CCR2, CCR3 = range(0x2C, 0x30)
PLL1_0, PLL1_1, PLL1_2, PLL1_3, PLL1_4, PLL1_5, PLL1_6, PLL1_7 = range(0x30, 0x38)
PLL2_7, PLL3_7, PLL4_7 = 0x3F, 0x47, 0x4F
RFT0, RFT1, DFT0, SDFT0 = 0x55, 0x56, 0x57, 0x5B
STAT0, SADC_RESULT, FSTAT = 0x5D, 0x5E, 0x5F
FIFO = 0x60
"""Where a burst reads samples; not a register."""

# Bits of MAIN that act once and read as zero.
FRAME_START, SW_RESET, FSM_RESET, FIFO_RESET = 1 << 0, 1 << 1, 1 << 2, 1 << 3

RESET_VALUES: dict[int, int] = dict.fromkeys(range(FIFO), 0) | {
    MAIN: 0x1E0000,
    ADC0: 0x0A2240,
    CHIP_ID: 0x000303,
    PACR1: 0x196524,
    PACR2: 0x040014,
    SFCTL: 0x710000,
    CSCI: 0x000B60,
    CSCDS: 0x000B60,
    CSC1: 0x000B60,
    CSC2: 0x000B60,
    CSC3: 0x000B60,
    CSC4: 0x000B60,
    RFT0: 0x001F40,
    RFT1: 0x060000,
    DFT0: 0x000200,
    STAT0: 0x0000A8,
    FSTAT: 0x100000,
}
"""All registers after a reset."""

CHIP_NAMES: dict[tuple[int, int], str] = {
    (3, 3): "BGT60TR13C",
    (5, 4): "BGT60ATR24C",
    (5, 5): "BGT24LTR24",
    (6, 6): "BGT60UTR13DAIP",
    (6, 11): "BGT60UTR13DAIP",
    (7, 7): "BGT60UTR11AIP",
    (7, 9): "BGT60UTR11AIP",
    (7, 12): "BGT60UTR11AIP",
    (8, 8): "BGT60TR12E",
    (8, 10): "BGT120UTR13E",
    (8, 12): "BGT60UTR11AIP",
    (9, 15): "BGT60ATR24EAIP",
    (9, 16): "BGT24LTR13E",
    (10, 13): "BGT120UTR24",
    (10, 14): "BGT120UTR24",
}
"""Chips by (digital id, RF id)."""

NUM_RX = 3
IF_GAINS_DB = (18, 23, 28, 30, 33, 35, 38, 40, 43, 45, 48, 50, 55, 60)
"""Gains of the baseband [dB]."""
HIGHPASS_CUTOFFS = (20e3, 45e3, 70e3, 80e3)
"""Cutoffs of the high-pass filter [Hz], in the order of HPF_SEL."""

# Limits.
_MIN_RATE, _MAX_RATE = 78201, 4_000_000  # [Hz], dividers 1023 and 20
_MIN_DIVIDER = 20
_MIN_KHZ, _MAX_KHZ = 58_000_000, 63_500_000
_MAX_SAMPLES = 4095
_MAX_CHIRPS = 4096
_MAX_FRAMES = 4094
_MAX_RAMP = 8 * 0x3FFF  # cycles; RTU has 14 bits
_MAX_SCALE = 30  # of the counters of delays
_PLL_RANGE = 1 << 23  # frequencies are signed, 24 bits

# Timing that is always the same, in cycles.
_FIRST_SAMPLE = 249  # after power is on, T_SSTART
_LEAD = 150  # the ramp starts that long before power is on, T_PAEN - T_START
_INIT = 3604 + 563  # to wake from idle
_WAKE_UP = 79883  # to wake from deep sleep, before the time from idle
# The host compares with these times of its timing model, in float32 [s].
_IDLE_TIME = float(np.float32(520875) * np.float32(1e-10))
_WAKE_TIME = float(np.float32(9985375) * np.float32(1e-10))
# Times beyond a limit by less than their own rounding to float32 are taken for it.
_TIME_ROUNDING = 2.0**-23

_ALWAYS = {
    PACR1: 0xE967FD,
    PACR2: 0x0805B4,
    CSI_0: 0,
    CSI_1: 0,
    CSI_2: 0,
    CSCI: 0x000BE0,
    CSDS_0: 0,
    CSDS_1: 0,
    CSDS_2: 0,
    CSCDS: 0x000B60,
    CSC1: 0x000490,
    CSC2: 0x000480,
    CSC3: 0x000480,
    CSC4: 0x000480,
    CCR3: 0x787E1E,
    PLL1_4: 0,
    PLL1_5: 0,
    PLL1_6: 0,
    PLL2_7: 0x000100,
    PLL3_7: 0x000100,
    PLL4_7: 0x000100,
    RFT1: 0,
    SDFT0: 0,
    MAIN: 0x1E8270,
}


class _LimitError(ValueError):
    """The chip cannot do what an argument asks; `argument` and `text` apart, as radars have other names for some."""

    def __init__(self, argument: str, text: str) -> None:
        super().__init__(argument, text)
        self.argument = argument
        self.text = text

    def __str__(self) -> str:
        return f"{self.argument}: {self.text}"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What can be set; the defaults are those of the chip at power-up.

    Any finite numbers are taken. `registers` refuses what the chip cannot do, `achieved` says what it makes of the
    rest.

    Parameters
    ----------
    start_frequency, end_frequency : float
        Frequency 3.1125 us before the first sample, and one sample after the last [Hz], from 58 to 63.5 GHz. An end
        below the start is a falling ramp.
    sample_rate : float
        Of one receiver [Hz].
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
        Of the baseband [Hz]; the nearest of `HIGHPASS_CUTOFFS` is taken.
    num_frames : int
        Frames until the chip stops; 0: endless.

    Raises
    ------
    TypeError, ValueError
        For what is no number, or not finite.
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

    def __post_init__(self) -> None:
        put = object.__setattr__
        for name, unit in (
            ("start_frequency", "Hz"),
            ("end_frequency", "Hz"),
            ("sample_rate", "Hz"),
            ("chirp_time", "s"),
            ("frame_time", "s"),
            ("highpass_cutoff", "Hz"),
        ):
            put(self, name, check.number(name, getattr(self, name), unit))
        for name in ("num_samples", "num_chirps", "rx_mask", "tx_power_level", "if_gain_db", "num_frames"):
            put(self, name, check.count(name, getattr(self, name), -sys.maxsize))
        if not isinstance(self.is_transmitting, bool | np.bool_):
            raise TypeError(f"is_transmitting: expected True or False, got {self.is_transmitting!r}")
        put(self, "is_transmitting", bool(self.is_transmitting))

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
        cls, radar: Radar, *, tx_power_level: int = 31, if_gain_db: int = 23, highpass_cutoff: float = 80e3
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
        tx_power_level, if_gain_db, highpass_cutoff
            As in `Settings`.

        Raises
        ------
        ValueError
            For a radar that the chip cannot be; the message has the nearest that it can.
        """
        if not isinstance(radar, Radar):
            raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
        waveform = radar.waveform
        if len(radar.tx) != 1:
            raise ValueError(f"tx: expected one antenna, got {len(radar.tx)}")
        if not waveform.has_uniform_chirps or waveform.chirp_times[0] > 1e-9 * waveform.chirp_interval:
            raise ValueError(
                f"chirp_times: expected evenly spaced chirps from 0 s on, got {waveform.chirp_times[0]:g} s "
                f"and on average {waveform.chirp_interval:g} s apart; use chirp_interval instead"
            )
        rate = CLOCK / _divider(waveform.sample_rate)
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
        )
        # What the chip refuses is reported in the words of the radar.
        try:
            registers(settings, 2)
        except _LimitError as error:
            raise _LimitError(_NAMES_OF_RADAR.get(error.argument, error.argument), error.text) from None
        return settings

    def to_radar(self) -> Radar:
        """The radar that the chip is with these settings, antennas and receiver as in ``bgt60tr13c()``.

        For `achieved` settings it is exact: the slope is that of the ramp's steps, the rate ``80 MHz / divider``
        (`sample_rate` is that in whole Hz).

        Raises
        ------
        ValueError
            Where start and end are the same, or the sample rate or the receivers are none of the chip.
        """
        _within("rx_mask", self.rx_mask, 1, 7)
        divider = _divider(self.sample_rate)
        sweep = (_FIRST_SAMPLE + divider * self.num_samples) / CLOCK
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
        return Radar(
            radar.waveform,
            tx=radar.tx,
            rx=radar.rx[list(self.rx_indices)],
            pattern=radar.pattern,
            tx_power_dbm=radar.tx_power_dbm,
            receiver=radar.receiver,
        )


_NAMES_OF_RADAR = {
    "start_frequency": "start_frequency (3.1125 us before the first sample)",
    "end_frequency": "slope (the ramp's end, one sample after the last)",
    "chirp_time": "chirp_interval",
    "frame_time": "frame_interval",
}


def registers(settings: Settings, slice_size: int) -> dict[int, int]:
    """Registers of settings, by ascending address; MAIN without FRAME_START.

    Parameters
    ----------
    settings : Settings
    slice_size : int
        Samples after which the chip asks to be read, even; see `choose_slice_size`.

    Raises
    ------
    ValueError
        For what the chip cannot do; the message has the nearest value that it can.
    """
    size = check.count("slice_size", slice_size, -sys.maxsize)
    _within("slice_size", size, 2, FIFO_SIZE)
    if size % 2:
        raise _LimitError("slice_size", f"expected an even number, got {size}; the nearest are {size - 1}, {size + 1}")
    _within("num_chirps", settings.num_chirps, 1, _MAX_CHIRPS)
    _within("rx_mask", settings.rx_mask, 1, 7)
    _within("tx_power_level", settings.tx_power_level, 0, 31)
    _within("num_frames", settings.num_frames, 0, _MAX_FRAMES)
    divider = _divider(settings.sample_rate)
    start, step, ramp_time = _ramp(settings, divider)
    sampling = settings.num_samples * divider
    chirp_end, frame_end = _delays(settings, sampling, ramp_time)
    rx, tx = settings.rx_mask, settings.is_transmitting
    values = {
        ADC0: (0x210 if divider >= 28 else 0x010) | divider << 14,
        SFCTL: (size // 2 - 1) | 1 << 13 | 1 << 20,
        SADC_CTRL: 0x010100 | _sadc_speed(sampling),
        CSU1_0: 0x100050
        | (1 if tx else 0)
        | (1 << 10 if rx & 0b101 else 0)
        | (1 << 11 if rx & 0b010 or tx else 0)
        | sum(3 << 12 + 2 * i for i in settings.rx_indices),
        CSU1_1: 0x0FF400 | rx << 20 | (settings.tx_power_level if tx else 0),
        CSU1_2: _baseband(settings),
        CCR0: 0x11BC0E | 1 << 9,
        CCR1: 10 | frame_end.field,
        CCR2: (settings.num_chirps - 1) << 12 | settings.num_frames,
        PLL1_0: start & 0xFFFFFF,
        PLL1_1: step & 0xFFFFFF,
        PLL1_2: ramp_time,
        PLL1_3: settings.num_samples,
        PLL1_7: 0x110 | chirp_end.field,
    }
    return dict(sorted((_ALWAYS | values).items()))


def settings_of(registers: Mapping[int, int]) -> Settings:
    """What the chip does with these registers, in exact numbers.

    Times are whole cycles of the clock; `end_frequency` is where the ramp's steps lead and may lie beyond 63.5 GHz by
    less than their rounding; `sample_rate` is ``80 MHz / divider`` in whole Hz, as the vendor's host reads it back.
    Of gains and filters those of the first receiver in use count. With a single chirp, `chirp_time` is its length.

    Parameters
    ----------
    registers : mapping of addresses to values
        Those that are missing have their values after a reset.

    Raises
    ------
    ValueError
        For registers from which no frame of one ramp follows.
    """
    image = _image(registers)

    def field(address: int, high: int, low: int) -> int:
        return image[address] >> low & (1 << high - low + 1) - 1

    def require(condition: bool, expected: str, address: int) -> None:
        if not condition:
            raise ValueError(f"registers: expected {expected}, got 0x{image[address]:06X} at 0x{address:02X}")

    # One shape of one ramp, with a channel set that samples.
    require(field(PLL1_7, 4, 4) == 1, "shape 1 to be on (PLL1_7.SH_EN)", PLL1_7)
    require(field(PLL1_7, 3, 0) == 0, "no repetition of shape 1 (PLL1_7.REPS)", PLL1_7)
    for address in (PLL2_7, PLL3_7, PLL4_7):
        require(field(address, 4, 4) == 0, "shapes 2 to 4 to be off (SH_EN)", address)
    require(field(PLL1_3, 23, 12) == 0, "no samples in the ramp back (PLL1_3.APD)", PLL1_3)
    require(field(PLL1_6, 13, 0) == 0, "no ramp back (PLL1_6.RTD)", PLL1_6)
    require(field(CSC1, 4, 4) == 1 and field(CSC1, 3, 0) == 0, "one use of channel set 1 (CSC1)", CSC1)
    require(field(CSU1_1, 10, 10) == 1, "the ADC to be on (CSU1_1.MADC_EN)", CSU1_1)
    require(1 <= field(CSU1_1, 23, 20) <= 7, "some of three receivers (CSU1_1.BBCH_SEL)", CSU1_1)
    require(field(ADC0, 23, 14) >= _MIN_DIVIDER, f"ADC_DIV of at least {_MIN_DIVIDER}", ADC0)
    require(field(PLL1_3, 11, 0) >= 1, "at least one sample (PLL1_3.APU)", PLL1_3)
    require(field(PACR2, 4, 0) == 20, "DIVSET of 20", PACR2)
    require(field(PLL1_7, 10, 9) < 3, "a power mode of 0 to 2 (PLL1_7.PD_MODE)", PLL1_7)
    require(field(CCR1, 10, 9) < 3, "a power mode of 0 to 2 (CCR1.PD_MODE)", CCR1)

    # Frequencies, counted from the time that lies 249 cycles before the first sample.
    divider, num_samples = field(ADC0, 23, 14), field(PLL1_3, 11, 0)
    ramp_start = 8 * field(CCR1, 8, 0) + 10
    first_sample = 8 * field(CCR3, 8, 0) + 8 * field(CCR3, 13, 9) + 1
    ramp, step, ramp_time = _signed(image[PLL1_0]), _signed(image[PLL1_1]), field(PLL1_2, 13, 0)
    require(-_PLL_RANGE <= ramp + 8 * step * ramp_time < _PLL_RANGE, "a ramp in the PLL's range", PLL1_1)
    last_sample = first_sample + (num_samples - 1) * divider
    require(ramp_start <= first_sample, "a ramp that starts before the first sample", CCR1)
    require(ramp_start + 8 * ramp_time >= last_sample, "a ramp that lasts to the last sample", PLL1_2)
    start = ramp + step * (first_sample - _FIRST_SAMPLE - ramp_start)
    end = start + step * (_FIRST_SAMPLE + num_samples * divider)

    # Cycles of a chirp: the longer one of sampling and ramp, and the delays at the end of a rising and a falling ramp.
    fast_down = 0
    if mode := field(PACR2, 7, 6):
        fast_down = field(PACR2, 16, 8) + 1 if field(PACR2, 16, 8) else {1: 40, 2: 56, 3: 24}[mode]
    chirp = max(
        first_sample + num_samples * divider, ramp_start + 8 * ramp_time + fast_down + 8 * field(CCR0, 8, 0) + 5
    )
    for address in (PLL1_2, PLL1_6):
        delay = field(address, 23, 16)
        chirp += 8 * delay + 5 if delay else 2

    # Cycles from chirp to chirp and from frame to frame: the end of the last chirp is replaced by that of the frame.
    init = timer_cycles(field(CCR0, 21, 14), field(CCR0, 23, 22)) + timer_cycles(
        field(CCR3, 21, 14), field(CCR3, 23, 22)
    )
    waking = (0, init, init + timer_cycles(field(MAIN, 11, 4), field(MAIN, 15, 12)))
    chirp_end, frame_end = (
        timer_cycles(field(address, 18, 11), field(address, 23, 19)) + waking[field(address, 10, 9)]
        for address in (PLL1_7, CCR1)
    )
    num_chirps = field(CCR2, 23, 12) + 1
    frame = num_chirps * (chirp + chirp_end) - chirp_end + frame_end

    # Gain and filter.
    rx_mask = field(CSU1_1, 23, 20)
    rx = (rx_mask & -rx_mask).bit_length() - 1
    vga = field(CSU1_2, 5 * rx + 4, 5 * rx + 2)
    require(vga <= 6, "VGA_GAIN of at most 6", CSU1_2)
    return Settings(
        start_frequency=_frequency(start),
        end_frequency=_frequency(end),
        sample_rate=float((160_000_000 // divider + 1) // 2),
        num_samples=num_samples,
        num_chirps=num_chirps,
        chirp_time=(chirp + chirp_end if num_chirps > 1 else chirp) / CLOCK,
        frame_time=frame / CLOCK,
        rx_mask=rx_mask,
        tx_power_level=field(CSU1_1, 4, 0),
        is_transmitting=bool(field(CSU1_0, 0, 0)),
        if_gain_db=(18 if field(CSU1_2, 20 + rx, 20 + rx) else 30) + 5 * vga,
        highpass_cutoff=HIGHPASS_CUTOFFS[field(CSU1_2, 5 * rx + 1, 5 * rx)],
        num_frames=field(CCR2, 11, 0),
    )


def achieved(settings: Settings) -> Settings:
    """What the chip makes of settings.

    Times move to the timers' steps: the chirp's and the frame's by up to 6 cycles, or 0.4 % of the delay after them.
    What the chip makes of achieved settings is the same again, but for times, which a host takes in float32: they can
    move by another 1e-7 of themselves.
    """
    return settings_of(registers(settings, 2))


def slice_size_of(registers: Mapping[int, int]) -> int:
    """Samples after which the chip asks to be read (SFCTL.FIFO_CREF)."""
    return 2 * ((_image(registers)[SFCTL] & 0x1FFF) + 1)


def choose_slice_size(settings: Settings) -> int:
    """Samples to read at once, so that frames and slices stay in step.

    One slice is one frame. Larger frames than `MAX_SLICE_SIZE` are cut into as few equal slices as possible. Above
    200 frames per second a slice holds as many frames as bring that down to 200 slices per second, if they fit. As
    slices hold pairs of samples, frames with an odd number of them are read by the two.

    Raises
    ------
    ValueError
        For what the chip cannot do, and for odd frames of more than 4096 samples.
    """
    registers(settings, 2)
    frame = settings.frame_size
    pair = 2 if frame % 2 else 1
    fitting = MAX_SLICE_SIZE // (pair * frame) * pair
    if fitting:
        wanted = pair * math.ceil(1.0 / (200.0 * settings.frame_time * pair))
        return frame * min(wanted, fitting)
    if pair == 2:
        samples = (n for n in (settings.num_samples - 1, settings.num_samples + 1) if 1 <= n <= _MAX_SAMPLES)
        chirps = (n for n in (settings.num_chirps - 1, settings.num_chirps + 1) if n >= 1)
        raise _LimitError(
            "num_samples",
            f"expected an even number of samples in a frame of more than {MAX_SLICE_SIZE // 2}, got "
            f"{len(settings.rx_indices)} receivers x {settings.num_chirps} chirps x {settings.num_samples} samples; "
            f"the nearest are {' or '.join(map(str, samples))} samples, or {' or '.join(map(str, chirps))} chirps",
        )
    return next(size for size in range(MAX_SLICE_SIZE, 0, -2) if frame % size == 0)


def sdk_slice_size(settings: Settings) -> int:
    """Samples that the vendor's host reads at once (Strata, slice size); `settings` as they are `achieved`.

    Raises
    ------
    ValueError
        For what the chip cannot do, and where it comes out odd.
    """
    registers(settings, 2)
    frame = settings.frame_size
    size = frame // -(-frame // MAX_SLICE_SIZE)
    rate = frame / size / float(np.float32(settings.frame_time))
    if rate > 20.0:
        size = min(size * math.floor(rate / 20.0), MAX_SLICE_SIZE)
    if size % 2:
        raise ValueError(f"settings: expected frames that are cut into even slices, got slices of {size} samples")
    return size


def start_words(registers: Mapping[int, int]) -> list[int]:
    """SPI words that set the registers and start: ascending, MAIN last with FRAME_START."""
    if MAIN not in registers:
        raise ValueError("registers: expected MAIN among them, got none at 0x00")
    others = sorted(address for address in registers if address != MAIN)
    words = [write_word(address, registers[address]) for address in others]
    return [*words, write_word(MAIN, registers[MAIN] | FRAME_START)]


def write_word(address: int, value: int) -> int:
    """SPI word that sets a register."""
    if not (0 <= address < 0x80 and 0 <= value <= 0xFFFFFF):
        raise ValueError(f"address, value: expected 7 and 24 bits, got {address} and {value}")
    return address << 25 | 1 << 24 | value


def word_bytes(words: Iterable[int]) -> bytes:
    """SPI words as they go out, most significant byte first."""
    return b"".join(word.to_bytes(4, "big") for word in words)


def chip_name(chip_id: int) -> str:
    """Name of the chip whose register CHIP_ID has this value."""
    digital, rf = chip_id >> 8 & 0xFF, chip_id & 0xFF
    return CHIP_NAMES.get((digital, rf), f"unknown chip 0x{chip_id:06X}")


def temperature_of(code: int) -> float:
    """Temperature [degrees Celsius] that the sensor's 10-bit code stands for."""
    value = check.count("code", code, 0)
    if value > 1023:
        raise ValueError(f"code: expected 0 to 1023, got {value}")
    return (value * 1.21 / 1023.0 - 0.78984) / 0.00286


def temperature_code(temperature: float) -> int:
    """Code of the chip's sensor at a temperature [degrees Celsius], from 0 to 1023."""
    code = (check.number("temperature", temperature, "degrees Celsius") * 0.00286 + 0.78984) * 1023.0 / 1.21
    return round(min(max(code, 0.0), 1023.0))


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
class _Delay:
    """What the chip does after a chirp or a frame."""

    mode: int  # 0 stays on, 1 idle, 2 deep sleep
    counter: int
    scale: int

    @property
    def field(self) -> int:
        """As it stands in PLL1_7 and in CCR1."""
        return self.mode << 9 | self.counter << 11 | self.scale << 19

    @property
    def cycles(self) -> int:
        """Waking included."""
        return timer_cycles(self.counter, self.scale) + (0, _INIT, _INIT + _WAKE_UP)[self.mode]


_LONGEST_DELAY = _Delay(2, 255, _MAX_SCALE).cycles


def _delay(rest: float) -> _Delay:
    """What fills up `rest` [s]: as deep a sleep as there is time for, and a timer (Strata, repetition times)."""
    mode = 0
    if rest >= _IDLE_TIME:
        mode, rest = 1, rest - _IDLE_TIME
        # Of what is left, not of all: so does the host.
        if rest >= _WAKE_TIME:
            mode, rest = 2, rest - _WAKE_TIME
    # The host counts in steps of 100 ps, 125 of which are one cycle; half ones are rounded up.
    steps = int(rest / 1e-10)
    return _Delay(mode, *scaled_timer((2 * steps + 125) // 250))


def _delays(settings: Settings, sampling: int, ramp_time: int) -> tuple[_Delay, _Delay]:
    """Delays after every chirp, and after the frame."""
    n = settings.num_chirps
    chirp = max(sampling + 489, 8 * ramp_time + 213) + 4
    samples = f"{settings.num_samples} samples at {_text(settings.sample_rate, 'Hz')}"
    chirp_end = _delay(_rest("chirp_time", settings.chirp_time, chirp, f"for {samples}"))
    chirps = n * (chirp + chirp_end.cycles) - chirp_end.cycles
    interval = _text((chirp + chirp_end.cycles) / CLOCK, "s")
    why = f"for {n} chirps every {interval}" if n > 1 else f"for a chirp of {samples}"
    return chirp_end, _delay(_rest("frame_time", settings.frame_time, chirps, why))


def _rest(name: str, time: float, cycles: int, why: str) -> float:
    """What is left of a time after so many cycles [s], in the float32 of the host."""
    least, most = cycles / CLOCK, (cycles + _LONGEST_DELAY) / CLOCK
    if time < least * (1.0 - _TIME_ROUNDING):
        text = (
            f"expected at least {_text(least, 's')} {why}, got {_text(time, 's')}; the nearest is {_text(least, 's')}"
        )
        raise _LimitError(name, text)
    if time > most * (1.0 + _TIME_ROUNDING):
        text = f"expected at most {_text(most, 's')} (the longest timer), got {_text(time, 's')}; the nearest is "
        raise _LimitError(name, text + _text(most, "s"))
    return max(float(np.float32(time)) - least, 0.0)


def _divider(sample_rate: float) -> int:
    """Cycles per sample."""
    rate = math.trunc(sample_rate)
    if not _MIN_RATE <= rate <= _MAX_RATE:
        raise _LimitError("sample_rate", _out_of_range(sample_rate, _MIN_RATE, _MAX_RATE, "Hz"))
    return (160_000_000 // rate + 1) // 2


def _ramp(settings: Settings, divider: int) -> tuple[int, int, int]:
    """First frequency of the ramp and its step per cycle, in steps of the PLL, and its length in 8 cycles."""
    # The ramp must end before its counter does.
    _within("num_samples", settings.num_samples, 1, _MAX_SAMPLES)
    length = settings.num_samples * divider + _FIRST_SAMPLE
    ramp_time = -(-(length + _LEAD) // 8)
    if 8 * ramp_time > _MAX_RAMP:
        longest = _MAX_RAMP - _FIRST_SAMPLE - _LEAD
        most, slowest = longest // divider, longest // settings.num_samples
        rate = (160_000_000 // slowest + 1) // 2
        raise _LimitError(
            "num_samples",
            f"expected 1 to {most} at {_text(settings.sample_rate, 'Hz')} (ramps of at most 1.6383 ms), got "
            f"{settings.num_samples}; the nearest is {most}, or a sample_rate of at least {_text(rate, 'Hz')}",
        )

    # Frequencies, in kHz. What the steps made of a legal end is legal again.
    start, end = (math.floor(f / 1e3 + 0.5) for f in (settings.start_frequency, settings.end_frequency))
    for name, khz, hertz in (
        ("start_frequency", start, settings.start_frequency),
        ("end_frequency", end, settings.end_frequency),
    ):
        legal = min(max(khz, _MIN_KHZ), _MAX_KHZ)
        if khz != legal and (name == "start_frequency" or _step(start, khz, length) != _step(start, legal, length)):
            raise _LimitError(name, _out_of_range(hertz, _MIN_KHZ * 1e3, _MAX_KHZ * 1e3, "Hz"))
    step = _step(start, end, length)
    first = _pll(start) - _LEAD * step
    if not -_PLL_RANGE <= first < _PLL_RANGE:
        steepest = (_PLL_RANGE + _pll(start)) // _LEAD if step > 0 else -((_PLL_RANGE - 1 - _pll(start)) // _LEAD)
        nearest = _text(round(_frequency(_pll(start) + steepest * length), -3), "Hz")
        raise _LimitError(
            "end_frequency",
            f"expected at {'most' if step > 0 else 'least'} {nearest} after {_text(length / CLOCK, 's')} (the ramp "
            f"begins {_text(_LEAD / CLOCK, 's')} before start_frequency, within 56.32 to 66.56 GHz), got "
            f"{_text(settings.end_frequency, 'Hz')}; the nearest is {nearest}, or take more samples",
        )
    return first, step, ramp_time


def _step(start: int, end: int, length: int) -> int:
    """Step per cycle of a ramp from start to end [kHz] in `length` cycles, rounded as the host does."""
    width = _pll(end) - _pll(start)
    magnitude = (2 * abs(width) // length + 1) // 2
    return magnitude if width > 0 else -magnitude


def _pll(khz: int) -> int:
    """Steps of the PLL above 61.44 GHz; a step has 640 MHz / 2**20, so 1024 of them are 625 kHz."""
    return (2048 * khz + 625) // 1250 - (96 << 20)


def _frequency(steps: int) -> float:
    """Frequency of the PLL [Hz]."""
    return 640e6 * (96 + steps / (1 << 20))


def _sadc_speed(sampling: int) -> int:
    """How long the sensor's ADC may average during so many cycles of sampling."""
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
    _within("if_gain_db", settings.if_gain_db, IF_GAINS_DB[0], IF_GAINS_DB[-1], "dB")
    if settings.highpass_cutoff < 0.0:
        text = f"expected 0 Hz or more, got {_text(settings.highpass_cutoff, 'Hz')}; the nearest is "
        raise _LimitError("highpass_cutoff", text + _text(HIGHPASS_CUTOFFS[0], "Hz"))
    cutoff = sum(settings.highpass_cutoff >= middle for middle in (32_500, 57_500, 75_000))
    # An amplifier of 18 or 30 dB, and one of 0 to 30 dB in steps of 5; the second choice wins where it is as near.
    gain = settings.if_gain_db
    first, vga = 18, (min(gain - 18, 30) + 2) // 5
    if gain >= 29:
        other = (min(gain - 30, 30) + 2) // 5
        if abs(30 + 5 * other - gain) <= abs(first + 5 * vga - gain):
            first, vga = 30, other
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


def _image(registers: Mapping[int, int]) -> dict[int, int]:
    """All registers, those not given as after a reset."""
    for address, value in registers.items():
        if operator.index(address) not in RESET_VALUES or not 0 <= operator.index(value) <= 0xFFFFFF:
            raise ValueError(f"registers: expected 24 bits at 0x00 to 0x5F, got {value} at {address}")
    return RESET_VALUES | dict(registers)


def _signed(value: int) -> int:
    """A field of 24 bits with its sign."""
    return value - 2 * _PLL_RANGE if value >= _PLL_RANGE else value


def _within(name: str, value: int, low: int, high: int, unit: str = "") -> None:
    if not low <= value <= high:
        raise _LimitError(name, _out_of_range(value, low, high, unit))


def _out_of_range(value: float, low: float, high: float, unit: str = "") -> str:
    nearest = _text(low if value < low else high, unit)
    return f"expected {_text(low, unit)} to {_text(high, unit)}, got {_text(value, unit)}; the nearest is {nearest}"


_PREFIXES = {
    "Hz": ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, "")),
    "s": ((1.0, ""), (1e-3, "m"), (1e-6, "u")),
}


def _text(value: float, unit: str) -> str:
    """A number with its unit; times of whole cycles and whole Hz are exact."""
    if unit not in _PREFIXES:
        return f"{value} {unit}".rstrip()
    prefixes = _PREFIXES[unit]
    scale, prefix = next((pair for pair in prefixes if abs(value) >= pair[0]), prefixes[-1])
    return f"{value / scale:.12g} {prefix}{unit}"
