"""Errors of a sensor; each names the port and, where possible, a remedy."""

from __future__ import annotations


class SensorError(OSError):
    """A sensor cannot do what is asked. An `OSError`, as those of files are."""


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


class FramesLostWarning(UserWarning):
    """Frames of a sensor were lost; the counts are in ``Frame.stats`` and ``Sensor.num_lost``."""
