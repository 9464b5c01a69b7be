"""A scene file and its recording, which most tests of the commands take."""

from __future__ import annotations

from pathlib import Path

import pytest

import radarcore as rc
from scene_files import APPROACHING


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Scene of a ball that comes closer."""
    path = tmp_path / "scene.toml"
    path.write_text(APPROACHING)
    return path


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of that scene: three frames."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "scene.toml").write_text(APPROACHING)
    rc.load_scene(folder / "scene.toml").record(folder / "rec", progress=False)
    return folder / "rec"
