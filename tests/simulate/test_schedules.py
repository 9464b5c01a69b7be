"""Schedules of transmitters and sub-sequences of a frame: received samples of a scene.

The slow truth is the direct sum of eq. (1) over the exact positions of a point at the time of every sample,
`point_echo_reference`, transmitter by transmitter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.simulate.engine import at_receivers, ramps_of
from reference import point_echo_reference

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=15e12, sample_rate=2e6, num_samples=32, num_chirps=16, chirp_interval=200e-6
)
TX = [[0.0, -5e-3, 0.0], [0.0, 0.0, 5e-3], [0.0, 5e-3, 0.0]]
RX = [[0.0, -1.25e-3, 0.0], [0.0, 1.25e-3, 0.0]]
POSITION, VELOCITY = np.array([2.0, 0.5, -0.3]), np.array([1.5, -0.4, 0.2])
TOLERANCE = 1e-6


def radar_of(schedule: rc.Schedule | None, waveform: Any = WAVEFORM, **others: Any) -> rc.Radar:
    return rc.Radar(waveform, tx=TX, rx=RX, schedule=schedule, **others)


def frame_of(radar: rc.Radar, velocity: Any = VELOCITY, position: Any = POSITION, **settings: Any) -> rc.Frame:
    scene = rc.Scene([rc.PointTarget(position, rcs=1.0, velocity=velocity)])
    return rc.Simulator(scene, radar, **{"tolerance": TOLERANCE, "resolution": 16, **settings}).frame()


def close(cube: NDArray[Any], expected: NDArray[Any]) -> None:
    """Within the tolerance, which is relative to the amplitudes, with twice that for rounding to complex64."""
    np.testing.assert_allclose(cube, expected, rtol=0, atol=3.0 * TOLERANCE * np.abs(expected).max())


def exact(radar: rc.Radar, waveform: rc.Waveform, offset: float = 0.0) -> NDArray[np.complex128]:
    """All pairs of antennas with ramps that start `offset` [s] after the chirps of a waveform."""
    time = offset + waveform.chirp_times[:, None] + waveform.sample_times
    alone = rc.Radar(waveform, tx=radar.tx, rx=radar.rx)
    return point_echo_reference(POSITION + time[..., None] * VELOCITY, 1.0, alone)


# Transmitters in turn.


STAGGERED = WAVEFORM.replace(num_chirps=5, chirp_times=np.cumsum([0.0, 150e-6, 200e-6, 170e-6, 230e-6]))


@pytest.mark.parametrize(
    ("schedule", "interval", "order", "waveform"),
    [
        (rc.Schedule.tdm(), 200e-6 / 3, (0, 1, 2), WAVEFORM),
        (rc.Schedule.tdm(order=(2, 0, 1)), 200e-6 / 3, (2, 0, 1), WAVEFORM),
        (rc.Schedule.tdm(interval=16 * 200e-6), 16 * 200e-6, (0, 1, 2), WAVEFORM),  # one transmitter after the other
        (rc.Schedule.tdm(), 50e-6, (0, 1, 2), STAGGERED),  # the shortest interval, over three
    ],
)
def test_tdm_channels_are_exact_sums_at_their_own_times(
    schedule: rc.Schedule, interval: float, order: tuple[int, ...], waveform: rc.Waveform
) -> None:
    radar = radar_of(schedule, waveform)
    cube = frame_of(radar).cube
    for turn, tx in enumerate(order):
        channels = slice(2 * tx, 2 * tx + 2)
        np.testing.assert_allclose(radar.channel_offsets[channels], turn * interval, rtol=1e-14)
        close(cube[channels], exact(radar, waveform, turn * interval)[channels])


def test_phase_between_transmitters_of_a_moving_target_is_that_of_its_doppler_frequency() -> None:
    """Transmitters at one place: between their turns the target moves on, and nothing else differs."""
    speed, interval = 3.0, 60e-6
    radar = rc.Radar(WAVEFORM, tx=[[0.0, 0.0, 0.0]] * 2, rx=RX, schedule=rc.Schedule.tdm(interval))
    cube = frame_of(radar, velocity=[speed, 0.0, 0.0], position=[2.0, 0.0, 0.0]).cube
    phase = np.angle(np.vdot(cube[0], cube[2]))
    doppler = 2.0 * speed / WAVEFORM.wavelength
    # 0.91 rad. The range grows by 0.18 mm, 3e-4 of a bin: the phase is exact to pi times that.
    assert phase == pytest.approx(2.0 * np.pi * doppler * interval, abs=1e-3)
    still = frame_of(radar, velocity=[0.0, 0.0, 0.0], position=[2.0, 0.0, 0.0]).cube
    close(still[2:], still[:2])


def test_tdm_of_a_surface_is_that_of_pairs_received_at_all_ramps() -> None:
    """With bodies that turn, so that rays are cast in parts, and reflections between them."""
    corner = rc.Body(
        rc.shapes.dihedral(0.3), motion=rc.Linear(rc.Pose([1.0, 0.1, 0.0]), [1.0, 0.0, 0.0], [0.0, 0.0, 15.0]), name="a"
    )
    settings: dict[str, Any] = {"resolution": 64, "max_bounces": 3, "retrace_deg": 0.5, "sampling": "footprint"}
    scene = rc.Scene([corner])
    turns = rc.Simulator(scene, radar_of(rc.Schedule.tdm()), **settings).frame()
    ramps = WAVEFORM.replace(num_chirps=48, chirp_interval=200e-6 / 3)
    everything = rc.Simulator(scene, radar_of(None, ramps), **settings).frame()
    assert turns.stats["casts"] > 1
    assert turns.stats["bounce_paths"] > 0
    assert turns.truth is not None
    assert everything.truth is not None
    for tx in range(3):
        mine = slice(2 * tx, 2 * tx + 2)
        # Chirp times differ by rounding, 1e-19 s.
        expected = everything.cube[mine, tx::3]
        np.testing.assert_allclose(turns.cube[mine], expected, rtol=0, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(turns.truth.range, everything.truth.range, rtol=1e-12)


# Transmitters at once.


def weighted(radar: rc.Radar, weights: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Sum over transmitters of what each alone gives times the conjugate of its weight (chirp, tx)."""
    alone = exact(radar, WAVEFORM).reshape(3, 2, 16, 32)
    return np.einsum("mt,trmn->rmn", np.conj(weights), alone)


