"""ROS bags read: ROS 1, and the SQLite and MCAP files of ROS 2; MCAP also up to where it is cut.

Needs rosbags and mcap: ``pip install radarcore[ros]``; ROS itself is not needed.
"""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import cache, lru_cache
from heapq import merge
from importlib.util import find_spec
from io import BufferedReader, FileIO
from itertools import groupby
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from radarcore import check, notice
from radarcore.adapters.ros.cut_mcap import CutMcap, check_unpacked, reason, unpacked
from radarcore.adapters.ros.messages import DEFINITIONS
from radarcore.output import LOCK
from radarcore.recording import infineon


def need_rosbags() -> None:
    """Raise an ImportError that names the extra, unless rosbags is installed."""
    if find_spec("rosbags") is None:
        raise ImportError("ROS bags need rosbags: pip install radarcore[ros]")


@cache
def typestore() -> Any:
    """Message types of ROS 2 (Humble) and of `DEFINITIONS`."""
    need_rosbags()
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name in DEFINITIONS.keys() - store.types.keys():
        types |= get_types_from_msg(DEFINITIONS[name], name)
    store.register(types)
    return store


def typed(store: Any, name: str, source: Any) -> Any:
    """A message of the type `name` with the fields of `source`: a mapping, or an object with attributes.

    Raises
    ------
    ValueError
        For a type that is not known, and a field that is missing.
    """
    if name not in store.fielddefs:
        raise ValueError(f"type: expected a known message, got {name!r}")
    kinds = dict(store.fielddefs[name][1])
    if not isinstance(source, Mapping):
        source = {field: getattr(source, field) for field in kinds if hasattr(source, field)}
    given = {"structure_needs_at_least_one_member": 0, **source}  # of messages without fields
    if missing := [field for field in kinds if field not in given]:
        raise ValueError(f"{name}: expected the field {missing[0]!r}, got none")
    values = {field: _value(store, kind, given[field], f"{name}.{field}") for field, kind in kinds.items()}
    return store.types[name](**values)


def _value(store: Any, description: Any, value: Any, where: str) -> Any:
    """A field as rosbags takes it: numbers in arrays, messages in lists."""
    kind, details = description
    if kind.name == "BASE":
        return str(value) if details[0] in _TEXTS else value
    if kind.name == "NAME":
        return typed(store, details, value)
    inner, _ = details
    if inner[0].name == "NAME" or inner[1][0] in _TEXTS:
        return [_value(store, inner, entry, where) for entry in value]
    dtype = {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0])
    array = np.frombuffer(value, np.uint8) if isinstance(value, bytes | bytearray | memoryview) else np.asarray(value)
    if array.dtype.kind == "f" and np.dtype(dtype).kind != "f":
        raise ValueError(f"{where}: expected numbers of type {dtype}, got {array.dtype}")
    numbers = array.astype(dtype, copy=False).reshape(-1)
    if array.dtype.kind in "iu" and not np.array_equal(numbers, array.reshape(-1)):
        raise ValueError(f"{where}: expected numbers of type {dtype}, got {array.min()} to {array.max()}")
    return numbers


_TEXTS = ("string", "wstring")

_SUFFIXES = (".mcap", ".db3", ".bag")
"""Of the files in a folder; the first that there are count."""

_MOST_NAMES = 30
"""Topics that a message names."""

_LONG = 1 << 20
"""Reads of more bytes than this are compared with the size of the file."""

_MAGICS = {"mcap": b"\x89MCAP0\r\n", "ros1": b"#ROSBAG V2.0\n", "sqlite3": b"SQLite format 3\0"}
"""First bytes of the formats."""

