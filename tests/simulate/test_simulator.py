"""The simulator end to end: rates, truth, Doppler, recordings, and what it refuses."""

from __future__ import annotations

import os
import signal
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.receive import chain

C = 299_792_458.0

CONDUCTOR = rc.materials["perfect_conductor"]
TX = [[0.0, -0.005, 0.0]]
RX = [[0.0, 0.004, 0.001], [0.0, 0.0, -0.003]]


def waveform(**changes: Any) -> rc.Waveform:
    settings: dict[str, Any] = {
        "start_frequency": 60e9,
        "slope": 2e13,
        "sample_rate": 2e6,
        "num_samples": 32,
        "num_chirps": 8,
        "chirp_interval": 300e-6,
    }
    return rc.Waveform(**settings | changes)


def simulator(bodies: list[Any], radar: rc.Radar | None = None, **options: Any) -> rc.Simulator:
    settings: dict[str, Any] = {"resolution": 32, "field_of_view_deg": (40.0, 40.0)} | options
    return rc.Simulator(
        rc.Scene(bodies), radar or rc.Radar(waveform(), tx=TX, rx=RX), **{"sampling": "footprint", **settings}
    )


def tumbling_box() -> rc.Body:
    """A box that moves in every way, half mirror, half matt: every ray on it comes back."""
    motion = rc.Linear(
        rc.Pose.from_rpy([1.5, 0.1, -0.05], [0.3, 0.2, 0.4]),
        velocity=[0.8, -0.5, 0.3],
        angular_velocity=[2.0, -1.0, 3.0],
    )
    return rc.Body(rc.shapes.box((0.3, 0.5, 0.4)), material=rc.Material(-0.5, 0.5), motion=motion)


def still_life() -> list[Any]:
    """Surfaces of all kinds and a point, none of them in motion."""
    return [
        rc.Body(rc.shapes.sphere(0.2), motion=rc.Pose([1.5, 0.2, 0.1]), name="ball"),
        rc.PointTarget([1.2, -0.2, 0.1], rcs=1e-3),
        rc.Body(
            rc.shapes.plate(2.0, 2.0), material=rc.Material(-0.5, 0.5), motion=rc.Pose([2.5, 0.0, 0.0]), name="wall"
        ),
    ]


# --- paths ---------------------------------------------------------------------------------------------------------


SENSOR_MOTIONS = [
    rc.Pose(),
    rc.Linear(
        rc.Pose.from_rpy([0.1, 0, 0], [0, 0.05, 0]), velocity=[0.4, 0.7, -0.2], angular_velocity=[0.5, -0.3, 0.8]
    ),
]


@pytest.mark.parametrize("radar_motion", SENSOR_MOTIONS, ids=["fixed sensor", "moving sensor"])
def test_delay_rate_is_the_derivative_of_delay(radar_motion: Any) -> None:
    # Rays are cast in the middle of a frame. Frames that start h earlier and last 2 h longer have the same middle,
    # hence the same material points.
    h, start, bodies = 2e-5, 0.02, [tumbling_box(), rc.PointTarget([1.0, 0.3, 0.1], velocity=[0.5, 1.0, -1.0])]

    def paths(shift: float) -> rc.Paths:
        wf = waveform(num_chirps=2, chirp_interval=None, chirp_times=[0.0, 1e-3 - 2.0 * shift])
        radar = rc.Radar(wf, tx=TX, rx=RX)
        return simulator(bodies, radar, radar_motion=radar_motion).paths(start + shift)

    before, now, after = paths(-h), paths(0.0), paths(h)
    assert now.delay.shape == now.delay_rate.shape == now.amplitude.shape == now.body.shape
    assert now.delay.shape[0] == 2
    assert now.delay.shape[1] > 100
    np.testing.assert_array_equal(before.body, after.body)
    difference = (after.delay - before.delay) / (2.0 * h)
    # In m/s: delays of 10 ns are known to 1e-24 s (1e-11 m/s); h^2 / 6 times a third derivative of at most 100 m/s^3
    # is 1e-8.
    np.testing.assert_allclose(0.5 * C * now.delay_rate, 0.5 * C * difference, rtol=0, atol=2e-8)


