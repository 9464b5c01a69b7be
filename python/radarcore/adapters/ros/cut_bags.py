"""Readers of bags without a usable index: their records one after the other, as far as the file goes.

A recorder that was killed leaves a file without its index, a full disk or a broken copy one that ends in the middle of
a record. Files of the three formats are sequences that can be read from the start: MCAP and ROS 1 record by record,
SQLite row by row.

- MCAP: https://mcap.dev/spec, opcodes 0x01 ... 0x0F
- ROS 1: http://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from bz2 import BZ2Decompressor
from collections.abc import Collection, Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple
from zlib import crc32

MCAP_MAGIC = b"\x89MCAP0\r\n"
ROS1_MAGIC = b"#ROSBAG V2.0\n"
SQLITE_MAGIC = b"SQLite format 3\0"
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""Start of a message that is packed; others of ROS 2 start with zero (CDR)."""

_MOST_UNPACKED, _MOST_RATIO = 1 << 26, 1000
"""Limits of an unpacked chunk, in bytes and relative to its size: a few bytes may unpack to gigabytes of zeros."""

Record = tuple[int, int, bytes]
"""Number of a connection, time [ns] and message."""


class CutError(Exception):
    """End of the readable part of a file, and the reason."""


class _Channel(NamedTuple):
    """Topic of a connection, with type, encoding and definition of its messages."""

    topic: str
    type: str
    encoding: str
    definition: str


class SequentialReader(ABC):
    """A bag's file, read from the start; stands in for a reader of rosbags.

    Attributes
    ----------
    version : int
        1 or 2, of ROS.
    connections : list
        Those of rosbags, with their numbers of messages.
    cut : str or None
        Why the file could not be read to its end.
    start_time, end_time : int
        Times of the first message and after the last one [ns].
    message_count : int
    """

    version = 2

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Any] = []
        self.cut: str | None = None
        self.start_time: int = 2**63 - 1
        self.end_time: int = 0
        self.message_count: int = 0
        self._channels: dict[int, _Channel] = {}

    def __enter__(self) -> SequentialReader:
        """Go through the file once: topics and numbers of messages."""
        counts: dict[int, int] = {}
        for number, time, _ in self._whole_records():
            counts[number] = counts.get(number, 0) + 1
            self.start_time, self.end_time = min(self.start_time, time), max(self.end_time, time + 1)
        self.message_count = sum(counts.values())
        self.connections = [
            _connection(self, number, channel, counts.get(number, 0)) for number, channel in self._channels.items()
        ]
        return self

    def __exit__(self, *_: object) -> None:
        self.connections = []

    def messages(
        self, connections: Collection[Any] = (), start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Any, int, bytes]]:
        """Messages of some connections (none: of all) between two times [ns], in the order of the file."""
        wanted = {connection.id: connection for connection in connections or self.connections}
        for number, time, data in self._whole_records():
            if number in wanted and (start is None or start <= time) and (stop is None or time < stop):
                yield wanted[number], time, data

    def _whole_records(self) -> Iterator[Record]:
        """Messages up to the cut."""
        try:
            yield from self._records()
        except CutError as error:
            self.cut = str(error)
        except (struct.error, KeyError, IndexError, UnicodeDecodeError) as error:
            self.cut = f"a record is damaged ({error})"

    @abstractmethod
    def _records(self) -> Iterator[Record]:
        """Messages of the file, until it ends or a `CutError`."""


class McapFile(SequentialReader):
    """An MCAP file, whether or not it has its summary and footer."""

    _FORMATS = ("ros2msg", "ros2idl", "omgidl")

    def _records(self) -> Iterator[Record]:
        schemas: dict[int, tuple[str, str, str]] = {}
        with self.path.open("rb") as file:
            file.seek(len(MCAP_MAGIC))
            for opcode, data in _mcap_records(file, self.path.stat().st_size):
                if opcode == 0x01 and (profile := _texts(data, 0, 1)[0][0]) != "ros2":
                    raise ValueError(f"{self.path}: expected the MCAP profile 'ros2', got {profile!r}")
                if opcode == 0x0F:  # the end of the data: an index may follow
                    return
                yield from self._messages(opcode, data, schemas)
        raise CutError("it has no end")

    def _messages(self, opcode: int, data: bytes, schemas: dict[int, tuple[str, str, str]]) -> Iterator[Record]:
        if opcode == 0x03:
            (name, encoding, text), _ = _texts(data, 2, 3)
            schemas[struct.unpack_from("<H", data)[0]] = name, encoding, text
        elif opcode == 0x04:
            number, schema = struct.unpack_from("<HH", data)
            (topic, encoding), _ = _texts(data, 4, 2)
            name, kind, text = schemas.get(schema, ("", "", ""))
            if encoding == "cdr" and kind in self._FORMATS:
                self._channels[number] = _Channel(topic, name, kind, text)
        elif opcode == 0x05:
            number, _, time, _ = struct.unpack_from("<HIQQ", data)
            if number in self._channels:
                yield number, time, data[22:]
        elif opcode == 0x06:
            yield from self._chunk(data, schemas)

    def _chunk(self, data: bytes, schemas: dict[int, tuple[str, str, str]]) -> Iterator[Record]:
        """Messages of a chunk in the order of their times; of one that is cut, those that are whole."""
        size, checksum = struct.unpack_from("<QI", data, 16)
        (compression,), at = _texts(data, 28, 1)
        (packed,) = struct.unpack_from("<Q", data, at)
        content = unpacked(compression, data[at + 8 : at + 8 + packed])
        if len(content) == size and checksum and crc32(content) != checksum:
            raise CutError("the checksum of a chunk is wrong")
        found: list[Record] = []
        try:
            for opcode, inner in _mcap_records(BytesIO(content), len(content)):
                found += self._messages(opcode, inner, schemas)
        except CutError as error:
            yield from sorted(found, key=lambda record: record[1])
            raise error
        yield from sorted(found, key=lambda record: record[1])
        if len(content) != size:
            raise CutError("it ends within a chunk")


