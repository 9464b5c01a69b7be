"""Static echoes, seen from a moving sensor, are removed; moving targets stay."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from ego_motion import demo, is_on_person

CHIP = rc.bgt60tr13c(
    start_frequency=60e9,
    stop_frequency=61.5e9,
    num_samples=64,
    num_chirps=64,
    chirp_interval=300e-6,
    frame_interval=25e-3,
)


def radar(output: str = "real") -> rc.Radar:
    return rc.Radar(CHIP.waveform, tx=CHIP.tx, rx=CHIP.rx, pattern=CHIP.pattern, receiver=rc.Receiver(output=output))


def frame(targets: list[Any], speed: float, of: rc.Radar, turning: float = 0.0) -> rc.Frame:
    """Frame of a sensor that moves ahead at a speed [m/s] and turns [rad/s]."""
    motion = rc.Linear(rc.Pose(), velocity=[speed, 0.0, 0.0], angular_velocity=[0.0, 0.0, turning])
    return rc.Simulator(rc.Scene(targets), of, radar_motion=motion, tolerance=1e-6).frame(0.0)


def static_points() -> list[rc.PointTarget]:
    """Strong points in many directions, from 0.6 to 2.6 m; the chip's range bins are 11 cm."""
    rng = np.random.default_rng(3)
    points = []
    for distance in np.linspace(0.6, 2.6, 6):
        for azimuth, elevation in np.deg2rad([(-50, 0), (-20, 12), (0, 0), (25, -15), (45, 5)]):
            across = np.cos(elevation)
            unit = np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])
            points.append(rc.PointTarget(distance * unit, rcs=rng.uniform(1.0, 10.0)))
    return points


def walker(velocity: float, speed: float) -> rc.PointTarget:
    """Much weaker than the points; `velocity` is its range rate seen from the sensor."""
    return rc.PointTarget([1.5, 0.0, 0.0], rcs=0.05, velocity=[velocity + speed, 0.0, 0.0])


def strongest(cube: NDArray[Any], first_bin: int = 3) -> float:
    """Power of the strongest cell of the range-Doppler map [dB], from a range bin on."""
    return float(20.0 * np.log10(np.abs(rc.range_doppler(cube, CHIP.waveform)[..., first_bin:]).max()))


def with_cube(like: rc.Frame, cube: NDArray[Any]) -> rc.Frame:
    return rc.Frame(cube, like.time, like.radar)


@pytest.mark.parametrize(("speed", "output"), [(0.25, "real"), (0.5, "iq"), (-0.5, "real")])
def test_clutter_falls_and_a_weak_walker_becomes_the_strongest_peak(speed: float, output: str) -> None:
    clutter = frame(static_points(), speed, radar(output))
    filtered = rc.remove_static(clutter, [speed, 0.0, 0.0])
    # 50 dB are promised to I/Q; real samples keep a little of the wrong sign of frequencies.
    assert strongest(clutter.cube) - strongest(filtered.cube) >= (50.0 if output == "iq" else 40.0)
    for velocity in (-1.1, 1.3):
        alone = frame([walker(velocity, speed)], speed, radar(output))
        assert abs(strongest(alone.cube) - strongest(rc.remove_static(alone, [speed, 0.0, 0.0]).cube)) <= 0.1  # [dB]
        both = with_cube(clutter, clutter.cube + alone.cube)
        limits = {"min_range": 3.0 * CHIP.waveform.range_resolution}
        before = rc.strongest_peak(both.cube, CHIP.waveform, **limits)  # type: ignore[arg-type]
        after = rc.strongest_peak(rc.remove_static(both, [speed, 0.0, 0.0]).cube, CHIP.waveform, **limits)  # type: ignore[arg-type]
        assert abs(before.velocity - velocity) > 0.5  # clutter
        assert abs(after.velocity - velocity) <= 0.1 * CHIP.waveform.velocity_resolution
        assert abs(after.range - (1.5 + 0.5 * CHIP.waveform.duration * velocity)) <= 1e-4


def test_the_walker_of_the_demo_is_found_while_the_arm_moves() -> None:
    recording, velocity = demo(5)
    assert (np.abs(velocity - [0.25, 0.0, 0.0]).max(axis=1) <= 1e-4).all()  # after the ramp
    assert not is_on_person(recording).any()
    assert not is_on_person(rc.remove_static(recording, [0.0, 0.0, 0.0])).any()
    assert is_on_person(rc.remove_static(recording, velocity)).all()


