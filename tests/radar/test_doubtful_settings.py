"""Settings of a radar that are hardly meant warn once, at the user's line; those that cannot be meant are refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc

SETTINGS: dict[str, Any] = {"start_frequency": 60e9, "slope": 2e13, "sample_rate": 2e6, "num_samples": 64}
WAVEFORM = rc.Waveform(**SETTINGS)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rc.Waveform(**SETTINGS | {"slope": 8e14}), r"slope: .* 30 % of .* 7.28e\+10 Hz, got 2.56e\+10 Hz"),
        (lambda: rc.Waveform(**SETTINGS | {"sample_rate": 500.0, "slope": 1e9}), "sample_rate: .* 0.1 s, got 0.128 s"),
        (lambda: rc.Radar(WAVEFORM, tx=[[0, 0, 0], [0, 2.5, 0]]), r"tx, rx: .* 100 wavelengths .* got 2.5 m"),
        (lambda: rc.IsotropicPattern(10.0), "gain_db: expected at most 3.01 dBi in all directions.*, got 10 dBi"),
        (lambda: rc.GaussianPattern(20.0, 30.0, 30.0), "gain_db: .* at most 16.2 dBi over 30 x 30 degrees.*, got 20"),
        (lambda: rc.TabulatedPattern([-1.0, 1.0], [-1.0, 1.0], np.full((2, 2), 9.0)), "gain_db: .*table.* got 9 dBi"),
    ],
    ids=["bandwidth", "long chirp", "aperture", "isotropic", "beam", "table"],
)
def test_what_is_hardly_meant_warns_at_the_line_that_says_it(make: Callable[[], object], message: str) -> None:
    with pytest.warns(UserWarning, match=message) as caught:
        make()
    assert [warning.filename for warning in caught] == [__file__]


@pytest.mark.parametrize("beamwidth", [1.0, 10.0, 50.0, 90.0])
def test_beam_that_radiates_just_what_it_is_fed_with_does_not_warn(beamwidth: float) -> None:
    # Closed form for narrow beams: 4 pi over the integral of the Gaussian; wide beams lose less to the cosine.
    width = np.deg2rad(beamwidth)
    gain_db = 10.0 * np.log10(16.0 * np.log(2.0) / width**2)
    rc.GaussianPattern(gain_db, beamwidth, beamwidth)
    with pytest.warns(UserWarning, match="gain_db: expected at most"):
        rc.GaussianPattern(gain_db + 3.5, beamwidth, beamwidth)


@pytest.mark.parametrize("frequency", [60.0, 60e6, 60e12])
def test_frequencies_in_other_units_are_refused(frequency: float) -> None:
    with pytest.raises(ValueError, match=r"start_frequency: expected 1e8 to 3e12 \[Hz\] \(60 GHz is 60e9\), got 6"):
        rc.Waveform(**SETTINGS | {"start_frequency": frequency, "slope": 1.0})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"start_frequency": 77e9, "stop_frequency": 78e9}, "start_frequency: expected 5.7e.*got 7.7e"),
        ({"stop_frequency": 77e9}, r"stop_frequency: expected 5.7e\+10 to 6.4e\+10 \[Hz\] of a BGT60TR13C, got 7.7e"),
        ({"slope": 1e15}, "slope, end of the ramp: expected 5.7e.*, got 1.27"),
    ],
)
def test_chip_at_frequencies_that_it_does_not_reach_is_refused(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rc.bgt60tr13c(**settings)


def test_unknown_keyword_of_a_preset_names_the_near_one() -> None:
    with pytest.raises(TypeError, match=r"bgt60tr13c: unknown keyword 'stop_freqency'; .*'stop_frequency'"):
        rc.bgt60tr13c(stop_freqency=61e9)
