"""USB boards on an emulated bus: found, taken and given back, whole however cut, unplugged and closed."""

from __future__ import annotations

import errno
import json
import os
import random
import subprocess
import sys
import time
from importlib import import_module
from typing import Any

import pytest

from doubles.small_boards import HANG, Call, Loopback, Requests, list_serial_ports, read_all
from doubles.usb_bus import EmulatedBus, Stall, bus_with, cdc_device, on_bus, stream_to, vendor_device, vendor_port_to
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.errors import (
    ProtocolError,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
)
from radarcore.sensor.opening import _port_of
from radarcore.sensor.transport.ports import Port, describe_usb, find_ports
from radarcore.sensor.transport.stream import Stalled
from radarcore.sensor.transport.usbport import UDEV_RULE, UsbStream, UsbVendorPort

usb: Any = pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
import_module("usb.util")


def echoes(stream: UsbStream) -> bool:
    stream.write(b"abc", HANG)
    return read_all(stream, 3) == b"abc"


# Finding


def test_boards_are_found_by_their_ids() -> None:
    bus = bus_with(
        cdc_device(Loopback(), serial_number="0815"),
        cdc_device(Loopback(), vendor_id=0x0403, product_id=0x6001),  # somebody else's
        cdc_device(Loopback(), product_id=0x0058, product="IFX CDC"),
        vendor_device(Requests(), product_id=0x0256, product="KIT"),
        denied := cdc_device(Loopback(), serial_number="0816"),
    )
    denied.is_denied = True
    *found, without = find_ports(usb_backend=bus, with_serial=False)
    assert found == [
        Port("usb-cdc", "usb:1-1", 0x058B, 0x0251, "IFX_CDC", "0815", "Radar Baseboard MCU7"),
        Port("usb-cdc", "usb:1-3", 0x058B, 0x0058, "IFX CDC", "", "XMC board with ComLib, or another XMC product"),
        Port("usb-vendor", "usb:1-4", 0x058B, 0x0256, "KIT", "", "KIT_60TR13C_EMBEDD_UNL"),
    ]
    assert (without.path, without.product, without.serial_number) == ("usb:1-5", "", "")
    assert "no permission" in without.description


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
    _, other, tty = list_serial_ports(monkeypatch, "/dev/ttyS0", "/dev/ttyUSB0", "/dev/ttyACM0")
    other.vid, other.pid = 0x0403, 0x6001  # somebody else's
    tty.vid, tty.pid, tty.location, tty.serial_number = 0x058B, 0x0251, location, serial_number
    bus = bus_with(cdc_device(Loopback(), serial_number="A"))
    assert [port.path for port in find_ports(usb_backend=bus)] == paths


def test_tty_with_unknown_ids_may_be_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("ttyUSB1", "ttyS0", "ttyACM10", "ttyACM9", "rfcomm0")
    list_serial_ports(monkeypatch, *(f"/dev/{name}" for name in names))
    found = find_ports(usb_backend=EmulatedBus())
    assert [port.path for port in found] == ["/dev/ttyACM9", "/dev/ttyACM10", "/dev/ttyUSB1"]
    assert {(port.kind, port.vendor_id) for port in found} == {("serial", None)}


def test_missing_libusb_or_pyusb_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    import libusb_package

    monkeypatch.setattr(libusb_package, "get_libusb1_backend", lambda: None)
    list_serial_ports(monkeypatch)
    with pytest.raises(SensorError, match=r"library libusb 1\.0, which was not found: pip install libusb-package"):
        find_ports(with_serial=False)
    with pytest.warns(RuntimeWarning, match=r"only serial ports are listed: .*libusb"):
        assert find_ports() == []
    monkeypatch.setitem(sys.modules, "usb", None)
    with pytest.raises(ImportError, match=r"pip install radarcore\[usb\]"):
        find_ports(usb_backend=EmulatedBus(), with_serial=False)


def test_board_is_named_by_its_place_or_its_ids() -> None:
    bus = bus_with(cdc_device(Loopback()), vendor_device(Requests()))
    names = ("usb:1-1", "usb:058b:0251", "usb:1-2", "usb:058B:0252")
    assert [_port_of(name, bus).path for name in names] == ["usb:1-1", "usb:1-1", "usb:1-2", "usb:1-2"]
    for name in ("usb:1-7", "usb:058b:0058", "usb:", "usb:xyz:1"):
        with pytest.raises(SensorNotFoundError, match=f"{name}: expected a radar board on USB, got none; there is"):
            _port_of(name, bus)


def test_devices_without_what_is_needed_are_refused_and_closed() -> None:
    bus = bus_with(cdc := cdc_device(Loopback()), vendor := vendor_device(Requests()))
    with pytest.raises(SensorError, match="expected a CDC device"):
        UsbStream(on_bus(bus, 2))
    with pytest.raises(SensorError, match="expected a vendor-class device"):
        UsbVendorPort(on_bus(bus, 1))
    assert cdc.driver_is_bound
    assert not cdc.claimed_interfaces | vendor.claimed_interfaces


def test_boards_of_the_vendor_are_described_and_left_alone() -> None:
    stream, bus, device = stream_to(Loopback(), serial_number="0815")
    bus.plug(cdc_device(Loopback(), vendor_id=0x0403))
    bus.plug(denied := vendor_device(Requests(), product_id=0x0999))  # a board that is not known yet
    denied.is_denied = True
    cdc, vendor = (" ".join(lines) for lines in json.loads(json.dumps(describe_usb(usb_backend=bus))))
    for text in ("DEVICE ID 058b:0251 on Bus 001 Address 001", "IFX_CDC", "0815", "ENDPOINT 0x81: Bulk IN"):
        assert text in cdc
    assert "058b:0999" in vendor
    assert "Vendor Specific" in vendor
    assert device.claimed_interfaces == {0, 1}
    assert echoes(stream)
    stream.close()


