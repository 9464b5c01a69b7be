"""Interface of an emulated board to the transport of its bytes."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

LATENCY = 1e-3
"""Shortest time from a request to its answer [s]: boards take about that, and some hosts fail with less."""


class Unplugged(Exception):  # noqa: N818  # what has happened
    """The board is gone from the bus."""


class StreamPeripheral(Protocol):
    """A board behind a byte stream: CDC or UART. Both calls raise `Unplugged` when it is gone, in any thread."""

    def receive(self, data: bytes) -> None:
        """Bytes from the host, cut anywhere."""

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes of one transfer to the host: 1 to `size`, none when nothing is to be sent within `timeout` [s]."""


@runtime_checkable
class HearsHangUp(Protocol):
    """A board that is told when its client has gone, as USB boards are by their control lines."""

    def hang_up(self) -> None:
        """Forget the request that has come in part, and the answers that have not been sent; the rest goes on."""
