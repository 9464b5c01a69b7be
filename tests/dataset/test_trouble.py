"""Trouble while a dataset is made: lost workers, full disks, two writers; and damaged files."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from full_disk import largest_file
from varied_scenes import Doing, digests, write_scene

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")

SETTINGS = {"count": 6, "seed": 1, "samples_per_shard": 2}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def whole(scene: Path) -> Path:
    return rc.dataset.make(scene, scene.parent / "whole", **SETTINGS, workers=1).path


def test_lost_process_is_an_error_that_says_how_to_go_on(scene: Path, whole: Path, tmp_path: Path) -> None:
    """A worker that is killed breaks the pool of processes."""
    script, path = tmp_path / "deadly.py", tmp_path / "out"
    script.write_text(DEADLY.replace("OUT", str(path)), encoding="utf-8")
    run = subprocess.run([sys.executable, str(script), str(scene)], capture_output=True, text=True)
    assert "a worker was lost (killed, or out of memory); complete shards stay; resume=True" in run.stderr
    assert set(rc.dataset.open_dataset(path).status.tolist()) <= {0, 1}
    rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
    assert digests(path) == digests(whole)


DEADLY = """
import os, signal, sys
import radarcore as rc


class Deadly(rc.dataset.Variation):
    def sample(self, index, *, seed=0):
        if index == 4 and __name__ != "__main__":
            os.kill(os.getpid(), signal.SIGKILL)
        return super().sample(index, seed=seed)

    def __reduce__(self):
        return Deadly, (self.path, self.parameters, self.body_names, self.run, self._tables)


if __name__ == "__main__":
    loaded = rc.dataset.Variation.load(sys.argv[1])
    deadly = Deadly(loaded.path, loaded.parameters, loaded.body_names, loaded.run, loaded._tables)
    rc.dataset.make(deadly, "OUT", count=6, seed=1, samples_per_shard=2, workers=2)
