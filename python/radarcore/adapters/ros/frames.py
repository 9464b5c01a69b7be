"""Samples of the ADC and range-velocity maps to and from messages of ROS.

No standard message holds samples. Here they are a ``std_msgs/Int16MultiArray`` per frame, codes of the ADC as they are,
or a ``Float32MultiArray`` for samples that are no codes; labels of the dimensions are frame, channel, chirp, sample
and, of complex samples, iq. Such messages have no header: their time is that of the bag, the start of the frame.
Settings stand once in a ``std_msgs/String``, on a latched topic or in the metadata of a file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.adapters.depth import unpacked
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.messages import Types, header, make, nearest_nanoseconds
from radarcore.radar.radar import Radar
from radarcore.recording.frame import (
    COUNTS,
    FULL_SCALE,
    TRUTH_FIELDS,
    Frame,
    Kind,
    Truth,
    check_alike,
    checked_codes,
    frame_shape,
    kind_of,
    to_samples,
    truth_of_rows,
    unit_of,
)
from radarcore.recording.native import meta_text, parsed_json, radar_from_json
from radarcore.recording.recording import Recording

_LABELS = ("frame", "channel", "chirp", "sample")
_IQ = "iq"

_ARRAYS = {"int16": "Int16", "float32": "Float32", "float64": "Float64"}
"""Name of a message by the type of its numbers."""


def to_samples_message(samples: Frame | NDArray[Any], *, types: Types = None) -> Any:
    """Samples as a ``std_msgs/Int16MultiArray``, or Float32MultiArray or Float64MultiArray for those that are no codes.

    Nothing is rounded: `from_samples_message` and `to_frame` give back every bit.

    Parameters
    ----------
    samples : Frame or array
        A frame, whose codes are sent if it has any; or integers, real or complex numbers
        ``[frame, channel, chirp, sample]``, or without the frames' axis.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    See Also
    --------
    adapters.ros.to_frame : The way back.
    adapters.ros.to_settings_message : Settings that belong to them.
    adapters.ros.FrameWriter : Both in a bag.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> message = rc.adapters.ros.to_samples_message(frame)
    >>> [(each.label, each.size) for each in message.layout.dim]
    [('channel', 3), ('chirp', 4), ('sample', 128)]
    """
    if isinstance(samples, Frame):
        samples = samples.cube if samples.raw is None else samples.raw
    values = np.asarray(samples)
    if values.ndim not in (3, 4):
        raise ValueError(f"samples: expected [channel, chirp, sample] or [frame, ...], got shape {values.shape}")
    labels = _LABELS[-values.ndim :]
    if values.dtype.kind == "c":
        values = np.ascontiguousarray(values).view(values.real.dtype).reshape(*values.shape, 2)
        labels = (*labels, _IQ)
    if values.dtype.kind in "iu":
        whole = values.astype(np.int16)
        if not np.array_equal(whole, values):
            raise ValueError(f"samples: expected integers of 16 bits, got {values.min()} to {values.max()}")
        values = whole
    if values.dtype.name not in _ARRAYS:
        raise TypeError(f"samples: expected integers, float32, float64 or complex numbers of these, got {values.dtype}")
    # A stride counts the numbers in one element of the dimension above.
    strides = np.cumprod(values.shape[::-1])[::-1].tolist()
    dimensions = [
        make(types, "std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
        for label, size, stride in zip(labels, values.shape, strides, strict=True)
    ]
    layout = make(types, "std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    name = f"std_msgs/msg/{_ARRAYS[values.dtype.name]}MultiArray"
    return make(types, name, layout=layout, data=np.ascontiguousarray(values).ravel())


def from_samples_message(message: Any) -> NDArray[Any]:
    """Samples of a ``std_msgs/Int16MultiArray`` or one of floating-point numbers, ``[frame, channel, chirp, sample]``.

    int16, float32 or float64, or complex numbers of these; int16 with I and Q become complex64.

    See Also
    --------
    adapters.ros.to_frame : A frame with its radar.
    adapters.ros.to_samples_message : The way back.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> samples = rc.adapters.ros.from_samples_message(rc.adapters.ros.to_samples_message(frame))
    >>> samples.dtype.name, (samples == frame.cube).all().item()
    ('float32', True)
    """
    layout = message.layout
    labels = tuple(str(dimension.label) for dimension in layout.dim)
    sizes = tuple(check.count("size", int(dimension.size), 0) for dimension in layout.dim)
    is_iq = labels[-1:] == (_IQ,)
    axes = labels[:-1] if is_iq else labels
    if axes not in (_LABELS, _LABELS[1:]) or (is_iq and sizes[-1] != 2):
        text = ", ".join(f"{label} {size}" for label, size in zip(labels, sizes, strict=True))
        raise ValueError(f"layout: expected frame, channel, chirp, sample (and iq 2), got {text or 'no dimensions'}")
    numbers = _numbers(message.data)[int(layout.data_offset) :]
    # As std_msgs/MultiArrayLayout has it, the first stride alone may tell more than the sizes do: padding.
    steps = [int(dimension.stride) for dimension in layout.dim[1:]] + [1]
    last = sum((size - 1) * step for size, step in zip(sizes, steps, strict=True))
    if 0 in sizes:
        values: NDArray[Any] = np.empty(sizes, numbers.dtype)
    elif min(steps) < 0 or last >= len(numbers):
        raise ValueError(f"data: expected at least {last + 1} numbers by the layout, got {len(numbers)}")
    else:
        places = [step * numbers.itemsize for step in steps]
        values = np.lib.stride_tricks.as_strided(numbers, sizes, places, writeable=False).copy()
    if is_iq:
        parts = values.astype(np.float32) if values.dtype.kind == "i" else values
        values = parts.view(np.result_type(parts.dtype, np.complex64))[..., 0]
    return values if labels[0] == _LABELS[0] else values[None]


def to_frame(message: Any, radar: Radar, time: float, *, cube_unit: str | None = None) -> Frame:
    """Frame of a radar from a message of its samples.

    Codes of an ADC of 12 bits become `Frame.raw`, and samples in full scale; other integers are float32 counts.

    Parameters
    ----------
    message : std_msgs/Int16MultiArray, Float32MultiArray or Float64MultiArray
        One frame, see `from_samples_message`.
    radar : Radar
        As `from_settings_message` gives it.
    time : float
        Start of the first chirp [s].
    cube_unit : str, optional
        As `from_settings_message` gives it: ``"full scale"`` of codes. Default: codes if the radar's receiver has them.

    See Also
    --------
    adapters.ros.from_settings_message : Radar and unit.
    adapters.ros.BagFrames : Frames of a bag.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> message = rc.adapters.ros.to_samples_message(frame)
    >>> again = rc.adapters.ros.to_frame(message, frame.radar, time=0.5)
    >>> again.time, (again.cube == frame.cube).all().item()
    (0.5, True)
    """
    samples = from_samples_message(message)
    if samples.shape != (expected := (1, *frame_shape(radar))):
        raise ValueError(f"message: expected shape {expected} [frame, channel, chirp, sample], got {samples.shape}")
    cube = samples[0]
    stats = {} if cube_unit is None else {"cube_unit": cube_unit}
    if cube.dtype.kind != "i":
        return Frame(cube, time, radar, stats=stats)
    receiver_has_codes = radar.receiver is not None and radar.receiver.has_codes
    if cube_unit == FULL_SCALE or (cube_unit is None and receiver_has_codes):
        codes = checked_codes(cube)
        return Frame(to_samples(codes), time, radar, raw=codes)
    return Frame(cube.astype(np.float32), time, radar, stats={"cube_unit": COUNTS} | stats)


def to_settings_message(source: Frame | Radar, *, cube_unit: str | None = None, types: Types = None) -> Any:
    """Settings of the radar and unit of its samples as a ``std_msgs/String`` of JSON, for a latched topic.

    From a frame, which knows its unit, or from a radar and `cube_unit`, as in `Recording.source`.

    See Also
    --------
    adapters.ros.from_settings_message : The way back.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> radar, unit = rc.adapters.ros.from_settings_message(rc.adapters.ros.to_settings_message(frame))
    >>> radar == frame.radar, unit
    (True, None)
    """
    radar, unit = (source.radar, cube_unit or unit_of(source)) if isinstance(source, Frame) else (source, cube_unit)
    text = json.dumps({"radar": radar.to_dict(), "cube_unit": unit})
    return make(types, "std_msgs/msg/String", data=text)


def from_settings_message(message: Any) -> tuple[Radar, str | None]:
    """Radar, and the unit of its samples as in ``Recording.source["cube_unit"]``; None: sqrt(W).

    See Also
    --------
    adapters.ros.to_settings_message : The way back.
    adapters.ros.to_frame : Takes both.

    Examples
    --------
    >>> message = rc.adapters.ros.to_settings_message(rc.bgt60tr13c(num_chirps=4), cube_unit="full scale")
    >>> radar, unit = rc.adapters.ros.from_settings_message(message)
    >>> radar.num_chirps, unit
    (4, 'full scale')
    """
    try:
        settings = json.loads(message.data)
        return Radar.from_dict(settings["radar"]), settings.get("cube_unit")
    except (json.JSONDecodeError, KeyError, TypeError, AttributeError) as error:
        got = check.printable(str(message.data)[:40])
        raise ValueError(f"data: expected settings of a radar as JSON, got {got!r} ({error})") from error


def to_map_image(values: ArrayLike, *, time_ns: int, frame_id: str = "radar", types: Types = None) -> Any:
    """Range-velocity map as a ``sensor_msgs/Image``, 32FC1: a row per velocity, the lowest on top, a column per range.

    Parameters
    ----------
    values : (doppler, range) array_like
        Real numbers, such as decibels; of `radarcore.range_doppler` its absolute value.
    time_ns : int
        Stamp [ns].
    frame_id : str
        Frame of the radar.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    See Also
    --------
    adapters.ros.from_map_image : The way back.
    range_doppler : The map.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> level = 20.0 * np.log10(np.abs(rc.range_doppler(frame)[0]))
    >>> message = rc.adapters.ros.to_map_image(level, time_ns=0)
    >>> message.encoding, message.height, message.width
    ('32FC1', 4, 65)
    """
    given = np.asarray(values)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"values: expected real numbers (np.abs of a spectrum), got {given.dtype}")
    if given.ndim != 2 or given.size == 0:
        raise ValueError(f"values: expected shape (doppler, range), got {given.shape}")
    pixels = np.ascontiguousarray(given, dtype="<f4")
    rows, columns = pixels.shape
    return make(
        types,
        "sensor_msgs/msg/Image",
        header=header(None, time_ns, frame_id, types),
        height=rows,
        width=columns,
        encoding="32FC1",
        is_bigendian=0,
        step=4 * columns,
        data=pixels.view(np.uint8).ravel(),
    )


def from_map_image(message: Any) -> NDArray[np.float32]:
    """Range-velocity map of a ``sensor_msgs/Image``, 32FC1: (doppler, range).

    See Also
    --------
    adapters.ros.to_map_image : The way back.

    Examples
    --------
    >>> message = rc.adapters.ros.to_map_image([[1.0, 2.0], [3.0, 4.0]], time_ns=0)
    >>> rc.adapters.ros.from_map_image(message).tolist()
    [[1.0, 2.0], [3.0, 4.0]]
    """
    if message.encoding != "32FC1":
        raise ValueError(f"encoding: expected 32FC1, got {message.encoding!r}")
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    kind = ">f4" if message.is_bigendian else "<f4"
    values = unpacked("data", message.data, kind, rows, columns, int(message.step))
    return values.astype(np.float32)


def _numbers(data: Any) -> NDArray[Any]:
    """Numbers of an array of any library, in the type that they were sent in: a list has forgotten it."""
    numbers = np.ascontiguousarray(data).ravel()
    if numbers.dtype.name in _ARRAYS:
        # A list of Float32MultiArray has become float64.
        single = numbers.astype(np.float32)
        is_list = not hasattr(data, "itemsize")
        return single if is_list and np.array_equal(single, numbers, equal_nan=True) else numbers
    if numbers.dtype.kind in "iu":
        return numbers.astype(np.int16)
    raise TypeError(f"data: expected int16, float32 or float64, got {numbers.dtype}")


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


def write_frames(bag: BagWriter, frames: Recording, *, topic: str = "/radar", start_ns: int = 0) -> None:
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
    for frame in frames:
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
