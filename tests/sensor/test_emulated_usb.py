"""USB boards through pyusb's own code, on an emulated bus."""

from __future__ import annotations

import errno
import json
import random
import subprocess
import sys
import time
from typing import Any

import pytest
import usb.core
import usb.util

from radarcore.sensor.emulator.usb import EmulatedBus, EmulatedDevice, cdc_device, vendor_device
from radarcore.sensor.errors import (
    ProtocolError,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
)
from radarcore.sensor.transport import (
    UDEV_RULE,
    Port,
    Stalled,
    UsbStream,
    UsbVendorPort,
    describe_usb,
    find_ports,
    open_stream,
    open_vendor_port,
)
from small_boards import HANG, Call, Loopback, Requests, Stall, Unplugged, read_all


def bus_with(*devices: EmulatedDevice) -> EmulatedBus:
    bus = EmulatedBus()
    for device in devices:
        bus.plug(device)
    return bus


def stream_to(peripheral: Loopback, **options: Any) -> tuple[UsbStream, EmulatedBus, EmulatedDevice]:
    device = cdc_device(peripheral, **options)
    bus = bus_with(device)
    return UsbStream("usb:1-1", usb_backend=bus), bus, device


def vendor_port_to(peripheral: Requests, **options: Any) -> tuple[UsbVendorPort, EmulatedBus, EmulatedDevice]:
    device = vendor_device(peripheral, **options)
    bus = bus_with(device)
    return UsbVendorPort("usb:1-1", usb_backend=bus), bus, device


# Finding


def test_boards_are_found_by_their_ids() -> None:
    bus = bus_with(
        cdc_device(Loopback(), serial_number="0815"),
        cdc_device(Loopback(), vendor_id=0x0403, product_id=0x6001),  # somebody else's
        cdc_device(Loopback(), product_id=0x0058, product="IFX CDC"),
        vendor_device(Requests(), product_id=0x0256, product="KIT"),
    )
    assert find_ports(usb_backend=bus, with_serial=False) == [
        Port("usb-cdc", "usb:1-1", 0x058B, 0x0251, "IFX_CDC", "0815", "Radar Baseboard MCU7"),
        Port("usb-cdc", "usb:1-3", 0x058B, 0x0058, "IFX CDC", "", "XMC board with ComLib, or another XMC product"),
        Port("usb-vendor", "usb:1-4", 0x058B, 0x0256, "KIT", "", "KIT_60TR13C_EMBEDD_UNL"),
    ]


def test_board_without_permission_is_listed_and_says_so() -> None:
    device = cdc_device(Loopback(), serial_number="0815")
    device.is_denied = True
    (port,) = find_ports(usb_backend=bus_with(device), with_serial=False)
    assert (port.path, port.product, port.serial_number) == ("usb:1-1", "", "")
    assert "no permission" in port.description


@pytest.mark.parametrize(
    ("location", "serial_number", "paths"),
    [
        ("1-1:1.0", "", ["/dev/ttyACM0"]),  # the same place
        ("1-2:1.0", "A", ["/dev/ttyACM0", "usb:1-1"]),  # another board of the same kind
        (None, "A", ["/dev/ttyACM0"]),  # the same serial number, where the system knows no places
        (None, "B", ["/dev/ttyACM0", "usb:1-1"]),
    ],
)
def test_board_that_is_a_tty_is_listed_once(
    monkeypatch: pytest.MonkeyPatch, location: str | None, serial_number: str, paths: list[str]
) -> None:
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    ports = [ListPortInfo(f"/dev/{name}") for name in ("ttyS0", "ttyUSB0", "ttyACM0")]
    ports[1].vid, ports[1].pid = 0x0403, 0x6001  # somebody else's
    tty = ports[2]
    tty.vid, tty.pid, tty.location, tty.serial_number = 0x058B, 0x0251, location, serial_number
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    bus = bus_with(cdc_device(Loopback(), serial_number="A"))
    assert [port.path for port in find_ports(usb_backend=bus)] == paths


def test_tty_with_unknown_ids_may_be_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    ports = [ListPortInfo(f"/dev/{name}") for name in ("ttyUSB1", "ttyS0", "ttyACM10", "ttyACM9", "rfcomm0")]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    found = find_ports(usb_backend=EmulatedBus())
    assert [port.path for port in found] == ["/dev/ttyACM9", "/dev/ttyACM10", "/dev/ttyUSB1"]
    assert {(port.kind, port.vendor_id) for port in found} == {("serial", None)}


