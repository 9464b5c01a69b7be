"""Boards that are plugged in."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any, Literal

from radarcore import notice
from radarcore.sensor.errors import SensorError
from radarcore.sensor.transport.serialport import is_pty, serial_ports
from radarcore.sensor.transport.usbport import device_path, require_pyusb, usb_devices, usb_strings

Kind = Literal["serial", "usb-cdc", "usb-vendor"]

INFINEON = 0x058B
"""Vendor id of all boards."""

KNOWN_BOARDS: dict[tuple[int, int], tuple[Kind, str]] = {
    (INFINEON, 0x0058): ("usb-cdc", "XMC board with ComLib, or another XMC product"),
    (INFINEON, 0x0251): ("usb-cdc", "Radar Baseboard MCU7"),
    (INFINEON, 0x0252): ("usb-vendor", "Radar Baseboard MCU7"),
    (INFINEON, 0x0253): ("usb-cdc", "AirEvaluationKit"),
    (INFINEON, 0x0256): ("usb-vendor", "KIT_60TR13C_EMBEDD_UNL"),
}
"""Vendor and product id -> kind of port and board (Strata, known ids; Infineon boards, which board speaks what)."""


@dataclass(frozen=True)
class Port:
    """Port that a board is, or may be, connected to.

    Attributes
    ----------
    kind : str
        ``"serial"``, ``"usb-cdc"`` (a byte stream too, without the kernel's driver) or ``"usb-vendor"``.
    path : str
        Device file or COM port, or ``usb:BUS-ADDRESS``.
    vendor_id, product_id : int or None
        USB ids; None if the port has none.
    product, serial_number : str
        Name that the device reports; empty if unknown.
    description : str
        Text for people: the board by its ids, and obstacles to reading more.
    device : device of pyusb or None
        None for a serial port.
    """

    kind: Kind
    path: str
    vendor_id: int | None
    product_id: int | None
    product: str
    serial_number: str
    description: str
    device: Any = field(default=None, repr=False, compare=False)


def find_ports(*, usb_backend: Any = None, with_serial: bool = True) -> list[Port]:
    """Ports that may have a board, serial ones first; whether one has is known only by speaking to it.

    Parameters
    ----------
    usb_backend : backend of pyusb, optional
        Backend that finds USB devices; default: libusb.
    with_serial : bool
        List serial ports too: ports with the ids of boards, and ttyACM and ttyUSB ports without known ids. A CDC
        board that the kernel has as a tty is listed once, as that.

    Returns
    -------
    ports : list of Port

    Warns
    -----
    RuntimeWarning
        libusb is missing; the serial ports are listed all the same.
    """
    ttys = [tty for tty in serial_ports() if _may_be_board(tty)] if with_serial else []
    try:
        devices = usb_devices(usb_backend)
    except SensorError as error:
        if not with_serial:
            raise
        notice.warn(f"only serial ports are listed: {error}", RuntimeWarning)
        devices = []
    ports = [_serial_port(tty) for tty in ttys]
    for device in devices:
        if (device.idVendor, device.idProduct) in KNOWN_BOARDS:
            port = _usb_port(device)
            if not any(_is_same(port, tty) for tty in ttys):
                ports.append(port)
    return ports


def describe_usb(*, usb_backend: Any = None) -> list[list[str]]:
    """USB descriptors of the vendor's boards as lines of text, for bug reports; nothing is claimed, sent or changed.

    Parameters
    ----------
    usb_backend : backend of pyusb, optional
        As in `find_ports`.
    """
    found = []
    for device in usb_devices(usb_backend):
        if device.idVendor == INFINEON:
            found.append(str(device).splitlines())
            require_pyusb().util.dispose_resources(device)
    return found


def serial_port(path: str) -> Port:
    """Serial port of a name, with the ids and names of its USB device where it has one; nothing is opened.

    `path` may be a device file, a symbolic link to one (``/dev/serial/by-id/...``), or ``COM3``.
    """
    place = _place(path)
    for tty in serial_ports():
        if _place(tty.device) == place:
            return replace(_serial_port(tty), path=path)
    return Port("serial", path, None, None, "", "", "")


def may_be_usb(port: Port) -> bool:
    """True where a USB board may stand behind a port without ids: a CDC port of a system that tells none, or a pty."""
    place = os.path.realpath(port.path)
    return port.vendor_id is not None or is_pty(place) or PurePath(place).name.startswith("ttyACM")


def _usb_port(device: Any) -> Port:
    kind, board = KNOWN_BOARDS[device.idVendor, device.idProduct]
    try:
        strings = usb_strings(device, {device.iProduct, device.iSerialNumber})
    except SensorError as error:
        strings, board = {}, f"{board} ({error})"
    product, serial_number = strings.get(device.iProduct, ""), strings.get(device.iSerialNumber, "")
    path = device_path(device)
    return Port(kind, path, device.idVendor, device.idProduct, product, serial_number, board, device)


def _serial_port(tty: Any) -> Port:
    board = KNOWN_BOARDS.get((tty.vid, tty.pid), ("", tty.description))[1]
    return Port("serial", tty.device, tty.vid, tty.pid, tty.product or "", tty.serial_number or "", board)


def _place(path: str) -> str:
    """Name of a serial port that is the same for all its names."""
    if sys.platform == "win32":
        return path.removeprefix("\\\\.\\").upper()
    path = os.path.realpath(path)
    # macOS has two files for a port; the file that waits for a carrier is not listed.
    return f"/dev/cu.{path.removeprefix('/dev/tty.')}" if path.startswith("/dev/tty.") else path


def _may_be_board(tty: Any) -> bool:
    if tty.vid is None:
        return PurePath(tty.device).name.startswith(("ttyACM", "ttyUSB"))
    return (tty.vid, tty.pid) in KNOWN_BOARDS


def _is_same(port: Port, tty: Any) -> bool:
    """True when a tty is the kernel's view of a USB device."""
    if (tty.vid, tty.pid) != (port.vendor_id, port.product_id):
        return False
    if tty.location and port.device.port_numbers:
        # Linux has "1-2.3:1.0": bus, ports of the hubs, configuration and interface.
        place: str = tty.location.partition(":")[0]
        return place == f"{port.device.bus}-{'.'.join(map(str, port.device.port_numbers))}"
    return (tty.serial_number or "") == port.serial_number
