"""ROS bags written: ROS 1, and the SQLite and MCAP files of ROS 2.

Needs rosbags: ``pip install radarcore[ros]``; ROS itself is not needed.
"""

from __future__ import annotations

import errno
import shutil
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

from radarcore import check
from radarcore.adapters.ros.typestore import need_rosbags, typed, typestore

FORMATS = ("mcap", "sqlite3", "ros1")

_BY_SUFFIX = {".bag": "ros1", ".mcap": "mcap", ".db3": "sqlite3"}

_LAST_NS = {"mcap": 2**63 - 1, "sqlite3": 2**63 - 1, "ros1": 2**32 * 10**9 - 1}
"""Latest time of a message [ns since 1970]."""


@check.knows_keywords
class BagWriter:
    """Writes messages into a new ROS bag.

    The bag gets its name when it is finished; until then it is ``NAME.part`` beside that, which `BagReader` reads as
    far as it got. Leaving a ``with`` block finishes it, by an exception or Ctrl-C too: what was written is readable.

    Parameters
    ----------
    path : path
        A folder of ROS 2 (no suffix), a single ``.mcap`` or ``.db3`` file, or a ROS 1 ``.bag``.
    format : "mcap", "sqlite3" or "ros1", optional
        Default: by the suffix of `path`; MCAP for a folder.
    overwrite : bool
        Replace a bag that is already there.

    Attributes
    ----------
    path : Path
    format : str
    version : int
        1 or 2, of ROS.
    types : object
        Types of rosbags: ``types=`` of the functions that make messages.

    Raises
    ------
    FileExistsError
        When `path` exists and is not a bag to be overwritten.
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
    >>> bag.path.name, bag.format, bag.version
    ('poses', 'mcap', 2)
    """

    def __init__(self, path: str | PathLike[str], format: str | None = None, *, overwrite: bool = False) -> None:
        need_rosbags()
        self.path: Path = Path(path)
        suffix = self.path.suffix
        if suffix not in _BY_SUFFIX and suffix[1:2].isalpha():  # dates and versions in names of folders have dots, too
            ends = ", ".join(_BY_SUFFIX)
            raise ValueError(f"path: expected a bag ({ends}) or a folder without a suffix, got {str(path)!r}")
        self.format: str = check.choice("format", format or _BY_SUFFIX.get(suffix, "mcap"), FORMATS)
        if _BY_SUFFIX.get(suffix, self.format) != self.format or (self.format == "ros1" and suffix != ".bag"):
            expected = next(end for end, kind in _BY_SUFFIX.items() if kind == self.format)
            folder = "" if self.format == "ros1" else " or a folder"
            raise ValueError(f"path: expected {expected}{folder} for the format {self.format!r}, got {str(path)!r}")
        self.version = 1 if self.format == "ros1" else 2
        self.types: Any = typestore(self.version)
        self._overwrite = overwrite
        self._check_room()
        self._part = self.path.with_name(f"{self.path.name}.part")
        self._connections: dict[str, Any] = {}
        self._closed = False

        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self._part.exists():  # of a writer that was killed
            shutil.rmtree(self._part)
        self._part.mkdir()
        self._inner = self._part / (self.path.stem if suffix in _BY_SUFFIX and self.version == 2 else self.path.name)
        try:
            self._bag = self._opened()
        except BaseException:  # Ctrl-C among them: nothing is in it yet
            shutil.rmtree(self._part)
            raise

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
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
            Its last message is for those who come later, too: settings. In ROS 2: transient local.

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
            raise ValueError(f"type: expected a known message, got {type!r}; {check.near_names(type, self._names())}")
        if (known := self._connections.get(topic)) is not None:
            if known.msgtype != type:
                raise ValueError(f"type: expected {known.msgtype}, that of the topic {topic!r}, got {type}")
            return
        options: dict[str, Any] = {"typestore": self.types}
        if latched:
            options |= {"latching": 1} if self.version == 1 else {"offered_qos_profiles": [_transient_local()]}
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
            Default: that of the message (``__msgtype__``), or of the topic.

        Raises
        ------
        ValueError
            For a field that is missing, another type than that of the topic, or a time that the format does not have.

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
        if time > _LAST_NS[self.format]:
            raise ValueError(f"time_ns: expected at most {_LAST_NS[self.format]} in a bag of {self.format}, got {time}")
        known = self._connections.get(topic)
        name = type or getattr(message, "__msgtype__", None) or (None if known is None else known.msgtype)
        if name is None:
            raise ValueError(f"type: expected that of the message, got none for the topic {topic!r}")
        self.add_topic(topic, name)
        if not isinstance(message, self.types.types[name]):
            message = typed(self.types, name, message)
        pack = self.types.serialize_ros1 if self.version == 1 else self.types.serialize_cdr
        self._bag.write(self._connections[topic], time, pack(message, name))

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
            self._bag.close()
        except BaseException:
            self._bag.abort()  # a full disk: its part stays, readable as far as it got
            raise
        made = self._inner
        if self.path.suffix in _BY_SUFFIX and self.version == 2:
            made = self._inner / f"{self._inner.name}{self.path.suffix}"
        self._check_room()
        if self.path.is_dir():
            shutil.rmtree(self.path)
        made.replace(self.path)
        shutil.rmtree(self._part)

    def _opened(self) -> Any:
        """The writer of rosbags."""
        if self.version == 1:
            from rosbags.rosbag1 import Writer as Writer1

            bag: Any = Writer1(self._inner)
        else:
            from rosbags.rosbag2 import StoragePlugin, Writer

            bag = Writer(self._inner, version=9, storage_plugin=StoragePlugin[self.format.upper()])
        bag.open()
        return bag

    def _check_room(self) -> None:
        """Refuse to replace anything but a bag, and that without being told to."""
        if not self.path.exists():
            return
        is_bag = (self.path / "metadata.yaml").is_file() if self.path.is_dir() else self.path.suffix in _BY_SUFFIX
        if not is_bag:
            what = "a folder that is no bag" if self.path.is_dir() else "a file that is no bag"
            raise FileExistsError(errno.EEXIST, f"expected no such path, got {what}", str(self.path))
        if not self._overwrite:
            raise FileExistsError(
                errno.EEXIST, "expected no such path, got a bag; overwrite=True replaces it", str(self.path)
            )

    def _names(self) -> list[str]:
        return list(self.types.fielddefs)


def _transient_local() -> Any:
    """Quality of service of a latched topic: the last message, delivered for certain, also to those who come later."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    forever = QosTime(2147483647, 4294967295)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        forever,
        forever,
        QosLiveliness.AUTOMATIC,
        forever,
        False,
    )
