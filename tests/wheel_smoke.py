"""Checks of an installed wheel, run by `make wheel-check` with nothing but the required packages around it."""

import contextlib
import importlib.metadata
import io
import sys
from pathlib import Path

import radarcore

# The installed package is meant, not the source tree.
source = Path(__file__).resolve().parents[1] / "python"
assert source not in Path(radarcore.__file__).resolve().parents, radarcore.__file__

assert radarcore.__version__ == importlib.metadata.version("radarcore"), radarcore.__version__

# Importing radarcore imports numpy and nothing else heavy, installed or not.
heavy = {"scipy", "pydantic", "matplotlib", "tqdm", "trimesh", "usb", "cyclopts", "rich"} & set(sys.modules)
assert not heavy, f"import radarcore also imports {sorted(heavy)}"

# Scene files and commands need nothing else.
from radarcore.scenefile import schema  # noqa: E402  # after the check of what is imported

assert "body[].shape.radius" in schema.text()

from radarcore.cli.main import COMMANDS, main  # noqa: E402

for command in COMMANDS:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main([*command.words.split(), "--help"]) == 0, command
    assert printed.getvalue().startswith(f"Usage: radarcore {command.words}"), command

# The main job runs: a mesh in, samples and a peak out.
sphere = radarcore.Body(radarcore.shapes.sphere(0.1), motion=radarcore.Pose([2.0, 0.0, 0.0]))
frame = radarcore.Simulator(radarcore.Scene([sphere]), radarcore.bgt60tr13c(stop_frequency=59e9)).frame()
peak = radarcore.strongest_peak(frame.cube, frame.radar.waveform, min_range=1.0)
assert abs(peak.range - 1.9) < 0.5 * frame.radar.waveform.range_resolution, peak
