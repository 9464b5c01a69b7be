"""Settings of a board: options of `radarcore sensor`, the radar for them, and its limits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter

from radarcore import check
from radarcore.cli.options import Count, Metres
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.design import RequirementError
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.units import SPEED_OF_LIGHT, frequency_of, quantity

_MAX_RANGE, _LEAST_RANGE = 10.0, 5.0
"""Default range of a board [m]: a room; less, but not below the other, if a wide band would need more than
`_MANY_SAMPLES` for it."""

_MANY_SAMPLES = 256

_RECEIVERS = {1: (0,), 2: (0, 2), 3: (0, 1, 2)}
"""Receivers by their number: of two, the horizontal pair."""


_Hertz = Annotated[float | None, Parameter(metavar="HZ")]


@Parameter(name="*", group=Group("Settings of a board", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class BoardSettings:
    """Requirements for the settings of a board."""

    radar: Annotated[Path | None, Parameter(metavar="SCENE")] = None
    """take the radar of a scene file (TOML), a recording, or settings of a chip"""

    max_range: Metres = None
    """see at least so far [m] (default: 10); end of the range axis"""

    max_velocity: Annotated[float | None, Parameter(metavar="V")] = None
    """largest velocity, in both directions [m/s] (default: 4)"""

    bandwidth: Annotated[str | None, Parameter(metavar="FREQUENCY")] = None
    """sampled band, as 1.5GHz or 500MHz: range bins of 15 cm per GHz of it (default: about 1 GHz)"""

    rx: Annotated[str | None, Parameter(metavar="RX")] = None
    """receivers, as 1,3; or how many of them (default: all)"""

    rate: _Hertz = None
    """frames per second (default: 40)"""

    num_chirps: Annotated[Count, Parameter(name="--chirps")] = None
    """chirps per frame (default: 64)"""

    num_samples: Annotated[Count, Parameter(name="--samples")] = None
    """samples per chirp (default: 128)"""

    if_gain_db: Annotated[Count, Parameter(name="--gain", metavar="DB")] = None
    """IF gain, 18 to 60 dB (default: 23)"""

    tx_power_level: Annotated[Count, Parameter(name="--power", metavar="LEVEL")] = None
    """transmit power, 0 to 31 (default: 31)"""


NOT_SET = BoardSettings()


def radar_of(settings: BoardSettings) -> Radar:
    """The radar that the settings ask for; a ValueError names settings that exclude each other."""
    names = ("max_range", "max_velocity", "rate", "num_chirps", "num_samples")
    requirements: dict[str, Any] = {name: value for name in names if (value := getattr(settings, name)) is not None}
    if settings.bandwidth is not None:
        requirements["range_resolution"] = SPEED_OF_LIGHT / (2.0 * _bandwidth(settings.bandwidth))
    if settings.radar is None:
        radar = _designed(requirements)
    else:
        from radarcore.scenefile.load import load_radar  # takes longer to load than the rest

        radar = _changed(load_radar(settings.radar), requirements)
    return radar if settings.rx is None else _with_receivers(radar, _indices(settings.rx))


def gains_of(settings: BoardSettings) -> dict[str, Any]:
    """Settings of a board beside its radar."""
    given = {"if_gain_db": settings.if_gain_db, "tx_power_level": settings.tx_power_level}
    return {name: value for name, value in given.items() if value is not None}


def sight(radar: Radar) -> str:
    """Text of range and velocity: "sees 6.2 m in steps of 5.1 cm, +-3.1 m/s in steps of 20 cm/s, at 40 Hz"."""
    wf = radar.waveform
    parts = []
    if not wf.is_cw:
        parts.append(f"{quantity(radar.max_unambiguous_range, 'm')} in steps of {quantity(wf.range_resolution, 'm')}")
    if wf.num_chirps > 1:
        steps = quantity(wf.velocity_resolution, "m/s")
        parts.append(f"+-{quantity(radar.max_velocity, 'm/s')} in steps of {steps}")
    return f"sees {', '.join(parts) or 'neither range nor velocity'}, at {quantity(1.0 / wf.frame_interval, 'Hz')}"


def _designed(requirements: dict[str, Any]) -> Radar:
    """A BGT60TR13C for the requirements; the default range suits a room if the others allow it."""
    resolution = requirements.get("range_resolution")
    range_of_many = _MAX_RANGE if resolution is None else 0.5 * resolution * _MANY_SAMPLES
    room: dict[str, Any] = {"max_range": min(_MAX_RANGE, max(_LEAST_RANGE, range_of_many))}
    try:
        try:
            return bgt60tr13c(**room | requirements)
        except RequirementError:
            if resolution is None:
                raise
            return bgt60tr13c(**requirements)
    except RequirementError as error:
        if error.requirement != "range_resolution":
            raise
        possible = quantity(SPEED_OF_LIGHT / (2.0 * error.possible), "Hz", 4)
        asked = quantity(SPEED_OF_LIGHT / (2.0 * requirements["range_resolution"]), "Hz", 4)
        raise ValueError(f"bandwidth: expected at most {possible}{error.args[2]}, got {asked}") from None


def _changed(radar: Radar, requirements: dict[str, Any]) -> Radar:
    """A radar of a scene file with other numbers."""
    if wrong := [name for name in ("max_range", "max_velocity", "range_resolution") if name in requirements]:
        name = "bandwidth" if wrong[0] == "range_resolution" else wrong[0]
        raise ValueError(f"{name}: expected none beside --radar, which has a waveform")
    changes = dict(requirements)
    if "rate" in changes:
        changes["frame_interval"] = 1.0 / check.positive("rate", changes.pop("rate"), "Hz")
    if not changes:
        return radar
    return replace(radar, waveform=radar.waveform.replace(**changes))


def _bandwidth(text: str) -> float:
    try:
        return frequency_of(text)
    except ValueError as error:
        raise ValueError(f"bandwidth: {error}") from None


def _indices(text: str) -> tuple[int, ...]:
    """Receivers from 0: of a list, such as ``1,3`` or ``2,``, or a number of them."""
    try:
        numbers = [int(part) for part in text.split(",") if part.strip()]
        if "," not in text:
            return _RECEIVERS[numbers[0]]
        if not numbers or not set(numbers) <= {1, 2, 3} or len(set(numbers)) < len(numbers):
            raise ValueError
        return tuple(sorted(number - 1 for number in numbers))
    except (ValueError, KeyError, IndexError):
        raise ValueError(f"rx: expected some of 1,2,3, or how many of three receivers, got {text!r}") from None


def _with_receivers(radar: Radar, indices: tuple[int, ...]) -> Radar:
    """A radar with some of its receivers; of what it knows of them, phases are kept, which a board takes."""
    if (missing := max(indices)) >= len(radar.rx):
        raise ValueError(f"rx: expected receivers up to {len(radar.rx)} of the radar, got {missing + 1}")
    known: Receiver | None = radar.receiver
    if known is not None:
        phases = known.rx_phase_deg
        some = tuple(phases[index] for index in indices) if isinstance(phases, tuple) else phases
        known = Receiver(output="real", noise_figure_db=known.noise_figure_db, rx_phase_deg=some)
    weights = radar.channel_weights
    return Radar(
        radar.waveform,
        tx=radar.tx,
        rx=radar.rx[list(indices)],
        pattern=radar.pattern,
        tx_power_dbm=radar.tx_power_dbm,
        receiver=known,
        channel_weights=None if weights is None else weights.reshape(-1, len(radar.rx))[:, list(indices)].ravel(),
    )
