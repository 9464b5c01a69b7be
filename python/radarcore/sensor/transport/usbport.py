"""USB boards through pyusb: CDC boards as byte streams without the kernel's driver, vendor-class boards."""

from __future__ import annotations

import errno
import math
import struct
import sys
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from radarcore.sensor.errors import (
    ProtocolError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)
from radarcore.sensor.transport.stream import Stalled

UDEV_RULE = 'SUBSYSTEM=="usb", ATTR{idVendor}=="058b", MODE="0660", TAG+="uaccess"'
"""Line of a udev rule that opens the boards to the local user (Strata, permissions)."""

_CLASS_COMMUNICATION, _CLASS_DATA, _CLASS_VENDOR = 0x02, 0x0A, 0xFF
_SET_LINE_CODING, _SET_CONTROL_LINE_STATE = 0x20, 0x22  # USB CDC PSTN, table 13
_TO_INTERFACE = 0x21  # bmRequestType: class request from the host
_DTR_RTS = 0x0003
_LINE_CODING = struct.pack("<IBBB", 921_600, 0, 0, 8)  # rate [baud], 1 stop bit, no parity, 8 bits

_LARGEST_TRANSFER = 16384
"""Bytes that are asked of the bus at once; libusb cuts longer transfers into several requests to the kernel (Linux)."""

_PACKET_SLICE = 0.2
"""Wait for the rest of a packet that a time-out has cut [s]."""


_ERRORS: dict[int, tuple[type[SensorError], str]] = {
    errno.ETIMEDOUT: (SensorTimeoutError, "the board did not answer in time"),
    errno.ENODEV: (SensorDisconnectedError, "the board is gone"),
    errno.EIO: (SensorDisconnectedError, "the board is gone (input/output error)"),
    errno.EPIPE: (Stalled, "the board refused the transfer (stall)"),
    errno.EOVERFLOW: (ProtocolError, "the board sent more than was asked (overflow)"),
    errno.EBUSY: (SensorError, "the board is in use by another program; close that one first"),
    errno.EACCES: (SensorError, "no permission to open the device"),
    errno.EPERM: (SensorError, "no permission to open the device"),
}
"""Errors of libusb by their numbers, and what they mean for a board."""


def require_pyusb() -> Any:
    """pyusb, or an ImportError that says how to install it."""
    try:
        import usb
        import usb.core
        import usb.util
    except ImportError as error:
        raise ImportError("USB boards need pyusb: pip install radarcore[usb]") from error
    return usb


def usb_devices(usb_backend: Any = None) -> list[Any]:
    """Devices on the bus as pyusb has them; SensorError when libusb is missing."""
    usb = require_pyusb()
    if usb_backend is None and (usb_backend := _libusb()) is None:
        raise SensorError(
            "USB boards need the library libusb 1.0, which was not found: pip install libusb-package brings it, "
            "or install libusb-1.0-0 (Linux) or libusb (Homebrew)"
        )
    with errors_as_ours("USB"):
        return list(usb.core.find(find_all=True, backend=usb_backend))


def device_path(device: Any) -> str:
    """Name of a device's port: ``usb:BUS-ADDRESS``."""
    return f"usb:{device.bus}-{device.address}"


def usb_strings(device: Any, indices: set[int]) -> dict[int, str]:
    """Readable string descriptors by their indices; SensorError if there are none.

    Closes the device, which must not be in use by its object.
    """
    usb = require_pyusb()
    strings = {}
    try:
        with errors_as_ours(device_path(device)):
            for language in usb.util.get_langids(device)[:1]:
                for index in sorted(indices - {0}):
                    with suppress(usb.core.USBError, ValueError, IndexError):
                        strings[index] = str(usb.util.get_string(device, index, language))
    except Stalled:
        return {}  # a device without any
    finally:
        usb.util.dispose_resources(device)
    return strings


def has_driver(device: Any, interface_number: int) -> bool | None:
    """True when the kernel has a driver on an interface; None if that is unknown."""
    try:
        return bool(device.is_kernel_driver_active(interface_number))
    except (OSError, NotImplementedError):  # Windows has no such notion
        return None


