"""Datasets are equal to the bit whoever makes them: one process or many, threads, in any order, killed and resumed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from varied_scenes import Doing, digests, write_scene

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")

COUNT = 12
SETTINGS = {"count": COUNT, "seed": 3, "samples_per_shard": 2}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def serial(scene: Path) -> rc.dataset.Dataset:
    return rc.dataset.make(scene, scene.parent / "serial", **SETTINGS, workers=1)


class LastFirst(Executor):
    """Executor that does nothing until it must, and begins with what came last."""

    def __init__(self) -> None:
        self.calls: list[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = []

    def submit(self, function: Callable[..., Any], /, *given: Any) -> Future[Any]:  # type: ignore[override]
        self.calls.append((Future(), function, given))
        if len(self.calls) == COUNT // 2:
            for future, call, values in reversed(self.calls):
                future.set_result(call(*values))
        return self.calls[-1][0]


def test_frames_are_those_of_the_simulator_to_the_bit(serial: rc.dataset.Dataset) -> None:
    assert len(serial) == COUNT
    for index in (0, COUNT - 1):
        simulator = serial.variation.sample(index, seed=3).simulation().simulator()
        frames = [simulator.frame(time) for time in (0.0, 0.025)]
        np.testing.assert_array_equal(serial.cube(index), [frame.cube for frame in frames])
        np.testing.assert_array_equal(serial[index]["true_range"], [frame.truth.range for frame in frames])


def test_processes_threads_and_any_order_make_the_same_files(serial: rc.dataset.Dataset, scene: Path) -> None:
    rc.dataset.make(scene, scene.parent / "processes", **SETTINGS, workers=2)
    with ThreadPoolExecutor(2) as threads:
        rc.dataset.make(scene, scene.parent / "threads", **SETTINGS, executor=threads)
    rc.dataset.make(scene, scene.parent / "last first", **SETTINGS, executor=LastFirst())
    expected = digests(serial.path)
    assert len(expected) > 40
    for name in ("processes", "threads", "last first"):
        assert digests(scene.parent / name) == expected


def test_run_that_is_killed_at_any_write_is_open_and_resumes_to_the_same_files(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every chunk is written beside its place and renamed: the folder is kept as it is before each of these steps."""
    target, replace, left = tmp_path / "set", Path.replace, []

    def kept(self: Path, to: Path) -> Path:
        if self.name.endswith(".partial") and target.exists():
            left.append(Path(shutil.copytree(target, tmp_path / str(len(left)))))
        return replace(self, to)

    settings = {"count": 3, "seed": 3, "samples_per_shard": 2, "workers": 1}
    monkeypatch.setattr(Path, "replace", kept)
    expected = rc.dataset.make(scene, target, **settings)
    monkeypatch.undo()
    assert len(left) == 2 * len(expected.names), "a write for every variable of two shards"
    for folder in left:
        opened = rc.dataset.open_dataset(folder)
        for index in opened.made.tolist():
            for name, values in expected[index].items():
                np.testing.assert_array_equal(opened[index][name], values)
        assert rc.dataset.verify(folder, again=0).is_good
        rc.dataset.make(scene, folder, **settings, resume=True)
        assert digests(folder) == digests(expected.path)


SLOW = """
import sys
import radarcore as rc
rc.dataset.make(sys.argv[1], sys.argv[2], count=12, seed=3, samples_per_shard=2, workers=2)
"""


def test_run_that_is_killed_leaves_no_workers_and_resumes(serial: rc.dataset.Dataset, scene: Path) -> None:
    target = scene.parent / "killed"
    run = subprocess.Popen([sys.executable, "-c", SLOW, str(scene), str(target)])
    deadline = time.monotonic() + 120.0
    while not list(target.glob("status/c/*")) and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.001)
    children = children_of(run.pid)
    run.kill()
    run.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in children) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert time.monotonic() < deadline  # no worker is left behind
    # A shard's status is written last: shards with one are complete, and are kept.
    complete = [int(file.name) for file in target.glob("status/c/*") if file.name.isdecimal()]
    assert complete
    before = {file: file.stat().st_mtime_ns for shard in complete for file in files_of_shard(target, shard)}
    rc.dataset.make(scene, target, **SETTINGS, workers=1, resume=True)
    assert digests(target) == digests(serial.path)
    assert all(file.stat().st_mtime_ns == made for file, made in before.items())


def files_of_shard(target: Path, shard: int) -> list[Path]:
    found = [*target.glob(f"*/c/{shard}"), *target.glob(f"*/c/{shard}/**/*")]
    return [file for file in found if file.is_file()]


def children_of(pid: int) -> list[int]:
    """Processes that a process has started, where the system says so."""
    file = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(word) for word in file.read_text().split()] if file.is_file() else []


def test_shard_without_one_of_its_files_is_made_again(serial: rc.dataset.Dataset, scene: Path) -> None:
    target = Path(shutil.copytree(serial.path, scene.parent / "torn"))
    for file in ("cube/c/1/0/0/0/0", "time/c/2/0", "status/c/3"):
        (target / file).unlink()
    rc.dataset.make(scene, target, **SETTINGS, workers=1, resume=True)
    assert digests(target) == digests(serial.path)


def test_other_settings_on_resume_are_named(serial: rc.dataset.Dataset, scene: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"got count = 13, not 12; seed = 4, not 3; labels\.boxes = True, not False"):
        rc.dataset.make(
            scene, serial.path, count=13, seed=4, labels=rc.dataset.Labels(boxes=True), workers=1, resume=True
        )
    other = write_scene(tmp_path, "rcs = 2.0")
    with pytest.raises(ValueError, match=r"another scene \(line 9: 'rcs = 2\.0', not ''\)"):
        rc.dataset.make(other, serial.path, **SETTINGS, workers=1, resume=True)


