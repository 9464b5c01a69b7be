"""Frames of a radar as messages of ROS, one message a frame, and in bags.

No standard message holds samples of a radar; `cubes` has transformed frames. Here a frame is a
``radarcore_msgs/RadarFrame``, whose definition every MCAP file contains:

=================== ================================================================================
field               content
=================== ================================================================================
``header``          stamp: start of the frame to the nearest nanosecond
``time``            start of the frame [s], to the last bit
``dtype``           type of the samples as NumPy calls it: ``uint16`` (codes of the ADC), ``complex64``
``shape``           numbers of channels, chirps and samples
``data``            samples in this order, little-endian
``lost``            frames lost just before; -1: not counted
``truth``           range, velocity, azimuth and elevation of the bodies, [field, body]
``settings``        JSON: radar, source, names of the bodies
=================== ================================================================================
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from radarcore import check
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.messages import Types, header, make, nearest_nanoseconds
from radarcore.radar.radar import Radar
from radarcore.recording.frame import (
    CUBE_TYPES,
    TRUTH_FIELDS,
    Frame,
    Kind,
    check_alike,
    checked_codes,
    kind_of,
    to_samples,
    truth_of_rows,
    unit_of,
)
from radarcore.recording.native import Meta, meta_text
from radarcore.recording.recording import Recording

FRAME_TYPE = "radarcore_msgs/msg/RadarFrame"


def to_frame_message(
    frame: Frame,
    *,
    time_ns: int | None = None,
    source: dict[str, Any] | None = None,
    frame_id: str = "radar",
    types: Types = None,
) -> Any:
    """A frame as a ``radarcore_msgs/RadarFrame``; `from_frame_message` gives back every bit.

    Parameters
    ----------
    frame : Frame
        Its codes of an ADC are sent if it has any.
    time_ns : int, optional
        Stamp [ns]; default: the frame's time, to the nearest nanosecond.
    source : dict, optional
        Origin of the frame: anything JSON can hold.
    frame_id : str
        Frame of the radar.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    See Also
    --------
    adapters.ros.from_frame_message : The way back.
    adapters.ros.FrameWriter : Frames in a bag.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> message = rc.adapters.ros.to_frame_message(frame)
    >>> message.dtype, message.shape.tolist()
    ('float32', [3, 4, 128])
    """
    has_codes = frame.raw is not None and np.array_equal(to_samples(frame.raw), frame.cube)
    samples = frame.raw if frame.raw is not None and has_codes else frame.cube
    unit = unit_of(frame)
    source = ({} if unit is None else {"cube_unit": unit}) | (source or {})
    rows = np.array([] if frame.truth is None else [getattr(frame.truth, name) for name in TRUTH_FIELDS])
    little = np.ascontiguousarray(samples, samples.dtype.newbyteorder("<"))
    return make(
        types,
        FRAME_TYPE,
        header=header(frame.time, time_ns, frame_id, types),
        time=frame.time,
        dtype=samples.dtype.name,
        shape=np.array(samples.shape, np.uint32),
        data=little.reshape(-1).view(np.uint8),
        lost=-1 if frame.lost_before is None else frame.lost_before,
        truth=rows.ravel(),
        settings=meta_text(frame.radar, source, None, kind_of(frame.cube, frame.truth)),
    )


def from_frame_message(message: Any) -> Frame:
    """Frame of a ``radarcore_msgs/RadarFrame``.

    See Also
    --------
    adapters.ros.to_frame_message : The way back.
    adapters.ros.BagFrames : Frames of a bag.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> again = rc.adapters.ros.from_frame_message(rc.adapters.ros.to_frame_message(frame))
    >>> again.radar == frame.radar, (again.cube == frame.cube).all().item()
    (True, True)
    """
    settings = _settings(str(message.settings))
    dtype = check.choice("dtype", str(message.dtype), ("uint16", *CUBE_TYPES))
    shape = tuple(int(length) for length in message.shape)
    is_buffer = isinstance(message.data, bytes | bytearray | memoryview)
    data = np.frombuffer(message.data, np.uint8) if is_buffer else np.asarray(message.data, np.uint8)
    if data.size != (size := int(np.prod(shape)) * np.dtype(dtype).itemsize):
        raise ValueError(f"data: expected {size} bytes for {check.shape_text(shape)} samples, got {data.size}")
    samples = data.view(np.dtype(dtype).newbyteorder("<")).astype(dtype).reshape(shape)
    raw = checked_codes(samples) if dtype == "uint16" else None
    stats: dict[str, Any] = {} if message.lost < 0 else {"lost_before": int(message.lost)}
    if raw is None and (unit := settings.source.get("cube_unit")) is not None:
        stats["cube_unit"] = unit
    truth = None
    if settings.names is not None:
        rows = np.array(message.truth, np.float64)
        if rows.size != (number := len(TRUTH_FIELDS) * len(settings.names)):
            raise ValueError(f"truth: expected {number} numbers for {settings.names}, got {rows.size}")
        truth = truth_of_rows(settings.names, rows.reshape(len(TRUTH_FIELDS), -1))
    cube = samples if raw is None else to_samples(raw)
    return Frame(cube, float(message.time), settings.radar, truth, stats, raw)


@lru_cache(maxsize=8)  # all frames of a recording have the same
def _settings(text: str) -> Meta:
    return Meta.parse(text.encode(), "settings")


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
    ...     print(bag.topics["/radar"].num_messages)
    4
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
        self._bag, self._radar, self._source, self._topic = bag, radar, dict(source or {}), topic
        self._start_ns = check.count("start_ns", start_ns, 0)
        self._kind: Kind | None = None
        self._last: int | None = None
        meta_text(radar, self._source, None, None)  # refuses a source that JSON cannot hold
        bag.add_topic(topic, FRAME_TYPE)

    def append(self, frame: Frame) -> None:
        """Write a frame of the same radar, bodies and dtype as the first, after that before it."""
        check_alike("frame", frame, self._radar, self._kind)
        stamp = self._start_ns + nearest_nanoseconds(frame.time)
        if stamp < 0:
            raise ValueError(f"frame.time: expected a time after 1970 by start_ns, got {frame.time:g} s")
        if self._last is not None and stamp <= self._last:
            raise ValueError(f"frame.time: expected at least a nanosecond between frames, got {frame.time:.15g} s")
        message = to_frame_message(frame, time_ns=stamp, source=self._source, types=self._bag.types)
        self._bag.write(self._topic, message, stamp)
        self._kind, self._last = kind_of(frame.cube, frame.truth), stamp


def write_frames(bag: BagWriter, recording: Recording, *, topic: str = "/radar", start_ns: int = 0) -> None:
    """Write a recording into a bag, frame by frame; parameters as in `FrameWriter`.

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
    writer = FrameWriter(bag, recording.radar, source=recording.source, topic=topic, start_ns=start_ns)
    for frame in recording:
        writer.append(frame)


class BagFrames:
    """Frames of a radar in a bag, a few at a time in memory.

    Parameters
    ----------
    bag : BagReader
    topic : str

    Attributes
    ----------
    radar : Radar
    source : dict
        Origin of the frames.

    Raises
    ------
    ValueError
        When the bag has no such frames, or the first is damaged.

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
        self._bag, self._topic = bag, bag.topic(topic, FRAME_TYPE)
        first = next(bag.messages(self._topic.name), None)
        if first is None:
            raise ValueError(f"{bag.path}: expected frames on {self._topic.name}, got none")
        settings = _settings(first.message.settings)
        self.radar: Radar = settings.radar
        self.source: dict[str, Any] = settings.source

    def __len__(self) -> int:
        """Number of frames."""
        return self._topic.num_messages

    def __iter__(self) -> Iterator[Frame]:
        """The frames in order."""
        for found in self._bag.messages(self._topic.name):
            try:
                yield from_frame_message(found.message)
            except (ValueError, TypeError) as error:
                where = f"{self._bag.path}, {found.topic} at {found.time_ns} ns"
                raise ValueError(f"{where}: {error}") from error

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
        return Recording.from_frames(self, self.source)