def test_missing_libusb_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    import libusb_package
    from serial.tools import list_ports

    monkeypatch.setattr(libusb_package, "get_libusb1_backend", lambda: None)
    monkeypatch.setattr(list_ports, "comports", list)
    with pytest.raises(SensorError, match=r"library libusb 1\.0, which was not found: pip install libusb-package"):
        find_ports(with_serial=False)
    with pytest.warns(RuntimeWarning, match=r"only serial ports are listed: .*libusb"):
        assert find_ports() == []


def test_missing_pyusb_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "usb", None)
    with pytest.raises(ImportError, match=r"pip install radarcore\[usb\]"):
        find_ports(usb_backend=EmulatedBus(), with_serial=False)


def test_device_is_opened_by_its_place_or_its_ids() -> None:
    bus = bus_with(cdc_device(Loopback()), vendor_device(Requests()))
    for port in ("usb:1-1", "usb:058b:0251", "usb:058B:251", find_ports(usb_backend=bus, with_serial=False)[0]):
        stream = open_stream(port, usb_backend=bus)
        assert stream.name == "usb:1-1"
        stream.close()
    for port in ("usb:1-2", "usb:058b:0252", find_ports(usb_backend=bus, with_serial=False)[1]):
        vendor_port = open_vendor_port(port, usb_backend=bus)
        assert (vendor_port.name, vendor_port.product) == ("usb:1-2", "Radar Baseboard MCU7")
        vendor_port.close()


def test_ids_of_two_boards_are_refused_with_their_places() -> None:
    bus = bus_with(cdc_device(Loopback()), cdc_device(Loopback()))
    with pytest.raises(SensorError, match=r"name one of the 2: usb:1-1, usb:1-2"):
        open_stream("usb:058b:0251", usb_backend=bus)


@pytest.mark.parametrize(
    "path", ["usb:", "usb:1", "usb:1-", "usb:a-b", "usb:1-2-3", "usb:058b:", "usb:xyz:1", "usb:1:2:3"]
)
def test_malformed_place_is_a_value_error(path: str) -> None:
    with pytest.raises(ValueError, match=r"port: expected usb:BUS-ADDRESS or usb:VID:PID, got 'usb:"):
        open_stream(path, usb_backend=EmulatedBus())
    with pytest.raises(ValueError, match="got '/dev/tty'"):
        open_vendor_port("/dev/tty", usb_backend=EmulatedBus())


@pytest.mark.parametrize("path", ["usb:1-1", "usb:058b:0251"])
def test_empty_place_is_not_found(path: str) -> None:
    with pytest.raises(SensorNotFoundError, match="is the board plugged in"):
        open_stream(path, usb_backend=EmulatedBus())


def test_wrong_kind_of_device_is_refused_and_closed() -> None:
    bus = bus_with(cdc := cdc_device(Loopback()), vendor := vendor_device(Requests()))
    with pytest.raises(SensorError, match="expected a CDC device"):
        open_stream("usb:1-2", usb_backend=bus)
    with pytest.raises(SensorError, match="expected a vendor-class device"):
        open_vendor_port("usb:1-1", usb_backend=bus)
    ports = find_ports(usb_backend=bus, with_serial=False)
    with pytest.raises(ValueError, match="expected one with a byte stream, got usb:1-2"):
        open_stream(ports[1], usb_backend=bus)
    with pytest.raises(ValueError, match="expected a vendor-class device, got usb:1-1"):
        open_vendor_port(ports[0], usb_backend=bus)
    assert cdc.driver_is_bound
    assert not cdc.claimed_interfaces | vendor.claimed_interfaces


# Taking a device and giving it back


def test_open_board_is_taken_from_the_driver_and_given_back() -> None:
    stream, _, device = stream_to(Loopback())
    assert not device.driver_is_bound
    assert device.claimed_interfaces == {0, 1}
    assert device.line_coding == bytes.fromhex("00100e00000008")  # 921600 8N1
    assert device.control_lines == 3
    stream.close()
    assert device.driver_is_bound
    assert device.claimed_interfaces == set()
    assert device.control_lines == 0
    stream.close()  # does nothing
    assert device.driver_is_bound


def test_forgotten_stream_gives_the_board_back() -> None:
    stream, _, device = stream_to(Loopback())
    assert not device.driver_is_bound
    del stream
    assert device.driver_is_bound


