"""Serial ports through pyserial: CDC boards that the kernel has as a tty, UART bridges, ptys, COM ports."""

from __future__ import annotations

import errno
import os
import re
import select
import sys
from array import array
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from radarcore.sensor.errors import SensorDisconnectedError, SensorError, SensorNotFoundError, SensorTimeoutError
from radarcore.sensor.transport.stream import SLICE, ByteStream

if TYPE_CHECKING:
    from serial import Serial
    from serial.tools.list_ports_common import ListPortInfo

BAUD_RATES = (921_600, 1_000_000, 115_200)
"""Rates in the order of trial [baud]. USB boards ignore the rate; the second is for UART bridges that lack the first
(Strata, serial transport), the last for ptys of macOS."""


_TIOCGEXCL = 0x80045440
"""Request of Linux: whether a terminal is exclusive."""


class SerialStream(ByteStream):
    """A serial port: 8N1, raw, no flow control, locked against other programs.

    The lock is that of files, which all users have and a killed program gives back. Where Linux has a port exclusive
    for another program, root is refused too. Ports of hardware are made exclusive, so that programs without locks are
    refused but for root's; a pty is not, as it stays so after a killed client while its other end has it open.

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
        super().__init__(path)
        self._serial = _opened(path)

    def _read_some(self, size: int, timeout: float) -> bytes:
        timeout = min(timeout, SLICE)
        try:
            if self._serial.timeout != timeout:
                self._serial.timeout = timeout
            # pyserial waits for as many bytes as are asked: ask for one, then for those that have come with it.
            data: bytes = self._serial.read(1)
            more = min(self._serial.in_waiting, size - 1) if data else 0
            return data + self._serial.read(more) if more else data
        except OSError as error:
            raise SensorDisconnectedError(f"{self.name}: the board is gone ({error})") from error

    def _write_some(self, data: bytes, timeout: float) -> int:
        import serial

        try:
            if os.name == "posix":
                # The loop of pyserial spins while the port takes nothing, and forgets how much it took.
                ready = select.select([], [self._serial.fileno()], [], min(timeout, SLICE))[1]
                return os.write(self._serial.fileno(), data) if ready else 0
            self._serial.write_timeout = max(timeout, 0.001)  # 0 would not wait for the result
            return self._serial.write(data) or 0
        except BlockingIOError:
            return 0
        except serial.SerialTimeoutException as error:
            raise SensorTimeoutError(f"{self.name}: the board did not take all bytes in time") from error
        except OSError as error:
            raise SensorDisconnectedError(f"{self.name}: the board is gone ({error})") from error

    def _give_back(self) -> None:
        _end_exclusive(self._serial)
        self._serial.close()


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
        port = serial.Serial(None, baudrate=rate, timeout=SLICE, write_timeout=None, exclusive=True)
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


def is_pty(path: str) -> bool:
    """True for the name of a pseudo terminal, or of a link to one."""
    return re.fullmatch("/dev/(pts/|ttys)[0-9]+", os.path.realpath(path)) is not None


def _make_exclusive(path: str, port: Serial) -> None:
    """Refuse a port that is exclusive for another program, which the system does for all but root; take it."""
    if sys.platform != "linux":
        return
    import fcntl
    import termios

    is_exclusive = array("i", [0])
    with suppress(OSError):  # a driver without such a flag
        fcntl.ioctl(port.fileno(), _TIOCGEXCL, is_exclusive, True)
        if not is_exclusive[0] and not is_pty(path):
            fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
    if is_exclusive[0]:
        port.close()
        raise _in_use(path)


def _end_exclusive(port: Serial) -> None:
    """Give an exclusive port back to programs that have it open beside this one."""
    if sys.platform == "linux":
        import fcntl
        import termios

        with suppress(OSError):  # it is closed already, or the board gone
            fcntl.ioctl(port.fileno(), termios.TIOCNXCL)


def _in_use(path: str) -> SensorError:
    return SensorError(f"{path}: the port is in use by another program; close that one first")


def _open_error(path: str, error: Exception) -> SensorError | None:
    """Error of a port that cannot be opened; None if another rate may help."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR) or "FileNotFoundError" in str(error):
        return SensorNotFoundError(f"{path}: there is no such port; is the board plugged in?")
    if number in (errno.EACCES, errno.EPERM):
        return SensorError(f"{path}: no permission{_permission_hint()}")
    # Windows denies access to what another program has open; its errors come as text.
    if number in (errno.EBUSY, errno.EAGAIN) or "PermissionError" in str(error):
        return _in_use(path)
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
