"""Emulated USB bus with boards on it, as a backend below pyusb's own code.

It answers as libusb does on Linux: timeouts in milliseconds (0: for ever), `USBTimeoutError`, and `USBError` with
EPIPE for a stall, ENODEV once the device is gone (also for calls under way), EBUSY for what another has, EACCES for
what may not be opened, EOVERFLOW for a packet that does not fit into the buffer.

A board that raises TimeoutError in a call leaves the transfer without an answer, for which nobody waits here. A
transfer of the board that fills whole packets ends with one of no bytes, as the vendor's boards must end theirs
(Strata, vendor transport).
"""

from __future__ import annotations

import errno
import math
import struct
import threading
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import monotonic
from types import SimpleNamespace
from typing import Any, NoReturn, Protocol

from radarcore.sensor.emulator.pty import StreamPeripheral, Unplugged
from radarcore.sensor.transport.usbport import UsbStream, UsbVendorPort, require_pyusb, usb_devices

_FULL_SPEED, _HIGH_SPEED = 2, 3  # as libusb numbers them

_LANGUAGE = 0x0409  # English (United States)

_SLICE = 0.02
"""Longest wait within a board [s], after which the bus looks whether it is still plugged in."""

_LARGEST_PACKET = 129 * 512
"""Bytes of a vendor board's transfer at most: more than any that the boards send."""


class Stall(Exception):  # noqa: N818  # the USB term: the answer "no" of an endpoint
    """The board refuses a control transfer."""


class VendorPeripheral(Protocol):
    """A board behind vendor requests and one bulk endpoint. All calls raise `Unplugged` when it is gone."""

    def control_out(self, request_type: int, request: int, value: int, index: int, data: bytes) -> None:
        """A control transfer to the board; `Stall` refuses it."""

    def control_in(self, request_type: int, request: int, value: int, index: int, length: int) -> bytes:
        """A control transfer from the board, at most `length` bytes; `Stall` refuses it."""

    def send(self, size: int, timeout: float) -> bytes:
        """Bulk transfer to the host, at most `size` bytes; none when nothing is to be sent within `timeout` [s]."""


@dataclass(eq=False)
class EmulatedDevice:
    """A board with its descriptors, to be plugged into an `EmulatedBus`.

    Attributes
    ----------
    stream : StreamPeripheral or None
        The board, if it is one behind a byte stream.
    vendor : VendorPeripheral or None
        The board, if it is one behind vendor requests.
    descriptor : namespace
        Device descriptor, with the names of the USB specification.
    interfaces : list of namespace
        Interface descriptors; each has its ``endpoints``.
    strings : dict
        String descriptors by their indices.
    has_driver : bool
        The kernel has a driver for all interfaces and binds it when the device is plugged in.
    is_denied : bool
        The device may not be opened.
    answers_class_requests : bool
        Line coding and control lines are accepted, not stalled.
    line_coding, control_lines : bytes, int
        As the host has set them last.
    """

    stream: StreamPeripheral | None
    vendor: VendorPeripheral | None
    descriptor: _Descriptor
    interfaces: list[_Descriptor]
    strings: dict[int, str]
    has_driver: bool = False
    is_denied: bool = False
    answers_class_requests: bool = True
    line_coding: bytes = bytes(7)
    control_lines: int = 0
    _connection: _Connection | None = field(default=None, repr=False)

    @property
    def driver_is_bound(self) -> bool:
        """True while the kernel's driver has the device."""
        return self._connection is not None and self._connection.driver_is_bound

    @property
    def claimed_interfaces(self) -> frozenset[int]:
        """Numbers of the interfaces that programs have claimed."""
        return frozenset(self._connection.claims if self._connection else ())