def test_strong_plates_fall_too() -> None:
    """Surfaces near by: not points far away, as the curve of angle and velocity has them."""
    plate = rc.shapes.plate(0.6, 0.6)
    plates = [
        rc.Body(plate, motion=rc.Pose.look_at([1.6, 0.3, 0.0], [0.0, 0.0, 0.0]), name="ahead"),
        rc.Body(plate, motion=rc.Pose.look_at([1.5, -1.2, 0.2], [0.0, 0.0, 0.0]), name="side"),
    ]
    clutter = frame(plates, 0.25, radar())
    filtered = rc.remove_static(clutter, [0.25, 0.0, 0.0])
    assert strongest(clutter.cube) - strongest(filtered.cube) >= 25.0


@pytest.mark.parametrize("output", ["iq", "real"])
def test_phases_of_receivers_do_not_change_what_is_left(output: str) -> None:
    phases = np.array([0.0, -75.0, 40.0])
    plain, turned = (
        frame([*static_points(), walker(0.1, 0.25)], 0.25, replace(radar(), receiver=receiver))
        for receiver in (rc.Receiver(output=output), rc.Receiver(output=output, rx_phase_deg=tuple(phases)))
    )
    expected, found = (rc.remove_static(of, [0.25, 0.0, 0.0], method="space-time").cube for of in (plain, turned))
    if output == "iq":
        np.testing.assert_allclose(
            found * np.exp(-1j * np.deg2rad(phases))[:, None, None], expected, atol=1e-5 * np.abs(plain.cube).max()
        )
    # Without the phases it is 2 dB more. Real samples keep a little of the wrong sign of frequencies.
    assert abs(strongest(found) - strongest(expected)) <= 0.02


@pytest.mark.parametrize(("method", "output"), [("doppler", "real"), ("space-time", "iq")])
def test_at_rest_the_mean_over_the_chirps_goes(method: str, output: str) -> None:
    rng = np.random.default_rng(1)
    cube = rng.normal(size=(3, 64, 64)).astype(np.float32)
    if output == "iq":
        cube = (cube + 1j * rng.normal(size=cube.shape)).astype(np.complex64)  # type: ignore[assignment]
    filtered = rc.remove_static(rc.Frame(cube, 0.0, radar(output)), [0.0, 0.0, 0.0], method=method)
    assert filtered.cube.dtype == cube.dtype
    np.testing.assert_allclose(filtered.cube, cube - cube.mean(axis=1, keepdims=True), atol=1e-6)


def test_turning_of_the_sensor_does_not_matter() -> None:
    clutter = frame(static_points(), 0.25, radar("iq"), turning=1.0)
    filtered = rc.remove_static(clutter, [0.25, 0.0, 0.0])
    assert strongest(clutter.cube) - strongest(filtered.cube) >= 40.0


def test_filter_is_a_projection_of_iq_samples_and_linear() -> None:
    rng = np.random.default_rng(2)
    cube = rng.normal(size=(3, 64, 64)) + 1j * rng.normal(size=(3, 64, 64))
    noise = rc.Frame(cube, 0.0, radar("iq"))
    for method in ("doppler", "space-time"):
        once = rc.remove_static(noise, [0.3, 0.1, 0.0], method=method)
        np.testing.assert_allclose(rc.remove_static(once, [0.3, 0.1, 0.0], method=method).cube, once.cube, atol=1e-12)
        scaled = rc.remove_static(with_cube(noise, 2j * cube), [0.3, 0.1, 0.0], method=method)
        np.testing.assert_allclose(scaled.cube, 2j * once.cube, atol=1e-12)
        # White noise loses a few dimensions of 64.
        assert 0.85 < np.mean(np.abs(once.cube) ** 2) / np.mean(np.abs(cube) ** 2) < 1.0


