"""The receiver's chain: from the ideal beat signal to the samples that it delivers."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from radarcore import _core
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver


def receive(ideal: NDArray[Any], radar: Radar, start: float, *, seed: int) -> NDArray[Any]:
    """Cube as the radar's receiver delivers it, in the precision of the ideal one, whose memory it takes over.

    The noise belongs to the seed and to the start of the frame [s]: any frame can be made again by itself.
    """
    receiver = radar.receiver or Receiver()
    # White noise of an I/Q receiver has half of its power in either part.
    variance = receiver.noise_variance(radar.waveform.sample_rate) * (0.5 if receiver.output == "iq" else 1.0)
    return _core.receive(ideal, output=receiver.output, deviation=variance**0.5, seed=seed, start=start)
