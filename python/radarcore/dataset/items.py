"""Pairs that a network learns from: what it sees of a frame, and its labels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.recording.frame import Frame

Item = tuple[NDArray[Any], dict[str, Any]]
"""Input of a network, and its labels."""

Output = Callable[[Frame], NDArray[Any]]
"""Function that makes the input of a network of a frame."""

_OUTPUTS: dict[str, Output] = {"cube": lambda frame: frame.cube, "range_doppler": range_doppler}


def checked_output(output: str | Output) -> str | Output:
    """A function, or the name of one that is known."""
    return output if callable(output) else check.choice("output", output, tuple(_OUTPUTS))


def output_of(output: str | Output) -> Output:
    """The function itself, which other processes would not find by its name."""
    return _OUTPUTS[output] if isinstance(output, str) else output
