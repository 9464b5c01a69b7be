"""The command `radarcore info`: content of a recording, a scene file, a bag or a mesh."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from radarcore.adapters.ros.bags import is_bag
from radarcore.cli import bag
from radarcore.cli.folder_info import folder_facts
from radarcore.cli.measured import measured_facts
from radarcore.cli.source import load_recording, path_and_topic
from radarcore.geometry.files import SUFFIXES, load_mesh
from radarcore.geometry.report import mesh_report
from radarcore.radar.radar import Radar
from radarcore.recording.description import Description
from radarcore.recording.folders import recordings_in
from radarcore.recording.reader import RecordingReader
from radarcore.scene.body import Body
from radarcore.scenefile.load import load_scene
from radarcore.simulate.times import frame_times
from radarcore.units import UNITS, quantity


def run(options: argparse.Namespace) -> int:
    """Print the content of a recording, a scene file, a bag or a mesh."""
    if options.source.suffix.lower() in SUFFIXES:
        return _mesh_info(options)
    facts = _facts(options.source, options.config)
    if options.json:
        print(json.dumps(facts, indent=2))
    else:
        width = max(map(len, facts))
        for name, value in facts.items():
            if name in ("topics", "recordings"):
                print("\n".join(f"  {entry}  {text}" for entry, text in value.items()))
            else:
                label, text = _in_units(name, value)
                print(f"{label:<{width}}  {text}")
    return 0


def _facts(path: Path, config: Description) -> dict[str, Any]:
    if path.suffix == ".toml":
        return _scene_facts(path)
    if is_bag(path):
        return bag.facts(path)
    found = recordings_in(path)
    return folder_facts(path, found, config) if found else _recording_facts(path, config)


def _mesh_info(options: argparse.Namespace) -> int:
    report = mesh_report(load_mesh(options.source, scale=options.scale))
    if options.json:
        print(json.dumps({"mesh": str(options.source), **report.facts(), "verdicts": report.verdicts}, indent=2))
    else:
        print(report)
    return 0


def _scene_facts(path: Path) -> dict[str, Any]:
    """Content of a scene file, by name with unit."""
    simulation = load_scene(path)
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
        **_radar_facts(simulation.radar),
    }


def _recording_facts(path: Path, config: Description) -> dict[str, Any]:
    """Content of a recording, by name with unit; samples of files are not read."""
    recording = load_recording(path) if path_and_topic(path)[1] else RecordingReader(path, **vars(config))
    cube = recording if isinstance(recording, RecordingReader) else recording.cube
    source = dict(recording.source)
    if isinstance(kept := source.get("infineon"), dict):  # the texts of its files are long
        source["infineon"] = {name: entry for name, entry in kept.items() if name != "texts"}
    return {
        "recording": str(path),
        "frames": len(recording),
        "start [s]": float(recording.time[0]) if len(recording) else None,
        "last frame [s]": float(recording.time[-1]) if len(recording) else None,
        "cube [frame, channel, chirp, sample]": list(cube.shape),
        "dtype": str(cube.dtype),
        "bodies": None if recording.truth is None else list(recording.truth.names),
        **_radar_facts(recording.radar),
        **measured_facts(recording.source),
        "lost frames": "not counted" if recording.lost is None else int(recording.lost.sum()),
        "source": source,
    }


def _radar_facts(radar: Radar) -> dict[str, Any]:
    """Parameters and resolutions of a radar, by name with unit."""
    wf = radar.waveform
    return {
        "transmitters": len(radar.tx),
        "receivers": len(radar.rx),
        **_pattern_facts(radar),
        "samples": "real" if radar.is_real else "I/Q",
        "start frequency [Hz]": wf.start_frequency,
        "slope [Hz/s]": wf.slope,
        "bandwidth [Hz]": wf.bandwidth,
        "sample rate [Hz]": wf.sample_rate,
        "samples per chirp": wf.num_samples,
        "chirps per frame": radar.num_chirps,
        "chirp interval [s]": wf.chirp_interval,
        "frame interval [s]": wf.frame_interval,
        "range bin [m]": None if wf.is_cw else wf.range_resolution,
        "largest range [m]": None if wf.is_cw else radar.max_range,
        "velocity bin [m/s]": wf.velocity_resolution,
        "largest velocity [m/s]": radar.max_velocity,
        **({} if radar.schedule is None else {"schedule": radar.schedule.kind}),
        **({"sub-sequences": len(radar.waveforms)} if radar.more_waveforms else {}),
    }


def _pattern_facts(radar: Radar) -> dict[str, str]:
    """The pattern of all antennas, or those of one after the other."""
    every = [("transmitter", radar.tx_patterns), ("receiver", radar.rx_patterns)]
    facts = {f"pattern of {kind} {i}": str(p) for kind, patterns in every for i, p in enumerate(patterns)}
    return facts if len(set(facts.values())) > 1 else {"antenna pattern": str(radar.tx_patterns[0])}


def _in_units(name: str, value: Any) -> tuple[str, str]:
    """Name and text of a fact: numbers in the units in which people write them."""
    label, _, unit = name.removesuffix("]").rpartition(" [")
    if isinstance(value, int | float) and unit in (*UNITS, "dB"):
        return label, quantity(value, unit, 6)
    return name, _fact_text(value)


def _fact_text(value: Any) -> str:
    if value is None or value == []:
        return "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return json.dumps(value) if isinstance(value, dict) else str(value)
