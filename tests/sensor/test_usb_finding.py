"""USB boards found, described and opened by their place or ids, on an emulated bus."""

from __future__ import annotations

import json
import sys

import pytest

from doubles.small_boards import HANG, Loopback, Requests, read_all
from doubles.usb_bus import EmulatedBus, bus_with, cdc_device, stream_to, vendor_device
from radarcore.sensor.errors import SensorError, SensorNotFoundError
from radarcore.sensor.transport.ports import Port, describe_usb, find_ports, open_stream, open_vendor_port


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


# Describing


def test_boards_of_the_vendor_are_described_with_all_descriptors() -> None:
    bus = bus_with(
        cdc_device(Loopback(), serial_number="0815"),
        cdc_device(Loopback(), vendor_id=0x0403),
        denied := vendor_device(Requests(), product_id=0x0999),  # a board that is not known yet
    )
    denied.is_denied = True
    cdc, vendor = (" ".join(lines) for lines in json.loads(json.dumps(describe_usb(usb_backend=bus))))
    assert "DEVICE ID 058b:0251 on Bus 001 Address 001" in cdc
    assert "IFX_CDC" in cdc
    assert "0815" in cdc
    assert "ENDPOINT 0x81: Bulk IN" in cdc
    assert "058b:0999" in vendor
    assert "Vendor Specific" in vendor


def test_describing_leaves_an_open_board_alone() -> None:
    stream, bus, device = stream_to(Loopback())
    describe_usb(usb_backend=bus)
    assert device.claimed_interfaces == {0, 1}
    stream.write(b"abc", HANG)
    assert read_all(stream, 3) == b"abc"
    stream.close()
