"""Refusals of waveforms, radars, patterns and schedules. Errors of `check` itself are in tests/test_check.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc

SETTINGS: dict[str, Any] = {
    "start_frequency": 60e9,
    "slope": 50e12,
    "sample_rate": 2e6,
    "num_samples": 40,
    "num_chirps": 16,
    "chirp_interval": 400e-6,
    "adc_delay": 3e-6,
}


def waveform(**changes: Any) -> rc.Waveform:
    return rc.Waveform(**(SETTINGS | changes))


WAVEFORM = waveform()
DOWN = WAVEFORM.replace(slope=-50e12, start_frequency=62e9)
STAGGERED = (400e-6 * np.arange(16) + 30e-6 * (np.arange(16) % 2)).tolist()
PAIR = [[0.0, 0.0, 0.0], [0.0, 4e-3, 0.0]]
ISOTROPIC = rc.IsotropicPattern()
TWO, FLAT = [0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]]


def radar(**changes: Any) -> rc.Radar:
    return rc.Radar(**({"waveform": WAVEFORM} | changes))


def after(**changes: Any) -> rc.Radar:
    """A radar whose second sub-sequence has other settings."""
    return radar(waveform=[WAVEFORM, DOWN.replace(**changes).delayed(10e-3)])


def scheduled(schedule: Any, **changes: Any) -> rc.Radar:
    return radar(tx=PAIR, schedule=schedule, **changes)


def other_pattern() -> rc.Radar:
    return rc.Radar.from_dict(radar().to_dict() | {"pattern": {"kind": "cosine"}})


def schedule(kind: str, **options: Any) -> rc.Schedule:
    return rc.Schedule(kind=kind, **options)


def chip(**keywords: Any) -> rc.Radar:
    return rc.bgt60tr13c(**keywords)


def table(*arguments: Any) -> rc.TabulatedPattern:
    return rc.TabulatedPattern(*arguments)


LEAST = "schedule: expected at least"
NO_HIGH_PASS = r"receiver\.high_pass: expected None for a radar without a sweep"
HIGH_PASS = rc.Receiver(high_pass=80e3)
STILL = WAVEFORM.replace(slope=0.0)

Call = Callable[[], object]

WRONG_VALUES: list[tuple[Call, str]] = [
    # Waveforms; 60 GHz at -3 GHz/us is gone after 20 us, before the last sample at 22.5 us.
    (lambda: waveform(start_frequency=60.0), r"start_frequency: expected 1e8 to 3e12 \[Hz\] \(60 GHz is"),
    (lambda: waveform(slope=np.nan), "slope: expected a finite number"),
    (lambda: waveform(sample_rate=0.0), "sample_rate: expected a positive number"),
    (lambda: waveform(adc_delay=-1e-9), "adc_delay: expected zero or a positive number"),
    (lambda: waveform(chirp_interval=-1.0), "chirp_interval: expected a positive number"),
    (lambda: waveform(frame_interval=0.0), "frame_interval: expected a positive number"),
    (lambda: waveform(num_chirps=0), "num_chirps: expected at least 1, got 0"),
    (lambda: waveform(num_samples=10**9, slope=1e6), "num_samples: expected at most 16777216, got"),
    (lambda: waveform(num_chirps=10**9), "num_chirps: expected at most 16777216, got 1000000000"),
    (lambda: waveform(slope=-3e15), r"slope: expected a ramp above 0 and up to 3e\+12 Hz .*got -9e\+09 Hz"),
    (lambda: waveform(slope=1e308), r"slope: expected a ramp .*got 2\.3e\+303 Hz"),
    (lambda: waveform(sample_rate=1e-300), r"num_samples / sample_rate: expected times up to 1e\+12 s, got 4e\+301"),
    (lambda: waveform(adc_delay=1e300), r"adc_delay .*: expected times up to 1e\+12 s, got 1e\+300"),
    (lambda: waveform(chirp_interval=1e308), r"chirp_interval: expected times up to 1e\+12 s, got 1e\+308"),
    (lambda: waveform(frame_interval=1e300), r"frame_interval: expected times up to 1e\+12 s, got 1e\+300"),
    (lambda: waveform(chirp_interval=10e-6), r"chirp_interval: expected at least 2.25e-05 s.*got 1e-05 s"),
    (lambda: waveform(chirp_times=STAGGERED[::-1]), "chirp_times: expected increasing times.*got 0.00603"),
    (lambda: waveform(chirp_times=[0.0, *STAGGERED[:15]]), "chirp_times: expected increasing.*at index 1"),
    (lambda: waveform(chirp_times=[t - 1e-6 for t in STAGGERED]), "chirp_times: expected times from 0"),
    (lambda: waveform(chirp_times=1e-6 * np.arange(16)), "chirp_times: expected at least 2.25e-05 s"),
    (lambda: waveform(num_chirps=2, chirp_times=[0.0, 1e300]), r"chirp_times: expected times up to 1e\+12 s"),
    (lambda: WAVEFORM.range_axis(0), "num_bins: expected .*, got 0"),
    (lambda: WAVEFORM.velocity_axis(0), "num_bins: expected .*, got 0"),
    (lambda: WAVEFORM.delay_times(0), "num_nodes: expected .*, got 0"),
    (lambda: WAVEFORM.replace(num_chirps=7).alternating(), "num_chirps: expected an even number .*, got 7"),
    (lambda: WAVEFORM.replace(slope=0.0).alternating(), "waveform: expected a ramp"),
    # Presets
    (lambda: chip(stop_frequency=62e9, slope=1e14), "stop_frequency: expected either .* or slope, got both"),
    (lambda: chip(start_frequency=61e9, stop_frequency=61e9), "stop_frequency: expected another frequency"),
    (lambda: chip(start_frequency=77e9, stop_frequency=78e9), "stop_frequency: expected 5.7e.*got 7.8e"),
    (lambda: chip(stop_frequency=77e9), r"stop_frequency: expected 5.7e\+10 to 6.4e\+10 \[Hz\] of a BGT60"),
    (lambda: chip(slope=1e15), "slope, end of the ramp: expected 5.7e.*, got 1.27"),
    (lambda: chip(rate=40.0, stop_frequency=62e9), "stop_frequency: expected none beside rate, which dec"),
    (lambda: chip(rate=40.0, slope=1e13), "slope: expected none beside rate"),
    (lambda: chip(rate=40.0, frame_interval=0.1), "frame_interval: expected none beside rate"),
    (lambda: chip(rate=40.0, start_frequency=57e9), r"start_frequency: expected 5\.8e\+10 to 6\.35e\+10"),
    (lambda: chip(rate=40.0, sample_rate=5e6), r"sample_rate: expected 78201 to 4e\+06 \[Hz\].*got 5e\+06"),
    (lambda: chip(rate=40.0, num_samples=5000), "num_samples: expected at most"),
    (lambda: chip(rate=40.0, num_chirps=5000), "num_chirps: expected at most 4096, got 5000"),
    # Radars
    (lambda: radar(rx=np.zeros((0, 3))), "rx: expected at least one antenna position, got none"),
    (lambda: radar(rx=[[0.0, 1e200, 0.0]]), r"rx: expected coordinates within 1e\+06 m, got 1e\+200"),
    (lambda: radar(tx_patterns=[]), "tx_patterns: expected 1 patterns, one per element, got 0"),
    (lambda: radar(rx_patterns=[ISOTROPIC] * 2), "rx_patterns: expected 1 patterns.*, got 2"),
    (lambda: radar(tx_power_dbm=1e300), r"tx_power_dbm: expected a number from -1000 to 1000 \[dBm\]"),
    (lambda: radar(channel_weights=[1.0, 1.0]), r"channel_weights: expected shape \(1,\), got \(2,\)"),
    (lambda: radar(channel_weights=[np.nan]), "channel_weights: expected finite"),
    (lambda: radar(channel_weights=[0.0]), "channel_weights: expected numbers other than zero, got zero for channel 0"),
    (lambda: radar(polarization="circular"), "polarization: expected 'vertical', 'horizontal' or a unit v"),
    (lambda: radar(polarization=[0.0, 1.0, 1.0]), "polarization: expected a unit vector, got one of"),
    (lambda: radar(waveform=[]), "waveform: expected at least one, got none"),
    (lambda: radar(waveform=[WAVEFORM, DOWN]), "waveform: expected at least 2.25e-05 s .* got 0 s at 0 s"),
    (lambda: after(num_samples=20), r"waveform\[1\]: expected num_samples = 40 as in waveform\[0\]"),
    (lambda: after(sample_rate=4e6), r"waveform\[1\]: expected sample_rate = 2e\+06 Hz as in"),
    *(
        (lambda waveforms=waveforms: radar(waveform=waveforms, receiver=HIGH_PASS), NO_HIGH_PASS)
        for waveforms in (STILL, [WAVEFORM, STILL.delayed(10e-3)], [STILL, WAVEFORM.delayed(10e-3)])
    ),
    # Patterns
    (other_pattern, "pattern kind: expected one of 'isotropic', 'gaussian', 'tabulated', got 'cosine'"),
    (lambda: rc.IsotropicPattern(1e300), r"gain_db: expected a number from -1000 to 1000 \[dBi\], got 1e"),
    (lambda: rc.GaussianPattern(5.0, 0.0, 30.0), "beamwidth_azimuth_deg: expected a number from 0.001 to 3"),
    (lambda: rc.GaussianPattern(5.0, 60.0, 1e200), r"beamwidth_elevation_deg: .* \[degrees\], got 1e\+200"),
    (lambda: table(TWO, TWO, [[0.0, 0.0], [0.0, 1e30]]), r"gain_db: expected less than 1e\+03 dB, got 1e"),
    (lambda: table([0.0], TWO, [[0.0, 0.0]]), r"azimuth: expected at least two angles \[rad\], got 1"),
    (lambda: table([], [], np.zeros((0, 0))), r"azimuth: expected at least two angles \[rad\], got 0"),
    (lambda: table([1.0, 0.0], TWO, FLAT), r"azimuth: expected increasing angles \[rad\], got 1 and then 0"),
    (lambda: table(TWO, [0.5, 0.5], FLAT), "elevation: expected increasing angles.*got 0.5 and then 0.5 at"),
    (lambda: table([0.0, 3.2], TWO, FLAT), r"azimuth: expected angles from -3.14159 to 3.14159 \[rad\], got"),
    (lambda: table([-180, 180], TWO, FLAT), r"azimuth: .* \[rad\], got -180; degrees\? np.deg2rad"),
    (lambda: table(TWO, [-1.6, 0.0], FLAT), r"elevation: expected angles from -1.5708 to 1.5708 \[rad\], g"),
    (lambda: rc.TabulatedPattern.from_degrees([0, 190], TWO, FLAT), "azimuth_deg: .* -180 to 180 .degrees"),
    (lambda: rc.TabulatedPattern.from_degrees(TWO, [3, 2], FLAT), r"elevation_deg: .* \[degrees\], got 3"),
    # Schedules
    (lambda: schedule("cdm"), "kind: expected one of 'tdm', 'ddm', 'steered', got 'cdm'"),
    (lambda: schedule("ddm", interval=1e-3), "interval: expected none in a schedule of kind 'ddm'"),
    (lambda: schedule("tdm", order=[0, 2]), r"order: expected every number from 0 to 1 once, got \[0, 2\]"),
    (lambda: schedule("ddm", turns=[0.0, 1.0]), "turns: expected another part of a turn for every"),
    (lambda: schedule("steered"), "weights: expected either weights or azimuth and elevation, got neither"),
    (lambda: schedule("steered", weights=[1], azimuth=0.0), "weights: expected either .* got both"),
    (lambda: schedule("steered", weights=[1.0, 1.1]), r"weights: expected magnitudes up to 1.*got 1\.1"),
    (lambda: schedule("steered", weights=1.0), r"weights: expected shape \(tx,\) or \(chirp, tx\), got"),
    (lambda: scheduled(rc.Schedule.tdm(order=[0])), r"schedule: expected order of shape \(2,\), got \(1,\)"),
    (lambda: scheduled(rc.Schedule.ddm([0.0])), r"schedule: expected turns of shape \(2,\), got \(1,\)"),
    (lambda: scheduled(rc.Schedule.steered([1.0])), r"weights of shape \(2,\) or \(16, 2\), got \(1,\)"),
    (lambda: scheduled(rc.Schedule.steered(azimuth=[0.1])), r"azimuth of shape \(\) or \(16,\), got \(1,\)"),
    (lambda: scheduled(rc.Schedule.tdm(10e-6)), rf"{LEAST} 2\.25e-05 s between the ramps .*, got 1e-05 s"),
    (lambda: scheduled(rc.Schedule.tdm(390e-6)), rf"{LEAST} .* got 1e-05 s"),
    (lambda: scheduled(rc.Schedule.tdm(), waveform=waveform(chirp_interval=25e-6)), LEAST),
    (lambda: scheduled(rc.Schedule.tdm(385e-6), waveform=WAVEFORM.alternating()), "of sub-sequences and tr"),
]


WRONG_TYPES: list[tuple[Call, str]] = [
    (lambda: waveform(num_samples=4.0), "num_samples: expected an integer"),
    (lambda: chip(stop_freqency=61e9), r"bgt60tr13c: unknown keyword 'stop_freqency'; .*'stop_frequency'"),
    (lambda: radar(tx=None), r"tx: expected numbers of shape \(n, 3\), got NoneType"),
    (lambda: radar(pattern="isotropic"), "pattern: expected .*IsotropicPattern.*got str"),
    (lambda: radar(rx_patterns=ISOTROPIC), "rx_patterns: expected a sequence.*, got IsotropicPattern"),
    (lambda: radar(tx_patterns=[3.0]), r"tx_patterns\[0\]: expected .*IsotropicPattern.*got float"),
    (lambda: radar(receiver="real"), "receiver: expected .*Receiver.*got str"),
    (lambda: radar(waveform=None), "waveform: expected Waveform, got NoneType"),
    (lambda: radar(waveform=[WAVEFORM, None]), r"waveform\[1\]: expected Waveform, got NoneType"),
    (lambda: schedule("tdm", order=3), "order: expected numbers of transmitters, got 3"),
    (lambda: scheduled("tdm"), "schedule: expected .*Schedule.*, got str"),
]


@pytest.mark.parametrize(("call", "message"), WRONG_VALUES)
def test_wrong_values_are_refused(call: Call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(("call", "message"), WRONG_TYPES)
def test_wrong_types_are_refused(call: Call, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        call()
