"""Breathing at a place: spheres that move by a known amount, seen by a radar at rest and by one that moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import radarcore as rc
from radarcore.processing import Breathing, breathing

RADAR = rc.bgt60tr13c(num_chirps=8)
PLACE = np.array([2.0, 0.3, 0.1])
SURFACE = PLACE - [0.3, 0.0, 0.0]


def swing(time: float) -> rc.Pose:
    """To and fro by 0.2 m at up to 0.25 m/s on an arc, with a turning head."""
    angle = 0.35 * np.sin(1.25 * time)
    across = np.array([0.6 * np.cos(angle) - 0.6, 0.6 * np.sin(angle), 0.0])
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return rc.Pose(across, rotation)


MOTIONS = {"still": rc.Pose(), "moving": swing}


def frames(
    amplitude: float, motion: object, duration: float = 6.0, radar: rc.Radar = RADAR, rcs: float = 0.3
) -> rc.Recording:
    """A point that moves by an amplitude [m] at 0.27 Hz, beside a strong static one 1 m behind."""
    x, y, z = PLACE

    def chest(time: float) -> rc.Pose:
        return rc.Pose([x + amplitude * np.sin(2.0 * np.pi * 0.27 * time), y, z])

    mesh = rc.shapes.sphere(np.sqrt(rcs / np.pi), subdivisions=5)
    wall = rc.Body(rc.shapes.plate(2.0, 2.0), material=rc.materials["plasterboard"], motion=rc.Pose([3.2, 0.0, 0.0]))
    scene = rc.Scene([rc.Body(mesh, motion=chest), wall])
    return rc.Simulator(scene, radar, radar_motion=motion).record(0.0, duration, rate=20.0, progress=False)


@pytest.mark.parametrize("name", MOTIONS)
def test_movement_of_millimetres_is_breathing_and_none_is_not(name: str) -> None:
    motion = MOTIONS[name]
    found = breathing(frames(2e-3, motion), SURFACE, motion)
    assert found.is_breathing is True
    static = breathing(frames(0.0, motion), SURFACE, motion)
    assert static.is_breathing is False
    assert static.share < 0.1 < 0.5 < found.share


def test_frames_of_a_live_sensor_are_used_as_they_come() -> None:
    recording, live = frames(2e-3, swing), rc.Live()

    def arriving() -> Iterator[rc.Frame]:
        for frame in recording.frames():
            for k in range(20):  # 400 Hz: the last 256 updates are not even a second
                live.update(frame.time + k / 400, swing(frame.time + k / 400))
            yield frame

    found = breathing(arriving(), SURFACE, live)
    assert found.is_breathing is True
    assert found.share == pytest.approx(breathing(recording, SURFACE, swing).share, abs=0.05)


def test_motion_of_the_sensor_within_a_frame_does_not_matter() -> None:
    def approach(time: float) -> rc.Pose:
        return rc.Pose([0.2 * np.sin(1.25 * time), 0.0, 0.0])

    # At 0.25 m/s, a wavelength in 64 chirps: without this motion in the matched filter, the share is 0.14 lower.
    radars = (rc.bgt60tr13c(num_chirps=number) for number in (8, 64))
    short, long = (breathing(frames(2e-3, approach, radar=radar), SURFACE, approach) for radar in radars)
    assert long.share == pytest.approx(short.share, abs=0.02)


def test_share_of_a_sine_of_known_phase() -> None:
    # The mean of exp(1j a sin(x)) is the Bessel function J0(a): a tenth of a wavelength moves the phase by 0.4 pi.
    from scipy.special import j0

    amplitude = 0.1 * RADAR.waveform.wavelength
    recording = frames(amplitude, rc.Pose(), duration=7.4)  # two periods
    (share, is_breathing, reason) = vars(breathing(recording, SURFACE)).values()
    assert share == pytest.approx(1.0 - j0(0.4 * np.pi) ** 2, abs=0.03)
    assert (is_breathing, reason) == (True, "")


def test_place_without_an_echo_is_not_certain() -> None:
    recording = frames(2e-3, rc.Pose())
    beside = breathing(recording, [1.1, -0.5, 0.0])
    assert (beside.is_breathing, beside.reason) == (None, "the strongest echo is more than 0.3 m from the place")
    noise = np.random.default_rng(0).standard_normal(recording.cube.shape).astype(np.float32)
    lost = breathing(rc.Recording(noise, recording.time, RADAR), PLACE)
    assert lost.is_breathing is None
    assert "no echo" in lost.reason


def test_path_that_is_passed_once_is_not_certain() -> None:
    cart = rc.Linear(rc.Pose(), velocity=[0.05, 0.02, 0.0])
    found = breathing(frames(2e-3, cart), SURFACE, cart)
    assert found.is_breathing is None
    assert "passes its line 1.0 times, fewer than 2" in found.reason


def test_path_off_a_line_is_not_certain() -> None:
    def circle(time: float) -> rc.Pose:
        return rc.Pose([0.0, 0.1 * np.cos(2.0 * time), 0.1 * np.sin(2.0 * time)])

    found = breathing(frames(2e-3, circle), SURFACE, circle)
    assert found.is_breathing is None
    assert "leaves its line by" in found.reason


def test_refusals() -> None:
    recording = frames(0.0, rc.Pose())
    with pytest.raises(ValueError, match=r"source: expected at least 5 s and 50 frames, got 2.95 s and 60 frames"):
        breathing(recording[:60], PLACE)
    with pytest.raises(ValueError, match=r"source: .* got 0.00 s and 0 frames"):
        breathing([], PLACE)
    with pytest.raises(ValueError, match="place"):
        breathing(recording, [1.0, 2.0])
    assert isinstance(breathing(recording, PLACE), Breathing)
