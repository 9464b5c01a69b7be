"""Docstrings of the public names: each has an example that runs, and names what is near it."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
import sys
from collections.abc import Iterator
from functools import cache, reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from doubles.motive import MotionCaptureServer
from radarcore.adapters import ros

SOURCES = Path(rc.__file__).parents[1]
PACKAGES = (
    *("radarcore", "radarcore.geometry.shapes", "radarcore.models", "radarcore.models.robots", "radarcore.plot"),
    *("radarcore.processing", "radarcore.sensor", "radarcore.dataset"),
    *(f"radarcore.adapters.{name}" for name in dir(rc.adapters)),
)
"""Packages and modules with public names, by a stub or by what they define."""

WRITTEN = {"radarcore": "", "radarcore.geometry.shapes": "shapes."}
"""Text of users between rc. and a name, where it is not the package."""

NUM_METHODS = 90
"""Examples of methods, at least."""

IMPORTED = ("mujoco", "pxr")
"""Packages of extras that examples import themselves."""

OBJECTS = ("bag", "live", "motive", "recording", "scene_file", "sensor", "tree", "varied_scene_file")
"""Objects that examples use without making them: the fixtures below, which docs/python.md describes."""

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
SECTION = re.compile(r"^([A-Z]\w+(?: \w+)*)\n-+\n", flags=re.MULTILINE)


def file_of(module: str) -> Path:
    path = SOURCES.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@cache
def tree_of(module: str) -> ast.Module:
    return ast.parse(file_of(module).read_text(encoding="utf-8"))


def listed(package: str) -> list[tuple[str, str]]:
    """Public names of a package and the modules that define them: of its stub, or what it defines itself."""
    stub = file_of(package).with_suffix(".pyi")
    if stub.is_file():
        lines = [line.split() for line in stub.read_text(encoding="utf-8").splitlines()]
        pairs = [(line[3], line[1]) for line in lines]
    else:
        kinds = ast.ClassDef | ast.FunctionDef
        pairs = [(node.name, package) for node in tree_of(package).body if isinstance(node, kinds)]
    return [(name, module) for name, module in pairs if not name.startswith("_")]


def nodes_of(name: str, module: str) -> Iterator[tuple[str, ast.ClassDef | ast.FunctionDef]]:
    """The class or function, and the public methods of the class."""
    for node in tree_of(module).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            yield name, node
            for method in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                    yield f"{name}.{method.name}", method


@cache
def docstrings() -> dict[str, str]:
    """Docstrings of classes, functions and methods, as users write them after ``rc.``; each at its first package."""
    found: dict[str, str] = {}
    known = set()
    for package in PACKAGES:
        before = WRITTEN.get(package, f"{package.removeprefix('radarcore.')}.")
        for name, stated in listed(package):
            module = dict(listed(stated)).get(name, stated) if file_of(stated).name == "__init__.py" else stated
            if (name, module) not in known:
                known.add((name, module))
                found |= {before + own: ast.get_docstring(node) or "" for own, node in nodes_of(name, module)}
    # Not a class or a function, but looked up most.
    return found | {"materials": inspect.getdoc(rc.materials) or ""}


def is_method(name: str) -> bool:
    return name.rpartition(".")[0] in docstrings()


def sections(name: str) -> dict[str, str]:
    """Sections of a docstring by their titles, in order."""
    _, *parts = SECTION.split(docstrings()[name])
    return dict(zip(parts[::2], parts[1::2], strict=True))


def resolved(name: str) -> Any:
    """The object behind a name after ``rc.``."""
    return reduce(getattr, name.split("."), rc)


NAMES = [name for name in docstrings() if not is_method(name)]
WITH_EXAMPLE = [name for name in docstrings() if "Examples" in sections(name)]
WITH_SEE_ALSO = [name for name in docstrings() if "See Also" in sections(name)]


def test_names_are_those_that_users_find() -> None:
    assert len(NAMES) > 200
    assert {"Radar", "shapes.plate", "models.Human", "plot.rcs", "adapters.ros.BagReader", "adapters.rerun.Viewer"} < {
        *NAMES
    }
    assert len(WITH_EXAMPLE) - len(NAMES) >= NUM_METHODS, "methods have examples, too"
    assert docstrings()["Radar"] == inspect.getdoc(rc.Radar)


@pytest.mark.parametrize("name", NAMES)
def test_name_has_an_example_and_says_what_is_near(name: str) -> None:
    assert not {"See Also", "Examples"} - sections(name).keys(), "missing"
    assert list(sections(name))[-1] == "Examples"


@pytest.fixture
def bag(tmp_path: Path) -> Iterator[ros.BagReader]:
    pytest.importorskip("rosbags", reason="needs rosbags: pip install 'radarcore[ros]'")
    with ros.BagWriter(tmp_path / "ball") as written:
        for k in range(3):
            message = ros.to_pose_stamped(rc.Pose([0.1 * k, 0.0, 0.0]), time_ns=k * 10**8, types=written.types)
            written.write("/ball", message, time_ns=k * 10**8)
    with ros.BagReader(tmp_path / "ball") as opened:
        yield opened


@pytest.fixture
def live() -> Any:
    mujoco = pytest.importorskip("mujoco", reason="needs mujoco: pip install 'radarcore[mujoco]'")
    ball = '<body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    made = rc.adapters.mujoco.LiveModel(model)
    made.update(mujoco.MjData(model))
    return made


@pytest.fixture
def tree() -> ros.TransformTree:
    poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
    moving = [ros.to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
    static = ros.to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")
    return ros.TransformTree(moving, [static])


@pytest.fixture
def motive() -> Iterator[MotionCaptureServer]:
    with MotionCaptureServer({"ball": rc.Linear(rc.Pose([2.0, 0.0, 1.0]), velocity=[-0.5, 0.0, 0.0])}) as server:
        yield server


@pytest.fixture(scope="module")
def recording() -> rc.Recording:
    scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    return rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).record(0.0, 0.3, progress=False)


@pytest.fixture
def scene_file(tmp_path: Path) -> str:
    return written(tmp_path, "position = [2.0, 0.0, 0.0]")


@pytest.fixture
def varied_scene_file(tmp_path: Path) -> str:
    return written(tmp_path, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]")


def written(folder: Path, position: str) -> str:
    lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", 'name = "ball"', position]
    (folder / "scene.toml").write_text("\n".join(lines), encoding="utf-8")
    return "scene.toml"


@pytest.fixture
def sensor() -> Iterator[rc.sensor.Sensor]:
    from radarcore.sensor.emulator.pty import PtyPort
    from radarcore.sensor.emulator.source import Noise

    with (
        rc.sensor.virtual_board(Noise()) as board,
        PtyPort(board) as port,
        rc.open_sensor(port.path, protocol="strata") as opened,
    ):
        yield opened


def objects_of(test: doctest.DocTest) -> list[str]:
    """Objects that the examples use and do not make."""
    tree = ast.parse("".join(example.source for example in test.examples))
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name)]
    made = {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return [name for name in OBJECTS if name in {node.id for node in names} - made]


@pytest.mark.parametrize("name", WITH_EXAMPLE)
def test_example_prints_what_it_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(tmp_path)
    if name.endswith(".is_available") and not resolved(name)():
        pytest.skip("needs the extra that it asks for")
    test = doctest.DocTestParser().get_doctest(docstrings()[name], {"rc": rc, "np": np}, name, None, 0)
    assert any(example.want for example in test.examples)
    test.globs |= {given: request.getfixturevalue(given) for given in objects_of(test)}
    try:
        doctest.DebugRunner(optionflags=FLAGS).run(test)
    except doctest.DocTestFailure as failure:
        pytest.fail(f"{failure.example.source}expected {failure.example.want}got {failure.got}")
    except doctest.UnexpectedException as unexpected:
        error = unexpected.exc_info[1]
        is_extra = "pip install radarcore[" in str(error) or getattr(error, "name", None) in IMPORTED
        if isinstance(error, ImportError) and is_extra:
            pytest.skip(f"needs an extra: {error}")
        raise error from None
    finally:
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")


@pytest.mark.parametrize("name", WITH_SEE_ALSO)
def test_what_is_near_exists(name: str) -> None:
    """By its name after ``rc.``, or of the same package."""
    lines = [line for line in sections(name)["See Also"].splitlines() if line and not line.startswith(" ")]
    found = [other for line in lines for other in line.partition(" : ")[0].split(", ")]
    assert 1 <= len(found) <= 4
    package = next((p for p in PACKAGES[2:] if name.startswith(p.removeprefix("radarcore.") + ".")), "radarcore")
    for other in found:
        assert other != name
        try:
            resolved(other)
        except AttributeError:
            resolved(f"{package.partition('.')[2]}.{other}")
