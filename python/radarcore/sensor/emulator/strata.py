"""The board's side of the Strata protocol: a microcontroller between the chip and the host."""

from __future__ import annotations

import struct
import threading
import time
from collections import deque
from dataclasses import dataclass, field, replace

from radarcore import check
from radarcore.sensor.bgt60.registers import FIFO_SIZE
from radarcore.sensor.emulator.chip import Chip
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.emulator.source import FrameSource
from radarcore.sensor.errors import RequestError
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import (
    Avian,
    Code,
    Component,
    Data,
    DataFormat,
    DataPacket,
    Info,
    Kind,
    Request,
    Response,
    Status,
    Version,
)
from radarcore.sensor.strata.slices import pack_msb
from radarcore.sensor.strata.stream import BoardParser

LATENCY = 1e-3
"""Shortest time from a request to its answer [s]: boards take about that, and some hosts fail with less."""

# Slices kept for a host that does not read, by the controller and by the buffers of a host's USB, which a pty does not
# have; then the chip's FIFO overflows.
_MOST_SLICES = 16


@dataclass(frozen=True)
class Identity:
    """Identity that an emulated board reports.

    Attributes
    ----------
    name, extended_version : str
    vendor_id, product_id : int
    version : Version
        Versions of the firmware and the protocol.
    uuid : bytes
        16 of them.
    chip_id : int
        Register CHIP_ID of the radar chip.
    """

    name: str = "Radar Baseboard MCU7 (MCU A)"
    extended_version: str = "radarcore emulator"
    vendor_id: int = 0x058B
    product_id: int = 0x0251
    version: Version = field(default=Version(2, 6, 0))  # a tuple
    uuid: bytes = bytes(12) + b"core"
    chip_id: int = 0x000303


def slice_size_of(payload: bytes) -> int:
    """Samples of a slice from the payload of `Data.CONFIGURE`, read in one burst from a register."""
    if len(payload) not in (8, 12):
        raise RequestError("data configuration", Status.INVALID_SIZE)
    # Eight bytes are settings without a read-out, which is one of no samples.
    data_format, address, size = struct.unpack("<B7xHH", payload.ljust(12, b"\0"))
    if data_format not in (DataFormat.PACKED12, DataFormat.AUTO) or address > 0xFF or size == 0 or size % 2:
        raise RequestError("data configuration", Status.INVALID_PARAMETER)
    if size > FIFO_SIZE:
        raise RequestError("slice size", Status.OVERFLOW)
    return int(size)


