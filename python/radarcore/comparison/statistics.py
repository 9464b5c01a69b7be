"""Statistics of errors: of ranges and velocities of one target over the frames of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

RANGE_LIMIT, VELOCITY_LIMIT = 0.5, 1.0
"""Errors below which frames are counted [bins]."""


@dataclass(frozen=True)
class Errors:
    """Errors of a quantity, in its unit, over the frames in which it is both known and estimated.

    Parameters
    ----------
    bias : float
        Median of the errors, with their signs.
    median, rms, largest : float
        Of their magnitudes; NaN without any.
    bin_width : float
        Width of a bin of the waveform, in the same unit.
    num_within : int
        Frames with an error below the limit: half a range bin, one velocity bin.
    """

    bias: float
    median: float
    rms: float
    largest: float
    bin_width: float
    num_within: int

    @property
    def median_bins(self) -> float:
        """`median` in bins."""
        return self.median / self.bin_width

    @property
    def rms_bins(self) -> float:
        """`rms` in bins."""
        return self.rms / self.bin_width

    @property
    def largest_bins(self) -> float:
        """`largest` in bins."""
        return self.largest / self.bin_width


@dataclass(frozen=True)
class TargetErrors:
    """Accuracy of one target over a recording.

    Parameters
    ----------
    name : str
    num_frames : int
        Frames in which the target was visible: its truth is known.
    num_tracked : int
        Visible frames in which a track followed the target.
    num_tracks : int
        Tracks that followed the target, side by side or one after the other.
    range, velocity : Errors
        Over the visible frames in which it was tracked [m, m/s].
    """

    name: str
    num_frames: int
    num_tracked: int
    num_tracks: int
    range: Errors
    velocity: Errors

    @property
    def range_share(self) -> float:
        """Part of the visible frames with a range error below half a bin; NaN if it was never visible."""
        return self.range.num_within / self.num_frames if self.num_frames > 0 else np.nan

    @property
    def velocity_share(self) -> float:
        """Part of the visible frames with a velocity error below one bin; NaN if it was never visible."""
        return self.velocity.num_within / self.num_frames if self.num_frames > 0 else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        errors = {
            f"{quantity}_error": {
                name: getattr(part, name)
                for name in ("bias", "median", "rms", "largest", "median_bins", "rms_bins", "largest_bins")
            }
            for quantity, part in (("range", self.range), ("velocity", self.velocity))
        }
        return {
            "name": self.name,
            "num_frames": self.num_frames,
            "num_tracked": self.num_tracked,
            "num_tracks": self.num_tracks,
            "num_range_within": self.range.num_within,
            "num_velocity_within": self.velocity.num_within,
            **errors,
        }


def target_errors(
    name: str,
    estimated: tuple[_Floats, _Floats],
    true: tuple[_Floats, _Floats],
    bins: tuple[float, float],
    num_tracks: int,
) -> TargetErrors:
    """Errors of estimates of range and velocity, (frame,) each, against the truth of the same frames.

    Parameters
    ----------
    name : str
    estimated, true : (range, velocity)
        Arrays (frame,) [m, m/s]; NaN where they are not known.
    bins : (float, float)
        Widths of a bin of range and of velocity [m, m/s].
    num_tracks : int
        As in `TargetErrors`.
    """
    is_visible = np.isfinite(true[0])
    is_tracked = is_visible & np.isfinite(estimated[0])
    parts = [
        _errors((estimated[k] - true[k])[is_tracked], bins[k], limit)
        for k, limit in enumerate((RANGE_LIMIT, VELOCITY_LIMIT))
    ]
    return TargetErrors(name, int(is_visible.sum()), int(is_tracked.sum()), num_tracks, *parts)


def _errors(errors: _Floats, bin_width: float, limit: float) -> Errors:
    known = errors[np.isfinite(errors)]
    if len(known) == 0:
        return Errors(*(np.nan,) * 4, bin_width=bin_width, num_within=0)
    sizes = np.abs(known)
    return Errors(
        bias=float(np.median(known)),
        median=float(np.median(sizes)),
        rms=float(np.sqrt(np.mean(np.square(known)))),
        largest=float(sizes.max()),
        bin_width=bin_width,
        num_within=int((sizes < limit * bin_width).sum()),
    )