def test_steered_cube_is_the_weighted_sum_of_the_transmitters() -> None:
    rng = np.random.default_rng(3)
    turns = rng.uniform(size=(16, 3))
    for weights in (0.8 * np.exp(2j * np.pi * turns), np.array([1.0, 0.5j, -0.3])):
        radar = radar_of(rc.Schedule.steered(weights))
        cube = frame_of(radar).cube
        assert cube.shape == (2, 16, 32)
        close(cube, weighted(radar, np.broadcast_to(weights, (16, 3))))


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(0.0, 0.0), (25.0, 0.0), (-40.0, 10.0), (15.0, -30.0)])
def test_beam_towards_a_far_target_has_the_amplitudes_of_all_transmitters_added(
    azimuth_deg: float, elevation_deg: float
) -> None:
    az, el = np.deg2rad([azimuth_deg, elevation_deg])
    direction = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    narrow = WAVEFORM.replace(slope=1e9, num_samples=4, num_chirps=2)
    far: dict[str, Any] = {"velocity": [0.0, 0.0, 0.0], "position": 50.0 * direction}
    each = np.abs(frame_of(radar_of(None, narrow), **far).cube).max()
    beam = np.abs(frame_of(radar_of(rc.Schedule.steered(azimuth=az, elevation=el), narrow), **far).cube)
    # Parts of the array are 5 mm from its middle: at 50 m waves are curved by 0.25 um, 3e-4 rad of 60 GHz.
    np.testing.assert_allclose(beam, 3.0 * each, rtol=1e-4)
    away = np.abs(frame_of(radar_of(rc.Schedule.steered(azimuth=-az - 0.5), narrow), **far).cube).max()
    assert away < 2.5 * each


