"""ROS bags written: the SQLite and MCAP files of ROS 2.

Needs rosbags: ``pip install radarcore[ros]``; ROS itself is not needed.
"""

from __future__ import annotations

import time as clock
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any

from radarcore import check
from radarcore._core import __version__
from radarcore.adapters.ros.bags import need_rosbags, typed, typestore
from radarcore.output import PartFolder, already_exists, check_file, give_name

FORMATS = ("mcap", "sqlite3")

_BY_SUFFIX = {".mcap": "mcap", ".db3": "sqlite3"}

_LAST_NS = 2**63 - 1
"""Latest time of a message [ns since 1970]."""

_METADATA, _MARK = "metadata.yaml", "radarcore"
"""File that describes a ROS 2 folder, and the key in its ``custom_data`` that marks folders of radarcore."""

_LONGEST_WAIT, _MOST_WAITING = 0.9, 1 << 25
"""Messages are flushed after this time [s] or number of bytes."""


class BagWriter:
    """Writes messages into a new ROS bag.

    The bag gets its name when it is finished; until then it is ``NAME.part`` beside that, which `BagReader` reads as
    far as it got. Leaving a ``with`` block finishes it, also by an exception or Ctrl-C: the bag is readable.
    A killed process loses at most the last second that it wrote; its part stays, and no other writer replaces it.

    Parameters
    ----------
    path : path
        A folder of ROS 2 (no suffix), a single ``.mcap`` or ``.db3`` file.
    format : "mcap" or "sqlite3", optional
        Default: by the suffix of `path`; MCAP for a folder.
    overwrite : bool
        Replace an existing bag: a single file, or a folder that radarcore has written. Only the files that its
        ``metadata.yaml`` lists are deleted.

    Attributes
    ----------
    path : Path
    format : str
    types : object
        Types of rosbags: ``types=`` of the functions that make messages.

    Raises
    ------
    FileExistsError
        When `path` exists and is not a bag to be overwritten, or ``NAME.part`` exists.
    BlockingIOError
        When another writer is writing the bag.
    ImportError
        When rosbags is missing.

    See Also
    --------
    adapters.ros.BagReader : Reads it.
    adapters.ros.FrameWriter : Frames of a radar.
    adapters.ros.to_pose_stamped : One of the functions that make messages.

    Examples
    --------
    >>> with rc.adapters.ros.BagWriter("poses") as bag:
    ...     for k in range(3):
    ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
    ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
    ...         bag.write("/ball", message, time_ns=k * 10**8)
    >>> bag.path.name, bag.format
    ('poses', 'mcap')
    """

    def __init__(self, path: str | PathLike[str], format: str | None = None, *, overwrite: bool = False) -> None:
        need_rosbags()
        self.path: Path = Path(path)
        suffix = self.path.suffix
        if suffix not in _BY_SUFFIX and suffix[1:2].isalpha():  # dates and versions in names of folders have dots, too
            ends = ", ".join(_BY_SUFFIX)
            raise ValueError(f"path: expected a bag ({ends}) or a folder without a suffix, got {str(path)!r}")
        self.format: str = check.choice("format", format or _BY_SUFFIX.get(suffix, "mcap"), FORMATS)
        if _BY_SUFFIX.get(suffix, self.format) != self.format:
            expected = next(end for end, kind in _BY_SUFFIX.items() if kind == self.format)
            raise ValueError(f"path: expected {expected} or a folder for the format {self.format!r}, got {str(path)!r}")
        self.types: Any = typestore()
        self._overwrite = overwrite
        self._replaced()
        self._connections: dict[str, Any] = {}
        self._closed = False
        self._num_waiting, self._flushed = 0, clock.monotonic()
        self._failure: Exception | None = None
        with ExitStack() as stack:
            self._part = stack.enter_context(PartFolder(self.path))
            name = self.path.stem if suffix in _BY_SUFFIX else self.path.name
            self._inner = self._part.folder / name
            self._bag = self._opened()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_topic(self, topic: str, type: str, *, latched: bool = False) -> None:
        """Make a topic before its first message; needed for one that is latched, and one without messages.

        Parameters
        ----------
        topic : str
            Such as ``"/radar/scan"``.
        type : str
            Such as ``"radar_msgs/msg/RadarScan"``.
        latched : bool
            Late subscribers get its last message, too: settings (transient local).

        See Also
        --------
        adapters.ros.BagWriter.write : Makes topics by itself.

        Examples
        --------
        >>> with rc.adapters.ros.BagWriter("empty") as bag:
        ...     bag.add_topic("/ball", "geometry_msgs/msg/PoseStamped")
        >>> with rc.adapters.ros.BagReader("empty") as bag:
        ...     print(list(bag.topics))
        ['/ball']
        """
        if not str(topic).strip("/"):
            raise ValueError(f"topic: expected a name such as '/radar/scan', got {topic!r}")
        if type not in self.types.fielddefs:
            raise ValueError(
                f"type: expected a known message, got {type!r}; {check.near_names(type, self.types.fielddefs)}"
            )
        if (known := self._connections.get(topic)) is not None:
            if known.msgtype != type:
                raise ValueError(f"type: expected {known.msgtype} of the topic {topic!r}, got {type}")
            return
        options: dict[str, Any] = {"typestore": self.types}
        if latched:
            options["offered_qos_profiles"] = [_transient_local()]
        self._connections[topic] = self._bag.add_connection(topic, type, **options)

    def write(self, topic: str, message: Any, time_ns: int, *, type: str | None = None) -> None:
        """Write a message.

        Parameters
        ----------
        topic : str
        message : object or mapping
            A message of rosbags, one of the functions of `radarcore.adapters.ros`, or anything with its fields.
        time_ns : int
            Time at which it is recorded [ns since 1970].
        type : str, optional
            Default: from the message (``__msgtype__``) or the topic.

        Raises
        ------
        ValueError
            For a missing field, a type other than the topic's, or a time outside of the format.

        See Also
        --------
        adapters.ros.BagReader.messages : Reads them.

        Examples
        --------
        >>> with rc.adapters.ros.BagWriter("written") as bag:
        ...     for k in range(3):
        ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
        ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
        ...         bag.write("/ball", message, time_ns=k * 10**8)
        >>> with rc.adapters.ros.BagReader("written") as bag:
        ...     print([message.topic for message in bag.messages()])
        ['/ball', '/ball', '/ball']
        """
        if self._closed:
            raise ValueError(f"{self.path}: expected an open bag, got one that is closed")
        time = check.count("time_ns", time_ns, 0)
        if time > _LAST_NS:
            raise ValueError(f"time_ns: expected at most {_LAST_NS}, got {time}")
        known = self._connections.get(topic)
        name = type or getattr(message, "__msgtype__", None) or (None if known is None else known.msgtype)
        if name is None:
            raise ValueError(f"type: expected the type of the message, got none for the topic {topic!r}")
        self.add_topic(topic, name)
        if not isinstance(message, self.types.types[name]):
            message = typed(self.types, name, message)
        data = self.types.serialize_cdr(message, name)
        self._check_whole()
        try:
            self._bag.write(self._connections[topic], time, data)
            self._num_waiting += len(data)
            if self._num_waiting > _MOST_WAITING or clock.monotonic() > self._flushed + _LONGEST_WAIT:
                self._flush()
        except Exception as error:  # such as a full disk, after which the file may end within a record
            self._failure = error
            raise

    def close(self) -> None:
        """Finish the bag and give it its name.

        See Also
        --------
        adapters.ros.BagWriter : A ``with`` block does this by itself.

        Examples
        --------
        >>> bag = rc.adapters.ros.BagWriter("closed")
        >>> bag.close()
        >>> bag.path.exists()
        True
        """
        if self._closed:
            return
        self._closed = True
        try:
            try:
                self._check_whole()
                self._bag.close()
            except BaseException:
                self._bag.abort()  # a full disk
                raise
            replaced = self._replaced()  # again: another program may have written there meanwhile
            if self.path.suffix in _BY_SUFFIX:
                file = self._inner / f"{self._inner.name}{self.path.suffix}"
                give_name(file, self.path, overwrite=self._overwrite)
                self._part.remove()
            else:
                self._part.put(self._inner, replaced)
        except BaseException:
            self._part.leave()  # readable as far as it got
            raise

    def _opened(self) -> Any:
        """The writer of rosbags."""
        from rosbags.rosbag2 import StoragePlugin, Writer

        bag: Any = Writer(self._inner, version=9, storage_plugin=StoragePlugin[self.format.upper()])
        bag.set_custom_data(_MARK, __version__)
        bag.open()
        if self.format == "sqlite3":
            # The file is complete at any time: it changes only with a commit.
            bag.storage.conn.execute("PRAGMA cache_spill = OFF")
        return bag

    def _check_whole(self) -> None:
        """Raise the error of an earlier write, whose record may be incomplete."""
        if self._failure is not None:
            raise self._failure

    def _flush(self) -> None:
        """Hand all messages over to the operating system, so that they survive a killed process."""
        if self.format == "sqlite3":
            self._bag.storage.conn.commit()
        else:
            if self._bag.storage.chunk.bio.tell():
                self._bag.storage.close_chunk()
            self._bag.storage.bio.flush()
        self._num_waiting, self._flushed = 0, clock.monotonic()

    def _replaced(self) -> list[Path]:
        """Files of the folder that this bag replaces; an error unless it is a bag and `overwrite` is given."""
        path = self.path
        if path.suffix in _BY_SUFFIX or not path.is_dir():
            if path.exists() and path.suffix not in _BY_SUFFIX:
                raise already_exists(path, "a file that is no bag")
            check_file(path, overwrite=self._overwrite)
            return []
        if not (path / _METADATA).is_file():
            raise already_exists(path, "a folder that is no bag")
        files = _own_files(path)
        if not files:
            raise already_exists(path, "a bag that radarcore did not write; delete it, or choose another path")
        if not self._overwrite:
            raise already_exists(path, "a bag; overwrite=True replaces it")
        return files


def _own_files(folder: Path) -> list[Path]:
    """Files of a bag that radarcore has written, by its metadata; empty for any other."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        described = YAML(typ="safe").load(folder / _METADATA)["rosbag2_bagfile_information"]
        is_own, names = _MARK in described["custom_data"], [_METADATA, *described["relative_file_paths"]]
    except (OSError, ValueError, TypeError, KeyError, YAMLError):
        return []
    return [folder / Path(name).name for name in names] if is_own else []


def _transient_local() -> Any:
    """Quality of service of a latched topic: reliable delivery of the last message, also to late subscribers."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    forever = QosTime(2147483647, 4294967295)
    delivery = QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL
    return Qos(QosHistory.KEEP_LAST, 1, *delivery, forever, forever, QosLiveliness.AUTOMATIC, forever, False)
