"""Imbalance of I and Q."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.units import power_from_db


def unbalance(samples: NDArray[Any], gain_db: float | None, phase_deg: float | None) -> None:
    """Give Q another gain and phase, in place: Q becomes ``g (Q cos(phi) + I sin(phi))``.

    A tone then has an image at the opposite frequency, of the relative power
    ``(1 + g^2 - 2 g cos(phi)) / (1 + g^2 + 2 g cos(phi))``.
    """
    gain = power_from_db(gain_db or 0.0) ** 0.5
    angle = np.deg2rad(phase_deg or 0.0)
    samples.imag = (gain * np.cos(angle)) * samples.imag + (gain * np.sin(angle)) * samples.real