@pytest.mark.parametrize("package", ["zarr", "scipy"])
def test_resume_with_another_version_of_a_library_names_both(tmp_path: Path, package: str) -> None:
    """Bytes of files depend on the version of zarr, normal draws on the version of scipy."""
    scene = write_scene(tmp_path, "rcs = { normal = [1.0, 0.1] }")
    path = rc.dataset.make(scene, tmp_path / "out", count=1, workers=1).path
    group = json.loads((path / "zarr.json").read_text())
    settings = json.loads(group["attributes"]["settings"])
    group["attributes"]["settings"] = json.dumps(settings | {package: "0.1"})
    (path / "zarr.json").write_text(json.dumps(group))
    with pytest.raises(ValueError, match=f"got {package} = '{version(package)}', not '0.1'"):
        rc.dataset.make(scene, path, count=1, workers=1, resume=True)


MESHES = """
[[body]]
name = "thing"
shape = { kind = "mesh", path = { choice = ["meshes/wedge.obj", "plate.obj"] }, scale = 1e-3 }
pose.position = [2.0, { uniform = [0.4, 0.5] }, 0.0]
"""


def with_meshes(folder: Path) -> Path:
    """Scene file that names one of two mesh files, which are in different folders."""
    (folder / "meshes").mkdir(parents=True)
    wedge = Path(__file__).parents[2] / "examples" / "wedge.obj"
    (folder / "meshes" / "wedge.obj").write_bytes(wedge.read_bytes())
    (folder / "plate.obj").write_text("v 0 -200 -200\nv 0 200 -200\nv 0 200 200\nv 0 -200 200\nf 4 3 2 1\n")
    return write_scene(folder, MESHES)


def test_moved_dataset_has_the_files_of_its_scene(tmp_path: Path) -> None:
    scene = with_meshes(tmp_path / "scene")
    rc.dataset.make(scene, tmp_path / "out", **SETTINGS, workers=1)
    assert len({*rc.dataset.open_dataset(tmp_path / "out").values("parameter.body.thing.shape.path")}) == 2
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "out").rename(tmp_path / "elsewhere" / "set")
    scene.parent.rename(tmp_path / "gone")
    found = rc.dataset.verify(moved, again=COUNT)
    assert (found.faults, found.again) == ((), tuple(range(COUNT)))
    dataset = rc.dataset.open_dataset(moved)
    dataset.sample(2).save(tmp_path / "two.toml")
    np.testing.assert_array_equal(rc.load_scene(tmp_path / "two.toml").record(progress=False).cube, dataset.cube(2))
    rc.dataset.make(tmp_path / "gone" / "scene.toml", moved, **SETTINGS, workers=1, resume=True)


def test_dataset_keeps_a_mesh_that_has_changed_and_refuses_to_go_on_with_another(tmp_path: Path) -> None:
    scene, settings = with_meshes(tmp_path), {**SETTINGS, "count": 4}
    rc.dataset.make(scene, tmp_path / "out", **settings, workers=1)
    plate = tmp_path / "plate.obj"
    plate.write_text(plate.read_text().replace("200", "100"))
    with pytest.raises(ValueError, match=r"begun with, got another file plate\.obj$"):
        rc.dataset.make(scene, tmp_path / "out", **settings, workers=1, resume=True)
    assert rc.dataset.verify(tmp_path / "out", again=4).faults == ()


TOO_NEAR = "[[body]]\nshape = { kind = 'plate', width = 0.5, height = 0.5 }\npose.position = "


def test_sample_that_fails_is_recorded_with_its_seed_and_the_run_goes_on(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, TOO_NEAR + "[{ uniform = [-0.002, 0.002] }, 0.0, 0.0]")
    dataset = rc.dataset.make(scene, tmp_path / "out", count=6, seed=1, workers=1)
    (name,) = (name for name in dataset.names if name.startswith("parameter.body."))
    is_near = np.abs(dataset.values(name)) < 0.001
    assert 0 < is_near.sum() < 6
    assert dataset.status.tolist() == np.where(is_near, 2, 1).tolist()
    assert [failed.sample for failed in dataset.failed] == np.flatnonzero(is_near).tolist()
    first = dataset.failed[0]
    assert first.seed == 1
    assert first.error.startswith("ValueError: ")
    assert np.isnan(dataset.cube(first.sample)).all()
    assert len(list(dataset)) == 6 - is_near.sum()
    assert rc.dataset.verify(dataset.path).is_good


def test_error_of_all_samples_is_raised_and_nothing_is_made(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="mm"):
        rc.dataset.make(write_scene(tmp_path, TOO_NEAR + "[0.0005, 0.0, 0.0]"), tmp_path / "out", count=2, workers=1)
    assert not (tmp_path / "out").exists()


def test_interrupted_run_leaves_what_is_complete(scene: Path, tmp_path: Path) -> None:
    def interrupted(function: Callable[..., Any], shard: int) -> Any:
        if shard == 3:
            raise KeyboardInterrupt
        return function(shard)

    with pytest.raises(KeyboardInterrupt):
        rc.dataset.make(scene, tmp_path / "out", **SETTINGS, executor=Doing(interrupted))
    dataset = rc.dataset.open_dataset(tmp_path / "out")
    assert not list((tmp_path / "out").rglob("*.partial"))
    found = rc.dataset.verify(tmp_path / "out")
    assert found.is_good
    assert 2 <= found.missing < COUNT
    assert len(list(dataset)) >= COUNT - found.missing
