"""Checks of a board: their results, and the measurements that they take."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from radarcore.radar.radar import Radar
from radarcore.sensor.board import Board, Lost, RawFrame
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.errors import SensorError

Result = Literal["PASS", "FAIL", "SKIP"]

_MANY_REASONS = 3
"""Reasons of losses that a text has at most."""


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes
    ----------
    name : str
    result : str
        ``"PASS"``, ``"FAIL"``, or ``"SKIP"`` for what this board, protocol or chip does not offer.
    measured, expected : str
        Texts for people.
    values : dict
        Numbers behind them, ready for JSON.

    See Also
    --------
    sensor.Sensor.selftest : Makes them.

    Examples
    --------
    >>> check = rc.sensor.Check("frames", "PASS", measured="100 frames", expected="100 frames")
    >>> check.result
    'PASS'
    """

    name: str
    result: Result
    measured: str
    expected: str
    values: dict[str, Any] = field(default_factory=dict)


def judged(name: str, is_good: bool, measured: str, expected: str, values: dict[str, Any] | None = None) -> Check:
    """A check that passes if what was measured is good."""
    return Check(name, "PASS" if is_good else "FAIL", measured, expected, values or {})


def present_radar(board: Board, interval: float) -> Radar:
    """The radar that a board with ComLib is set to, at its fastest or every `interval` [s]."""
    if not isinstance(board, ComLibBoard):
        raise SensorError(f"{board.info.port}: expected a board with Strata or ComLib, got {board.info.protocol}")
    radar = board.present_radar()
    waveform = radar.waveform
    return replace(radar, waveform=waveform.replace(frame_interval=max(interval, waveform.frame_interval)))


def set_to(board: Board, radar: Radar, **options: Any) -> float:
    """Configure a board; the interval of frames that it has then [s]."""
    try:
        return board.configure(radar, **options).waveform.frame_interval
    except ValueError as error:
        if not isinstance(board, ComLibBoard):
            raise
        raise SensorError(f"{board.info.port}: the board's own settings are beyond its limits: {error}") from error


def reasons_of(lost: list[Lost]) -> str:
    """Reasons of losses in words: the first ones, as each may have numbers of its own."""
    reasons = list(dict.fromkeys(loss.reason for loss in lost))
    more = f" and {len(reasons) - _MANY_REASONS} more" if len(reasons) > _MANY_REASONS else ""
    return ", ".join(reasons[:_MANY_REASONS]) + more


def measure(board: Board, num_frames: int, interval: float) -> tuple[list[RawFrame], list[Lost]]:
    """Some frames of a board every `interval` [s], and losses among them; SensorError where they take far too long."""
    frames: list[RawFrame] = []
    lost: list[Lost] = []
    board.start()
    try:
        deadline = time.monotonic() + 2.0 + 1.5 * num_frames * interval
        while len(frames) < num_frames:
            for item in board.read(0.1):
                if len(frames) == num_frames:
                    break  # what comes behind the last one is not about them
                if isinstance(item, RawFrame):
                    frames.append(item)
                else:
                    lost.append(item)
            if len(frames) < num_frames and time.monotonic() > deadline:
                reasons = reasons_of(lost)
                raise SensorError(
                    f"{board.info.port}: {len(frames)} of {num_frames} frames, which take "
                    f"{num_frames * interval:.2g} s, came in "
                    f"{2.0 + 1.5 * num_frames * interval:.1f} s{': ' + reasons if reasons else ''}"
                )
    finally:
        board.stop()
    return frames, lost


def with_rx(radar: Radar, indices: list[int]) -> Radar:
    """Radar with some of the receivers of another."""
    return Radar(radar.waveform, tx=radar.tx, rx=radar.rx[indices], pattern=radar.pattern, receiver=radar.receiver)
