"""Frames of the chip from its registers: any shapes, rising and falling ramps, and a constant wave.

A host of the board sets one rising or falling ramp, see `radarcore.sensor.bgt60.settings`. The
chip does more: a frame is FRAME_LEN + 1 groups; each group is one of up to four shapes, in turn, repeated 2^REPS times.
A shape is a rising ramp and, unless FSD, RSD and RTD are zero, a falling one; the names say nothing about the signs of
the slopes. Either has its own samples, frequencies and channel set.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.bgt60_chip import CLOCK, FIRST_SAMPLE, MIN_DIVIDER
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.bgt60_receiver import HIGHPASS_CUTOFFS
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.bgt60 import registers as reg
from radarcore.sensor.bgt60.registers import signed
from radarcore.sensor.bgt60.settings import ADC_DELAY, NUM_RX
from radarcore.sensor.bgt60.timing import frequency_of, timer_cycles
from radarcore.sensor.emulator.source import NO_POWER_DBM

_POWER_RANGE_DB = 15.0
"""Power at the highest of the levels over that at the lowest [dB], of the data sheet."""

_HIGHEST_LEVEL = 31
_DIVSET = 20  # of a clock of 80 MHz
_MOST_SAMPLES = 1 << 26
"""Largest frame [samples]: 4096 of the longest chirps are fewer."""

_LEAST_SIZE = 1024
"""Samples for which a ramp counts that has fewer."""

_PAUSE = 3.0 / CLOCK
"""Shortest frame of a constant wave beyond its samples [s]."""


@dataclass(frozen=True)
class Ramps:
    """All ramps of a frame that are alike: of a shape, rising or falling.

    Attributes
    ----------
    radar : Radar
        Waveform with the starts of the ramps within the frame, receivers in use, power, and in its receiver the
        high-pass.
    if_gain_db : int
        Gain of the baseband [dB].
    has_first_rx : bool
        RX1 is in use.
    """

    radar: Radar
    if_gain_db: int
    has_first_rx: bool

    @property
    def chirp_size(self) -> int:
        """Samples of a ramp, all receivers together."""
        return self.radar.num_channels * self.radar.waveform.num_samples


@dataclass(frozen=True)
class Sequence:
    """Frames of the chip.

    Attributes
    ----------
    ramps : tuple of Ramps
    order : (chirp,) int
        Number in `ramps` of every sampled ramp of a frame, in the order of time.
    ends : (chirp,) float64
        When each is over, its pause included, after the start of the frame [s]: the board has its samples then.
    frame_time : float
        From one frame to the next [s].
    num_frames : int
        Frames until the chip stops; 0: endless.
    """

    ramps: tuple[Ramps, ...]
    order: NDArray[np.intp]
    ends: NDArray[np.float64]
    frame_time: float
    num_frames: int

    @property
    def frame_size(self) -> int:
        """Samples of a frame."""
        sizes = np.array([ramps.chirp_size for ramps in self.ramps])
        return int(sizes[self.order].sum())

    def stream(self, cubes: list[NDArray[np.uint16]]) -> NDArray[np.uint16]:
        """Codes in FIFO order, receivers in turn, from codes of all ramps (rx, chirp, sample)."""
        streams = [np.ascontiguousarray(cube.transpose(1, 2, 0)).reshape(cube.shape[1], -1) for cube in cubes]
        if len(streams) == 1:
            return streams[0].reshape(-1)
        seen = [0] * len(streams)
        pieces = []
        for which in self.order:
            pieces.append(streams[which][seen[which]])
            seen[which] += 1
        return np.concatenate(pieces)


def tx_power_dbm(level: int) -> float:
    """Power of the transmitter [dBm] at a level (TX1_DAC), from 0 to 31.

    The law is not public. The data sheet has a range of about 15 dB and 4 dBm at 31; between, steps of equal dB.
    """
    return bgt60tr13c().tx_power_dbm - _POWER_RANGE_DB * (1.0 - level / _HIGHEST_LEVEL)


def sequence_of(registers: Mapping[int, int]) -> Sequence:
    """Frames that registers stand for.

    Raises
    ------
    ValueError
        For registers from which no samples follow.
    """
    return _Frames(registers).sequence()


def constant_wave_of(registers: Mapping[int, int]) -> Sequence:
    """One frame of samples without a ramp, at the start frequency of shape 1.

    Raises
    ------
    ValueError
        For registers from which no samples follow.
    """
    image = _Frames(registers)
    image.check()
    ramps = image.ramps(0, 0, [0], image.chirp_cycles(0, 0), step=0)
    if ramps is None:
        raise image.error("samples of a receiver", reg.CSU1_1)
    waveform = ramps.radar.waveform
    end = float(waveform.sample_times[-1])
    return Sequence((ramps,), np.zeros(1, np.intp), np.array([end]), end + _PAUSE, 1)


class _Frames:
    """Frames of a whole register image, and times that follow from it in cycles of the clock.

    Registers that are not given are as after a reset. Shapes count from 0; side 0 is the first ramp of a shape, 1 the
    second.
    """

    def __init__(self, registers: Mapping[int, int]) -> None:
        self._registers = reg.image_of(registers)
        self.divider: int = self.field(reg.ADC0, 23, 14)
        """Cycles per sample."""

    def __getitem__(self, address: int) -> int:
        """Value of a register."""
        return self._registers[address]

    def field(self, address: int, high: int, low: int) -> int:
        """Bits of a register."""
        return self._registers[address] >> low & (1 << high - low + 1) - 1

    def error(self, expected: str, address: int) -> ValueError:
        """Error for the value of a register."""
        return ValueError(f"registers: expected {expected}, got 0x{self[address]:06X} at 0x{address:02X}")

    def is_triangle(self, shape: int) -> bool:
        """True where a true ramp follows the first one, and not only a return."""
        base = reg.PLL1_0 + 8 * shape
        return bool(self[base + 4] or self[base + 5] or self.field(base + 6, 13, 0))

    def chirp_cycles(self, shape: int, side: int) -> int:
        """Cycles of a ramp: the longer one of sampling and ramp, and the delay at its end."""
        fast_down = 0
        if not self.is_triangle(shape) and (mode := self.field(reg.PACR2, 7, 6)):
            timer = self.field(reg.PACR2, 16, 8)
            fast_down = timer + 1 if timer else {1: 40, 2: 56, 3: 24}[mode]
        ramp_time = 8 * self.field(reg.PLL1_0 + 8 * shape + 2 + 4 * side, 13, 0)
        sampling = self.first_sample + self.num_samples(shape, side) * self.divider
        ramp = self.ramp_start + ramp_time + fast_down + 8 * self.field(reg.CCR0, 8, 0) + 5
        return max(sampling, ramp) + self.end_delay(shape, side)

    def return_cycles(self, shape: int) -> int:
        """Cycles of the delay after a return that is no ramp."""
        return 0 if self.is_triangle(shape) else self.end_delay(shape, 1)

    def end_delay(self, shape: int, side: int) -> int:
        """Cycles of the delay after a ramp."""
        delay = self.field(reg.PLL1_0 + 8 * shape + 2 + 4 * side, 23, 16)
        return 8 * delay + 5 if delay else 2

    def pause_cycles(self, address: int) -> int:
        """Cycles of the delay in a register, waking included."""
        init = sum(timer_cycles(self.field(each, 21, 14), self.field(each, 23, 22)) for each in (reg.CCR0, reg.CCR3))
        wake_up = timer_cycles(self.field(reg.MAIN, 11, 4), self.field(reg.MAIN, 15, 12))
        waking = (0, init, init + wake_up, init + wake_up)[self.field(address, 10, 9)]
        return timer_cycles(self.field(address, 18, 11), self.field(address, 23, 19)) + waking

    @property
    def ramp_start(self) -> int:
        """Cycles from the start of a chirp to the start of its ramp."""
        return 8 * self.field(reg.CCR1, 8, 0) + 10

    @property
    def first_sample(self) -> int:
        """Cycles from the start of a chirp to its first sample."""
        return 8 * self.field(reg.CCR3, 8, 0) + 8 * self.field(reg.CCR3, 13, 9) + 1

    def num_samples(self, shape: int, side: int) -> int:
        """APU or APD."""
        return self.field(reg.PLL1_0 + 8 * shape + 3, *((11, 0), (23, 12))[side])

    def check(self) -> None:
        """Raise an error for sequences without samples or with unknown ones."""
        if self.divider < MIN_DIVIDER:
            raise self.error(f"ADC_DIV of at least {MIN_DIVIDER}", reg.ADC0)
        if self.field(reg.PACR2, 4, 0) != _DIVSET:
            raise self.error(f"DIVSET of {_DIVSET}", reg.PACR2)

    def sequence(self) -> Sequence:
        """Frames of all shapes."""
        self.check()
        # Behind a shape that is off, the chip goes back to the first one.
        shapes = list(takewhile(lambda shape: self.field(reg.PLL1_7 + 8 * shape, 4, 4), range(4)))
        if not shapes:
            raise self.error("shape 1 to be on (PLL1_7.SH_EN)", reg.PLL1_7)
        order, frame = self._order(shapes)
        starts: dict[tuple[int, int], list[int]] = {}
        for key, start in order:
            starts.setdefault(key, []).append(start)
        ramps = {key: found for key, times in starts.items() if (found := self.ramps(*key, times, frame)) is not None}
        if not ramps:
            raise self.error("samples of a receiver", reg.CSU1_1)
        numbers = {key: number for number, key in enumerate(ramps)}
        sampled = [numbers[key] for key, _ in order if key in numbers]
        # The last one pauses as one before it would, whatever the frame's end is.
        (last, _), start = order[-1]
        pause = self.pause_cycles(reg.PLL1_7 + 8 * last) if len(order) > 1 else 0
        overs = [start for _, start in order[1:]]
        overs.append(start + self.chirp_cycles(*order[-1][0]) + self.return_cycles(last) + pause)
        ends = [over / CLOCK for (key, _), over in zip(order, overs, strict=True) if key in numbers]
        num_frames = self.field(reg.CCR2, 11, 0)
        return Sequence(tuple(ramps.values()), np.array(sampled, np.intp), np.array(ends), frame / CLOCK, num_frames)

    def _order(self, shapes: list[int]) -> tuple[list[tuple[tuple[int, int], int]], int]:
        """All ramps of a frame as (shape, 0 up or 1 down) and their starts, and its duration [cycles]."""
        groups = self.field(reg.CCR2, 23, 12) + 1
        order: list[tuple[tuple[int, int], int]] = []
        now, size = 0, sum(self._group_size(shapes[group % len(shapes)]) for group in range(groups))
        if size > _MOST_SAMPLES:
            raise ValueError(
                f"registers: expected frames of fewer samples, got {groups} groups of shapes at 0x{reg.CCR2:02X}"
            )
        for group in range(groups):
            shape = shapes[group % len(shapes)]
            for _ in range(1 << self.field(reg.PLL1_7 + 8 * shape, 3, 0)):
                for side in (0, 1) if self.is_triangle(shape) else (0,):
                    order.append(((shape, side), now))
                    now += self.chirp_cycles(shape, side)
                now += self.return_cycles(shape)
            is_last = group == groups - 1
            now += self.pause_cycles(reg.CCR1 if is_last else reg.PLL1_7 + 8 * shape)
        return order, now

    def _group_size(self, shape: int) -> int:
        """Samples of a shape and its repetitions, about."""
        each = max(NUM_RX * sum(self.num_samples(shape, side) for side in (0, 1)), _LEAST_SIZE)
        return each << self.field(reg.PLL1_7 + 8 * shape, 3, 0)

    def ramps(self, shape: int, side: int, starts: list[int], frame: int, *, step: int | None = None) -> Ramps | None:
        """Ramps that start at some of the cycles of a frame; None without samples, ADC or receivers."""
        channel_set = 7 * shape + 3 * side
        switches, levels, baseband = (self[address + channel_set] for address in (reg.CSU1_0, reg.CSU1_1, reg.CSU1_2))
        rx_mask = levels >> 20 & (1 << NUM_RX) - 1
        num_samples = self.num_samples(shape, side)
        if num_samples == 0 or rx_mask == 0 or not levels >> 10 & 1:
            return None
        rx = (rx_mask & -rx_mask).bit_length() - 1
        base = reg.PLL1_0 + 8 * shape + 4 * side
        step = signed(self[base + 1]) if step is None else step
        # Frequencies count from the time that lies 249 cycles before the first sample, up to one sample after the last.
        length = FIRST_SAMPLE + num_samples * self.divider
        start = signed(self[base]) + step * (self.first_sample - FIRST_SAMPLE - self.ramp_start)
        alone = self.chirp_cycles(shape, side) + self.return_cycles(shape)
        interval = starts[1] - starts[0] if len(starts) > 1 else alone
        spacing: dict[str, Any] = {"chirp_times": np.array(starts) / CLOCK}
        if starts == list(range(0, len(starts) * interval, interval)):
            spacing = {"chirp_interval": interval / CLOCK}
        waveform = Waveform(
            start_frequency=frequency_of(start),
            slope=(frequency_of(start + step * length) - frequency_of(start)) / (length / CLOCK),
            sample_rate=CLOCK / self.divider,
            num_samples=num_samples,
            num_chirps=len(starts),
            **spacing,
            frame_interval=frame / CLOCK,
            adc_delay=ADC_DELAY,
        )
        preset = bgt60tr13c()
        is_on = bool(switches & 1)
        radar = Radar(
            waveform,
            tx=preset.tx,
            rx=preset.rx[[i for i in range(NUM_RX) if rx_mask >> i & 1]],
            pattern=preset.pattern,
            tx_power_dbm=tx_power_dbm(levels & 0x1F) if is_on else NO_POWER_DBM,
            receiver=Receiver(
                output="real",
                noise_figure_db=12.0,
                high_pass=HIGHPASS_CUTOFFS[baseband >> 5 * rx & 0b11] if step else None,  # echoes of 0 Hz
            ),
        )
        # Gains beyond 30 dB are not the second amplifier's.
        vga = min(baseband >> 5 * rx + 2 & 0b111, 6)
        return Ramps(radar, (18 if baseband >> 20 + rx & 1 else 30) + 5 * vga, bool(rx_mask & 1))