def test_board_without_line_coding_is_opened_nevertheless() -> None:
    device = cdc_device(Loopback())
    device.answers_class_requests = False
    stream = UsbStream("usb:1-1", usb_backend=bus_with(device))
    stream.write(b"abc", HANG)
    assert read_all(stream, 3) == b"abc"
    stream.close()
    assert device.driver_is_bound


def test_board_in_use_is_refused_and_left_as_it_is() -> None:
    stream, bus, device = stream_to(Loopback())
    with pytest.raises(SensorError, match="in use by another program"):
        UsbStream("usb:1-1", usb_backend=bus)
    assert device.claimed_interfaces == {0, 1}
    stream.write(b"abc", HANG)
    assert read_all(stream, 3) == b"abc"
    stream.close()
    UsbStream("usb:1-1", usb_backend=bus).close()


def test_failed_claim_gives_the_driver_back() -> None:
    # Another program has the data interface only, as the driver has left it.
    device = cdc_device(Loopback())
    bus = bus_with(device)
    other = usb.core.find(backend=bus)
    other.detach_kernel_driver(0)
    usb.util.claim_interface(other, 1)
    with pytest.raises(SensorError, match="in use by another program"):
        UsbStream("usb:1-1", usb_backend=bus)
    assert device.claimed_interfaces == {1}
    usb.util.release_interface(other, 1)
    other.attach_kernel_driver(0)
    assert device.driver_is_bound


def test_failed_line_coding_gives_the_board_back(monkeypatch: pytest.MonkeyPatch) -> None:
    device = cdc_device(Loopback())
    bus = bus_with(device)

    def silent(*arguments: Any) -> int:
        raise usb.core.USBTimeoutError("timeout", -7, errno.ETIMEDOUT)

    monkeypatch.setattr(bus, "ctrl_transfer", silent)
    with pytest.raises(SensorTimeoutError, match="usb:1-1: the board did not answer in time") as raised:
        UsbStream("usb:1-1", usb_backend=bus)
    assert device.driver_is_bound  # although the error still knows the stream
    assert device.claimed_interfaces == set()
    assert raised.tb is not None


def test_missing_permission_shows_the_udev_rule() -> None:
    cdc, vendor = cdc_device(Loopback()), vendor_device(Requests())
    cdc.is_denied = vendor.is_denied = True
    bus = bus_with(cdc, vendor)
    for call in (lambda: open_stream("usb:1-1", usb_backend=bus), lambda: open_vendor_port("usb:1-2", usb_backend=bus)):
        with pytest.raises(SensorError, match="no permission to open the device") as raised:
            call()
        if sys.platform == "linux":
            assert UDEV_RULE in str(raised.value)
            assert "/etc/udev/rules.d/" in str(raised.value)


# Bytes


def test_bytes_go_both_ways_through_both_speeds() -> None:
    data = random.Random(1).randbytes(100_000)
    for high_speed in (True, False):
        peripheral = Loopback()
        stream, _, _ = stream_to(peripheral, high_speed=high_speed)
        stream.write(data, HANG)
        assert peripheral.received == data
        assert read_all(stream, len(data)) == data
        stream.close()


@pytest.mark.parametrize("seed", range(20))
def test_stream_is_the_same_however_it_is_cut(seed: int) -> None:
    rng = random.Random(seed)
    transfers = [rng.randbytes(rng.choice([1, 63, 64, 65, 511, 512, 513, 1024, 4095, 20_000])) for _ in range(20)]
    stream, _, _ = stream_to(Loopback(*transfers), high_speed=bool(seed % 2))
    expected, got = b"".join(transfers), b""
    while len(got) < len(expected):
        size = rng.choice([1, 2, 6, 64, 100, 512, 1000, 15_872, 1_000_000])
        chunk = stream.read(size, HANG)
        assert 1 <= len(chunk) <= size
        got += chunk
    assert got == expected
    assert stream.read(1, 0.0) == b""
    stream.close()


def test_partial_writes_are_continued() -> None:
    peripheral = Loopback()
    stream, _, device = stream_to(peripheral)
    device.max_write = 100
    data = bytes(range(250))
    stream.write(data, HANG)
    assert peripheral.received == data
    stream.close()


def test_board_that_takes_nothing_is_a_timeout() -> None:
    stream, _, device = stream_to(Loopback())
    device.max_write = 0
    with pytest.raises(SensorTimeoutError, match=r"usb:1-1: the board took 0 of 3 bytes in 0\.01 s"):
        stream.write(b"abc", 0.01)
    stream.write(b"", 0.0)  # nothing to take
    stream.close()