@pytest.mark.parametrize(
    ("turns", "output", "is_falling"),
    [(None, "iq", False), ([0.0, 0.25, 0.5], "real", True), ([0.5, 0.0, 0.25], "iq", True), (None, "real", False)],
)
def test_demultiplexed_ddm_of_a_slow_target_is_what_transmitters_apart_give(
    turns: list[float] | None, output: str, is_falling: bool
) -> None:
    slope = -WAVEFORM.slope if is_falling else WAVEFORM.slope
    waveform = WAVEFORM.replace(num_chirps=48, slope=slope)
    receiver = rc.Receiver(output=output)
    radar = radar_of(rc.Schedule.ddm(turns), waveform, receiver=receiver)
    # In the middle of bins: rectangular windows then leak nothing from one transmitter into another, but for the
    # curvature of the motion and the walk through range, 48 chirps * 0.2 ms * 0.26 m/s = 2.5 mm, 4e-3 of a bin.
    velocity = 2.0 * waveform.velocity_resolution
    far: dict[str, Any] = {"velocity": [velocity, 0.0, 0.0], "position": [2.0, 0.0, 0.0]}
    transform: dict[str, Any] = {"window": "hann", "doppler_window": None}
    apart = rc.range_doppler(frame_of(radar_of(None, waveform, receiver=receiver), **far), **transform)
    frame = frame_of(radar, **far)
    assert frame.cube.shape == (2, 48, 32)
    found = rc.demultiplex(rc.range_doppler(frame, **transform), radar)
    width = 16 if turns is None else 12
    assert found.spectrum.shape == (6, width, apart.shape[-1])
    np.testing.assert_array_equal(found.velocity, waveform.velocity_axis()[24 - width // 2 : 24 + width // 2])
    expected = apart[:, 24 - width // 2 : 24 + width // 2]
    np.testing.assert_allclose(found.spectrum, expected, rtol=0, atol=0.01 * np.abs(expected).max())
    row, column = np.unravel_index(np.abs(found.spectrum[0]).argmax(), found.spectrum.shape[1:])
    assert abs(found.velocity[row] - velocity) < 1e-9
    assert abs(waveform.range_axis()[column] - 2.0) <= 0.5 * waveform.range_resolution


def test_noise_comes_after_the_sum_of_transmitters() -> None:
    """The receivers have the noise of two channels for any number of transmitters."""
    noisy = rc.Receiver(noise_figure_db=10.0)
    shy = radar_of(rc.Schedule.ddm(), receiver=noisy, tx_power_dbm=-300.0)
    cube = frame_of(shy).cube
    # 1024 complex samples: the power is known to 3 %, four times that.
    assert np.mean(np.abs(cube) ** 2) == pytest.approx(noisy.noise_variance(2e6), rel=0.125)
    one = rc.Radar(WAVEFORM, rx=RX, receiver=noisy, tx_power_dbm=-300.0)
    np.testing.assert_allclose(cube, frame_of(one).cube, rtol=1e-6)


# Sub-sequences.

SEQUENCES = (
    WAVEFORM,
    WAVEFORM.replace(slope=-10e12, start_frequency=62e9, num_chirps=8, chirp_interval=90e-6).delayed(16 * 200e-6),
)


@pytest.mark.parametrize("schedule", [None, rc.Schedule.tdm(interval=25e-6), rc.Schedule.ddm()])
def test_sub_sequences_are_frames_of_their_own_radars(schedule: rc.Schedule | None) -> None:
    radar = radar_of(schedule, SEQUENCES, receiver=rc.Receiver(noise_figure_db=3.0), tx_power_dbm=-60.0)
    frame = frame_of(radar)
    assert frame.cube.shape == (radar.num_channels, 24, 32)
    first, second = frame.sequences()
    assert (first.radar.waveform, second.radar.waveform) == SEQUENCES
    assert (first.radar.waveforms, first.time, second.time) == ((WAVEFORM,), frame.time, frame.time)
    np.testing.assert_array_equal(first.cube, frame_of(first.radar).cube)
    # Noise of the second is its own.
    silent = frame_of(replace(second.radar, receiver=None)).cube
    noise = second.cube - silent
    assert np.mean(np.abs(noise) ** 2) == pytest.approx(radar.receiver.noise_variance(2e6), rel=0.2)  # 4 / sqrt(512)
    own = frame_of(second.radar).cube - silent
    assert np.abs(np.vdot(noise, own)) < 0.2 * np.linalg.norm(noise) * np.linalg.norm(own)


def test_sub_sequences_are_exact_sums_at_their_times() -> None:
    radar = radar_of(None, SEQUENCES)
    for part, waveform in zip(frame_of(radar).sequences(), SEQUENCES, strict=True):
        close(part.cube, exact(radar, waveform))


def test_alternating_chirps_give_range_and_velocity_by_both_slopes() -> None:
    """Up and down: R' = R +- f v / S, so that half of the sum is the range and half of the difference the velocity."""
    waveform = WAVEFORM.replace(num_samples=64, num_chirps=64, chirp_interval=100e-6, adc_delay=4e-6)
    radar = rc.Radar(waveform.alternating())
    position, velocity = 2.0, -4.0
    up, down = frame_of(radar, velocity=[velocity, 0.0, 0.0], position=[position, 0.0, 0.0]).sequences()
    at_middle = position + velocity * 0.5 * radar.duration
    apparent = []
    for part in (up, down):
        peak = rc.strongest_peak(part.cube, part.radar.waveform)
        assert peak.velocity == pytest.approx(velocity, abs=0.002 * part.radar.waveform.velocity_resolution)
        assert peak.range == pytest.approx(at_middle, abs=0.05 * part.radar.waveform.range_resolution)
        bins = 4096
        power = np.abs(rc.range_profile(part, num_bins=bins)).sum(axis=(0, 1))
        apparent.append(float(part.radar.waveform.range_axis(bins)[power.argmax()]))
    factor = waveform.center_frequency / waveform.slope
    # Bins of a 64th: half of one each. Profiles are means over the frame, whose middle the truth is of.
    step = 0.5 * waveform.range_resolution / 64
    assert 0.5 * (apparent[0] + apparent[1]) == pytest.approx(at_middle, abs=2.0 * step)
    assert 0.5 * (apparent[0] - apparent[1]) / factor == pytest.approx(velocity, abs=2.0 * step / factor)


@pytest.mark.parametrize("schedule", [rc.Schedule.tdm(20e-6), rc.Schedule.ddm(), rc.Schedule.steered(azimuth=0.2)])
def test_depth_images_have_schedules_too(schedule: rc.Schedule) -> None:
    """Their receivers get those ramps and sums, tested above, of what every transmitter sends by itself."""
    distance = np.full((1, 1), 1.5)
    shared: dict[str, Any] = {"camera": (10.0, 10.0), "previous": distance - 0.05, "interval": 25e-3, "tolerance": 1e-6}
    shared["normals"] = [[[-1.0, 0.0, 0.0]]]
    whole = radar_of(schedule, SEQUENCES)
    parts = []
    for part in whole.sequences():
        alone = rc.frame_from_depth(distance, 1.0, radar_of(None, ramps_of(part)), **shared)
        parts.append(at_receivers(alone.cube, part))
    close(rc.frame_from_depth(distance, 1.0, whole, **shared).cube, np.concatenate(parts, axis=1))