_REMEDIES = {
    "ros1": "; `rosbag reindex {file}` makes its index anew",
    "sqlite3": "; `sqlite3 {file} .recover | sqlite3 whole.db3` saves what is readable",
}
"""Commands that mend a file of a format."""

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""Start of a message that is packed; others of ROS 2 start with zero (CDR)."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes
    ----------
    name : str
    type : str
        As ROS 2 writes it: ``sensor_msgs/msg/Image``.
    num_messages : int
    """

    name: str
    type: str
    num_messages: int


@dataclass(frozen=True, eq=False)
class BagMessage:
    """A message of a bag.

    Attributes
    ----------
    topic, type : str
    time_ns : int
        Time at which it was recorded [ns since 1970].
    message : object
        With the fields of its type as attributes.
    """

    topic: str
    type: str
    time_ns: int
    message: Any


class BagReader:
    """A ROS bag: its topics, and its messages in the order of their times.

    Messages are read on access, so bags may be larger than memory. An MCAP file that is cut, because its
    recorder was killed or its copy is not complete, is read up to the chunk with the cut, with one warning. Cut files
    of the other formats raise an error with the command that mends them.

    Parameters
    ----------
    path : path
        A ROS 1 bag (``.bag``); a folder of ROS 2 with its files; or a single ``.mcap`` or ``.db3`` file.

    Attributes
    ----------
    path : Path
    version : int
        1 or 2, of ROS.
    topics : dict of str to Topic
        By name.
    start_ns, stop_ns : int
        Times of the first message and after the last one [ns since 1970]; both zero in an empty bag.

    Raises
    ------
    FileNotFoundError
        When there is nothing at `path`.
    ImportError
        When rosbags is missing.
    ValueError
        When it is not a bag, or one of ROS 1 or SQLite that is cut.

    See Also
    --------
    adapters.ros.BagWriter : Writes one.
    adapters.ros.BagMotions : Motions of its bodies.
    adapters.ros.DepthImages : Its depth images.
    adapters.ros.BagFrames : Its frames of a radar.

    Examples
    --------
    >>> with rc.adapters.ros.BagWriter("poses") as bag:
    ...     for k in range(3):
    ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
    ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
    ...         bag.write("/ball", message, time_ns=k * 10**8)
    >>> with rc.adapters.ros.BagReader("poses") as bag:
    ...     print(bag.topics["/ball"].type, bag.start_ns, len(list(bag.messages("/ball"))))
    geometry_msgs/msg/PoseStamped 0 3
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        need_rosbags()
        self.path: Path = Path(path)
        if not self.path.exists():
            raise FileNotFoundError(errno.ENOENT, "no such bag", str(self.path))
        self._has_warned = self._closed = False
        self._stack = ExitStack()
        self.version: int
        self._readers, self.version = self._opened()
        self._connections = [connection for reader in self._readers for connection in reader.connections]
        self.topics: dict[str, Topic] = _topics(self._connections)
        filled = [reader for reader in self._readers if reader.message_count]
        self.start_ns: int = min((reader.start_time for reader in filled), default=0)
        self.stop_ns: int = max((reader.end_time for reader in filled), default=0)

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the files.

        See Also
        --------
        adapters.ros.BagReader : A ``with`` block does this by itself.

        Examples
        --------
        >>> with rc.adapters.ros.BagWriter("open") as bag:
        ...     for k in range(3):
        ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
        ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
        ...         bag.write("/ball", message, time_ns=k * 10**8)
        >>> bag = rc.adapters.ros.BagReader("open")
        >>> bag.close()
        >>> bag.path.name
        'open'
        """
        self._readers, self._connections, self._closed = [], [], True
        self._stack.close()

    def topic(self, name: str, *types: str, argument: str = "topic") -> Topic:
        """The topic of a name, with or without the slash in front, that has one of some types (none: any).

        Raises
        ------
        ValueError
            When there is none (the message lists the existing topics), or when it has another type.

        See Also
        --------
        adapters.ros.BagReader.only_topic : By its type.

        Examples
        --------
        >>> print(bag.topic("ball").name)
        /ball
        """
        wanted = f"/{name.strip('/')}"
        found = next((topic for topic in self.topics.values() if f"/{topic.name.strip('/')}" == wanted), None)
        if found is None:
            near = check.near(name, self.topics)
            meant = f"did you mean {' or '.join(map(repr, near))}? " if near else ""
            raise ValueError(f"{argument}: no topic {name!r} in {self.path}; {meant}there are {self._names(types)}")
        if types and found.type not in types:
            raise ValueError(
                f"{argument}: expected {' or '.join(types)}, got {found.type} of {name!r}; "
                f"there are {self._names(types)}"
            )
        return found

    def only_topic(self, *types: str, argument: str = "topic") -> Topic:
        """The one topic that has one of some types.

        Raises
        ------
        ValueError
            When there is none, or more than one: names them.

        See Also
        --------
        adapters.ros.BagReader.topic : By its name.

        Examples
        --------
        >>> print(bag.only_topic("geometry_msgs/msg/PoseStamped").name)
        /ball
        """
        found = [topic for topic in self.topics.values() if topic.type in types]
        if not found:
            raise ValueError(
                f"{argument}: expected a topic of {' or '.join(types)} in {self.path}, got none; "
                f"there are {self._names(())}"
            )
        if len(found) > 1:
            raise ValueError(f"{argument}: expected the name of one of {', '.join(topic.name for topic in found)}")
        return found[0]

    def messages(
        self, topics: str | Iterable[str] | None = None, *, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Messages in the order of their times; in a bag that is cut, in the order of its file.

        Parameters
        ----------
        topics : str or several, optional
            Default: all.
        start_ns, stop_ns : int, optional
            Only messages from a time on, and before one [ns since 1970].

        Raises
        ------
        ValueError
            For a topic that is not there, a message that is not what its definition says, and when the bag is closed.

        See Also
        --------
        adapters.ros.from_pose : One of the functions that decode them.

        Examples
        --------
        >>> print([message.time_ns for message in bag.messages("/ball", start_ns=10**8)])
        [100000000, 200000000]
        """
        if self._closed:
            raise ValueError(f"{self.path}: expected an open bag, got one that is closed")
        names = None if topics is None else [topics] if isinstance(topics, str) else list(topics)
        wanted = self._connections
        if names is not None:
            known = {self.topic(name, argument="topics").name for name in names}
            wanted = [connection for connection in wanted if connection.topic in known]
        return self._messages(wanted, start_ns, stop_ns) if wanted else iter(())

    def _messages(self, wanted: list[Any], start: int | None, stop: int | None) -> Iterator[BagMessage]:
        # Stable: connections of one owner stay together.
        owned = [list(own) for _, own in groupby(sorted(wanted, key=_owner), key=_owner)]
        merged = merge(*(self._raw(own, start, stop) for own in owned), key=lambda entry: entry[1])
        for connection, time, data in merged:
            yield BagMessage(connection.topic, connection.msgtype, time, self._decoded(connection, data))

    def _raw(self, own: list[Any], start: int | None, stop: int | None) -> Iterator[tuple[Any, int, bytes]]:
        """Messages of one file, up to where it is damaged."""
        reader = own[0].owner
        try:
            for connection, time, data in reader.messages(connections=own, start=start, stop=stop):
                # A message may be packed by itself: metadata.yaml says so, where there is one.
                yield connection, time, unpacked(data) if data.startswith(_ZSTD_MAGIC) else data
        except Exception as error:  # of rosbags, its decompressors and databases: whatever a damaged file leads to
            self._warn(reason(error))

    def _decoded(self, connection: Any, data: bytes) -> Any:
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError

        try:
            store = _store(connection.msgtype, connection.msgdef)
            if self.version == 1:
                return store.deserialize_ros1(data, connection.msgtype)
            return store.deserialize_cdr(data, connection.msgtype)
        except (SerdeError, TypesysError, KeyError, ValueError) as error:
            where = f"{check.printable(connection.msgtype)} on {connection.topic!r}"
            raise ValueError(f"{self.path}: expected messages of {where}, got others ({reason(error)})") from error

    def _opened(self) -> tuple[list[Any], int]:
        """Readers of the bag, and the version of ROS."""
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2

        files = _files(self.path)
        kind = _format(files[0])
        version = 1 if kind == "ros1" else 2
        is_described = version == 2 and (self.path / "metadata.yaml").is_file()
        try:
            if kind == "sqlite3":
                for file in files:
                    _check_database(file, is_part=_part_of(self.path) is not None)
            readers: list[Any] = [
                (Reader1 if version == 1 else Reader2)(_Bounded(place))
                for place in ([self.path] if is_described else files)
            ]
            with ExitStack() as stack:
                for reader in readers:
                    stack.enter_context(reader)
                    _check_reader(reader)
                self._stack = stack.pop_all()
        except PermissionError:
            raise
        except Exception as error:  # of rosbags and what it uses: whatever a damaged file leads to
            if kind != "mcap":
                remedy = _REMEDIES.get(kind, "").format(file=files[0])
                raise ValueError(
                    f"{self.path}: expected a whole bag, got a damaged one ({reason(error)}){remedy}"
                ) from error
            readers = [CutMcap(file) for file in files]
            cuts = [reader.cut for reader in readers if reader.cut is not None]
            if cuts and not any(reader.connections for reader in readers):
                raise ValueError(f"{self.path}: expected a bag, got a damaged one ({cuts[0]})") from error
            # Whole files with topics of other encodings are read without those, and without a warning.
            if cuts or not isinstance(error, KeyError):
                count = sum(reader.message_count for reader in readers)
                self._warn(f"{cuts[0] if cuts else reason(error)}; {count} messages are whole")
        else:
            if self.path.is_dir() and version == 2 and not is_described:
                self._warn("a folder without metadata.yaml, its recorder was interrupted")
        return readers, version

    def _warn(self, what: str) -> None:
        """One warning of a bag, however often its damage is met."""
        if not self._has_warned:
            self._has_warned = True
            notice.warn(f"{self.path}: a bag that is cut or damaged: {what}")

    def _names(self, types: tuple[str, ...]) -> str:
        """Names and types of the topics; some types first."""
        every = sorted(self.topics.values(), key=lambda topic: (topic.type not in types, topic.name))
        shown = [f"{topic.name} ({topic.type})" for topic in every[:_MOST_NAMES]]
        if len(every) > _MOST_NAMES:
            shown.append(f"and {len(every) - _MOST_NAMES} more")
        return ", ".join(shown) or "none"


