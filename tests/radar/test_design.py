"""Waveforms from requirements: possible ones are met, conflicts are named with the limit."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import radarcore as rc

C = 299_792_458.0
UP, DOWN = ("max_range", "max_velocity", "rate"), ("range_resolution", "velocity_resolution")
ROUNDING = 1e-9


def has(waveform: rc.Waveform, requirement: str) -> float:
    return 1.0 / waveform.frame_interval if requirement == "rate" else float(getattr(waveform, requirement))


def meets(waveform: rc.Waveform, requirements: dict[str, float]) -> None:
    for requirement, value in requirements.items():
        if requirement in UP:
            assert has(waveform, requirement) >= value * (1.0 - ROUNDING), requirement
        elif requirement in DOWN:
            assert has(waveform, requirement) <= value * (1.0 + ROUNDING), requirement
    if "rate" in requirements:
        assert has(waveform, "rate") == pytest.approx(requirements["rate"], rel=ROUNDING)


def test_settings_are_those_of_the_textbook() -> None:
    """c fs / (4 R), 2 R / dR samples, lambda / (4 v) and lambda / (2 v dv)."""
    wf = rc.Waveform.design(max_range=10.0, range_resolution=0.2, max_velocity=5.0, velocity_resolution=0.1)
    assert wf.slope == pytest.approx(C * 2e6 / 40.0, rel=1e-15)
    assert wf.num_samples == 100
    assert wf.chirp_interval == pytest.approx(wf.wavelength / 20.0, rel=1e-15)
    assert wf.num_chirps == 100
    assert (wf.start_frequency, wf.sample_rate, wf.adc_delay) == (60e9, 2e6, 0.0)


@pytest.mark.parametrize(
    "requirements",
    [
        {"max_range": 8.0, "max_velocity": 4.0, "range_resolution": 0.05, "rate": 40.0},
        {"max_range": 8.0},
        {"range_resolution": 0.05},
        {"range_resolution": 0.3, "velocity_resolution": 0.11, "rate": 40.0},
        {
            "max_range": 200.0,
            "range_resolution": 0.5,
            "max_velocity": 20.0,
            "start_frequency": 77e9,
            "sample_rate": 20e6,
        },
        {"max_range": 20.0, "rate": 1000.0, "adc_delay": 4e-6, "idle_time": 3e-6},
        {"max_range": 20.0, "max_velocity": 3.0, "num_chirps": 17, "num_samples": 333},
        {"max_range": 20.0, "max_velocity": 3.0, "velocity_resolution": 0.5, "num_chirps": 100},
    ],
)
def test_requirements_are_met_together(requirements: dict[str, Any]) -> None:
    waveform = rc.Waveform.design(**requirements)
    meets(waveform, requirements)
    for name in ("start_frequency", "sample_rate", "num_samples", "num_chirps", "adc_delay"):
        if name in requirements:
            assert getattr(waveform, name) == requirements[name]
    after = waveform.adc_delay + waveform.num_samples / waveform.sample_rate + requirements.get("idle_time", 0.0)
    assert waveform.chirp_interval >= after * (1.0 - ROUNDING)
    assert waveform.num_chirps * waveform.chirp_interval <= waveform.frame_interval * (1.0 + ROUNDING)


def test_transmitters_in_turn_fit_into_the_chirp_interval() -> None:
    requirements = {"max_range": 10.0, "range_resolution": 0.2, "max_velocity": 5.0}
    waveform = rc.Waveform.design(**requirements, num_tx=4)
    meets(waveform, requirements)
    tx = [[0.0, 2e-3 * i, 0.0] for i in range(4)]
    assert rc.Radar(waveform, tx=tx, schedule=rc.Schedule.tdm()).num_channels == 4
    with pytest.raises(
        ValueError, match=r"max_velocity: expected at most .* at 2 MHz and 6 transmitters in turn, got 5"
    ):
        rc.Waveform.design(**requirements, num_tx=6)


@pytest.mark.parametrize(
    ("requirements", "message"),
    [
        (
            # 400 samples last 200 us, and the wavelength is 4.876 mm in the middle of 60 to 63 GHz.
            {"max_range": 10.0, "range_resolution": 0.05, "max_velocity": 8.0},
            "max_velocity: expected at most 6.093 m/s with range_resolution = 0.05 m and max_range = 10 m at 2 MHz",
        ),
        (
            {"max_range": 10.0, "velocity_resolution": 0.01, "rate": 40.0},
            "velocity_resolution: expected at least 0.09914 m/s with rate = 40 Hz, got 0.01",
        ),
        (
            {"max_range": 10.0, "rate": 1e5},
            "rate: expected at most 15620 Hz for a single chirp with max_range = 10 m at 2 MHz, got 100000",
        ),
        (
            {"max_range": 10.0, "rate": 500.0, "num_chirps": 200},
            "rate: expected at most 78.12 Hz with num_chirps = 200 and max_range = 10 m at 2 MHz, got 500",
        ),
        (
            {"max_range": 10.0, "range_resolution": 0.1, "num_samples": 100},
            "range_resolution: expected at least 0.2 m with max_range = 10 m at 2 MHz, got 0.1",
        ),
        (
            {"max_range": 1.0, "velocity_resolution": 0.1, "num_chirps": 5, "max_velocity": 5.0},
            "velocity_resolution: expected at least 2 m/s with max_velocity = 5 m/s and num_chirps = 5, got 0.1",
        ),
        ({"max_velocity": 3.0}, "range_resolution: expected it or max_range, got neither"),
        ({"max_range": -1.0}, "max_range: expected a positive number [m], got -1.0"),
        ({"max_range": 1.0, "num_tx": 0}, "num_tx: expected at least 1, got 0"),
        ({"max_range": 1.0, "start_frequency": 60.0}, "start_frequency: expected 1e8 to 3e12 [Hz] (60 GHz is 60e9)"),
    ],
)
def test_conflicting_requirement_is_named(requirements: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        rc.Waveform.design(**requirements)


def test_what_an_error_says_can_be_had_can_be_had() -> None:
    """Any requirements, one after the other replaced by what the error says: the last of them is met."""
    rng = np.random.default_rng(11)
    scales = {
        "max_range": (0.5, 100.0),
        "range_resolution": (0.02, 0.5),
        "max_velocity": (0.5, 50.0),
        "velocity_resolution": (0.01, 2.0),
        "rate": (1.0, 5000.0),
    }
    num_refused = 0
    for _ in range(100):
        names = [name for name in scales if rng.random() < 0.6]
        requirements = {name: float(np.exp(rng.uniform(*np.log(scales[name])))) for name in names}
        for _ in range(8):
            text = ""
            try:
                meets(rc.bgt60tr13c(**requirements).waveform, requirements)
                break
            except ValueError as error:
                text = str(error)
            found = re.match(r"(\w+): expected at (least|most) ([\d.e+-]+) ", text)
            assert found, text
            requirements[found[1]] = float(found[3])
            num_refused += 1
        else:
            raise AssertionError(requirements)
    assert num_refused > 20
