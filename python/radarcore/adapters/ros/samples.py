"""Samples of the ADC and range-velocity maps to and from messages of ROS.

No standard message holds samples. Here they are a ``std_msgs/Int16MultiArray`` per frame, codes of the ADC as they are,
or a ``Float32MultiArray`` for samples that are no codes; labels of the dimensions are frame, channel, chirp, sample
and, of complex samples, iq. Such messages have no header: their time is that of the bag, the start of the frame.
Settings stand once in a ``std_msgs/String``, on a latched topic or in the metadata of a file.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.adapters.planar_depth import unpacked
from radarcore.adapters.ros.messages import Types, header, make
from radarcore.radar.radar import Radar
from radarcore.recording.frame import COUNTS, FULL_SCALE, Frame, checked_codes, frame_shape, to_samples, unit_of

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
