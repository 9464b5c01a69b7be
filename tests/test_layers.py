"""Imports within the package: folders one way, files of a folder without circles, private names within their file."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import radarcore

PACKAGE = Path(radarcore.__file__).parent
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}

EVERYWHERE = {"check", "direction", "output", "units", "products", "records", "notice", "lazy", "table", "_core"}
DESCRIPTIONS = {"recording", "radar"}
BODIES = {"scene", "motion", "geometry"}
MAY_IMPORT = {
    "geometry": set(),
    "radar": set(),
    "motion": {"geometry"},
    "scene": {"motion", "geometry", "radar"},
    "recording": {"radar"},
    "receive": {"radar"},
    "processing": BODIES | DESCRIPTIONS,
    "sensor": DESCRIPTIONS,
    "models": BODIES,
    "plot": {"processing"} | BODIES | DESCRIPTIONS,
    "adapters": {"processing"} | BODIES | DESCRIPTIONS,
    "simulate": {"receive"} | BODIES | DESCRIPTIONS,
    "depth": {"simulate", "receive"} | BODIES | DESCRIPTIONS,
    "scenefile": {"models", "simulate", "adapters"} | BODIES | DESCRIPTIONS,
    "virtual": {"scenefile", "simulate", "sensor", "receive"} | DESCRIPTIONS,
    "comparison": {"scenefile", "simulate", "plot", "processing"} | BODIES | DESCRIPTIONS,
    "dataset": {"scenefile", "simulate", "models", "processing", "adapters"} | BODIES | DESCRIPTIONS,
}
MAY_IMPORT["cli"] = {*MAY_IMPORT, "cli"}

COUNTERPARTS = {"_core", "_core_at"}
"""The core's counterparts of meshes, scenes, materials, radars: private, except for modules that pass them to the
core."""
CORE_USERS = ("simulate.", "depth.", "scene.scene", "geometry.mesh_report")
NAMED_TUPLE = {"_replace", "_asdict", "_fields"}
"""Public methods of named tuples."""


@cache
def tree(name: str) -> ast.Module:
    return ast.parse(FILES[name].read_text(encoding="utf-8"))


def imports(name: str) -> Iterator[str]:
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.Import):
            assert not any(alias.name.startswith("radarcore.") for alias in node.names), f"{name}: `import` of a file"
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "radarcore":
            module = (node.module or "").removeprefix("radarcore").lstrip(".")
            for alias in node.names:
                inner = f"{module}.{alias.name}".lstrip(".")
                yield inner if inner in FILES else module or alias.name


@cache
def imported(name: str) -> set[str]:
    """Modules of the package that a file imports, anywhere in it."""
    return set(imports(name))


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_folder_imports_only_what_lies_below_it(folder: str) -> None:
    allowed = EVERYWHERE | MAY_IMPORT[folder] | {folder}
    found = {(name, target) for name in FILES if name.split(".")[0] == folder for target in imported(name)}
    assert {(name, target) for name, target in found if target.split(".")[0] not in allowed} == set()


def test_all_folders_are_in_the_table() -> None:
    assert {name.split(".")[0] for name in FILES} <= {*MAY_IMPORT, *EVERYWHERE, "", "__init__", "__main__"}


def test_files_import_each_other_without_circles() -> None:
    TopologicalSorter({name: imported(name) - {name} for name in FILES}).prepare()  # a CycleError names them


def test_imports_inside_the_package_name_the_file() -> None:
    faces = {name for name, path in FILES.items() if path.name == "__init__.py"} - {"sensor.transport"}
    assert {(name, face) for name in FILES for face in faces & imported(name) if name[:4] != "cli."} == set()


@pytest.mark.parametrize("name", FILES)
def test_private_names_stay_in_their_file(name: str) -> None:
    own = set(COUNTERPARTS if name.startswith(CORE_USERS) else ())
    used: set[str] = set()
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            own.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            own.add(node.id if isinstance(node, ast.Name) else node.attr)
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            if ast.unparse(node.value) not in ("self", "cls"):
                used.add(node.attr)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("radarcore"):
            private = {alias.name for alias in node.names if alias.name.startswith("_")}
            used |= private - {"_core", "__version__"}
    assert used - own - NAMED_TUPLE == set()
