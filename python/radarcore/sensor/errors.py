"""Errors of a sensor; each names the port and, where possible, a remedy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class SensorError(OSError):
    """A sensor cannot do what is asked. An `OSError`, as those of files are.

    Attributes
    ----------
    protocol : str
        Protocol in which the board had answered before it failed; empty where nothing has answered.
    """

    protocol: str = ""


class SensorNotFoundError(SensorError):
    """Error for a missing board, or nothing at the named port."""


class SensorTimeoutError(SensorError, TimeoutError):
    """The board did not answer, or sent no frame, in time."""


class SensorDisconnectedError(SensorError, ConnectionError):
    """The board is gone: unplugged, or its port closed."""


class ProtocolError(SensorError):
    """The board's answer is not what the protocol allows."""


class RequestError(ProtocolError):
    """The board refused a request.

    Attributes
    ----------
    status : int
        Status code.
    """

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


@contextmanager
def answering(protocol: str) -> Iterator[None]:
    """Conversation with a board that has answered in a protocol: its errors say so."""
    try:
        yield
    except SensorError as error:
        error.protocol = protocol
        raise


class FramesLostWarning(UserWarning):
    """Frames of a sensor were lost; the counts are in ``Frame.stats`` and ``Sensor.num_lost``."""
