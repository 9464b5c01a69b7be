"""The command `radarcore info`: content of recordings, scenes, bags, datasets and meshes, and boards."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore.adapters.ros.bags import BagReader, is_bag
from radarcore.cli.options import Json, Source
from radarcore.cli.sensor import show_board
from radarcore.cli.sources import NOT_BARE, BareSamples, is_board
from radarcore.cli.terminal import show
from radarcore.dataset.store import attrs_of
from radarcore.dataset.variation import Parameter as Varying
from radarcore.dataset.variation import Variation, varies
from radarcore.geometry.mesh_files import STEP_SUFFIXES, SUFFIXES, load_mesh
from radarcore.geometry.mesh_report import mesh_report
from radarcore.recording.bare import NO_DESCRIPTION, Description
from radarcore.recording.recording import Recording, facts_of_frames, recordings_in
from radarcore.scene.body import Body
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.read import values_of
from radarcore.table import Table
from radarcore.units import line


def run(
    source: Source,
    /,
    *,
    scale: Annotated[float, Parameter(metavar="M")] = 1.0,
    as_json: Json = False,
    bare: BareSamples = NOT_BARE,
) -> None:
    """Print the content of a recording, a scene file, a bag, a dataset or a mesh; or what a board is.

    Parameters
    ----------
    source : path
        recording, scene file (TOML), ROS bag, dataset, mesh (OBJ, STL, PLY, ...), or port of a board
    scale : float
        metres per unit of a mesh
    """
    if source.suffix.lower() in SUFFIXES + STEP_SUFFIXES:
        _show_mesh(source, scale, as_json)
        return
    if attrs_of(source) is not None:
        from radarcore.cli.dataset import show_dataset  # takes longer to load than the rest

        show_dataset(source, as_json)
        return
    if is_board(source):
        show_board(source.as_posix(), as_json)
        return
    facts = _facts(source, bare)
    if as_json:
        print(json.dumps(facts, indent=2))
    else:
        show(Table((), list(_texts(facts)), num_left=2))


def _texts(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Names and values as text; of topics and recordings an entry each."""
    for name, value in facts.items():
        if name == "varies":
            yield name, f"{len(value)} values of samples"
        if name in ("topics", "recordings", "varies"):
            yield from ((f"  {entry}", text) for entry, text in value.items())
        else:
            yield line(name, value)


def _facts(path: Path, bare: BareSamples) -> dict[str, Any]:
    if path.suffix == ".toml":
        return _scene_facts(path)
    if is_bag(path):
        return _bag_facts(path)
    if found := recordings_in(path):
        return {
            "folder": str(path),
            "recordings": {place.name: _recording_line(place, bare.description) for place in found},
        }
    return _recording_facts(path, bare)


def _bag_facts(path: Path) -> dict[str, Any]:
    """Content of a bag, by name with unit."""
    with BagReader(path) as bag:
        start = datetime.fromtimestamp(bag.start_ns // 10**9, UTC).isoformat()
        return {
            "bag": str(path),
            "ROS": bag.version,
            "start": start if bag.topics else None,
            "start [ns]": bag.start_ns,
            "duration [s]": 1e-9 * (bag.stop_ns - bag.start_ns),
            "messages": sum(topic.num_messages for topic in bag.topics.values()),
            "topics": {topic.name: f"{topic.num_messages} {topic.type}" for topic in bag.topics.values()},
        }


def _show_mesh(path: Path, scale: float, as_json: bool) -> None:
    report = mesh_report(load_mesh(path, scale=scale))
    if as_json:
        print(json.dumps({"mesh": str(path), **report.facts(), "verdict": report.verdict}, indent=2))
    else:
        show(report)


def _scene_facts(path: Path) -> dict[str, Any]:
    """Content of a scene file, by name with unit; of its first sample if it varies."""
    variation = Variation.load(path) if varies(values_of(path)) else None
    simulation = load_scene(path) if variation is None else variation.sample(0).simulation()
    scene, run = simulation.scene, simulation.run
    return {
        "scene": str(path),
        "bodies": list(scene.names),
        **({"interferers": list(scene.interferer_names)} if scene.interferers else {}),
        "triangles": sum(len(body.mesh.triangles) for body in scene.bodies if isinstance(body, Body)),
        "frames": len(run.times),
        "start [s]": run.start,
        "stop [s]": run.stop,
        "rate [Hz]": run.rate,
        **simulation.radar.facts(),
        **({} if variation is None else {"varies": {one.path: _range(one) for one in variation.parameters}}),
    }


def _range(parameter: Varying) -> str:
    """Distribution of a value that varies, as text."""
    ends = (f"{end:g}" if isinstance(end, float) else str(end) for end in parameter.ends)
    return f"{parameter.kind} {', '.join(ends)}{f' [{parameter.unit}]' if parameter.unit else ''}"


def _recording_facts(path: Path, bare: BareSamples) -> dict[str, Any]:
    """Content of a recording, by name with unit; samples of files are not read."""
    recording = bare.load(path)
    return {
        "recording": str(path),
        **facts_of_frames(recording),
        **measured_facts(recording.source),
        "lost frames": "not counted" if recording.lost is None else int(recording.lost.sum()),
        "source": recording.source,
    }


def _recording_line(place: Path, config: Description) -> str:
    """One line about a recording, or its error."""
    try:
        recording = _recording(place, config)
    except (ValueError, TypeError, OSError, ImportError) as error:
        return str(error).splitlines()[0].removeprefix(f"{place}: ")
    num_frames, *row = recording.shape
    wf = recording.radar.waveform
    seconds = float(recording.time[-1] - recording.time[0]) + wf.frame_interval if num_frames else 0.0
    sensor = f", {text}" if (text := measured_facts(recording.source).get("sensor")) else ""
    shape = " x ".join(map(str, row))
    return f"{num_frames} frames of {shape}, {seconds:.3g} s, {wf.start_frequency * 1e-9:.6g} GHz{sensor}"


def _recording(place: Path, config: Description) -> Recording:
    """Recording at a place, with the description if it is bare."""
    try:
        return Recording.load(place, **vars(NO_DESCRIPTION))
    except (ValueError, TypeError):
        if not config.given or place.is_dir() or place.suffix == ".npz":
            raise
        return Recording.load(place, **vars(config))


def measured_facts(source: Mapping[str, Any]) -> dict[str, Any]:
    """Board, date, receivers and gains by name with unit, if a sensor made the recording."""
    kept = source.get("infineon")
    known: dict[str, Any] = kept if isinstance(kept, dict) else {}
    sensor: Any = source.get("sensor")
    firmware = known.get("firmware_version")
    if isinstance(sensor, dict):
        sensor, firmware = sensor.get("name"), sensor.get("firmware")
    facts = {
        "sensor": sensor if sensor is None or firmware is None else f"{sensor}, firmware {firmware}",
        "date": source.get("date", known.get("date_captured")),
        "RX antennas": known.get("rx_antennas"),
        "IF gain [dB]": known.get("if_gain_dB"),
        "high-pass [Hz]": known.get("hp_cutoff_Hz"),
        "low-pass [Hz]": known.get("aaf_cutoff_Hz"),
        "transmit power level": known.get("tx_power_level"),
    }
    return {name: value for name, value in facts.items() if value is not None}
