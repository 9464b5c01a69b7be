"""Receiver: noise and output of the ideal beat signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.units import BOLTZMANN, NOISE_TEMPERATURE, power_from_db


@dataclass(frozen=True, kw_only=True)
class Receiver:
    """Output and noise of a receiver.

    Parameters
    ----------
    output : "iq" or "real"
        Complex samples, or only their real part as one mixer gives it.
    noise_figure_db : float, optional
        Noise figure [dB] at 290 K; None: no noise.
    """

    output: str = "iq"
    noise_figure_db: float | None = None

    def __post_init__(self) -> None:
        check.choice("output", self.output, ("iq", "real"))
        if self.noise_figure_db is not None:
            level = check.non_negative("noise_figure_db", self.noise_figure_db, "dB")
            object.__setattr__(self, "noise_figure_db", level)

    def noise_variance(self, sample_rate: float) -> float:
        """Noise power per sample [W]: ``k T F fs``, half of it for a real receiver."""
        if self.noise_figure_db is None:
            return 0.0
        power = BOLTZMANN * NOISE_TEMPERATURE * power_from_db(self.noise_figure_db) * sample_rate
        return power if self.output == "iq" else 0.5 * power

    def receive(
        self, beat_signal: NDArray[np.complex128], sample_rate: float, rng: np.random.Generator
    ) -> NDArray[np.complex128] | NDArray[np.float64]:
        """Samples as the receiver delivers them, in sqrt(W), same shape as the ideal complex signal."""
        variance = self.noise_variance(sample_rate)
        is_real = self.output == "real"
        if variance == 0.0:
            return np.ascontiguousarray(beat_signal.real) if is_real else beat_signal
        # In place: fresh memory costs as much as the numbers in it.
        noise = rng.standard_normal(beat_signal.shape if is_real else (*beat_signal.shape, 2))
        noise *= np.sqrt(variance if is_real else 0.5 * variance)
        noisy: NDArray[np.complex128] | NDArray[np.float64] = noise if is_real else noise.view(np.complex128)[..., 0]
        noisy += beat_signal.real if is_real else beat_signal
        return noisy