def cdc_device(
    peripheral: StreamPeripheral,
    *,
    vendor_id: int = 0x058B,
    product_id: int = 0x0251,
    product: str = "IFX_CDC",
    serial_number: str = "",
    high_speed: bool = True,
) -> EmulatedDevice:
    """A CDC-ACM board, to which the kernel binds a driver: communication interface 0, data interface 1."""
    packet_size = 512 if high_speed else 64
    functional = bytes.fromhex("05240010010524010001042402020524060001")  # header, calls, ACM, union of 0 and 1
    communication = _Descriptor(
        bInterfaceClass=0x02,
        bInterfaceSubClass=0x02,
        bInterfaceProtocol=0x01,
        endpoints=[_endpoint(0x82, 3, 16)],
        extra_descriptors=list(functional),
    )
    bulk = [_endpoint(0x81, 2, packet_size), _endpoint(0x01, 2, packet_size)]
    interfaces = [communication, _Descriptor(bInterfaceClass=0x0A, endpoints=bulk)]
    speed = _HIGH_SPEED if high_speed else _FULL_SPEED
    descriptors = _device(0x02, interfaces, (vendor_id, product_id), product, serial_number, speed)
    return EmulatedDevice(peripheral, None, **descriptors, has_driver=True)


def vendor_device(
    peripheral: VendorPeripheral, *, product_id: int = 0x0252, product: str = "Radar Baseboard MCU7"
) -> EmulatedDevice:
    """A vendor-class board at high speed: interface 0 with bulk IN 0x81 (Strata, vendor transport)."""
    interfaces = [_Descriptor(bInterfaceClass=0xFF, endpoints=[_endpoint(0x81, 2, 512)])]
    return EmulatedDevice(None, peripheral, **_device(0xFF, interfaces, (0x058B, product_id), product, "", _HIGH_SPEED))


