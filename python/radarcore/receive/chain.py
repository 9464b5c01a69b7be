"""The receiver's chain: from the ideal beat signal to the samples that it delivers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.receive.noise import add_noise


def receive(ideal: NDArray[Any], radar: Radar, start: float, *, seed: int) -> NDArray[Any]:
    """Cube as the radar's receiver delivers it, in the precision of the ideal one, whose memory it takes over.

    The noise belongs to the seed and to the start of the frame [s]: any frame can be made again by itself.
    """
    receiver = radar.receiver or Receiver()
    cube = ideal if receiver.output == "iq" else np.ascontiguousarray(ideal.real)
    add_noise(cube, receiver.noise_variance(radar.waveform.sample_rate), seed=seed, start=start)
    return cube
