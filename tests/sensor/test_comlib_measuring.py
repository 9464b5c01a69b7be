"""ComLib boards that measure: frames in order, late and lost, a line that is out of step, and how it ends."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from doubles.comlib_boards import Pipe, Ramp, board_with, radar
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.errors import (
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)
from radarcore.sensor.interface import Lost, RawFrame


@pytest.mark.parametrize("is_interleaved", [False, True])
def test_frames_come_as_the_source_gave_them(is_interleaved):
    source = Ramp()
    board = ComLibBoard(Pipe(ComLibEmulator(source, is_interleaved=is_interleaved), size=64))
    board.configure(radar(3))
    board.start()
    frames = [item for _ in range(3) for item in board.read(60.0)]
    board.stop()
    assert all(isinstance(frame, RawFrame) for frame in frames)
    assert [frame.index for frame in frames] == [0, 1, 2]
    for index, frame in enumerate(frames):
        assert frame.codes.dtype == np.uint16
        np.testing.assert_array_equal(frame.codes, Ramp().frame(radar(3), index, 0.0))
    assert [(index, round(begin, 9)) for _, index, begin in source.calls] == [(0, 0.0), (1, 0.05), (2, 0.1)]


def started(emulator: ComLibEmulator) -> ComLibBoard:
    """A board that measures."""
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    return board


def test_temperature_told_with_a_frame_is_no_frame():
    emulator = ComLibEmulator(Ramp())
    board = started(emulator)
    emulator.temperature = 50.0
    (frame,) = board.read(60.0)
    assert isinstance(frame, RawFrame)


class Stepped(ComLibEmulator):
    """Board whose time goes on by hand."""

    now = 0.0

    def _now(self) -> float:
        return self.now


def test_frames_that_were_over_are_reported():
    emulator = Stepped(Ramp(), speed=1.0)
    board = started(emulator)
    emulator.now = 0.06  # [s], an interval takes 50 ms
    (first,) = board.read(60.0)
    emulator.now = 10.0
    lost, second = board.read(60.0)
    assert isinstance(lost, Lost)
    assert first.index == 0
    assert second.index == 1 + lost.num_frames > 100


def test_late_frame_is_that_of_the_next_read():
    emulator = Stepped(Ramp(), speed=1.0)
    board = started(emulator)
    assert board.read(0.0) == []
    emulator.now = 0.06
    (frame,) = board.read(0.0)
    assert frame.index == 0
    # The temperature is asked for once the frame has come; no frame gets lost by that.
    assert board.read(0.0) == []
    emulator.now = 0.11
    assert board.temperature() == pytest.approx(40.0)
    (frame,) = board.read(0.0)
    assert frame.index == 1


def test_stop_and_start_count_from_zero():
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator), timeout=0.1)
    board.configure(radar())
    board.stop()
    for _ in range(2):
        board.start()
        emulator.now += 0.06
        assert board.read(0.0)[0].index == 0
        assert board.read(0.0) == []
        emulator.now += 0.06
        board.stop()
        with pytest.raises(SensorError, match="not measuring"):
            board.read(0.0)


def test_frame_that_never_comes_does_not_hold_up_the_board_for_ever():
    # The board does not even answer what is asked behind it.
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator), timeout=0.05, board_timeout=0.05)
    board.configure(radar(frame_interval=0.01))
    board.start()
    assert board.read(0.0) == []
    with pytest.raises(SensorTimeoutError, match="pipe: no answer"):
        board.temperature()
    emulator.now = 1.0
    assert board.temperature() == pytest.approx(40.0)
    board.stop()


def test_other_threads_get_in_between_frames():
    board = started(ComLibEmulator(Ramp()))
    indices: list[int] = []
    is_over = threading.Event()

    def read() -> None:
        while not is_over.is_set():
            indices.extend(frame.index for frame in board.read(60.0))

    thread = threading.Thread(target=read)
    thread.start()
    temperatures = [board.temperature() for _ in range(20)]
    is_over.set()
    thread.join(60.0)
    board.close()
    assert temperatures == pytest.approx([40.0] * 20)
    assert indices == list(range(len(indices)))


def test_host_finds_step_again_after_damage():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    board = board_with(emulator)
    board.configure(radar())
    board.start()
    pipe = board._stream
    (frame,) = board.read(60.0)
    assert frame.index == 0
    pipe.change = lambda data: b"\x11" + data
    with pytest.raises(ProtocolError, match="pipe: not ComLib: byte 0x11 begins no message"):
        board.read(60.0)
    pipe.change = lambda data: data
    lost, frame = board.read(60.0)
    assert (lost.num_frames, frame.index) == (1, 2)


def test_host_waits_for_a_board_that_has_lost_step():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.3)
    board = ComLibBoard(Pipe(emulator), timeout=0.2, board_timeout=60.0)
    emulator.receive(b"\xc0")
    begin = time.monotonic()
    with pytest.raises(RequestError, match=r"bad start \(0x0002\)"):
        board.temperature()
    assert board.temperature() == pytest.approx(40.0)
    # The board says when it listens again; it is not waited for as long as others may take.
    assert time.monotonic() - begin < 30.0


def test_board_that_was_left_half_way_is_opened():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    # Another program has sent half a request; its rest is taken from the first of ours.
    emulator.receive(bytes.fromhex("5a 01 02 00"))
    assert board_with(emulator).temperature() == pytest.approx(40.0)


def test_silence_is_no_comlib():
    class Silent(ComLibEmulator):
        def receive(self, data: bytes) -> None:
            pass

    with pytest.raises(SensorTimeoutError, match=r"pipe: no answer in 0\.1 s"):
        board_with(Silent(Ramp()))


def test_endless_noise_is_no_comlib():
    class Noise(ComLibEmulator):
        def send(self, size: int, timeout: float) -> bytes:
            time.sleep(0.001)
            return b"\xd3" * size

    with pytest.raises(SensorTimeoutError, match="pipe: the line is never silent"):
        ComLibBoard(NoDiscard(Noise(Ramp())), timeout=0.02, board_timeout=0.05)


class NoDiscard(Pipe):
    """Stream whose discarding ends early, as that of a port does."""

    def discard(self) -> None:
        self.read(65536, 0.0)


def test_unplugged_board_is_disconnected_and_can_be_closed():
    emulator = ComLibEmulator(Ramp())
    board = started(emulator)
    emulator.unplug()
    with pytest.raises(SensorDisconnectedError):
        board.read(60.0)
    board.close()
    board.close()
    assert board._stream.is_closed
