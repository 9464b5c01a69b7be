"""Interface of a board, whatever its protocol: identity, and frames of ADC codes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar


@dataclass(frozen=True)
class BoardInfo:
    """Identity of a board.

    Attributes
    ----------
    port : str
        Name of the port: a device file, or ``usb:BUS-ADDRESS``.
    protocol : str
        ``"strata"`` or ``"comlib"``.
    name : str
        As the board calls itself.
    chip : str
        Radar chip, such as ``"BGT60TR13C"``.
    firmware : str
        Version of the firmware.
    serial_number : str
        Serial number; empty for a board without one.

    See Also
    --------
    sensor.list_sensors : Methods of all boards that answer.

    Examples
    --------
    >>> print(sensor.info.chip, sensor.info.protocol)
    BGT60TR13C strata
    """

    port: str
    protocol: str
    name: str
    chip: str
    firmware: str
    serial_number: str


@dataclass(frozen=True, eq=False)
class RawFrame:
    """Frame of ADC codes.

    Attributes
    ----------
    codes : (channel, chirp, sample) uint16
        Codes of the ADC, from 0 to 4095.
    index : int
        Number of the frame since the start; counts lost ones.
    host_time : float
        When it arrived, seconds since 1970 by the clock of the host.
    device_time : float or None
        Time stamp of the board [s], from an origin of its own.
    lost_reasons : tuple of str
        Reasons of the losses just before it.
    """

    codes: NDArray[np.uint16]
    index: int
    host_time: float
    device_time: float | None = None
    lost_reasons: tuple[str, ...] = ()


@dataclass(frozen=True)
class Damage:
    """Bytes that a parser discarded.

    Attributes
    ----------
    num_bytes : int
    reason : str
    status : int
        Status for the other side, which says where the stream goes wrong; 0 for more bytes of the same damage.
    """

    num_bytes: int
    reason: str
    status: int = 0


class Board(Protocol):
    """A board with its connection. One thread uses it at a time: `Sensor` sees to that."""

    info: BoardInfo
    options: tuple[str, ...]
    """Options of `configure`."""

    @property
    def configure(self) -> Callable[..., Radar]:
        """Function of a radar and options of the board: the nearest it can do, in force from the next `start` on."""

    def start(self) -> None:
        """Begin to measure; frames count from 0."""

    def read(self, timeout: float) -> list[RawFrame]:
        """Frames since the last call, in order; empty when none arrives within `timeout` [s]."""

    def stop(self, *, is_silent: bool = False) -> None:
        """End measuring; does nothing where nothing is measured. A silent board gets the command without a wait."""

    def damage(self) -> str:
        """Losses and damage since the last frame, in words; empty where there are none."""

    def details(self) -> dict[str, Any]:
        """Entries of `Recording.source`: facts about the board that the radar does not hold."""

    def temperature(self) -> float:
        """Temperature of the chip [degrees Celsius]."""

    def close(self) -> None:
        """Give the port back; may be called twice."""


def check_single_ramp(radar: Radar) -> None:
    """Refuse a radar that needs more than one transmitter and one kind of chirps at equal intervals."""
    waveform = radar.waveform
    if radar.more_waveforms:
        raise ValueError(f"waveform: expected one, got {len(radar.waveforms)} sub-sequences")
    if radar.schedule is not None:
        raise ValueError(f"schedule: expected none with one antenna, got {radar.schedule.kind!r}")
    if len(radar.tx) != 1:
        raise ValueError(f"tx: expected one antenna, got {len(radar.tx)}")
    if not waveform.has_uniform_chirps or waveform.chirp_times[0] > 1e-9 * waveform.chirp_interval:
        raise ValueError(
            f"chirp_times: expected evenly spaced chirps from 0 s on, got {waveform.chirp_times[0]:g} s "
            f"and on average {waveform.chirp_interval:g} s between chirps; use chirp_interval instead"
        )
