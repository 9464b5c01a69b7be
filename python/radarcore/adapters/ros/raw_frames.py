"""Frames of a radar in a bag: raw samples, times and truth, and once the settings.

There is no standard message for raw samples of a radar. Here every frame is on topics below one
name, all stamped alike:

=================== ============================== ======================================================
topic               message                        content
=================== ============================== ======================================================
``/radar/settings`` std_msgs/String, latched       JSON: radar, origin, names of the bodies
``/radar/adc``      std_msgs/Int16MultiArray       codes of the ADC [frame, channel, chirp, sample]
``/radar/samples``  std_msgs/Float32MultiArray     in place of codes: samples, I/Q with a last axis ``iq``;
                    or Float64MultiArray           of double precision
``/radar/time``     std_msgs/Float64               time of the frame [s], to the last bit
``/radar/truth``    std_msgs/Float64MultiArray     range, velocity, azimuth, elevation [field, body]
``/radar/lost``     std_msgs/Int32                 frames lost just before, where they were counted
=================== ============================== ======================================================
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.messages import Types, make
from radarcore.adapters.ros.samples import from_samples_message, to_samples_message
from radarcore.adapters.ros.stamps import nearest_nanoseconds
from radarcore.radar.radar import Radar
from radarcore.recording.frame import (
    TRUTH_FIELDS,
    Frame,
    Kind,
    Truth,
    check_alike,
    frame_shape,
    kind_of,
    to_samples,
    truth_of_rows,
    unit_of,
)
from radarcore.recording.native import meta_text, parsed_json, radar_from_json
from radarcore.recording.recording import Recording, RecordingReader

SETTINGS_TYPE = "std_msgs/msg/String"
TRUTH_TYPE = "std_msgs/msg/Float64MultiArray"

_TRUTH_AXES = ("field", "body")


def to_truth_message(truth: Truth, *, types: Types = None) -> Any:
    """Truth of a frame as a ``std_msgs/Float64MultiArray``: range, velocity, azimuth, elevation [field, body].

    See Also
    --------
    adapters.ros.from_truth_message : The way back.
    Truth : Where bodies are.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=4)).frame()
    >>> message = rc.adapters.ros.to_truth_message(frame.truth)
    >>> rc.adapters.ros.from_truth_message(message, ("ball",)).range.round(2).tolist()
    [2.0]
    """
    rows = np.array([getattr(truth, name) for name in TRUTH_FIELDS])
    sizes, strides = rows.shape, (rows.size, rows.shape[1])
    dimensions = [
        make(types, "std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
        for label, size, stride in zip(_TRUTH_AXES, sizes, strides, strict=True)
    ]
    layout = make(types, "std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    return make(types, TRUTH_TYPE, layout=layout, data=rows.ravel())


def from_truth_message(message: Any, names: tuple[str, ...]) -> Truth:
    """Truth of one frame, of bodies with `names`.

    See Also
    --------
    adapters.ros.to_truth_message : The way back.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=4)).frame()
    >>> message = rc.adapters.ros.to_truth_message(frame.truth)
    >>> rc.adapters.ros.from_truth_message(message, ("ball",)).names
    ('ball',)
    """
    found = {str(dimension.label): int(dimension.size) for dimension in message.layout.dim}
    expected = dict(zip(_TRUTH_AXES, (len(TRUTH_FIELDS), len(names)), strict=True))
    if found != expected:
        raise ValueError(f"layout: expected {expected}, got {found}")
    values = np.asarray(message.data, dtype=np.float64)[int(message.layout.data_offset) :]
    size = len(TRUTH_FIELDS) * len(names)
    if len(values) < size:
        raise ValueError(f"data: expected {size} numbers, got {len(values)}")
    return truth_of_rows(names, values[:size].reshape(len(TRUTH_FIELDS), len(names)).copy())


class FrameWriter:
    """Writes frames of a radar into a bag, one by one; nothing is kept in memory.

    Parameters
    ----------
    bag : BagWriter
        Not closed by this.
    radar : Radar
    source : dict, optional
        Origin of the frames: anything JSON can hold.
    topic : str
        Name in front of those of the topics.
    start_ns : int
        Stamp of time 0 of the frames [ns since 1970].

    See Also
    --------
    adapters.ros.write_frames : A whole recording.
    adapters.ros.BagFrames : Reads them again.

    Examples
    --------
    >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4))
    >>> with rc.adapters.ros.BagWriter("run") as bag:
    ...     writer = rc.adapters.ros.FrameWriter(bag, simulator.radar)
    ...     for frame in simulator.frames(0.0, 0.1):
    ...         writer.append(frame)
    >>> with rc.adapters.ros.BagReader("run") as bag:
    ...     print(sorted(bag.topics))
    ['/radar/samples', '/radar/settings', '/radar/time', '/radar/truth']
    """

    def __init__(
        self,
        bag: BagWriter,
        radar: Radar,
        *,
        source: dict[str, Any] | None = None,
        topic: str = "/radar",
        start_ns: int = 0,
    ) -> None:
        self._bag, self._radar, self._source = bag, radar, dict(source or {})
        self._topic = _base(topic)
        self._start_ns = check.count("start_ns", start_ns, 0)
        self._kind: Kind | None = None
        self._has_codes = False
        self._last: int | None = None
        meta_text(radar, self._source, None, None)  # refuses a source that JSON cannot hold
        bag.add_topic(f"{self._topic}/settings", SETTINGS_TYPE, latched=True)

    def append(self, frame: Frame) -> None:
        """Write a frame of the same radar, bodies and dtype as the first, after that before it."""
        check_alike("frame", frame, self._radar, self._kind)
        stamp = self._start_ns + nearest_nanoseconds(frame.time)
        if stamp < 0:
            raise ValueError(f"frame.time: expected a time after 1970 by start_ns, got {frame.time:g} s")
        if self._last is not None and stamp <= self._last:
            raise ValueError(f"frame.time: expected frames at least a nanosecond apart, got {frame.time:.15g} s")
        has_codes = frame.raw is not None and _same(to_samples(frame.raw), frame.cube)
        if self._kind is None:
            self._begin(frame, has_codes, stamp)
        if self._has_codes and not has_codes:
            raise ValueError("frame: expected samples of an ADC's codes as in the first frame, got others")
        self._last = stamp
        types = self._bag.types
        if (num_lost := frame.lost_before) is not None:
            self._write("lost", make(types, "std_msgs/msg/Int32", data=num_lost), stamp)
        self._write("time", make(types, "std_msgs/msg/Float64", data=frame.time), stamp)
        if frame.truth is not None:
            self._write("truth", to_truth_message(frame.truth, types=types), stamp)
        if self._has_codes:
            self._write("adc", to_samples_message(frame, types=types), stamp)
        else:
            self._write("samples", to_samples_message(frame.cube, types=types), stamp)

    def close(self) -> None:
        """Write the settings of a recording without frames; not needed after a frame."""
        if self._kind is None:
            self._write_settings(self._start_ns)

    def _begin(self, frame: Frame, has_codes: bool, stamp: int) -> None:
        """Write the settings."""
        self._kind, self._has_codes = kind_of(frame.cube, frame.truth), has_codes
        if (unit := unit_of(frame)) is not None:
            self._source.setdefault("cube_unit", unit)
        self._write_settings(stamp)

    def _write_settings(self, stamp: int) -> None:
        values = json.loads(meta_text(self._radar, self._source, None, self._kind))
        values["cube_unit"] = (
            None if self._has_codes else self._source.get("cube_unit")
        )  # as `from_settings_message` has it
        self._write("settings", make(self._bag.types, SETTINGS_TYPE, data=json.dumps(values)), stamp)

    def _write(self, name: str, message: Any, stamp: int) -> None:
        self._bag.write(f"{self._topic}/{name}", message, stamp)


def write_frames(
    bag: BagWriter, frames: Recording | RecordingReader, *, topic: str = "/radar", start_ns: int = 0
) -> None:
    """Write a recording into a bag, frame by frame; parameters are those of `FrameWriter`.

    See Also
    --------
    adapters.ros.FrameWriter : Frames one by one.
    adapters.ros.BagFrames : Reads them again.

    Examples
    --------
    >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4))
    >>> with rc.adapters.ros.BagWriter("run") as bag:
    ...     rc.adapters.ros.write_frames(bag, simulator.record(0.0, 0.1))
    >>> with rc.adapters.ros.BagReader("run") as bag:
    ...     print(len(rc.adapters.ros.BagFrames(bag)))
    4
    """
    writer = FrameWriter(bag, frames.radar, source=frames.source, topic=topic, start_ns=start_ns)
    for frame in frames.frames() if isinstance(frames, Recording) else frames:
        writer.append(frame)
    writer.close()


class BagFrames:
    """Frames of a radar in a bag, a few at a time in memory.

    Parameters
    ----------
    bag : BagReader
    topic : str
        Name in front of those of the topics.

    Attributes
    ----------
    radar : Radar
    source : dict
        Origin of the frames.

    Raises
    ------
    ValueError
        When the bag has no such frames, or its settings are damaged.

    See Also
    --------
    adapters.ros.write_frames : Writes them.
    adapters.ros.FrameWriter : Writes them one by one.

    Examples
    --------
    >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4))
    >>> with rc.adapters.ros.BagWriter("run") as bag:
    ...     rc.adapters.ros.write_frames(bag, simulator.record(0.0, 0.1))
    >>> with rc.adapters.ros.BagReader("run") as bag:
    ...     print([frame.cube.shape for frame in rc.adapters.ros.BagFrames(bag)])
    [(3, 4, 128), (3, 4, 128), (3, 4, 128), (3, 4, 128)]
    """

    def __init__(self, bag: BagReader, topic: str = "/radar") -> None:
        self._bag, self._topic = bag, _base(topic)
        name = bag.topic(f"{self._topic}/settings", SETTINGS_TYPE).name
        text = next((found.message.data for found in bag.messages(name)), None)
        where = f"{bag.path}, {name}"
        if text is None:
            raise ValueError(f"{where}: expected the settings of a radar, got no message")
        self.radar: Radar = radar_from_json(text, where)
        values = parsed_json(text, where)
        self.source: dict[str, Any] = dict(values.get("source") or {})
        self._unit = values.get("cube_unit")
        names = values.get("truth")
        self._bodies = None if names is None else tuple(map(str, names))
        self._samples = next(
            (known for end in ("adc", "samples") if (known := f"{self._topic}/{end}") in bag.topics), None
        )
        self._others = [
            f"{self._topic}/{end}" for end in ("time", "truth", "lost") if f"{self._topic}/{end}" in bag.topics
        ]

    def __len__(self) -> int:
        """Number of frames; in a bag that is cut, one may be incomplete."""
        return 0 if self._samples is None else self._bag.topics[self._samples].num_messages

    def __iter__(self) -> Iterator[Frame]:
        """The frames in order; warns of those of which a message is missing, but for the last one."""
        if self._samples is None:
            return
        needed = {self._samples, *self._others} - {f"{self._topic}/lost"}
        messages = self._bag.messages([self._samples, *self._others])
        num_incomplete, is_whole = 0, True
        for stamp, group in groupby(messages, key=lambda found: found.time_ns):
            num_incomplete += not is_whole  # the last frame of a bag that is cut does not count
            parts = {found.topic: found.message for found in group}
            if is_whole := needed <= parts.keys():
                yield self._frame({name.rpartition("/")[2]: part for name, part in parts.items()}, stamp)
        if num_incomplete > 0:
            notice.warn(
                f"{self._bag.path}: {num_incomplete} frames of {self._topic} left out: expected messages of "
                f"{', '.join(sorted(needed))} with the same stamp, got some of them"
            )

    def recording(self) -> Recording:
        """All frames in memory.

        See Also
        --------
        Recording.save : Other formats.

        Examples
        --------
        >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4))
        >>> with rc.adapters.ros.BagWriter("whole") as bag:
        ...     rc.adapters.ros.write_frames(bag, simulator.record(0.0, 0.1))
        >>> with rc.adapters.ros.BagReader("whole") as bag:
        ...     print(rc.adapters.ros.BagFrames(bag).recording().cube.shape)
        (4, 3, 4, 128)
        """
        frames = list(self)
        if not frames:
            kind = np.float32 if self.radar.is_real else np.complex64
            return Recording(np.zeros((0, *frame_shape(self.radar)), kind), np.zeros(0), self.radar, None, self.source)
        return Recording.from_frames(frames, self.source)

    def _frame(self, parts: dict[str, Any], stamp: int) -> Frame:
        try:
            time = float(parts["time"].data) if "time" in parts else 1e-9 * stamp
            stats: dict[str, Any] = {} if self._unit is None else {"cube_unit": self._unit}
            if "lost" in parts:
                stats["lost_before"] = int(parts["lost"].data)
            raw, truth = None, None
            if "adc" in parts:
                raw = from_samples_message(parts["adc"])[0].astype(np.uint16)
            cube = to_samples(raw) if raw is not None else from_samples_message(parts["samples"])[0]
            if "truth" in parts and self._bodies is not None:
                truth = from_truth_message(parts["truth"], self._bodies)
            return Frame(cube, time, self.radar, truth, stats, raw)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{self._bag.path}, {self._topic} at {stamp} ns: {error}") from error


def _same(samples: NDArray[np.float32], cube: NDArray[Any]) -> bool:
    return samples.dtype == cube.dtype and bool(
        (samples.view(np.uint32) == np.ascontiguousarray(cube).view(np.uint32)).all()
    )


def _base(topic: str) -> str:
    name = topic.rstrip("/")
    if not name.startswith("/") or not name.strip("/"):
        raise ValueError(f"topic: expected a name such as '/radar', got {topic!r}")
    return name
