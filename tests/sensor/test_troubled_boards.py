"""Boards in trouble while they measure: long packets, damage, silence, answers that get lost."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import pytest

import radarcore as rc
from doubles import comlib_boards
from doubles.boards import LARGE, SMALL, TRANSPORTS, Numbered, change_answers, number_of, opened
from doubles.usb_bus import bus_with, cdc_device, vendor_device
from doubles.vendor_board import VendorBoard
from radarcore.sensor import Sensor, SensorTimeoutError, device, open_sensor
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import Base
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.interface import RawFrame
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Avian, Code, Data, DataPacket, Kind, Request
from radarcore.sensor.strata.stream import BoardParser
from short_requests import shorten_requests

# Long packets


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_slices_may_come_in_packets_of_any_size(transport: str) -> None:
    with opened(Controller(Numbered(), speed=None, most_payload=20_000), transport, radar=LARGE) as sensor:
        assert [number_of(frame.raw) for frame in sensor.frames(5)] == [0, 1, 2, 3, 4]
        assert sensor.num_lost == 0


def test_packet_that_claims_more_than_comes_delays_the_next_ones_for_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    encode = packets.encode_data

    def claiming(packet: DataPacket, *, with_crc: bool = True) -> bytes:
        data = encode(packet, with_crc=with_crc)
        return data[:5] + b"\xff" + data[6:] if packet.counter == 3 else data

    monkeypatch.setattr(packets, "encode_data", claiming)
    with opened(Controller(Numbered())) as sensor:
        sensor.configure(rc.bgt60tr13c(num_samples=8, num_chirps=8, frame_interval=50e-3))
        frames = sensor.frames()
        given = [next(frames) for _ in range(3)]
        began = time.monotonic()
        with pytest.warns(rc.sensor.FramesLostWarning, match="1 lost: packet that never became whole"):
            given.append(next(frames))
        assert time.monotonic() - began < 6.0  # 65 kB of such frames are 12 s
        assert [number_of(frame.raw) for frame in given] == [0, 1, 2, 4]
        frames.close()


# Damage


def damaging(monkeypatch: pytest.MonkeyPatch, change: Callable[[bytes, DataPacket], bytes], first: int = 1) -> None:
    """Change the bytes of data packets, from a counter on."""
    encode = packets.encode_data

    def damaged(packet: DataPacket, *, with_crc: bool = True) -> bytes:
        data = encode(packet, with_crc=with_crc)
        return data if packet.counter < first else change(data, packet)

    monkeypatch.setattr(packets, "encode_data", damaged)


def flipped(data: bytes, packet: DataPacket) -> bytes:
    return data[:-1] + bytes([data[-1] ^ 1])


def timed_out(sensor: Sensor, num_frames: int = 1) -> str:
    """Message of the time-out behind the first frames."""
    sensor.configure(SMALL)
    frames = sensor.frames(timeout=0.4)
    for index in range(num_frames):
        assert number_of(next(frames).raw) == index
    with pytest.raises(SensorTimeoutError) as caught:
        next(frames)
    return str(caught.value)


def test_damaged_packets_stand_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, flipped)
    with opened(Controller(Numbered())) as sensor:
        message = timed_out(sensor)
    # Slices of 768 samples: 1152 bytes, and 16 of header, time stamp and CRC around them; all in one place, as no
    # good packet comes between.
    found = re.fullmatch(
        r"usb:1-1: no frame within 0\.4 s; (\d+) bytes dropped at 1 place \(bad CRC of a packet of 1168 bytes\)"
        r"(, \d+ bytes? of a packet that is not whole)?",
        message,
    )
    assert found is not None, message
    assert int(found[1]) >= 5 * 1168


def test_damaged_packets_of_a_vendor_board_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, lambda data, packet: data[:-1])
    with opened(Controller(Numbered()), "vendor") as sensor:
        message = timed_out(sensor)
    found = re.search(r"; (\d+) bytes dropped at (\d+) places \(.*expected 6 \+ 1160 bytes, got 1165\)$", message)
    assert found is not None, message
    assert int(found[1]) == 1165 * int(found[2]) >= 5 * 1165


def test_lost_packets_stand_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every second packet of slices of two is missing."""
    damaging(monkeypatch, lambda data, packet: b"" if packet.counter % 2 else data, first=2)
    with opened(Controller(Numbered(), most_payload=768)) as sensor:
        message = timed_out(sensor)
    found = re.search(r"; (\d+) packets lost$", message)
    assert found is not None, message
    assert int(found[1]) >= 2 * 5


