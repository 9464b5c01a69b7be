"""The command `radarcore compare`: compare recordings with each other and with the truth."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore import check, plot
from radarcore.adapters.optitrack.csv import read_motive_csv
from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.adapters.ros.frames import FRAME_TYPE
from radarcore.adapters.ros.messages import nearest_nanoseconds
from radarcore.adapters.ros.motions import POSES, RIGID_BODIES, first_stamp_ns
from radarcore.adapters.ros.poses import pose_series, rigid_body_series
from radarcore.cli.options import AS_USUAL, Detecting, File, Flag, Json, OutputFile, Overwrite, Quiet, Seconds, given
from radarcore.cli.sources import NOT_BARE, WHOLE, Reading, beside, only_radar, path_and_topic
from radarcore.cli.terminal import show
from radarcore.comparison import report
from radarcore.comparison.alignment import AUTO
from radarcore.comparison.compare import compare
from radarcore.comparison.targets import FALSE_ALARM_RATE
from radarcore.motion.protocol import Motion
from radarcore.output import check_file
from radarcore.processing.detection.detect import detect

_RADAR = "radar"
"""Default name of the radar's body in motion capture."""

_PAGE, _PICTURES = ".html", (".png", ".pdf", ".svg")

_LONGEST_GAP = 0.1
"""Longest time to interpolate between poses of motion capture [s]."""


def run(
    a: Annotated[str, Parameter(metavar="A")],
    b: Annotated[str | None, Parameter(metavar="B")] = None,
    /,
    *,
    output: OutputFile = None,
    truth: File = None,
    radar: Annotated[str | None, Parameter(metavar="NAME")] = None,
    radius: Annotated[str | None, Parameter(metavar="NAME=M,...")] = None,
    offset: Annotated[str | None, Parameter(metavar="S", allow_leading_hyphen=True)] = None,
    max_offset: Seconds = None,
    targets: Annotated[str | None, Parameter(metavar="NAME,...")] = None,
    names: Annotated[str | None, Parameter(metavar="NAME,NAME")] = None,
    range_only: Flag = False,
    time: Seconds = None,
    overwrite: Overwrite = False,
    _quiet: Quiet = False,
    as_json: Json = False,
    detecting: Detecting = AS_USUAL,
    reading: Reading = WHOLE,
) -> None:
    """Compare, print the tables, and write the report or the picture.

    Parameters
    ----------
    a : str
        recording, or BAG:/TOPIC; its clock, or the truth's, is the time base
    b : str
        recording, or BAG:/TOPIC, to compare with A
    output : path
        report (.html), or picture (.png, .pdf, .svg) (default: A-comparison.html beside A; none with --json)
    truth : path
        motion capture (Motive's .csv, poses in a bag), or recording with truth (default: the recordings' own)
    radar : str
        body of motion capture that carries the radar (default: radar)
    radius : str
        distance from origins of motion capture bodies to their surfaces [m]
    offset : str
        time base minus clock of the last recording [s], or auto (default: 0); S,S for both
    max_offset : float
        largest offset for auto [s]
    targets : str
        targets to compare; NAME=BODY renames one (default: all visible)
    names : str
        names of the recordings (default: names of their files)
    range_only : bool
        ignore angles, for radars with uncalibrated receivers
    time : float
        time of the maps (default: the middle)
    """
    if output is None and not as_json:
        output = beside(Path(a), "-comparison.html")
    if output is not None:
        if output.suffix.lower() not in (_PAGE, *_PICTURES):
            kinds = ", ".join((_PAGE, *_PICTURES))
            raise ValueError(f"{output}: expected a report or a picture ({kinds}), got suffix {output.suffix!r}")
        check_file(output, overwrite=overwrite)
        plot.require()
    sources = [text for text in (a, b) if text is not None]
    recordings = [reading.load(Path(text)) for text in sources]
    compared = compare(
        *recordings,
        **_truth(truth, a, radar, radius),
        targets=_pairs("targets", targets),
        offset=_offset(offset),
        max_offset=max_offset,
        names=_names(names, sources),
        range_only=range_only,
        detector=partial(detect, **{"false_alarm_rate": FALSE_ALARM_RATE} | detecting.given),
    )
    if as_json:
        print(json.dumps(compared.to_dict(), indent=2, allow_nan=False))
    else:
        for number, table in enumerate(report.tables(compared)):
            if number:
                show("")
            show(table)
    if output is not None:
        write = compared.report if output.suffix.lower() == _PAGE else compared.figure
        write(output, time=time, max_range=detecting.max_range, overwrite=overwrite)
        if not as_json:
            show(f"\n{output}")