def test_silent_board_reads_as_nothing() -> None:
    stream, _, _ = stream_to(Loopback())
    assert stream.read(100, 0.0) == b""
    assert stream.read(100, 0.12) == b""
    stream.close()


def test_what_has_come_is_discarded() -> None:
    peripheral = Loopback(b"old" * 100, b"older")
    stream, _, _ = stream_to(peripheral)
    assert stream.read(1, HANG) == b"o"
    stream.discard()
    stream.write(b"new", HANG)
    assert read_all(stream, 3) == b"new"
    stream.close()


def test_discard_ends_although_the_board_goes_on() -> None:
    class Endless(Loopback):
        def send(self, size: int, timeout: float) -> bytes:
            time.sleep(0.001)
            return b"x" * size

    stream, _, _ = stream_to(Endless())
    Call(stream.discard).result()
    assert stream.read(1, HANG) == b"x"
    stream.close()


def test_halted_endpoint_is_cleared_once() -> None:
    stream, _, _ = stream_to(Loopback(Stall, b"abc", Stall, Stall, b"def"))
    assert stream.read(10, HANG) == b"abc"
    with pytest.raises(Stalled, match="usb:1-1: the board refused the transfer"):
        stream.read(10, HANG)
    assert stream.read(10, HANG) == b"def"
    stream.close()


@pytest.mark.parametrize(("size", "timeout"), [(0, 1.0), (-1, 1.0), (1, -1.0), (1, float("nan"))])
def test_silly_reads_are_value_errors(size: int, timeout: float) -> None:
    stream, _, _ = stream_to(Loopback())
    with pytest.raises(ValueError, match=r"size|timeout"):
        stream.read(size, timeout)
    stream.close()


# Unplugging and closing


def test_unplugging_ends_a_read_that_waits() -> None:
    stream, bus, device = stream_to(Loopback())
    call = Call(lambda: stream.read(1, 10 * HANG))
    time.sleep(0.05)
    assert call.is_running
    bus.unplug(device)
    with pytest.raises(SensorDisconnectedError, match="usb:1-1: the board is gone"):
        call.result()
    with pytest.raises(SensorDisconnectedError):
        stream.write(b"abc", 1.0)
    stream.close()


def test_board_that_unplugs_itself_is_gone_from_the_bus() -> None:
    stream, bus, _ = stream_to(Loopback(Unplugged))
    with pytest.raises(SensorDisconnectedError):
        stream.read(1, HANG)
    assert find_ports(usb_backend=bus, with_serial=False) == []
    stream.close()


def test_closing_ends_a_read_that_waits() -> None:
    stream, _, device = stream_to(Loopback())
    call = Call(lambda: stream.read(1, 10 * HANG))
    time.sleep(0.02)
    Call(stream.close).result()
    with pytest.raises(SensorDisconnectedError, match="the port has been closed"):
        call.result()
    assert device.driver_is_bound


def test_closing_ends_a_write_that_waits() -> None:
    stream, _, device = stream_to(Loopback())
    device.max_write = 0
    call = Call(lambda: stream.write(b"abc", 10 * HANG))
    time.sleep(0.02)
    Call(stream.close).result()
    with pytest.raises(SensorDisconnectedError, match="the port has been closed"):
        call.result()


def test_reads_and_writes_do_not_hold_each_other_up() -> None:
    stream, _, _ = stream_to(Loopback())
    call = Call(lambda: stream.read(3, 10 * HANG))
    Call(lambda: stream.write(b"abc", HANG)).result()
    assert call.result() == b"abc"
    stream.close()


def test_board_plugged_in_anew_has_a_new_address_and_opens() -> None:
    stream, bus, device = stream_to(Loopback())
    bus.unplug(device)
    bus.unplug(device)  # does nothing
    bus.plug(device)
    with pytest.raises(SensorDisconnectedError):
        stream.read(1, 0.0)
    stream.close()
    assert device.driver_is_bound  # the old stream has nothing to say to the new connection
    with pytest.raises(SensorNotFoundError):
        UsbStream("usb:1-1", usb_backend=bus)
    again = UsbStream("usb:058b:0251", usb_backend=bus)
    assert again.name == "usb:1-2"
    again.write(b"abc", HANG)
    assert read_all(again, 3) == b"abc"
    again.close()


