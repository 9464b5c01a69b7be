"""Patterns of antenna arrays: gain of the transmitters, the receivers and both together over direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.processing.angles.steering import (
    checked_angles,
    steering_vectors,
    steering_weights,
    uniform_row,
)
from radarcore.processing.spectra.windows import Window, symmetric_window
from radarcore.radar.pattern import Pattern
from radarcore.radar.radar import Radar
from radarcore.units import decibels

Steer = ArrayLike | None
"""Azimuth, or azimuth and elevation, to steer to [rad]; None: straight ahead."""


@dataclass(frozen=True, eq=False)
class ArrayPattern:
    """Gain of an array over direction; -inf where there is none.

    Attributes
    ----------
    azimuth, elevation : float64
        Angles [rad], broadcast together.
    transmit_db : float64
        Transmitted power over an isotropic antenna with the same total power [dBi].
    receive_db : float64
        SNR of the weighted sum of the receivers over the SNR of one isotropic receiver [dBi].

    See Also
    --------
    array_pattern : Makes one.

    Examples
    --------
    >>> radar = rc.Radar(rc.bgt60tr13c().waveform, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]])
    >>> pattern = rc.array_pattern(radar, azimuth=[0.0])
    >>> print(f"{pattern.receive_db[0]:.2f} dBi, {pattern.two_way_db[0]:.2f} dB")
    3.01 dBi, 3.01 dB
    """

    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    transmit_db: NDArray[np.float64]
    receive_db: NDArray[np.float64]

    @property
    def two_way_db(self) -> NDArray[np.float64]:
        """Two-way gain of an echo [dB]: sum of both."""
        return self.transmit_db + self.receive_db


def array_pattern(
    radar: Radar,
    azimuth: ArrayLike,
    elevation: ArrayLike = 0.0,
    *,
    steer: Steer = None,
    tx_weights: ArrayLike | None = None,
    rx_weights: ArrayLike | None = None,
    tx_window: Window = None,
    rx_window: Window = None,
) -> ArrayPattern:
    """Gain over direction of all transmitters together, of all receivers together, and of both.

    N equal elements with equal weights have N times the gain of one element in the steered direction. Channels that
    are recorded separately follow the two-way pattern if they are added with the same weights.

    Parameters
    ----------
    radar : Radar
        Positions and patterns of the elements, and the wavelength.
    azimuth, elevation : array_like
        Angles [rad], positive to the left and up, broadcast together.
    steer : float or (float, float), optional
        Azimuth, or azimuth and elevation, where waves add up [rad]; applied in addition to weights and windows.
    tx_weights, rx_weights : (element,) array_like of complex, optional
        Default: 1.
    tx_window, rx_window : str, tuple or None
        Symmetric window over the elements of a uniform row, as `scipy.signal.get_window` names it, such as "taylor" or
        ``("chebwin", 40)``: lower side lobes and a wider main lobe.

    Returns
    -------
    pattern : ArrayPattern

    Raises
    ------
    ValueError, TypeError
        For weights of other shapes or all zero, and for windows over elements that do not form a uniform row.

    See Also
    --------
    processing.steering_weights : Weights that add an echo in phase.
    plot.array_pattern : Plots it.

    Examples
    --------
    >>> row = [[0.0, 2.5e-3 * k, 0.0] for k in range(8)]
    >>> radar = rc.Radar(rc.bgt60tr13c().waveform, rx=row)
    >>> pattern = rc.array_pattern(radar, np.deg2rad([0.0, 20.0]), steer=np.deg2rad(20.0))
    >>> pattern.receive_db.round(2).tolist()  # eight elements: 9 dB where it is steered to
    [-3.91, 9.03]
    """
    # Check all arguments before any work.
    check.instance("radar", radar, Radar)
    az, el = checked_angles(azimuth, elevation)
    to = _steered_to(steer)
    wavelength = radar.waveform.wavelength
    sides = (
        ("tx", radar.tx, radar.tx_patterns, tx_weights, tx_window),
        ("rx", radar.rx, radar.rx_patterns, rx_weights, rx_window),
    )
    levels = []
    for name, positions, patterns, given, window in sides:
        weights = _weights(name, given, len(positions)) * _window(f"{name}_window", window, positions)
        weights = weights * steering_weights(positions, wavelength, *to)
        levels.append(_gain_db(positions, patterns, weights, wavelength, az, el))
    return ArrayPattern(az, el, *levels)


def _steered_to(steer: Steer) -> tuple[float, float]:
    to: Any = (0.0, 0.0) if steer is None else (steer, 0.0) if np.ndim(steer) == 0 else steer
    azimuth, elevation = check.radians("steer", check.array("steer", to, (2,))).tolist()
    return azimuth, elevation


def _weights(name: str, given: ArrayLike | None, number: int) -> NDArray[np.complex128]:
    if given is None:
        return np.ones(number, np.complex128)
    weights = check.complex_numbers(f"{name}_weights", given, (number,))
    if not np.isfinite(weights).all() or not weights.any():
        raise ValueError(f"{name}_weights: expected finite numbers, not all of them zero, got {weights.tolist()}")
    return weights


def _window(name: str, window: Window, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric window over a uniform row, in the order of the elements."""
    weights = np.ones(len(positions))
    if window is None or len(positions) == 1:
        return weights
    if (row := uniform_row(positions)) is None:
        raise ValueError(f"{name}: expected elements at equal steps along a line, got others")
    weights[row[0]] = symmetric_window(name, window, len(positions))
    return weights


def _gain_db(
    positions: NDArray[np.float64],
    patterns: Sequence[Pattern],
    weights: NDArray[np.complex128],
    wavelength: float,
    az: NDArray[np.float64],
    el: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Power of the weighted sum of fields over the sum of the squared weights [dB]."""
    waves = steering_vectors(positions - positions.mean(axis=0), wavelength, unit_vectors(az, el))
    known: dict[Pattern, NDArray[np.float64]] = {p: np.sqrt(p.gain(az, el)) for p in dict.fromkeys(patterns)}
    fields = np.stack([known[pattern] for pattern in patterns], axis=-1)
    return decibels(np.abs((waves * fields) @ weights) ** 2 / np.sum(np.abs(weights) ** 2))
