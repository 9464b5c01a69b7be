"""ROS bags: written messages come back, by a second reader too; truncated MCAP files up to the cut."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

from full_disk import largest_file
from radarcore.adapters.ros import cut_mcap
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader, Topic, is_bag, typed, typestore
from ros_bags import (
    ARRAY,
    EVERY_NS,
    FORMATS,
    NUM,
    POSE,
    START_NS,
    array_of,
    cut,
    file_of,
    read_cut,
    write_bag,
    write_ros1_bag,
)


@pytest.fixture(params=FORMATS)
def format(request: pytest.FixtureRequest) -> str:  # noqa: A001  # the argument's name
    name: str = request.param
    return name


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bags")
    whole = {kind: write_bag(folder / kind, kind) for kind in FORMATS}
    return whole | {"ros1": write_ros1_bag(folder / "take.bag")}


@pytest.fixture
def path(tmp_path: Path, format: str, bags: dict[str, Path]) -> Path:
    """A copy of a bag, to be damaged."""
    return copied(bags[format], tmp_path)


def copied(bag: Path, folder: Path) -> Path:
    copy = shutil.copytree if bag.is_dir() else shutil.copy
    return Path(copy(bag, folder / bag.name))


@contextmanager
def foreign_mcap(path: Path, **options: Any) -> Iterator[tuple[Any, Callable[..., int]]]:
    """MCAP file by another library: its writer, and a function that adds a topic of a type and definition."""
    writer = pytest.importorskip("mcap.writer", reason="needs mcap: pip install radarcore[ros]")
    with path.open("wb") as file:
        other = writer.Writer(file, **options)
        other.start(profile="ros2")

        def add(topic: str, kind: str, definition: str, encoding: str = "ros2msg", message: str = "cdr") -> int:
            schema = other.register_schema(kind, encoding, definition.encode())
            return int(other.register_channel(topic, message, schema))

        yield other, add
        other.finish()


# --- Round trip


@pytest.mark.parametrize("kind", [*FORMATS, "ros1"])
def test_messages_come_back_in_order_with_their_times(bags: dict[str, Path], kind: str) -> None:
    with BagReader(bags[kind]) as bag:
        assert bag.topics == {"/arm/pose": Topic("/arm/pose", POSE, NUM), "/array": Topic("/array", ARRAY, NUM)}
        assert bag.version == (1 if kind == "ros1" else 2)
        assert (bag.start_ns, bag.stop_ns) == (START_NS, START_NS + (NUM - 1) * EVERY_NS + 1)
        every = list(bag.messages())
        arrays, poses = ([m for m in every if m.topic == topic] for topic in ("/array", "/arm/pose"))
        assert [m.time_ns for m in arrays] == [START_NS + k * EVERY_NS for k in range(NUM)]
        assert all((m.message.data == k).all() and m.message.data.dtype == np.int16 for k, m in enumerate(arrays))
        assert [m.message.pose.position.x for m in poses] == list(range(NUM))
        stamps = [m.message.header.stamp for m in poses]
        assert [s.sec * 10**9 + s.nanosec for s in stamps] == [m.time_ns for m in poses]
        some = list(bag.messages("array", start_ns=START_NS + EVERY_NS, stop_ns=START_NS + 3 * EVERY_NS))
        assert [int(m.message.data[0]) for m in some] == [1, 2]


def test_closed_bags_have_no_messages(tmp_path: Path) -> None:
    with BagReader(write_bag(tmp_path / "bag", "mcap", 1)) as bag:
        assert len(list(bag.messages())) == 2
    with pytest.raises(ValueError, match="expected an open bag, got one that is closed"):
        bag.messages("/array")


def test_a_single_file_and_a_folder_without_metadata_are_bags_too(tmp_path: Path) -> None:
    for kind, suffix in (("mcap", ".mcap"), ("sqlite3", ".db3")):
        whole = write_bag(tmp_path / f"take{suffix}", kind, 5)
        assert whole.is_file()
        assert read_cut(whole) == (list(range(5)), [])
        folder = write_bag(tmp_path / kind, kind, 5)
        assert read_cut(file_of(folder)) == (list(range(5)), [])
        (folder / "metadata.yaml").unlink()
        found, warned = read_cut(folder)
        assert found == list(range(5))
        assert warned == [
            f"{folder}: a bag that is cut or damaged: a folder without metadata.yaml, its recorder was interrupted"
        ]
    assert {entry.name for entry in tmp_path.iterdir()} == {"take.mcap", "take.db3", "mcap", "sqlite3"}


def test_topics_of_other_encodings_are_left_out(tmp_path: Path) -> None:
    """Foxglove and others put JSON beside messages of ROS into an MCAP file."""
    store = typestore()
    data = bytes(store.serialize_cdr(typed(store, "std_msgs/msg/String", {"data": "x"}), "std_msgs/msg/String"))
    with foreign_mcap(tmp_path / "a.mcap") as (other, add):
        other.add_message(add("/json", "a", "{}", "jsonschema", "json"), 5, b"{}", 5)
        other.add_message(add("/text", "std_msgs/msg/String", "string data"), 5, data, 5)
    with BagReader(tmp_path / "a.mcap") as bag:
        assert bag.topics == {"/text": Topic("/text", "std_msgs/msg/String", 1)}
        assert [(m.time_ns, m.message.data) for m in bag.messages()] == [(5, "x")]


POINT_IDL = """\
IDL: {name}
module geometry_msgs {{ module msg {{ struct {kind} {{ double x; double y; double z; }}; }}; }};
"""


@pytest.mark.parametrize("is_cut", [False, True])
def test_definitions_in_idl_are_understood(tmp_path: Path, is_cut: bool) -> None:
    """Of one type, and of several with lines between them."""
    store, path = typestore(), tmp_path / "a.mcap"
    data = bytes(store.serialize_cdr(typed(store, POINT, {"x": 1.0, "y": 2.0, "z": 3.0}), POINT))
    one = POINT_IDL.format(name=POINT, kind="Point")
    line = "=" * 80 + "\n"
    several = f"{line}{one}{line}{POINT_IDL.format(name='geometry_msgs/msg/Other', kind='Other')}"
    with foreign_mcap(path) as (other, add):
        for number, text in enumerate((one.partition("\n")[2], several)):
            other.add_message(add(f"/{number}", POINT, text, "ros2idl"), 5, data, 5)
    if is_cut:
        path.write_bytes(path.read_bytes()[:-30])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with BagReader(path) as bag:
            points = [message.message for message in bag.messages(["/0", "/1"])]
    assert [(point.x, point.y, point.z) for point in points] == [(1.0, 2.0, 3.0)] * 2
    assert len(caught) == is_cut


def test_databases_without_definitions_are_read_by_those_of_ros(tmp_path: Path, bags: dict[str, Path]) -> None:
    """As those before ROS 2 Iron."""
    import apsw

    path = copied(bags["sqlite3"], tmp_path)
    database = apsw.Connection(str(file_of(path)))
    database.execute("DROP TABLE message_definitions; DROP TABLE schema; DROP TABLE metadata").fetchall()
    database.execute("ALTER TABLE topics DROP COLUMN type_description_hash").fetchall()
    database.close()
    assert read_cut(file_of(path)) == (list(range(NUM)), [])


POINT = "geometry_msgs/msg/Point"


def test_latched_topics_say_so(tmp_path: Path, format: str) -> None:
    path = tmp_path / "bag"
    with BagWriter(path, format) as bag:
        bag.add_topic("/settings", "std_msgs/msg/String", latched=True)
        bag.write("/settings", {"data": "x"}, 1)
    assert b"durability: transient_local" in file_of(path).read_bytes()


# --- Cut bags


@pytest.mark.parametrize("packed", [None, "LZ4", "ZSTD"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_cut_mcap_is_read_up_to_the_chunk_with_the_cut(tmp_path: Path, share: float, packed: str | None) -> None:
    kind = pytest.importorskip("mcap.writer").CompressionType[packed or "NONE"]
    store, path = typestore(), tmp_path / "a.mcap"
    sent = np.random.default_rng(0).integers(-(2**15), 2**15, (NUM, 600)).astype(np.int16)
    with foreign_mcap(path, chunk_size=12_000, compression=kind) as (other, add):  # chunks of some ten messages
        channel = add("/array", ARRAY, store.generate_msgdef(ARRAY, ros_version=2)[0])
        for k in range(NUM):
            message = typed(store, ARRAY, array_of(k) | {"data": sent[k]})
            other.add_message(channel, k, bytes(store.serialize_cdr(message, ARRAY)), k)
    cut(path, share)
    with pytest.warns(UserWarning, match="cut or damaged") as caught, BagReader(path) as bag:
        found = [m.message.data for m in bag.messages()]
    assert NUM * share - 15 < len(found) <= NUM * share + 1
    assert all((values == sent[k]).all() for k, values in enumerate(found))
    (warned,) = caught
    assert str(warned.message).startswith(f"{path}: a bag that is cut or damaged: ")
    assert str(warned.message).endswith(f"; {len(found)} messages are whole")


def test_an_mcap_without_its_index_is_whole(tmp_path: Path, bags: dict[str, Path]) -> None:
    """A recorder that was killed between two chunks."""
    file = file_of(copied(bags["mcap"], tmp_path))
    data = file.read_bytes()
    file.write_bytes(data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0")])  # before DataEnd
    found, warned = read_cut(file)
    assert found == list(range(NUM))
    assert len(warned) == 1


@pytest.mark.parametrize(
    ("kind", "command"),
    [("ros1", r"`rosbag reindex .*take\.bag`"), ("sqlite3", r"`sqlite3 .*\.db3 \.recover \| sqlite3")],
)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_other_cut_bags_are_refused_with_the_command_that_mends_them(
    tmp_path: Path, bags: dict[str, Path], kind: str, command: str, share: float
) -> None:
    path = cut(copied(bags[kind], tmp_path), share)
    with pytest.raises(ValueError, match=f"expected a whole bag, got a damaged one .*; {command}"):
        BagReader(path)


@pytest.mark.parametrize("kind", ["mcap", "mcap without index", "message"])
def test_small_bags_do_not_fill_the_memory(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """40 MB of zeros, packed into some kilobytes, are refused before they are unpacked."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    monkeypatch.setattr(cut_mcap, "MOST_UNPACKED", 1 << 22)
    bag = Writer(path := tmp_path / "small", version=9, storage_plugin=StoragePlugin.MCAP)
    mode = CompressionMode.MESSAGE if kind == "message" else CompressionMode.STORAGE
    bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection("/array", ARRAY, typestore=typestore())
        bag.write(connection, START_NS, bytes(40_000_000))
    if kind == "message":
        (path,) = path.glob("*.mcap")
    if kind == "mcap without index":
        (file,) = path.glob("*.mcap")
        path = tmp_path / "cut.mcap"
        path.write_bytes(file.read_bytes()[:-200])
    assert sum(file.stat().st_size for file in tmp_path.rglob("*.*") if file.is_file()) < 200_000
    tracemalloc.start()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with BagReader(path) as read:
                assert list(read.messages()) == []
        said = str(caught[-1].message)
    except ValueError as error:
        said = str(error)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "unpacks to more than 4194304" in said
    assert peak < 20e6


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_packed_files_and_messages_are_unpacked(tmp_path: Path, mode: str, plugin: str) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store, path = typestore(), tmp_path / "bag"
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        topic = writer.add_connection("/array", ARRAY, typestore=store)
        for k in range(5):
            writer.write(topic, k, store.serialize_cdr(typed(store, ARRAY, array_of(k)), ARRAY))
    assert read_cut(path) == (list(range(5)), [])
    if mode == "MESSAGE":
        (path / "metadata.yaml").unlink()
        assert read_cut(path)[0] == list(range(5))
        file = next(path.iterdir())
        file.write_bytes(file.read_bytes()[:-20])
        if plugin == "MCAP":
            found, warned = read_cut(path)
            assert found == list(range(5))
            assert len(warned) == 1


