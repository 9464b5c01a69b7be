"""Transformed frames as ``edgefirst_msgs/RadarCube``, the message of EdgeFirst's radar nodes.

Definition: EdgeFirst schemas, ``edgefirst_msgs/msg/RadarCube.msg``. The last length of ``shape`` counts real and
imaginary parts separately; ``scales`` has the width of a bin of every axis, 1 where an axis counts (EdgeFirst radarpub,
``format_cube``: sequence, range [m], channel, doppler [m/s]). The message has neither a radar nor a unit of its values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.adapters.ros.messages import Types, header, header_nanoseconds, make

CUBE_TYPE = "edgefirst_msgs/msg/RadarCube"

AXES = ("undefined", "range", "doppler", "azimuth", "elevation", "channel", "sequence")
"""Axes by the number that the message gives them."""

_INT16 = np.iinfo(np.int16)


@dataclass(frozen=True)
class RadarCube:
    """Content of a ``edgefirst_msgs/RadarCube``.

    Parameters
    ----------
    values : array
        complex64, or int16 of real cubes, with one axis for each of `axes`.
    axes : tuple of str
        ``"range"``, ``"doppler"``, ``"azimuth"``, ``"elevation"``, ``"channel"``, ``"sequence"``, ``"undefined"``.
    scales : tuple of float
        Width of a bin of every axis, in the unit of the sender: m and m/s of EdgeFirst's nodes.
    time_ns : int
        Stamp [ns since 1970].
    timestamp : int
        Clock of the radar, in its unit: microseconds of EdgeFirst's nodes.
    """

    values: NDArray[Any]
    axes: tuple[str, ...]
    scales: tuple[float, ...]
    time_ns: int = 0
    timestamp: int = 0


def to_cube_message(
    values: ArrayLike,
    axes: Sequence[str],
    scales: Sequence[float],
    *,
    time_ns: int,
    timestamp: int = 0,
    frame_id: str = "radar",
    types: Types = None,
) -> Any:
    """Values as a ``edgefirst_msgs/RadarCube``: rounded to int16, real and imaginary parts.

    Scale them before so that the largest part is near 32767.

    Parameters
    ----------
    values : array
        Real or complex, such as ``range_doppler`` of a frame, ``[channel, doppler, range]``.
    axes, scales, time_ns, timestamp
        See `radarcore.adapters.ros.cubes.RadarCube`.
    frame_id : str
        Frame of the radar.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    Raises
    ------
    ValueError
        For other names of axes, numbers of axes or scales that do not fit, and values outside int16.

    See Also
    --------
    adapters.ros.from_cube_message : The way back.
    adapters.ros.to_frame_message : Samples to the last bit, with their radar.

    Examples
    --------
    >>> message = rc.adapters.ros.to_cube_message([[1 + 2j, 3 - 4j]], ["channel", "range"], [1.0, 0.04], time_ns=0)
    >>> message.shape.tolist(), message.cube.tolist()
    ([1, 4], [1, 2, 3, -4])
    """
    given = np.asarray(values)
    numbers = [AXES.index(check.choice("axes", name, AXES)) for name in axes]
    if not given.ndim == len(numbers) == len(scales) > 0:
        raise ValueError(f"axes: expected a name and a scale per axis of {check.shape_text(given.shape)} values")
    is_complex = np.iscomplexobj(given)
    if is_complex:
        given = np.stack([given.real, given.imag], axis=-1).reshape(*given.shape[:-1], -1)
    parts = np.rint(given)
    if not ((parts >= _INT16.min) & (parts <= _INT16.max)).all():
        raise ValueError(f"values: expected parts within {_INT16.min} to {_INT16.max}, got others; scale them first")
    if max(parts.shape) > np.iinfo(np.uint16).max:
        raise ValueError(f"values: expected lengths within 16 bits, got {check.shape_text(parts.shape)}")
    return make(
        types,
        CUBE_TYPE,
        header=header(None, time_ns, frame_id, types),
        timestamp=timestamp,
        layout=np.array(numbers, np.uint8),
        shape=np.array(parts.shape, np.uint16),
        scales=np.array(scales, np.float32),
        cube=parts.astype(np.int16).ravel(),
        is_complex=is_complex,
    )


def from_cube_message(message: Any) -> RadarCube:
    """Content of a ``edgefirst_msgs/RadarCube``.

    Raises
    ------
    ValueError
        When lengths, numbers and labels do not fit together.

    See Also
    --------
    adapters.ros.to_cube_message : The way back.
    adapters.ros.from_frame_message : Samples with their radar.

    Examples
    --------
    >>> message = rc.adapters.ros.to_cube_message([[1 + 2j, 3 - 4j]], ["channel", "range"], [1.0, 0.5], time_ns=7)
    >>> cube = rc.adapters.ros.from_cube_message(message)
    >>> cube.values.tolist(), cube.axes, cube.scales
    ([[(1+2j), (3-4j)]], ('channel', 'range'), (1.0, 0.5))
    """
    # A ROS 2 that is installed has arrays of bytes as `bytes`.
    labels, shape = list(bytes(message.layout)), tuple(int(length) for length in message.shape)
    parts = np.asarray(message.cube, np.int16)
    if parts.size != (size := int(np.prod(shape))):
        raise ValueError(f"cube: expected {size} numbers for {check.shape_text(shape)}, got {parts.size}")
    if not len(labels) == len(shape) == len(message.scales) > 0:
        got = f"{len(labels)} labels and {len(message.scales)} scales of {len(shape)} axes"
        raise ValueError(f"layout: expected a label and a scale per axis, got {got}")
    if max(labels) >= len(AXES):
        raise ValueError(f"layout: expected labels of 0 to {len(AXES) - 1}, got {max(labels)}")
    values: NDArray[Any] = parts.reshape(shape)
    if message.is_complex:
        if shape[-1] % 2:
            raise ValueError(f"shape: expected an even last length of complex values, got {shape[-1]}")
        values = (values[..., 0::2] + 1j * values[..., 1::2]).astype(np.complex64)
    axes = tuple(AXES[label] for label in labels)
    scales = tuple(float(scale) for scale in message.scales)
    return RadarCube(values, axes, scales, header_nanoseconds(message) or 0, int(message.timestamp))