def test_an_array_keeps_a_slow_target_in_another_direction() -> None:
    """It closes in as fast as the clutter ahead does, but from 45 degrees to the left."""
    wavelength = CHIP.waveform.wavelength
    line = rc.Radar(CHIP.waveform, rx=[[0.0, 0.5 * wavelength * k, 0.0] for k in range(8)])
    speed, azimuths = 0.5, np.deg2rad(np.linspace(-60.0, 60.0, 25))
    rng = np.random.default_rng(0)
    clutter = frame(
        [rc.PointTarget(rng.uniform(0.8, 2.0) * np.array([np.cos(a), np.sin(a), 0.0]), rcs=2.0) for a in azimuths],
        speed,
        line,
    )
    unit = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0])
    velocity = (-0.49 + speed * unit[0]) * unit  # a range rate of -0.49 m/s seen from the sensor
    slow = frame([rc.PointTarget(1.5 * unit, rcs=0.1, velocity=velocity)], speed, line)
    losses = {}
    for method in ("doppler", "space-time"):
        fallen, lost = (
            strongest(one.cube)
            - strongest(rc.remove_static(one, [speed, 0, 0], method=method, field_of_view_deg=(130.0, 4.0)).cube)
            for one in (clutter, slow)
        )
        assert fallen >= 35.0
        losses[method] = lost
    assert losses["space-time"] < 3.0
    assert losses["doppler"] > 40.0


def test_frames_of_a_recording_have_velocities_of_their_own() -> None:
    frames = [frame(static_points()[:5], speed, radar()) for speed in (0.0, 0.25)]
    cube = np.stack([one.cube for one in frames])
    recording = rc.Recording(cube, [0.0, 0.1], radar(), source={"from": "test"})
    velocities = [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0]]
    filtered = rc.remove_static(recording, velocities)
    assert isinstance(filtered, rc.Recording)
    assert filtered.source == recording.source
    assert filtered.cube.dtype == np.float32
    for k in range(2):
        np.testing.assert_array_equal(filtered.cube[k], rc.remove_static(frames[k], velocities[k]).cube)
    same = rc.remove_static(recording, velocities[1])
    np.testing.assert_array_equal(same.cube[1], filtered.cube[1])


def test_velocities_come_from_a_motion_at_the_middle_of_each_frame() -> None:
    chip = radar()
    motion = rc.Linear(rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, 0.3]), [0.2, 0.1, 0.0], [0.0, 0.0, 1.0])
    found = frame(static_points()[:5], 0.25, chip)
    recording = rc.Recording(np.stack([found.cube, found.cube]), [0.0, 1.0], chip, source={"from": "test"})
    filtered = rc.remove_static(recording, motion)
    for time, of_recording in zip(recording.time, filtered.cube, strict=True):
        pose, rate = motion.at(time + chip.middle), motion.rate_at(time + chip.middle)
        velocity = pose.rotation.T @ (rate @ [*chip.array_center, 1.0])  # the centre turns about the origin
        np.testing.assert_allclose(of_recording, rc.remove_static(found, velocity).cube, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(rc.remove_static(found, motion).cube, filtered.cube[0])


def test_velocities_may_be_arrays_with_an_attribute_at() -> None:
    class Labelled(np.ndarray):
        """As the arrays of JAX and pandas."""

        at = None

    found = frame(static_points()[:2], 0.25, radar())
    expected = rc.remove_static(found, [0.25, 0.0, 0.0])
    np.testing.assert_array_equal(
        rc.remove_static(found, np.array([0.25, 0.0, 0.0]).view(Labelled)).cube, expected.cube
    )


def test_a_live_motion_without_a_recent_update_warns() -> None:
    found, motion = frame(static_points()[:2], 0.25, radar()), rc.Live()
    motion.update(-0.2, rc.Pose(), velocity=[0.25, 0.0, 0.0], angular_velocity=[0.0, 0.0, 0.0])
    with pytest.warns(UserWarning, match=r"motion: expected a live update within 0.1 s of a frame, got one 0.2\d* s"):
        stale = rc.remove_static(found, motion)
    np.testing.assert_allclose(stale.cube, rc.remove_static(found, [0.25, 0.0, 0.0]).cube, rtol=1e-6)


def test_frame_keeps_what_is_not_samples() -> None:
    found = frame([*static_points()[:3], walker(1.0, 0.25)], 0.25, radar())
    coded = rc.Frame(
        found.cube, 3.0, found.radar, truth=found.truth, stats=found.stats, raw=np.zeros((3, 64, 64), dtype=np.uint16)
    )
    filtered = rc.remove_static(coded, [0.25, 0.0, 0.0])
    assert (filtered.time, filtered.truth) == (3.0, found.truth)
    assert filtered.stats == found.stats | {"cube_unit": "parts of full scale"}  # no codes any more
    assert filtered.raw is None
    assert not np.shares_memory(filtered.cube, coded.cube)