class EmulatedBus:
    """A USB bus, passed as `usb_backend` wherever one is asked for; several threads may use it.

    A wait of one transfer holds up no other.
    """

    number = 1
    """Number of the bus."""

    intr_read = intr_write = iso_read = iso_write = None
    """Transfers of other types, which pyusb looks up, and no board has."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._connections: list[_Connection] = []
        self._last_address = 0

    def plug(self, device: EmulatedDevice) -> None:
        """Plug a device in; it gets a new address, and the kernel's driver if there is one."""
        with self._lock:
            used = {connection.port for connection in self._connections}
            port = next(n for n in range(1, len(used) + 2) if n not in used)
            self._last_address = self._last_address % 127 + 1
            device._connection = _Connection(device, self._last_address, port, driver_is_bound=device.has_driver)
            self._connections.append(device._connection)

    def unplug(self, device: EmulatedDevice) -> None:
        """Unplug a device, if it is there: calls under way fail, and its handles are dead for good."""
        if device._connection is not None:
            self.drop(device._connection)

    def drop(self, connection: _Connection) -> None:
        """End a connection, by unplugging or by the board itself."""
        with self._lock:
            connection.is_gone.set()
            if connection in self._connections:
                self._connections.remove(connection)
                connection.device._connection = None

    # Methods that pyusb demands of a backend, with its names and arguments.

    def enumerate_devices(self) -> list[_Connection]:
        """Devices that are plugged in."""
        with self._lock:
            return list(self._connections)

    def get_parent(self, connection: _Connection) -> None:
        """Parent hub of a device: None, as no hubs are emulated."""

    def get_device_descriptor(self, connection: _Connection) -> _Descriptor:
        """Device descriptor, with the place on the bus."""
        place = {"bus": self.number, "address": connection.address, "port_number": connection.port}
        return _Descriptor(**vars(connection.device.descriptor) | place, port_numbers=(connection.port,))

    def get_configuration_descriptor(self, connection: _Connection, configuration: int) -> _Descriptor:
        """The only configuration."""
        number = len(connection.device.interfaces)
        return _Descriptor(bLength=9, bDescriptorType=2, bNumInterfaces=number, bConfigurationValue=1, bMaxPower=250)

    def get_interface_descriptor(
        self, connection: _Connection, interface: int, alternate: int, _configuration: int
    ) -> _Descriptor:
        """An interface, which has no alternate settings."""
        if alternate != 0:
            raise IndexError(f"alternate: expected 0, got {alternate}")
        return connection.device.interfaces[interface]

    def get_endpoint_descriptor(
        self, connection: _Connection, endpoint: int, interface: int, _alternate: int, _configuration: int
    ) -> _Descriptor:
        """An endpoint of an interface."""
        descriptor: _Descriptor = connection.device.interfaces[interface].endpoints[endpoint]
        return descriptor

    def open_device(self, connection: _Connection) -> _Handle:
        """A handle of a device."""
        connection.check_here()
        if connection.device.is_denied:
            _fail(errno.EACCES)
        return _Handle(connection)

    def close_device(self, handle: _Handle) -> None:
        """Close a handle, which releases what it has claimed."""
        with self._lock:
            claims = handle.connection.claims
            for number in [number for number, owner in claims.items() if owner is handle]:
                del claims[number]

    def get_configuration(self, handle: _Handle) -> int:
        """Value of the only configuration."""
        handle.connection.check_here()
        return 1

    def claim_interface(self, handle: _Handle, interface: int) -> None:
        """Claim an interface, unless the kernel's driver or another handle has it."""
        with self._lock:
            connection = handle.connection
            connection.check_here()
            if connection.driver_is_bound or connection.claims.get(interface, handle) is not handle:
                _fail(errno.EBUSY)
            connection.claims[interface] = handle

    def release_interface(self, handle: _Handle, interface: int) -> None:
        """Give an interface back."""
        with self._lock:
            handle.check_claimed(interface)
            del handle.connection.claims[interface]

    def is_kernel_driver_active(self, handle: _Handle, interface: int) -> bool:
        """True when the kernel's driver has an interface."""
        handle.connection.check_here()
        return handle.connection.driver_is_bound

    def detach_kernel_driver(self, handle: _Handle, interface: int) -> None:
        """Take an interface from the kernel's driver, which then leaves the others too (as cdc_acm does)."""
        with self._lock:
            handle.connection.driver_is_bound = False

    def attach_kernel_driver(self, handle: _Handle, interface: int) -> None:
        """Let the kernel's driver take all interfaces, if asked for the first one and nobody has any."""
        with self._lock:
            connection = handle.connection
            connection.check_here()
            if not connection.device.has_driver or interface != 0:
                _fail(errno.ENOENT)
            if connection.driver_is_bound or connection.claims:
                _fail(errno.EBUSY)
            connection.driver_is_bound = True

    def bulk_read(self, handle: _Handle, endpoint: int, interface: int, buffer: array[int], timeout: int) -> int:
        """Transfer from a board into a buffer."""
        handle.check_claimed(interface)
        deadline = _deadline(timeout)
        with handle.connection.reading:
            data = handle.connection.bulk_in(endpoint, len(buffer), deadline, self)
        buffer[: len(data)] = array("B", data)
        return len(data)

    def bulk_write(self, handle: _Handle, endpoint: int, interface: int, data: array[int], _timeout: int) -> int:
        """Transfer to a board."""
        handle.check_claimed(interface)
        connection, device = handle.connection, handle.connection.device
        if device.stream is None or connection.endpoint(endpoint) is None:
            _fail(errno.ENOENT)
        with connection.answers(self, endpoint):
            device.stream.receive(data.tobytes())
        return len(data)

    def ctrl_transfer(
        self,
        handle: _Handle,
        request_type: int,
        request: int,
        value: int,
        index: int,
        data: array[int],
        _timeout: int,
    ) -> int:
        """A control transfer on endpoint 0."""
        connection = handle.connection
        with connection.answers(self, 0):
            answer = connection.control(request_type, request, value, index, data)
        if not request_type & 0x80:
            return len(data)
        if len(answer) > len(data):
            _fail(errno.EOVERFLOW)
        data[: len(answer)] = array("B", answer)
        return len(answer)

    def clear_halt(self, handle: _Handle, endpoint: int) -> None:
        """End the stall of an endpoint."""
        handle.connection.check_here()
        handle.connection.halted.discard(endpoint)


