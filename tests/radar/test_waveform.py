"""The waveform: its axes follow from its numbers, and numbers that make no waveform are refused."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import radarcore as rc

C = 299_792_458.0  # [m/s]
EPS = np.finfo(float).eps

SETTINGS: dict[str, Any] = {
    "start_frequency": 60e9,
    "slope": 50e12,
    "sample_rate": 2e6,
    "num_samples": 40,
    "num_chirps": 16,
    "chirp_interval": 400e-6,
    "frame_interval": 25e-3,
    "adc_delay": 3e-6,
}
"""20 us of samples at 50 MHz/us: 1 GHz."""

STAGGERED = (400e-6 * np.arange(16) + 30e-6 * (np.arange(16) % 2)).tolist()


def waveform(**changes: Any) -> rc.Waveform:
    return rc.Waveform(**(SETTINGS | changes))


def test_bandwidth_is_the_sampled_one_and_gives_the_range_resolution() -> None:
    wf = waveform()
    assert wf.bandwidth == pytest.approx(1e9, rel=4 * EPS)  # not the 1.15 GHz the ramp also covers before
    assert wf.range_resolution == pytest.approx(0.149896229, rel=4 * EPS)  # c / 2 GHz
    # A real receiver is unambiguous up to half its rate: f_b = S 2R/c = fs/2.
    assert wf.max_range == pytest.approx(C * 2e6 / (4 * 50e12), rel=4 * EPS)


def test_velocity_resolution_and_limit_follow_from_the_chirps() -> None:
    wf = waveform()
    center = 60e9 + 50e12 * (3e-6 + 10e-6)  # of the sampled band: 60.65 GHz
    assert wf.center_frequency == pytest.approx(center, rel=4 * EPS)
    assert wf.wavelength == pytest.approx(C / center, rel=4 * EPS)
    assert wf.velocity_resolution == pytest.approx(C / center / (2 * 16 * 400e-6), rel=8 * EPS)
    # Half a turn from chirp to chirp: 4 pi v T / lambda = pi.
    assert wf.max_velocity == pytest.approx(C / center / (4 * 400e-6), rel=8 * EPS)
    assert wf.max_velocity == pytest.approx(8 * wf.velocity_resolution, rel=8 * EPS)


@pytest.mark.parametrize("slope", [50e12, -50e12])
def test_down_chirp_has_the_axes_of_its_mirror_image_but_another_centre(slope: float) -> None:
    wf = waveform(slope=slope)
    assert (wf.bandwidth, wf.range_resolution, wf.max_range) == (
        waveform().bandwidth,
        waveform().range_resolution,
        waveform().max_range,
    )
    np.testing.assert_array_equal(wf.range_axis(), waveform().range_axis())
    assert wf.center_frequency == pytest.approx(60e9 + math.copysign(0.65e9, slope), rel=4 * EPS)


@pytest.mark.parametrize(("start", "stop"), [(58e9, 63.5e9), (63.5e9, 58e9), (60e9, 60.01e9)])
@pytest.mark.parametrize("adc_delay", [0.0, 7e-6])
def test_sweep_from_start_to_stop_is_the_sampled_one(start: float, stop: float, adc_delay: float) -> None:
    wf = rc.Waveform.from_sweep(
        start_frequency=start, stop_frequency=stop, sample_rate=2e6, num_samples=128, adc_delay=adc_delay
    )
    assert wf.start_frequency + wf.slope * 128 / 2e6 == pytest.approx(stop, rel=4 * EPS)
    assert wf.bandwidth == pytest.approx(abs(stop - start), rel=4 * EPS)
    direct = rc.Waveform(start_frequency=start, slope=wf.slope, sample_rate=2e6, num_samples=128, adc_delay=adc_delay)
    assert wf == direct


def test_range_axis_has_the_spacing_of_the_transform_length() -> None:
    wf = waveform()
    np.testing.assert_allclose(wf.range_axis(), np.arange(40) * wf.range_resolution, rtol=8 * EPS)
    # Zero padding to 100 samples: bins 2.5 times finer, the same largest range.
    np.testing.assert_allclose(wf.range_axis(100), np.arange(100) * wf.range_resolution / 2.5, rtol=8 * EPS)
    assert wf.range_axis(1).tolist() == [0.0]
    # The bin at half the transform length is the real receiver's limit.
    assert wf.range_axis(100)[50] == pytest.approx(wf.max_range, rel=8 * EPS)


@pytest.mark.parametrize("num_bins", [1, 2, 3, 16, 31, 32])
def test_velocity_axis_increases_and_is_zero_in_the_middle(num_bins: int) -> None:
    wf = waveform()
    axis = wf.velocity_axis(num_bins)
    assert axis.shape == (num_bins,)
    assert axis[num_bins // 2] == 0.0
    np.testing.assert_allclose(np.diff(axis), wf.velocity_resolution * 16 / num_bins, rtol=1e-12)
    # Like numpy.fft.fftshift: an even length starts at minus the limit and ends one bin short of plus it.
    assert axis[0] == pytest.approx(-wf.max_velocity * 2 * (num_bins // 2) / num_bins, rel=8 * EPS)
    assert wf.velocity_axis().shape == (16,)


def test_chirps_follow_at_their_interval_and_last_sample_ends_the_frame() -> None:
    wf = waveform()
    np.testing.assert_allclose(wf.chirp_times, 400e-6 * np.arange(16), rtol=4 * EPS)
    assert wf.duration == pytest.approx(15 * 400e-6 + 3e-6 + 39 / 2e6, rel=4 * EPS)
    assert wf.has_uniform_chirps
    with pytest.raises(ValueError, match="read-only"):
        wf.chirp_times[0] = 1.0


def test_default_chirps_and_frames_are_back_to_back() -> None:
    wf = waveform(num_chirps=3, chirp_interval=None, frame_interval=None)
    assert wf.chirp_interval == pytest.approx(23e-6, rel=4 * EPS)
    assert wf.frame_interval == pytest.approx(3 * 23e-6, rel=4 * EPS)
    single = waveform(num_chirps=1, chirp_interval=None, frame_interval=None, adc_delay=0.0)
    assert (single.num_chirps, single.chirp_interval, single.frame_interval) == (1, 20e-6, 20e-6)


def test_given_chirp_times_are_kept_and_their_mean_spacing_is_the_interval() -> None:
    times = np.array(STAGGERED)
    wf = waveform(chirp_times=times, chirp_interval=None)
    np.testing.assert_array_equal(wf.chirp_times, times)
    assert wf.chirp_interval == pytest.approx(times[-1] / 15, rel=4 * EPS)
    assert not wf.has_uniform_chirps
    times[0] = 7.0  # a copy was taken
    assert wf.chirp_times[0] == 0.0
    # Late but evenly spaced is uniform: slow time only gets another phase.
    late = waveform(chirp_times=1e-3 + 400e-6 * np.arange(16), chirp_interval=None)
    assert late.has_uniform_chirps
    assert late.duration == pytest.approx(waveform().duration + 1e-3, rel=4 * EPS)


@pytest.mark.parametrize("num_nodes", [1, 2, 5, 12])
@pytest.mark.parametrize(("num_chirps", "num_samples"), [(16, 40), (1, 40), (16, 1), (1, 1)])
@pytest.mark.parametrize("adc_delay", [0.0, 3e-6])
def test_delay_times_are_chebyshev_nodes_from_zero_to_the_last_sample(
    num_nodes: int, num_chirps: int, num_samples: int, adc_delay: float
) -> None:
    wf = waveform(num_chirps=num_chirps, num_samples=num_samples, adc_delay=adc_delay)
    times = wf.delay_times(num_nodes)
    assert times.shape == (num_nodes,)
    duration = (num_chirps - 1) * 400e-6 + adc_delay + (num_samples - 1) / 2e6
    # Zeros of the Chebyshev polynomial T_n over [-1, 1], mapped to [0, duration].
    zeros = np.sort(np.polynomial.chebyshev.chebroots([0.0] * num_nodes + [1.0]))
    np.testing.assert_allclose(times, 0.5 * duration * (1.0 + zeros), rtol=0, atol=1e-14 * duration)
    if duration > 0.0:
        assert (np.diff(times) > 0.0).all()
    else:
        assert (times == 0.0).all()


def test_replace_changes_what_is_named_and_nothing_else() -> None:
    wf = waveform()
    faster = wf.replace(sample_rate=4e6)
    assert faster == waveform(sample_rate=4e6)
    assert wf == waveform()
    assert wf.replace() == wf
    assert wf.replace(num_chirps=4).chirp_times.shape == (4,)
    assert wf.replace(chirp_interval=500e-6).chirp_times[1] == 500e-6
    with pytest.raises(TypeError, match="num_chrips"):
        wf.replace(num_chrips=4)


def test_replace_keeps_staggered_chirps_until_their_number_or_interval_changes() -> None:
    wf = waveform(chirp_times=STAGGERED, chirp_interval=None)
    np.testing.assert_array_equal(wf.replace(slope=40e12).chirp_times, STAGGERED)
    assert wf.replace(num_chirps=4).has_uniform_chirps
    np.testing.assert_array_equal(wf.replace(chirp_interval=500e-6).chirp_times, 500e-6 * np.arange(16))
    np.testing.assert_array_equal(waveform().replace(chirp_times=STAGGERED).chirp_times, STAGGERED)


def test_replace_keeps_the_delay_of_a_waveform_that_starts_late() -> None:
    late = waveform(num_chirps=8).delayed(2e-3)
    np.testing.assert_array_equal(late.replace(slope=40e12).chirp_times, late.chirp_times)
    assert late.replace(slope=40e12) == waveform(num_chirps=8, slope=40e12).delayed(2e-3)
    fewer = late.replace(num_chirps=4, chirp_interval=500e-6)
    np.testing.assert_allclose(fewer.chirp_times, 2e-3 + 500e-6 * np.arange(4), rtol=1e-15)
    times = 400e-6 * np.arange(8)
    np.testing.assert_array_equal(late.replace(chirp_times=times).chirp_times, times)
    back_to_back = rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=100, num_chirps=4)
    longer = back_to_back.delayed(1e-3).replace(num_chirps=8)
    assert longer.frame_interval == pytest.approx(800e-6, rel=4 * EPS)  # of the chirps, as for a delayed one


@pytest.mark.parametrize(
    "changes", [{"num_samples": 200}, {"num_samples": 50}, {"sample_rate": 2e6}, {"adc_delay": 5e-6}, {"num_chirps": 8}]
)
@pytest.mark.parametrize("delay", [0.0, 1e-3])
def test_intervals_that_were_back_to_back_are_so_again(delay: float, changes: dict[str, Any]) -> None:
    settings: dict[str, Any] = {"start_frequency": 60e9, "slope": 1e12, "sample_rate": 1e6, "num_samples": 100}
    settings["num_chirps"] = 4
    for intervals in ({}, {"frame_interval": 5e-3}, {"chirp_interval": 300e-6, "frame_interval": 5e-3}):
        found = rc.Waveform(**settings, **intervals).delayed(delay).replace(**changes)
        wanted = rc.Waveform(**settings | changes, **intervals)
        assert found.chirp_interval == pytest.approx(wanted.chirp_interval, rel=1e-12)
        assert found.frame_interval == pytest.approx(wanted.frame_interval, rel=1e-12)
        np.testing.assert_allclose(found.chirp_times, delay + wanted.chirp_times, rtol=1e-12)
    kept = rc.Waveform(**settings).delayed(delay).replace(**changes, chirp_interval=300e-6)
    assert kept.chirp_interval == pytest.approx(300e-6, rel=1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"slope": -50e12},
        {"num_chirps": 1},
        {"chirp_interval": 0.1 + 0.2},
        {"chirp_interval": None, "chirp_times": STAGGERED},
        {"chirp_interval": None, "chirp_times": [1e-3 + t for t in STAGGERED]},
        {"chirp_interval": None, "chirp_times": (1e-3 + 400e-6 * np.arange(16)).tolist()},  # late, uniform
        {"chirp_interval": None, "num_chirps": 1, "chirp_times": [2e-3]},
    ],
)
def test_dict_makes_the_round_trip_through_json_bit_for_bit(changes: dict[str, Any]) -> None:
    wf = waveform(**changes)
    back = rc.Waveform(**json.loads(json.dumps(wf.to_dict())))
    assert back == wf
    assert hash(back) == hash(wf)
    np.testing.assert_array_equal(back.chirp_times, wf.chirp_times)
    assert (back.duration, back.max_velocity, back.frame_interval) == (wf.duration, wf.max_velocity, wf.frame_interval)


def test_waveforms_are_equal_when_their_numbers_are() -> None:
    assert waveform() == waveform(chirp_interval=None, chirp_times=waveform().chirp_times)
    assert hash(waveform()) == hash(waveform())
    assert len({waveform(), waveform(), waveform(slope=40e12)}) == 2
    for name, value in SETTINGS.items():
        assert waveform(**{name: 2 * value}) != waveform(), name
    assert waveform(chirp_interval=None, chirp_times=STAGGERED) != waveform()
    assert waveform() != "waveform"


def test_numbers_of_other_types_become_plain_ones_and_cannot_be_changed() -> None:
    wf = rc.Waveform(
        start_frequency=np.float32(2**36), slope=10**13, sample_rate=np.int64(2_000_000), num_samples=np.uint8(40)
    )
    assert [type(getattr(wf, name)) for name in ("start_frequency", "slope", "sample_rate")] == [float] * 3
    assert type(wf.num_samples) is int
    with pytest.raises(AttributeError, match="slope"):
        wf.slope = 1.0


def test_samples_may_end_where_the_next_ramp_starts() -> None:
    sampled = 3e-6 + 39 / 2e6
    assert waveform(chirp_interval=sampled).chirp_interval == sampled
    # A single chirp overlaps with none.
    assert waveform(num_chirps=1, chirp_interval=1e-9).num_chirps == 1
