"""Requests of the driver whose answers are not waited for so long, for boards that lose them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from radarcore.sensor.strata.packets import Request
from radarcore.sensor.strata.stream import REQUEST_TIMEOUT, RETRIES, StreamLink


def shorten_requests(
    monkeypatch: pytest.MonkeyPatch, longest: float, those: Callable[[Request], Any] = lambda request: True
) -> None:
    """Let requests (those, if not all) wait for their answers up to `longest` [s]."""
    ask = StreamLink.ask

    def soon(self: StreamLink, request: Request, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> bytes:
        return ask(self, request, min(timeout, longest) if those(request) else timeout, retries=retries)

    monkeypatch.setattr(StreamLink, "ask", soon)