def test_a_database_with_a_log_of_changes_is_refused(tmp_path: Path) -> None:
    """As ROS 2 leaves it behind when its recorder is killed."""
    import apsw

    path = write_bag(tmp_path / "a.db3", "sqlite3", 5)
    database = apsw.Connection(str(path))
    database.execute("PRAGMA journal_mode=WAL").fetchall()
    database.execute("INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages")
    database.execute("SELECT 1").fetchall()
    copy = tmp_path / "copy.db3"
    for end in ("", "-wal"):
        copy.with_name(copy.name + end).write_bytes(path.with_name(path.name + end).read_bytes())
    database.close()
    with pytest.raises(ValueError, match=r"its writer left copy\.db3-wal\); `sqlite3 .*copy\.db3 \.recover"):
        BagReader(copy)


def test_a_killed_writer_loses_at_most_the_last_second_that_it_wrote(tmp_path: Path, format: str) -> None:
    """A message every 10 ms of a clock of the test; later writers leave the part to the user."""
    program = (
        "import os, sys; from types import SimpleNamespace; from ros_bags import *\n"
        "from radarcore.adapters.ros import bag_writer\n"
        "k, bag_writer.clock = 0, SimpleNamespace(monotonic=lambda: 0.01 * k)\n"
        "bag = BagWriter(sys.argv[1], sys.argv[2])\n"
        "for k in range(200):\n"
        "    bag.write('/array', array_of(k), k, type=ARRAY)\n"
        "os.kill(os.getpid(), 9)"
    )
    tests = str(Path(__file__).resolve().parents[1])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([tests, *sys.path])}
    path = tmp_path / "bag"
    subprocess.run([sys.executable, "-c", program, path, format], env=environment, check=False)
    part = path.with_name(f"{path.name}.part")
    assert list(tmp_path.iterdir()) == [part]
    found, warned = read_cut(part)
    assert found == list(range(len(found)))
    assert len(warned) == 1
    assert is_bag(part)
    assert 100 < len(found) < 200
    with pytest.raises(FileExistsError, match=r"killed writer of .* leaves; keep it by another name, or delete it"):
        BagWriter(path, format, overwrite=True)
    assert read_cut(part)[0] == found
    if format == "sqlite3":  # SQLite files have no end that could be missing
        from rosbags.rosbag2 import Reader

        with Reader(file_of(part / path.name)) as whole:
            assert whole.message_count == len(found)


