"""The viewer Rerun: contents of its files, read back by its own reader."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.adapters.rerun import Viewer
from radarcore.cli.main import main
from scene_files import APPROACHING

# Looked for, not imported, which takes half a second in every process that collects tests.
pytestmark = pytest.mark.skipif(
    find_spec("rerun") is None, reason="needs the extra `rerun`: pip install radarcore[rerun]"
)

RADAR = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=64, num_chirps=16, chirp_interval=300e-6)
MIDDLE = 0.5 * RADAR.waveform.duration
BOX = rc.shapes.box([0.2, 0.4, 0.6])

SCENE = APPROACHING.replace("stop = 0.3", "stop = 0.5").replace("resolution = 48", "resolution = 32")


class Content:
    """Rows of an .rrd file: by entity and component, with their times [s]."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        assert len(reader.recordings()) == 1
        self.static: dict[tuple[str, str], Any] = {}
        self.rows: dict[tuple[str, str], list[tuple[float, Any]]] = defaultdict(list)
        self.time_lines: set[str] = set()
        for chunk in reader.stream():
            batch = chunk.to_record_batch()
            self.time_lines |= set(chunk.timeline_names)
            for name in batch.schema.names:
                if ":" not in name:
                    continue
                values = batch.column(name).to_pylist()
                if chunk.is_static:
                    self.static[chunk.entity_path, name] = values[0]
                    continue
                times = batch.column("sim_time").cast("int64").to_pylist()
                self.rows[chunk.entity_path, name] += [
                    (1e-9 * time, value) for time, value in zip(times, values, strict=True) if value is not None
                ]

    def at(self, entity: str, component: str) -> list[tuple[float, NDArray[Any]]]:
        """Values of a component over time."""
        return [
            (time, np.asarray(value)) for time, value in sorted(self.rows[entity, component], key=lambda row: row[0])
        ]

    @property
    def entities(self) -> set[str]:
        return {entity for entity, _ in [*self.static, *self.rows]}


def sockets_and_children() -> tuple[int, str]:
    """Open sockets of this process, and its child processes."""
    links = [str(link.readlink()) if link.exists() else "" for link in Path("/proc/self/fd").iterdir()]
    children = "".join(path.read_text() for path in Path("/proc/self/task").glob("*/children"))
    return sum(link.startswith("socket:") for link in links), children


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_a_step_writes_a_file_and_nothing_is_sent_or_opened(tmp_path: Path) -> None:
    import_module("rerun")  # which connects its own threads with each other
    before = sockets_and_children()
    scene = rc.Scene([rc.Body(BOX, name="box")])
    with Viewer(tmp_path / "new" / "run.rrd") as viewer:
        viewer.show_poses(scene, 0.0)
        assert sockets_and_children() == before
    assert (tmp_path / "new" / "run.rrd").stat().st_size > 1000
    assert sockets_and_children() == before


def test_mesh_is_sent_once_and_poses_at_their_times(tmp_path: Path) -> None:
    motion = rc.Linear(rc.Pose([1.0, 2.0, 3.0]), velocity=[0.5, 0.0, 0.0], angular_velocity=[0.0, 0.0, np.pi])
    radar_motion = rc.Pose.look_at([0.0, 0.0, 1.0], [1.0, 1.0, 1.0])
    scene = rc.Scene([rc.Body(BOX, motion=motion, name="room/box"), rc.PointTarget([5, 0, 0], velocity=[1, 0, 0])])
    with Viewer(tmp_path / "run.rrd") as viewer:
        for time in (0.0, 0.5):
            viewer.show_poses(scene, time, radar_motion)
    content = Content(tmp_path / "run.rrd")
    assert content.time_lines == {"sim_time", "log_time"}  # the latter is of Rerun itself

    # The slash of a name does not make the box a part of something else.
    box = r"/world/bodies/room\/box"
    corners = np.array(content.static[box, "Mesh3D:vertex_positions"])
    normals = np.array(content.static[box, "Mesh3D:vertex_normals"])
    assert corners.shape == normals.shape == (36, 3)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], BOX.bounds, atol=1e-7)
    assert ((corners * normals).sum(axis=1) > 0.05).all()  # outwards, as the box is about the origin
    assert not any(name.startswith("Mesh3D") for _, name in content.rows)

    places = content.at(box, "Transform3D:translation")
    assert [time for time, _ in places] == pytest.approx([0.0, 0.5])
    np.testing.assert_allclose([value[0] for _, value in places], [[1.0, 2.0, 3.0], [1.25, 2.0, 3.0]])
    turns = content.at(box, "Transform3D:mat3x3")
    # Column by column; a quarter of a turn takes x to y.
    np.testing.assert_allclose(turns[1][1][0].reshape(3, 3).T, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-7)
    radar = content.at("/world/radar", "Transform3D:mat3x3")
    np.testing.assert_allclose(radar[0][1][0].reshape(3, 3).T, radar_motion.rotation, atol=1e-7)
    points = content.at("/world/points", "Points3D:positions")
    np.testing.assert_allclose([value[0] for _, value in points], [[5.0, 0.0, 0.0], [5.5, 0.0, 0.0]])


