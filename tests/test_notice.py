"""Warnings point at the user's line, however deep in the package they arise."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

import radarcore as rc

FAR = rc.Scene([rc.PointTarget([50.0, 0.0, 0.0])])
FILE = """
[radar]
preset = "bgt60tr13c"

[run]
stop = 0.1

[[point]]
position = [50.0, 0.0, 0.0]
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(FILE)
    return path


@pytest.mark.parametrize(
    "run",
    [
        lambda _: rc.Simulator(FAR, rc.bgt60tr13c()).frame(0.0),
        lambda _: rc.Simulator(FAR, rc.bgt60tr13c()).record(0.0, 0.1, 10.0),
        lambda path: rc.load_scene(path).simulator().frame(0.0),
        lambda path: rc.load_scene(path).record(),
    ],
    ids=["frame", "record", "frame of a file", "record of a file"],
)
def test_warning_has_the_line_of_the_call(run: Callable[[Path], object], scene_file: Path) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(scene_file)
    assert [warning.filename for warning in caught] == [__file__] * len(caught)
    assert any("beyond max_unambiguous_range" in str(warning.message) for warning in caught)
