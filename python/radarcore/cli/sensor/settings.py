"""Settings of a board: options of `radarcore sensor`, the radar that they wish for, and what it sees."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter

from radarcore import check
from radarcore.cli.options import Count, Metres
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.design import WishError
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.units import SPEED_OF_LIGHT, frequency_of, quantity

_MAX_RANGE, _LEAST_RANGE = 10.0, 5.0
"""Range that a board sees if nobody asks for one [m]: a room; less, but not below the other, where a wide band would
need more than `_MANY_SAMPLES` for it."""

_MANY_SAMPLES = 256

_OPTIONS = {
    "max_range": ("--max-range", "m"),
    "max_velocity": ("--max-velocity", "m/s"),
    "bandwidth": ("--bandwidth", "Hz"),
    "rate": ("--rate", "Hz"),
    "num_chirps": ("--chirps", ""),
    "num_samples": ("--samples", ""),
}
"""Options of a waveform by their keywords, and units."""

_GAINS = {"if_gain_db": "--gain", "tx_power_level": "--power"}
"""Options of a board beside its waveform by their keywords."""

_RECEIVERS = {1: (0,), 2: (0, 2), 3: (0, 1, 2)}
"""Receivers by their number: of two, the horizontal pair."""


_Hertz = Annotated[float | None, Parameter(metavar="HZ")]


@Parameter(name="*", group=Group("Settings of a board", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class BoardSettings:
    """Wishes for the settings of a board."""

    radar: Annotated[Path | None, Parameter(metavar="SCENE")] = None
    """take the radar of a scene file (TOML), a recording, or settings of a chip"""

    max_range: Metres = None
    """see at least so far [m] (default: 10); end of the range axis"""

    max_velocity: Annotated[float | None, Parameter(metavar="V")] = None
    """tell velocities apart up to this, both ways [m/s] (default: 4)"""

    bandwidth: Annotated[str | None, Parameter(metavar="FREQUENCY")] = None
    """sampled band, as 1.5GHz or 500MHz: range bins of 15 cm per GHz of it (default: about 1 GHz)"""

    rx: Annotated[str | None, Parameter(metavar="RX")] = None
    """receivers, as 1,3; or how many of them (default: all)"""

    rate: _Hertz = None
    """frames per second (default: 40)"""

    chirps: Count = None
    """chirps per frame (default: 64)"""

    samples: Count = None
    """samples per chirp (default: 128)"""

    gain: Annotated[Count, Parameter(metavar="DB")] = None
    """IF gain, 18 to 60 dB (default: 23)"""

    power: Annotated[Count, Parameter(metavar="LEVEL")] = None
    """transmit power, 0 to 31 (default: 31)"""


NOT_SET = BoardSettings()


def radar_of(settings: BoardSettings) -> Radar:
    """The radar that the settings wish for; a ValueError names those that cannot be had together."""
    given = {
        "max_range": settings.max_range,
        "max_velocity": settings.max_velocity,
        "bandwidth": None if settings.bandwidth is None else _bandwidth(settings.bandwidth),
        "rate": settings.rate,
        "num_chirps": settings.chirps,
        "num_samples": settings.samples,
    }
    wishes: dict[str, float] = {name: value for name, value in given.items() if value is not None}
    for name, value in wishes.items():
        option, unit = _OPTIONS[name]
        check.count(option, value) if name.startswith("num_") else check.positive(option, value, unit)
    if settings.radar is None:
        radar = _designed(wishes)
    else:
        from radarcore.scenefile.load import load_radar  # takes longer to load than the rest

        radar = _changed(load_radar(settings.radar), wishes)
    return radar if settings.rx is None else _with_receivers(radar, _indices(settings.rx))


def refuse_settings(settings: BoardSettings, source: str) -> None:
    """Refuse settings of a board beside a recording or scene, whose range alone may be cut in the view."""
    names = ("radar", "max_velocity", "bandwidth", "rx", "rate", "chirps", "samples", "gain", "power")
    if (given := next((name for name in names if getattr(settings, name) is not None), None)) is not None:
        raise ValueError(f"--{given.replace('_', '-')}: expected a board, which it sets, got {source}")


def gains_of(settings: BoardSettings) -> dict[str, Any]:
    """Options of a board beside its radar."""
    given = {"if_gain_db": settings.gain, "tx_power_level": settings.power}
    return {name: value for name, value in given.items() if value is not None}


@contextmanager
def words_of_options() -> Iterator[None]:
    """Errors of a board's settings in the words of the options."""
    try:
        yield
    except (ValueError, TypeError) as error:
        name, colon, rest = str(error).partition(":")
        if name not in _GAINS:
            raise
        raise ValueError(f"{_GAINS[name]}{colon}{rest}") from None


def sight(radar: Radar) -> str:
    """Text of range and velocity: "sees 6.2 m in steps of 5.1 cm, +-3.1 m/s in steps of 20 cm/s, at 40 Hz"."""
    wf = radar.waveform
    parts = []
    if not wf.is_cw:
        parts.append(f"{quantity(radar.max_range, 'm')} in steps of {quantity(wf.range_resolution, 'm')}")
    if wf.num_chirps > 1:
        steps = quantity(wf.velocity_resolution, "m/s")
        parts.append(f"+-{quantity(radar.max_velocity, 'm/s')} in steps of {steps}")
    return f"sees {', '.join(parts) or 'neither range nor velocity'}, at {quantity(1.0 / wf.frame_interval, 'Hz')}"


