"""Refusals of receivers. Errors of `check` itself are in tests/test_check.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=32)
NAN = float("nan")


def receiver(**settings: Any) -> rc.Receiver:
    return rc.Receiver(**settings)


def with_errors(**errors: Any) -> rc.Receiver:
    return rc.Receiver(adc_errors=rc.AdcErrors(**errors))


def leaking(**settings: Any) -> rc.Radar:
    return with_receiver(leakage=rc.Leakage(**settings))


def with_receiver(**settings: Any) -> rc.Radar:
    return rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], receiver=rc.Receiver(**settings))


LATE = "expected at most the ramp, 1.6e-05 s, got"
ONE_PER_RECEIVER = "expected one number, or 2, one per receiver, got"

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: receiver(output="complex"), ValueError, "output: expected one of 'iq', 'real', got 'complex'"),
    (lambda: receiver(noise_figure_db=-1.0), ValueError, r"noise_figure_db: expected zero or a positive number \[dB\]"),
    (lambda: receiver(phase_noise=-80.0), ValueError, r"phase_noise: expected shape \(n, 2\)"),
    (lambda: receiver(phase_noise=[(0.0, -80.0)]), ValueError, "phase_noise: expected positive, increasing offsets"),
    (lambda: receiver(phase_noise=[(1e5, -80.0), (1e4, -70.0)]), ValueError, "phase_noise: expected positive, increas"),
    (lambda: receiver(phase_noise=[(1e5, 1.0)]), ValueError, r"phase_noise\[0\]\[1\]: expected at most 0 \[dBc/Hz\]"),
    (lambda: receiver(leakage=-30.0), TypeError, "leakage: expected Leakage or None, got float"),
    (lambda: receiver(rx_phase_deg=-75.0), TypeError, "rx_phase_deg: expected one number per receiver, got -75"),
    (lambda: receiver(rx_phase_deg=[0.0, NAN]), ValueError, r"rx_phase_deg\[1\]: expected a finite number"),
    (lambda: receiver(high_pass=0.0), ValueError, r"high_pass: expected a positive number \[Hz\]"),
    (lambda: receiver(high_pass_order=17), ValueError, "high_pass_order: expected at most 16, got 17"),
    (lambda: receiver(high_pass=6e5, low_pass=5e5), ValueError, "high_pass: expected less than low_pass, 500000 Hz"),
    (lambda: receiver(iq_phase_deg=1.0, output="real"), ValueError, "iq_phase_deg: expected None for a real receiver"),
    (lambda: receiver(gain_db=1e4), ValueError, "gain_db: expected a number from -1000 to 1000"),
    (lambda: receiver(full_scale=-1.0), ValueError, r"full_scale: expected a positive number \[V\]"),
    (lambda: receiver(dc_offset=[NAN, 0.0]), ValueError, r"dc_offset\[0\]: expected a finite number"),
    (lambda: receiver(adc_bits=12), ValueError, "full_scale: expected a value, as adc_bits is given, got None"),
    (lambda: receiver(adc_bits=25, full_scale=1.0), ValueError, "adc_bits: expected at most 24, got 25"),
    (lambda: with_errors(turn_on_db=3.0), ValueError, r"noise_figure_db: expected a value, as adc_errors\.turn_on_db"),
    (lambda: with_errors(turn_on_time=-1.0), ValueError, r"turn_on_time: expected a positive number \[s\]"),
    (lambda: with_errors(noise_lsb=1.0), ValueError, "adc_bits: expected a value, as adc_errors is given, got None"),
    (lambda: with_errors(chirp_offset_lsb=(1.0, -1.0)), ValueError, r"chirp_offset_lsb\[1\]: expected zero or a posit"),
    (lambda: with_errors(odd_width=2.5), ValueError, "odd_width: expected a number from 0 to 2"),
    (lambda: leaking(level_db=()), ValueError, "level_db: expected a number, or one per receiver, got none"),
    (lambda: leaking(level_db=(-30.0, "x")), TypeError, r"level_db\[1\]: expected a number \[dB\], got 'x'"),
    (lambda: leaking(level_db=(-30.0, 0.5)), ValueError, r"level_db\[1\]: expected at most 0 \[dB\], got 0.5"),
    (lambda: leaking(echo_db=20.0), ValueError, r"echo_db: expected at most 0 \[dB\], got 20"),
    (lambda: leaking(step_db=3.0), ValueError, r"step_db: expected at most 0 \[dB\], got 3"),
    (lambda: leaking(step_time=0.0), ValueError, r"step_time: expected a positive number \[s\]"),
    (lambda: leaking(delay=17e-6), ValueError, rf"receiver\.leakage\.delay: {LATE} 1.7e-05 s"),
    (lambda: leaking(echo_delay=1.0), ValueError, rf"receiver\.leakage\.echo_delay: {LATE} 1 s"),
    (lambda: with_receiver(rx_phase_deg=(0.0, 1.0, 2.0)), ValueError, rf"receiver\.rx_phase_deg: {ONE_PER_RECEIVER}"),
    (lambda: with_receiver(dc_offset=(0.0,)), ValueError, rf"receiver\.dc_offset: {ONE_PER_RECEIVER}"),
    (lambda: leaking(level_db=(-1.0, -2.0, -3.0)), ValueError, rf"receiver\.leakage\.level_db: {ONE_PER_RECEIVER}"),
    (
        lambda: leaking(step_db=0.0, step_phase_deg=(1.0, 2.0, 3.0)),
        ValueError,
        rf"receiver\.leakage\.step_phase_deg: {ONE_PER_RECEIVER}",
    ),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
