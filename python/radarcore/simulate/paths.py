"""Propagation paths at one time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths from transmitter over scatterer to receiver at one time.

    Attributes
    ----------
    delay : (channel, path) float64
        Two-way delay [s].
    delay_rate : (channel, path) float64
        Rate of change of the delay [s/s].
    amplitude : (channel, path) complex128
        Amplitude without the phase of propagation [sqrt(W)].
    body : (channel, path) int32
        Index of the body in the scene; for several reflections of the last body.
    order : (channel, path) uint8
        Exponent n of amplitudes that fall with frequency^-n; `amplitude` holds at the centre of the band. 1 for
        edges and mirror images of flat surfaces, 2 for their corners, 0 for all others.

    See Also
    --------
    Simulator.paths : Makes them.
    beat_signal : Samples of paths.

    Examples
    --------
    >>> target = rc.PointTarget([3.0, 0.0, 0.0], velocity=[-1.0, 0.0, 0.0])
    >>> paths = rc.Simulator(rc.Scene([target]), rc.bgt60tr13c(num_chirps=16)).paths()
    >>> print(f"{paths.delay_rate[0, 0] * 299792458.0 / 2.0:.3f} m/s")
    -1.000 m/s
    """

    delay: NDArray[np.float64]
    delay_rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]
    order: NDArray[np.uint8]