@dataclass(eq=False)
class _Connection:
    """Device from plugging in to unplugging, which libusb calls a device."""

    device: EmulatedDevice
    address: int
    port: int
    driver_is_bound: bool
    claims: dict[int, _Handle] = field(default_factory=dict)
    """Interfaces that are claimed, and by whom."""
    halted: set[int] = field(default_factory=set)
    rest: bytes | None = None
    """Rest of the board's transfer: b"" where only its end, a packet of no bytes, is still to come."""
    is_gone: threading.Event = field(default_factory=threading.Event)
    reading: threading.Lock = field(default_factory=threading.Lock)

    def check_here(self) -> None:
        """Fail once the device is unplugged."""
        if self.is_gone.is_set():
            _fail(errno.ENODEV)

    def endpoint(self, address: int) -> _Descriptor | None:
        """The endpoint with an address."""
        endpoints = (endpoint for interface in self.device.interfaces for endpoint in interface.endpoints)
        return next((endpoint for endpoint in endpoints if endpoint.bEndpointAddress == address), None)

    @contextmanager
    def answers(self, bus: EmulatedBus, endpoint: int) -> Iterator[None]:
        """A call of the board: its refusals become errors of the bus."""
        self.check_here()
        if endpoint in self.halted:
            _fail(errno.EPIPE)
        try:
            yield
        except Stall:
            if endpoint != 0:  # endpoint 0 is free again with the next request
                self.halted.add(endpoint)
            _fail(errno.EPIPE)
        except Unplugged:
            bus.drop(self)
            _fail(errno.ENODEV)
        except TimeoutError:
            _fail(errno.ETIMEDOUT)
        self.check_here()

    def bulk_in(self, address: int, size: int, deadline: float, bus: EmulatedBus) -> bytes:
        """Bytes of a transfer into a buffer of `size` bytes."""
        endpoint = self.endpoint(address)
        board = self.device.stream or self.device.vendor
        if endpoint is None or board is None:
            _fail(errno.ENOENT)
        packet_size: int = endpoint.wMaxPacketSize

        # Take the next transfer of the board, unless the last one did not fit.
        while self.rest is None:
            whole = math.ceil(size / packet_size) * packet_size
            with self.answers(bus, address):
                wait = min(max(deadline - monotonic(), 0.0), _SLICE)
                self.rest = board.send(_LARGEST_PACKET if self.device.vendor else whole, wait) or None
            if self.rest is None and monotonic() >= deadline:
                _fail(errno.ETIMEDOUT)

        # A packet that crosses the end of the buffer is lost with the transfer.
        transfer, self.rest = self.rest, None
        if len(transfer) > size and size % packet_size:
            _fail(errno.EOVERFLOW)
        if len(transfer) > size or (len(transfer) == size and size and size % packet_size == 0):
            self.rest = transfer[size:]
        return transfer[:size]

    def control(self, request_type: int, request: int, value: int, index: int, data: array[int]) -> bytes:
        """Answer of the device to a request, empty for one to the device; `Stall` for what it does not know."""
        device = self.device
        kind = request_type >> 5 & 3
        if kind == 2 and device.vendor is not None:
            if request_type & 0x80:
                return device.vendor.control_in(request_type, request, value, index, len(data))
            device.vendor.control_out(request_type, request, value, index, data.tobytes())
            return b""
        if kind == 1 and device.stream is not None and device.answers_class_requests:
            # Requests of CDC PSTN devices: set line coding, set control line state, get line coding.
            match request_type, request:
                case 0x21, 0x20:
                    device.line_coding = data.tobytes()
                    return b""
                case 0x21, 0x22:
                    device.control_lines = value
                    return b""
                case 0xA1, 0x21:
                    return device.line_coding[: len(data)]
        number = value & 0xFF
        if (request_type, request, value >> 8) == (0x80, 0x06, 3) and (number == 0 or number in device.strings):
            # GET_DESCRIPTOR of a string; number 0 has the languages.
            text = device.strings[number].encode("utf-16-le") if number else struct.pack("<H", _LANGUAGE)
            return (bytes([2 + len(text), 3]) + text)[: len(data)]
        raise Stall


