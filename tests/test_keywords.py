"""Names that are spelled wrong: of keywords, of choices, of attributes of packages."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters import coppeliasim, mujoco, optitrack, ros
from radarcore.sensor.bgt60.settings import Settings

FACES = [rc, rc.models, rc.models.robots, rc.plot, rc.processing, rc.sensor, coppeliasim, mujoco, optitrack, ros]
FILES = [rc.shapes, rc.adapters.gazebo, rc.adapters.images, rc.adapters.rerun]


def functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public functions that have arguments with defaults."""
    for module in FACES + FILES:
        for name in dir(module):
            value = getattr(module, name)
            if not inspect.isfunction(value):
                continue
            kinds = list(inspect.signature(value).parameters.values())
            if any(each.kind is each.VAR_KEYWORD for each in kinds):
                continue  # those look at the names themselves
            if any(each.default is not each.empty for each in kinds):
                yield f"{module.__name__}.{name}", value


@pytest.mark.parametrize("called", [pytest.param(called, id=name) for name, called in functions()])
def test_every_function_with_options_names_the_near_one(called: Callable[..., Any]) -> None:
    options = [each.name for each in inspect.signature(called).parameters.values() if each.default is not each.empty]
    wrong = options[-1] + "x"
    with pytest.raises(
        TypeError, match=rf"{called.__name__}: unknown keyword '{wrong}'; did you mean .*'{options[-1]}'"
    ):
        called(**{wrong: None})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rc.Body(motoin=None), "Body: unknown keyword 'motoin'; did you mean 'motion'?"),
        (lambda: rc.Scene(boddies=[]), "Scene: unknown keyword 'boddies'; did you mean 'bodies'?"),
        (lambda: rc.Simulator(resolutoin=3), "Simulator: unknown keyword 'resolutoin'; did you mean 'resolution'?"),
        (lambda: rc.Mesh(triangle=3), "Mesh: unknown keyword 'triangle'; did you mean 'triangles'?"),
        (lambda: rc.Trajectory(time=3), "Trajectory: unknown keyword 'time'; did you mean 'times'?"),
        (lambda: rc.models.Human(hight=1.8), "Human: unknown keyword 'hight'; did you mean 'height'?"),
        (
            lambda: rc.Waveform.design(max_rnge=3.0),
            "Waveform.design: unknown keyword 'max_rnge'; did you mean 'max_range'?",
        ),
        (
            lambda: rc.Pose.look_at(target=1, postion=2),
            "Pose.look_at: unknown keyword 'postion'; did you mean 'position'?",
        ),
        (
            lambda: rc.Recording.load("here", mmaps=False),
            "Recording.load: unknown keyword 'mmaps'; did you mean 'mmap'?",
        ),
        (
            lambda: rc.Material(permittivity=3.0),
            "Material: unknown keyword 'permittivity'; Material.dielectric takes it",
        ),
        (lambda: rc.Pose([1, 2, 3], xyzw=[0, 0, 0, 1]), "Pose: unknown keyword 'xyzw'; Pose.from_quaternion takes it"),
        (lambda: rc.Radar(zzz=1), "Radar: unknown keyword 'zzz'; known: waveform, "),
    ],
)
def test_classes_and_their_other_constructors_name_the_near_one(make: Callable[[], object], message: str) -> None:
    with pytest.raises(TypeError) as caught:
        make()
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: rc.Waveform(60e9, 15e12),  # type: ignore[misc]
            "Waveform: expected keywords start_frequency=, slope=, sample_rate=, num_samples=, num_chirps=, "
            "chirp_interval=, ..., got 2 positional values",
        ),
        (
            lambda: rc.Simulator(rc.Scene(), rc.bgt60tr13c(), rc.Pose()),  # type: ignore[misc]
            "Simulator: expected 2 positional and then keywords resolution=, field_of_view_deg=, ",
        ),
        (
            lambda: rc.Waveform.from_sweep(58e9, 59e9),  # type: ignore[misc]
            "Waveform.from_sweep: expected keywords start_frequency=, stop_frequency=, ",
        ),
        (
            lambda: rc.bgt60tr13c(64),  # type: ignore[misc]
            "bgt60tr13c: expected keywords stop_frequency=, tx_power_dbm=, ",
        ),
        (
            lambda: rc.shapes.sphere(0.1, 3),  # type: ignore[misc]
            "sphere: expected 1 positional and then keywords subdivisions=, sagitta=, got 2 positional values",
        ),
    ],
)
def test_values_that_need_keywords_name_them(make: Callable[[], object], message: str) -> None:
    with pytest.raises(TypeError) as caught:
        make()
    assert str(caught.value).startswith(message)


