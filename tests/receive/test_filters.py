"""Filters of the baseband: echoes are weighted by their true beat frequency, wherever they are evaluated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.filters import filter_gain

C = 299_792_458.0
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=100e12, sample_rate=2e6, num_samples=64, num_chirps=4, chirp_interval=100e-6
)


def radar(receiver: rc.Receiver | None, waveform: rc.Waveform = WAVEFORM) -> rc.Radar:
    return rc.Radar(waveform, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], receiver=receiver)


def cube(
    receiver: rc.Receiver | None, scene: rc.Scene, waveform: rc.Waveform = WAVEFORM, **options: Any
) -> NDArray[Any]:
    return rc.Simulator(scene, radar(receiver, waveform), resolution=32, **options).frame().cube


def butterworth(ratio: float, order: int) -> float:
    """Level of a low-pass at a ratio of frequency to corner; of a high-pass at the ratio of corner to frequency."""
    return 1.0 / np.sqrt(1.0 + ratio ** (2 * order))


@pytest.mark.parametrize("order", [1, 2, 4, 8])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 30.0])
def test_level_is_that_of_a_butterworth_filter(order: int, ratio: float) -> None:
    low = rc.Receiver(low_pass=500e3, low_pass_order=order)
    high = rc.Receiver(high_pass=80e3, high_pass_order=order)
    for sign in (1.0, -1.0):
        low_gain = filter_gain(low, np.array(sign * ratio * 500e3))
        high_gain = filter_gain(high, np.array(sign * 80e3 / ratio))
        assert abs(low_gain) == pytest.approx(butterworth(ratio, order), rel=1e-9)
        assert abs(high_gain) == pytest.approx(butterworth(ratio, order), rel=1e-9)
        # Real filters: the other sign is the conjugate.
        assert filter_gain(low, np.array(-sign * ratio * 500e3)) == pytest.approx(np.conj(low_gain), rel=1e-9)


def test_phase_of_first_order_filters_at_their_corner_is_an_eighth_of_a_turn() -> None:
    assert np.angle(filter_gain(rc.Receiver(high_pass=80e3), np.array(80e3))) == pytest.approx(np.pi / 4.0)
    low = rc.Receiver(low_pass=80e3, low_pass_order=1)
    assert np.angle(filter_gain(low, np.array(80e3))) == pytest.approx(-np.pi / 4.0)


@pytest.mark.filterwarnings("ignore:the scene reaches to")
@pytest.mark.parametrize("distance", [0.05, 1.0, 1.7, 4.0])
@pytest.mark.parametrize("slope", [100e12, -100e12])
def test_echo_is_weighted_by_its_true_beat_frequency_also_where_it_aliases(distance: float, slope: float) -> None:
    """Half of the sample rate is at 1.5 m: echoes beyond fold back, weakened by what they were before."""
    waveform = replace(WAVEFORM, start_frequency=62e9, slope=slope)
    scene = rc.Scene([rc.PointTarget([distance, 0.0, 0.0])])
    filters = rc.Receiver(high_pass=80e3, low_pass=515e3)
    ratio = cube(filters, scene, waveform)[0] / cube(None, scene, waveform)[0]
    beat = slope * 2.0 * distance / C
    level = butterworth(80e3 / abs(beat), 1) * butterworth(abs(beat) / 515e3, 4)
    # Linear between steps of 1/64 of the corner: 1e-4; complex64 besides.
    np.testing.assert_allclose(abs(ratio), level, rtol=1e-3)
    np.testing.assert_allclose(ratio, complex(filter_gain(filters, np.array(beat))), rtol=1e-3)


def surfaces() -> rc.Scene:
    plate = rc.Body(rc.shapes.plate(0.2, 0.2), motion=rc.Pose([0.8, 0.1, 0.0]), name="plate")
    corner = rc.Body(rc.shapes.dihedral(0.1, 0.1), motion=rc.Pose([1.2, -0.3, 0.0]), name="corner")
    return rc.Scene([plate, corner, rc.PointTarget([0.5, 0.0, 0.2], rcs=0.01)])


@pytest.mark.parametrize("sampling", ["adaptive", "footprint"])
def test_all_kinds_of_paths_are_weighted(sampling: str) -> None:
    filters = rc.Receiver(high_pass=80e3, low_pass=515e3)
    options: dict[str, Any] = {"resolution": 32, "sampling": sampling, "max_bounces": 3}
    ideal = rc.Simulator(surfaces(), radar(None), **options).paths()
    weighted = rc.Simulator(surfaces(), radar(filters), **options).paths()
    np.testing.assert_array_equal(weighted.delay, ideal.delay)
    if sampling == "adaptive":  # reflections from wall to wall are among them
        assert rc.Simulator(surfaces(), radar(None), **options).frame().stats["bounce_paths"] > 0
    # The beat signal has the conjugate of amplitudes: TX times conjugate RX.
    expected = ideal.amplitude * filter_gain(filters, WAVEFORM.slope * ideal.delay).conj()
    scale = abs(ideal.amplitude).max()
    np.testing.assert_allclose(weighted.amplitude, expected, rtol=1e-3, atol=1e-9 * scale)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8])
def test_frames_sum_the_weighted_paths_in_both_precisions(tolerance: float) -> None:
    """Kernels of single and of double precision evaluate amplitudes each in their own way."""
    filters = rc.Receiver(high_pass=80e3, low_pass=515e3)
    # No path's amplitude depends on the frequency.
    options: dict[str, Any] = {"resolution": 32, "sampling": "footprint", "max_bounces": 3}
    simulator = rc.Simulator(surfaces(), radar(filters), tolerance=tolerance, **options)
    paths, found = simulator.paths(), simulator.frame().cube
    for channel in range(2):
        summed = rc.beat_signal(
            paths.delay[channel], paths.amplitude[channel], WAVEFORM, method="direct", tolerance=1e-9
        )
        error = np.sqrt(np.mean(abs(found[channel] - summed[0]) ** 2)) / np.linalg.norm(paths.amplitude[channel])
        assert error <= 1.1 * tolerance + 1e-7, channel  # the simulator's own bound, and complex64


def test_bodies_that_deform_are_weighted_too() -> None:
    mesh = rc.shapes.plate(0.1, 0.1)
    still = rc.Deformation([0.0, 1.0], [mesh.vertices, mesh.vertices * 1.001])
    scene = rc.Scene([rc.Body(mesh, motion=rc.Pose([0.6, 0.0, 0.0]), deformation=still)])
    filters = rc.Receiver(high_pass=80e3, low_pass=300e3)
    ratio = cube(filters, scene) / cube(None, scene)
    # All of the plate is within 5 cm of 60 cm, so within 1 % of its beat frequency, 400 kHz.
    expected = complex(filter_gain(filters, np.array(WAVEFORM.slope * 1.2 / C)))
    np.testing.assert_allclose(np.median(ratio.real) + 1j * np.median(ratio.imag), expected, rtol=0.05)


def test_low_pass_does_nothing_to_a_radar_without_a_sweep() -> None:
    """All echoes are at 0 Hz."""
    waveform = rc.Waveform(start_frequency=60e9, slope=0.0, sample_rate=1e4, num_samples=64)
    scene = rc.Scene([rc.PointTarget([1.0, 0.0, 0.0])])
    np.testing.assert_array_equal(cube(rc.Receiver(low_pass=1e3), scene, waveform), cube(None, scene, waveform))
