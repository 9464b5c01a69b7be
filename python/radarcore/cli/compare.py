"""The command `radarcore compare`: recordings against each other and against the truth."""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import Any

from radarcore import check, plot
from radarcore.adapters.ros.bags import is_bag
from radarcore.cli.captured import motions_of, name_of
from radarcore.cli.source import load_recording
from radarcore.comparison.alignment import AUTO
from radarcore.comparison.comparison import compare
from radarcore.processing.detection import detect

_RADAR = "radar"
"""Body of motion capture that is the radar."""

_PAGE, _PICTURES = ".html", (".png", ".pdf", ".svg")
_FALSE_ALARM_RATE = 1e-4
"""As in `compare`, which has no limits of range."""


def run(options: argparse.Namespace) -> int:
    """Compare, print the tables, and write the report or the picture."""
    _check_output(options.output)
    sources = [text for text in (options.a, options.b) if text is not None]
    settings = ("method", "min_range", "max_range")
    chosen = {name: value for name in settings if (value := getattr(options, name)) is not None}
    recordings = [load_recording(Path(text)) for text in sources]
    compared = compare(
        *recordings,
        **_truth(options),
        targets=_pairs("targets", options.targets),
        offset=_offset(options.offset),
        max_offset=options.max_offset,
        names=_names(options.names, sources),
        range_only=options.range_only,
        detector=partial(detect, false_alarm_rate=_FALSE_ALARM_RATE, **chosen),
    )
    if options.json:
        print(json.dumps(compared.to_dict(), indent=2, allow_nan=False))
    else:
        print(compared)
    if options.output is not None:
        write = compared.report if options.output.suffix.lower() == _PAGE else compared.figure
        write(options.output, time=options.time, max_range=options.max_range)
        if not options.json:
            print(f"\n{options.output}")
    return 0


def _check_output(path: Path | None) -> None:
    """Refuse an output that could not be written, before work is done."""
    if path is None:
        return
    if path.suffix.lower() not in (_PAGE, *_PICTURES):
        kinds = ", ".join((_PAGE, *_PICTURES))
        raise ValueError(f"{path}: expected a report or a picture ({kinds}), got suffix {path.suffix!r}")
    plot.require()


def _truth(options: argparse.Namespace) -> dict[str, Any]:
    """The truth that was given, and the radar's motion in it: arguments of `compare`."""
    path: Path | None = options.truth
    if path is not None and (path.suffix.lower() == ".csv" or is_bag(path)):
        return _captured(path, options)
    for name in ("radar", "radius"):
        if getattr(options, name) is not None:
            got = "none" if path is None else path
            raise ValueError(f"--{name}: expected --truth with motion capture (Motive's .csv, or a bag), got {got}")
    return {} if path is None else {"truth": load_recording(path)}


def _captured(path: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Motions of the bodies that motion capture saw, and of the one that is the radar."""
    motions = motions_of(path, options.a)
    radar = _RADAR if options.radar is None else options.radar
    if radar not in motions:
        raise ValueError(f"--radar: expected a body of {path}, got {radar!r}; {check.near_names(radar, motions)}")
    if len(motions) == 1:
        raise ValueError(f"--truth: expected a body of {path} besides the radar {radar!r}, got none")
    radii = {name: check.non_negative("radius", _float("radius", text), "m") for name, text in _radii(options.radius)}
    return {
        "truth": {name: motion for name, motion in motions.items() if name != radar},
        "radar_motion": motions[radar],
        "radii": radii or None,
    }


def _radii(text: str | None) -> list[tuple[str, str]]:
    return [] if text is None else list((_pairs("radius", text) or {}).items())


def _pairs(name: str, text: str | None) -> dict[str, str] | None:
    """Values by the names of a list NAME=VALUE,...; a name without one is its own."""
    if text is None:
        return None
    pairs = [entry.strip().partition("=") for entry in text.split(",")]
    if any(not key for key, _, _ in pairs):
        raise ValueError(f"--{name}: expected names with commas between them, got {text!r}")
    return {key: value or key for key, _, value in pairs}


def _float(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"--{name}: expected a number, got {text!r}") from None


def _offset(text: str | None) -> Any:
    """Seconds, or auto, or both of a pair."""
    if text is None:
        return 0.0
    parts = [part if part == AUTO else _float("offset", part) for part in text.split(",")]
    return parts[0] if len(parts) == 1 else tuple(parts)


def _names(text: str | None, sources: list[str]) -> list[str] | None:
    """Names of the recordings; None where they are alike."""
    if text is not None:
        return [name.strip() for name in text.split(",")]
    names = [name_of(source) for source in sources]
    return names if len(set(names)) == len(names) else None
