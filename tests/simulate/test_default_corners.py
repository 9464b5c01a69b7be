"""Corner reflectors in the default view, of any size in pixels, against the radar equation."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc


def corner_error_db(leg: float, place: list[float]) -> float:
    """Echo of a triangular corner at a place [m] over a point of its cross-section [dB], in the default view."""
    radar = replace(rc.bgt60tr13c(), receiver=rc.Receiver())
    wavelength = 299_792_458.0 / radar.waveform.center_frequency
    sigma = 4.0 * np.pi * leg**4 / (3.0 * wavelength**2)
    corner = rc.Body(
        rc.shapes.trihedral(leg), material=rc.materials["perfect_conductor"], motion=rc.Pose(place), name="corner"
    )
    powers = []
    for target in (corner, rc.PointTarget(place, rcs=sigma)):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".* (beyond max_unambiguous_range|ended at its finest cells)")
            frame = rc.Simulator(rc.Scene([target]), radar, max_bounces=3).frame()
        powers.append(np.mean(np.abs(frame.cube) ** 2))
    return float(10.0 * np.log10(powers[0] / powers[1]))


@pytest.mark.parametrize("leg", [0.05, 0.1, 0.2, 0.3])
def test_corners_in_the_default_view_have_the_echo_of_their_cross_section(leg: float) -> None:
    # Of any size in pixels: 5 cm at 30 m are a third of one. Far fields begin at 2 D^2 / lambda.
    wavelength = 299_792_458.0 / rc.bgt60tr13c().waveform.center_frequency
    for distance in (2.0, 10.0, 30.0):
        if distance >= 4.0 * leg**2 / wavelength:
            assert corner_error_db(leg, [distance, 0.02, 0.01]) == pytest.approx(0.0, abs=0.3), distance


def test_small_far_corner_has_its_echo_wherever_it_lies_in_a_pixel() -> None:
    # 0.11 dB rms of eight places; 0.27 with four times the default floor.
    errors = [corner_error_db(0.05, [30.0, 0.02 + 0.078 * step, 0.01 + 0.042 * step]) for step in range(4)]
    assert np.sqrt(np.mean(np.square(errors))) < 0.18
