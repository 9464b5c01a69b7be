"""A sensor's own leakage is no peak, no detection and no track; a person in front of it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore import processing
from recordings import real_recording

WIDE = {"start_frequency": 58e9, "stop_frequency": 63.5e9, "num_samples": 64}
"""Sweep of the chip's settings at power-up."""


def measured(*points: rc.PointTarget, num_chirps: int = 16, **settings: Any) -> rc.Simulator:
    """Simulator of the chip's whole chain, leakage and codes included."""
    radar = rc.bgt60tr13c(receiver="measured", if_gain_db=23, num_chirps=num_chirps, **settings)
    return rc.Simulator(rc.Scene(list(points)), radar)


def peak_of(frame: rc.Frame, **limits: float) -> processing.Peak:
    """The strongest peak, which there is."""
    peak = rc.strongest_peak(frame, **limits)  # type: ignore[arg-type]
    assert peak is not None
    return peak


@pytest.fixture(scope="module")
def real() -> rc.Recording:
    """Recording of a real sensor with a moving person."""
    return rc.Recording.load(real_recording())


@pytest.mark.parametrize("settings", [{}, WIDE], ids=["1 GHz", "5.5 GHz"])
def test_leakage_alone_is_no_peak(settings: dict[str, Any]) -> None:
    frame = measured(**settings).frame()
    loudest = peak_of(frame, min_range=0.0)
    assert loudest.range_index == 0, "there is leakage"
    assert loudest.snr_db > 50.0
    assert rc.strongest_peak(frame) is None
    assert len(rc.detect(frame)) == 0


def test_leakage_in_a_bare_cube_raises_a_warning() -> None:
    frame = measured(rc.PointTarget([2.0, 0.0, 0.0], rcs=0.02)).frame()
    with pytest.warns(UserWarning, match="give the sensor's Frame, or min_range"):
        loudest = rc.strongest_peak(frame.cube, frame.radar)
    assert (
        loudest == rc.strongest_peak(frame, min_range=0.0) == rc.strongest_peak(frame.cube, frame.radar, min_range=0.0)
    )
    far = rc.strongest_peak(frame.cube, frame.radar, min_range=1.5)
    assert far is not None
    assert abs(far.range - 2.0) < 0.5 * frame.radar.waveform.range_resolution


@pytest.mark.parametrize(("settings", "distance"), [({}, 2.0), (WIDE, 0.6)], ids=["1 GHz", "5.5 GHz"])
def test_echo_is_found_beside_leakage_that_is_much_louder(settings: dict[str, Any], distance: float) -> None:
    frame = measured(rc.PointTarget([distance, 0.0, 0.0], rcs=0.02), **settings).frame()
    wf = frame.radar.waveform
    loudest, peak = peak_of(frame, min_range=0.0), peak_of(frame)
    assert loudest.power > 1e3 * peak.power
    # Noise at 17 dB and more is a tenth of a bin; residual leakage adds some.
    assert abs(peak.range - distance) < 0.5 * wf.range_resolution
    found = rc.detect(frame)
    assert len(found) == 1
    assert abs(found.range[0] - distance) < 0.5 * wf.range_resolution