class _Bounded(type(Path())):  # type: ignore[misc]  # Python 3.11 has no subclasses of Path itself
    """A path whose file never reads beyond its size: rosbags asks for the length in a damaged record."""

    def open(self, mode: str = "r", *args: Any, **options: Any) -> Any:
        return _BoundedFile(FileIO(self, "rb")) if mode == "rb" else super().open(mode, *args, **options)


class _BoundedFile(BufferedReader):
    def read(self, size: int | None = -1) -> bytes:
        if size is not None and size > _LONG:
            size = min(size, max(os.fstat(self.fileno()).st_size - self.tell(), 0))
        return super().read(size)


def is_bag(path: str | PathLike[str]) -> bool:
    """True for what looks like a bag: by its suffix, or the files in a folder that is no recording."""
    place = Path(path)
    if (inner := _part_of(place)) is not None:
        return is_bag(inner)
    if place.is_dir():
        if (place / "meta.json").is_file() or infineon.is_recording(place):
            return False
        return (place / "metadata.yaml").is_file() or any(file.suffix in _SUFFIXES for file in place.iterdir())
    return place.suffix in _SUFFIXES


def _part_of(path: Path) -> Path | None:
    """The bag in a part that a `BagWriter` has left."""
    if path.suffix != ".part" or not path.is_dir():
        return None
    return next((place for place in path.iterdir() if place.name != LOCK), None)


