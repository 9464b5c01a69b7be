"""Thermal noise of the receiver."""

from __future__ import annotations

import struct
from typing import Any

from numpy.typing import NDArray

from radarcore import _core


def add_noise(cube: NDArray[Any], variance: float, *, seed: int, start: float) -> None:
    """Add white noise of a power per sample [W] to a contiguous cube, in place.

    The noise is independent for every seed and every start of a frame [s].
    """
    if variance == 0.0:
        return
    is_complex = cube.dtype.kind == "c"
    deviation = (0.5 * variance if is_complex else variance) ** 0.5
    # The bits of the start; those of -0.0 are not those of 0.0.
    (stream,) = struct.unpack("<Q", struct.pack("<d", start + 0.0))
    samples = cube.reshape(-1)
    _core.add_noise(samples.view(samples.real.dtype), deviation=deviation, seed=seed, stream=stream)
