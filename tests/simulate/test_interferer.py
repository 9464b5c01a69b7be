"""Interferers in a scene: power by Friis, geometry, clocks, seeds, and scene files."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive.filters import filter_gain
from radarcore.scene.interferer import chirps_between
from scene_files import check_fault, load, write

C = 299_792_458.0
CW = rc.Waveform(start_frequency=77e9, slope=0.0, sample_rate=1e6, num_samples=32, num_chirps=8, chirp_interval=40e-6)
FMCW = rc.Waveform.from_sweep(
    start_frequency=77e9, stop_frequency=77.2e9, sample_rate=2e6, num_samples=64, num_chirps=16, chirp_interval=40e-6
)
CROSSING = FMCW.replace(start_frequency=77.2e9, slope=-FMCW.slope)
FILTER = rc.Receiver(low_pass=0.5e6)
"""Of a receiver that has none: half of the sample rate."""
HORN = rc.GaussianPattern(15.0, beamwidth_azimuth_deg=30.0, beamwidth_elevation_deg=20.0)

Array = NDArray[Any]


def tone(offset: float, **options: Any) -> rc.Interferer:
    """A CW interferer at an offset from 77 GHz [Hz], on all the time."""
    motion = options.pop("motion", rc.Pose([3.0, 4.0, 0.0]))
    wf = rc.Waveform(start_frequency=77e9 + offset, slope=0.0, sample_rate=1e6, num_samples=1000)
    radar = rc.Radar(wf, **{"tx_power_dbm": 10.0, **options})
    return rc.Interferer(radar, motion)


def cube_of(parts: list[Any], radar: rc.Radar | None = None, time: float = 0.0, **options: Any) -> Array:
    radar = rc.Radar(CW) if radar is None else radar
    cube: Array = rc.Simulator(rc.Scene(parts), radar, tolerance=1e-8, **options).frame(time).cube
    return cube


def power_of(parts: list[Any], radar: rc.Radar | None = None, **options: Any) -> float:
    return float(np.mean(np.abs(cube_of(parts, radar, **options)) ** 2))


def friis(frequency: float, distance: float, power: float = 1e-2) -> float:
    return power * (C / frequency / (4.0 * np.pi * distance)) ** 2


# --- The direct path


def test_cw_interferer_is_a_tone_of_friis_power_at_the_difference_of_frequencies() -> None:
    offset = 1.1e5
    cube = cube_of([tone(offset)])[0]
    gain = filter_gain(FILTER, offset)
    power = friis(77e9 + offset, 5.0) * abs(gain) ** 2
    np.testing.assert_allclose(np.abs(cube) ** 2, power, rtol=1e-6)
    times = CW.chirp_times[:, None] + CW.sample_times
    # Ours minus the other: one phase through all chirps.
    coherent = np.abs(np.mean(cube * np.exp(2j * np.pi * offset * times))) ** 2
    assert coherent == pytest.approx(power, rel=1e-6)


def test_gains_are_those_of_the_directions_in_either_frame() -> None:
    here = rc.Pose.from_rpy([0.0, 0.0, 0.5], [0.1, 0.2, 0.3])
    there = rc.Pose.from_rpy([3.0, 1.0, 0.0], [0.2, -0.1, 2.9])
    gains = 1.0
    for pose, target in ((here, there), (there, here)):
        x, y, z = pose.inverse().apply(target.position)
        gains *= float(HORN.gain(np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))))
    distance = float(np.linalg.norm(here.position - there.position))
    found = power_of([tone(0.0, pattern=HORN, motion=there)], rc.Radar(CW, pattern=HORN), radar_motion=here)
    assert found == pytest.approx(gains * friis(77e9, distance), rel=1e-6)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0])
def test_polarisation_that_does_not_match_takes_the_squared_cosine(angle_deg: float) -> None:
    roll = rc.Pose.from_rpy([5.0, 0.0, 0.0], [np.deg2rad(angle_deg), 0.0, 0.0])
    ours = rc.Radar(CW, polarization="vertical")
    found = power_of([tone(0.0, motion=roll, polarization="vertical")], ours)
    expected = friis(77e9, 5.0) * np.cos(np.deg2rad(angle_deg)) ** 2
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-30)
    assert power_of([tone(0.0, motion=roll)], ours) == pytest.approx(friis(77e9, 5.0), rel=1e-6)


def test_every_receiver_has_the_phase_of_its_place() -> None:
    quarter = 0.25 * C / 77e9
    ours = rc.Radar(CW, rx=[[0.0, 0.0, 0.0], [0.0, quarter, 0.0]])
    cube = cube_of([tone(0.0, motion=rc.Pose([0.0, 200.0, 0.0]))], ours)
    # A quarter of a wavelength nearer: a quarter of a turn less delay.
    np.testing.assert_allclose(np.angle(cube[1] / cube[0]), -0.5 * np.pi, atol=1e-6)


def test_body_between_the_radars_occludes_the_direct_path() -> None:
    for y, num_hit in ((2.0, 0), (-2.0, CW.num_chirps)):  # between them, and beside
        wall = rc.Body(rc.shapes.plate(0.5, 0.5), motion=rc.Pose.look_at([1.5, y, 0.0], [0.0, 0.0, 0.0]))
        stats = rc.Simulator(rc.Scene([wall, tone(1e5)]), rc.Radar(CW)).frame().stats
        assert (stats["interference_power"] > 0.0, stats["chirps_hit"]) == (num_hit > 0, num_hit)


def test_receding_interferer_has_a_tone_of_its_doppler_shift() -> None:
    away = rc.Linear(rc.Pose([5.0, 0.0, 0.0]), velocity=[50.0, 0.0, 0.0])
    wf = CW.replace(num_chirps=32)
    cube = cube_of([tone(0.0, motion=away)], rc.Radar(wf))[0]
    times = (wf.chirp_times[:, None] + wf.sample_times).ravel()
    turns = np.polyfit(times, np.unwrap(np.angle(cube.ravel())) / (2.0 * np.pi), 1)
    assert turns[0] == pytest.approx(77e9 * 50.0 / C, rel=1e-8)


def test_interferer_adds_to_the_echoes_and_changes_nothing_else() -> None:
    bodies = [rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([2.0, 0.0, 0.0])), rc.PointTarget([1.0, 0.2, 0.0])]
    radar = rc.Radar(FMCW)
    other = rc.Interferer(rc.Radar(CROSSING, tx_power_dbm=0.0), rc.Pose([5.0, 1.0, 0.0]))
    without, alone, both = (
        rc.Simulator(rc.Scene(parts), radar).frame(0.1) for parts in (bodies, [other], [*bodies, other])
    )
    assert both.truth is not None
    assert both.truth.names == rc.Scene(bodies).names
    assert without.truth is not None
    assert np.array_equal(both.truth.range, without.truth.range)
    assert "interference_power" not in without.stats
    single = 1e-6 * np.abs(both.cube).max()  # complex64
    np.testing.assert_allclose(both.cube - without.cube, alone.cube, rtol=0.0, atol=single)


# --- Ghosts, clocks and phases


def ghost(start_phase: str) -> Array:
    """Range-Doppler map (velocity, range) of an interferer like us that starts 0.1 us later, 3 m away."""
    like_us = rc.Radar(FMCW.replace(frame_interval=1e-3), tx_power_dbm=0.0)
    other = rc.Interferer(like_us, rc.Pose([3.0, 0.0, 0.0]), start=1e-7, start_phase=start_phase)
    return np.abs(np.asarray(rc.range_doppler(cube_of([other], rc.Radar(FMCW)), FMCW))[0])


def test_interferer_like_us_is_a_ghost_at_half_the_delay_of_its_clock() -> None:
    spectrum = ghost("frame")
    velocity, distance = np.unravel_index(spectrum.argmax(), spectrum.shape)
    expected = 0.5 * (C * 1e-7 + 3.0)
    assert abs(FMCW.range_axis()[distance] - expected) <= 0.5 * FMCW.range_resolution
    assert FMCW.velocity_axis()[velocity] == 0.0


def test_phase_anew_in_every_chirp_spreads_the_ghost_over_all_velocities() -> None:
    focused, spread = (np.sort(ghost(phase).max(axis=1)) for phase in ("frame", "chirp"))
    # 16 chirps: a peak of 16 amplitudes, or of about 4 at many velocities.
    assert focused[-1] > 1.5 * spread[-1]
    assert np.median(spread) > 0.1 * spread[-1]
    assert np.median(focused) < 0.1 * focused[-1]


def test_drift_of_its_clock_shifts_frequency_slope_and_times() -> None:
    other = rc.Interferer(rc.Radar(FMCW.replace(frame_interval=1e-3)), rc.Pose(), start=0.25e-3, drift_ppm=20.0)
    starts, frame, chirp = chirps_between(other, 0.0, 2e-3, 0.0)
    clock = 1.0 + 20e-6
    np.testing.assert_allclose(starts, 0.25e-3 + frame * 1e-3 / clock + FMCW.chirp_times[chirp] / clock, atol=1e-15)
    shifted = tone(0.0)
    shifted = rc.Interferer(shifted.radar, shifted.motion, drift_ppm=1.0)  # 77 kHz
    cube = cube_of([shifted])[0]
    times = CW.chirp_times[:, None] + CW.sample_times
    coherent = np.abs(np.mean(cube * np.exp(2j * np.pi * 77e3 * times))) ** 2
    assert coherent == pytest.approx(np.mean(np.abs(cube) ** 2), rel=1e-6)


@pytest.mark.parametrize("origin", [-3.7, 0.0, 0.013, 1.7e9])
def test_chirps_of_any_time_are_all_there(origin: float) -> None:
    other = rc.Interferer(rc.Radar(FMCW), rc.Pose(), start=0.1, rate=400.0)
    begin, end = -1e-3, 6e-3
    starts, frame, chirp = chirps_between(other, begin, end, origin)
    assert (np.diff(starts) > 0.0).all()
    # Numbers of frames count from the start; their time is known to the rounding of the origin.
    expected = 0.1 - origin + frame / 400.0 + FMCW.chirp_times[chirp]
    np.testing.assert_allclose(starts, expected, rtol=0.0, atol=4.0 * np.spacing(abs(origin) + 1.0))
    # All that last into the time: sixteen chirps in each of the frames, at most three begin or last in 7 ms.
    whole = [number for number in np.unique(frame) if (frame == number).sum() == 16]
    assert len(whole) >= 1
    assert (starts <= end).all()
    assert (starts + other.ramp_duration >= begin).all()


def test_same_seed_gives_the_same_bits() -> None:
    body = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([3.0, 0.0, 0.0]), velocity=[1.0, 0.0, 0.0]))
    other = rc.Interferer(rc.Radar(CROSSING, tx_power_dbm=0.0), rc.Pose([5.0, 1.0, 0.0]), rate=700.0)
    radar = rc.Radar(FMCW, rx=[[0, 0, 0], [0, 2e-3, 0]], receiver=rc.Receiver(noise_figure_db=10.0))
    scene = rc.Scene([body, other])

    sims = [rc.Simulator(scene, radar, resolution=32, **options) for options in ({"threads": 1}, {"seed": 1})]
    first, seed = (sim.record(0.0, 0.1, 20.0, progress=False) for sim in sims)
    assert np.array_equal(sims[0].frame(float(first.time[1])).cube, first.cube[1])
    assert not np.array_equal(first.cube, seed.cube)
    assert not np.array_equal(first.cube[0], first.cube[1])
    assert first.source["interferers"] == ["interferer 0"]


def test_chirp_that_lasts_into_two_frames_has_one_phase() -> None:
    long = rc.Waveform(start_frequency=77e9, slope=1e9, sample_rate=1e6, num_samples=1000)
    other = rc.Interferer(rc.Radar(long), rc.Pose([3.0, 0.0, 0.0]))
    sim = rc.Simulator(rc.Scene([other]), rc.Radar(CW.replace(num_chirps=1)))
    # Phases of the same chirp at two times, back to its start.
    phases = []
    for time in (300e-6, 500e-6):
        cube = sim.frame(time).cube[0, 0]
        u = CW.sample_times
        t = time + u - 3.0 / C
        own, sent = 77e9 * u, 77e9 * t + 0.5e9 * t**2
        settled = np.angle(cube * np.exp(-2j * np.pi * ((own - sent) % 1.0)))
        response = np.angle(filter_gain(FILTER, -1e9 * t))
        phases.append(np.exp(1j * (settled - response)).mean())
    # 1e-4 of a turn: phases of 4e7 turns, and the response to the slope.
    assert np.angle(phases[0] / phases[1]) == pytest.approx(0.0, abs=1e-2)


def test_transmitters_of_an_interferer_add_up() -> None:
    wavelength = C / 77e9
    pair = tone(0.0, motion=rc.Pose([5.0, 0.0, 0.0]), tx=[[0.0, 0.0, 0.0], [0.5 * wavelength, 0.0, 0.0]])
    # Half a wavelength of path difference: they cancel except for the difference of their distances, lambda / 2 of 5 m.
    assert power_of([pair]) < 1e-5 * friis(77e9, 5.0)


PAIR = [[0.0, 0.0, 0.0], [0.0, 4e-3, 0.0]]


@pytest.mark.parametrize("schedule", [rc.Schedule.ddm(), rc.Schedule.steered(azimuth=0.3)], ids=["ddm", "steered"])
def test_receivers_of_transmitters_that_send_at_once_get_the_signal_once(schedule: rc.Schedule) -> None:
    together = cube_of([tone(1.1e5)], rc.Radar(CW, tx=PAIR, schedule=schedule))
    np.testing.assert_allclose(together, cube_of([tone(1.1e5)], rc.Radar(CW, tx=PAIR[:1])), rtol=1e-9)


def test_transmitters_in_turn_get_the_signal_of_their_times() -> None:
    interval, offset = 12e-6, 1.1e5
    radar = rc.Radar(CW.replace(num_samples=8), tx=PAIR, schedule=rc.Schedule.tdm(interval=interval))
    first, second = cube_of([tone(offset)], radar)
    # Both are the same tone, at the same receiver.
    turn = np.exp(2j * np.pi * offset * interval * np.sign(np.angle(first[0, 1] / first[0, 0])))
    np.testing.assert_allclose(second, first * turn, rtol=1e-6)


def test_sub_sequences_are_disturbed_by_themselves() -> None:
    up, down = FMCW.alternating()
    both = rc.Radar([up, down])
    other = rc.Interferer(rc.Radar(CROSSING), rc.Pose([3.0, 0.0, 0.0]))
    simulator = rc.Simulator(rc.Scene([other]), both, tolerance=1e-8)
    frame, num_hit = simulator.frame(0.0), 0
    for part, waveform in zip(frame.sequences(), (up, down), strict=True):
        alone = rc.Simulator(rc.Scene([other]), rc.Radar(waveform), tolerance=1e-8).frame(0.0)
        np.testing.assert_allclose(part.cube, alone.cube, rtol=1e-9)
        num_hit += alone.stats["chirps_hit"]
    assert frame.stats["chirps_hit"] == num_hit


def test_phase_noise_of_echoes_leaves_the_signal_alone() -> None:
    quiet, noisy = (
        rc.Radar(FMCW, receiver=rc.Receiver(phase_noise=pairs)) for pairs in (None, ((1e4, -70.0), (1e6, -90.0)))
    )
    expected = cube_of([tone(1e8)], quiet)
    assert np.abs(expected).max() > 0.0
    np.testing.assert_allclose(cube_of([tone(1e8)], noisy), expected, rtol=1e-9)


# --- Descriptions


def test_scene_keeps_interferers_beside_bodies() -> None:
    other, point = tone(0.0), rc.PointTarget([1.0, 0.0, 0.0], name="a")
    scene = rc.Scene([other, point])
    assert (scene.bodies, scene.interferers, scene.names) == ((point,), (other,), ("a",))
    assert repr(scene) == "<Scene: a, interferer 0>"
    again = pickle.loads(pickle.dumps(scene))
    assert again.names == scene.names
    assert len(again.interferers) == 1
    with pytest.raises(ValueError, match="names that differ, got 'a'"):
        rc.Scene([point, rc.Interferer(other.radar, other.motion, name="a")])


def test_interferer_at_our_antenna_is_refused() -> None:
    with pytest.raises(ValueError, match=r"interferer: expected antennas at least 1 mm from ours, got 0\.1 mm"):
        cube_of([tone(0.0, motion=rc.Pose([1e-4, 0.0, 0.0]))])


def test_interferer_inside_of_a_body_or_at_a_point_is_refused() -> None:
    box = rc.Body(rc.shapes.box([0.2, 0.2, 0.2]), motion=rc.Pose([3.0, 4.0, 0.0]), name="box")
    for part, message in ((box, "got them inside 'box'"), (rc.PointTarget([3.0, 4.0, 0.0]), "to 'point 0'")):
        with pytest.raises(ValueError, match=f"motion of 'interferer 0': expected .* {message}"):
            cube_of([part, tone(0.0)])


def test_picture_from_above_names_interferers() -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    other = rc.Interferer(rc.Radar(CW), rc.Pose([3.0, 1.0, 0.0]), name="other")
    ax = rc.plot.scene_from_above(rc.Scene([rc.PointTarget([1.0, 0.0, 0.0]), other]))
    assert {"other", "point 0", "radar"} <= {text.get_text() for text in ax.texts}


TABLE = """
[[interferer]]
name = "other"
radar = { preset = "bgt60tr13c", num_chirps = 16, tx_power_dbm = 3.0 }
pose = { position = [4.0, 0.0, 0.0], rpy_deg = [0.0, 0.0, 180.0] }
motion = { kind = "linear", velocity = [0.0, 1.0, 0.0] }
start = 1e-3
rate = 30.0
drift_ppm = 5.0
start_phase = "frame"
"""


def test_scene_file_has_interferers(tmp_path: Path) -> None:
    simulation = load(tmp_path, TABLE)
    (other,) = simulation.scene.interferers
    assert (other.name, other.start, other.rate, other.drift_ppm) == ("other", 1e-3, 30.0, 5.0)
    assert (other.start_phase, other.radar.tx_power_dbm) == ("frame", 3.0)
    assert other.motion.at(1.0).position == pytest.approx([4.0, 1.0, 0.0])
    assert simulation.simulator().frame().stats["interferers"] == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("rate = 30.0", "rate = 3e4"), "interferer[0] 'other': rate: expected at most"),
        (("preset =", "presets ="), "interferer[0] 'other': radar: unknown key 'presets'; did you mean 'preset'"),
        (("drift_ppm", "drift"), "interferer[0] 'other': unknown key 'drift'; did you mean 'drift_ppm'"),
    ],
)
def test_faults_of_a_scene_file_are_named(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    check_fault(write(tmp_path, TABLE.replace(*change)), message)