class UsbStream:
    """A CDC board, with its interfaces taken from the kernel's driver until `close`.

    Parameters
    ----------
    device : device of pyusb

    Raises
    ------
    SensorDisconnectedError
        It is gone.
    SensorError
        The device may not be opened, is in use, or is no CDC device.
    """

    def __init__(self, device: Any) -> None:
        self._device = device
        self.name: str = device_path(device)
        self._pending = b""
        self._claim = _Claim(self._device)
        with self._claim.released_on_error():
            interfaces = _interfaces(self._device)
            data = next((i for i in interfaces if i.bInterfaceClass == _CLASS_DATA and _is_two_way(i)), None)
            if data is None:
                raise SensorError(f"{self.name}: expected a CDC device, got one without a data interface")
            self._in, self._out = _bulk_endpoint(data, 0x80), _bulk_endpoint(data, 0x00)
            # The kernel's driver belongs to the communication interface, so it is the first to be given back.
            comm = [i for i in interfaces if i.bInterfaceClass == _CLASS_COMMUNICATION][:1]
            self._claim.take([*comm, data])
            for interface in comm:
                self._claim.raise_lines(interface.bInterfaceNumber)

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""
        if not self._pending:
            whole = _whole_packets(min(size, _LARGEST_TRANSFER), self._in)
            self._pending = _bulk_read(self._device, self._in, whole, timeout)
        data, self._pending = self._pending[:size], self._pending[size:]
        return data

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""
        num_sent = _transfer(self._device, self._out, self._device.write, data, timeout) or 0
        if num_sent < len(data):
            raise SensorTimeoutError(f"{self.name}: the board took {num_sent} of {len(data)} bytes in {timeout:g} s")

    def close(self) -> None:
        """Give the port back; may be called twice."""
        self._claim.release()


class UsbVendorPort:
    """A vendor-class board: control transfers on endpoint 0, packets on the bulk IN endpoint that its descriptors name.

    Parameters and errors as in `UsbStream`.
    """

    def __init__(self, device: Any) -> None:
        self.name: str = device_path(device)
        self._device = device
        self._claim = _Claim(device)
        with self._claim.released_on_error():
            vendor = [i for i in _interfaces(device) if i.bInterfaceClass == _CLASS_VENDOR and _bulk_endpoint(i, 0x80)]
            if not vendor:
                raise SensorError(f"{self.name}: expected a vendor-class device, got one without such a bulk endpoint")
            self._in = _bulk_endpoint(vendor[0], 0x80)
            self._claim.take(vendor[:1])

    def control_write(
        self, request_type: int, request: int, value: int, index: int, data: bytes, timeout: float
    ) -> None:
        """A control transfer to the board, all of `data` within `timeout` [s]."""
        num_sent = self._control(request_type, request, value, index, data, timeout)
        if num_sent != len(data):
            raise ProtocolError(f"{self.name}: the board took {num_sent} of {len(data)} bytes of a control transfer")

    def control_read(
        self, request_type: int, request: int, value: int, index: int, length: int, timeout: float
    ) -> bytes:
        """A control transfer from the board, at most `length` bytes, within `timeout` [s]."""
        return bytes(self._control(request_type, request, value, index, length, timeout))

    def read_packet(self, size: int, timeout: float) -> bytes:
        """Bulk transfer of at most `size` bytes; none when none came within `timeout` [s]."""
        room = _whole_packets(size, self._in)
        packet, wait = b"", timeout
        while True:
            begin = monotonic()
            part = _bulk_read(self._device, self._in, room - len(packet), wait)
            packet += part
            if len(packet) > size:
                raise ProtocolError(f"{self.name}: expected a packet of at most {size} bytes, got a longer one")
            # Whole USB packets at the end of the wait may be the first ones of a transfer that the wait has cut.
            # (Of short waits nothing can be said: a slow machine spends them on transfers that are complete.)
            ends_whole = part != b"" and _whole_packets(len(part), self._in) == len(part)
            if not (ends_whole and len(packet) < size and wait >= 0.01 and monotonic() - begin >= wait):
                return packet
            wait = _PACKET_SLICE

    def close(self) -> None:
        """Give the device back; may be called twice."""
        self._claim.release()

    def _control(
        self, request_type: int, request: int, value: int, index: int, data: bytes | int, timeout: float
    ) -> Any:
        with errors_as_ours(self.name):
            return self._device.ctrl_transfer(request_type, request, value, index, data, _milliseconds(timeout))


class _Claim:
    """Interfaces of a device that are ours: taken from the kernel's driver at first, given back to it by `release`.

    They are given back at the latest when the program ends; else the kernel would have no tty for the board until it
    is plugged in anew.
    """

    def __init__(self, device: Any) -> None:
        self._device = device
        self._raised: list[int] = []
        self._claimed: list[int] = []
        self._detached: list[int] = []
        self.release = weakref.finalize(self, _release, device, self._raised, self._claimed, self._detached)

    @contextmanager
    def released_on_error(self) -> Iterator[None]:
        """Steps of opening a device; none stays half done."""
        try:
            with errors_as_ours(device_path(self._device)):
                yield
        except BaseException:
            self.release()
            raise

    def take(self, interfaces: list[Any]) -> None:
        """Detach the kernel's driver from all interfaces, then claim them."""
        for interface in interfaces:
            if has_driver(self._device, interface.bInterfaceNumber):
                self._device.detach_kernel_driver(interface.bInterfaceNumber)
                self._detached.append(interface.bInterfaceNumber)
        for interface in interfaces:
            require_pyusb().util.claim_interface(self._device, interface.bInterfaceNumber)
            self._claimed.append(interface.bInterfaceNumber)
            if interface.bAlternateSetting != 0:
                interface.set_altsetting()

    def raise_lines(self, comm: int) -> None:
        """Set the line coding and tell the board that a host listens; boards may refuse either."""
        self._raised.append(comm)
        for request, value, data in ((_SET_LINE_CODING, 0, _LINE_CODING), (_SET_CONTROL_LINE_STATE, _DTR_RTS, b"")):
            try:
                self._device.ctrl_transfer(_TO_INTERFACE, request, value, comm, data, 1000)
            except OSError as error:
                if error.errno != errno.EPIPE:
                    raise


