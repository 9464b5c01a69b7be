"""Serial ports through pyserial: CDC boards that the kernel has as a tty, UART bridges, ptys, COM ports."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from radarcore.sensor.errors import SensorDisconnectedError, SensorError, SensorNotFoundError, SensorTimeoutError

if TYPE_CHECKING:
    from serial import Serial
    from serial.tools.list_ports_common import ListPortInfo

BAUD_RATES = (921_600, 1_000_000, 115_200)
"""Rates in the order of trial [baud]. USB boards ignore the rate; the second is for UART bridges that lack the first
(Strata, serial transport), the last for ptys of macOS."""


class SerialStream:
    """A serial port: 8N1, raw, no flow control, locked against other programs.

    Programs that lock ports are refused by a lock of the file, and others by the port itself, unless it is a pty.
    A killed program gives both back.

    Parameters
    ----------
    path : str
        Device file of a port or pty such as ``/dev/ttyACM0``, or ``COM3``.

    Raises
    ------
    SensorNotFoundError
        Nothing is there.
    SensorError
        The port may not be opened, is in use, or is no serial port.
    """

    def __init__(self, path: str) -> None:
        if not path or "\0" in path:
            raise ValueError(f"path: expected the path of a serial port, got {path!r}")
        self.name: str = path
        self._serial = _opened(path)

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""
        with _gone(self.name):
            if self._serial.timeout != timeout:
                self._serial.timeout = timeout
            # pyserial waits for the requested number of bytes: request one, then the bytes that came with it.
            data: bytes = self._serial.read(1)
            more = min(self._serial.in_waiting, size - 1) if data else 0
            return data + self._serial.read(more) if more else data

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""
        with _gone(self.name):
            self._serial.write_timeout = max(timeout, 0.001)  # 0 would not wait for the result
            self._serial.write(data)

    def close(self) -> None:
        """Give the port back; may be called twice."""
        self._serial.close()


@contextmanager
def _gone(name: str) -> Iterator[None]:
    """Errors of an open port as the sensor's errors."""
    try:
        yield
    except require_pyserial().SerialTimeoutException as error:
        raise SensorTimeoutError(f"{name}: the board did not take all bytes in time") from error
    except OSError as error:
        raise SensorDisconnectedError(f"{name}: the board is gone ({error})") from error


def require_pyserial() -> Any:
    """pyserial, or an ImportError that says how to install it."""
    try:
        import serial
        import serial.tools.list_ports
    except ImportError as error:
        raise ImportError("serial ports need pyserial: pip install radarcore[usb]") from error
    return serial


def serial_ports() -> list[ListPortInfo]:
    """Serial ports of this machine, sorted by name."""
    return sorted(require_pyserial().tools.list_ports.comports())


def _opened(path: str) -> Serial:
    """An open port at the first rate that it accepts."""
    serial = require_pyserial()
    refusals: tuple[type[Exception], ...] = (OSError, ValueError, *_termios_errors())
    refused: Exception | None = None
    for rate in BAUD_RATES:
        port = serial.Serial(None, baudrate=rate, exclusive=True)
        port.port = path
        try:
            port.open()
        except refusals as error:
            if (known := _open_error(path, error)) is not None:
                raise known from error
            refused = refused or error
        else:
            _make_exclusive(path, port)
            return port  # type: ignore[no-any-return]  # pyserial is imported late, and so Any
    raise SensorError(f"{path}: no serial port, or none that can be set up ({refused})") from refused


def _make_exclusive(path: str, port: Serial) -> None:
    """Refuse the port to programs without locks, but for root's. A pty would stay so when its client is killed."""
    if sys.platform != "win32" and not is_pty(path):
        import fcntl
        import termios

        with suppress(OSError):  # a driver without such a flag
            fcntl.ioctl(port.fileno(), termios.TIOCEXCL)


def is_pty(path: str) -> bool:
    """True for the name of a pseudo terminal, or of a link to one."""
    return re.fullmatch("/dev/(pts/|ttys)[0-9]+", os.path.realpath(path)) is not None


def _open_error(path: str, error: Exception) -> SensorError | None:
    """Error of a port that cannot be opened; None if another rate may help."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR) or "FileNotFoundError" in str(error):
        return SensorNotFoundError(f"{path}: there is no such port; is the board plugged in?")
    if number in (errno.EACCES, errno.EPERM):
        return SensorError(f"{path}: no permission{_permission_hint()}")
    # Windows denies access to what another program has open; its errors come as text.
    if number in (errno.EBUSY, errno.EAGAIN) or "PermissionError" in str(error):
        return SensorError(f"{path}: the port is in use by another program; close that one first")
    return None


def _permission_hint() -> str:
    if sys.platform != "linux":
        return ""
    return "; add yourself to the group dialout (sudo usermod -aG dialout $USER) and log in again"


def _termios_errors() -> tuple[type[Exception], ...]:
    """Errors besides OSError and ValueError that setting up a port raises."""
    try:
        import termios
    except ImportError:  # Windows has none
        return ()
    return (termios.error,)
