"""MCAP files without a usable index: their records one after the other, as far as the file goes.

A recorder that was killed leaves a file without its index; a full disk or a broken copy leaves a file that ends in the
middle of a record. The chunk that is cut is lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, Any

from radarcore import check

_FORMATS = ("ros2msg", "ros2idl", "omgidl")
"""Encodings of the definitions of ROS messages."""

MOST_UNPACKED = 1 << 27
"""Limit of an unpacked chunk or message [bytes]; recorders make chunks of 1 to 5 MB, or of a single larger message."""

_LONGEST_REASON = 200
"""Characters of another library's message."""


class CutMcap:
    """An MCAP file, read from the start by mcap's reader of streams; stands in for a reader of rosbags.

    Attributes
    ----------
    connections : list
        Topics as rosbags describes them, with their numbers of messages.
    cut : str or None
        Reason why the file could not be read to its end.
    start_time, end_time : int
        Times of the first message and after the last one [ns].
    message_count : int
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut: str | None = None
        channels: dict[int, Any] = {}
        counts: Counter[int] = Counter()
        first, last = 2**63 - 1, -1
        for channel, schema, message in self._records():
            channels[channel.id] = channel, schema
            if message is not None:
                counts[channel.id] += 1
                first, last = min(first, message.log_time), max(last, message.log_time)
        self.start_time: int = first
        self.end_time: int = last + 1
        self.message_count: int = counts.total()
        self.connections: list[Any] = [
            _connection(self, channel, schema, counts[number]) for number, (channel, schema) in channels.items()
        ]

    def messages(
        self, connections: Collection[Any], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Any, int, bytes]]:
        """Messages of some connections between two times [ns], in the order of the file."""
        wanted = {connection.id: connection for connection in connections}
        for channel, _, message in self._records():
            if message is None or channel.id not in wanted:
                continue
            if (start is None or start <= message.log_time) and (stop is None or message.log_time < stop):
                yield wanted[channel.id], message.log_time, message.data

    def _records(self) -> Iterator[tuple[Any, Any, Any]]:
        """Channel and schema of ROS messages, alone where the channel begins and with every message, up to the cut."""
        from mcap.records import Channel, Header, Message, Schema

        schemas: dict[int, Any] = {}
        channels: dict[int, tuple[Any, Any]] = {}
        with self.path.open("rb") as file:
            try:
                for record in _records(file, self.path.stat().st_size):
                    if isinstance(record, Header) and record.profile != "ros2":
                        raise ValueError(f"expected the MCAP profile 'ros2', got {record.profile!r}")
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        schema = schemas.get(record.schema_id)
                        if record.message_encoding == "cdr" and schema is not None and schema.encoding in _FORMATS:
                            channels[record.id] = record, schema
                            yield record, schema, None
                    elif isinstance(record, Message) and record.channel_id in channels:
                        yield *channels[record.channel_id], record
            except Exception as error:  # of mcap and its decompressors: whatever a damaged file leads to
                self.cut = reason(error)


def _records(file: IO[bytes], size: int) -> Iterator[Any]:
    """Records of an MCAP file, chunks unpacked."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    for record in StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=size).records:
        if isinstance(record, Chunk):
            check_unpacked(record.uncompressed_size)
            yield from breakup_chunk(record, validate_crc=True)
        else:
            yield record


def unpacked(data: bytes) -> bytes:
    """Content of a message that is packed by Zstandard."""
    from zstandard import ZstdDecompressor

    content: bytes = ZstdDecompressor().stream_reader(data).read(MOST_UNPACKED + 1)
    check_unpacked(len(content))
    return content


def check_unpacked(num_bytes: int) -> None:
    """Raise a ValueError for a chunk or message that is larger than recorders make."""
    if num_bytes > MOST_UNPACKED:
        raise ValueError(f"a part of it unpacks to more than {MOST_UNPACKED} bytes")


def reason(error: Exception) -> str:
    """An error of another library, which may run over many lines, as a short one."""
    text = check.printable(" ".join(str(error).split())).rstrip(".") or type(error).__name__
    return text if len(text) <= _LONGEST_REASON else f"{text[: _LONGEST_REASON - 3]}..."


def _connection(owner: CutMcap, channel: Any, schema: Any, count: int) -> Any:
    """A topic as rosbags describes it."""
    from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat

    kind = MessageDefinitionFormat.IDL if "idl" in schema.encoding else MessageDefinitionFormat.MSG
    text = schema.data.decode(errors="replace")
    definition = MessageDefinition(kind if text else MessageDefinitionFormat.NONE, text)
    return Connection(
        channel.id, channel.topic, schema.name, definition, "", count, ConnectionExtRosbag2("cdr", []), owner
    )