def _release(device: Any, raised: list[int], claimed: list[int], detached: list[int]) -> None:
    """Give a device back, as far as it still lets us."""
    util = require_pyusb().util
    for comm in raised:
        with suppress(OSError, NotImplementedError):
            device.ctrl_transfer(_TO_INTERFACE, _SET_CONTROL_LINE_STATE, 0, comm, b"", 200)
    for number in claimed:
        with suppress(OSError, NotImplementedError):
            util.release_interface(device, number)
    for number in detached:
        with suppress(OSError, NotImplementedError):
            device.attach_kernel_driver(number)
    with suppress(OSError, NotImplementedError):
        util.dispose_resources(device)


def _interfaces(device: Any) -> list[Any]:
    """Interfaces of the active configuration in all their alternate settings; a device without one is configured."""
    usb = require_pyusb()
    try:
        return list(device.get_active_configuration())
    except usb.core.USBError as error:
        if error.errno is not None:  # pyusb's own error: no configuration is set
            raise
    device.set_configuration()
    return list(device.get_active_configuration())


def _bulk_endpoint(interface: Any, direction: int) -> Any | None:
    """First bulk endpoint of a direction (0x80 to the host, 0 from it)."""
    return next((e for e in interface if e.bmAttributes & 3 == 2 and e.bEndpointAddress & 0x80 == direction), None)


def _is_two_way(interface: Any) -> bool:
    return _bulk_endpoint(interface, 0x80) is not None and _bulk_endpoint(interface, 0x00) is not None


def _whole_packets(size: int, endpoint: Any) -> int:
    """`size` rounded up to whole packets: a packet that does not fit into the rest of the buffer would overflow it."""
    packet_size = (endpoint.wMaxPacketSize & 0x7FF) or 64  # the least that is usual, where the board tells none
    return math.ceil(size / packet_size) * packet_size


def _bulk_read(device: Any, endpoint: Any, size: int, timeout: float) -> bytes:
    """Bytes of one transfer that has any; none when none came in time."""
    deadline = monotonic() + timeout
    while True:
        data = bytes(_transfer(device, endpoint, device.read, size, max(deadline - monotonic(), 0.0)) or b"")
        if data or monotonic() >= deadline:
            return data


def _transfer(device: Any, endpoint: Any, transfer: Callable[..., Any], load: int | bytes, timeout: float) -> Any:
    """Result of a bulk transfer; None where its time ran out. A halted endpoint is cleared and tried once more."""
    with errors_as_ours(device_path(device)):
        for is_last in (False, True):
            try:
                return transfer(endpoint, load, _milliseconds(timeout))
            except OSError as error:
                if error.errno == errno.ETIMEDOUT:
                    return None
                if error.errno != errno.EPIPE or is_last:
                    raise
            device.clear_halt(endpoint)
    return None


def _milliseconds(seconds: float) -> int:
    """Timeout for libusb [ms], at least 1, as 0 means for ever."""
    return max(1, min(math.ceil(1000.0 * seconds), 0x7FFFFFFF))


def _libusb() -> Any:
    """The libusb of libusb-package, else of the system; None if both are missing."""
    try:
        import libusb_package
    except ImportError:
        import usb.backend.libusb1

        return usb.backend.libusb1.get_backend()
    return libusb_package.get_libusb1_backend()


@contextmanager
def errors_as_ours(name: str) -> Iterator[None]:
    """Errors of libusb as the sensor's errors."""
    try:
        yield
    except SensorError:
        raise
    except NotImplementedError as error:
        raise SensorError(f"{name}: this system does not do that with the device ({error}){_driver_hint()}") from error
    except OSError as error:
        kind, text = _ERRORS.get(error.errno or 0, (SensorError, error.strerror or str(error)))
        hint = _permission_hint() if error.errno in (errno.EACCES, errno.EPERM) else ""
        raise kind(f"{name}: {text}{hint}") from error


def _permission_hint() -> str:
    if sys.platform == "linux":
        return (
            f"; put this line into /etc/udev/rules.d/70-radar-boards.rules, then run `sudo udevadm control --reload` "
            f"and plug the board in anew:\n{UDEV_RULE}"
        )
    return _driver_hint()


def _driver_hint() -> str:
    if sys.platform == "win32":
        return "; a CDC board is opened as its COM port; a vendor-class board needs the WinUSB driver (Zadig)"
    if sys.platform == "darwin":
        return "; a CDC board is opened as its serial port /dev/cu.usbmodem*"
    return ""
