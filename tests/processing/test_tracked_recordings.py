"""Whole recordings to tracks: simulated ones against their truth, and one of a real sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from radarcore.processing.clutter.static import remove_mean
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.spectra.spectra import range_profile
from radarcore.processing.tracking.tracker import track
from radarcore.processing.tracking.tracks import assign_to_truth
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.schedule import Schedule
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scene.body import PointTarget
from radarcore.scene.scene import Scene
from radarcore.simulate.simulator import Simulator
from recordings import real_recording


def test_simulated_targets_are_tracked_to_their_truth() -> None:
    """Two targets that pass each other at 0.4 m to the left and right, with the noise of the sensor."""
    scene = Scene(
        [
            PointTarget([1.2, 0.4, 0.0], rcs=0.1, velocity=[0.8, 0.0, 0.0], name="leaving"),
            PointTarget([2.4, -0.4, 0.0], rcs=0.1, velocity=[-0.8, 0.0, 0.0], name="coming"),
        ]
    )
    radar = bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=32, chirp_interval=400e-6)
    rec = Simulator(scene, radar).record(0.0, 1.5, rate=40.0, progress=False)
    assert rec.truth is not None
    tracks = track(rec)
    named = assign_to_truth(tracks, rec.truth)
    assert sorted(map(str, named.values())) == ["coming", "leaving"]
    for one in tracks:
        truth = rec.truth.select([str(named[one.id])])
        assert (one.frame[0], one.frame[-1]) == (0, len(rec) - 1)
        assert one.longest_gap == 0
        # Point targets with a high SNR are measured to a small part of a bin; the filter allows for 5 cm of extent.
        later = slice(10, None)
        assert np.abs(one.range - truth.range[:, 0])[later].max() < rec.radar.waveform.range_resolution
        assert np.abs(one.velocity - truth.velocity[:, 0])[later].max() < rec.radar.waveform.velocity_resolution
        assert np.abs(one.azimuth - truth.azimuth[:, 0])[later].max() < np.deg2rad(5.0)


def test_target_of_doppler_division_is_one_track() -> None:
    """Velocities are known modulo twice the radar's largest, a third of the waveform's."""
    wf = bgt60tr13c(num_chirps=32, chirp_interval=400e-6).waveform
    radar = Radar(wf, tx=np.zeros((3, 3)), schedule=Schedule.ddm())
    velocity, period = -1.3 * radar.max_velocity, 2.0 * radar.max_velocity
    frames = [Frame(np.zeros((1, 32, wf.num_samples)), 0.05 * k, radar) for k in range(30)]

    def detector(frame: Frame) -> Detections:
        distance = 6.0 + velocity * frame.time
        return Detections([distance], [velocity + period], [np.nan], [np.nan], [20.0], time=frame.time)

    (one,) = track(frames, detector=detector)
    assert len(one.frame) == 30
    assert one.velocity[-1] == pytest.approx(velocity, abs=0.02)


def test_person_of_a_real_recording_is_tracked_throughout() -> None:
    """Somebody 0.30 to 0.45 m before the sensor (as published: bins 40 to 60 of 256), hardly moving but for breath."""
    rec = Recording.load(real_recording())
    moving = replace(rec, cube=remove_mean(rec.cube, axis=-4))
    tracks = track(moving, num_dimensions=1)
    person = max(tracks, key=len)
    assert (person.frame[0], person.frame[-1]) == (0, len(rec) - 1)
    assert person.longest_gap <= 5
    assert ((person.range > 0.30) & (person.range < 0.45)).all()
    # Another way to the same: the strongest range of the mean chirp, whose bins are 3 cm wide.
    power = np.square(np.abs(range_profile(moving.cube.mean(axis=2), rec.radar, num_bins=256))).sum(axis=1)
    strongest = rec.radar.waveform.range_axis(256)[np.argmax(power, axis=1)]
    apart = np.abs(person.range - strongest)
    assert np.median(apart) < 0.5 * rec.radar.waveform.range_resolution
    assert np.mean(apart < 1.5 * rec.radar.waveform.range_resolution) > 0.95  # parts of the body take turns