def _truth(path: Path | None, reference: str, radar: str | None, radius: str | None) -> dict[str, Any]:
    """Arguments of `compare` for the given truth; motion capture also gives the radar's motion."""
    if path is None or (path.suffix.lower() != ".csv" and not is_bag(path)):
        if alone := given(radar=radar, radius=radius):
            got = "none" if path is None else path
            raise ValueError(
                f"{next(iter(alone))}: expected --truth with motion capture (Motive's .csv, or a bag), got {got}"
            )
        return {} if path is None else {"truth": NOT_BARE.load(path)}
    motions, name = _motions_of(path, reference), radar or _RADAR
    if name not in motions:
        raise ValueError(f"radar: expected a body of {path}, got {name!r}; {check.near_names(name, motions)}")
    radar_motion = motions.pop(name)
    if not motions:
        raise ValueError(f"--truth: expected a body of {path} besides the radar {name!r}, got none")
    texts = _pairs("radius", radius) or {}
    radii = {body: check.non_negative("radius", _float("radius", text), "m") for body, text in texts.items()}
    return {"truth": motions, "radar_motion": radar_motion, "radii": radii or None}


def _pairs(name: str, text: str | None) -> dict[str, str] | None:
    """Values by name from a list NAME=VALUE,...; the default value is the name."""
    if text is None:
        return None
    pairs = [entry.strip().partition("=") for entry in text.split(",")]
    if any(not key for key, _, _ in pairs):
        raise ValueError(f"{name}: expected names with commas between them, got {text!r}")
    return {key: value or key for key, _, value in pairs}


def _float(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name}: expected a number, got {text!r}") from None


def _offset(text: str | None) -> Any:
    """Seconds or auto, or a pair of them."""
    if text is None:
        return 0.0
    parts = [part if part == AUTO else _float("offset", part) for part in text.split(",")]
    return parts[0] if len(parts) == 1 else tuple(parts)


def _names(text: str | None, sources: list[str]) -> list[str] | None:
    """Names of the recordings, by default the last parts of their topics or paths; None if these are equal."""
    if text is not None:
        return [name.strip() for name in text.split(",")]
    places = map(path_and_topic, sources)
    names = [topic.rpartition("/")[2] if topic else path.resolve().stem for path, topic in places]
    return names if len(set(names)) == len(names) else None


def _motions_of(path: Path, reference: str) -> dict[str, Motion]:
    """Motions of the bodies in a take of Motive or in a bag, by name.

    Times in a bag count like the frames of `reference` if these are in the same bag, else from the first stamp.
    """
    if not is_bag(path):
        capture = read_motive_csv(path)
        seen = [name for name in capture.names if capture[name].is_tracked.sum() >= 2]
        return {name: capture.trajectory(name) for name in seen}
    with BagReader(path) as bag:
        of_frames, topic = path_and_topic(reference)
        is_same = is_bag(of_frames) and of_frames.resolve() == path.resolve()
        start = _start_of_frames(bag, topic or only_radar(bag)) if is_same else first_stamp_ns(bag)
        series = {}
        for found in bag.topics.values():
            messages = bag.messages(found.name)
            if found.type in POSES:
                series[_body_of(found.name)] = pose_series(messages)
            elif found.type in RIGID_BODIES:
                series |= rigid_body_series(messages)
        if not series:
            bag.only_topic(*POSES, *RIGID_BODIES, argument="--truth")  # raises an error that lists the topics
        return {name: one.trajectory(start, max_gap=_LONGEST_GAP) for name, one in series.items()}


def _body_of(topic: str) -> str:
    """Name of the body of a topic: the last part that is not ``pose``, as in ``/natnet_ros/NAME/pose``."""
    parts = [part for part in topic.split("/") if part]
    return parts[-2] if len(parts) > 1 and parts[-1] == "pose" else parts[-1]


def _start_of_frames(bag: BagReader, topic: str) -> int:
    """Stamp at time 0 of the frames on a topic [ns]."""
    first = next(bag.messages(bag.topic(topic, FRAME_TYPE).name), None)
    if first is None:
        raise ValueError(f"{bag.path}, {topic}: expected at least one frame, got none")
    return first.time_ns - nearest_nanoseconds(first.message.time)
