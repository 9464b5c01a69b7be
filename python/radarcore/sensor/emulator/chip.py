"""A BGT60TR13C: registers behind SPI words, a sequencer that measures frame by frame, and a FIFO that can overflow.

The sequencer is a thread: it asks the source for a frame, waits until that would have been measured, and puts the
samples into the FIFO. Scene time and time stamps follow from the number of the frame, so that a source that is too slow
makes a slow sensor, not a wrong one. Time stamps count from power-up, and run on from one measurement to the next.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from radarcore.sensor.bgt60.registers import (
    CHIP_ID,
    FIFO_RESET,
    FIFO_SIZE,
    FRAME_START,
    FSM_RESET,
    FSTAT,
    LFSR_EN,
    MAIN,
    RESET_VALUES,
    SADC_RESULT,
    SFCTL,
    STAT0,
    SW_RESET,
    temperature_code,
    test_pattern,
)
from radarcore.sensor.bgt60.settings import slice_size_of
from radarcore.sensor.emulator.sequence import Ramps, Sequence, constant_wave_of, sequence_of
from radarcore.sensor.emulator.source import FrameSource

# Status byte in front of every answer.
_STATUS = 0xF0
_STATUS_OVERFLOW = 0x08

_CW_MODE = 1 << 16
_MAIN_ACTIONS = FRAME_START | SW_RESET | FSM_RESET | FIFO_RESET
_STAT0_READY = 0b1111  # sensor ADC, ADC, band gap and regulators
_FSTAT_OVERFLOW = 1 << 23
_FSTAT_EMPTY = 1 << 20

_DEEP_SLEEP, _IDLE, _INTERCHIRP, _ACTIVE = 5, 3, 2, 1
"""Power modes (STAT0.PM)."""
_WAKING = {_DEEP_SLEEP: _IDLE, _IDLE: _INTERCHIRP, _INTERCHIRP: _ACTIVE}
"""Modes that follow each other in CW mode, one with every trigger."""
_POWER_MODE = 0b111 << 5  # in STAT0

PACE_TIME = 10.0
"""Time over which the rate of a source is measured [s of the host]: a busy host is late now and then."""
_MOST_PACES = 8


class Chip:
    """The radar chip of an emulated board.

    Parameters
    ----------
    source : FrameSource
        Measured samples.
    speed : float or None
        Seconds of the sensor per second of the host; None: as fast as samples are taken.
    temperature : float
        [degrees Celsius]
    on_samples : callable
        Called with no lock held whenever samples have come or the FIFO has overflown.
    is_full : callable
        True while the reader of the samples has no room: at ``speed=None`` the sequencer then waits.
    """

    def __init__(
        self,
        source: FrameSource,
        *,
        speed: float | None,
        temperature: float,
        chip_id: int,
        on_samples: Callable[[], None],
        is_full: Callable[[], bool],
    ) -> None:
        self.source = source
        self.speed = speed
        self.temperature = temperature
        self.chip_id = chip_id
        self._on_samples = on_samples
        self._is_full = is_full
        self._lock = threading.Condition()
        self._fifo: deque[tuple[NDArray[np.uint16], float]] = deque()
        self._fill = 0
        self._run = 0  # number of the measurement under way; a sequencer of another number ends
        self._thread: threading.Thread | None = None
        self.has_overflown: bool = False
        self.complains: bool = False
        """An overflow is not reported yet; the report clears this."""
        self.failure: Exception | None = None
        self.frame_size: int = 0
        """Samples of a frame of the newest measurement, of all receivers."""
        self.num_lost: int = 0
        """Frames lost by overflows, in all; frames without a waiting host are not counted."""
        self.paces: deque[float] = deque(maxlen=_MOST_PACES)
        """Rates of the source over `PACE_TIME` [s of the sensor per s of the host], until they are read."""
        self._power_mode = _DEEP_SLEEP
        self._wave = (0, 0.0)  # constant wave: triggers that gave samples, and when the first came
        self._began = time.monotonic()
        self._latest = 0.0  # time stamp of the newest samples
        self.registers: dict[int, int] = {}
        self._clear()

    def reset(self) -> None:
        """Hardware reset: registers as after power-up, nothing measured."""
        self._stop()
        self._clear()

    def _clear(self) -> None:
        with self._lock:
            self.registers = dict(RESET_VALUES)
            self.registers[CHIP_ID] = self.chip_id
            self._wave = (0, 0.0)
        self._empty()

    def _empty(self) -> None:
        with self._lock:
            self._fifo.clear()
            self._fill = 0
            self.has_overflown = False
            self._lock.notify_all()

    def execute(self, words: Iterable[int]) -> list[int]:
        """Answers to SPI words, in order: status on top of the register's value before the word."""
        answers = []
        for word in words:
            address, is_write, value = word >> 25, word >> 24 & 1, word & 0xFFFFFF
            status = _STATUS | (_STATUS_OVERFLOW if self.has_overflown else 0)
            answers.append(status << 24 | self.read(address))
            if is_write:
                self.write(address, value)
        return answers

    def read(self, address: int) -> int:
        """Value of a register; missing registers are zero."""
        with self._lock:
            if address == STAT0:
                return self.registers[address] & ~_POWER_MODE | self._power_mode << 5 | _STAT0_READY
            if address == SADC_RESULT:
                return temperature_code(self.temperature)
            if address == FSTAT:
                flags = (_FSTAT_OVERFLOW if self.has_overflown else 0) | (_FSTAT_EMPTY if self._fill == 0 else 0)
                return self._fill // 2 | flags
            return self.registers.get(address, 0)

    def write(self, address: int, value: int) -> None:
        """Set a register; bits of MAIN that act do so at once and read back as zero."""
        if address in (CHIP_ID, STAT0, SADC_RESULT, FSTAT):
            return
        with self._lock:
            if address in self.registers:
                self.registers[address] = value & ~_MAIN_ACTIONS if address == MAIN else value
        if address == MAIN:
            self._act(value)

    def _act(self, main: int) -> None:
        if main & SW_RESET:
            self.reset()
        if main & (FSM_RESET | FIFO_RESET):
            self._stop()
        if main & FIFO_RESET:
            self._empty()
        if main & FRAME_START:
            if main & _CW_MODE:
                self._trigger_wave()
            else:
                self._start()

    def has_samples(self, num_samples: int) -> bool:
        """True when the FIFO holds at least `num_samples`."""
        return self._fill >= num_samples

    def take(self, num_samples: int) -> tuple[NDArray[np.uint16], float] | None:
        """The oldest samples of the FIFO, and when the last of them was measured [s since power-up].

        None while there are fewer.
        """
        with self._lock:
            if self._fill < num_samples:
                return None
            pieces: list[NDArray[np.uint16]] = []
            missing, when = num_samples, 0.0
            while missing > 0:
                piece, when = self._fifo.popleft()
                if len(piece) > missing:
                    self._fifo.appendleft((piece[missing:], when))
                    piece = piece[:missing]
                pieces.append(piece)
                missing -= len(piece)
            self._fill -= num_samples
            self._lock.notify_all()
        return (pieces[0] if len(pieces) == 1 else np.concatenate(pieces)), when

    def wake(self) -> None:
        """Wake the sequencer: the reader of samples has room again."""
        with self._lock:
            self._lock.notify_all()

    def overflow(self, num_more: int = 0) -> None:
        """Lose the content of the FIFO and `num_more` samples, and stop, as when it is not read in time."""
        with self._lock:
            self.num_lost += -(-(self._fill + num_more) // max(self.frame_size, 1))
            self.has_overflown = self.complains = True
            self._run += 1
            self._power_mode = _DEEP_SLEEP
            self._fifo.clear()
            self._fill = 0
            self._lock.notify_all()

    def close(self) -> None:
        """End the sequencer."""
        self._stop()
        if self._thread is not None:
            self._thread.join()

    def _start(self) -> None:
        """Measure frames as the registers say, from now on."""
        self._stop()
        try:
            sequence = sequence_of(self.registers)
        except ValueError as error:  # no frame comes of such registers
            self.failure = error
            return
        self._power_mode = _ACTIVE
        self.paces.clear()
        self._begin(sequence)

    def _trigger_wave(self) -> None:
        """One state further in CW mode, in which each waits for a trigger: the last one samples, and comes again."""
        if self._power_mode != _ACTIVE:
            self._power_mode = _WAKING[self._power_mode]
            return
        try:
            sequence = constant_wave_of(self.registers)
        except ValueError as error:
            self.failure = error
            return
        number, began = self._wave if self._wave[0] else (0, self._uptime())
        self._wave = number + 1, began
        self._stop()
        self._power_mode = _INTERCHIRP
        self._begin(sequence, first_index=number, origin=began)

    def _begin(self, sequence: Sequence, *, first_index: int = 0, origin: float | None = None) -> None:
        """Measure in a thread; `origin` is the time stamp of the time 0 of the source, now by default [s]."""
        piece = slice_size_of(self.registers)
        is_test = bool(self.registers[SFCTL] & LFSR_EN)
        arguments = (self._run, sequence, piece, is_test, self._thread, first_index, origin)
        self._thread = threading.Thread(target=self._measure, args=arguments, name="radarcore-sequencer", daemon=True)
        self._thread.start()

    def _stop(self) -> None:
        """End the measurement; its thread ends with the frame that the source is at, which may take long."""
        with self._lock:
            self._run += 1
            self._power_mode = _DEEP_SLEEP
            self._lock.notify_all()

    def _measure(
        self,
        run: int,
        sequence: Sequence,
        piece: int,
        is_test: bool,
        previous: threading.Thread | None,
        first_index: int,
        origin: float | None,
    ) -> None:
        """Frames into the FIFO until `run` is over; the source belongs to `previous` until that has ended."""
        if previous is not None:
            previous.join()
        stamp = self._uptime()
        first_stamp = stamp if origin is None else origin
        first_start = stamp - first_stamp
        began, number = time.monotonic() - first_start / (self.speed or 1.0), 0
        paced_from: tuple[float, float] | None = None
        # A board has samples after their chirp.
        sizes = np.array([ramps.chirp_size for ramps in sequence.ramps])[sequence.order]
        counts, ends = np.concatenate([[0], np.cumsum(sizes)]), np.concatenate([[0.0], sequence.ends])
        while self._run == run and (sequence.num_frames == 0 or number < sequence.num_frames):
            start = first_start + number * sequence.frame_time
            try:
                cubes = [
                    self.source.frame(ramps.radar, first_index + number, start, if_gain_db=ramps.if_gain_db)
                    for ramps in sequence.ramps
                ]
            except Exception as error:  # a source that fails ends the measurement, not the board
                if self._run == run:
                    self.failure = error
                return
            if is_test:
                parts = zip(cubes, sequence.ramps, strict=True)
                cubes = [_with_test_pattern(cube, ramps, first_index + number) for cube, ramps in parts]
            samples = sequence.stream(cubes)
            self.frame_size = len(samples)
            for first in range(0, len(samples), piece):
                part = samples[first : first + piece]
                moment = start + float(np.interp(first + len(part), counts, ends))
                late = self._wait_until(run, began, moment)
                if first == 0:
                    # A source that is late makes the sensor late, but not its chirps shorter.
                    began += late
                    paced_from = self._pace(paced_from, moment)
                if not self._put(run, part, first_stamp + moment):
                    return
            number += 1
        with self._lock:
            if self._run == run and origin is None:
                self._power_mode = _DEEP_SLEEP  # all requested frames

    def _uptime(self) -> float:
        """Time since power-up [s], not before what has been measured."""
        by_host = 0.0 if self.speed is None else self.speed * (time.monotonic() - self._began)
        return max(self._latest, by_host)

    def _pace(self, begin: tuple[float, float] | None, moment: float) -> tuple[float, float]:
        """Compare the sensor's time with the host's since `begin`; returns from when on to compare next."""
        now = time.monotonic()
        if begin is None or self.speed is None:  # the first frame could not be made ahead
            return now, moment
        if now - begin[0] < PACE_TIME:
            return begin
        self.paces.append((moment - begin[1]) / (now - begin[0]))
        return now, moment

    def _wait_until(self, run: int, began: float, moment: float) -> float:
        """Wait for a moment of the sensor's time; returns by how much it was missed [s of the host]."""
        if self.speed is None:
            return 0.0
        with self._lock:
            due = began + moment / self.speed
            late = time.monotonic() - due
            while self._run == run and (left := due - time.monotonic()) > 0.0:
                self._lock.wait(left)
        return max(late, 0.0)

    def _put(self, run: int, samples: NDArray[np.uint16], when: float) -> bool:
        """Samples into the FIFO; False where the measurement is over."""
        with self._lock:
            while self.speed is None and self._run == run and (self._fill > 0 or self._is_full()):
                self._lock.wait(0.5)
            if self._run != run:
                return False
            has_room = self._fill + len(samples) <= FIFO_SIZE
            self._latest = when
            if has_room:
                self._fifo.append((samples, when))
                self._fill += len(samples)
        if not has_room:
            self.overflow(len(samples))
        self._on_samples()
        return has_room


def _with_test_pattern(cube: NDArray[np.uint16], ramps: Ramps, index: int) -> NDArray[np.uint16]:
    """Codes whose RX1, if in use, has the test sequence of the chip.

    It advances with every sample of any receiver, from frame to frame; RX1 shows it.
    """
    if not ramps.has_first_rx:
        return cube
    cube = cube.copy()
    cube[0] = test_pattern(cube.size, index * cube.size)[:: len(cube)].reshape(cube[0].shape)
    return cube