def test_bag_on_a_full_disk_is_never_finished(tmp_path: Path, format: str) -> None:
    """Not even with free space again: a record would follow an incomplete one."""
    path = tmp_path / "bag"
    bag = BagWriter(path, format)
    bag.write("/array", array_of(0), 0, type=ARRAY)
    bag._flush()

    def fill() -> None:
        for k in range(1, 6000):
            bag.write("/array", array_of(k), k)

    with largest_file(100_000), pytest.raises(Exception, match=r"(?i)too large|full|disk I/O"):
        fill()
    for call in (lambda: bag.write("/array", array_of(0), 9000), bag.close):
        with pytest.raises(Exception, match=r"(?i)too large|full|disk I/O"):
            call()
    assert not path.exists()
    found, _ = read_cut(path.with_name(f"{path.name}.part"))
    assert found == list(range(len(found)))
    assert found


def test_only_one_writer_has_a_bag(tmp_path: Path, format: str) -> None:
    path = tmp_path / "bag"
    with BagWriter(path, format) as bag:
        bag.write("/array", array_of(0), 0, type=ARRAY)
        with pytest.raises(BlockingIOError, match=f"expected no other writer, got process {os.getpid()}, which writes"):
            BagWriter(path, format, overwrite=True)
        bag.write("/array", array_of(1), 1)
    assert read_cut(path) == ([0, 1], [])
    assert list(tmp_path.iterdir()) == [path]


