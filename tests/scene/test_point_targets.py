"""Point targets end to end: every sample against the radar equation, and what symmetry leaves unchanged."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from reference import point_echo_reference

C = 299_792_458.0

TX = [[0.0, -0.004, 0.001], [0.002, 0.011, 0.0]]
RX = [[0.0, 0.003, 0.0], [0.0, 0.0, -0.0025], [0.001, 0.009, 0.002]]

CLOSED_FORM = 1e-9
"""Relative. A delay of 20 ns is known to 3e-24 s (eps / 2): 60 GHz make that 1e-12 rad."""


WAVEFORM = rc.Waveform(
    start_frequency=60e9,
    slope=2e12,
    sample_rate=1e6,
    num_samples=48,
    num_chirps=16,
    chirp_interval=300e-6,
    adc_delay=2e-6,
)


def waveform(slope: float = 2e12, **changes: Any) -> rc.Waveform:
    return WAVEFORM.replace(slope=slope, **changes)


def simulate(bodies: list[Any], radar: rc.Radar, *, time: float = 0.0, **options: Any) -> NDArray[Any]:
    """Cube in double precision; the few rays only matter where there are meshes."""
    settings: dict[str, Any] = {"resolution": 16, "tolerance": 1e-9} | options
    return rc.Simulator(rc.Scene(bodies), radar, **settings).frame(time).cube


def frame_times(wf: rc.Waveform, start: float = 0.0) -> NDArray[np.float64]:
    """Absolute time of every sample, (chirp, sample)."""
    return start + wf.chirp_times[:, None] + wf.sample_times


def at_rest(position: Any, wf: rc.Waveform) -> NDArray[np.float64]:
    return np.broadcast_to(np.asarray(position, dtype=float), (wf.num_chirps, wf.num_samples, 3))


def relative_error(got: NDArray[Any], expected: NDArray[Any]) -> float:
    """Largest error of a sample over the largest sample."""
    return float(np.abs(got - expected).max() / np.abs(expected).max())


def random_rotation(rng: np.random.Generator) -> NDArray[np.float64]:
    return rc.Pose.from_quaternion([0, 0, 0], wxyz=rng.standard_normal(4)).rotation


@pytest.mark.parametrize("slope", [2e12, -2e12], ids=["up", "down"])
@pytest.mark.parametrize(
    "pattern", [rc.IsotropicPattern(3.0), rc.GaussianPattern(7.0, 60.0, 35.0)], ids=["isotropic", "gaussian"]
)
def test_samples_of_every_channel_follow_the_radar_equation(slope: float, pattern: Any) -> None:
    radar = rc.Radar(waveform(slope), tx=TX, rx=RX, pattern=pattern, tx_power_dbm=7.0)
    position = [1.9, 0.7, -0.4]
    cube = simulate([rc.PointTarget(position, rcs=0.3)], radar)
    expected = point_echo_reference(at_rest(position, radar.waveform), 0.3, radar)
    assert cube.shape == (6, 16, 48)
    assert relative_error(cube, expected) <= CLOSED_FORM


def test_square_metre_at_two_metres_returns_the_textbook_amplitude() -> None:
    # One sample of a ramp without slope to speak of: amplitude and phase at 60 GHz. 1 W and no gain are defaults.
    wf = rc.Waveform(start_frequency=60e9, slope=1.0, sample_rate=1e6, num_samples=1)
    ((sample,),) = simulate([rc.PointTarget([2.0, 0.0, 0.0], rcs=1.0)], rc.Radar(wf))[0]
    assert abs(sample) == pytest.approx(2.804108e-05, rel=2e-7)  # the seven digits of the number on paper


@pytest.mark.parametrize(("distance", "phase"), [(0.5, 0.866456), (2.0, 3.423879), (10.0, 3.434467)])
def test_first_sample_has_the_phase_on_paper(distance: float, phase: float) -> None:
    # At the start of a ramp of 100 MHz/us; the residual video phase is in it (0.056 rad at 2 m).
    wf = rc.Waveform(start_frequency=60e9, slope=1e14, sample_rate=1e9, num_samples=1)
    ((sample,),) = simulate([rc.PointTarget([distance, 0.0, 0.0])], rc.Radar(wf))[0]
    assert np.angle(sample * np.exp(-1j * phase)) == pytest.approx(0.0, abs=1e-6)  # the digits on paper


def test_amplitude_scales_with_the_wavelength_in_the_middle_of_the_sampled_band() -> None:
    # 10 us before and 24 us of samples at 100 MHz/us: the start of the ramp would be off by 4 %.
    wf = waveform(1e14, adc_delay=10e-6, num_chirps=1, sample_rate=2e6)
    cube = simulate([rc.PointTarget([2.0, 0.0, 0.0])], rc.Radar(wf))
    wavelength = C / (60e9 + 1e14 * (10e-6 + 12e-6))
    assert np.abs(cube) == pytest.approx(wavelength / (4 * np.pi) ** 1.5 / 4.0, rel=CLOSED_FORM)


def test_real_receiver_has_the_real_part_of_the_iq_samples() -> None:
    target = rc.PointTarget([1.2, 0.3, 0.1], velocity=[0.5, 0.0, 0.0])
    iq = simulate([target], rc.Radar(waveform(), rx=RX))
    real = simulate([target], rc.Radar(waveform(), rx=RX, receiver=rc.Receiver(output="real")))
    assert real.dtype == np.float64
    np.testing.assert_array_equal(real, iq.real)


def test_default_tolerance_gives_single_precision_of_the_same_samples() -> None:
    target = rc.PointTarget([1.2, 0.3, 0.1])
    radar = rc.Radar(waveform())
    single, double = simulate([target], radar, tolerance=1e-4), simulate([target], radar)
    assert (single.dtype, double.dtype) == (np.complex64, np.complex128)
    np.testing.assert_allclose(single, double, rtol=0, atol=1e-4 * np.abs(double).max())


def test_frame_is_the_sum_of_the_frames_of_its_targets() -> None:
    seed = 3
    rng = np.random.default_rng(seed)
    targets = [
        rc.PointTarget(rng.uniform(1, 2, 3), rcs=rng.uniform(0.1, 2.0), velocity=rng.uniform(-1, 1, 3))
        for _ in range(5)
    ]
    radar = rc.Radar(waveform(), tx=TX, rx=RX)
    together = simulate(targets, radar)
    alone = np.sum([simulate([target], radar) for target in targets], axis=0)
    # Every frame may follow the motion with enough delays: each is right to 1e-9.
    assert relative_error(together, alone) <= 5 * CLOSED_FORM, f"seed {seed}"


@pytest.mark.parametrize("slope", [2e12, -2e12], ids=["up", "down"])
@pytest.mark.parametrize("velocity", [-0.7, 1.1])
def test_receding_target_has_positive_velocity(slope: float, velocity: float) -> None:
    wf = waveform(slope, num_samples=256, sample_rate=4e6, num_chirps=64)
    cube = simulate([rc.PointTarget([1.5, 0.0, 0.0], velocity=[velocity, 0.0, 0.0])], rc.Radar(wf))
    peak = rc.strongest_peak(cube, wf)
    # A hundredth of a bin; single targets are found to a thousandth of one.
    assert peak.velocity == pytest.approx(velocity, abs=0.01 * wf.velocity_resolution)
    assert peak.range == pytest.approx(1.5 + velocity * wf.duration / 2, abs=0.01 * wf.range_resolution)


# A point passes at 0.3 m and 3 m/s: 25 ms turn the line of sight by 14 degrees. Times are absolute: the frame begins
# at 10 ms, and the point is nearest in the middle of it.
PASSING = {"position": [0.3, -0.06, 0.02], "velocity": [0.0, 3.0, 0.0]}
PASSING_WAVEFORM = {"num_chirps": 64, "chirp_interval": 400e-6, "num_samples": 32}
EXACT_GEOMETRY = 1e-8
"""Relative. The series of delays and amplitudes end below 1e-9, with a few terms each."""


@pytest.mark.parametrize(
    ("radar_motion", "pattern"),
    [
        (rc.Pose.from_rpy([-0.05, 0.02, 0.03], [0.3, -0.1, 0.2]), rc.GaussianPattern(5.0, 60.0, 40.0)),
        (rc.Linear(rc.Pose.from_rpy([0.0, 0.1, 0.0], [0.1, 0.0, 0.1]), [0.5, -2.0, 0.3]), rc.IsotropicPattern()),
        (
            rc.Linear(rc.Pose([-0.05, 0.0, 0.0]), [0.2, 1.0, 0.0], [1.0, -2.0, 5.0]),
            rc.GaussianPattern(5.0, 60.0, 40.0),
        ),
    ],
    ids=["turned", "moving", "turning"],
)
def test_passing_point_follows_the_exact_geometry_of_every_sample(radar_motion: Any, pattern: Any) -> None:
    radar = rc.Radar(waveform(**PASSING_WAVEFORM), tx=TX, rx=RX, pattern=pattern)
    start = 0.01
    cube = simulate([rc.PointTarget(**PASSING)], radar, time=start, radar_motion=radar_motion)

    times = frame_times(radar.waveform, start)
    position = np.empty((*times.shape, 3))
    for index, time in np.ndenumerate(times):
        world = np.asarray(PASSING["position"]) + time * np.asarray(PASSING["velocity"])
        position[index] = radar_motion.at(time).inverse().apply(world)
    expected = point_echo_reference(position, 1.0, radar)
    assert relative_error(cube, expected) <= EXACT_GEOMETRY


@pytest.mark.filterwarnings("ignore:.* beyond max_velocity")
def test_motion_too_fast_for_the_delays_of_a_frame_is_said() -> None:
    radar = rc.Radar(waveform(**PASSING_WAVEFORM))
    target = rc.PointTarget([0.01, -1.25, 0.0], velocity=[0.0, 100.0, 0.0])  # past the antenna at 1 cm and 100 m/s
    with pytest.warns(
        UserWarning, match=r"phases .* are interpolated .* with an error of .*, above the tolerance of 1.0e-09"
    ):
        simulate([target], radar)


sphere = cache(rc.shapes.sphere)


def world(motion: rc.Pose) -> list[Any]:
    """Points and meshes of every kind of surface, moved as one."""

    def place(position: Any, rpy: Any) -> rc.Pose:
        return motion @ rc.Pose.from_rpy(position, rpy)

    def target(position: Any, velocity: Any, rcs: float) -> rc.PointTarget:
        return rc.PointTarget(motion.apply(position), rcs=rcs, velocity=motion.rotation @ np.asarray(velocity))

    turning = rc.Linear(
        place([1.3, -0.3, 0.1], [0.2, 0.4, 0.7]),
        velocity=motion.rotation @ [0.3, 0.1, -0.2],
        angular_velocity=motion.rotation @ [1.0, -2.0, 3.0],
    )
    return [
        target([1.4, 0.4, 0.2], [0.6, -0.3, 0.1], 0.01),
        rc.Body(sphere(0.15), motion=place([1.2, 0.3, -0.1], [0.1, 0.2, 0.3])),
        rc.Body(rc.shapes.box((0.2, 0.3, 0.1)), material=rc.Material(-0.5, 0.5), motion=turning),
        rc.Body(
            rc.shapes.plate(1.1, 0.9),
            material=rc.Material.lambertian(0.9),
            motion=place([2.1, 0.05, 0.0], [0.03, 0.02, 0.01]),
        ),
    ]


@pytest.mark.parametrize("kind", ["points", "meshes"])
def test_moving_world_and_radar_together_changes_nothing(kind: str) -> None:
    radar = rc.Radar(waveform(num_samples=16), tx=TX, rx=RX, pattern=rc.GaussianPattern(5.0, 70.0, 50.0))
    picked = slice(0, 1) if kind == "points" else slice(1, None)
    sensor = rc.Pose([0.02, -0.03, 0.01])
    options = {"resolution": 48, "seed": 7}
    here = simulate(world(rc.Pose())[picked], radar, radar_motion=sensor, **options)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        far = rng.standard_normal(3)
        moved = rc.Pose(1000.0 * far / np.linalg.norm(far), random_rotation(rng))
        there = simulate(world(moved)[picked], radar, radar_motion=moved @ sensor, **options)
        # Positions at 1 km are known to 1e-13 m: 3e-10 rad, a few times that with rotations and two ways.
        assert relative_error(there, here) <= 1e-8, f"seed {seed}"


@pytest.mark.parametrize("kind", ["points", "meshes"])
def test_swapping_transmitters_and_receivers_changes_nothing(kind: str) -> None:
    picked = slice(0, 1) if kind == "points" else slice(1, None)
    pattern = rc.GaussianPattern(5.0, 70.0, 50.0)
    bodies = world(rc.Pose())[picked]
    options = {"resolution": 48, "tolerance": 1e-12}
    forth = simulate(bodies, rc.Radar(waveform(num_samples=16), tx=TX, rx=RX, pattern=pattern), **options)
    back = simulate(bodies, rc.Radar(waveform(num_samples=16), tx=RX, rx=TX, pattern=pattern), **options)
    # Channel tx * num_rx + rx: the transpose. Sums of two run in the other order: rounding.
    swapped = back.reshape(3, 2, *back.shape[1:]).swapaxes(0, 1).reshape(forth.shape)
    assert relative_error(swapped, forth) <= 1e-12


def test_points_are_seen_through_everything_and_from_behind() -> None:
    # Ideal points: the pattern weighs their echo, no mesh hides it, no field of view cuts it off.
    radar = rc.Radar(waveform(num_chirps=1))
    hidden = rc.PointTarget([-2.0, 0.5, 0.0])
    wall = rc.Body(rc.shapes.plate(1.0, 1.0), material=rc.Material(0.0), motion=rc.Pose([-1.0, 0.0, 0.0]))
    expected = point_echo_reference(at_rest([-2.0, 0.5, 0.0], radar.waveform), 1.0, radar)
    with pytest.warns(UserWarning, match="no body is seen"):
        assert relative_error(simulate([wall, hidden], radar), expected) <= CLOSED_FORM


def test_target_of_no_cross_section_and_no_target_are_silent() -> None:
    radar = rc.Radar(waveform())
    assert not simulate([rc.PointTarget([1.0, 0.0, 0.0], rcs=0.0)], radar).any()
    assert not simulate([], radar).any()


def test_target_on_an_antenna_is_an_error() -> None:
    with pytest.raises(ValueError, match="expected all antennas at least 1 mm from every surface"):
        simulate([rc.PointTarget([0.0, 0.0, 0.0])], rc.Radar(waveform()))


def test_echo_is_within_the_tolerance_while_the_radar_s_acceleration_jumps() -> None:
    radar, jump, acceleration = rc.Radar(waveform(num_chirps=64), rx=RX), 7.3e-3, 4.0

    def along(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.3 * time + 0.5 * acceleration * np.maximum(time - jump, 0.0) ** 2

    def motion(time: float) -> rc.Pose:
        return rc.Pose([float(along(np.array(time))), 0.0, 0.0])

    scene, tolerance = rc.Scene([rc.PointTarget([1.9, 0.7, -0.4])]), 1e-3
    frame = rc.Simulator(scene, radar, radar_motion=motion, resolution=16, tolerance=tolerance).frame()
    position = at_rest([1.9, 0.7, -0.4], radar.waveform).copy()
    position[..., 0] -= along(frame_times(radar.waveform))
    expected = point_echo_reference(position, 1.0, radar)
    for got, wanted in zip(frame.cube, expected, strict=True):
        assert np.linalg.norm(got - wanted) <= tolerance * np.linalg.norm(wanted)
    # Coefficients of the series fall with the third power of their degree: rms errors need far fewer than largest ones.
    assert frame.stats["delay_nodes"] <= 32