def _files(path: Path) -> list[Path]:
    """The files of a bag in the order of recording."""
    if path.is_file():
        return [path]
    if (inner := _part_of(path)) is not None:
        return _files(inner)
    for suffix in _SUFFIXES:
        if found := sorted(path.glob(f"*{suffix}"), key=lambda file: (len(file.name), file.name)):
            return found
    if found := sorted(path.glob("*.zstd")):
        # SQLite and MCAP files packed as a whole: rosbags unpacks them.
        return found
    raise ValueError(f"{path}: expected a bag, got a folder without {', '.join(_SUFFIXES)} files")


def _format(file: Path) -> str:
    """Format of a file by its first bytes: a key of `_MAGICS`, or ``"packed"``."""
    if file.suffix == ".zstd":  # packed as a whole: rosbags unpacks it
        return "packed"
    with file.open("rb") as opened:
        start = opened.read(16)
    for name, magic in _MAGICS.items():
        if start.startswith(magic):
            return name
    got = "another file" if start else "an empty file"
    raise ValueError(f"{file}: expected a ROS 1 bag, or an MCAP or SQLite bag of ROS 2, got {got}")


def _check_database(file: Path, *, is_part: bool) -> None:
    """Raise a ValueError for a SQLite file that rosbags would read as if nothing was missing.

    SQLite itself finishes a part that a killed `BagWriter` has left.
    """
    with file.open("rb") as opened:
        head = opened.read(100)
    # SQLite, "Database File Format", 1.3: size of a page and number of pages, valid if two counters agree.
    page = int.from_bytes(head[16:18], "big")
    size = (65536 if page == 1 else page) * int.from_bytes(head[28:32], "big")
    if head[24:28] == head[92:96] and size > file.stat().st_size:
        raise ValueError(f"expected {size} bytes, got {file.stat().st_size}")
    if is_part:
        with closing(sqlite3.connect(file)) as database:
            database.execute("SELECT count(*) FROM sqlite_master").fetchall()
        return
    for end in ("-wal", "-journal"):  # changes that its writer, when it was killed, had not put in yet
        changes = file.with_name(file.name + end)
        if changes.exists() and changes.stat().st_size > 0:
            raise ValueError(f"its writer left {changes.name}")


