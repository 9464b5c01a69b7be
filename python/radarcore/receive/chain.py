"""The receiver's chain: from the ideal beat signal to the samples that it delivers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver


def receive(ideal: NDArray[Any], radar: Radar, start: float, *, seed: int) -> NDArray[Any]:
    """Cube as the radar's receiver delivers it, in the precision of the ideal one.

    The noise belongs to the seed and to the start of the frame [s]: any frame can be made again by itself.
    """
    receiver = radar.receiver or Receiver()
    time_bits = int(np.float64(start + 0.0).view(np.uint64))
    cube = receiver.receive(ideal, radar.waveform.sample_rate, np.random.default_rng([seed, time_bits]))
    single = ideal.dtype == np.complex64
    if np.iscomplexobj(cube):
        return cube.astype(np.complex64 if single else np.complex128, copy=False)
    return cube.astype(np.float32 if single else np.float64, copy=False)
