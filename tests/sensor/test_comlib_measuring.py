"""ComLib boards that measure: frames in order, late and lost, a line that is out of step, and how it ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

import numpy as np
import pytest

from doubles.comlib_boards import Pipe, Ramp, board_with, radar
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import Base
from radarcore.sensor.comlib.messages import (
    AdcSettings,
    FmcwSettings,
    Format,
    HostParser,
    Message,
    StatusMessage,
    encode_number,
)
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
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.1)
    board = ComLibBoard(Pipe(emulator), timeout=0.05, board_timeout=60.0)
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


class Silent(ComLibEmulator):
    def receive(self, data: bytes) -> None:
        pass


class Noise(ComLibEmulator):
    def send(self, size: int, timeout: float) -> bytes:
        time.sleep(0.001)
        return b"\xd3" * size


@pytest.mark.parametrize(("kind", "message"), [(Silent, r"no answer in 0\.05 s"), (Noise, "the line is never silent")])
def test_silence_and_endless_noise_are_no_comlib(kind, message):
    with pytest.raises(SensorTimeoutError, match=f"pipe: {message}"):
        ComLibBoard(NoDiscard(kind(Ramp())), timeout=0.05, board_timeout=0.05)


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


# The emulator, byte by byte


def talk(emulator: ComLibEmulator, endpoint: int, payload: bytes) -> list[Message | StatusMessage]:
    """Everything that a request is answered with."""
    emulator.receive(Message(endpoint, payload).encode())
    parser = HostParser()
    found = []
    while data := emulator.send(7, 0.0):
        found += parser.feed(data)
    assert parser.is_idle
    return found


def codes_of(answer: Sequence[Message | StatusMessage]) -> list[tuple[int, int]]:
    return [
        (item.endpoint, item.code if isinstance(item, Message) else -1 - item.status)
        for item in answer
    ]  # fmt: skip


OK = -1


def test_emulator_tells_what_follows_from_a_setting():
    emulator = ComLibEmulator(Ramp())
    assert codes_of(talk(emulator, 1, Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (3, 0x01), (2, 0x02), (1, OK),
    ]  # fmt: skip
    ramp = FmcwSettings(57_000_000, 64_000_000, 0, 31)
    assert codes_of(talk(emulator, 2, ramp.encode())) == [(1, 0x33), (1, 0x33), (2, 0x01), (2, OK)]
    assert codes_of(talk(emulator, 3, AdcSettings(1_000_000).encode())) == [(1, 0x35), (1, 0x37), (3, 0x01), (3, OK)]
    without = ComLibEmulator(Ramp(), has_adc=False)
    assert codes_of(talk(without, 1, Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (2, 0x02), (1, OK),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("endpoint", "payload", "status"),
    [
        (0, b"\x07", 0xFFFF),
        (1, b"\x01", 0xFFFF),
        (1, encode_number(0x02, 1), 0x05),
        (1, bytes(8).replace(b"\0", b"\x03", 1), 0x03),
        (1, b"\x30\x01", 0x07),
        (1, b"\x32\x02", 0x06),
        (1, Format(64, 16, 0x10).encode(), 0x06),
        (1, Format(0, 16, 1).encode(), 0x08),
        (1, Format(64, 16, 1, 2).encode(), 0x0B),
        (2, FmcwSettings(55_999_999, 64_000_000, 0, 0).encode(), 0x09),
        (2, FmcwSettings(57_000_000, 64_000_000, 0, 32).encode(), 0x0A),
        (2, FmcwSettings(57_000_000, 64_000_000, 2, 0).encode(), 0x20),
        (3, AdcSettings(3_000_001).encode(), 0x50),
        (3, AdcSettings(1_000_000, 10).encode(), 0x51),
    ],
)
def test_emulator_refuses_with_the_status_of_the_protocol(endpoint, payload, status):
    assert talk(ComLibEmulator(Ramp()), endpoint, payload) == [StatusMessage(endpoint, status)]


def test_frame_that_is_not_ready_is_refused_or_held_back():
    # A frame every 100 ms, which takes days of the clock.
    emulator = ComLibEmulator(Ramp(), speed=1e-6)
    talk(emulator, 1, encode_number(0x02, 100_000))
    assert talk(emulator, 1, b"\x01\x00") == [StatusMessage(1, 0x02)]
    assert talk(emulator, 1, b"\x01\x01") == []
    # The next request waits behind it.
    assert talk(emulator, 1, b"\x22") == []


def test_frame_comes_when_its_interval_is_over():
    emulator = ComLibEmulator(Ramp(), speed=2.0)
    talk(emulator, 1, encode_number(0x02, 100_000))
    begin = time.monotonic()
    emulator.receive(Message(1, b"\x01\x01").encode())
    data = emulator.send(100, 60.0)
    # Half the interval, less what passed before the clock was read.
    assert data
    assert time.monotonic() - begin > 0.02
    assert data[4] == Base.FRAME
