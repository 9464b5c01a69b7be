"""The command `radarcore info`: content of a recording, a scene file, a bag or a mesh."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from radarcore.adapters.ros.bags import is_bag
from radarcore.cli import bag
from radarcore.cli.folder_info import folder_facts
from radarcore.cli.measured import measured_facts
from radarcore.cli.options import Json, Source
from radarcore.cli.source import NOT_BARE, BareSamples, load_recording, path_and_topic
from radarcore.cli.terminal import show, show_facts
from radarcore.dataset.tree import varies
from radarcore.dataset.variation import Parameter as Varying
from radarcore.dataset.variation import Variation
from radarcore.geometry.mesh_files import STEP_SUFFIXES, SUFFIXES, load_mesh
from radarcore.geometry.mesh_report import mesh_report
from radarcore.recording.bare import Description
from radarcore.recording.recording import RecordingReader, facts_of_frames, recordings_in
from radarcore.scene.body import Body
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.read import values_of
from radarcore.simulate.schedule import frame_times
from radarcore.units import line


def run(
    source: Source,
    /,
    *,
    scale: Annotated[float, Parameter(metavar="M")] = 1.0,
    as_json: Json = False,
    bare: BareSamples = NOT_BARE,
) -> None:
    """Print the content of a recording, a scene file, a bag or a mesh.

    Parameters
    ----------
    source : path
        recording, scene file (TOML), ROS bag, or mesh (OBJ, STL, PLY, ...)
    scale : float
        metres per unit of a mesh
    """
    if source.suffix.lower() in SUFFIXES + STEP_SUFFIXES:
        _show_mesh(source, scale, as_json)
        return
    facts = _facts(source, bare.description)
    if as_json:
        print(json.dumps(facts, indent=2))
    else:
        show_facts(_texts(facts), max(map(len, facts)))


def _texts(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Names and values as text; of topics and recordings an entry each."""
    for name, value in facts.items():
        if name == "varies":
            yield name, f"{len(value)} values of samples"
        if name in ("topics", "recordings", "varies"):
            yield from ((f"  {entry}", text) for entry, text in value.items())
        else:
            yield line(name, value)


def _facts(path: Path, config: Description) -> dict[str, Any]:
    if path.suffix == ".toml":
        return _scene_facts(path)
    if is_bag(path):
        return bag.facts(path)
    found = recordings_in(path)
    return folder_facts(path, found, config) if found else _recording_facts(path, config)


def _show_mesh(path: Path, scale: float, as_json: bool) -> None:
    report = mesh_report(load_mesh(path, scale=scale))
    if as_json:
        print(json.dumps({"mesh": str(path), **report.facts(), "verdicts": report.verdicts}, indent=2))
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
        "frames": len(frame_times(run.start, run.stop, run.rate)),
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


def _recording_facts(path: Path, config: Description) -> dict[str, Any]:
    """Content of a recording, by name with unit; samples of files are not read."""
    recording = load_recording(path) if path_and_topic(path)[1] else RecordingReader(path, **vars(config))
    cube = recording if isinstance(recording, RecordingReader) else recording.cube
    source = dict(recording.source)
    if isinstance(kept := source.get("infineon"), dict):  # the texts of its files are long
        source["infineon"] = {name: entry for name, entry in kept.items() if name != "texts"}
    return {
        "recording": str(path),
        **facts_of_frames(recording.time, cube.shape, cube.dtype, recording.truth, recording.radar),
        **measured_facts(recording.source),
        "lost frames": "not counted" if recording.lost is None else int(recording.lost.sum()),
        "source": source,
    }
