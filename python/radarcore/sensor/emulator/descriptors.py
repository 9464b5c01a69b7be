"""Descriptors of emulated USB devices, with the names of the USB specification, as pyusb asks a backend for them."""

from __future__ import annotations

from types import SimpleNamespace

_FULL_SPEED, _HIGH_SPEED = 2, 3  # as libusb numbers them


def device_descriptor(
    device_class: int, vendor_id: int, product_id: int, product: str, serial_number: str, high_speed: bool
) -> tuple[SimpleNamespace, dict[int, str]]:
    """Device descriptor and strings; a device without a serial number has no such string."""
    strings = {1: "Infineon", 2: product} | ({3: serial_number} if serial_number else {})
    for text in strings.values():
        if len(text.encode("utf-16-le")) > 252:
            raise ValueError(f"product, serial_number: expected at most 126 characters, got {text!r}")
    descriptor = SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=device_class,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=vendor_id,
        idProduct=product_id,
        bcdDevice=0x0100,
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3 if serial_number else 0,
        bNumConfigurations=1,
        speed=_HIGH_SPEED if high_speed else _FULL_SPEED,
    )
    return descriptor, strings


def configuration_descriptor(interfaces: list[SimpleNamespace]) -> SimpleNamespace:
    """The only configuration of a device, powered by the bus."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=2,
        wTotalLength=9 + sum(9 + len(i.extra_descriptors) + 7 * i.bNumEndpoints for i in interfaces),
        bNumInterfaces=len(interfaces),
        bConfigurationValue=1,
        iConfiguration=0,
        bmAttributes=0x80,
        bMaxPower=250,  # 500 mA
        extra_descriptors=[],
    )


def interface_descriptor(
    number: int, kind: int, subclass: int, protocol: int, endpoints: list[SimpleNamespace], extra: bytes = b""
) -> SimpleNamespace:
    """An interface with its endpoints; `extra` is what the configuration has between the two."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=4,
        bInterfaceNumber=number,
        bAlternateSetting=0,
        bNumEndpoints=len(endpoints),
        bInterfaceClass=kind,
        bInterfaceSubClass=subclass,
        bInterfaceProtocol=protocol,
        iInterface=0,
        extra_descriptors=list(extra),
        endpoints=endpoints,
    )


def endpoint_descriptor(address: int, transfer_type: int, packet_size: int, interval: int = 0) -> SimpleNamespace:
    """An endpoint; transfer type 2 is bulk, 3 interrupt."""
    return SimpleNamespace(
        bLength=7,
        bDescriptorType=5,
        bEndpointAddress=address,
        bmAttributes=transfer_type,
        wMaxPacketSize=packet_size,
        bInterval=interval,
        bRefresh=0,
        bSynchAddress=0,
        extra_descriptors=[],
    )