class Controller:
    """Answers requests and makes data packets of the chip's samples; transports are for others.

    Parameters
    ----------
    source : FrameSource
        Samples that the chip measures.
    speed : float, optional
        Seconds of the sensor per second of the host; None: as fast as the host reads, and no FIFO overflows.
    identity : Identity
    temperature : float
        [degrees Celsius]
    has_timestamps : bool
        Slices carry the time.
    most_payload : int
        Bytes of samples per packet; slices that are larger come in several packets.
    latency : float
        Time from a request to its answer, at least [s]; real boards take about 1 ms, and hosts may count on that.
    faults : Faults, optional
    """

    def __init__(
        self,
        source: FrameSource,
        *,
        speed: float | None = 1.0,
        identity: Identity | None = None,
        temperature: float = 25.0,
        has_timestamps: bool = True,
        most_payload: int = 3072,
        latency: float = LATENCY,
        faults: Faults | None = None,
    ) -> None:
        self.latency: float = check.non_negative("latency", latency, "s")
        self.identity: Identity = Identity() if identity is None else identity
        self.has_timestamps = has_timestamps
        self.most_payload = most_payload
        self.faults: Faults = Faults() if faults is None else faults
        self.arrived: threading.Condition = threading.Condition()
        """Guards `packets`; notified when there are new ones."""
        self.packets: deque[DataPacket] = deque()
        self.num_sent: int = 0
        """Data packets that were taken, in all."""
        self.num_frames: float = 0.0
        """Frames whose slices were taken, in all, and parts of frames."""
        self._num_slices = 0
        self._counter = 0
        self._slice_size: int | None = None
        self._is_sending = False
        self.chip: Chip = Chip(
            source,
            speed=speed,
            temperature=temperature,
            chip_id=self.identity.chip_id,
            on_samples=self._collect,
            is_full=lambda: self._num_slices >= _MOST_SLICES // 2,
        )

    def close(self) -> None:
        """End measuring."""
        self.chip.close()

    def handle(self, request: Request) -> Response:
        """The answer to a request; failures are in its status."""
        try:
            answer = self._answer(request)
            if request.kind == Kind.READ and len(answer) != request.length:
                raise RequestError("length", Status.BAD_LENGTH)
            return Response(request.kind, 0, answer)
        except RequestError as error:
            return Response(request.kind, error.status, b"")

    def _answer(self, request: Request) -> bytes:
        if request.request == Code.BOARD_INFO:
            return self._board_info(request)
        if request.request == Code.DATA:
            return self._data(request)
        if request.request == Code.COMPONENT:
            return self._component(request)
        raise RequestError("request", Status.REQUEST_UNKNOWN)

    def _board_info(self, request: Request) -> bytes:
        identity, asked = self.identity, (request.kind, request.value)
        if asked == (Kind.TRANSFER, Info.NAME):
            return packets.encode_board_info(identity.vendor_id, identity.product_id, identity.name)
        if asked == (Kind.READ, Info.VERSION):
            return identity.version.encode()
        if asked == (Kind.READ, Info.UUID):
            return identity.uuid
        if asked == (Kind.TRANSFER, Info.EXTENDED_VERSION):
            return identity.extended_version.encode() + b"\0"
        raise RequestError("value", Status.BAD_VALUE)

    def _data(self, request: Request) -> bytes:
        if request.index != 0:
            raise RequestError("data index", Status.OUT_OF_BOUNDS)
        asked = (request.kind, request.value)
        if asked == (Kind.READ, Data.FLAGS):
            return bytes(4)
        if asked == (Kind.WRITE, Data.CONFIGURE):
            self._is_sending = False
            self._slice_size = slice_size_of(request.payload)
        elif asked == (Kind.WRITE, Data.START):
            if self._slice_size is None:
                raise RequestError("data start", Status.NOT_CONFIGURED)
            self._is_sending = True
            self._collect()
        elif asked == (Kind.WRITE, Data.STOP):
            self._is_sending = False
        else:
            raise RequestError("value", Status.BAD_VALUE)
        return b""

    def _component(self, request: Request) -> bytes:
        kind, value, index = request.kind, request.value, request.index
        if (kind, value) == (Kind.READ, Component.COUNT):
            return b"\1" if index == Component.AVIAN else b"\0"
        if value != Component.AVIAN:
            raise RequestError("component type", Status.COMPONENT_TYPE_INVALID)
        if index & 0xF != 0:
            raise RequestError("component id", Status.COMPONENT_ID_INVALID)
        if (kind, index) == (Kind.WRITE, Avian.PIN_RESET_PULSE):
            self.chip.reset()
            self.chip.complains = False
            return b""
        # The next register function reports an overflow once and is still carried out. EXECUTE is a function of the
        # protocol.
        complains = self.chip.complains and index >> 4 & 0xF == Avian.REGISTERS_SET >> 4 & 0xF
        answer = self._registers(kind, index, request.payload)
        if complains:
            self.chip.complains = False
            raise RequestError("overflow", Status.UNEXPECTED_VALUE)
        return answer

    def _registers(self, kind: int, index: int, payload: bytes) -> bytes:
        chip = self.chip
        if index == Avian.EXECUTE and kind in (Kind.WRITE, Kind.TRANSFER):
            answers = chip.execute(packets.decode_commands(payload))
            return packets.encode_values(answers) if kind == Kind.TRANSFER else b""
        if (kind, index, len(payload)) == (Kind.WRITE, Avian.SET_BITS, 4):
            (word,) = packets.decode_values(payload)
            chip.write(word >> 24, chip.read(word >> 24) | word & 0xFFFFFF)
            return b""
        if (kind, index, len(payload) % 4) == (Kind.WRITE, Avian.REGISTERS_WRITE_BURST, 1):
            for offset, value in enumerate(packets.decode_values(payload[:-1])):
                chip.write(payload[-1] + offset, value & 0xFFFFFF)
            return b""
        if (kind, index, len(payload)) == (Kind.TRANSFER, Avian.REGISTERS_READ_BURST, 2):
            number, first = payload
            return packets.encode_values(chip.read(first + offset) for offset in range(number))
        if index in (Avian.EXECUTE, Avian.SET_BITS, Avian.REGISTERS_WRITE_BURST, Avian.REGISTERS_READ_BURST):
            raise RequestError("payload", Status.BAD_PAYLOAD)
        raise RequestError("function", Status.FUNCTION_INVALID)

    def take_packet(self) -> DataPacket | None:
        """The next data packet, with room for another; call with `arrived` held."""
        if not self.packets:
            return None
        packet = self.packets.popleft()
        self.num_sent += 1
        if packet.is_last:
            self._num_slices -= 1
            if packet.error is None and self._slice_size is not None:
                self.num_frames += self._slice_size / max(self.chip.frame_size, 1)
            self._collect()
            self.chip.wake()
        return packet

    def _collect(self) -> None:
        """Slices of the chip's FIFO into packets, as long as there is room for them."""
        with self.arrived:
            while self._is_sending and self._slice_size is not None and self._num_slices < _MOST_SLICES:
                if self.chip.has_samples(self._slice_size) and self.faults.happens("overflow"):
                    self.chip.overflow()
                if self.chip.has_overflown:
                    self._is_sending = False
                    self.packets.append(self._packet(b"", when=None, error=Status.OVERFLOW))
                    self._num_slices += 1
                    break
                taken = self.chip.take(self._slice_size)
                if taken is None:
                    break
                self._add(pack_msb(taken[0]), taken[1])
            self.arrived.notify_all()

    def _add(self, payload: bytes, when: float) -> None:
        size = self.most_payload
        pieces = [payload[first : first + size] for first in range(0, len(payload), size)]
        for number, piece in enumerate(pieces):
            packet = self._packet(piece, when=when if number == len(pieces) - 1 else None)
            self.packets.append(replace(packet, is_first=number == 0, is_last=number == len(pieces) - 1))
        self._num_slices += 1

    def _packet(self, payload: bytes, *, when: float | None, error: int | None = None) -> DataPacket:
        counter = self._counter = (self._counter + self.faults.jump()) % 65536
        self._counter = (counter + 1) % 65536
        timestamp = round(1e6 * when) if when is not None and self.has_timestamps else None
        return DataPacket(payload, counter, timestamp=timestamp, error=error)


