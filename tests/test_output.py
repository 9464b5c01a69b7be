"""Writing never deletes or replaces other files: one table of everything that writes a file."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import radarcore as rc
from full_disk import largest_file
from radarcore import output

RADAR = rc.bgt60tr13c(num_chirps=8, num_samples=32)
SCENE = rc.Scene([rc.PointTarget([0.5, 0.0, 0.0], name="ball")])
PACKAGE = Path(rc.__file__).parent


@cache
def recording() -> rc.Recording:
    return rc.Simulator(SCENE, RADAR).record(0.0, 0.05, progress=False)


def sample() -> rc.dataset.Sample:
    Path("scene.toml").write_text('radar.preset = "bgt60tr13c"\n[[point]]\nposition = [2.0, 0.0, 0.0]\n')
    return rc.dataset.Variation.load("scene.toml").sample(0)


def view() -> rc.plot.LiveView:
    live = rc.plot.LiveView(RADAR)
    live.update(recording()[0])
    return live


def capture() -> rc.adapters.optitrack.MotionCapture:
    track = np.zeros((400, 3))
    ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (400, 1)), np.zeros(400))
    return rc.adapters.optitrack.MotionCapture(np.arange(400) * 0.01, {"ball": ball})


def bag(path: Path, **how: bool) -> None:
    with rc.adapters.ros.BagWriter(path, **how) as writer:
        writer.write("/text", {"data": "text" * 2000}, 0, type="std_msgs/msg/String")


def viewer(path: Path, **how: bool) -> None:
    with rc.adapters.rerun.Viewer(path, **how) as shown:
        shown.show_frame(recording()[0])


@cache
def compared() -> rc.comparison.Comparison:
    return rc.compare(recording(), progress=False)


class Writer(NamedTuple):
    """A file, its writer, the package that it needs, and whether a full disk is tested."""

    name: str
    write: Callable[..., object]
    needs: str = "numpy"
    is_whole: bool = True


WRITERS = (
    Writer("a.npz", lambda path, **how: recording().save(path, **how)),
    Writer("a.png", lambda path, **how: view().save(path, **how), "matplotlib"),
    Writer("b.png", lambda path, **how: rc.plot.overview(recording()[0], None, path, **how), "matplotlib"),
    Writer("a.svg", lambda path, **how: rc.plot.experiment(recording(), SCENE, path=path, **how), "matplotlib"),
    # matplotlib closes such a file in an order that hides the error
    Writer("a.pdf", lambda path, **how: compared().figure(path, **how), "matplotlib", is_whole=False),
    Writer("a.html", lambda path, **how: compared().report(path, **how), "matplotlib"),
    Writer("a.csv", lambda path, **how: rc.adapters.optitrack.write_motive_csv(path, capture(), **how)),
    Writer("a.toml", lambda path, **how: sample().save(path, **how), is_whole=False),
    Writer("a.mcap", bag, "rosbags"),
    Writer("a.db3", bag, "rosbags"),
    Writer("a.rrd", viewer, "rerun", is_whole=False),
)


@pytest.fixture(params=WRITERS, ids=[writer.name for writer in WRITERS])
def writer(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Writer:
    chosen: Writer = request.param
    pytest.importorskip(chosen.needs, reason=f"needs {chosen.needs}")
    (tmp_path / "work").mkdir()
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return chosen


def names(path: Path) -> list[str]:
    return sorted(place.name for place in path.iterdir())


@pytest.mark.filterwarnings("ignore:A. expected at least one track")
def test_file_is_replaced_only_on_request_by_its_own_kind_and_as_a_whole(writer: Writer, tmp_path: Path) -> None:
    path = tmp_path / "out" / writer.name
    path.write_text("mine")
    with pytest.raises(FileExistsError, match="overwrite=True replaces it"):
        writer.write(path, overwrite=False)
    assert path.read_text() == "mine"
    if path.suffix in output._STARTS:
        with pytest.raises(FileExistsError, match=f"got a file that is no {path.suffix} file"):
            writer.write(path, overwrite=True)
        assert path.read_text() == "mine"
        path.unlink()
        writer.write(path, overwrite=False)
    writer.write(path, overwrite=True)
    assert len(path.read_bytes()) > len("mine")
    assert names(path.parent) == [writer.name]

    # A folder of that name stays.
    (tmp_path / "out" / "folder" / writer.name).mkdir(parents=True)
    with pytest.raises(FileExistsError, match="got a directory"):
        writer.write(tmp_path / "out" / "folder" / writer.name, overwrite=True)

    # A full disk leaves the file that was there, and a bag as far as it got.
    if writer.is_whole:
        before = path.read_bytes()
        with largest_file(2000), pytest.raises(Exception, match=r"(?i)too large|full|disk I/O|can't|errno = 27"):
            writer.write(path, overwrite=True)
        assert path.read_bytes() == before
        assert set(names(path.parent)) - {"folder"} <= {writer.name, f"{writer.name}.part"}


def test_name_of_another_kind_is_refused(tmp_path: Path) -> None:
    for name in ("scene.toml", "take.mcap", "a.png"):
        with pytest.raises(ValueError, match=rf"expected a file name with \.h5, got one with {Path(name).suffix}"):
            output.check_file(tmp_path / name, overwrite=False, kind=".h5")
    output.check_file(tmp_path / "set.nc", overwrite=False, kind=".h5")
    output.check_file(tmp_path / "set.hdf5", overwrite=False, kind=".h5")


@pytest.mark.parametrize("name", ["m.mcap", "take.bag", "set.h5", "map.png", "scene.toml", "detections.csv", "a.JSON"])
def test_folder_does_not_get_the_name_of_a_file(tmp_path: Path, name: str) -> None:
    path, frames = tmp_path / name, recording()
    writers: tuple[Callable[[], object], ...] = (
        lambda: rc.RecordingWriter(path, RADAR),
        lambda: rc.Simulator(SCENE, RADAR).record(0.0, 0.05, path=path, progress=False),
        lambda: frames.save(path),
        lambda: output.make_folder(path),
    )
    for write in writers:
        with pytest.raises(ValueError, match=r"expected (the name of a folder, got the suffix|a directory or)"):
            write()
    assert names(tmp_path) == []


def test_link_stays_a_link_and_a_device_is_written_to(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    output.write_text(tmp_path / "link", "new", overwrite=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"
    output.write_text(Path(os.devnull), "nothing")


def test_second_of_two_writers_of_a_new_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file"
    second = output.new_file(path)
    second.__enter__().write_text("second")
    output.write_text(path, "first")
    with pytest.raises(FileExistsError, match="overwrite=True replaces it"):
        second.__exit__(None, None, None)
    assert path.read_text() == "first"
    assert names(tmp_path) == ["file"]


def test_linked_folder_and_files_of_others_stay(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / ".lock").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with output.PartFolder(tmp_path / "link") as part:
        (part.folder / "made").mkdir()
        (part.folder / "made" / "new").write_text("new")
        with output.Lock(tmp_path / "link"):
            part.put(part.folder / "made")
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path / "elsewhere") == [".lock", "new"]
    assert (tmp_path / "elsewhere" / ".lock").read_text() == "mine"
    assert names(tmp_path) == ["elsewhere", "link"]
    with output.PartFolder(tmp_path / "link") as part:
        (part.folder / "made").mkdir()
        (part.folder / "made" / "new").write_text("newer")
        part.put(part.folder / "made", ours=[tmp_path / "link" / "new"])
    assert (tmp_path / "link" / "new").read_text() == "newer"
    assert names(tmp_path / "elsewhere") == [".lock", "new"]


def test_protected_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_text("mine")
    path.chmod(0o444)
    monkeypatch.setattr(os, "access", lambda place, mode: bool(place.stat().st_mode & 0o200))  # root may write all
    with pytest.raises(PermissionError, match="expected a file that may be written, got a protected one"):
        output.write_text(path, "other", overwrite=True)
    assert path.read_text() == "mine"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a file system that takes no files")
@pytest.mark.parametrize("path", ["/proc/x", "/proc/x/y"])
def test_place_that_takes_no_files_is_named(path: str) -> None:
    for write in (lambda: output.write_text(Path(path), ""), lambda: rc.RecordingWriter(path, RADAR)):
        with pytest.raises(PermissionError, match="expected a folder in which files can be made, got one that is"):
            write()


def test_lock_ends_with_its_process(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path; from radarcore.output import Lock\n"
        "lock = Lock(Path(sys.argv[1])); print('mine', flush=True); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", program, tmp_path], env=environment, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "mine\n"
        with pytest.raises(BlockingIOError, match=f"process {other.pid}, which writes there now") as refused:
            output.Lock(tmp_path)
        assert refused.value.filename == str(tmp_path)
        other.kill()
    with output.Lock(tmp_path), pytest.raises(BlockingIOError, match=f"process {os.getpid()}"):
        output.Lock(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_only_one_writer_has_a_recording(tmp_path: Path) -> None:
    with rc.RecordingWriter(tmp_path / "rec", RADAR) as first:
        first.append(recording()[0])
        with pytest.raises(BlockingIOError, match=f"process {os.getpid()}, which writes there now"):
            rc.RecordingWriter(tmp_path / "rec", RADAR, overwrite=True)
        first.append(recording()[1])
    assert len(rc.Recording.load(tmp_path / "rec")) == 2
    truth = [f"truth_{name}.npy" for name in ("azimuth", "elevation", "range", "velocity")]
    assert names(tmp_path / "rec") == ["cube.npy", "meta.json", "time.npy", *truth]


DELETING = {"rmtree", "unlink", "rmdir", "removedirs", "rename", "symlink_to", "copyfile"}
WRITING = {"write_bytes", "savefig", "imsave", "savetxt", "tofile"}
ALLOWED = {
    "output.py": {*DELETING, "open"},
    "sensor/emulator/pty.py": {"unlink", "symlink_to"},  # its own link; another link if asked
    "recording/infineon.py": {"unlink", "rmdir", "open", "write_bytes"},  # into new files; folders that it has made
    "recording/native.py": {"open", "unlink"},  # into a new file; the files of a recording, under its lock
    "recording/npy.py": {"open", "write_bytes"},  # arrays of a recording, under its lock
    "dataset/sample.py": {"copyfile"},  # into a part
    "dataset/store.py": {"unlink"},  # files that zarr was writing when it was killed, under the dataset's lock
    "adapters/optitrack/csv.py": {"open"},  # into a new file
    "comparison/report.py": {"savefig"},  # into memory
    "plot/canvas.py": {"savefig"},  # into a new file
    "plot/live/view.py": {"savefig", "imsave"},  # into a new file
    "cli/process.py": {"open"},  # results, frame by frame, after `check_file`
    "sensor/transport/capture.py": {"open"},  # a file that `open_sensor` has made
}


def test_everything_that_writes_or_deletes_keeps_to_the_rule() -> None:
    """Each such call needs an entry here that says why it is safe, or uses `radarcore.output`."""
    found: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                modes = [arg.value for arg in node.args if isinstance(arg, ast.Constant) and isinstance(arg.value, str)]
                opens = name in ("open", "File") and any(set(m) & set("wax+") and len(m) <= 3 for m in modes)
                if opens or name in DELETING | WRITING:
                    found.setdefault(path.relative_to(PACKAGE).as_posix(), set()).add(name)
    unknown = {path: calls - ALLOWED.get(path, set()) for path, calls in found.items()}
    assert {path: calls for path, calls in unknown.items() if calls} == {}