def test_only_bags_of_radarcore_are_replaced_and_only_their_files(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "bag", "mcap", 3)
    (path / "notes.txt").write_text("mine")
    with BagWriter(path, "sqlite3", overwrite=True) as bag:
        bag.write("/array", array_of(7), 7, type=ARRAY)
    assert sorted(file.name for file in path.iterdir()) == ["bag.db3", "metadata.yaml", "notes.txt"]
    assert read_cut(path) == ([7], [])

    text = (path / "metadata.yaml").read_text()
    described = {
        "of others": text.replace("radarcore:", "recorder:"),
        "a file elsewhere": text.replace("- bag.db3", "- ../notes.txt"),
        "no metadata of a bag": "rosbag2_bagfile_information: 3",
        "no YAML": "{",
    }
    (tmp_path / "notes.txt").write_text("mine")
    for what, content in described.items():
        (path / "metadata.yaml").write_text(content)
        if what == "a file elsewhere":
            with BagWriter(tmp_path / "bag", overwrite=True):
                pass
            assert (tmp_path / "notes.txt").read_text() == "mine"
        else:
            with pytest.raises(FileExistsError, match="a bag that radarcore did not write; delete it, or choose"):
                BagWriter(path, overwrite=True)
    assert "bag.db3" in [file.name for file in path.iterdir()]


def test_an_error_finishes_the_bag(tmp_path: Path, format: str) -> None:
    path = tmp_path / "bag"
    with pytest.raises(ValueError, match="expected a known message"), BagWriter(path, format) as bag:  # noqa: PT012
        bag.write("/array", array_of(0), 0, type=ARRAY)
        bag.add_topic("/other", "nonsense")
    assert read_cut(path) == ([0], [])


