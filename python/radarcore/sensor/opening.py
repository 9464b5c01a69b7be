"""Opening of boards: which are there, which protocol they speak, and why one cannot be used."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from radarcore import check, notice
from radarcore.output import claimed
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.device import Sensor
from radarcore.sensor.errors import (
    ProtocolError,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
)
from radarcore.sensor.interface import Board, BoardInfo
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.strata.stream import Link, StreamLink, VendorLink
from radarcore.sensor.transport import ports
from radarcore.sensor.transport.capture import Capture, Replay
from radarcore.sensor.transport.ports import Port
from radarcore.sensor.transport.serialport import SerialStream
from radarcore.sensor.transport.stream import Stream
from radarcore.sensor.transport.usbport import UsbStream, UsbVendorPort

_Made = TypeVar("_Made")

PROTOCOLS = ("comlib", "strata")
"""Protocols that boards speak."""

_SPELLED = {"comlib": "ComLib", "strata": "Strata"}

_XMC = (0x058B, 0x0058)
"""USB ids of boards with ComLib, and of other products of the vendor."""

_CAPTURE = "capture:"
_PROBE_TIMEOUT = 0.3


def list_sensors(*, usb_backend: Any = None) -> list[BoardInfo]:
    """Boards that answer, one after the other.

    Parameters
    ----------
    usb_backend : object, optional
        Backend of pyusb; default: the system's.

    Warns
    -----
    RuntimeWarning
        Boards that are there and left out, each with the reason: old firmware, no permission, another program.

    See Also
    --------
    open_sensor : Connect to one of them.

    Examples
    --------
    >>> # What is printed depends on what is plugged in.
    >>> rc.sensor.list_sensors()  # doctest: +SKIP
    [BoardInfo(port='/dev/ttyACM0', protocol='strata', name='Radar Baseboard MCU7 (MCU A)', chip='BGT60TR13C', ...)]
    """
    found, failures = [], []
    for port in ports.find_ports(usb_backend=usb_backend):
        try:
            board = _connect(port, None, usb_backend)
        except SensorError as error:
            if _is_of_board(port, error):
                failures.append(error)
            continue
        found.append(board.info)
        board.close()
    if failures:
        notice.warn(f"boards left out:{_listed(failures)}", RuntimeWarning)
    return found


def open_sensor(
    port: str | Port | None = None,
    *,
    protocol: str | None = None,
    queue_size: int = 64,
    capture: str | PathLike[str] | None = None,
    usb_backend: Any = None,
) -> Sensor:
    """Connect to a board.

    Parameters
    ----------
    port : str or Port, optional
        Device file or a link to one, ``COM3``, ``usb:BUS-ADDRESS`` or ``usb:VENDOR:PRODUCT``; default: the first board
        that answers. ``capture:FILE`` plays a capture as if its board were there, for a program that asks the same.
    protocol : "strata" or "comlib", optional
        Default: by its USB id, or else what it answers to.
    queue_size : int
        Frames kept for a slow consumer. Beyond that the oldest are dropped, and counted.
    capture : path, optional
        New file for every byte to and from the board, at a port with a byte stream. A full disk ends it with a warning;
        the conversation continues.
    usb_backend : object, optional
        Backend of pyusb; default: the system's.

    Raises
    ------
    FileExistsError
        When the file `capture` exists.
    SensorNotFoundError
        When there is no board, or nothing at `port`.
    SensorError
        When it cannot be opened (permissions, another program), or is not a radar that is known here (old firmware,
        another chip).
    ImportError
        Without the extra `usb`.

    See Also
    --------
    sensor.Sensor : The result.
    sensor.list_sensors : Boards that answer.
    sensor.virtual_board : A board without hardware.
    Simulator : Frames of a simulated scene, of the same kind.

    Examples
    --------
    >>> from radarcore.sensor.emulator.pty import PtyPort
    >>> from radarcore.sensor.emulator.source import Noise
    >>> with rc.sensor.virtual_board(Noise()) as board, PtyPort(board) as port:  # in place of a board on USB
    ...     with rc.open_sensor(port.path, protocol="strata") as sensor:
    ...         radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
    ...         print([frame.cube.shape for frame in sensor.frames(2)])
    [(3, 16, 128), (3, 16, 128)]
    """
    if protocol is not None:
        check.choice("protocol", protocol, PROTOCOLS)
    failures, reasons = [], []
    with nullcontext() if capture is None else claimed(Path(capture)):
        if port is not None:
            return Sensor(_connect(port, protocol, usb_backend, capture), queue_size=queue_size)
        for found in ports.find_ports(usb_backend=usb_backend):
            try:
                return Sensor(_connect(found, protocol, usb_backend, capture), queue_size=queue_size)
            except SensorError as error:
                failures.append(error)
                if _is_of_board(found, error):
                    reasons.append(error)
        if len(reasons) == 1:
            raise reasons[0]
        if reasons:
            raise SensorError(f"expected a radar board that can be opened, got{_listed(reasons)}")
        tried = f"; tried:{_listed(failures)}" if failures else ": no known USB device and no serial port of one"
        raise SensorNotFoundError(f"no radar board found{tried}")


def _is_of_board(port: Port, error: SensorError) -> bool:
    """True for a failure of what is there and a radar board for certain: by its answer, or by its USB ids."""
    if isinstance(error, SensorNotFoundError | SensorDisconnectedError):
        return False  # unplugged meanwhile
    ids = (port.vendor_id, port.product_id)
    if ids == _XMC and isinstance(error, (SensorTimeoutError, ProtocolError)):
        return bool(error.protocol)
    return bool(error.protocol) or ids in ports.KNOWN_BOARDS


def _listed(failures: list[SensorError]) -> str:
    return "".join(f"\n  {failure}" for failure in failures)


def _connect(
    port: str | Port, protocol: str | None, usb_backend: Any, capture: str | PathLike[str] | None = None
) -> Board:
    """The board at a port."""
    protocols: tuple[str, ...]
    open_stream: Callable[[], Stream]
    if isinstance(port, str) and port.startswith(_CAPTURE):
        place, protocols = port.removeprefix(_CAPTURE), PROTOCOLS[::-1]
        open_stream = partial(Replay, place)
    else:
        port = _port_of(port, usb_backend) if isinstance(port, str) else port
        if port.kind == "usb-vendor":
            if capture is not None:
                raise ValueError(f"capture: expected a port with a byte stream, got {port.path}, which has none")
            link = VendorLink(UsbVendorPort(port.device))
            return _or_close(link, partial(StrataBoard, link))
        place, protocols = port.path, _protocols_of(port)
        is_usb = port.kind == "usb-cdc"
        open_stream = partial(UsbStream, port.device) if is_usb else partial(SerialStream, port.path)
    if protocol is not None:
        protocols = (protocol,)
    timeout = _PROBE_TIMEOUT if len(protocols) > 1 else 1.0
    failures: dict[str, SensorError] = {}
    for name in protocols:
        stream: Stream = open_stream()
        if capture is not None:
            stream = _or_close(stream, partial(Capture, stream, capture))
        try:
            if name == "comlib":
                return _or_close(stream, partial(ComLibBoard, stream, timeout=timeout))
            return _or_close(stream, partial(StrataBoard, StreamLink(stream), timeout=timeout))
        except (SensorTimeoutError, ProtocolError) as error:
            if len(protocols) == 1 or error.protocol:
                raise
            failures[name] = error
    reasons = "; ".join(
        f"{_SPELLED[name]}: {str(error).removeprefix(f'{place}: ')}" for name, error in failures.items()
    )
    raise SensorError(f"{place}: expected a radar board, got a device without ComLib or Strata ({reasons})")


def _protocols_of(port: Port) -> tuple[str, ...]:
    """Protocols that a port may speak, in the order in which they are tried.

    Boards with known ids speak one. Bridges with ids of their own and UARTs are ways to Strata boards, while ComLib
    boards are USB devices themselves. At a pty either may be, and of the two a Strata board takes requests of the
    other protocol more lightly: a ComLib board then is silent for seconds.
    """
    ids = (port.vendor_id, port.product_id)
    if ids == _XMC:
        return ("comlib",)  # other products with these ids speak no Strata either
    if ids in ports.KNOWN_BOARDS:
        return ("strata",)
    return PROTOCOLS if port.vendor_id is None and ports.may_be_usb(port) else PROTOCOLS[::-1]


def _port_of(text: str, usb_backend: Any) -> Port:
    """Port of a name: a USB device that is plugged in, or else a serial port."""
    if not text.startswith("usb:"):
        return ports.serial_port(text)
    found = ports.find_ports(usb_backend=usb_backend, with_serial=False)
    for port in found:
        if text.lower() in (port.path, f"usb:{port.vendor_id:04x}:{port.product_id:04x}"):
            return port
    there = f"; there is {', '.join(port.path for port in found)}" if found else ""
    raise SensorNotFoundError(f"{text}: expected a radar board on USB, got none{there}")


def _or_close(resource: Stream | Link, make: Callable[[], _Made]) -> _Made:
    """Board or capture made from a resource, which is closed when that fails."""
    try:
        return make()
    except BaseException:
        resource.close()
        raise
