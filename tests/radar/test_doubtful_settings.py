"""Implausible settings of a radar warn once, at the user's line; impossible ones raise errors."""

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