def test_damage_before_a_good_frame_is_not_told_later(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, lambda data, packet: flipped(data, packet) if packet.counter == 1 else data)
    controller = Controller(Numbered())
    with opened(controller) as sensor, pytest.warns(rc.sensor.FramesLostWarning, match="bad CRC"):  # noqa: PT031
        sensor.configure(SMALL)
        frames = sensor.frames(timeout=0.4)
        assert [number_of(next(frames).raw) for _ in range(2)] == [0, 2]
        controller.chip.close()
        with pytest.raises(SensorTimeoutError, match=r"no frame within 0\.4 s$"):  # noqa: PT012  # some had come
            for _ in range(1000):
                next(frames)


def test_noise_in_place_of_an_answer_stands_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_requests(monkeypatch, 0.5)
    encode = packets.encode_response
    with PtyPort(CdcBoard(Controller(Numbered()))) as port:
        monkeypatch.setattr(packets, "encode_response", lambda response: encode(response)[:-1] + b"\0")
        message = (
            r"within 1 s; 22 bytes dropped at 1 place \(bytes before the first whole packet\)"
            r"|within 1 s; 22 bytes of a packet that is not whole"
        )
        with pytest.raises(SensorTimeoutError, match=message):
            open_sensor(port.path, protocol="strata")


# Silence


class Mute:
    """A board of any kind that falls silent, and hears nothing, from a moment on."""

    def __init__(self, board: Any) -> None:
        self.board = board
        self.is_mute = False
        self.heard: list[bytes] = []

    def receive(self, data: bytes) -> None:
        if not self.is_mute:
            self.board.receive(data)
            self.heard.clear()
        self.heard.append(data)

    def send(self, size: int, timeout: float) -> bytes:
        if self.is_mute:
            time.sleep(timeout)
            return b""
        return self.board.send(size, timeout)

    def control_out(self, *arguments: Any) -> None:
        if self.is_mute:
            raise TimeoutError
        self.board.control_out(*arguments)

    def control_in(self, *arguments: Any) -> bytes:
        if self.is_mute:
            raise TimeoutError
        return self.board.control_in(*arguments)


@contextmanager
def mute_board(kind: str) -> Iterator[tuple[Mute, Sensor]]:
    """A board that measures SMALL, or part of it, and its sensor."""
    radar, options = SMALL, {}
    controller = Controller(Numbered())
    if kind == "comlib":
        board = Mute(comlib_boards.ComLibDouble(clock=time.monotonic))
        radar, options = rc.Radar(SMALL.waveform, rx=[[0.0, 0.0, 0.0]], receiver=SMALL.receiver), {"rx_mask": 1}
        plugged = cdc_device(board, product_id=0x0058)
    elif kind == "vendor":
        plugged = vendor_device(board := Mute(VendorBoard(controller)))
    else:
        plugged = cdc_device(board := Mute(CdcBoard(controller)))
    with open_sensor(usb_backend=bus_with(plugged)) as sensor:
        sensor.configure(radar, **options)
        yield board, sensor
    controller.close()


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")  # of hosts that are too busy to ask in time
@pytest.mark.parametrize("kind", ["cdc", "vendor", "comlib"])
def test_board_that_falls_silent_is_told_and_measures_again_when_it_is_back(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert device._SILENCE == 2.0
    monkeypatch.setattr(device, "_SILENCE", 0.4)
    with mute_board(kind) as (board, sensor):
        frames = sensor.frames()
        next(frames)
        board.is_mute = True
        began = time.monotonic()
        with pytest.raises(SensorTimeoutError, match=r"usb:1-1: no frame within 0\.42\d* s"):  # noqa: PT012
            while True:
                next(frames)  # one may have been on its way
        assert 0.4 < time.monotonic() - began < 6.4, "with a stop that nobody answers"
        board.is_mute = False
        assert [number_of(frame.raw) for frame in sensor.frames(2)] == [0, 1]
        board.is_mute = True
        began = time.monotonic()
        sensor.close()
        assert time.monotonic() - began < 3.0


@pytest.mark.parametrize("kind", ["cdc", "vendor", "comlib"])
def test_board_that_is_silent_at_the_start_is_told_soon(kind: str) -> None:
    with mute_board(kind) as (board, sensor):
        if kind == "comlib":
            sensor._board._timeout = 0.3
        board.is_mute = True
        began = time.monotonic()
        with pytest.raises(SensorTimeoutError, match=r"usb:1-1: (no answer|the board did not answer)"):
            next(sensor.frames())
        assert time.monotonic() - began < 8.0
        sensor.close()
        assert time.monotonic() - began < 12.0


def test_slow_frames_are_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "_SILENCE", 0.1)
    with opened(Controller(Numbered())) as sensor:
        sensor.configure(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=0.4))
        assert [number_of(frame.raw) for frame in sensor.frames(2)] == [0, 1]


