"""The commands `radarcore dataset`."""

from __future__ import annotations

import json
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli.main import main
from varied_scenes import write_scene

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")


def make(folder: Path, *options: str) -> int:
    scene, count = str(folder / "scene.toml"), ["--count", "3", "--seed", "1", "--workers", "1"]
    return main(["dataset", "make", scene, "-o", str(folder / "out"), *count, *options])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("command")
    write_scene(folder)
    assert make(folder, "--labels", "truth,boxes,visibility") == 0
    return folder


def test_make_resume_and_what_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert make(folder, "--labels", "truth,boxes,visibility", "--resume", "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["samples"], result["frames"], result["failed"]) == (3, 6, 0)
    assert make(folder, "--labels", "truth,boxes,visibility") == 1
    assert "out: expected no such path, got a dataset; --resume continues it\n" in capsys.readouterr().err
    assert make(folder, "--resume") == 1
    assert "got labels.boxes = False, not True; labels.visibility = False, not True" in capsys.readouterr().err
    assert make(folder, "--resume", "--labels", "truth,boxs") == 1
    assert "--labels: expected truth, boxes, visibility, joints, cells or none, got 'boxs'" in capsys.readouterr().err


def test_verify_and_info(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dataset", "verify", str(folder / "out"), "--again", "2"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("3 of 3 samples, 0 failed\n")
    assert text.endswith("".join(f"sample {number} simulated again: the same to the bit\n" for number in (0, 2)))
    assert main(["info", str(folder / "out")]) == 0
    assert "bodies     ball\n" in capsys.readouterr().out
    assert main(["info", str(folder / "out"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["samples"] == {"missing": 0, "made": 3, "failed": 0}
    assert facts["variables"]["box_size"] == "m"
    assert main(["dataset", "verify", str(folder)]) == 1
    assert capsys.readouterr().err == f"radarcore: {folder}: expected a dataset, got a folder without one\n"


def test_damage_gives_exit_status_1(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_scene(tmp_path)
    assert make(tmp_path) == 0
    (tmp_path / "out" / "time" / "c" / "0" / "0").write_bytes(b"0123456789abcdef")
    assert main(["dataset", "verify", str(tmp_path / "out")]) == 1
    assert "fault: " in capsys.readouterr().out


def test_scene_of_a_sample_gives_its_frames(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dataset", "scene", str(folder / "out"), "2"]) == 0
    (tmp_path / "two.toml").write_text(capsys.readouterr().out)
    dataset = rc.dataset.open_dataset(folder / "out")
    np.testing.assert_array_equal(rc.load_scene(tmp_path / "two.toml").record(progress=False).cube, dataset.cube(2))
    assert main(["dataset", "scene", str(folder / "out"), "3"]) == 1
    assert "INDEX: expected an index below 3, got 3" in capsys.readouterr().err


def test_failed_samples_are_told_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plate = "[[body]]\nshape = { kind = 'plate', width = 0.5, height = 0.5 }\npose.position = "
    write_scene(tmp_path, plate + "[{ uniform = [-0.002, 0.002] }, 0.0, 0.0]")
    arguments = ["dataset", "make", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out"), "--count", "12"]
    assert main([*arguments, "--workers", "1"]) == 0
    printed = capsys.readouterr()
    dataset = rc.dataset.open_dataset(tmp_path / "out")
    assert len(dataset.failed) > 3
    assert printed.err.count("of seed 1 failed: ValueError: ") == 3
    assert f"{len(dataset.failed) - 3} more failed" in printed.err
    assert f"{len(dataset.failed)} failed; " in printed.out


def test_lost_worker_is_told_with_the_option_that_goes_on(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = ChildProcessError("a worker was lost; resume=True continues with the rest")
    monkeypatch.setattr("radarcore.cli.dataset.verify", MagicMock(side_effect=lost))
    assert main(["dataset", "verify", str(folder / "out")]) == 1
    assert "--resume continues with the rest" in capsys.readouterr().err