def test_paths_name_the_body_of_the_scene() -> None:
    paths = simulator(still_life()).paths()
    assert set(paths.body.ravel().tolist()) == {0, 1, 2}
    assert (paths.body == 1).sum() == 2  # the point, once per channel
    (point,) = paths.delay[:, paths.body[0] == 1].T
    position = np.array([1.2, -0.2, 0.1])
    lengths = [np.linalg.norm(position - TX[0]) + np.linalg.norm(position - rx) for rx in RX]
    np.testing.assert_allclose(point, np.divide(lengths, C), rtol=1e-14)


# --- frames --------------------------------------------------------------------------------------------------------


def test_frame_of_a_static_scene_is_the_beat_signal_of_its_paths() -> None:
    sim = simulator(still_life(), tolerance=1e-9)
    paths = sim.paths()
    expected = rc.beat_signal(paths.delay, paths.amplitude, sim.radar.waveform, tolerance=1e-9)
    frame = sim.frame()
    assert frame.stats["paths"] == paths.delay.shape[1]
    np.testing.assert_allclose(frame.cube, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_frame_of_a_moving_scene_is_the_beat_signal_of_its_paths_at_first_order() -> None:
    # The rates of `paths` continue its delays for 64 us. Distances that change by 64 um and normals that turn by 0.24
    # mrad change amplitudes by 3e-4; accelerations of 5 m/s^2 move the points by 1e-8 m or 3e-5 rad.
    sim = simulator(
        [tumbling_box()], rc.Radar(waveform(num_chirps=4, chirp_interval=16e-6), tx=TX, rx=RX), tolerance=1e-9
    )
    paths = sim.paths(0.01)
    expected = rc.beat_signal(
        paths.delay, paths.amplitude, sim.radar.waveform, delay_rate=paths.delay_rate, tolerance=1e-9
    )
    error = np.abs(sim.frame(0.01).cube - expected).max()
    assert paths.delay.shape[1] > 100
    assert error <= 1e-3 * np.abs(expected).max()


def test_truth_of_a_point_is_its_geometry_in_the_middle_of_the_frame() -> None:
    target = rc.PointTarget([1.5, 0.4, -0.3], velocity=[0.5, -1.0, 2.0], name="bee")
    sensor = rc.Linear(
        rc.Pose.from_rpy([0.1, 0.2, 0.0], [0, 0, 0.3]), velocity=[0.2, 0.0, 0.1], angular_velocity=[0, 0, 2]
    )
    sim = simulator([target], radar_motion=sensor)
    frame = sim.frame(0.05)
    middle = 0.05 + 0.5 * sim.radar.waveform.duration
    pose = sensor.at(middle)
    point = target.position + middle * target.velocity
    # Seen from the centre of the array, which turns with the sensor.
    center = pose.rotation @ sim.radar.array_center
    sight = point - pose.position - center
    x, y, z = pose.rotation.T @ sight
    truth = frame.truth
    assert truth is not None
    assert truth.names == ("bee",)
    assert truth.range == pytest.approx([np.linalg.norm(sight)], rel=1e-13)
    assert truth.velocity == pytest.approx(
        [sight @ (target.velocity - sensor.velocity - np.cross([0, 0, 2], center)) / np.linalg.norm(sight)], rel=1e-12
    )
    assert truth.azimuth == pytest.approx([np.arctan2(y, x)], rel=1e-12)
    assert truth.elevation == pytest.approx([np.arctan2(z, np.hypot(x, y))], rel=1e-12)


def test_truth_of_a_mesh_is_its_nearest_visible_point() -> None:
    plate = rc.Body(
        rc.shapes.plate(1.0, 1.0), motion=rc.Linear(rc.Pose([2.0, 0, 0]), velocity=[0.7, 0, 0]), name="plate"
    )
    hidden = rc.Body(rc.shapes.box(0.2), motion=rc.Pose([2.5, 0, 0]), name="hidden")
    sim = simulator([hidden, plate], resolution=33)  # odd: a ray runs along the axis
    truth = sim.frame(0.1).truth
    assert truth is not None
    assert truth.names == ("hidden", "plate")
    middle = 0.1 + 0.5 * sim.radar.waveform.duration
    assert truth.range[1] == pytest.approx(2.0 + 0.7 * middle, rel=1e-13)
    assert truth.velocity[1] == pytest.approx(0.7, rel=1e-12)
    assert (truth.azimuth[1], truth.elevation[1]) == (0.0, 0.0)
    for name in ("range", "velocity", "azimuth", "elevation"):
        assert np.isnan(getattr(truth, name)[0])


@pytest.mark.parametrize("sampling", ["footprint", "adaptive"])
def test_moving_sphere_has_its_true_range_and_doppler_and_no_other(sampling: str) -> None:
    wf = waveform(num_samples=64, num_chirps=128, chirp_interval=200e-6)
    velocity = 10.37 * wf.velocity_resolution  # between two bins, where windows leak most
    motion = rc.Linear(rc.Pose([1.0, 0.05, 0.02]), velocity=[velocity, 0.0, 0.0])
    sphere = rc.Body(rc.shapes.sphere(0.1), material=CONDUCTOR, motion=motion)
    options: dict[str, Any] = {"resolution": 200} if sampling == "footprint" else {"resolution": None}
    frame = simulator([sphere], rc.Radar(wf), sampling=sampling, field_of_view_deg=(16.0, 16.0), **options).frame()
    peak = rc.strongest_peak(frame.cube, wf)
    assert frame.truth is not None
    # Half a bin would do to tell signs and factors of two; single targets are found to far less.
    assert peak.range == pytest.approx(frame.truth.range[0], abs=0.05 * wf.range_resolution)
    assert peak.velocity == pytest.approx(frame.truth.velocity[0], abs=0.02 * wf.velocity_resolution)
    power = np.abs(rc.range_doppler(frame.cube, wf)[0]) ** 2  # (doppler, range)
    row, column = np.unravel_index(power.argmax(), power.shape)
    # The window itself: the spectrum of Hann falls as 1 / (pi n^3), below -70 dB from n = 10 bins on.
    is_far = np.abs(np.arange(len(power)) - row) >= 10
    assert 10 * np.log10(power[is_far, column].max() / power[row, column]) <= -65.0


def test_two_equal_calls_give_equal_bits_for_any_number_of_threads() -> None:
    bodies = [*still_life(), tumbling_box()]
    radar = rc.Radar(waveform(), tx=TX, rx=RX, receiver=rc.Receiver(noise_figure_db=10.0))
    first = simulator(bodies, radar, threads=1).frame(0.1)
    for threads in (None, 1, 2, 5):
        sim = simulator(bodies, radar, threads=threads)
        for _ in range(2):
            np.testing.assert_array_equal(sim.frame(0.1).cube, first.cube)


def test_seed_changes_noise_and_speckle_and_nothing_else() -> None:
    mirror = [
        rc.Body(rc.shapes.sphere(0.2), material=CONDUCTOR, motion=rc.Pose([1.5, 0, 0])),
        rc.PointTarget([1, 0, 0]),
    ]
    matt = [rc.Body(rc.shapes.sphere(0.2), material=rc.Material.lambertian(0.5), motion=rc.Pose([1.5, 0, 0]))]
    quiet = rc.Radar(waveform())
    noisy = rc.Radar(waveform(), receiver=rc.Receiver(noise_figure_db=10.0))

    def cubes(bodies: list[Any], radar: rc.Radar) -> list[NDArray[Any]]:
        return [simulator(bodies, radar, seed=seed, tolerance=1e-9).frame().cube for seed in (0, 1)]

    np.testing.assert_array_equal(*cubes(mirror, quiet))
    assert not np.array_equal(*cubes(matt, quiet))
    first, second = cubes(mirror, noisy)
    assert not np.array_equal(first, second)
    # Noise power k T F fs on top of the same echo; 256 samples of it vary by 1 / 16.
    (clean, _) = cubes(mirror, quiet)
    expected = 1.380649e-23 * 290.0 * 10.0 * 2e6
    for cube in (first, second):
        assert np.mean(np.abs(cube - clean) ** 2) == pytest.approx(expected, rel=4 / 16)


def test_stats_count_rays_and_paths() -> None:
    stats = simulator(still_life(), sampling="point").frame().stats
    image = simulator(still_life()).depth_image()
    assert stats["rays_cast"] == 32 * 32
    assert stats["rays_hit"] == (image.body >= 0).sum()
    assert stats["paths"] - 1 + stats["paths_skipped"] == stats["rays_hit"]  # one path is the point's
    assert stats["delay_nodes"] == 1, "nothing moves"
    assert simulator([tumbling_box()]).frame().stats["delay_nodes"] > 1


# --- recordings ----------------------------------------------------------------------------------------------------


def small() -> rc.Simulator:
    body = rc.Body(rc.shapes.plate(0.5, 0.5), motion=rc.Linear(rc.Pose([1, 0, 0]), velocity=[0.1, 0, 0]), name="plate")
    return simulator([body], rc.Radar(waveform(num_samples=8, num_chirps=2)), resolution=8)


@pytest.mark.parametrize(
    ("start", "stop", "rate", "count"),
    [
        (0.0, 1.0, 40.0, 40),
        (0.0, 0.3, 10.0, 3),
        (0.1, 0.4, 10.0, 3),
        (-0.5, 0.0, 10.0, 5),
        (0.0, 0.05, 30.0, 2),
        (0, 1e-3, 1, 1),
    ],
)
def test_recording_holds_the_frames_that_start_before_its_end(
    start: float, stop: float, rate: float, count: int
) -> None:
    recording = small().record(start, stop, rate, progress=False)
    np.testing.assert_allclose(recording.time, start + np.arange(count) / rate, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "interval"),
    [
        ({"frame_interval": 0.1}, 0.1),
        ({"frame_interval": 5e-3}, 5e-3),
        ({}, 0.025),  # back to back, an interval that nobody chose: 40 frames per second
        ({"num_chirps": 256}, 256 * 300e-6),  # fewer fit
    ],
)
def test_frames_without_a_rate_come_as_the_radar_sends_them(changes: dict[str, Any], interval: float) -> None:
    sim = simulator([], rc.Radar(waveform(num_samples=8, **changes)), resolution=4)
    expected = interval * np.arange(5)
    np.testing.assert_allclose(sim.record(0.0, 5 * interval, progress=False).time, expected, atol=1e-15)
    np.testing.assert_allclose([frame.time for frame in sim.frames(0.0, 5 * interval)], expected, atol=1e-15)


