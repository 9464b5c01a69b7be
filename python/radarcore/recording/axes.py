"""Axes of arrays of samples: their names in the order of a file, brought into that of a recording.

Names are ``frame``, ``chirp``, ``sample``, ``rx``, ``tx`` (channels are ``tx * num_rx + rx``), ``channel`` (or ``rx``
alone) for all of them, and ``iq`` for an axis of two, real and imaginary part. ``name=length`` states a length as well;
lengths alone are those of ``channel, chirp, sample`` with ``frame`` before and ``iq`` behind where there are more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar

NAMES = ("frame", "tx", "rx", "channel", "chirp", "sample", "iq")
"""Names in the order that arrays are brought into."""

_WITHOUT_NAMES = {
    3: ("channel", "chirp", "sample"),
    4: ("frame", "channel", "chirp", "sample"),
    5: ("frame", "channel", "chirp", "sample", "iq"),
}
"""Axes of arrays that nobody named."""


class Axis(NamedTuple):
    """An axis by its name, and its length where that was given."""

    name: str
    length: int | None = None


def parsed(shape: str | Sequence[str | int]) -> tuple[Axis, ...]:
    """Axes of a text like ``"frame,rx,chirp,sample"``, ``"frame,rx=3,chirp=64,sample=128"`` or ``"100,3,64,128"``."""
    words = shape.split(",") if isinstance(shape, str) else list(map(str, shape))
    words = [word.strip() for word in words]
    if all(word.lstrip("-").isdigit() for word in words):
        names = _WITHOUT_NAMES.get(len(words))
        if names is None:
            raise ValueError(f"shape: expected 3 to 5 lengths [{', '.join(_WITHOUT_NAMES[5])}], got {shape!r}")
        axes = [Axis(name, _length(word, shape)) for name, word in zip(names, words, strict=True)]
    else:
        pairs = [word.partition("=") for word in words]
        axes = [Axis(name.strip(), _length(text, shape) if is_given else None) for name, is_given, text in pairs]
    names_given = [axis.name for axis in axes]
    for name in names_given:
        if name not in NAMES:
            raise ValueError(f"shape: expected names of axes, got {name!r}; {check.near_names(name, NAMES)}")
        if names_given.count(name) > 1:
            raise ValueError(f"shape: expected every axis once, got {name!r} twice in {shape!r}")
    if "tx" in names_given and "rx" not in names_given:
        raise ValueError(f"shape: expected rx beside tx, got {shape!r}")
    if "channel" in names_given and "rx" in names_given:
        raise ValueError(f"shape: expected either channel or rx, got {shape!r}")
    if "sample" not in names_given:
        raise ValueError(f"shape: expected an axis sample, got {shape!r}")
    return tuple(axes)


def _length(text: str, shape: object) -> int | None:
    """A length of a shape; None for -1: as many as there are."""
    if not text.strip().lstrip("-").isdigit() or (length := int(text)) == 0 or length < -1:
        raise ValueError(f"shape: expected a length, got {text.strip()!r} in {shape!r}")
    return None if length == -1 else length


def of_array(
    shape: tuple[int, ...], given: str | Sequence[str | int] | None, radar: Radar, path: Path
) -> tuple[Axis, ...]:
    """Axes of an array with a shape: those given, else frame, channel, chirp, sample or a frame alone."""
    if given is not None:
        axes = parsed(given)
        expected = tuple(_expected(axis, axes, radar) for axis in axes)
        if len(shape) == 1 and len(axes) > 1:  # numbers one after the other
            return _filled(shape[0], axes, expected, path)
    else:
        names = _WITHOUT_NAMES.get(len(shape), _WITHOUT_NAMES[4])
        axes = tuple(Axis(name) for name in names)
        expected = tuple(_expected(axis, axes, radar) for axis in axes)
    fits = len(shape) == len(axes) and all(
        want is None or want == length for want, length in zip(expected, shape, strict=True)
    )
    if not fits:
        names_text = ", ".join(axis.name for axis in axes)
        raise ValueError(
            f"{path}: expected shape {check.shape_text(expected)} [{names_text}] of the radar, "
            f"got {shape}{_advice(shape, radar) if given is None else ''}"
        )
    return tuple(Axis(axis.name, length) for axis, length in zip(axes, shape, strict=True))


def _filled(num_values: int, axes: tuple[Axis, ...], expected: tuple[int | None, ...], path: Path) -> tuple[Axis, ...]:
    """Axes whose one free length follows from the number of values."""
    rest = math.prod(length for length in expected if length is not None)
    free = [axis.name for axis, length in zip(axes, expected, strict=True) if length is None]
    if len(free) > 1 or num_values % rest or (not free and num_values != rest):
        names = ", ".join(axis.name for axis in axes)
        raise ValueError(f"{path}: expected shape {check.shape_text(expected)} [{names}], got {num_values} numbers")
    return tuple(Axis(axis.name, length or num_values // rest) for axis, length in zip(axes, expected, strict=True))


def _expected(axis: Axis, axes: tuple[Axis, ...], radar: Radar) -> int | None:
    """Length that an axis has by the radar or by what was given; None for any."""
    is_apart = any(other.name == "tx" for other in axes)
    lengths = {
        "tx": len(radar.tx),
        "rx": len(radar.rx) if is_apart else radar.num_channels,
        "channel": radar.num_channels,
        "chirp": radar.num_chirps,
        "sample": radar.waveform.num_samples,
        "iq": 2,
    }
    wanted = lengths.get(axis.name)
    if wanted is not None and axis.length not in (None, wanted):
        raise ValueError(f"shape: expected {axis.name} = {wanted} of the radar, got {axis.length}")
    return axis.length if wanted is None else wanted


def _advice(shape: tuple[int, ...], radar: Radar) -> str:
    """Message about an array in another order, with the order if only one fits."""
    names = _WITHOUT_NAMES.get(len(shape))
    if names is None:
        return "; say what its axes are, as shape='frame,rx,chirp,sample', --shape"
    axes = tuple(Axis(name) for name in names)
    lengths = {axis.name: _expected(axis, axes, radar) for axis in axes}
    fitting = [
        order
        for order in permutations(names)
        if all(lengths[name] in (None, length) for name, length in zip(order, shape, strict=True))
    ]
    if len(fitting) == 1:
        return f"; shape={','.join(fitting[0])!r} (--shape) would fit"
    return f"; say the order of its axes, as shape={','.join(names)!r}, --shape"


def in_order(values: NDArray[Any], axes: tuple[Axis, ...]) -> NDArray[Any]:
    """View of an array as (frame, tx, rx, chirp, sample), and iq behind where there is one; channels count as rx."""
    names = ["rx" if axis.name == "channel" else axis.name for axis in axes]
    order = [names.index(name) for name in NAMES if name in names]
    view = values.transpose(order)
    for place, name in enumerate(("frame", "tx", "rx", "chirp", "sample")):
        if name not in names:
            view = np.expand_dims(view, place)
    return view
