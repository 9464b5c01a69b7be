"""A ComLib board, streams to it in the same process, and a radar that it can be."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import astuple
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doubles.boards import numbered
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import Adc, Base, Direction, EndpointType, Fmcw, Protocol, ProtocolStatus
from radarcore.sensor.comlib.messages import (
    AdcSettings,
    Firmware,
    FmcwSettings,
    Format,
    Info,
    Message,
    Parser,
    StatusMessage,
    Temperature,
    encode_number,
)
from radarcore.sensor.emulator.pty import StreamPeripheral, Unplugged
from radarcore.sensor.errors import SensorDisconnectedError
from radarcore.sensor.interface import Damage

NO_ADC = (EndpointType.RBAS, EndpointType.RFMC)
ALL = (*NO_ADC, EndpointType.RADX)
"""Types of the endpoints of a board."""

OVERHEAD_NS = 22_000
"""A chirp lasts longer than its samples: 150 us were measured with 256 samples at 2 MHz."""

FIRMWARE = Firmware(1, 0, 0, "BGT60TR24B radar board, emulated")
INFO = Info(56_000_000, 64_000_000, 2, 4, 31, 1, 1, 0, 0, 0, "BGT60TR24B")


class At(IntEnum):
    """Numbers of the endpoints."""

    PROTOCOL = 0
    BASE = 1
    FMCW = 2
    ADC = 3


class ComLibDouble:
    """A `StreamPeripheral` with the endpoints RBAS, RFMC and, if wanted, RADX.

    It tells what follows from a setting before the status, discards everything after an error until the line has been
    silent, and sends a frame only when asked. It takes all settings.

    Parameters
    ----------
    codes : callable
        Codes of the frame of a shape (rx, chirp, sample) and a number.
    clock : callable, optional
        Time [s]: a frame is ready an interval after the last one, and over when the next is. Default: frames are ready
        whenever they are asked for, and none is ever lost.
    other_answers : dict
        By endpoint and code of a request: a payload, or a status, in place of the answer.
    types : sequence of int
        Types of the endpoints.
    """

    patience = 10.0
    """Silence after which an incomplete message is given up [s]."""

    def __init__(
        self,
        codes: Callable[[tuple[int, ...], int], NDArray[np.uint16]] = numbered,
        *,
        clock: Callable[[], float] | None = None,
        other_answers: Mapping[tuple[int, int], bytes | int] | None = None,
        types: tuple[int, ...] = ALL,
    ) -> None:
        self.ramp = FmcwSettings(57_000_000, 64_000_000, Direction.UP, 31)
        self.adc = AdcSettings(2_000_000)
        self.form = Format(64, 16, 0xF)
        self.interval = 0  # [us]
        self.is_gone = False
        self._codes, self._clock, self._other_answers, self._types = codes, clock, other_answers or {}, types
        self._began, self._next_index = 0.0, 0
        self._parser, self._last_byte = Parser(), 0.0
        self._is_confused = False
        self._waiting: list[Message | StatusMessage] = []
        self._out = bytearray()
        self._changed = threading.Condition()

    def receive(self, data: bytes) -> None:
        """Bytes from the host, cut anywhere."""
        with self._changed:
            self._look()
            self._last_byte = time.monotonic()
            for item in self._parser.feed(data):
                if not isinstance(item, Damage):
                    self._waiting.append(item)
                elif item.status:
                    self._is_confused = True
                    self._waiting.append(StatusMessage(0, item.status))
            self._changed.notify_all()

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes of one transfer to the host: 1 to `size`, none when nothing is to be sent within `timeout` [s]."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                self._look()
                left = deadline - time.monotonic()
                if self._out or left <= 0.0:
                    break
                self._changed.wait(min(left, 2e-3))
            data = bytes(self._out[:size])
            del self._out[:size]
            return data

    def hang_up(self) -> None:
        """Forget half a request and answers nobody has taken."""
        with self._changed:
            self._parser.reset()
            self._waiting.clear()
            self._out.clear()

    def _look(self) -> None:
        """Answer what has come, up to a frame that is not ready."""
        if self.is_gone:
            raise Unplugged
        if (self._is_confused or self._parser.num_held) and time.monotonic() > self._last_byte + self.patience:
            self._parser.reset()
            self._is_confused = False
            self._waiting.append(StatusMessage(0, ProtocolStatus.SILENCE))
        while self._waiting:
            item = self._waiting[0]
            if isinstance(item, StatusMessage):
                self._out += item.encode()
            elif (item.endpoint, item.code) == (At.BASE, Base.GET_FRAME) and self._num_over <= self._next_index:
                break
            else:
                self._answer(item)
            del self._waiting[0]

    def _answer(self, request: Message) -> None:
        answer = self._other_answers.get((request.endpoint, request.code))
        status = 0
        if isinstance(answer, int):
            messages, status = [], answer
        elif answer is not None:
            messages = [Message(request.endpoint, answer)]
        else:
            messages = self._messages(request)
        for message in messages:
            self._out += message.encode()
        self._out += StatusMessage(request.endpoint, status).encode()

    @property
    def _num_over(self) -> int:
        """Frames that are over or ready."""
        if self._clock is None:
            return self._next_index + 1
        return int((self._clock() - self._began) * 1e6 / self.interval)

    @property
    def _chirp_duration(self) -> int:
        """Duration of a chirp [ns]."""
        return round(self.form.num_samples / self.adc.sample_rate * 1e9) + OVERHEAD_NS

    def _messages(self, request: Message) -> list[Message]:
        """Messages of the answer to a request."""
        payload, duration = request.payload, self._chirp_duration
        temperature = Message(At.BASE, Temperature(0, 40_000).encode())
        timing = [
            Message(At.BASE, encode_number(Base.CHIRP_DURATION, duration)),
            Message(At.BASE, encode_number(Base.MIN_INTERVAL, -(-self.form.num_chirps * duration // 1000))),
        ]
        match request.endpoint, request.code:
            case At.PROTOCOL, Protocol.ENDPOINTS:
                return [Message(At.PROTOCOL, endpoints_payload(self._types))]
            case At.PROTOCOL, Protocol.FIRMWARE:
                return [Message(At.PROTOCOL, described_payload(FIRMWARE))]
            case At.BASE, Base.SET_INTERVAL:
                self.interval = int.from_bytes(payload[1:], "little")
                self._began, self._next_index = self._clock() if self._clock else 0.0, 0
                return []
            case At.BASE, Base.GET_FRAME:
                self._next_index = self._num_over
                form = self.form
                shape = (form.rx_mask.bit_count(), form.num_chirps, form.num_samples)
                number = self._next_index - 1
                return [Message(At.BASE, frame_payload(number, self._codes(shape, number), form.rx_mask)), temperature]
            case At.BASE, Base.GET_INFO:
                return [Message(At.BASE, described_payload(INFO))]
            case At.BASE, Base.GET_TEMPERATURE:
                return [temperature]
            case At.BASE, Base.GET_CHIRP_DURATION:
                return timing[:1]
            case At.BASE, Base.GET_MIN_INTERVAL:
                return timing[1:]
            case At.BASE, Base.GET_FORMAT:
                return [Message(At.BASE, self.form.encode())]
            case At.BASE, Base.FORMAT:
                self.form = Format.decode(payload)
                return [*timing, Message(At.BASE, payload)]
            case At.FMCW, Fmcw.GET_SETTINGS:
                return [Message(At.FMCW, self.ramp.encode())]
            case At.FMCW, Fmcw.SETTINGS:
                self.ramp = FmcwSettings.decode(payload)
                return [Message(At.FMCW, payload)]
            case At.FMCW, Fmcw.SLOPE:
                slope = round((self.ramp.upper_khz - self.ramp.lower_khz) / duration * 1e6)  # [MHz/s]
                return [Message(At.FMCW, encode_number(Fmcw.SLOPE, slope))]
            case At.ADC, Adc.GET_SETTINGS:
                return [Message(At.ADC, self.adc.encode())]
            case At.ADC, Adc.SETTINGS:
                self.adc = AdcSettings.decode(payload)
                return [*timing, Message(At.ADC, payload)]
        raise AssertionError(f"the driver sends no such request: {request}")


def endpoints_payload(types: tuple[int, ...]) -> bytes:
    """Answer to the query of endpoints; the first is endpoint 1, and all have version 1."""
    records = b"".join(struct.pack("<IH", kind, 1) for kind in types)
    return bytes([Protocol.ENDPOINTS, len(types)]) + records


def described_payload(record: Firmware | Info) -> bytes:
    """Payload of numbers with a text behind them."""
    *numbers, text = astuple(record)
    return struct.pack(f"<B{record._layout}", record._code, *numbers) + text.encode() + b"\0"


def frame_payload(number: int, codes: NDArray[np.uint16], rx_mask: int, *, is_interleaved: bool = False) -> bytes:
    """Payload of a frame: chirp by chirp, receivers one after the other or in turn, 12 bits each, the lowest first."""
    num_rx, num_chirps, num_samples = codes.shape
    shape = (num_chirps, num_rx, num_samples)
    head = struct.pack("<BIIBIBBBB", Base.FRAME, number, *shape, rx_mask, 0, 12, is_interleaved)
    stream = codes.transpose((1, 2, 0) if is_interleaved else (1, 0, 2)).reshape(-1, 1)
    bits = np.unpackbits(stream.astype("<u2").view(np.uint8), axis=1, bitorder="little")[:, :12]
    return head + np.packbits(bits, bitorder="little").tobytes()


class Pipe:
    """Stream to an emulated board in the same process; `change` is applied to what comes from it."""

    name = "pipe"

    def __init__(self, board: StreamPeripheral, size: int = 16384) -> None:
        self.board = board
        self.size = size
        self.change: Callable[[bytes], bytes] = lambda data: data
        self.is_closed = False

    def read(self, size: int, timeout: float) -> bytes:
        try:
            return self.change(self.board.send(min(size, self.size), timeout))
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def write(self, data: bytes, timeout: float) -> None:
        try:
            self.board.receive(data)
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def close(self) -> None:
        self.is_closed = True


def radar(num_rx: int = 4, *, num_tx: int = 1, **waveform: Any) -> Radar:
    """A radar that the board can be, but for what is changed."""
    values = {
        "start_frequency": 57e9,
        "slope": 40e12,
        "sample_rate": 2e6,
        "num_samples": 64,
        "num_chirps": 16,
        "frame_interval": 0.05,
    }
    return Radar(
        Waveform(**(values | waveform)),
        tx=np.zeros((num_tx, 3)),
        rx=np.zeros((num_rx, 3)),
        receiver=Receiver(output="real", noise_figure_db=12.0),
    )


def board_of(double: StreamPeripheral | None = None, *, size: int = 16384, **options: Any) -> ComLibBoard:
    """Board at the end of a pipe, by default with a double of its own."""
    return ComLibBoard(Pipe(double or ComLibDouble(), size), **options)