def test_body_that_deforms_is_sent_anew(tmp_path: Path) -> None:
    growing = rc.Body(BOX, deformation=lambda t: BOX.vertices * (1.0 + t), name="balloon")
    scene = rc.Scene([growing])
    with Viewer(tmp_path / "run.rrd") as viewer:
        for time in (0.0, 1.0):
            viewer.show_poses(scene, time)
    shapes = Content(tmp_path / "run.rrd").at("/world/bodies/balloon", "Mesh3D:vertex_positions")
    np.testing.assert_allclose(shapes[1][1], 2.0 * shapes[0][1], rtol=1e-6)


def test_depth_image_and_rays_end_on_the_wall(tmp_path: Path) -> None:
    wall = rc.Body(rc.shapes.plate(1.0, 1.0), motion=rc.Pose([2.0, 0.0, 0.0]))
    simulator = rc.Simulator(rc.Scene([wall]), RADAR, field_of_view_deg=(60.0, 40.0), resolution=(20, 32))
    image = simulator.depth_image(0.25)
    with Viewer(tmp_path / "run.rrd") as viewer:
        viewer.show_depth(image, num_rays=10)
    content = Content(tmp_path / "run.rrd")
    rows, columns = image.distance.shape
    ((time, buffer),) = content.at("/world/radar/camera/depth", "DepthImage:buffer")
    assert time == pytest.approx(0.25)
    depth = np.frombuffer(np.asarray(buffer[0], np.uint8).tobytes(), np.float32).reshape(rows, columns)
    is_hit = image.body >= 0
    np.testing.assert_allclose(depth[is_hit], 2.0, rtol=1e-6)  # planar depth
    assert (depth[~is_hit] == 0.0).all()
    assert 0 < is_hit.sum() < is_hit.size

    ((_, rays),) = content.at("/world/radar/rays", "LineStrips3D:strips")
    assert rays.shape == (10, 2, 3)
    np.testing.assert_allclose(rays[:, 0], 0.0)
    np.testing.assert_allclose(rays[:, 1, 0], 2.0, rtol=1e-6)
    assert (np.abs(rays[:, 1, 1:]) < 0.51).all()

    # The camera looks along the radar's x axis: its z axis; its x axis is to the right, its y axis down.
    ((_, axes),) = content.at("/world/radar/camera", "Transform3D:mat3x3")
    np.testing.assert_array_equal(axes[0].reshape(3, 3).T, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    ((_, matrix),) = content.at("/world/radar/camera", "Pinhole:image_from_camera")
    focal = 0.5 * columns / np.tan(np.deg2rad(30.0))
    np.testing.assert_allclose(matrix[0].reshape(3, 3).T[:, 2], [columns / 2, rows / 2, 1.0])
    assert matrix[0][0] == pytest.approx(focal)


def test_depth_image_of_nothing_has_no_rays(tmp_path: Path) -> None:
    image = rc.Simulator(rc.Scene([rc.PointTarget([1, 0, 0])]), RADAR, resolution=8).depth_image(0.0)
    with Viewer(tmp_path / "run.rrd") as viewer:
        viewer.show_depth(image)
    rays = Content(tmp_path / "run.rrd").at("/world/radar/rays", "LineStrips3D:strips")
    assert [len(value) for _, value in rays] in ([], [0])


def test_map_detections_and_truth_show_the_target(tmp_path: Path) -> None:
    # A target on a cell: 10 cells of range away, 3 cells of velocity towards the radar.
    waveform = RADAR.waveform
    distance, velocity = 10 * waveform.range_resolution, -3 * waveform.velocity_resolution
    start = [distance - velocity * MIDDLE, 0.0, 0.0]
    scene = rc.Scene([rc.PointTarget(start, rcs=1.0, velocity=[velocity, 0.0, 0.0], name="target")])
    frame = rc.Simulator(scene, replace(RADAR, receiver=None)).frame(0.0)
    found = rc.detect(frame)
    with Viewer(tmp_path / "run.rrd") as viewer:
        viewer.show_frame(frame)
        viewer.show_detections(found)
    content = Content(tmp_path / "run.rrd")
    ((time, data),) = content.at("/radar/range_velocity", "Tensor:data")
    assert time == pytest.approx(MIDDLE, abs=1e-9)
    tensor = data[0]
    cells = f"{waveform.velocity_resolution:.3g} m/s", f"{waveform.range_resolution:.3g} m"
    assert tensor["names"] == [f"velocity, {cells[0]} per cell, 0 in the middle", f"range, {cells[1]} per cell"]
    levels = np.array(tensor["buffer"]).reshape(tensor["shape"])
    row, column = np.unravel_index(levels.argmax(), levels.shape)
    assert (column, row - levels.shape[0] // 2) == (10, -3)
    assert levels.max() == 0.0
    assert levels.min() >= -80.0

    ((_, truth),) = content.at("/world/radar/truth", "Points3D:positions")
    np.testing.assert_allclose(truth, [[distance, 0.0, 0.0]], atol=1e-3)  # seen from the middle of the antennas
    ((_, places),) = content.at("/world/radar/detections", "Points3D:positions")
    assert np.linalg.norm(places - truth, axis=1).min() < waveform.range_resolution
    ((_, labels),) = content.at("/world/radar/detections", "Points3D:labels")
    assert f"{found.range[0]:.2f} m, {found.velocity[0]:+.2f} m/s" in labels
    assert content.at(r"/range/target", "Scalars:scalars")[0][1][0] == pytest.approx(distance, abs=1e-5)


@pytest.mark.parametrize("motion", [None, rc.Pose.from_rpy([1.0, 2.0, 0.5], [0.1, 0.2, 0.3])])
def test_tracks_appear_once_they_are_confirmed(tmp_path: Path, motion: rc.Pose | None) -> None:
    def detections(time: float) -> rc.Detections:
        covariance = np.diag([1e-4, 1e-2, 1e-4, 1e-4])[None]
        return rc.Detections([2.0 - time], [-1.0], [0.3], [0.0], [20.0], covariance=covariance, time=time)

    tracker = rc.Tracker(motion)
    confirmed = []
    with Viewer(tmp_path / "run.rrd") as viewer:
        for time in np.arange(12) / 20.0:
            states = tracker.update(detections(float(time)))
            viewer.show_tracks(states, float(time))
            confirmed += [float(time)] * any(state.is_confirmed for state in states)
    content = Content(tmp_path / "run.rrd")
    ranges = content.at(r"/range/track\ 0", "Scalars:scalars")
    assert [time for time, _ in ranges] == pytest.approx(confirmed)
    assert 1 < len(confirmed) < 12
    np.testing.assert_allclose([value[0] for _, value in ranges], 2.0 - np.array(confirmed), atol=0.05)
    place = content.at("/world/radar/tracks", "Points3D:positions")[-1][1][0]
    last = 2.0 - confirmed[-1]
    np.testing.assert_allclose(place, [last * np.cos(0.3), last * np.sin(0.3), 0.0], atol=0.05)
    motion = content.at("/world/radar/tracks/velocity", "Arrows3D:vectors")[-1][1][0]
    assert motion @ [np.cos(0.3), np.sin(0.3), 0.0] == pytest.approx(-1.0, abs=0.1)


def test_command_shows_a_scene_and_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    assert main(["view", str(scene), "-o", str(tmp_path / "scene.rrd")]) == 0
    assert capsys.readouterr().out == f"{scene}: 5 frames in {tmp_path / 'scene.rrd'}\n"
    content = Content(tmp_path / "scene.rrd")
    half = 0.5 * rc.load_scene(scene).radar.waveform.duration
    frames = np.arange(5) / 10.0 + half
    for entity, component in (
        ("/world/bodies/ball", "Transform3D:translation"),
        ("/world/radar/camera/depth", "DepthImage:buffer"),
        ("/radar/range_velocity", "Tensor:data"),
        ("/world/radar/detections", "Points3D:positions"),
        ("/range/ball", "Scalars:scalars"),
    ):
        assert [time for time, _ in content.at(entity, component)] == pytest.approx(frames), entity
    places = [value[0, 0] for _, value in content.at("/world/bodies/ball", "Transform3D:translation")]
    np.testing.assert_allclose(places, 1.5 - 0.5 * frames, atol=1e-6)

    rc.load_scene(scene).record(tmp_path / "recording", progress=False)
    assert main(["view", str(tmp_path / "recording"), "-o", str(tmp_path / "recording.rrd")]) == 0
    recorded = Content(tmp_path / "recording.rrd")
    for entity in ("/radar/range_velocity", "/world/radar/detections", "/range/ball"):
        assert entity in recorded.entities
    assert not any(entity.startswith("/world/bodies") for entity in recorded.entities)


def test_map_of_a_sensors_recording_is_without_its_leakage(tmp_path: Path) -> None:
    radar = rc.bgt60tr13c(receiver="measured", num_chirps=8)
    scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[1.0, 0.0, 0.0])])
    simulated = rc.Simulator(scene, radar).record(0.0, 0.1, progress=False)
    replace(simulated, truth=None).save(tmp_path / "recording")
    for words, expected in (([], 2.0), (["--keep-mean"], 0.0)):
        path = tmp_path / f"run{len(words)}.rrd"
        assert main(["view", str(tmp_path / "recording"), "-o", str(path), *words]) == 0
        tensor = Content(path).at("/radar/range_velocity", "Tensor:data")[0][1][0]
        levels = np.array(tensor["buffer"]).reshape(tensor["shape"])
        brightest = int(np.unravel_index(levels.argmax(), levels.shape)[1])
        assert abs(radar.waveform.range_axis(radar.waveform.num_samples)[brightest] - expected) < 0.16  # one bin


def test_without_a_path_the_viewer_is_opened_and_told_all(monkeypatch: pytest.MonkeyPatch) -> None:
    import rerun

    opened: list[Any] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(rerun.RecordingStream, "spawn", lambda _, **options: opened.append(options))
    with Viewer() as viewer:
        viewer.show_poses(rc.Scene([rc.Body(BOX)]), 0.0)
    assert [list(options) for options in opened] == [["default_blueprint"]]


def test_no_display_says_how_to_save(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    (tmp_path / "scene.toml").write_text(SCENE)
    assert main(["view", str(tmp_path / "scene.toml"), "--rerun"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("radarcore: no display for the viewer; save a file instead")
    assert "-o" in error
    assert error.count("\n") == 1


def test_missing_source_leaves_no_file(tmp_path: Path) -> None:
    for source in ("none", "none.toml"):
        assert main(["view", str(tmp_path / source), "-o", str(tmp_path / "run.rrd")]) == 1
    assert not (tmp_path / "run.rrd").exists()


def test_file_that_cannot_be_made_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"run\.rrd: expected a file that can be written; Failed to create file"):
        Viewer("/proc/self/run.rrd")