def test_device_is_plugged_in_once() -> None:
    bus = bus_with(device := cdc_device(Loopback()))
    with pytest.raises(ValueError, match="expected one that is not plugged in"):
        bus.plug(device)


def test_closed_ports_are_disconnected() -> None:
    stream, _, _ = stream_to(Loopback(b"abc"))
    stream.close()
    port, _, device = vendor_port_to(Requests(b"abc"))
    port.close()
    port.close()
    for call in (
        lambda: stream.read(1, 1.0),
        lambda: stream.write(b"x", 1.0),
        lambda: stream.discard(),
        lambda: port.read_packet(512, 1.0),
        lambda: port.control_read(0xC0, 1, 2, 3, 4, 1.0),
        lambda: port.control_write(0x40, 1, 2, 3, b"", 1.0),
    ):
        with pytest.raises(SensorDisconnectedError, match="the port has been closed"):
            call()
    assert device.claimed_interfaces == set()  # nothing was opened again


# Vendor ports


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


def test_control_transfer_without_an_answer_is_a_timeout() -> None:
    board = Requests()
    port, _, _ = vendor_port_to(board)
    board.failure = TimeoutError
    with pytest.raises(SensorTimeoutError):
        port.control_read(0xC0, 1, 2, 3, 4, 1.0)
    port.close()


def test_vendor_board_that_is_unplugged_is_disconnected() -> None:
    board = Requests()
    port, _, _ = vendor_port_to(board)
    board.failure = Unplugged
    with pytest.raises(SensorDisconnectedError):
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


# The bus itself, as libusb would answer


def test_transfer_that_does_not_fit_overflows() -> None:
    bus = bus_with(vendor_device(Requests(b"a" * 700, b"b" * 700)))
    device = usb.core.find(backend=bus)
    with pytest.raises(usb.core.USBError) as raised:
        device.read(0x81, 600, 1000)
    assert raised.value.errno == errno.EOVERFLOW
    assert bytes(device.read(0x81, 512, 1000)) == b"b" * 512  # whole packets fit
    assert bytes(device.read(0x81, 512, 1000)) == b"b" * 188


def test_transfer_of_whole_packets_ends_with_an_empty_one() -> None:
    bus = bus_with(vendor_device(Requests(b"a" * 1024, b"b")))
    device = usb.core.find(backend=bus)
    assert [bytes(device.read(0x81, 512, 1000)) for _ in range(4)] == [b"a" * 512, b"a" * 512, b"", b"b"]
    device = usb.core.find(backend=bus_with(vendor_device(Requests(b"a" * 1024, b"b"))))
    assert [bytes(device.read(0x81, 4096, 1000)) for _ in range(2)] == [b"a" * 1024, b"b"]


def test_bus_has_the_errors_of_libusb() -> None:
    bus = bus_with(cdc := cdc_device(Loopback()))
    device = usb.core.find(backend=bus)

    def number(call: Any, *arguments: Any) -> int:
        with pytest.raises(usb.core.USBError) as raised:
            call(*arguments)
        return raised.value.errno

    assert device.is_kernel_driver_active(0)
    assert device.is_kernel_driver_active(1)
    assert number(usb.util.claim_interface, device, 1) == errno.EBUSY  # the driver has it
    assert number(device.set_configuration) == errno.EBUSY
    device.detach_kernel_driver(1)
    assert not device.is_kernel_driver_active(0)  # it leaves both
    assert number(device.detach_kernel_driver, 0) == errno.ENOENT
    device.set_configuration()
    assert number(usb.util.claim_interface, device, 2) == errno.ENOENT
    usb.util.claim_interface(device, 1)
    assert number(device.attach_kernel_driver, 0) == errno.EBUSY  # not while anybody has either
    assert number(device.attach_kernel_driver, 1) == errno.ENOENT  # it belongs to the first
    other = usb.core.find(backend=bus)
    assert number(usb.util.claim_interface, other, 1) == errno.EBUSY
    with pytest.raises(usb.core.USBTimeoutError):
        device.read(0x82, 16, 1)  # no notifications
    assert number(device.ctrl_transfer, 0xC0, 1, 2, 3, 4) == errno.EPIPE  # no vendor requests
    assert bytes(device.ctrl_transfer(0xA1, 0x21, 0, 0, 7)) == bytes(7)  # line coding, unset so far
    assert len(usb.control.get_descriptor(device, 18, 1, 0)) == 18
    bus.unplug(cdc)
    assert number(device.write, 0x01, b"abc") == errno.ENODEV
    assert number(device.clear_halt, 0x81) == errno.ENODEV
    usb.util.dispose_resources(device)
    assert number(device.get_active_configuration) == errno.ENODEV
    assert usb.core.find(backend=bus) is None


