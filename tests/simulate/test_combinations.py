"""Receivers, schedules, sub-sequences and interferers together, as no other file has them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc

SCHEDULES = [None, rc.Schedule.tdm(), rc.Schedule.ddm(), rc.Schedule.steered(azimuth=np.deg2rad(20.0))]
MEASURED = rc.bgt60tr24(receiver="measured", if_gain_db=23)


def name_of(schedule: rc.Schedule | None) -> str:
    return "none" if schedule is None else schedule.kind


@pytest.mark.parametrize("schedule", SCHEDULES, ids=name_of)
def test_frames_are_the_same_alone_in_recordings_on_threads_and_from_files(
    schedule: rc.Schedule | None, tmp_path: Path
) -> None:
    """The whole chain with codes and phase noise, up- and down-chirps, and an interferer that crosses them."""
    up, down = MEASURED.waveform.replace(num_chirps=8).alternating()
    radar = replace(MEASURED, waveform=(up, down), schedule=schedule)
    other = rc.Radar(up.replace(start_frequency=63.5e9, slope=-up.slope), tx_power_dbm=10.0)
    facing = rc.Pose.look_at([3.0, 0.5, 0.0], [0.0, 0.0, 0.0])
    ball = rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([0.5, -0.2, 0.0]), velocity=[0.4, 0.0, 0.0]))
    scene = rc.Scene([ball, rc.Interferer(other, facing, rate=40.0)])
    one, two = (rc.Simulator(scene, radar, threads=threads, seed=3, resolution=32) for threads in (1, 2))
    recording = two.record(0.0, 0.075, progress=False)
    first = one.frame(0.0)
    assert first.stats["chirps_hit"] > 0
    assert first.raw is not None
    assert recording.raw is not None
    np.testing.assert_array_equal(first.raw, recording.raw[0])
    for simulator in (one, pickle.loads(pickle.dumps(two)), rc.Simulator(scene, radar, seed=3, resolution=32)):
        np.testing.assert_array_equal(simulator.frame(0.05).cube, recording.cube[2])
    assert (recording.cube[1] != recording.cube[2]).any()

    for path in (tmp_path / "directory", tmp_path / "file.npz"):
        recording.save(path)
        read = list(rc.Recording.load(path))
        assert read[2].radar == radar
        for frame, expected in zip(read[2].sequences(), one.frame(0.05).sequences(), strict=True):
            assert frame.radar == expected.radar
            np.testing.assert_array_equal(frame.raw, expected.raw)


@pytest.mark.parametrize("schedule", SCHEDULES, ids=name_of)
@pytest.mark.parametrize("azimuth_deg", [-10.0, 20.0])
def test_angles_of_moving_targets_are_right_with_phases_of_receivers(
    schedule: rc.Schedule | None, azimuth_deg: float
) -> None:
    """Phases of receivers and times of transmitters are corrected once, for any schedule."""
    chain = rc.bgt60tr13c(receiver="measured", if_gain_db=23).receiver  # RX2 is 75 degrees behind
    wf = rc.Waveform.design(
        max_range=8.0, range_resolution=0.12, max_velocity=4.0, num_tx=2, num_chirps=64, start_frequency=60e9
    )
    half = 0.5 * wf.wavelength
    rx = [[0.0, half * k, 0.0] for k in range(3)]
    radar = rc.Radar(
        wf, tx=[[0.0, 0.0, 0.01], [0.0, 3.0 * half, 0.01]], rx=rx, receiver=chain, schedule=schedule, tx_power_dbm=4.0
    )
    ahead = np.array([np.cos(np.deg2rad(azimuth_deg)), np.sin(np.deg2rad(azimuth_deg)), 0.0])
    target = rc.PointTarget(3.0 * ahead, rcs=1.0, velocity=1.2 * ahead)
    frame = rc.Simulator(rc.Scene([target]), radar, field_of_view_deg=(120.0, 20.0)).frame()
    if schedule is not None and schedule.kind == "ddm":
        found = rc.demultiplex(rc.range_doppler(frame), radar)
        power = (np.abs(found.spectrum) ** 2).sum(axis=0)
        power[:, wf.range_axis()[: power.shape[1]] < 1.0] = 0.0  # leakage
        row, column = np.unravel_index(power.argmax(), power.shape)
        assert abs(found.velocity[row] - 1.2) <= wf.velocity_resolution
        cell = found.spectrum[:, row, column]
        azimuth = rc.directions(cell[None], replace(radar, schedule=None)).azimuth
    else:
        azimuth = rc.detect(frame).azimuth
    np.testing.assert_allclose(np.rad2deg(azimuth), [azimuth_deg], atol=1.0)