# --- Bad input


def test_a_wrong_topic_names_those_that_there_are(path: Path) -> None:
    with BagReader(path) as bag:
        with pytest.raises(
            ValueError, match=r"topic: no topic '/arm/poze' in .*; did you mean '/arm/pose'\? "
        ) as error:
            bag.topic("/arm/poze")
        assert str(error.value).endswith(f"there are /arm/pose ({POSE}), /array ({ARRAY})")
        with pytest.raises(ValueError, match=r"topics: no topic '/x'"):
            bag.messages(["/array", "/x"])
        with pytest.raises(ValueError, match=f"--depth-topic: expected sensor_msgs/msg/Image, got {ARRAY} of '/array'"):
            bag.topic("/array", "sensor_msgs/msg/Image", argument="--depth-topic")
        with pytest.raises(
            ValueError, match=r"topic: expected a topic of sensor_msgs/msg/Image in .*, got none; there"
        ):
            bag.only_topic("sensor_msgs/msg/Image")


@pytest.mark.parametrize("seed", range(4))
def test_bytes_that_are_wrong_end_in_one_warning_or_one_line(bags: dict[str, Path], tmp_path: Path, seed: int) -> None:
    """Never in another error, without end, or in a message that its definition does not fit."""
    for kind, bag in bags.items():
        path = copied(bag, tmp_path)
        file = file_of(path)
        random = np.random.default_rng(seed)
        data = np.frombuffer(file.read_bytes(), np.uint8).copy()
        places = random.integers(0, len(data) if seed % 2 else 5000, 20)
        data[places] = random.integers(0, 256, 20)
        file.write_bytes(data.tobytes())
        refused = ""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                with BagReader(path) as read:
                    assert sum(1 for _ in read.messages()) <= 2 * NUM
            except ValueError as error:
                refused = str(error)
        assert refused.startswith(str(path)) or not refused, kind
        assert "\n" not in refused
        assert len(caught) <= 1
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def test_writer_refuses_what_it_cannot_write(tmp_path: Path) -> None:
    (tmp_path / "notes").mkdir()
    with pytest.raises(FileExistsError, match="a folder that is no bag"):
        BagWriter(tmp_path / "notes", overwrite=True)
    write_bag(tmp_path / "bag", "mcap", 1)
    with pytest.raises(FileExistsError, match="overwrite=True replaces it"):
        BagWriter(tmp_path / "bag")
    with pytest.raises(ValueError, match=r"path: expected \.db3 or a folder for the format 'sqlite3', got"):
        BagWriter(tmp_path / "take.mcap", "sqlite3")
    for name in ("take.bag", "take.mcap.gz", "take.MCAP"):
        with pytest.raises(ValueError, match=r"path: expected a bag \(\.mcap, \.db3\) or a folder"):
            BagWriter(tmp_path / name)
    with BagWriter(tmp_path / "2026.11.26"):
        pass
    assert (tmp_path / "2026.11.26").is_dir()
    with BagWriter(tmp_path / "bag", overwrite=True) as bag:
        with pytest.raises(ValueError, match=r"type: expected a known message, got 'std_msgs/msg/Strin'; did you mean"):
            bag.write("/a", {"data": "x"}, 0, type="std_msgs/msg/Strin")
        with pytest.raises(ValueError, match="std_msgs/msg/String: expected the field 'data', got none"):
            bag.write("/a", {}, 0, type="std_msgs/msg/String")
        with pytest.raises(ValueError, match=r"type: expected std_msgs/msg/String of the topic '/a', got std_msgs"):
            bag.write("/a", {"data": 1.0}, 0, type="std_msgs/msg/Float64")
        with pytest.raises(ValueError, match=r"Int16MultiArray.data: expected numbers of type int16, got 1 to 40000"):
            bag.write("/b", array_of(0) | {"data": [1, 40_000]}, 0, type=ARRAY)
        with pytest.raises(ValueError, match="time_ns: expected at least 0, got -1"):
            bag.write("/a", {"data": "x"}, -1)
    with pytest.raises(ValueError, match="expected an open bag, got one that is closed"):
        bag.write("/a", {"data": "x"}, 0)


def test_writer_that_is_interrupted_before_it_begins_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(self: BagWriter) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(BagWriter, "_opened", interrupted)
    with pytest.raises(KeyboardInterrupt):
        BagWriter(tmp_path / "take.mcap")
    assert list(tmp_path.iterdir()) == []
