"""Vendor-class USB boards, on an emulated bus: control transfers and packets."""

from __future__ import annotations

import time
from typing import Any

import pytest

from doubles.small_boards import HANG, Call, Requests, Stall, Unplugged
from doubles.usb_bus import EmulatedBus, vendor_device, vendor_port_to
from radarcore.sensor.errors import ProtocolError, SensorDisconnectedError, SensorTimeoutError
from radarcore.sensor.transport.stream import Stalled
from radarcore.sensor.transport.usbport import UsbVendorPort


def test_control_transfers_carry_their_requests() -> None:
    board = Requests()
    port, _, device = vendor_port_to(board)
    assert device.claimed_interfaces == {0}
    port.control_write(0x40, 0x20, 0x0103, 0x0310, b"\x01\x02", 1.0)
    port.control_write(0x43, 0x80, 0x0000, 0x0000, b"", 1.0)
    assert port.control_read(0xC3, 0x20, 0x0103, 0x0310, 4096, 1.0) == b"\x01\x02"
    assert port.control_read(0xC0, 0x20, 0x0103, 0x0310, 1, 1.0) == b"\x01"
    assert port.control_read(0xC0, 0x80, 0x0000, 0x0000, 0, 1.0) == b""
    assert board.types == [0x40, 0x43, 0xC3, 0xC0, 0xC0]
    port.close()


def test_refused_control_transfers_are_stalled_and_the_next_ones_are_not() -> None:
    board = Requests()
    port, _, _ = vendor_port_to(board)
    with pytest.raises(Stalled):
        port.control_read(0xC0, 1, 2, 3, 4, 1.0)
    board.failure = Stall
    with pytest.raises(Stalled):
        port.control_write(0x40, 1, 2, 3, b"abcd", 1.0)
    board.failure = None
    port.control_write(0x40, 1, 2, 3, b"abcd", 1.0)
    assert port.control_read(0xC0, 1, 2, 3, 4, 1.0) == b"abcd"
    port.close()


def test_board_that_does_not_answer_and_one_that_is_unplugged_are_errors() -> None:
    board = Requests()
    port, _, _ = vendor_port_to(board)
    for failure, error in ((TimeoutError, SensorTimeoutError), (Unplugged, SensorDisconnectedError)):
        board.failure = failure
        with pytest.raises(error):
            port.control_read(0xC0, 1, 2, 3, 4, 1.0)
    with pytest.raises(SensorDisconnectedError):
        port.read_packet(512, HANG)
    port.close()


def test_one_packet_is_read_at_a_time() -> None:
    # 512 and 15872 bytes end with a transfer of no bytes, which is no packet.
    packets = [b"a" * 10, b"b" * 512, b"c" * 15_872, b"d" * 1000, b"e"]
    port, _, _ = vendor_port_to(Requests(*packets))
    assert [port.read_packet(15_872, HANG) for _ in packets] == packets
    assert port.read_packet(15_872, 0.0) == b""
    port.close()


def test_buffer_need_not_be_whole_usb_packets() -> None:
    port, _, _ = vendor_port_to(Requests(b"a" * 700, b"b" * 701))
    assert port.read_packet(700, HANG) == b"a" * 700
    with pytest.raises(ProtocolError, match="expected a packet of at most 700 bytes, got a longer one"):
        port.read_packet(700, HANG)
    port.close()


def test_packet_cut_by_the_end_of_a_wait_is_put_together() -> None:
    class Cut(EmulatedBus):
        """Gives the first packet of a transfer at the end of the wait, as libusb gives what has come by then."""

        num_reads = 0

        def bulk_read(self, *arguments: Any) -> int:
            self.num_reads += 1
            if self.num_reads == 1:
                time.sleep(arguments[-1] / 1000.0)
                arguments[3][:512] = type(arguments[3])("B", b"a" * 512)
                return 512
            return super().bulk_read(*arguments)

    bus = Cut()
    bus.plug(vendor_device(Requests(b"b" * 300, b"c")))
    port = UsbVendorPort("usb:1-1", usb_backend=bus)
    assert port.read_packet(1024, 0.02) == b"a" * 512 + b"b" * 300
    assert port.read_packet(1024, HANG) == b"c"
    port.close()


def test_closing_a_vendor_port_ends_a_read_that_waits() -> None:
    port, _, _ = vendor_port_to(Requests())
    call = Call(lambda: port.read_packet(512, 10 * HANG))
    Call(port.close).result()
    with pytest.raises(SensorDisconnectedError, match="the port has been closed"):
        call.result()
