"""Byte streams of USB boards, on an emulated bus: taken and given back, whole however cut, unplugged and closed."""

from __future__ import annotations

import errno
import os
import random
import subprocess
import sys
import time
from importlib import import_module
from typing import Any

import pytest

from doubles.small_boards import HANG, Call, Loopback, Requests, Stall, read_all
from doubles.usb_bus import bus_with, cdc_device, stream_to, vendor_device, vendor_port_to
from radarcore.sensor.errors import SensorDisconnectedError, SensorError, SensorNotFoundError, SensorTimeoutError
from radarcore.sensor.transport.ports import open_stream, open_vendor_port
from radarcore.sensor.transport.stream import Stalled
from radarcore.sensor.transport.usbport import UDEV_RULE, UsbStream

usb: Any = pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
import_module("usb.util")


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


# Processes


def run_python(code: str) -> str:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60, env=environment
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_transport_needs_no_pyusb_until_a_port_is_looked_for() -> None:
    code = "import sys, radarcore.sensor.transport; print({'usb', 'serial', 'libusb_package'} & set(sys.modules))"
    assert run_python(code) == "set()\n"


def test_board_is_given_back_when_the_program_ends() -> None:
    code = """
import atexit
atexit.register(lambda: print(device.driver_is_bound))  # the first is called last
from doubles.usb_bus import EmulatedBus, cdc_device
from radarcore.sensor.transport.ports import open_stream
bus, device = EmulatedBus(), cdc_device(None)
bus.plug(device)
stream = open_stream("usb:1-1", usb_backend=bus)
print(device.driver_is_bound)
raise SystemExit
"""
    assert run_python(code) == "False\nTrue\n"