@dataclass(eq=False)
class _Handle:
    """A device that a program has open."""

    connection: _Connection

    def check_claimed(self, interface: int) -> None:
        """Fail for an interface that is not claimed by this handle."""
        self.connection.check_here()
        if self.connection.claims.get(interface) is not self:
            _fail(errno.ENOENT)


def _deadline(timeout: int) -> float:
    """End of a wait of `timeout` [ms], 0 for one without end."""
    return monotonic() + timeout / 1000.0 if timeout else math.inf


def _fail(number: int) -> NoReturn:
    """Raise the error of pyusb that libusb's backend raises for an error number."""
    core = require_pyusb().core
    kind = core.USBTimeoutError if number == errno.ETIMEDOUT else core.USBError
    raise kind(errno.errorcode[number], errno=number)


class _Descriptor(SimpleNamespace):
    """A descriptor, with the names of the USB specification; fields that are not given are zero."""

    extra_descriptors: Sequence[int] = ()

    def __getattr__(self, name: str) -> int:
        return 0


def _device(
    device_class: int, interfaces: list[_Descriptor], ids: tuple[int, int], product: str, serial_number: str, speed: int
) -> dict[str, Any]:
    """Descriptors of a device; one without a serial number has no such string."""
    for number, interface in enumerate(interfaces):
        interface.bLength, interface.bDescriptorType, interface.bInterfaceNumber = 9, 4, number
        interface.bNumEndpoints = len(interface.endpoints)
    descriptor = _Descriptor(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=device_class,
        bMaxPacketSize0=64,
        idVendor=ids[0],
        idProduct=ids[1],
        bcdDevice=0x0100,
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3 if serial_number else 0,
        bNumConfigurations=1,
        speed=speed,
    )
    strings = {1: "Infineon", 2: product} | ({3: serial_number} if serial_number else {})
    return {"descriptor": descriptor, "interfaces": interfaces, "strings": strings}


def _endpoint(address: int, transfer_type: int, packet_size: int) -> _Descriptor:
    """An endpoint; transfer type 2 is bulk, 3 interrupt."""
    return _Descriptor(
        bLength=7, bDescriptorType=5, bEndpointAddress=address, bmAttributes=transfer_type, wMaxPacketSize=packet_size
    )


def bus_with(*devices: EmulatedDevice) -> EmulatedBus:
    """A bus with devices at usb:1-1, usb:1-2, ..."""
    bus = EmulatedBus()
    for device in devices:
        bus.plug(device)
    return bus


def on_bus(bus: EmulatedBus, number: int = 1) -> Any:
    """The device at usb:1-NUMBER, as pyusb has it."""
    return usb_devices(bus)[number - 1]


def stream_to(peripheral: StreamPeripheral, **options: Any) -> tuple[UsbStream, EmulatedBus, EmulatedDevice]:
    device = cdc_device(peripheral, **options)
    bus = bus_with(device)
    return UsbStream(on_bus(bus)), bus, device


def vendor_port_to(peripheral: VendorPeripheral, **options: Any) -> tuple[UsbVendorPort, EmulatedBus, EmulatedDevice]:
    device = vendor_device(peripheral, **options)
    bus = bus_with(device)
    return UsbVendorPort(on_bus(bus)), bus, device