# Taken from the driver, and given back


def test_open_board_is_taken_from_the_driver_and_given_back() -> None:
    stream, _, device = stream_to(Loopback())
    assert not device.driver_is_bound
    assert device.claimed_interfaces == {0, 1}
    assert device.line_coding == bytes.fromhex("00100e00000008")  # 921600 8N1
    assert device.control_lines == 3
    for _ in range(2):  # the second time does nothing
        stream.close()
        assert device.driver_is_bound
        assert device.claimed_interfaces == set()
        assert device.control_lines == 0


def test_board_without_line_coding_is_opened_nevertheless() -> None:
    device = cdc_device(Loopback())
    device.answers_class_requests = False
    stream = UsbStream(on_bus(bus_with(device)))
    assert echoes(stream)
    stream.close()
    assert device.driver_is_bound


def test_board_in_use_is_refused_and_left_as_it_is() -> None:
    stream, bus, device = stream_to(Loopback())
    with pytest.raises(SensorError, match="in use by another program"):
        UsbStream(on_bus(bus))
    assert device.claimed_interfaces == {0, 1}
    assert echoes(stream)
    stream.close()
    UsbStream(on_bus(bus)).close()


def test_failed_claim_gives_the_driver_back() -> None:
    # Another program has the data interface only, as the driver has left it.
    device = cdc_device(Loopback())
    bus = bus_with(device)
    other = usb.core.find(backend=bus)
    other.detach_kernel_driver(0)
    usb.util.claim_interface(other, 1)
    with pytest.raises(SensorError, match="in use by another program"):
        UsbStream(on_bus(bus))
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
        UsbStream(on_bus(bus))
    assert device.driver_is_bound  # although the error still knows the stream
    assert device.claimed_interfaces == set()
    assert raised.tb is not None


def test_missing_permission_shows_the_udev_rule() -> None:
    cdc, vendor = cdc_device(Loopback()), vendor_device(Requests())
    cdc.is_denied = vendor.is_denied = True
    bus = bus_with(cdc, vendor)
    for call in (lambda: UsbStream(on_bus(bus, 1)), lambda: UsbVendorPort(on_bus(bus, 2))):
        with pytest.raises(SensorError, match="no permission to open the device") as raised:
            call()
        if sys.platform == "linux":
            assert UDEV_RULE in str(raised.value)
            assert "/etc/udev/rules.d/" in str(raised.value)


def test_board_is_given_back_when_a_program_ends_and_pyusb_is_loaded_for_a_port_alone() -> None:
    code = """
import atexit, sys
import radarcore.sensor.transport
print({'usb', 'serial', 'libusb_package'} & set(sys.modules))
atexit.register(lambda: print(device.driver_is_bound))  # the first is called last
from doubles.usb_bus import EmulatedBus, cdc_device, on_bus
from radarcore.sensor.transport.usbport import UsbStream
bus, device = EmulatedBus(), cdc_device(None)
bus.plug(device)
stream = UsbStream(on_bus(bus))
print(device.driver_is_bound)
raise SystemExit
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60, env=environment
    )
    assert (result.returncode, result.stdout) == (0, "set()\nFalse\nTrue\n"), result.stderr


# Bytes


@pytest.mark.parametrize("seed", range(4))
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


def test_halted_endpoint_is_cleared_once() -> None:
    stream, _, _ = stream_to(Loopback(Stall, b"abc", Stall, Stall, b"def"))
    assert stream.read(10, HANG) == b"abc"
    with pytest.raises(Stalled, match="usb:1-1: the board refused the transfer"):
        stream.read(10, HANG)
    assert stream.read(10, HANG) == b"def"
    stream.close()


# Unplugging and closing


def test_board_plugged_in_anew_has_a_new_address_and_opens() -> None:
    stream, bus, device = stream_to(Loopback())
    call = Call(lambda: stream.read(1, 10 * HANG))
    time.sleep(0.02)
    assert call.is_running
    bus.unplug(device)
    with pytest.raises(SensorDisconnectedError, match="usb:1-1: the board is gone"):
        call.result()
    with pytest.raises(SensorDisconnectedError):
        stream.write(b"abc", 1.0)
    bus.plug(device)
    with pytest.raises(SensorDisconnectedError):
        stream.read(1, 0.0)
    stream.close()
    assert device.driver_is_bound  # the old stream has nothing to say to the new connection
    with pytest.raises(SensorNotFoundError):
        _port_of("usb:1-1", bus)
    again = UsbStream(_port_of("usb:058b:0251", bus).device)
    assert again.name == "usb:1-2"
    assert echoes(again)
    again.close()


# Vendor-class boards


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


def test_control_transfers_fail_with_the_error_of_their_failure() -> None:
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
    port, _, _ = vendor_port_to(Requests(*packets, b"a" * 700, b"b" * 701))
    assert [port.read_packet(15_872, HANG) for _ in packets] == packets
    # The buffer need not be whole USB packets.
    assert port.read_packet(700, HANG) == b"a" * 700
    with pytest.raises(ProtocolError, match="expected a packet of at most 700 bytes, got a longer one"):
        port.read_packet(700, HANG)
    assert port.read_packet(15_872, 0.0) == b""
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
    port = UsbVendorPort(on_bus(bus))
    assert port.read_packet(1024, 0.02) == b"a" * 512 + b"b" * 300
    assert port.read_packet(1024, HANG) == b"c"
    port.close()