def _check_reader(reader: Any) -> None:
    """Refuse topics without a name, and chunks that are larger than recorders make."""
    if not all(isinstance(text, str) for one in reader.connections for text in (one.topic, one.msgtype)):
        raise ValueError("expected names of topics and types, got none")
    storage = getattr(reader, "storage", None)
    for file in (storage, *getattr(storage, "storages", ())):  # a folder has several files
        for chunk in getattr(file, "chunks", ()):
            check_unpacked(chunk.uncompressed_size)


def _owner(connection: Any) -> int:
    return id(connection.owner)


def _topics(connections: Iterable[Any]) -> dict[str, Topic]:
    found: dict[str, Topic] = {}
    for connection in connections:
        before = found.get(connection.topic)
        count = connection.msgcount + (0 if before is None else before.num_messages)
        found[connection.topic] = Topic(connection.topic, connection.msgtype, count)
    return dict(sorted(found.items()))


@lru_cache(maxsize=256)  # rosbags compiles a decoder for every type
def _store(name: str, definition: Any) -> Any:
    """Message types in a definition, or the types of ROS if there is no definition."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    if definition.format == MessageDefinitionFormat.NONE:
        return typestore()
    types: dict[str, Any] = {}
    if definition.format == MessageDefinitionFormat.MSG:
        types |= get_types_from_msg(definition.data, name)
    else:
        line = "=" * 80 + "\n"  # between the definitions of several types
        parts = definition.data.split(line)[1:] if definition.data.startswith(f"{line}IDL: ") else [definition.data]
        for part in parts:
            types |= get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store
