"""Velocities beyond the limit of one transmitter's chirps: by empty Doppler bands, and by hypotheses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.direction import unit_vectors

WAVEFORM = rc.Waveform(
    start_frequency=77e9, slope=15e12, sample_rate=10e6, num_samples=64, num_chirps=64, chirp_interval=60e-6
)
HALF = 0.5 * WAVEFORM.wavelength
TX, RX = [[0.0, 4.0 * HALF * i, 0.0] for i in range(3)], [[0.0, HALF * i, 0.0] for i in range(4)]
LIMIT = WAVEFORM.max_velocity
EMPTY = rc.Schedule.ddm(np.arange(3) / 4)
pytestmark = pytest.mark.filterwarnings("ignore:.*beyond max_velocity")


def array(schedule: rc.Schedule | None, tx: Any = TX, rx: Any = RX, **changes: Any) -> rc.Radar:
    receiver = rc.Receiver(noise_figure_db=15.0, output=changes.pop("output", "iq"))
    return rc.Radar(WAVEFORM.replace(**changes), tx=tx, rx=rx, schedule=schedule, receiver=receiver)


def frame_of(radar: rc.Radar, velocity: float, azimuth: float = 0.3, distance: float = 6.0) -> rc.Frame:
    toward = unit_vectors(azimuth, 0.0)
    point = rc.PointTarget(distance * toward, velocity=velocity * toward, rcs=0.1)
    return rc.Simulator(rc.Scene([point]), radar).frame()


@pytest.mark.parametrize("output", ["iq", "real"])
@pytest.mark.parametrize("part", [-0.9, -0.3, 0.0, 0.55, 0.95])
def test_empty_band_tells_all_velocities_of_the_waveform(part: float, output: str) -> None:
    radar = array(EMPTY, output=output)
    assert radar.max_velocity == LIMIT
    found = rc.detect(frame_of(radar, part * LIMIT))
    assert len(found) == 1
    assert found.velocity[0] == pytest.approx(part * LIMIT, abs=0.3 * WAVEFORM.velocity_resolution)
    assert found.azimuth[0] == pytest.approx(0.3, abs=5.0 * np.sqrt(found.covariance[0, 2, 2]))
    # The direction is of all twelve channels, a row of half wavelengths: 6 / (snr 12 (144 - 1) pi^2 cos^2).
    bound = 6.0 / (10 ** (0.1 * found.snr_db[0]) * 12 * 143 * np.pi**2 * np.cos(0.3) ** 2)
    # The fit of a tone uses the power of several cells.
    assert 0.45 * bound <= found.covariance[0, 2, 2] <= bound


def test_transmitters_with_weights_of_their_receivers_are_separated_too() -> None:
    weights = np.exp(1j * np.array([0.0, 1.0, -1.0, 2.0]))
    frame = frame_of(array(EMPTY), 0.5 * LIMIT)
    radar = rc.Radar(WAVEFORM, tx=TX, rx=RX, schedule=EMPTY, channel_weights=weights)
    cube = frame.cube / weights[:, None, None]
    np.testing.assert_allclose(rc.detect(cube, radar).azimuth, rc.detect(frame).azimuth, atol=1e-5)


@pytest.mark.parametrize("turns", [None, [0.0, 0.25, 0.5, 0.75], [0.0, 0.5]])
def test_bands_without_a_gap_tell_no_transmitters(turns: list[float] | None) -> None:
    num_tx = 3 if turns is None else len(turns)
    radar = array(rc.Schedule.ddm(turns), tx=[[0.0, HALF * i, 0.0] for i in range(num_tx)])
    assert radar.max_velocity == pytest.approx(LIMIT / num_tx)
    with pytest.raises(ValueError, match="if the turns leave a band empty"):
        rc.detect(frame_of(radar, 0.0))


@pytest.mark.parametrize("part", [-2.6, -1.3, 0.4, 1.9])
def test_transmitters_in_turn_tell_which_period_a_velocity_is_in(part: float) -> None:
    frame = frame_of(array(rc.Schedule.tdm(20e-6)), part * LIMIT)
    found = rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=3.0 * LIMIT)
    assert found.velocity.shape == (1, 3)
    np.testing.assert_allclose(np.nansum(found.probability, axis=1), 1.0)
    best = found.resolved()
    assert best.velocity[0] == pytest.approx(part * LIMIT, abs=0.3 * WAVEFORM.velocity_resolution)
    assert best.azimuth[0] == pytest.approx(0.3, abs=0.01)
    assert best.range[0] == pytest.approx(6.0 + part * LIMIT * frame.radar.middle, abs=0.05)


def test_range_that_changes_within_a_frame_tells_the_period_too() -> None:
    # 1.5 GHz and 128 chirps: a period moves the target by 64 wavelengths, 2.5 range bins.
    radar = array(None, tx=[[0.0, 0.0, 0.0]], rx=[[0.0, 0.0, 0.0]], slope=120e12, num_samples=128, num_chirps=128)
    frame = frame_of(radar, 1.5 * LIMIT, distance=3.0)
    found = rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=2.0 * LIMIT)
    assert found.resolved().velocity[0] == pytest.approx(1.5 * LIMIT, abs=0.2)


def test_probabilities_are_as_frequent_as_they_say_and_else_the_velocity_is_nan() -> None:
    # Transmitters above each other, and 96 MHz: a period looks like another elevation.
    tx = [[0.0, 0.0, HALF * i] for i in range(2)]
    radar = array(rc.Schedule.tdm(20e-6), tx=tx, slope=15e12)
    rng, claimed, is_right, unknown = np.random.default_rng(2), [], [], 0
    for velocity in rng.uniform(-1.8, 1.8, 40) * LIMIT:
        frame = frame_of(radar, velocity, distance=10.0)
        strongest = rc.detect(frame)
        found = rc.processing.velocity_hypotheses(
            frame, strongest[int(strongest.snr_db.argmax())], max_velocity=1.8 * LIMIT
        )
        best = int(np.nanargmax(found.probability[0]))
        claimed.append(found.probability[0, best])
        is_right.append(abs(found.velocity[0, best] - velocity) < 1.0)
        resolved = found.resolved()
        unknown += int(np.isnan(resolved.velocity[0]))
        if np.isfinite(resolved.velocity[0]):
            assert is_right[-1]
        else:
            assert np.isnan(resolved.azimuth[0])
    assert unknown > 0
    deviation = np.sqrt(np.sum(np.multiply(claimed, np.subtract(1.0, claimed)))) + 0.5
    assert abs(np.sum(is_right) - np.sum(claimed)) <= 3.0 * deviation


def test_frames_of_a_recording_have_hypotheses_in_a_tracker() -> None:
    def detector(frame: rc.Frame) -> rc.Detections:
        return rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=2.9 * LIMIT).resolved()

    radar, velocity = array(rc.Schedule.tdm(20e-6)), 1.5 * LIMIT
    point = rc.PointTarget([4.0, 0.5, 0.0], velocity=[velocity, 0.0, 0.0], rcs=0.1)
    recording = rc.Simulator(rc.Scene([point]), radar).record(0.0, 0.1, 100.0)
    tracks = rc.track(recording, detector=detector, velocity_ambiguity=None, max_speed=40.0)
    assert len(tracks) == 1
    assert tracks[0].velocity[-1] == pytest.approx(velocity, abs=0.5)
