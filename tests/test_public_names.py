"""The public face: names that stubs list and packages load on first use."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import radarcore as rc

PUBLIC = [
    *("", "adapters", "adapters.mujoco", "adapters.optitrack", "adapters.ros", "adapters.usd"),
    *("dataset", "models", "models.robots", "plot", "processing", "sensor"),
]


@pytest.fixture(params=PUBLIC, ids=lambda name: name or "radarcore")
def face(request: pytest.FixtureRequest) -> ModuleType:
    return import_module(f"radarcore.{request.param}".rstrip("."))


def stub_of(face: ModuleType) -> list[list[str]]:
    """Words of the stub's lines: from MODULE import NAME as NAME."""
    return [line.split() for line in Path(str(face.__file__)).with_suffix(".pyi").read_text().splitlines()]


def test_stub_has_a_line_per_name(face: ModuleType) -> None:
    for words in stub_of(face):
        assert words[0::2] == ["from", "import", "as"]
        assert words[3] == words[5]


def test_package_shows_what_its_stub_lists(face: ModuleType) -> None:
    assert dir(face) == face.__all__ == sorted(words[3] for words in stub_of(face))


def test_the_first_page_stays_short() -> None:
    assert len(rc.__all__) <= 76, "results and rare functions belong to the package that they come from"


def test_every_name_loads_and_stays(face: ModuleType) -> None:
    for name in face.__all__:
        value = getattr(face, name)
        assert getattr(face, name) is value
        if not isinstance(value, ModuleType) and hasattr(value, "__qualname__"):
            assert value.__qualname__ == name


def test_nothing_but_its_own_modules_is_reachable_beside_the_names_of_a_package(face: ModuleType) -> None:
    """The import system puts the modules there: `dir` and type checkers do not show them."""
    for name in face.__all__:
        getattr(face, name)
    for name in vars(face).keys() - set(face.__all__):
        if not name.startswith("__"):
            beside = getattr(face, name)
            assert isinstance(beside, ModuleType)
            assert beside.__name__ == f"{face.__name__}.{name}"


@pytest.mark.parametrize(
    "name", ["shapes", "adapters.images", "adapters.gazebo", "adapters.coppeliasim", "adapters.rerun"]
)
def test_module_of_public_functions_shows_these_alone(name: str) -> None:
    shown = import_module(f"radarcore.{name}" if name != "shapes" else "radarcore.geometry.shapes")
    assert dir(shown) == sorted(shown.__all__)
    own = {
        key
        for key, value in vars(shown).items()
        if getattr(value, "__module__", None) == shown.__name__ and not key.startswith("_")
    }
    assert own - set(shown.__all__) <= {"Image"}  # a protocol: requirements of a type, for checkers


def test_no_module_has_the_name_of_something_else(face: ModuleType) -> None:
    """The import system would put the module in the place of a function, depending on what was loaded before."""
    others = {words[3] for words in stub_of(face) if words[1] != face.__name__}
    folder = Path(str(face.__file__)).parent
    assert others.isdisjoint(path.stem for path in folder.iterdir() if path.is_dir() or path.suffix == ".py")


def test_unknown_name_is_an_attribute_error(face: ModuleType) -> None:
    with pytest.raises(AttributeError, match=f"module '{face.__name__}' has no attribute 'nonsense'"):
        face.nonsense  # noqa: B018


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


LOADED = """
import sys
before = set(sys.modules)
import radarcore
{use}
new = {{name.partition(".")[0] for name in set(sys.modules) - before}}
print(*sorted(name for name in new if name not in sys.stdlib_module_names))
"""
SIMULATOR = "radarcore.Simulator(radarcore.Scene(), radarcore.bgt60tr13c())"
FRAME = (
    "plate = radarcore.Body(radarcore.shapes.plate(0.1, 0.1), motion=radarcore.Pose([1.0, 0.0, 0.0]))\n"
    "radarcore.Simulator(radarcore.Scene([plate]), radarcore.bgt60tr13c(num_chirps=1), resolution=4).frame()"
)
"""Loads no scipy, pydantic or matplotlib: simulation of a frame needs numpy and the core."""


@pytest.mark.parametrize(
    ("use", "packages"), [("", ["radarcore"]), (SIMULATOR, ["numpy", "radarcore"]), (FRAME, ["numpy", "radarcore"])]
)
def test_import_loads_nothing_else_and_a_simulator_and_its_frames_numpy_alone(use: str, packages: list[str]) -> None:
    code = LOADED.format(use=use)
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stderr == ""
    assert result.stdout.split() == packages
