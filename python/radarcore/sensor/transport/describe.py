"""Descriptors of the boards on the bus, for owners of a board that is unknown here."""

from __future__ import annotations

import re
from typing import Any

from radarcore.sensor.errors import SensorError
from radarcore.sensor.transport.ports import INFINEON, KNOWN_BOARDS
from radarcore.sensor.transport.usbport import (
    device_path,
    errors_as_ours,
    has_driver,
    require_pyusb,
    usb_devices,
    usb_strings,
)

_TRANSFER_TYPES = ("control", "isochronous", "bulk", "interrupt")

_FIELD = re.compile("(b|bcd|bm|i|id|w)[A-Z]")
"""Begin of a field's name in the USB specification."""


def describe_usb(*, usb_backend: Any = None) -> list[dict[str, Any]]:
    """USB descriptors of the vendor's boards; nothing is claimed, sent or changed.

    Parameters
    ----------
    usb_backend : backend of pyusb, optional
        As in `find_ports`.

    Returns
    -------
    devices : list of dict
        One per device, ready for JSON: ``path``, ``board``, ``port_numbers``, ``speed`` (of libusb: 2 full, 3 high),
        the fields of the device descriptor by their names in the USB specification, ``strings`` by their indices,
        ``configurations`` with ``interfaces`` with ``endpoints``, and ``errors``: what could not be read, and why.
        ``extra`` has further descriptors in hexadecimal, ``kernel_driver`` whether the kernel has a
        driver on the interface (None if that is unknown).
    """
    devices = usb_devices(usb_backend)
    return [
        _device(device)
        for device in devices
        if device.idVendor == INFINEON or (device.idVendor, device.idProduct) in KNOWN_BOARDS
    ]


def _device(device: Any) -> dict[str, Any]:
    errors = []
    configurations: list[Any] = []
    strings: dict[int, str] = {}
    try:
        with errors_as_ours(device_path(device)):
            configurations = list(device)
    except SensorError as error:
        errors.append(f"configurations: {error}")
    interfaces = [interface for configuration in configurations for interface in configuration]
    indices = {device.iManufacturer, device.iProduct, device.iSerialNumber}
    indices |= {c.iConfiguration for c in configurations} | {i.iInterface for i in interfaces}
    try:
        strings = usb_strings(device, indices)
    except SensorError as error:
        errors.append(f"strings: {error}")
    try:
        return {
            "path": device_path(device),
            "board": KNOWN_BOARDS.get((device.idVendor, device.idProduct), ("", "unknown"))[1],
            "port_numbers": list(device.port_numbers or ()),
            "speed": device.speed,
            **_fields(device),
            "strings": {str(index): text for index, text in strings.items()},
            "configurations": [_configuration(device, configuration) for configuration in configurations],
            "errors": errors,
        }
    finally:
        require_pyusb().util.dispose_resources(device)


def _configuration(device: Any, configuration: Any) -> dict[str, Any]:
    return {
        **_fields(configuration),
        "extra": bytes(configuration.extra_descriptors).hex(),
        "interfaces": [
            {
                **_fields(interface),
                "kernel_driver": has_driver(device, interface.bInterfaceNumber),
                "extra": bytes(interface.extra_descriptors).hex(),
                "endpoints": [_endpoint(endpoint) for endpoint in interface],
            }
            for interface in configuration
        ],
    }


def _endpoint(endpoint: Any) -> dict[str, Any]:
    return {
        **_fields(endpoint),
        "direction": "in" if endpoint.bEndpointAddress & 0x80 else "out",
        "type": _TRANSFER_TYPES[endpoint.bmAttributes & 3],
        "extra": bytes(endpoint.extra_descriptors).hex(),
    }


def _fields(descriptor: Any) -> dict[str, int]:
    """Fields of a descriptor by their names in the USB specification."""
    return {name: int(value) for name, value in vars(descriptor).items() if _FIELD.match(name)}