# Answers that get lost


class Losing(CdcBoard):
    """A board whose answer to a request gets lost, a number of times; it records received starts and stops."""

    def __init__(self, controller: Controller, lost: Callable[[Request], bool], number: int = 1) -> None:
        super().__init__(controller)
        self.lost, self.number = lost, number
        self.told: list[str] = []

    def receive(self, data: bytes) -> None:
        (request,) = BoardParser().feed(data)
        assert isinstance(request, Request)
        if request.request == Code.DATA and request.value in (Data.START, Data.STOP):
            self.told.append("start" if request.value == Data.START else "stop")
        if is_trigger(request):
            self.told.append("trigger")
        if self.number > 0 and self.lost(request):
            self.number -= 1
            self.controller.handle(request)
        else:
            super().receive(data)


def is_trigger(request: Request) -> bool:
    """Words for the chip; the last starts its frames."""
    is_execute = request.kind == Kind.WRITE and request.index == Avian.EXECUTE
    return is_execute and len(request.payload) > 32 and bool(request.payload[-1] & 1)


@contextmanager
def losing_board(
    monkeypatch: pytest.MonkeyPatch, lost: Callable[[Request], bool], number: int = 1
) -> Iterator[tuple[Losing, Sensor]]:
    controller = Controller(Numbered())
    board = Losing(controller, lost, number)
    # Only the lost answers; longer than for a board that has never answered.
    shorten_requests(monkeypatch, 0.35, lambda request: board.number > 0 and lost(request))
    with open_sensor(usb_backend=bus_with(cdc_device(board))) as sensor:
        sensor.configure(SMALL)
        board.told.clear()
        yield board, sensor
    controller.close()


@pytest.mark.parametrize(
    ("lost", "told"),
    [
        (lambda asked: (asked.request, asked.value) == (Code.DATA, Data.START), ["start", "stop", "start", "trigger"]),
        (is_trigger, ["start", "trigger", "stop", "start", "trigger"]),
    ],
    ids=["data", "chip"],
)
def test_lost_answer_to_a_start_is_followed_by_a_stop(
    lost: Callable[[Request], bool], told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with losing_board(monkeypatch, lost) as (board, sensor):
        assert [number_of(frame.raw) for frame in sensor.frames(3)] == [0, 1, 2]
        assert board.told == [*told, "stop"]


def test_start_that_is_never_answered_is_given_up_after_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    with losing_board(monkeypatch, is_trigger, 3) as (board, sensor):
        with pytest.raises(SensorTimeoutError, match="no answer to request 0x20"):
            next(sensor.frames())
        assert board.told == ["start", "trigger", "stop"] * 3
        assert [number_of(frame.raw) for frame in sensor.frames(2)] == [0, 1]


def test_start_that_tells_of_an_overflow_is_stopped_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chip may have executed the words all the same."""
    left = [1]

    def complaining(request: Request, answer: packets.Response) -> packets.Response:
        return packets.Response(request.kind, 0x05) if is_trigger(request) and left and left.pop() else answer

    change_answers(monkeypatch, complaining)
    with losing_board(monkeypatch, lambda request: False) as (board, sensor):
        assert [number_of(frame.raw) for frame in sensor.frames(2)] == [0, 1]
        assert board.told == ["start", "trigger", "stop", "start", "trigger", "stop"]


def test_lost_answer_to_a_start_of_a_comlib_board_is_followed_by_a_stop() -> None:
    class Pipe(comlib_boards.Pipe):
        lost = 1
        intervals: ClassVar[list[int]] = []

        def write(self, data: bytes, timeout: float) -> None:
            super().write(data, timeout)
            if (data[1], data[4]) == (1, Base.SET_INTERVAL):
                self.intervals.append(int.from_bytes(data[5:9], "little"))
                if self.intervals[-1] and self.lost:
                    self.lost -= 1
                    while self.board.send(65536, 0.0):
                        pass

    board = ComLibBoard(Pipe(comlib_boards.ComLibDouble()), timeout=0.2)
    board.configure(comlib_boards.radar())
    Pipe.intervals.clear()
    began = time.monotonic()
    board.start()
    assert Pipe.intervals == [50_000, 0, 50_000]
    assert time.monotonic() - began < 5.0
    (frame,) = board.read(5.0)
    assert isinstance(frame, RawFrame)
    assert frame.index == 0
    board.close()
    assert Pipe.intervals == [50_000, 0, 50_000, 0]