def test_recorded_frames_are_the_frames(tmp_path: Path) -> None:
    sim = small()
    frames = list(sim.frames(0.2, 0.3, 40.0))
    assert [frame.time for frame in frames] == pytest.approx([0.2, 0.225, 0.25, 0.275], rel=1e-15)
    in_memory = sim.record(0.2, 0.3, 40.0, progress=False)
    on_disk = sim.record(0.2, 0.3, 40.0, progress=False, path=tmp_path / "rec")
    for recording in (in_memory, on_disk, rc.Recording.load(tmp_path / "rec")):
        assert recording.radar == sim.radar
        assert recording.truth is not None
        assert recording.truth.names == ("plate",)
        assert recording.source["bodies"] == ["plate"]
        for frame, recorded in zip(frames, recording.frames(), strict=True):
            np.testing.assert_array_equal(recorded.cube, frame.cube)
            assert recorded.time == frame.time
            assert recorded.truth is not None
            assert frame.truth is not None
            np.testing.assert_array_equal(recorded.truth.range, frame.truth.range)
    assert len(sim.record(0.2, 0.25, 40.0, progress=False, path=tmp_path / "rec", overwrite=True)) == 2


def test_interrupted_recording_leaves_its_whole_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sim, received = small(), chain.receive_all

    def interrupted(ideal: Any, radar: rc.Radar, start: float, **options: Any) -> Any:
        if start > 0.06:
            raise KeyboardInterrupt
        return received(ideal, radar, start, **options)

    monkeypatch.setattr(chain, "receive_all", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sim.record(0.0, 1.0, 40.0, progress=False, path=tmp_path / "rec")
    monkeypatch.undo()
    with pytest.warns(UserWarning, match=r"3 of 40"):
        recording = rc.Recording.load(tmp_path / "rec")
    assert len(recording) == 3
    for recorded in recording.frames():
        np.testing.assert_array_equal(recorded.cube, sim.frame(recorded.time).cube)


def test_unwritable_place_fails_before_any_frame_is_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr(chain, "receive", never)
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(OSError, match="file"):
        small().record(0.0, 1.0, progress=False, path=tmp_path / "file" / "rec")
    with pytest.raises(FileExistsError):
        small().record(0.0, 1.0, progress=False, path=tmp_path / "file")
    with pytest.raises(ValueError, match=r"path: expected a directory \(no suffix\)"):
        small().record(0.0, 1.0, progress=False, path=tmp_path / "rec.npz")


# --- matt surfaces, processes ---------------------------------------------------------------------------------------


def matt(size: float, position: tuple[float, float, float]) -> rc.Body:
    return rc.Body(rc.shapes.plate(size, size), material=rc.Material.lambertian(0.8), motion=rc.Pose(position))


def test_matt_scene_seen_from_a_moved_and_turned_place_is_the_same() -> None:
    move = rc.Pose.from_rpy([300.0, -200.0, 50.0], [0.3, -0.7, 2.0])
    wall = matt(0.3, (1.5, 0.1, 0.0))
    moved = rc.Body(wall.mesh, material=wall.material, motion=move @ wall.motion)
    here = simulator([wall], resolution=64, tolerance=1e-9).frame().cube
    there = simulator([moved], resolution=64, tolerance=1e-9, radar_motion=move).frame().cube
    # 1e-13 m of rounding at 300 m is 3e-10 rad.
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-8 * np.abs(here).max())