"""


def test_only_one_process_makes_a_dataset(scene: Path, whole: Path, tmp_path: Path) -> None:
    """Other processes get an error that names the first, which makes or resumes the dataset."""
    path = tmp_path / "out"

    def after_another(function: Callable[..., Any], *given: Any) -> Any:
        with pytest.raises(BlockingIOError, match=rf"no other writer, got process {os.getpid()}.*{path}"):
            rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
        return function(*given)

    for resume in (False, True):
        rc.dataset.make(scene, path, **SETTINGS, executor=Doing(after_another), resume=resume)
        assert digests(path) == digests(whole)
        shutil.rmtree(path / "status" / "c")


def test_foreign_files_beside_and_within_a_dataset_stay(scene: Path, tmp_path: Path) -> None:
    path = tmp_path / "out"
    part = tmp_path / "out.part"
    part.mkdir()
    (part / "notes.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"killed writer of out leaves; keep it by another name, .*out\.part"):
        rc.dataset.make(scene, path, **SETTINGS, workers=1)
    assert (part / "notes.txt").read_text() == "mine"
    part.rename(tmp_path / "other")
    rc.dataset.make(scene, path, **SETTINGS, workers=1)
    mine = path / "cube" / "c" / "mine.partial"
    mine.write_text("mine")
    rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
    assert mine.read_text() == "mine"


def test_full_disk_names_the_file_and_what_is_complete_stays(scene: Path, tmp_path: Path) -> None:
    settings: dict[str, Any] = {**SETTINGS, "samples_per_shard": 4}  # the second shard has half the samples
    rc.dataset.make(scene, tmp_path / "out", **settings, workers=1)
    expected = digests(tmp_path / "out")
    (tmp_path / "out" / "status" / "c" / "0").unlink()
    with largest_file(20_000), pytest.raises(OSError, match="File too large") as caught:
        rc.dataset.make(scene, tmp_path / "out", **settings, workers=1, resume=True)
    assert caught.value.filename == str(tmp_path / "out" / "cube" / "c" / "0" / "0" / "0" / "0" / "0")
    assert not list((tmp_path / "out").rglob("*.partial"))
    assert rc.dataset.verify(tmp_path / "out").missing == 4
    rc.dataset.make(scene, tmp_path / "out", **settings, workers=1, resume=True)
    assert digests(tmp_path / "out") == expected


@pytest.mark.parametrize("damage", ["bit", "cut", "gone"])
@pytest.mark.parametrize("file", ["cube/c/1/0/0/0/0", "time/c/1/0", "error/c/1", "status/c/1"])
def test_damage_of_any_file_is_found_and_named(whole: Path, tmp_path: Path, file: str, damage: str) -> None:
    path = Path(shutil.copytree(whole, tmp_path / "out"))
    data = bytearray((path / file).read_bytes())
    if damage == "gone":
        (path / file).unlink()
    else:
        data[len(data) // 2] ^= 1
        (path / file).write_bytes(data if damage == "bit" else data[: len(data) // 2])
    found = rc.dataset.verify(path, again=0)
    if (file, damage) == ("status/c/1", "gone"):
        assert (found.faults, found.missing) == ((), 2)
        return
    (fault,) = found.faults
    what = "a file, got none" if damage == "gone" else "the content that was written, got a damaged file"
    assert fault.startswith(f"{path / file}: expected {what}")


def test_damage_of_packed_codes_is_found(tmp_path: Path) -> None:
    """Zstandard alone unpacks codes of an ADC with a flipped bit to others."""
    adc = "radar.receiver = { output = 'real', noise_figure_db = 12.0, full_scale = 1e-3, adc_bits = 12 }"
    scene = write_scene(tmp_path)
    scene.write_text(f"{adc}\n{scene.read_text()}")
    path = rc.dataset.make(scene, tmp_path / "out", count=1, seed=1, workers=1).path
    file = path / "cube" / "c" / "0" / "0" / "0" / "0" / "0"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    (fault,) = rc.dataset.verify(path, again=0).faults
    assert fault.startswith(f"{file}: expected the content that was written, got a damaged file")


def test_samples_that_are_not_those_of_the_scene_are_found(whole: Path, tmp_path: Path) -> None:
    """Changed samples with a checksum of their own are found by a simulation of the sample."""
    import zarr

    path = Path(shutil.copytree(whole, tmp_path / "out"))
    found = rc.dataset.verify(path, again=2)
    assert (found.is_good, found.missing, found.again) == (True, 0, (0, 5))
    group = zarr.open_group(path, mode="r+")
    group["cube"][0] = 2.0 * group["cube"][0]
    assert rc.dataset.verify(path).faults == ("sample 0: expected the same bits when simulated again, got others",)
    group["cube"][5] = np.nan
    assert rc.dataset.verify(path, again=0).faults == ("sample 5: expected finite numbers in cube, got others",)


def metadata(group: Any) -> Any:
    return group["consolidated_metadata"]["metadata"]


@pytest.mark.parametrize(
    ("damage", "what"),
    [
        (lambda group: group.update(zarr_format=9), "damaged one"),
        (lambda group: group["attributes"].pop("seed"), "a damaged one without seed"),
        (lambda group: metadata(group).pop("status"), "a damaged one without status"),
        (lambda group: metadata(group)["cube"].pop("shape"), "damaged one"),
        (lambda group: metadata(group)["time"].pop("dimension_names"), "without axes of time"),
    ],
)
def test_damaged_group_is_one_line(
    scene: Path, whole: Path, tmp_path: Path, damage: Callable[[Any], object], what: str
) -> None:
    path = Path(shutil.copytree(whole, tmp_path / "out"))
    group = json.loads((path / "zarr.json").read_text())
    damage(group)
    (path / "zarr.json").write_text(json.dumps(group))
    resume = partial(rc.dataset.make, scene, **SETTINGS, workers=1, resume=True)
    for call in (rc.dataset.open_dataset, resume):
        with pytest.raises(ValueError, match=rf"^{path}: expected a dataset, got .*{what}") as error:
            call(path)
        assert "\n" not in str(error.value)


def test_names_that_would_share_a_column_are_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(
        'radar.preset = "bgt60tr13c"\n'
        + "".join(
            f'[[point]]\nname = "{name}"\nposition = [{{ uniform = [1.0, 2.0] }}, {y}, 0.0]\n'
            for y, name in enumerate(("a/b", "a_b"))
        )
    )
    message = r"differ in more than / and _, got 'point\.a/b\.position\[0\]' and 'point\.a_b\.position\[0\]'"
    with pytest.raises(ValueError, match=message):
        rc.dataset.make(tmp_path / "scene.toml", tmp_path / "out", count=1, workers=1)
    assert not (tmp_path / "out").exists()


def test_worker_with_another_disk_is_an_error(scene: Path, tmp_path: Path) -> None:
    elsewhere = Doing(lambda function, shard: (shard, ()))  # writes nothing here
    with pytest.raises(OSError, match="all workers must reach the same directory"):
        rc.dataset.make(scene, tmp_path / "out", **SETTINGS, executor=elsewhere)
