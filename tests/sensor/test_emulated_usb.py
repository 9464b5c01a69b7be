"""The emulated bus itself answers pyusb as libusb would."""

from __future__ import annotations

import errno
from importlib import import_module
from typing import Any

import pytest

from doubles.small_boards import Loopback, Requests
from doubles.usb_bus import bus_with, cdc_device, vendor_device

usb: Any = pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
import_module("usb.util")


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