class Ros1File(SequentialReader):
    """A ROS 1 bag, whether or not it has its index."""

    version = 1

    def _records(self) -> Iterator[Record]:
        with self.path.open("rb") as file:
            file.seek(len(ROS1_MAGIC))
            index = 0
            for header, data in _ros1_records(file, self.path.stat().st_size):
                operation = header["op"][0]
                if operation == 3:
                    (index,) = struct.unpack("<Q", header["index_pos"])
                if operation == 5:
                    yield from self._chunk(header, data)
                else:
                    yield from self._messages(operation, header, data)
        if index == 0:
            raise CutError("it has no index")

    def _messages(self, operation: int, header: dict[str, bytes], data: bytes) -> Iterator[Record]:
        if operation == 7:
            fields = _ros1_fields(data)
            (number,) = struct.unpack("<I", header["conn"])
            package, _, name = fields["type"].decode().rpartition("/")
            text = fields["message_definition"].decode(errors="replace")
            self._channels.setdefault(number, _Channel(header["topic"].decode(), f"{package}/msg/{name}", "ros1", text))
        elif operation == 2:
            seconds, nanoseconds = struct.unpack("<II", header["time"])
            yield struct.unpack("<I", header["conn"])[0], seconds * 1_000_000_000 + nanoseconds, data

    def _chunk(self, header: dict[str, bytes], data: bytes) -> Iterator[Record]:
        content = unpacked(header["compression"].decode(), data)
        found: list[Record] = []
        try:
            for inner, entry in _ros1_records(BytesIO(content), len(content)):
                found += self._messages(inner["op"][0], inner, entry)
        except CutError as error:
            yield from sorted(found, key=lambda record: record[1])
            raise error
        yield from sorted(found, key=lambda record: record[1])
        if len(content) != struct.unpack("<I", header["size"])[0]:
            raise CutError("it ends within a chunk")


class SqliteFile(SequentialReader):
    """A ROS 2 bag of SQLite, row by row without its index of times."""

    def _records(self) -> Iterator[Record]:
        import apsw

        try:
            with closing(_database(self.path)) as database:
                cursor = database.cursor()
                self._read_channels(cursor)
                rows = cursor.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id")
                for number, time, data in rows:
                    if number in self._channels and isinstance(time, int) and isinstance(data, bytes):
                        yield number, time, data
        except apsw.Error as error:
            raise CutError(f"{type(error).__name__}: {error}") from error

    def _read_channels(self, cursor: Any) -> None:
        tables = {name for (name,) in cursor.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if missing := {"topics", "messages"} - tables:
            raise ValueError(f"{self.path}: expected a bag, got a database without the table {sorted(missing)[0]!r}")
        texts: dict[str, tuple[str, str]] = {}
        if "message_definitions" in tables:
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            texts = {name: (encoding, text) for name, encoding, text in cursor.execute(query)}
        for number, topic, name, encoding in cursor.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ).fetchall():
            given = topic, name, *texts.get(name, ("", ""))
            if encoding == "cdr" and all(isinstance(text, str) for text in given):
                self._channels[number] = _Channel(*given)


def sequential_reader(path: Path) -> SequentialReader:
    """The reader for a file, by its first bytes.

    Raises
    ------
    ValueError
        When it is not a bag.
    """
    with path.open("rb") as file:
        start = file.read(16)
    for magic, kind in ((MCAP_MAGIC, McapFile), (ROS1_MAGIC, Ros1File), (SQLITE_MAGIC, SqliteFile)):
        if start.startswith(magic):
            return kind(path)
    got = "an empty file" if not start else "another file"
    raise ValueError(f"{path}: expected a ROS 1 bag, or an MCAP or SQLite bag of ROS 2, got {got}")


def unpacked_message(data: bytes) -> bytes:
    """A message of ROS 2, which may be packed by itself: metadata.yaml says so, where there is one."""
    return unpacked("zstd", data) if data.startswith(_ZSTD_MAGIC) else data


