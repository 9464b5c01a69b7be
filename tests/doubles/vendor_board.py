"""A Strata board behind vendor requests and a bulk endpoint, as boards with vendor-class firmware are."""

from __future__ import annotations

from dataclasses import replace

from doubles.usb_bus import Stall
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.emulator.strata import Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Code, Info, Kind, Request, Response


class VendorBoard:
    """A `Controller` behind vendor requests and a bulk endpoint; a `VendorPeripheral`."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self._is_gone = False
        self._answer: tuple[tuple[int, int, int], Response] | None = None
        self._last = Response(Kind.WRITE, 0)

    def control_out(self, request_type: int, request: int, value: int, index: int, data: bytes) -> None:
        """A write, or the first half of a transfer."""
        self._check()
        asked = Request(request_type, request, value, index, len(data), data)
        self._last = self.controller.handle(asked)
        if request_type == Kind.TRANSFER:
            self._answer = ((request, value, index), self._last)

    def control_in(self, request_type: int, request: int, value: int, index: int, length: int) -> bytes:
        """A read, the second half of a transfer, or the status of what was before."""
        self._check()
        if (request_type, request, value) == (Kind.READ, Code.BOARD_INFO, Info.STATUS):
            return packets.encode_response(replace(self._last, payload=b""))[:4]
        if request_type == Kind.FETCH:
            answer, self._answer = self._answer, None
            if answer is None or answer[0] != (request, value, index) or answer[1].status != 0:
                raise Stall
            return answer[1].payload[:length]
        self._last = self.controller.handle(Request(request_type, request, value, index, length, b""))
        if self._last.status != 0:
            raise Stall
        return self._last.payload

    def send(self, size: int, timeout: float) -> bytes:
        """Data packet."""
        with self.controller.arrived:
            packet = self.controller.arrived.wait_for(lambda: self._is_gone or self.controller.take_packet(), timeout)
            self._check()
        if packet is None:
            return b""
        encoded = packets.encode_data(packet, with_crc=False)
        if self.controller.faults.happens("unplug"):
            self._is_gone = True
            raise Unplugged
        return self.controller.faults.damage(encoded)[:size]

    def unplug(self) -> None:
        """The board is gone."""
        self._is_gone = True
        with self.controller.arrived:
            self.controller.arrived.notify_all()

    def _check(self) -> None:
        if self._is_gone:
            raise Unplugged
