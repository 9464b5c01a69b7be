"""What goes wrong while a dataset is made: workers lost, disks full, schedulers away; and files that are damaged."""

from __future__ import annotations

import hashlib
import json
import os
import socket
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from deadly_work import Deadly
from full_disk import largest_file
from radarcore.cli.main import main
from radarcore.dataset import executors
from radarcore.dataset.shards import Done
from varied_scenes import digests, write_scene

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")

SETTINGS = {"count": 6, "seed": 1, "samples_per_shard": 2}


def test_shard_of_a_lost_worker_is_made_once_more(tmp_path: Path) -> None:
    made = executors.processes(Deadly(2, tmp_path / "marker"), range(5), 2, "shard {}".format)
    assert sorted(done.shard for done in made) == [0, 1, 2, 3, 4]


def test_shard_that_loses_its_worker_twice_is_named() -> None:
    with pytest.raises(ChildProcessError, match=r"shard 2: its worker was lost twice .*resume=True goes on"):
        list(executors.processes(Deadly(2), range(3), 1, "shard {}".format))


class Broken(Executor):
    """Executor that breaks at its second shard and stays so."""

    number = 0

    def submit(self, function: Callable[..., Any], /, *given: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        self.number += 1
        if self.number == 1:
            future.set_result(function(*given))
        else:
            future.set_exception(BrokenExecutor("a worker has ended"))
        return future


def test_broken_executor_is_an_error_that_names_the_shard_and_the_rest_can_be_resumed(tmp_path: Path) -> None:
    scene = write_scene(tmp_path)
    with pytest.raises(ChildProcessError, match=r"out: shard [12] \(samples [24] to [35]\): its worker was lost twice"):
        rc.dataset.make(scene, tmp_path / "out", **SETTINGS, executor=Broken())
    assert rc.dataset.open_dataset(tmp_path / "out").status.tolist() == [1, 1, 0, 0, 0, 0]
    rc.dataset.make(scene, tmp_path / "out", **SETTINGS, workers=1, resume=True)
    rc.dataset.make(scene, tmp_path / "whole", **SETTINGS, workers=1)
    assert digests(tmp_path / "out") == digests(tmp_path / "whole")


class Waiting(Broken):
    """Executor that does something before its first shard."""

    def __init__(self, first: Callable[[], None]) -> None:
        self._first = first

    def submit(self, function: Callable[..., Any], /, *given: Any) -> Future[Any]:
        self.number = 0 if self.number else self._first() or 0
        return super().submit(function, *given)


def test_only_one_process_makes_a_dataset(tmp_path: Path) -> None:
    """Other processes get an error that names the first, which makes or resumes the dataset."""
    scene, path = write_scene(tmp_path), tmp_path / "out"
    refused = []

    def others() -> None:
        for _ in range(2):
            with pytest.raises(BlockingIOError, match=rf"no other writer, got process {os.getpid()}.*{path}"):
                rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
            refused.append(path)

    for resume in (False, True):
        rc.dataset.make(scene, path, **SETTINGS, executor=Waiting(others), resume=resume)
        (path / "progress.jsonl").unlink()
    assert len(refused) == 4
    rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
    rc.dataset.make(scene, tmp_path / "whole", **SETTINGS, workers=1)
    assert digests(path) == digests(tmp_path / "whole")


def test_foreign_files_beside_and_within_a_dataset_stay(tmp_path: Path) -> None:
    scene, path = write_scene(tmp_path), tmp_path / "out"
    part = tmp_path / "out.part"
    part.mkdir()
    (part / "notes.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"killed writer of out leaves; keep it by another name, .*out\.part"):
        rc.dataset.make(scene, path, **SETTINGS, workers=1)
    assert (part / "notes.txt").read_text() == "mine"
    part.rename(tmp_path / "other")
    rc.dataset.make(scene, path, **SETTINGS, workers=1)
    (path / ".partial").mkdir()
    (path / ".partial" / "notes.txt").write_text("mine")
    rc.dataset.make(scene, path, **SETTINGS, workers=1, resume=True)
    assert (path / ".partial" / "notes.txt").read_text() == "mine"


def test_full_disk_names_the_file_and_what_is_complete_stays(tmp_path: Path) -> None:
    scene = write_scene(tmp_path)
    settings: dict[str, Any] = {**SETTINGS, "samples_per_shard": 4}  # the second shard has half as many samples
    rc.dataset.make(scene, tmp_path / "out", **settings, workers=1)
    expected = digests(tmp_path / "out")
    lines = (tmp_path / "out" / "progress.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "out" / "progress.jsonl").write_text(lines[1])
    with largest_file(20_000), pytest.raises(OSError, match="File too large") as caught:
        rc.dataset.make(scene, tmp_path / "out", **settings, workers=1, resume=True)
    assert caught.value.filename == str(tmp_path / "out" / "cube" / "c" / "0" / "0" / "0" / "0" / "0")
    assert not (tmp_path / "out" / ".partial").exists()
    assert rc.dataset.verify(tmp_path / "out").missing == 4
    rc.dataset.make(scene, tmp_path / "out", **settings, workers=1, resume=True)
    assert digests(tmp_path / "out") == expected


def test_scheduler_that_is_not_there_is_an_error_in_time(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="needs dask: pip install radarcore[dask]")
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{unused.getsockname()[1]}"
    began = time.monotonic()
    with pytest.raises(
        ConnectionError, match=rf"scheduler: expected one of dask at {address}, got no answer within 0.5"
    ):
        rc.dataset.make(write_scene(tmp_path), tmp_path / "out", **SETTINGS, scheduler=address, timeout=0.5)
    assert time.monotonic() - began < 5.0
    assert not (tmp_path / "out").exists()


def test_service_that_is_no_scheduler_is_told_from_one_that_is_silent(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="needs dask: pip install radarcore[dask]")
    scene = write_scene(tmp_path)

    def answer(service: socket.socket) -> None:
        connection, _ = service.accept()
        connection.sendall(4 * b"HTTP/1.1 400 Bad Request\r\n\r\n")
        connection.recv(1000)
        connection.close()

    with socket.create_server(("127.0.0.1", 0)) as service:
        address = f"tcp://127.0.0.1:{service.getsockname()[1]}"
        with pytest.raises(ConnectionError, match=rf"of dask at {address}, got no answer within 0\.3 s"):
            rc.dataset.make(scene, tmp_path / "out", **SETTINGS, scheduler=address, timeout=0.3)
    with socket.create_server(("127.0.0.1", 0)) as service:
        address = f"tcp://127.0.0.1:{service.getsockname()[1]}"
        Thread(target=answer, args=(service,), daemon=True).start()
        with pytest.raises(ConnectionError, match=rf"of dask at {address}, got the answer of something else"):
            rc.dataset.make(scene, tmp_path / "out", **SETTINGS, scheduler=address)
    with pytest.raises(ValueError, match=r"scheduler: expected an address as tcp://HOST:8786, got 'nowhere'"):
        rc.dataset.make(scene, tmp_path / "out", **SETTINGS, scheduler="nowhere")
    assert "Traceback" not in capfd.readouterr().err


def test_damage_is_found_and_named(tmp_path: Path) -> None:
    path = rc.dataset.make(write_scene(tmp_path), tmp_path / "out", **SETTINGS, workers=1).path
    found = rc.dataset.verify(path, again=2)
    assert (found.is_good, found.missing, found.again) == (True, 0, (0, 5))
    file = path / "cube" / "c" / "1" / "0" / "0" / "0" / "0"
    data = bytearray(file.read_bytes())
    data[100] ^= 1
    file.write_bytes(data)
    (fault,) = rc.dataset.verify(path).faults
    assert fault == f"{file}: expected the content that was written, got another checksum"
    (path / "time" / "c" / "2" / "0").unlink()
    assert len(rc.dataset.verify(path).faults) == 2
    # Whoever changes the sums as well is found by a simulation of the sample.
    journal = path / "progress.jsonl"
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    lines[1]["files"]["cube/c/1/0/0/0/0"][1] = hashlib.sha256(data).hexdigest()
    journal.write_text(json.dumps(lines[1]) + "\n")
    assert rc.dataset.verify(path).faults == ("sample 2: expected the same bits when simulated again, got others",)


@pytest.mark.parametrize(
    ("damage", "what"),
    [
        (lambda group: group.update(zarr_format=9), "damaged one"),
        (lambda group: group["attributes"].pop("seed"), "a damaged one without seed"),
        (lambda group: group["consolidated_metadata"]["metadata"].pop("status"), "a damaged one without status"),
        (lambda group: group["consolidated_metadata"]["metadata"]["cube"].pop("shape"), "damaged one"),
        (
            lambda group: group["consolidated_metadata"]["metadata"]["time"].pop("dimension_names"),
            "without axes of time",
        ),
    ],
)
def test_damaged_group_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: Callable[[Any], object], what: str
) -> None:
    scene, path = write_scene(tmp_path), tmp_path / "out"
    rc.dataset.make(scene, path, count=1, workers=1)
    group = json.loads((path / "zarr.json").read_text())
    damage(group)
    (path / "zarr.json").write_text(json.dumps(group))
    for words in (["info"], ["verify"], ["scene", "0"], ["export", "-o", "out.h5", "--format", "hdf5"]):
        assert main(["dataset", words[0], str(path), *words[1:]]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert f"{path}: expected a dataset, got " in line
        assert what in line
    assert main(["dataset", "make", str(scene), "-o", str(path), "--count", "1", "--resume"]) == 1
    assert what in capsys.readouterr().err


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


def test_distribution_out_of_range_names_sample_and_key(tmp_path: Path) -> None:
    scene = write_scene(tmp_path, "rcs = { uniform = [-1.0, 1.0] }")
    with pytest.raises(ValueError, match=r"point\.ball\.rcs: uniform may be -1"):
        rc.dataset.make(scene, tmp_path / "out", **SETTINGS, workers=1)
    assert np.all([not (tmp_path / name).exists() for name in ("out", "out.part")])


def test_worker_with_another_disk_is_an_error(tmp_path: Path) -> None:
    class Elsewhere(Executor):
        """Executor whose results are never seen here."""

        def submit(self, function: Callable[..., Any], /, *given: Any) -> Future[Any]:  # type: ignore[override]
            future: Future[Any] = Future()
            future.set_result(Done(int(given[0]), {"cube/c/0/0/0/0/0": (10, "")}))
            return future

    with pytest.raises(OSError, match="all workers must reach the same directory"):
        rc.dataset.make(write_scene(tmp_path), tmp_path / "out", **SETTINGS, executor=Elsewhere())