class CdcBoard:
    """A `Controller` behind a byte stream, as boards with CDC firmware are; a `StreamPeripheral`."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._parser = BoardParser()
        self._out = bytearray()
        self._answers: deque[tuple[float, bytes]] = deque()  # when they are due, and their bytes
        self._is_gone = False
        self._pause = 0.0

    def receive(self, data: bytes) -> None:
        """Bytes from the host; answers wait for `send`."""
        self._check()
        came = time.monotonic()
        for found in self._parser.feed(data):
            if isinstance(found, Request):
                response = self.controller.handle(found)
            else:
                if found.status == Status.SUCCESS:
                    continue
                response = Response(Kind.WRITE, found.status, b"")
            packet = packets.encode_response(response)
            with self.controller.arrived:
                self._answers.append((came + self.controller.latency, self.controller.faults.damage(packet)))
                self.controller.arrived.notify_all()

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes of one transfer."""
        deadline = time.monotonic() + timeout
        faults, arrived = self.controller.faults, self.controller.arrived
        with arrived:
            while True:
                self._check()
                paused = self._pause - time.monotonic()
                if paused <= 0.0:
                    self._answer()
                    self._fill(size)
                    if self._out:
                        number = min(faults.transfer_size(size), len(self._out))
                        sent = bytes(self._out[:number])
                        del self._out[:number]
                        return sent
                now = time.monotonic()
                left = deadline - now
                if left <= 0.0:
                    return b""
                next_events = [self._pause - now] if paused > 0.0 else [due - now for due, _ in self._answers]
                arrived.wait(max(min([left, *next_events]), 0.0))

    def _answer(self) -> None:
        """Answers that are due, behind what is to be sent."""
        now = time.monotonic()
        while self._answers and self._answers[0][0] <= now:
            self._out += self._answers.popleft()[1]

    def _fill(self, size: int) -> None:
        """Data packets after pending answers, one or a full transfer."""
        faults = self.controller.faults
        while len(self._out) < (size if faults.has_any_transfers else 1):
            packet = self.controller.take_packet()
            if packet is None:
                return
            encoded = packets.encode_data(packet)
            if faults.happens("unplug"):
                self._out += faults.part(encoded)
                self._is_gone = True
                return
            if faults.happens("stall"):
                self._pause = time.monotonic() + faults.stall_time
            self._out += faults.damage(encoded)

    def hang_up(self) -> None:
        """Drop half a request and unread answers; registers and the measurement stay."""
        self._parser.reset()
        with self.controller.arrived:
            self._out.clear()
            self._answers.clear()

    def unplug(self) -> None:
        """Take the board off the bus, whatever is under way."""
        self._is_gone = True
        with self.controller.arrived:
            self.controller.arrived.notify_all()

    def _check(self) -> None:
        if self._is_gone and not self._out:
            raise Unplugged
