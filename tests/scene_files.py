"""Scene files to write and load, and the one line that names a fault."""

from pathlib import Path

import pytest

import radarcore as rc

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.toml"))

RADAR = """
[radar]
start_frequency = 60e9
stop_frequency = 61e9
sample_rate = 2e6
num_samples = 64
"""

APPROACHING = """
[radar]
preset = "bgt60tr13c"
stop_frequency = 60e9
num_chirps = 8

[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
pose = { position = [1.5, 0.0, 0.0] }
motion = { kind = "linear", velocity = [-0.5, 0.0, 0.0] }

[run]
stop = 0.3
rate = 10.0
resolution = 48
"""
"""A ball that approaches a BGT60TR13C: three frames."""

BALL = '[[body]]\nname = "ball"\nshape = { kind = "sphere", radius = 0.1 }\npose = { position = [2.0, 0.0, 0.0] }\n'
PARTS = "v 0 0 0\nv 0 1 0\nv 0 0 1\nv 0 1 1\nf 1 2 3\nusemtl steel\nf 2 4 3\nusemtl glass\nf 1 3 2\nf 2 3 4\n"
"""Text of an OBJ file with triangles of no material, of steel and of glass."""


def write(directory: Path, text: str, radar: str = RADAR) -> Path:
    """A scene file with a radar and `text`."""
    path = directory / "scene.toml"
    path.write_text(radar + text, encoding="utf-8")
    return path


def load(directory: Path, text: str, radar: str = RADAR) -> rc.Simulation:
    return rc.load_scene(write(directory, text, radar))


def pose_of(simulation: rc.Simulation, name: str, time: float = 0.0) -> rc.Pose:
    body = simulation.scene.bodies[simulation.scene.names.index(name)]
    assert isinstance(body, rc.Body)
    return body.motion.at(time)


def shaped(shape: str) -> str:
    """A body of some shape, 2 m away."""
    return f'[[body]]\nname = "a"\nshape = {shape}\npose = {{ position = [2, 0, 0] }}\n'


def check_fault(path: Path, message: str) -> None:
    """Fail unless the file is refused in one line that begins with its name and `message`."""
    with pytest.raises(ValueError, match=r".") as caught:
        rc.load_scene(path)
    line = str(caught.value)
    # A message that ends in a word, number or quote is the whole line; others are its beginning.
    assert line.startswith(f"{path}: {message}")
    assert "\n" not in line
