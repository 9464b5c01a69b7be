"""Transport of bytes to and from a board: serial ports, USB, captures. It knows timeouts, and no protocol.

`serialport` alone names pyserial and `usbport` alone pyusb; both come with ``pip install radarcore[usb]`` and are
imported when the first port is looked for, so that captures play without them.
"""

from radarcore.sensor.transport.capture import Capture, Replay
from radarcore.sensor.transport.ports import (
    KNOWN_BOARDS,
    Port,
    describe_usb,
    find_ports,
    may_be_usb,
    open_stream,
    open_vendor_port,
    serial_port,
)
from radarcore.sensor.transport.serialport import SerialStream
from radarcore.sensor.transport.stream import Stalled, Stream, VendorPort
from radarcore.sensor.transport.usbport import UDEV_RULE, UsbStream, UsbVendorPort, require_pyusb

__all__ = [
    "KNOWN_BOARDS",
    "UDEV_RULE",
    "Capture",
    "Port",
    "Replay",
    "SerialStream",
    "Stalled",
    "Stream",
    "UsbStream",
    "UsbVendorPort",
    "VendorPort",
    "describe_usb",
    "find_ports",
    "may_be_usb",
    "open_stream",
    "open_vendor_port",
    "require_pyusb",
    "serial_port",
]
