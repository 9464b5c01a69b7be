"""USB ports of emulated boards, through pyusb's own code on an emulated bus."""

from __future__ import annotations

from typing import Any

from radarcore.sensor.emulator.usb import EmulatedBus, EmulatedDevice, cdc_device, vendor_device
from radarcore.sensor.transport import UsbStream, UsbVendorPort
from small_boards import Loopback, Requests


def bus_with(*devices: EmulatedDevice) -> EmulatedBus:
    """A bus with devices at usb:1-1, usb:1-2, ..."""
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