def test_descriptors_of_both_kinds_are_read_by_pyusb() -> None:
    bus = bus_with(cdc_device(Loopback(), high_speed=False), vendor_device(Requests(), serial_number="7"))
    cdc, vendor = usb.core.find(find_all=True, backend=bus)
    assert "CDC" in str(cdc)  # pyusb's own listing walks all of it
    assert "Vendor Specific" in str(vendor)
    assert [interface.bInterfaceClass for interface in cdc[0]] == [0x02, 0x0A]
    assert [endpoint.wMaxPacketSize for endpoint in cdc[0][1, 0]] == [64, 64]
    assert (vendor.manufacturer, vendor.product, vendor.serial_number) == ("Infineon", "Radar Baseboard MCU7", "7")
    assert cdc.serial_number is None
    # The length that the configuration tells is that of its parts.
    parts = [cdc[0], *cdc[0], *(endpoint for interface in cdc[0] for endpoint in interface)]
    assert cdc[0].wTotalLength == sum(part.bLength + len(part.extra_descriptors) for part in parts)


# Describing


def test_description_is_json_with_every_descriptor() -> None:
    bus = bus_with(
        cdc_device(Loopback(), serial_number="0815"),
        cdc_device(Loopback(), vendor_id=0x0403),
        vendor_device(Requests(), product_id=0x0999),  # a board that is not known yet
    )
    cdc, vendor = json.loads(json.dumps(describe_usb(usb_backend=bus)))
    assert (cdc["path"], cdc["idVendor"], cdc["idProduct"], cdc["speed"]) == ("usb:1-1", 0x058B, 0x0251, 3)
    assert cdc["strings"] == {"1": "Infineon", "2": "IFX_CDC", "3": "0815"}
    assert cdc["errors"] == []
    comm, data = cdc["configurations"][0]["interfaces"]
    assert (comm["bInterfaceClass"], comm["bInterfaceSubClass"], comm["kernel_driver"]) == (2, 2, True)
    assert comm["extra"] == "05240010010524010001042402020524060001"
    assert comm["endpoints"][0]["type"] == "interrupt"
    assert [(e["bEndpointAddress"], e["type"], e["direction"]) for e in data["endpoints"]] == [
        (0x81, "bulk", "in"),
        (0x01, "bulk", "out"),
    ]
    assert data["endpoints"][0]["wMaxPacketSize"] == 512
    assert (vendor["path"], vendor["board"]) == ("usb:1-3", "unknown")
    assert vendor["configurations"][0]["interfaces"][0]["kernel_driver"] is False


def test_description_says_what_could_not_be_read() -> None:
    device = cdc_device(Loopback())
    device.is_denied = True
    bus = bus_with(device)
    (description,) = json.loads(json.dumps(describe_usb(usb_backend=bus)))
    assert description["strings"] == {}
    assert "no permission" in description["errors"][0]
    interfaces = description["configurations"][0]["interfaces"]
    assert [interface["kernel_driver"] for interface in interfaces] == [None, None]


def test_describing_leaves_an_open_board_alone() -> None:
    stream, bus, device = stream_to(Loopback())
    describe_usb(usb_backend=bus)
    assert device.claimed_interfaces == {0, 1}
    stream.write(b"abc", HANG)
    assert read_all(stream, 3) == b"abc"
    stream.close()


# Processes


def run_python(code: str) -> str:
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_transport_needs_no_pyusb_until_a_port_is_looked_for() -> None:
    code = "import sys, radarcore.sensor.transport; print({'usb', 'serial', 'libusb_package'} & set(sys.modules))"
    assert run_python(code) == "set()\n"


def test_board_is_given_back_when_the_program_ends() -> None:
    code = """
import atexit
atexit.register(lambda: print(device.driver_is_bound))  # the first is called last
from radarcore.sensor.emulator.usb import EmulatedBus, cdc_device
from radarcore.sensor.transport import open_stream
bus, device = EmulatedBus(), cdc_device(None)
bus.plug(device)
stream = open_stream("usb:1-1", usb_backend=bus)
print(device.driver_is_bound)
raise SystemExit
"""
    assert run_python(code) == "False\nTrue\n"
