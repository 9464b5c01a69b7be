"""A byte stream to a board, and the refusal of a USB transfer."""

from __future__ import annotations

from typing import Protocol

from radarcore.sensor.errors import ProtocolError


class Stalled(ProtocolError):  # noqa: N818  # the USB term
    """The board refused a USB transfer (a STALL)."""


class Stream(Protocol):
    """A connection that carries bytes in both directions, cut anywhere.

    One thread uses it at a time. An unplugged or closed stream raises SensorDisconnectedError.
    """

    name: str

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""

    def close(self) -> None:
        """Give the port back; may be called twice."""