def test_choice_names_the_near_one_where_there_is_one() -> None:
    with pytest.raises(ValueError, match=r"sampling: expected .* got 'adaptiv'; did you mean 'adaptive'\?"):
        rc.Simulator(rc.Scene(), rc.bgt60tr13c(), sampling="adaptiv")
    with pytest.raises(ValueError, match=r"sampling: expected one of .*, got 'zzz'$"):
        rc.Simulator(rc.Scene(), rc.bgt60tr13c(), sampling="zzz")


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("radarcore.Simulater", "Simulator"),
        ("radarcore.adapters.mujoko", "mujoco"),
        ("radarcore.plot.spectogram", "spectrogram"),
        ("radarcore.shapes.spher", "sphere"),
    ],
)
def test_interpreter_suggests_the_near_attribute(wrong: str, meant: str) -> None:
    """It does as it prints the error: in a process of its own."""
    result = subprocess.run([sys.executable, "-c", f"import radarcore\n{wrong}"], capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr.rstrip().endswith(f"has no attribute '{wrong.split('.')[-1]}'. Did you mean: '{meant}'?")


def test_names_of_materials_and_arms_are_suggested() -> None:
    with pytest.raises(KeyError, match="no material 'metall'; did you mean 'metal'"):
        rc.materials["metall"]
    with pytest.raises(KeyError, match="no arm 'ur11'; did you mean 'ur10'"):
        rc.models.RobotArm.named("ur11")


def test_checked_callables_stay_what_they_are() -> None:
    """Same names, signatures and docstrings, and they can be sent to other processes."""
    assert str(inspect.signature(rc.shapes.sphere)).startswith("(radius: 'float', *, subdivisions: 'int | None' = None")
    assert rc.detect.__module__ == "radarcore.processing.detection"
    assert (rc.detect.__doc__ or "").startswith("Detect")
    assert pickle.loads(pickle.dumps(rc.detect)) is rc.detect
    assert pickle.loads(pickle.dumps(rc.Pose([1.0, 2.0, 3.0]))) == rc.Pose([1.0, 2.0, 3.0])


def flags() -> Iterator[Any]:
    """Public functions, classes and methods with arguments that are True or False, and the names of these."""
    made_by_decoders = {"TrackState", "VirtualBoard", "BodyState", "MarkerState", "NatNetFrame", "ServerInfo"}
    found: dict[str, Callable[..., Any]] = {}
    for module in [*FACES, *FILES, rc.dataset]:
        for value in (getattr(module, name) for name in dir(module)):
            if inspect.isfunction(value):
                found[value.__qualname__] = value
            elif inspect.isclass(value) and value.__name__ not in made_by_decoders:
                methods = [each for name, each in vars(value).items() if name == "__init__" or name[0] != "_"]
                functions = [getattr(each, "__func__", each) for each in methods]
                found |= {each.__qualname__: each for each in functions if inspect.isfunction(each)}
    for name, called in found.items():
        if not called.__module__.startswith("radarcore"):
            continue
        options = [each.name for each in inspect.signature(called).parameters.values() if each.annotation == "bool"]
        if options:
            yield pytest.param(called, options, id=name)


@pytest.mark.parametrize(("called", "options"), list(flags()))
def test_flags_take_true_or_false_alone(called: Callable[..., Any], options: list[str]) -> None:
    for name in options:
        for value in ("no", "False", 0, None):
            with pytest.raises(TypeError, match=rf"^{name}: expected True or False, got {value!r}$"):
                called(**{name: value})


def test_flags_may_come_from_numpy_and_without_their_keywords() -> None:
    true: Any = np.True_
    assert Settings(is_transmitting=true).is_transmitting is True
    with pytest.raises(TypeError, match="boxes: expected True or False, got 'no'"):
        rc.dataset.Labels(True, "no")  # type: ignore[arg-type]
