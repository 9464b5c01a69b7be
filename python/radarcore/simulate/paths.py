"""Paths at one time, for whoever wants to look at them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Paths:
    """All paths from transmitter over scatterer to receiver at one time.

    Attributes
    ----------
    delay : (channel, path) float64
        Two-way delay [s].
    delay_rate : (channel, path) float64
        Its rate of change [s/s].
    amplitude : (channel, path) complex128
        Amplitude without the phase of propagation [sqrt(W)].
    body : (channel, path) int32
        Number of the body in the scene; of paths of several reflections that of the last.
    order : (channel, path) uint8
        Power of the frequency by which amplitudes fall; `amplitude` is that at the centre of the band. Edges have 1 or
        2, everything else 0.
    """

    delay: NDArray[np.float64]
    delay_rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]
    order: NDArray[np.uint8]
