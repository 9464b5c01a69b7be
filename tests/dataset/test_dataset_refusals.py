"""Scenes that vary, distributions, labels and folders that are refused: by key, and before anything is made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.dataset import Labels, dims_of, labels_of
from radarcore.dataset.distributions import distribution_of
from varied_scenes import BALL, HEAD, PERSON, write_scene

WAVEFORM = rc.bgt60tr13c(num_chirps=32).waveform
PAIR = [[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0]]


def point(name: str) -> rc.Simulator:
    return rc.Simulator(rc.Scene([rc.PointTarget([3.0, 1.0, 0.0], name=name)]), rc.bgt60tr13c(num_chirps=16))


LAMP = point("lamp")


def labelled(names: Any = ("lamp",), settings: Any = None, frame: rc.Frame | None = None) -> object:
    return labels_of(LAMP, LAMP.frame(0.0) if frame is None else frame, names, settings)


def cells_of(radar: rc.Radar) -> object:
    return dims_of(radar, ("lamp",), Labels(truth=False, cells=True))


# Scene files.


RECEIVERS = '{ choice = [{ output = "iq" }, { output = "real" }] }'
SWEEP = "start_frequency = 60e9, slope = 1e13, sample_rate = 2e6, num_samples = 64"
SHAPE, POINT = "the shape of the cube", "[[point]]\nposition = [1, 0, 0]\n"


@pytest.mark.parametrize(
    ("text", "key", "decides"),
    [
        ("radar.num_chirps = { integers = [8, 16] }", "radar.num_chirps", SHAPE),
        ("radar.rx = { choice = [[[0, 0, 0]], [[0, 1, 0]]] }", "radar.rx", SHAPE),
        ("radar.start_frequency = { uniform = [59e9, 60e9] }", "radar.start_frequency", "the axes of the cube"),
        ('radar.receiver.output = { choice = ["iq", "real"] }', "radar.receiver.output", SHAPE),
        (f"radar = {{ receiver = {RECEIVERS}, {SWEEP} }}", "radar.receiver", SHAPE),
        ("run = { rate = { uniform = [10, 20] } }", "run.rate", "the number of frames"),
    ],
)
def test_what_all_samples_share_has_no_distribution(tmp_path: Path, text: str, key: str, decides: str) -> None:
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=rf"{key}: expected one value for all samples, as it decides {decides}, got a"):
        rc.dataset.Variation.load(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("before", "old", "new", "messages"),
    [
        (BALL, "uniform", "unifrom", ["'ball': pose.position[0]: expected a number [m]", "; did you mean 'uniform'"]),
        (BALL, "choice", "chioce", ["material: unknown key 'chioce'; did you mean 'choice'?"]),
        (BALL, "[1.0, 3.0]", "[3.0, 1.0]", ["body.ball.pose.position[0]: uniform: expected the smaller"]),
        (BALL, '"ball"', '{ choice = ["a", "b"] }', ["body[0]: name: expected text, the same in all sa"]),
        (PERSON, "[0, 3]", "[-1, 3]", ["human.person.repeat: expected 0 to 1000 copies"]),
        (PERSON, "integers = [0, 3]", "uniform = [0, 3]", ["person.repeat: expected an integer, or a d"]),
        ("", "", "[[body]]\nchoice = []\n", ["body[0]: expected a table, got a distribution"]),
        (POINT, "[1, 0", "[1, 0, 0]\nrsc = [{ uniform = [0.1, 1.0] }", ["unknown key 'rsc'; did you mean"]),
        # The ends of distributions are tried when the file is read.
        (BALL, 'choice = ["metal", "wood"]', "albedo = { uniform = [0.5, 1.5] }", ["ball.material.albedo", "be 1.5"]),
        (PERSON, "[0.5, 1.5]", "[0.5, 3.0]", ["human.person 0.speed", "uniform may be 3", "expected at"]),
        (BALL, '"wood"', '"wod"', ["body.ball.material: choice may be 'wod'", "did you mean 'wood' or"]),
        (PERSON, "speed = { uniform = [0.5, 1.5] }", "meshes = { uniform = [0, 1] }", ["expected true or false"]),
    ],
)
def test_faults_are_named_by_key_when_the_file_is_read(
    tmp_path: Path, before: str, old: str, new: str, messages: list[str]
) -> None:
    (tmp_path / "scene.toml").write_text(HEAD + before.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=r"scene\.toml: ") as error:
        rc.dataset.Variation.load(tmp_path / "scene.toml")
    assert all(message in str(error.value) for message in messages), str(error.value)
    assert ("sample " in str(error.value)) == ("meshes" in new), "only what no distribution can be is found by a sample"


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"uniform": [2.0, 1.0]}, "uniform: expected the smaller end first, got [2.0, 1.0]"),
        ({"uniform": [1.0]}, "uniform: expected two numbers, the smallest and the largest value, got [1.0]"),
        ({"uniform": [False, True]}, "uniform: expected two numbers"),
        ({"uniform": [0.0, 1.0], "step": 2.0}, "step: expected at most 1, the distance of the ends, got 2"),
        ({"uniform": [0.0, 1.0], "stap": 0.1}, "unknown key 'stap' of a distribution; did you mean 'step'?"),
        ({"uniform": [0.0, 1.0], "normal": [0.0, 1.0]}, "normal: expected one distribution, got uniform as well"),
        ({"normal": [0.0, 0.0]}, "normal: standard deviation: expected a positive number, got 0.0"),
        ({"normal": [0.0, 1.0], "min": 2.0, "max": 1.0}, "max: expected more than min, 2, got 1"),
        ({"normal": [0.0, 1.0], "min": 9.0}, "min: expected bounds that keep some of the distribution, got 9 to inf"),
        ({"normal": [0, 1], "min": 0, "max": 1, "step": 2}, "step: expected at most 1, the distance of the bounds"),
        ({"log_uniform": [0.0, 1.0]}, "log_uniform: expected a positive number, got 0.0"),
        ({"integers": [1.0, 2.0]}, "integers: expected two integers, got [1.0, 2.0]"),
        ({"choice": []}, "choice: expected a list of values, got []"),
        ({"choice": ["a", "b"], "weights": [1.0]}, "weights: expected a list of 2 numbers, one per value, got [1.0]"),
        ({"choice": ["a", "b"], "weights": [0, 0]}, "weights: expected one above zero, got [0, 0]"),
        ({"choice": ["a", "b"], "weights": [1, -1]}, "weights: expected zero or a positive number, got -1"),
    ],
)
def test_what_is_no_distribution_is_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011  # the message is looked at
        distribution_of(table)
    assert str(error.value).startswith(message)


STAGGERED = WAVEFORM.replace(chirp_times=1e-3 * np.array([*range(31), 40]))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: labelled(["lump"]), ValueError, "body_names: expected a name for every body of the scene, got none f"),
        (lambda: labelled("lamp"), TypeError, "body_names: expected one name per body, got the text 'lamp'"),
        (lambda: labelled(["lamp", "lamp"]), ValueError, "body_names: expected names that differ, got 'lamp' twice"),
        (lambda: labelled(settings={"boxes": True}), TypeError, "settings: expected Labels, got dict"),
        (lambda: labelled(frame=point("cat").frame(0.0)), ValueError, "frame: expected the truth of the simulator's "),
        (lambda: cells_of(rc.Radar(STAGGERED)), ValueError, "chirps at equal intervals"),
        (lambda: cells_of(rc.Radar(WAVEFORM.alternating())), ValueError, "expected one waveform, got 2"),
        (lambda: cells_of(rc.Radar(WAVEFORM.replace(slope=0.0))), ValueError, "slope|sweep|CW"),
        (lambda: cells_of(rc.Radar(WAVEFORM, tx=PAIR, schedule=rc.Schedule.ddm())), ValueError, "send in turn"),
    ],
)
def test_labels_that_cannot_be_made_are_refused(
    call: Callable[[], object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        call()


def test_folders_that_are_no_datasets_are_refused_and_stay(tmp_path: Path) -> None:
    pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")
    scene = write_scene(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    for path, error, message in (
        (tmp_path / "none", FileNotFoundError, "expected a dataset, got no such path"),
        (tmp_path, ValueError, "expected a dataset, got a folder without one"),
        (tmp_path / "notes.txt", ValueError, "expected a dataset, got a file, no folder"),
    ):
        with pytest.raises(error, match=message):
            rc.dataset.open_dataset(path)
    with pytest.raises(FileExistsError, match="got a directory that is not empty and no dataset"):
        rc.dataset.make(scene, tmp_path, count=1, workers=1, resume=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    scene.write_text(scene.read_text().replace("[[point]]", "[[point]]\nrcs = { uniform = [-1.0, 1.0] }", 1))
    with pytest.raises(ValueError, match=r"point\.ball\.rcs: uniform may be -1"):
        rc.dataset.make(scene, tmp_path / "out", count=1, workers=1)
    assert not list(tmp_path.glob("out*"))
