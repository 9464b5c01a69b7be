"""Frames for training: the same stored, simulated, in a loop, by index and in other processes, with their labels."""

from __future__ import annotations

import pickle
import re
import runpy
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc

SCENE = """
run = { stop = 0.04, rate = 50.0, resolution = 32 }
[radar]
preset = "bgt60tr13c"
num_chirps = 16
[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
pose = { position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0] }
motion = { kind = "linear", velocity = [{ uniform = [-2.0, 2.0] }, 0.0, 0.0] }
material = { choice = ["metal", "wood"] }
[[point]]
name = "extra"
repeat = { integers = [0, 1] }
position = [4.0, { uniform = [-1.0, 1.0] }, 0.0]
rcs = 1e-7
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE, encoding="utf-8")
    return file


def same(one: rc.dataset.training.Item, other: rc.dataset.training.Item) -> bool:
    (frame, labels), (other_frame, other_labels) = one, other
    return np.array_equal(frame, other_frame) and pickle.dumps(labels) == pickle.dumps(other_labels)


def test_an_index_a_loop_and_other_processes_give_the_same_frames(scene: Path) -> None:
    frames = rc.dataset.stream(scene, seed=3, count=3)
    alone = list(frames)
    assert len(alone) == len(frames) == 6
    assert all(same(alone[k], frames[k]) for k in (5, 0, 3))
    assert same(alone[5], frames[-1])
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert same(alone[4], next(pool.map(frames.__getitem__, [4])))
    with pytest.raises(ValueError, match="index: expected an index below 6, got 6"):
        frames[6]


def test_frames_are_those_of_the_sample(scene: Path) -> None:
    variation = rc.dataset.Variation.load(scene)
    items = list(rc.dataset.stream(variation, seed=1, count=2))
    frames = [frame for index in range(2) for frame in variation.sample(index, seed=1).frames()]
    for (cube, labels), frame in zip(items, frames, strict=True):
        np.testing.assert_array_equal(cube, frame.cube)
        assert labels["time"] == frame.time
    assert [(labels["sample"], labels["frame"]) for _, labels in items] == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_drawn_values_are_labels_that_every_frame_has(scene: Path) -> None:
    labels = [labels for _, labels in rc.dataset.stream(scene, seed=1, count=8)]
    assert all(each.keys() == labels[0].keys() for each in labels)
    for each in labels:
        assert each["body.ball.material"] in ("metal", "wood")
        assert np.isnan(each["point.extra 0.position[1]"]) == (each["point.extra.repeat"] == 0)


def test_map_has_its_peak_where_the_labels_say(scene: Path) -> None:
    stream = rc.dataset.stream(scene, seed=2, count=4, output="range_doppler", labels=rc.dataset.Labels(boxes=True))
    radar = rc.dataset.Variation.load(scene).sample(0).simulation().radar
    ranges, velocities = radar.waveform.range_axis(), radar.waveform.velocity_axis(16)
    for image, labels in stream:
        power = (np.abs(image) ** 2).sum(axis=0)
        row, column = np.unravel_index(power.argmax(), power.shape)
        distance, velocity = labels["true_range"][0], labels["true_velocity"][0]
        assert abs(ranges[column] - distance) <= radar.waveform.range_resolution
        assert abs(velocities[row] - velocity) <= radar.waveform.velocity_resolution
        assert velocity == pytest.approx(labels["body.ball.motion.velocity[0]"], abs=2e-5)
        assert labels["box_size"][0] == pytest.approx([0.2, 0.2, 0.2], abs=1e-9)
        assert np.isnan(labels["true_range"][1]) == (labels["point.extra.repeat"] == 0)


def test_fault_of_a_function_of_frames_is_no_impossible_sample(scene: Path) -> None:
    def faulty(frame: rc.Frame) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        raise ValueError("one of my own")

    with pytest.raises(ValueError, match="one of my own"):
        next(iter(rc.dataset.stream(scene, output=faulty)))


def test_stream_without_a_count_has_no_end_and_no_length(scene: Path) -> None:
    stream = rc.dataset.stream(scene)
    assert [labels["sample"] for _, labels in islice(stream, 5)] == [0, 0, 1, 1, 2]
    with pytest.raises(TypeError, match="count: expected a number of samples for a stream with a length, got none"):
        len(stream)


def test_impossible_samples_are_left_out_with_one_warning(scene: Path) -> None:
    scene.write_text(
        SCENE.replace("stop = 0.04", "stop = 0.02").replace("radius = 0.1", "radius = { normal = [0.1, 0.1] }"),
        encoding="utf-8",
    )
    stream = rc.dataset.stream(scene, seed=1, count=12)
    variation = rc.dataset.Variation.load(scene)
    radii = [variation.sample(k, seed=1).values["body.ball.shape.radius"] for k in range(12)]
    good = [k for k, radius in enumerate(radii) if radius > 0.0]
    assert 4 < len(good) < 12
    with pytest.warns(UserWarning, match=r"sample \d+ of seed 1: .*radius.* such samples are left out") as warned:
        numbers = [labels["sample"] for _, labels in stream]
    assert numbers == good
    assert len(warned) == 1
    with pytest.raises(ValueError, match=r"of seed 1: .*radius"):
        stream[radii.index(min(radii))]


def test_warnings_of_samples_come_once_of_each_kind(scene: Path) -> None:
    fast = SCENE.replace("stop = 0.04", "stop = 0.02").replace("[-2.0, 2.0]", "[6.0, 9.0]")
    scene.write_text(fast, encoding="utf-8")
    with pytest.warns(UserWarning, match="radial speed") as warned:
        frames = list(rc.dataset.stream(scene, seed=1, count=3))
    assert len(frames) == 3
    (told,) = [str(each.message) for each in warned]
    assert told.startswith("sample 0: 'ball' has a radial speed of")


def test_stored_frames_are_those_that_are_streamed(scene: Path, tmp_path: Path) -> None:
    labels = rc.dataset.Labels(boxes=True)
    dataset = rc.dataset.make(
        scene, tmp_path / "out", count=5, seed=1, workers=1, labels=labels, samples_per_shard=2, progress=False
    )
    for output in ("cube", "range_doppler", lambda frame: np.array([frame.time, frame.truth.range[0]])):
        stored = dataset.frames(output=output)
        streamed = rc.dataset.stream(scene, seed=1, count=5, labels=labels, output=output)
        assert len(stored) == len(streamed) == 10
        for one, other in zip(stored, streamed, strict=True):
            np.testing.assert_array_equal(one[0], other[0])
            assert one[1].keys() == other[1].keys()
            for name, value in other[1].items():
                np.testing.assert_array_equal(one[1][name], value, err_msg=name)
        np.testing.assert_array_equal(stored[-3][0], streamed[7][0])
    with pytest.raises(ValueError, match="output: expected one of 'cube', 'range_doppler', got 'map'"):
        dataset.frames(output="map")


def test_stored_frames_have_the_radar_of_their_sample(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.write_text(
        SCENE.replace("num_chirps", "tx_power_dbm = { uniform = [0.0, 9.0] }\nnum_chirps"), encoding="utf-8"
    )
    dataset = rc.dataset.make(scene, tmp_path / "out", count=3, seed=1, workers=1, progress=False)
    made: list[int] = []
    draw = type(dataset).sample
    monkeypatch.setattr(type(dataset), "sample", lambda self, index: made.append(index) or draw(self, index))
    powers = list(dataset.frames(output=lambda frame: np.array(frame.radar.tx_power_dbm)))
    assert made == [0, 1, 2], "once per sample"
    for power, labels in powers:
        assert float(power) == pytest.approx(labels["radar.tx_power_dbm"])
    assert len({float(power) for power, _ in powers}) == 3


def test_stored_frames_leave_out_samples_that_failed(scene: Path, tmp_path: Path) -> None:
    plate = "[[body]]\nshape = { kind = 'plate', width = 0.5, height = 0.5 }\n"
    near = "pose.position = [{ uniform = [-0.002, 0.002] }, 0.0, 0.0]\n"  # within 1 mm of the antennas, or farther away
    scene.write_text(f"{SCENE}{plate}{near}", encoding="utf-8")
    dataset = rc.dataset.make(scene, tmp_path / "out", count=6, seed=1, workers=1, progress=False)
    there = [index for index in range(6) if dataset.status[index] == 1]
    assert 0 < len(there) < 6
    stored = dataset.frames()
    assert [labels["sample"] for _, labels in stored] == [index for index in there for _ in range(2)]
    assert [stored[k][1]["sample"] for k in (0, -1)] == [there[0], there[-1]]


def test_example_tells_arm_person_and_empty_room_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sklearn", reason="needs scikit-learn: pip install scikit-learn")
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    script = Path(__file__).resolve().parents[2] / "examples" / "classify_motion.py"
    monkeypatch.setattr(sys, "argv", [str(script), "--count", "10", "-o", str(tmp_path / "new" / "picture.png")])
    runpy.run_path(str(script), run_name="__main__")
    found = re.fullmatch(r"30 maps to learn from, 15 of another seed: accuracy ([\d.]+)\n", capsys.readouterr().out)
    assert found is not None
    assert float(found[1]) > 0.6  # by chance a third, with a standard deviation of 0.12
    assert (tmp_path / "new" / "picture.png").read_bytes()[:4] == b"\x89PNG"
