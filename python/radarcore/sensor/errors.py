"""Errors of a sensor; each names the port and, where possible, a remedy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class SensorError(OSError):
    """A sensor cannot do what is asked. An OSError, like errors of files.

    Attributes
    ----------
    protocol : str
        Protocol in which the board had answered before it failed; empty where nothing has answered.

    See Also
    --------
    sensor.SensorNotFoundError : No board.
    sensor.SensorTimeoutError : No answer.
    sensor.ProtocolError : An answer that makes no sense.

    Examples
    --------
    >>> try:
    ...     sensor = rc.open_sensor("/dev/null")
    ... except rc.sensor.SensorError as error:
    ...     print(isinstance(error, OSError))
    True
    """

    protocol: str = ""


class SensorNotFoundError(SensorError):
    """Error for a missing board, or nothing at the named port.

    See Also
    --------
    sensor.list_sensors : Boards that answer.

    Examples
    --------
    >>> try:
    ...     sensor = rc.open_sensor("/dev/no-such-port")
    ... except rc.sensor.SensorNotFoundError as error:
    ...     print(error)
    /dev/no-such-port: there is no such port; is the board plugged in?
    """


class SensorTimeoutError(SensorError, TimeoutError):
    """The board did not answer, or sent no frame, in time.

    See Also
    --------
    sensor.Sensor.frames : Takes the longest time without a frame.

    Examples
    --------
    >>> issubclass(rc.sensor.SensorTimeoutError, TimeoutError)
    True
    """


class SensorDisconnectedError(SensorError, ConnectionError):
    """The board is gone: unplugged, or its port closed.

    See Also
    --------
    open_sensor : Opens the board again when it is back.

    Examples
    --------
    >>> issubclass(rc.sensor.SensorDisconnectedError, ConnectionError)
    True
    """


class ProtocolError(SensorError):
    """The board's answer is not what the protocol allows.

    See Also
    --------
    sensor.RequestError : A request that was refused.

    Examples
    --------
    >>> issubclass(rc.sensor.ProtocolError, rc.sensor.SensorError)
    True
    """


class RequestError(ProtocolError):
    """The board refused a request.

    Attributes
    ----------
    status : int
        Status code.

    See Also
    --------
    sensor.ProtocolError : An answer that makes no sense.

    Examples
    --------
    >>> error = rc.sensor.RequestError("board: refused", status=3)
    >>> error.status
    3
    """

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.status), vars(self)


@contextmanager
def answering(protocol: str) -> Iterator[None]:
    """Conversation with a board that has answered in a protocol: its errors say so."""
    try:
        yield
    except SensorError as error:
        error.protocol = protocol
        raise


class FramesLostWarning(UserWarning):
    """Frames of a sensor were lost; the counts are in ``Frame.stats`` and ``Sensor.num_lost``.

    See Also
    --------
    sensor.Sensor.frames : Warns by it.

    Examples
    --------
    >>> issubclass(rc.sensor.FramesLostWarning, UserWarning)
    True
    """
