"""Receiver: noise and output of the ideal beat signal."""

from __future__ import annotations

from dataclasses import dataclass

from radarcore import check
from radarcore.radar.levels import level
from radarcore.units import BOLTZMANN, NOISE_TEMPERATURE, power_from_db


@check.knows_keywords
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
            check.non_negative("noise_figure_db", self.noise_figure_db, "dB")
            object.__setattr__(self, "noise_figure_db", level("noise_figure_db", self.noise_figure_db))

    def noise_variance(self, sample_rate: float) -> float:
        """Noise power per sample [W]: ``k T F fs``, half of it for a real receiver."""
        if self.noise_figure_db is None:
            return 0.0
        power = BOLTZMANN * NOISE_TEMPERATURE * power_from_db(self.noise_figure_db) * sample_rate
        return power if self.output == "iq" else 0.5 * power
