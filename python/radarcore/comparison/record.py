"""Record of a comparison: its recordings on one time base, and its targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.comparison.echoes import EchoDifference
from radarcore.comparison.settings import Difference
from radarcore.comparison.statistics import TargetErrors
from radarcore.comparison.targets import Estimates, Found
from radarcore.comparison.time_base import Dropped, RecordingOffset
from radarcore.recording.frame import Truth
from radarcore.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Side:
    """One of the recordings of a comparison.

    Parameters
    ----------
    name : str
    found : Found
        The recording, its detections and tracks.
    offset : RecordingOffset
        Added to the times of the recording it gives those of the common base.
    dropped : tuple of Dropped
        Frames that are missing.
    time : (frame,) float64
        Middle of every frame, by the common base [s].
    truth : Truth
        Of all that is known to be there, at these times; what A has tracked if there is no truth.
    """

    name: str
    found: Found
    offset: RecordingOffset
    dropped: tuple[Dropped, ...]
    time: NDArray[np.float64]
    truth: Truth

    @property
    def recording(self) -> Recording:
        """The recording, by its own clock."""
        return self.found.recording

    @property
    def bins(self) -> tuple[float, float]:
        """Width of a bin of range and of velocity [m, m/s]."""
        return self.recording.radar.waveform.range_resolution, self.recording.radar.waveform.velocity_resolution


@dataclass(frozen=True, eq=False)
class TargetComparison:
    """One target of a comparison.

    Parameters
    ----------
    name : str
    estimates : tuple of Estimates
        Of every recording, by the common base.
    truth : tuple of (range, velocity) or None
        Of every recording, arrays (frame,) at the times of the estimates; None without truth.
    errors : tuple of TargetErrors
        Of every recording against the truth; empty without truth.
    difference : TargetErrors or None
        Of B against A, over the frames of B, A's estimates interpolated to their times; "visible" are those with an
        estimate of A. None without B.
    echo : EchoDifference or None
        Amplitudes and phases of B against A; None without B.
    """

    name: str
    estimates: tuple[Estimates, ...]
    truth: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...] | None
    errors: tuple[TargetErrors, ...]
    difference: TargetErrors | None
    echo: EchoDifference | None


@dataclass(frozen=True, eq=False)
class Record:
    """Recordings and truth side by side.

    Parameters
    ----------
    sides : tuple of Side
        Recording A, and B if there is one.
    targets : tuple of TargetComparison
    differences : tuple of Difference
        Settings in which the radars differ.
    truth_source : str
        Source of the truth, in words; empty without.
    """

    sides: tuple[Side, ...]
    targets: tuple[TargetComparison, ...]
    differences: tuple[Difference, ...]
    truth_source: str

    def __getitem__(self, name: str) -> TargetComparison:
        """The target of a name; KeyError for one that is not there."""
        for target in self.targets:
            if target.name == name:
                return target
        raise KeyError(f"no target {name!r}; {check.near_names(name, [target.name for target in self.targets])}")
