"""Antenna patterns: power gain over azimuth and elevation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.units import power_from_db


@dataclass(frozen=True)
class IsotropicPattern:
    """The same gain in every direction."""

    gain_db: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain_db", check.number("gain_db", self.gain_db, "dB"))

    def gain(self, azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
        """Power gain (ratio) at angles in radians, broadcast together."""
        shape = np.broadcast(np.asarray(azimuth), np.asarray(elevation)).shape
        return np.full(shape, power_from_db(self.gain_db))

    @property
    def gaussian_parameters(self) -> tuple[float, float, float]:
        """Peak gain and the two exponents [1/rad^2] of ``g exp(-a az^2 - b el^2)``, as the core takes them."""
        return power_from_db(self.gain_db), 0.0, 0.0


@dataclass(frozen=True)
class GaussianPattern:
    """Gaussian beam ``G0 exp(-4 ln 2 [(az/BW_az)^2 + (el/BW_el)^2])``.

    Parameters
    ----------
    gain_db : float
        Power gain on boresight [dBi].
    beamwidth_azimuth_deg, beamwidth_elevation_deg : float
        Full widths at half power [degrees].
    """

    gain_db: float
    beamwidth_azimuth_deg: float
    beamwidth_elevation_deg: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain_db", check.number("gain_db", self.gain_db, "dB"))
        for name in ("beamwidth_azimuth_deg", "beamwidth_elevation_deg"):
            object.__setattr__(self, name, check.positive(name, getattr(self, name), "degrees"))

    def gain(self, azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
        """Power gain (ratio) at angles in radians, broadcast together."""
        peak, a, b = self.gaussian_parameters
        return np.asarray(peak * np.exp(-a * np.square(azimuth) - b * np.square(elevation)), dtype=np.float64)

    @property
    def gaussian_parameters(self) -> tuple[float, float, float]:
        """Peak gain and the two exponents [1/rad^2] of ``g exp(-a az^2 - b el^2)``, as the core takes them."""
        widths = np.deg2rad([self.beamwidth_azimuth_deg, self.beamwidth_elevation_deg])
        a, b = 4.0 * np.log(2.0) / widths**2
        return power_from_db(self.gain_db), float(a), float(b)


Pattern = IsotropicPattern | GaussianPattern
"""What `Radar` takes as an antenna pattern."""


def pattern_to_dict(pattern: Pattern) -> dict[str, Any]:
    """Kind and parameters of a pattern, for JSON."""
    return {"kind": "isotropic" if isinstance(pattern, IsotropicPattern) else "gaussian", **vars(pattern)}


def pattern_from_dict(values: dict[str, Any]) -> Pattern:
    """The pattern that `pattern_to_dict` described."""
    parameters = dict(values)
    kind = check.choice("pattern kind", parameters.pop("kind", None), ("isotropic", "gaussian"))
    return IsotropicPattern(**parameters) if kind == "isotropic" else GaussianPattern(**parameters)
