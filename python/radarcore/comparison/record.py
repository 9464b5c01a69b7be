"""Record of a comparison: recordings on a common time base, targets, and differing settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.comparison.alignment import RecordingOffset
from radarcore.comparison.echoes import EchoDifference
from radarcore.comparison.targets import Dropped, Estimates, Found, TargetErrors
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Truth
from radarcore.recording.recording import Recording

_ROUNDING = 1e-9
"""Largest relative difference of equal numbers."""

_OF_WAVEFORM = {
    "start_frequency": "Hz",
    "slope": "Hz/s",
    "sample_rate": "Hz",
    "num_samples": "",
    "adc_delay": "s",
    "num_chirps": "",
    "chirp_interval": "s",
    "frame_interval": "s",
    "range_resolution": "m",
    "velocity_resolution": "m/s",
}
"""Settings of a waveform, and their units."""


class Difference(NamedTuple):
    """A differing setting: its name, and the values of A and B as texts with units."""

    name: str
    a: str
    b: str


def differences(a: Radar, b: Radar) -> tuple[Difference, ...]:
    """Differing settings of two radars, waveform settings first."""
    found = []
    for (name, unit, one), (_, _, other) in zip(_settings(a), _settings(b), strict=True):
        if not _same(one, other):
            found.append(Difference(name, _text(one, unit), _text(other, unit)))
    return tuple(found)


def _settings(radar: Radar) -> Iterator[tuple[str, str, Any]]:
    """Names, units and values."""
    for name, unit in _OF_WAVEFORM.items():
        yield name, unit, getattr(radar.waveform, name)
    yield "samples", "", "real" if radar.is_real else "I/Q"
    yield "transmitters [m]", "", _places(radar.tx)
    yield "receivers [m]", "", _places(radar.rx)
    yield "tx_power", "dBm", radar.tx_power_dbm
    yield "antenna pattern", "", "; ".join(dict.fromkeys(map(str, (*radar.tx_patterns, *radar.rx_patterns))))
    yield "receiver", "", _receiver(radar)


def _places(antennas: Any) -> str:
    return ", ".join("({:.6g} {:.6g} {:.6g})".format(*place) for place in antennas + 0.0)


def _receiver(radar: Radar) -> str:
    """Short description of the receiver: noise and codes."""
    receiver = radar.receiver
    if receiver is None:
        return "ideal"
    codes = f", codes of an ADC at {receiver.gain_db:g} dB" if receiver.has_codes else ""
    noise = "no noise" if receiver.noise_figure_db is None else f"noise figure {receiver.noise_figure_db:.3g} dB"
    return f"{noise}{codes}"


def _same(first: Any, second: Any) -> bool:
    if isinstance(first, float) and isinstance(second, float):
        return abs(first - second) <= _ROUNDING * max(abs(first), abs(second))
    return bool(first == second)


def _text(value: Any, unit: str) -> str:
    number = f"{value:.9g}" if isinstance(value, float) else str(value)
    return f"{number} {unit}".rstrip()


@dataclass(frozen=True, eq=False)
class Side:
    """One of the recordings of a comparison.

    Parameters
    ----------
    name : str
    found : Found
        The recording, its detections and tracks.
    offset : RecordingOffset
        Common time minus the recording's time.
    dropped : tuple of Dropped
        Missing frames.
    time : (frame,) float64
        Middle of every frame in common time [s].
    truth : Truth
        Of all known bodies at these times; without any truth, the tracks of A.
    """

    name: str
    found: Found
    offset: RecordingOffset
    dropped: tuple[Dropped, ...]
    time: NDArray[np.float64]
    truth: Truth

    @property
    def recording(self) -> Recording:
        """The recording, with times of its own clock."""
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
        Of every recording, in common time.
    truth : tuple of (range, velocity) or None
        Of every recording, arrays (frame,) at the times of the estimates; None without truth.
    errors : tuple of TargetErrors
        Of every recording against the truth; empty without truth.
    difference : TargetErrors or None
        Of B against A over the frames of B, with A interpolated to their times. A frame counts as visible if A has an
        estimate. None without B.
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
        """Target by name; raises KeyError for an unknown name."""
        for target in self.targets:
            if target.name == name:
                return target
        raise KeyError(f"no target {name!r}; {check.near_names(name, [target.name for target in self.targets])}")
