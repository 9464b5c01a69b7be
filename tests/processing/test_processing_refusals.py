"""Refusals of processing. Errors of `check` itself are in tests/test_check.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore import processing
from radarcore.processing.tracking.cluster import cluster
from radarcore.processing.tracking.tracks import assign_to_truth

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=1e-4
)
ONE = WAVEFORM.replace(num_chirps=1)
DOWN = WAVEFORM.replace(start_frequency=62e9, slope=-50e12)
CW = WAVEFORM.replace(slope=0.0)
STAGGERED = WAVEFORM.replace(chirp_times=1e-4 * np.arange(32) + 5e-5 * (np.arange(32) % 2))


def row(number: int, axis: int = 1) -> Any:
    """Positions at half a wavelength along an axis."""
    return 0.5 * WAVEFORM.wavelength * np.arange(number)[:, None] * np.eye(3)[axis]


EIGHT = rc.Radar(WAVEFORM, rx=row(8))
UNEVEN = rc.Radar(WAVEFORM, rx=row(8) * np.array([1.0, 1.0, 1.0, 1.1, 1.0, 1.0, 1.0, 1.0])[:, None])
RADAR = rc.Radar(WAVEFORM)
CUBE = np.ones((1, 32, 64), np.float32)
CUBES = np.ones((8, 32, 64), np.float32)
FRAME = rc.Frame(CUBE, 0.0, RADAR)
CW_FRAME = rc.Frame(CUBE, 0.0, rc.Radar(CW))
RECORDING = rc.Recording(CUBE[None], [0.0], RADAR)
UP_AND_DOWN = rc.Recording(CUBE[None], [0.0], rc.Radar(WAVEFORM.alternating()))
DDM = rc.Radar(WAVEFORM, tx=row(2), rx=row(2), schedule=rc.Schedule.ddm())
CODED = rc.Frame(CUBES[:2], 0.0, DDM)
ONE_EMPTY = rc.Radar(WAVEFORM, tx=row(2), rx=row(2), schedule=rc.Schedule.ddm([0.0, 1.0 / 3.0]))
MAPS = np.zeros((2, 32, 5), complex)
POWER = np.ones((8, 9))
TWO = processing.Detections([1.0, 2.0], *np.full((3, 2), np.nan), [0.0, 0.0])
NAN_CUBE = np.where(np.eye(32, 64), np.nan, CUBE)


def cfar(power: Any = POWER, **changes: Any) -> object:
    return rc.cfar(power, **({"guard": 1, "training": 2, "false_alarm_rate": 1e-3} | changes))


def map_of(cube: Any = CUBES, radar: Any = EIGHT, **changes: Any) -> object:
    return rc.range_angle(cube, radar, **changes)


def pattern(**changes: Any) -> object:
    return rc.array_pattern(UNEVEN, 0.0, **changes)


def hypotheses(frame: rc.Frame, max_velocity: float = 9.0) -> object:
    return processing.velocity_hypotheses(frame, TWO, max_velocity=max_velocity)


def still(**changes: Any) -> object:
    return rc.remove_static(FRAME, **({"motion": [0.1, 0.0, 0.0]} | changes))


ONE_WAVEFORM = "radar: expected one waveform, got 2"
NO_RANGE = r"a CW radar \(slope = 0 Hz/s\) measures no range"

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    # Cubes and their radars
    (lambda: rc.range_profile(CUBE[..., :63], WAVEFORM), ValueError, r"num_samples = 64, got \(1, 32, 63\)"),
    (lambda: rc.strongest_peak(CUBE[0], WAVEFORM), ValueError, r"\(channel, chirp, sample\) with .*got \(32, 64\)"),
    (lambda: rc.range_profile(CUBE.astype(np.int16), WAVEFORM), TypeError, r"got int16 \(raw ADC counts: scale them"),
    (lambda: rc.range_doppler(CUBE.astype(object), WAVEFORM), TypeError, "float32, float64, complex64 .*, got object"),
    (lambda: rc.detect(CUBES, RADAR), ValueError, r"num_channels = 1, .*got \(8, 32, 64\)"),
    (lambda: rc.detect(NAN_CUBE, RADAR), ValueError, r"frame: expected finite numbers, got nan at index \(0, 0, 0\)"),
    (lambda: rc.detect(CUBE, WAVEFORM), TypeError, "radar: expected Radar with a cube .*got Waveform"),
    (lambda: map_of(np.ones((7, 32, 64))), ValueError, r"cube: expected shape \(\.\.\., channel, chirp, sample\)"),
    (lambda: rc.range_profile(CUBE), TypeError, "waveform: expected Waveform or Radar with a cube .*, got none"),
    (lambda: rc.range_doppler(FRAME, WAVEFORM), TypeError, "waveform: expected none with a Frame, which has its radar"),
    (lambda: rc.detect(RECORDING), TypeError, "frame: expected a Frame .*, got a Recording; take its frames one by"),
    (lambda: rc.doppler_velocity(CUBE[0], WAVEFORM), ValueError, r"cube: expected shape \(\[frame,\] channel, chirp"),
    (lambda: rc.doppler_velocity(CUBE[:0], WAVEFORM), ValueError, "cube: expected at least one channel, got none"),
    # Radars that a function cannot serve
    *(
        (lambda function=function: function(CODED), ValueError, "radar: expected separate transmitters, .* kind 'ddm'")
        for function in (rc.detect, rc.strongest_peak, rc.doppler_velocity, lambda of: rc.remove_static(of, [0.0] * 3))
    ),
    (lambda: rc.detect(CUBES[:2], ONE_EMPTY), ValueError, "radar: expected a multiple of 3 chirps, .* got 32"),
    (lambda: hypotheses(CODED), ValueError, "radar: expected separate transmitters"),
    (lambda: hypotheses(rc.Frame(CUBE, 0.0, rc.Radar(CW))), ValueError, "waveform: expected a ramp"),
    (lambda: hypotheses(FRAME, max_velocity=0.0), ValueError, "max_velocity: expected a positive number"),
    *(
        (lambda function=function: function(UP_AND_DOWN), ValueError, ONE_WAVEFORM)
        for function in (
            *(rc.range_time, rc.spectrogram, rc.range_profile, rc.range_angle, processing.chirp_rate_velocity),
            *(rc.remove_mean, rc.cancel_pulses, rc.track, lambda of: rc.remove_static(of, [0.1, 0.0, 0.0])),
        )
    ),
    *(
        (
            lambda function=function, limits=limits: function(rc.Frame(CUBE, 0.0, rc.Radar(CW)), **limits),
            ValueError,
            NO_RANGE,
        )
        for function, limits in (
            *((function, {}) for function in (rc.range_profile, rc.range_doppler, rc.range_time, rc.range_angle)),
            *((function, {"min_range": 1.0}) for function in (rc.spectrogram, rc.strongest_peak, rc.detect)),
            (rc.doppler_velocity, {}),
        )
    ),
    (lambda: processing.doppler_bound(CW, 0.0), ValueError, NO_RANGE),
    (lambda: rc.remove_static(CW_FRAME, [0.0] * 3), ValueError, "I/Q samples of a CW radar"),
    (lambda: rc.spectrogram(rc.Recording(CUBE[None], [0.0], rc.Radar(STAGGERED))), ValueError, "chirps at equal inter"),
    *(
        (
            lambda function=function: function(CUBE, STAGGERED),
            ValueError,
            "equal intervals, because .* 5e-05 to 0.00015 s",
        )
        for function in (rc.range_doppler, rc.strongest_peak, rc.doppler_velocity)
    ),
    # Windows, bins and limits
    (lambda: rc.range_profile(CUBE, WAVEFORM, window="henn"), ValueError, "window: expected a window of scipy.*got 'h"),
    (lambda: rc.range_profile(CUBE, WAVEFORM, window=3), TypeError, "window: expected a window of scipy.*got 3"),
    (lambda: rc.detect(FRAME, window=np.ones(64)), TypeError, "^window: expected a window of scipy"),
    (lambda: rc.detect(FRAME, doppler_window=["kaiser", 5.0]), TypeError, "^doppler_window: expected a window of scip"),
    (lambda: rc.range_profile(CUBE, WAVEFORM, num_bins=63), ValueError, r"num_bins: expected at least 64 \(num"),
    (lambda: rc.range_doppler(CUBE, WAVEFORM, num_velocity_bins=31), ValueError, "num_velocity_bins: expected at"),
    (lambda: rc.strongest_peak(FRAME, max_range=-1.0), ValueError, "max_range: expected at least min_range = 0 m"),
    (lambda: rc.strongest_peak(FRAME, min_velocity=2, max_velocity=1), ValueError, "max_velocity: expected at least"),
    (lambda: rc.detect(FRAME, min_range=2.0, max_range=1.0), ValueError, "max_range: expected at least min_range"),
    (lambda: rc.spectrogram(RECORDING, min_range=9), ValueError, "min_range: expected at most .*, the last range"),
    (lambda: rc.spectrogram(RECORDING, min_range=1.51, max_range=1.52), ValueError, "max_range: expected a gate that"),
    (lambda: rc.spectrogram(RECORDING, window_length=33), ValueError, "window_length: expected at most 32, the most"),
    (lambda: rc.spectrogram(RECORDING, overlap=1), ValueError, "overlap: expected a part of the window, 0 to below 1"),
    (lambda: rc.range_time(RECORDING, channel=-2), ValueError, "channel: expected at least -1, got -2"),
    # Removal of static echoes
    (lambda: rc.cancel_pulses(CUBE, num_pulses=4), ValueError, "num_pulses: expected 2 or 3, got 4"),
    (lambda: rc.cancel_pulses(CUBE[:, :1]), ValueError, r"cube: expected at least 2 chirps \(num_pulses\)"),
    (lambda: rc.remove_running_mean(FRAME, time_constant=1.0), TypeError, "cube: expected a Recording"),  # type: ignore[call-overload]
    (lambda: rc.remove_running_mean(CUBE[None], time_constant=1.0), TypeError, "time: expected the times"),  # type: ignore[call-overload]
    (lambda: rc.detect(CUBE[:, :1], rc.Radar(ONE), subtract_mean=True), ValueError, "expected at least two chirps"),
    (lambda: still(motion=[1e8, 0.0, 0.0]), ValueError, "motion: expected at most 299792 m/s"),
    (lambda: still(field_of_view_deg=(180.0, 20.0)), ValueError, "angles from 0 to below 180"),
    (lambda: still(motion=[20.0, 0.0, 0.0]), ValueError, "frame: expected more than 32 chirps, because clutter"),
    # Detection
    (lambda: processing.noise_level(-CUBE), ValueError, "power: expected 0 or above"),
    (lambda: cfar(POWER + 1j), TypeError, r"power: expected real numbers, got complex128 \(power of a spectrum"),
    (lambda: cfar(1.0), ValueError, "power: expected at least one axis"),
    (lambda: cfar(guard=(1, 2, 3)), ValueError, r"guard: expected one number, or one per axis \(2\)"),
    (lambda: cfar(training=0), ValueError, "training: expected at least one cell on a side, got 0"),
    (lambda: cfar(training=(1, 1.5)), TypeError, r"training\[1\]: expected an integer"),
    (lambda: cfar(false_alarm_rate=1.0), ValueError, "false_alarm_rate: expected a probability below 1, got 1.0"),
    (lambda: cfar(rank=3), ValueError, "rank: expected none with method 'ca', got 3"),
    (lambda: cfar(rank=41, method="os"), ValueError, "rank: expected at most 40, the training cells"),
    (lambda: cfar(axes=(0, 0)), ValueError, "axes: expected one or two different axes"),
    (lambda: cfar(axes="ab"), TypeError, "axes: expected one or two integers, got 'ab'"),
    (lambda: rc.detect(FRAME, false_alarm_rate=0.02), ValueError, "false_alarm_rate: expected at most 0.01 per cell"),
    (
        lambda: rc.detect(FRAME, max_directions=2),
        ValueError,
        "max_directions: expected 1 with .* fewer than 4 channels",
    ),
    (lambda: rc.detect(FRAME, max_directions=3), ValueError, "max_directions: expected 1 or 2, got 3"),
    (lambda: rc.detect(FRAME, training=0), ValueError, "training: expected at least one cell"),
    # Angles
    (lambda: map_of(radar=UNEVEN, method="fft"), ValueError, "method: expected channels at equal steps along a line"),
    (lambda: map_of(azimuth=np.zeros((2, 2))), ValueError, "azimuth, elevation: expected angles that broadcast to one"),
    (lambda: map_of(azimuth=[0.0] * 3, elevation=[0.0] * 2), ValueError, "elevation: expected a shape that broadcasts"),
    (lambda: map_of(method="music", num_sources=6), ValueError, "num_sources: expected fewer than the 6 channels"),
    (
        lambda: rc.processing.azimuth_elevation(CUBES, EIGHT, at_range=120.0),
        ValueError,
        "at_range: expected at most .* m, the",
    ),
    (lambda: pattern(rx_weights=np.zeros(8)), ValueError, "rx_weights: expected finite numbers, not all of them zero"),
    (lambda: pattern(rx_window="taylor"), ValueError, "rx_window: expected elements at equal steps along a line, got"),
    (lambda: rc.directions(np.ones((3, 5)), EIGHT), ValueError, r"snapshots: expected shape \(n, 8\), got \(3, 5\)"),
    (lambda: rc.demultiplex(MAPS, RADAR), ValueError, "radar: expected a schedule .* got none"),
    (lambda: rc.demultiplex(MAPS.real, DDM), TypeError, "spectrum: expected complex numbers"),
    (lambda: rc.demultiplex(MAPS[0], DDM), ValueError, "with rx = 2, got"),
    (lambda: rc.demultiplex(np.zeros((2, 33, 5), complex), DDM), ValueError, "got 33 bins for turns of"),
    # Velocities and bounds
    (lambda: processing.doppler_bound(ONE, 0.0), ValueError, "waveform: expected at least 2 chirps, got 1"),
    (lambda: processing.chirp_rate_bound(ONE.replace(num_samples=2), 0.0), ValueError, "expected at least 3 samples"),
    (lambda: processing.up_down_bound(ONE, ONE, 0.0), ValueError, "down: expected a slope of the other sign than up's"),
    (lambda: processing.up_down_bound(ONE, DOWN.replace(num_samples=1), 0.0), ValueError, "expected at least 2 sample"),
    (lambda: rc.doppler_velocity(CUBE[:, :1], ONE), ValueError, "waveform: expected at least 2 chirps, got 1"),
    (lambda: processing.up_down_velocity(CUBE, CUBE[None], WAVEFORM, DOWN), ValueError, "down: expected one frame"),
    # Clusters and tracks
    (lambda: cluster(TWO, num_deviations=3.0), ValueError, "num_deviations: expected detections with positive varianc"),
    (lambda: rc.track([], gate=1.0), ValueError, "gate: expected a probability between 0 and 1, got 1"),
    (lambda: rc.track([], confirm_hits=6), ValueError, "confirm_frames: expected at least confirm_hits = 6, got 5"),
    (lambda: rc.track([], deviations=(0.1, 0.1, 0.0, 0.1)), ValueError, "deviations: expected positive numbers"),
    (lambda: rc.track([], num_dimensions=4), ValueError, "num_dimensions: expected 1, 2 or 3, got 4"),
    (lambda: rc.track([], detector=4), TypeError, "detector: expected a function of a frame, got int"),  # type: ignore[arg-type]
    (lambda: rc.track(3.0), TypeError, "source: expected Recording or an iterable of Detections or Frame, got float"),  # type: ignore[arg-type]
    (lambda: assign_to_truth(rc.track([]), rc.Truth((), *np.zeros((4, 0)))), ValueError, r"truth: expected arrays of"),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