def database_size(path: Path) -> int:
    """Bytes that a SQLite file says it has; 0 if it does not (SQLite, "Database File Format", 1.3)."""
    with path.open("rb") as file:
        head = file.read(100)
    if len(head) < 100 or head[24:28] != head[92:96]:
        return 0
    page = int.from_bytes(head[16:18], "big")
    return (65536 if page == 1 else page) * int.from_bytes(head[28:32], "big")


def _connection(owner: SequentialReader, number: int, channel: _Channel, count: int) -> Any:
    """Record of rosbags for a topic."""
    from rosbags.interfaces import (
        Connection,
        ConnectionExtRosbag1,
        ConnectionExtRosbag2,
        MessageDefinition,
        MessageDefinitionFormat,
    )

    text = MessageDefinitionFormat.IDL if "idl" in channel.encoding else MessageDefinitionFormat.MSG
    definition = MessageDefinition(text if channel.definition else MessageDefinitionFormat.NONE, channel.definition)
    extra: Any = ConnectionExtRosbag1(None, None) if channel.encoding == "ros1" else ConnectionExtRosbag2("cdr", [])
    return Connection(number, channel.topic, channel.type, definition, "", count, extra, owner)


def _mcap_records(file: IO[bytes], size: int) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of every record; the content of a chunk that is cut as far as it goes."""
    while (at := file.tell()) < size:
        head = file.read(9)
        if len(head) < 9:
            raise CutError("it ends within a record")
        opcode, length = struct.unpack("<BQ", head)
        if length > size - at - 9:
            if opcode == 0x06 and size - at - 9 > 64:
                yield opcode, file.read()
            raise CutError("it ends within a record")
        yield opcode, file.read(length)


def _ros1_records(file: IO[bytes], size: int) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Header and data of every record; the data of a chunk that is cut as far as they go."""
    while file.tell() < size:
        header = _ros1_fields(_ros1_block(file, size))
        at = file.tell()
        try:
            data = _ros1_block(file, size)
        except CutError:
            if header.get("op") == b"\x05":
                file.seek(at + 4)
                yield header, file.read()
            raise
        if "op" not in header:
            raise CutError("a record has no operation")
        yield header, data


def _ros1_block(file: IO[bytes], size: int) -> bytes:
    head = file.read(4)
    if len(head) < 4 or (length := struct.unpack("<I", head)[0]) > size - file.tell():
        raise CutError("it ends within a record")
    return file.read(length)


def _ros1_fields(data: bytes) -> dict[str, bytes]:
    """Fields ``name=value`` of a header."""
    fields, at = {}, 0
    while at + 4 <= len(data):
        (length,) = struct.unpack_from("<I", data, at)
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        if not equals or at + 4 + length > len(data):
            raise CutError("a record is damaged")
        fields[name.decode(errors="replace")] = value
        at += 4 + length
    return fields


def _texts(data: bytes, at: int, count: int) -> tuple[list[str], int]:
    """Some texts with their lengths in front, and the place behind them."""
    found = []
    for _ in range(count):
        if at + 4 > len(data):
            raise CutError("a record is damaged")
        (length,) = struct.unpack_from("<I", data, at)
        found.append(data[at + 4 : at + 4 + length].decode(errors="replace"))
        at += 4 + length
    return found, at


def most_unpacked(size: int) -> int:
    """Largest number of bytes to which a chunk may unpack."""
    return max(_MOST_UNPACKED, _MOST_RATIO * size)


def unpacked(compression: str, data: bytes) -> bytes:
    """Content of a chunk; of one that is cut as much as there is."""
    if compression in ("", "none"):
        return data
    most = most_unpacked(len(data))
    try:
        content = bytes(_decompressor(compression).decompress(data, most + 1))
    except (RuntimeError, OSError, EOFError, ValueError) as error:
        raise CutError(f"a chunk is damaged ({error})") from error
    except Exception as error:  # zstd has an error of its own, whose module depends on the version of Python
        raise CutError(f"a chunk is damaged ({error})") from error
    if len(content) > most:
        raise CutError(f"a chunk of {len(data)} bytes unpacks to more than {most}")
    return content


def _decompressor(compression: str) -> Any:
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    if compression == "bz2":
        return BZ2Decompressor()
    if compression == "zstd":
        try:
            from compression import zstd
        except ImportError:  # before Python 3.14
            from backports import zstd
        return zstd.ZstdDecompressor()
    raise CutError(f"a chunk has the unknown compression {compression!r}")


def _database(path: Path) -> Any:
    """A database to read, damaged or not."""
    import apsw

    from radarcore.adapters.ros.torn_database import torn_database

    if any(path.with_name(path.name + end).exists() for end in ("-wal", "-journal")):
        try:  # with what its writer had not put into the file yet
            database = apsw.Connection(str(path), flags=apsw.SQLITE_OPEN_READONLY)
            database.execute("SELECT count(*) FROM sqlite_master").fetchall()
            return database
        except apsw.Error:
            pass  # nobody may write there, or the journal is damaged as well
    return torn_database(path, database_size(path))
