"""Units as people write them."""

from __future__ import annotations

import pytest

from radarcore.units import frequency_of, quantity


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (60e9, "Hz", "60 GHz"),
        (2e6, "Hz", "2 MHz"),
        (40.0, "Hz", "40 Hz"),
        (0.05, "Hz", "0.05 Hz"),
        (0.0, "Hz", "0 Hz"),
        (31.25e12, "Hz/s", "31.2 MHz/us"),
        (-5e9, "Hz/s", "-5 kHz/us"),
        (0.105, "m", "10.5 cm"),
        (6.2, "m", "6.2 m"),
        (0.0012, "m", "1.2 mm"),
        (0.9999, "m", "1 m"),
        (0.31, "m/s", "31 cm/s"),
        (0.00059112, "s", "591 us"),
        (0.0, "s", "0 s"),
        (23.0, "dB", "23 dB"),
        (64, "", "64"),
    ],
)
def test_numbers_have_the_unit_that_suits_them(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_digits_are_as_many_as_asked_for() -> None:
    assert quantity(31.25e12, "Hz/s", 6) == "31.25 MHz/us"


@pytest.mark.parametrize(
    ("text", "frequency"), [("1.5GHz", 1.5e9), ("500 MHz", 5e8), ("80khz", 8e4), ("2e9 Hz", 2e9), (" 1GHZ ", 1e9)]
)
def test_frequencies_are_read_with_their_unit(text: str, frequency: float) -> None:
    assert frequency_of(text) == pytest.approx(frequency, rel=1e-15)


@pytest.mark.parametrize("text", ["1.5", "GHz", "", "1.5 m", "1,5GHz"])
def test_frequencies_without_a_unit_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected a frequency with its unit"):
        frequency_of(text)


def test_powers_of_noise_are_compared_within_their_relative_tolerance() -> None:
    assert pytest.approx(4e-15, rel=0.1) == 4.3e-15
    assert pytest.approx(4e-15, rel=0.1) != 5e-15