def _designed(wishes: dict[str, float]) -> Radar:
    """A BGT60TR13C for the wishes; the range that nobody asked for gives way to them."""
    keywords: dict[str, Any] = {name: value for name, value in wishes.items() if name != "bandwidth"}
    if "bandwidth" in wishes:
        keywords["range_resolution"] = SPEED_OF_LIGHT / (2.0 * wishes["bandwidth"])
    tried = [keywords]
    if "max_range" not in wishes:
        if "bandwidth" not in wishes:
            tried = [keywords | {"max_range": _MAX_RANGE}]
        elif "num_samples" not in wishes:
            range_of_many = SPEED_OF_LIGHT * _MANY_SAMPLES / (4.0 * wishes["bandwidth"])
            tried.insert(0, keywords | {"max_range": min(_MAX_RANGE, max(_LEAST_RANGE, range_of_many))})
    try:
        try:
            return bgt60tr13c(**tried[0])
        except WishError:
            return bgt60tr13c(**tried[-1])
    except WishError as error:
        raise ValueError(_refusal(error, wishes)) from None
    except ValueError as error:
        raise ValueError(_in_options(str(error), wishes)) from None


def _refusal(error: WishError, wishes: dict[str, float]) -> str:
    """The wish that cannot be had, what can, and all that it was asked beside."""
    name, possible = error.wish, error.possible
    if name == "range_resolution":
        name, possible = "bandwidth", SPEED_OF_LIGHT / (2.0 * possible)
    unit = _OPTIONS[name][1]
    step = 10.0 ** (math.floor(math.log10(possible)) - 3) if possible > 0.0 else 1.0  # to the side that can be had
    text = quantity(step * math.floor(possible / step * (1.0 + 1e-9)), unit, 4)
    if name not in wishes:  # the range that nobody asked for
        return _in_options(str(error), wishes)
    return f"{_OPTIONS[name][0]}: expected at most {text}{_beside(wishes, name)}, got {quantity(wishes[name], unit, 6)}"


def _in_options(text: str, wishes: dict[str, float]) -> str:
    """A message in the words of the settings."""
    name = text.partition(":")[0]
    words = re.sub(r"\b(" + "|".join(_OPTIONS) + r")\b", lambda found: _OPTIONS[found[0]][0], text)
    return words if name not in _OPTIONS else f"{words}{_beside(wishes, name)}"


def _beside(wishes: dict[str, float], name: str) -> str:
    """The other options that were given."""
    others = [
        f"{_OPTIONS[other][0]} {quantity(value, _OPTIONS[other][1], 6)}"
        for other, value in wishes.items()
        if other != name
    ]
    return f" beside {' and '.join(others)}" if others else ""


def _changed(radar: Radar, wishes: dict[str, float]) -> Radar:
    """A radar of a scene file with other numbers."""
    if wrong := next((name for name in wishes if name in ("max_range", "max_velocity", "bandwidth")), None):
        raise ValueError(f"{_OPTIONS[wrong][0]}: expected none beside --radar, which has a waveform")
    changes: dict[str, Any] = {name: value for name, value in wishes.items() if name != "rate"}
    if "rate" in wishes:
        changes["frame_interval"] = 1.0 / wishes["rate"]
    if not changes:
        return radar
    values = radar.to_dict()
    values["waveform"] = radar.waveform.replace(**changes).to_dict()
    return Radar.from_dict(values)


def _bandwidth(text: str) -> float:
    try:
        return frequency_of(text)
    except ValueError as error:
        raise ValueError(f"--bandwidth: {error}") from None


def _indices(text: str) -> tuple[int, ...]:
    """Receivers from 0: those of a list, such as ``1,3`` or ``2,``, or as many as a number says."""
    try:
        numbers = [int(part) for part in text.split(",") if part.strip()]
        if "," not in text:
            return _RECEIVERS[numbers[0]]
        if not numbers or not set(numbers) <= {1, 2, 3} or len(set(numbers)) < len(numbers):
            raise ValueError
        return tuple(sorted(number - 1 for number in numbers))
    except (ValueError, KeyError, IndexError):
        raise ValueError(f"--rx: expected some of 1,2,3, or how many of three receivers, got {text!r}") from None


def _with_receivers(radar: Radar, indices: tuple[int, ...]) -> Radar:
    """A radar with some of its receivers; of what it knows of them, phases are kept, which a board takes."""
    if (missing := max(indices)) >= len(radar.rx):
        raise ValueError(f"--rx: expected receivers up to {len(radar.rx)} of the radar, got {missing + 1}")
    known: Receiver | None = radar.receiver
    if known is not None:
        phases = known.rx_phase_deg
        some = tuple(phases[index] for index in indices) if isinstance(phases, tuple) else phases
        known = Receiver(output="real", noise_figure_db=known.noise_figure_db, rx_phase_deg=some)
    return Radar(
        radar.waveform,
        tx=radar.tx,
        rx=radar.rx[list(indices)],
        pattern=radar.pattern,
        tx_power_dbm=radar.tx_power_dbm,
        receiver=known,
    )
