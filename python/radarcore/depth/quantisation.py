"""Quantisation of depth images, such as 16-bit millimetres and z-buffers, and the errors of phase it makes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.radar.waveform import Waveform
from radarcore.units import SPEED_OF_LIGHT

Values = NDArray[np.float64]

# Steps below this fraction of the largest value are rounding of single precision, and do not matter.
_SMALLEST = 4e-7
# Second differences of a quantised image are small multiples of the step.
_MOST_STEPS = 100.0
# Second differences above this fraction of the values are edges.
_EDGE = 0.01
# Least share of either sign among the smallest: steps go up and down, curved surfaces bend one way.
_LEAST_BOTH = 0.1
# Least share, and least number, of second differences that are multiples of the step ...
_LEAST_SHARE, _LEAST = 0.003, 50
# ... and least share of nonzero ones that are this close to whole multiples (0.4 of them would be by chance).
_LEAST_WHOLE, _WHOLE = 0.95, 0.2

# Steps that sensors write integers of [m]; how close to multiples of them how many different values have to be (by
# chance a fiftieth of them is).
_DECIMAL_STEPS = (1e-2, 1e-3, 1e-4)
_DECIMAL_SLACK, _LEAST_DISTINCT = 0.01, 5

# Quantisation that turns phases by more than this is worth a warning [degrees].
_PHASE_WARNING_DEG = 5.0


@dataclass(frozen=True)
class Quantisation:
    """Steps of a depth image: of the depth itself [m] and of its inverse, as in a z-buffer [1/m]; zero where none."""

    depth_step: float
    inverse_step: float
    deepest: float

    def at(self, depth: Values) -> Values:
        """Step at a depth [m]."""
        return self.depth_step + depth**2 * self.inverse_step

    @property
    def largest(self) -> float:
        """Step at the deepest pixel [m]."""
        return self.depth_step + self.deepest**2 * self.inverse_step

    def phase_error_deg(self, wavelength: float) -> float:
        """Error of the two-way phase at the deepest pixel, rms [degrees]."""
        return float(720.0 * self.largest / np.sqrt(12.0) / wavelength)


def find(depth: Values, slant: Values) -> Quantisation:
    """Steps of an image of depths, NaN where nothing returns; depth / slant is the planar depth."""
    step = _decimal_step(depth) or _uniform_step(depth)
    inverse_step = 0.0 if step > 0.0 else _uniform_step(slant / depth)
    is_known = np.isfinite(depth)
    return Quantisation(step, inverse_step, float(depth.max(initial=0.0, where=is_known)))


def relative_noise(given: NDArray[Any], depth: Values, steps: Quantisation) -> Values:
    """Uncertainty of every depth relative to itself: type of the numbers and steps."""
    rounding = 4.0 * np.finfo(given.dtype).eps if given.dtype.kind == "f" else 0.0
    known = np.where(np.isfinite(depth), depth, 1.0)
    return np.maximum(max(rounding, 1e-12), steps.at(known) / known)


def warn_of(steps: Quantisation, waveform: Waveform, interval: float | None) -> None:
    """Warn when quantisation makes large errors of phase, at once or by velocities from differences."""
    wavelength = waveform.wavelength
    phase = steps.phase_error_deg(wavelength)
    if phase > _PHASE_WARNING_DEG:
        notice.warn(
            f"distance: quantised in steps of up to {1e6 * steps.largest:.3g} um, {phase:.0f} degrees of phase (rms) "
            f"at {1e-9 * SPEED_OF_LIGHT / wavelength:.1f} GHz: expect false echoes and useless Doppler",
        )
    if interval is None:
        return
    drift = np.sqrt(2.0) * phase * waveform.duration / interval
    if drift > _PHASE_WARNING_DEG:
        speed = np.sqrt(2.0 / 12.0) * steps.largest / interval
        notice.warn(
            f"previous: velocities from quantised depths have errors of {speed:.2g} m/s (rms), "
            f"{drift:.0f} degrees of phase within the frame",
        )


def _decimal_step(depth: Values) -> float:
    """Step of an image in whole millimetres or the like, on surfaces of any shape; zero where there is none."""
    distinct = np.unique(depth[np.isfinite(depth)])
    if len(distinct) < _LEAST_DISTINCT:
        return 0.0
    for step in _DECIMAL_STEPS:
        count = distinct / step
        if (np.abs(count - np.round(count)) < _DECIMAL_SLACK).mean() >= 1.0 - _DECIMAL_SLACK:
            return step
    return 0.0


def _uniform_step(values: Values) -> float:
    """Step that all values are multiples of, but for an offset; zero where there is none.

    Seen from the second differences along rows and columns: those of a plane are zero if it is not quantised, although
    its values may be evenly spaced.
    """
    bends = np.concatenate([np.diff(values, 2, axis=axis).ravel() for axis in (0, 1)])
    bends = bends[np.isfinite(bends)]
    largest = np.max(values, initial=0.0, where=np.isfinite(values))
    size = np.abs(bends)
    multiples = bends[(size > _SMALLEST * largest) & (size < _EDGE * largest)]
    step = float(np.abs(multiples).min(initial=np.inf))
    few = multiples[np.abs(multiples) < _MOST_STEPS * step]
    if len(few) < max(_LEAST, _LEAST_SHARE * len(bends)):
        return 0.0
    count = np.round(few / step)
    is_small = np.abs(count) <= 4.0
    if min((count[is_small] > 0.0).sum(), (count[is_small] < 0.0).sum()) < _LEAST_BOTH * is_small.sum():
        return 0.0  # evenly curved, not quantised
    step = float((few * count)[is_small].sum() / (count**2)[is_small].sum())
    is_whole = np.abs(few / step - np.round(few / step)) < _WHOLE
    return step if is_whole.mean() >= _LEAST_WHOLE else 0.0
