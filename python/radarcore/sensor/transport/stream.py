"""Connections to a board: byte streams, or vendor requests with bulk packets."""

from __future__ import annotations

from typing import Protocol

from radarcore.sensor.errors import ProtocolError


class Stalled(ProtocolError):  # noqa: N818  # the USB term
    """The board refused a USB transfer (a STALL)."""


class Stream(Protocol):
    """A connection that carries bytes in both directions, cut anywhere.

    One thread uses it at a time. What is unplugged or closed raises `SensorDisconnectedError`.
    """

    name: str

    def read(self, size: int, timeout: float) -> bytes:
        """Received bytes, 1 to `size`; none if none came within `timeout` [s]."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send all of `data`, or raise `SensorTimeoutError` when `timeout` [s] is over."""

    def close(self) -> None:
        """Give the port back; may be called twice."""


class VendorPort(Protocol):
    """A USB device that is spoken to in control transfers and answers there and in bulk packets.

    One thread uses it at a time. A transfer that the board refuses raises `Stalled`, one that it does not answer within
    `timeout` [s] `SensorTimeoutError`.
    """

    name: str

    def control_write(
        self, request_type: int, request: int, value: int, index: int, data: bytes, timeout: float
    ) -> None:
        """A control transfer to the board."""

    def control_read(
        self, request_type: int, request: int, value: int, index: int, length: int, timeout: float
    ) -> bytes:
        """A control transfer from the board, at most `length` bytes."""

    def read_packet(self, size: int, timeout: float) -> bytes:
        """Bulk transfer of at most `size` bytes; none when none came within `timeout` [s]."""

    def close(self) -> None:
        """Give the device back; may be called twice."""