def test_limit_of_range_that_is_given_is_the_only_one() -> None:
    """The search covers the user's limits, with or without leakage; samples without an ADC have no leakage to skip."""
    frame = measured().frame()
    width = frame.radar.waveform.range_resolution
    peak_of(frame, min_range=0.5 * width, max_range=8.0 * width)  # a sidelobe of the leakage
    ideal = rc.Simulator(rc.Scene([rc.PointTarget([1.5 * width, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=16)).frame()
    peak = peak_of(ideal)
    assert abs(peak.range - 1.5 * width) < 0.5 * width, "an ideal echo in the nearest bins is one"


ADC = {"gain_db": 50.0, "full_scale": 1.21, "adc_bits": 12}


@pytest.mark.parametrize(("distance", "output"), [(0.15, "real"), (0.42, "real"), (0.15, "iq")])
def test_near_echo_behind_an_adc_without_leakage_is_a_peak(distance: float, output: str) -> None:
    """Bins of 15 cm: all of these lie where leakage would."""
    radar = rc.bgt60tr13c(num_chirps=16)
    radar = replace(radar, receiver=rc.Receiver(noise_figure_db=12.0, output=output, **ADC))
    point = rc.PointTarget([distance, 0.0, 0.0], rcs=0.01)
    frame = rc.Simulator(rc.Scene([point]), radar).frame()
    assert (frame.raw is not None) == (output == "real")
    peak = peak_of(frame)
    # The mirror image of real samples moves what is nearer than a bin.
    assert abs(peak.range - distance) < (0.3 if output == "real" else 0.02) * radar.waveform.range_resolution


@pytest.mark.parametrize(
    "effect", [{"dc_offset": 0.05}, {"adc_errors": rc.AdcErrors(noise_lsb=0.9, chirp_offset_lsb=1.0)}]
)
def test_offset_of_the_adc_is_no_peak(effect: dict[str, Any]) -> None:
    settings: dict[str, Any] = {"adc_errors": rc.AdcErrors(noise_lsb=0.9)} | ADC | effect
    receiver = rc.Receiver(noise_figure_db=12.0, output="real", **settings)
    radar = replace(rc.bgt60tr13c(num_chirps=16), receiver=receiver)
    frame = rc.Simulator(rc.Scene([]), radar).frame()
    peak_of(frame, min_range=0.0)  # at 0 m
    assert rc.strongest_peak(frame) is None


def test_mean_of_frames_that_come_is_that_of_their_recording(real: rc.Recording) -> None:
    some = real[:20]
    came = list(rc.remove_running_mean(some.frames(), time_constant=0.5))
    whole = rc.remove_running_mean(some, time_constant=0.5)
    for frame, expected in zip(came, whole.frames(), strict=True):
        np.testing.assert_array_equal(frame.cube, expected.cube)
        assert (frame.time, frame.raw) == (expected.time, None)


def test_frames_are_filtered_as_they_come() -> None:
    simulator = measured(rc.PointTarget([2.0, 0.0, 0.0], rcs=1.0, velocity=[0.8, 0.0, 0.0]), num_chirps=32)
    taken = []

    def frames() -> Iterator[rc.Frame]:
        for number in range(6):
            taken.append(number)
            yield simulator.frame(25e-3 * number)

    for number, frame in enumerate(rc.remove_running_mean(frames(), time_constant=1.0)):
        assert taken[-1] == number, "none is taken ahead"
        peak = peak_of(frame)
        assert abs(peak.range - (2.0 + 0.8 * 25e-3 * number)) < 0.5 * frame.radar.waveform.range_resolution


def test_source_of_frames_ends_with_what_is_made_of_them() -> None:
    ended: list[bool] = []

    def frames() -> Iterator[rc.Frame]:
        try:
            while True:
                yield frame
        finally:
            ended.append(True)

    frame = measured(num_chirps=2).frame()
    moving = rc.remove_running_mean(frames(), time_constant=1.0)
    next(moving)
    with pytest.raises(ValueError, match="increasing times"):
        next(moving)
    assert ended, "a sensor would stop"


def test_frames_that_do_not_belong_together_are_refused() -> None:
    frame = measured().frame()
    with pytest.raises(ValueError, match="increasing times"):
        list(rc.remove_running_mean(iter([frame, frame]), time_constant=1.0))
    with pytest.raises(TypeError, match="expected Frame, got ndarray"):
        list(rc.remove_running_mean(iter([frame.cube]), time_constant=1.0))  # type: ignore[list-item]
    with pytest.raises(TypeError, match="time: expected none with frames"):
        rc.remove_running_mean(iter([frame]), [0.0], time_constant=1.0)  # type: ignore[call-overload]


def test_person_is_the_strongest_peak_of_every_frame_of_a_real_sensor(real: rc.Recording) -> None:
    """The person sits at 0.33 to 0.40 m, as a spectrum of the recording without its mean shows."""
    for index in range(0, len(real), 8):
        assert peak_of(real[index], min_range=0.0).range < 0.01, "the leakage"
        assert 0.33 < peak_of(real[index]).range < 0.40
        with pytest.warns(UserWarning, match="nearer bins contain a sensor's leakage, got it at "):
            rc.strongest_peak(real[index].cube, real.radar)