def test_a_surface_that_turns_out_of_sight_needs_no_more_nodes_than_the_tolerance() -> None:
    ball = rc.Body(
        rc.shapes.sphere(0.2),
        material=rc.Material.lambertian(0.8),
        motion=rc.Linear(rc.Pose([1.5, 0.0, 0.0]), velocity=[0.0, 3.0, 0.0]),
    )
    frame = simulator([ball], rc.Radar(waveform(num_chirps=64, chirp_interval=400e-6)), resolution=48).frame()
    assert frame.stats["delay_nodes"] <= 16  # delays are smooth; the kink of the amplitudes is within tolerance
    assert frame.stats["series_residual"] < 1e-3


def test_a_forked_child_simulates_too() -> None:
    sim = simulator([matt(0.3, (1.0, 0.0, 0.0))], resolution=16)
    expected = sim.frame().cube
    read, write = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of forks with threads
        child = os.fork()
    if child == 0:
        signal.alarm(60)  # a child that waits for its parent's threads would wait for ever
        same = np.array_equal(sim.frame().cube, expected)
        os.write(write, b"same" if same else b"other")
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        assert pipe.read() == b"same"
    os.waitpid(child, 0)


def test_rays_start_at_the_centre_of_the_array() -> None:
    radar = rc.Radar(waveform(), tx=[[0.0, 0.5, 0.0]], rx=[[0.0, 0.5, 0.0]])
    plate = rc.Body(rc.shapes.plate(0.2, 0.2), motion=rc.Pose([2.0, 0.5, 0.0]))
    image = simulator([plate], radar, resolution=33).depth_image()
    assert image.distance[16, 16] == pytest.approx(2.0, rel=1e-15)
