"""Files that are no meshes, or of another kind than their name says."""

from __future__ import annotations

import struct
import sys
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import radarcore as rc

STL_FORMS = "expected faces of an STL file (binary, or text from 'solid' to 'endsolid'), got none; the file "
NO_FACES = "file: expected faces that have an area, got none; the file "
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
POINTS = b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property float %c\n" * 3 % (*b"xyz",) + b"end_header\n0 0 0\n"

FILES = {
    "words.stl": (b"these are words\n" * 9, STL_FORMS + r"begins with 'these are words"),
    "page.stl": (b"<!DOCTYPE html><html></html>", STL_FORMS + "begins with '<!DOCTYPE html>"),
    "pointer.stl": (POINTER, STL_FORMS + "is a pointer of Git LFS: fetch its content by git lfs pull"),
    "nothing.stl": (b"solid nothing\nendsolid nothing\n", STL_FORMS + "begins with 'solid nothing"),
    "zeros.stl": (b"\0" * 80 + struct.pack("<I", 0), STL_FORMS + "begins with the bytes 00 00 00 00"),
    "empty.stl": (b"", STL_FORMS + "is empty"),
    "count.stl": (
        b"made by hand".ljust(80) + struct.pack("<I", 5) + bytes(600),
        STL_FORMS + "begins with 'made by hand",
    ),
    "cut.stl": (
        b"made by hand".ljust(80) + struct.pack("<I", 12) + bytes(501),
        STL_FORMS + "begins with 'made by hand",
    ),
    "points.ply": (POINTS, "expected faces, got none; the file begins with 'ply"),
    "words.ply": (b"words", "; the file begins with 'words'"),
    "notes.txt": (b"words", "expected a mesh file (.obj, .stl, .ply, .off, .glb, .gltf, .dae, .3mf), got .txt: "),
    "picture.png": (
        b"\x89PNG\r\n\x1a\n",
        "expected a mesh file (.obj, .stl, .ply, .off, .glb, .gltf, .dae, .3mf), got .png",
    ),
    "page.obj": (b"<!DOCTYPE html><html></html>", NO_FACES + "begins with '<!DOCTYPE html>"),
    "pointer.obj": (POINTER, NO_FACES + "is a pointer of Git LFS"),
    "empty.obj": (b"", NO_FACES + "is empty"),
    "picture.obj": (b"\x89PNG\r\n\x1a\n\0\0", "the file begins with the bytes 89 50 4e 47 0d 0a 1a 0a"),
}


@pytest.mark.parametrize("name", FILES)
def test_file_of_another_kind_is_refused_by_its_name_and_beginning(tmp_path: Path, name: str) -> None:
    if not name.endswith(".obj"):
        pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    path = tmp_path / name
    content, message = FILES[name]
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r".") as caught:
        rc.load_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


def test_text_of_an_stl_file_is_an_stl_file(tmp_path: Path) -> None:
    pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    path = tmp_path / "part.stl"
    path.write_text(
        "solid part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        "endsolid part\n",
        encoding="utf-8",
    )
    assert len(rc.load_mesh(path).triangles) == 1


SIZES = np.array([0.1, 0.2, 0.3])
BOX = rc.shapes.box(SIZES)


def assert_box(mesh: rc.Mesh, low: Any = -0.5 * SIZES) -> None:
    """The box with its normals outwards."""
    np.testing.assert_allclose(mesh.bounds, [low, low + SIZES], atol=1e-7)  # files in single precision
    assert len(mesh.triangles) == 12
    assert mesh.volume == pytest.approx(0.006, rel=1e-6)


def test_gltf_is_turned_to_z_up(tmp_path: Path) -> None:
    """glTF 2.0, 3.4: +Y is up, +Z towards the viewer: y and z of the file are z and -y here."""
    trimesh: Any = pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    written = trimesh.Trimesh(BOX.vertices[:, [0, 2, 1]] * [1, 1, -1], BOX.triangles, process=False)
    for name, data in {"box.glb": written.export(file_type="glb"), **written.export(file_type="gltf")}.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "model.gltf").rename(tmp_path / "box.gltf")
    assert_box(rc.load_mesh(tmp_path / "box.glb"))
    assert_box(rc.load_mesh(tmp_path / "box.gltf"))


CORE_3MF = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION_3MF = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
NO_VERTICES = '<object id="2"><mesh><vertices/><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>'
HALF_TURN = "-1 0 0 0 -1 0 0 0 1"


def write_3mf(path: Path, build: str, *, unit: str = "", per_metre: float = 1000.0, more: str = "") -> Path:
    """The box as object 1 of the model and of another part, in a package by hand."""
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*corner) for corner in per_metre * BOX.vertices)
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in BOX.triangles)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"

    def model(attributes: str, rest: str) -> str:
        resources = f'<resources><object id="1" type="model">{mesh}</object>{more if rest else ""}</resources>'
        return f'<model xmlns="{CORE_3MF}" xmlns:p="{PRODUCTION_3MF}" {attributes}>{resources}{rest}</model>'

    relation = 'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/main.model" Id="a"'
    schema = "http://schemas.openxmlformats.org/package/2006/relationships"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("_rels/.rels", f'<Relationships xmlns="{schema}"><Relationship {relation}/></Relationships>')
        package.writestr("3D/main.model", model(unit and f'unit="{unit}"', f"<build>{build}</build>"))
        package.writestr("3D/other.model", model("", "").replace('<object id="1"', '<object id="7"'))
    return path


@pytest.mark.parametrize(
    ("unit", "per_metre"),
    [("", 1e3), ("micron", 1e6), ("centimeter", 1e2), ("inch", 1 / 0.0254), ("foot", 1 / 0.3048), ("meter", 1.0)],
)
def test_3mf_is_in_its_own_unit(tmp_path: Path, unit: str, per_metre: float) -> None:
    """Core 3.4: millimetres unless it says another unit; the transform of an item is in that unit, too."""
    item = f'<item objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 {0.15 * per_metre}"/>'
    path = write_3mf(tmp_path / "box.3mf", item, unit=unit, per_metre=per_metre)
    assert_box(rc.load_mesh(path), low=[-0.05, -0.1, 0.0])


def test_3mf_puts_components_in_their_places(tmp_path: Path) -> None:
    """An object of another part, mirrored in a rotated group: rows of the matrices are images of the axes."""
    more = (
        '<object id="2"><components><component objectid="7" p:path="/3D/other.model" '
        'transform="0 1 0 1 0 0 0 0 1 100 0 0"/></components></object><object id="3" type="support"/>'
    )
    items = f'<item objectid="2" transform="{HALF_TURN} 0 0 150"/><item objectid="3"/>'
    mesh = rc.load_mesh(write_3mf(tmp_path / "box.3mf", items, more=more))
    np.testing.assert_allclose(mesh.bounds, [[-0.2, -0.05, 0.0], [0.0, 0.05, 0.3]], atol=1e-12)
    assert mesh.volume == pytest.approx(0.006)


def group(number: int, components: str) -> str:
    return f'<object id="{number}"><components>{components}</components></object>'


TEN_FOLD = "".join(group(number, 10 * f'<component objectid="{number - 1}"/>') for number in range(2, 21))


@pytest.mark.parametrize(
    ("items", "more", "message"),
    [
        ('<item objectid="2"/>', group(2, '<component objectid="2"/>'), "100 within each other, got more"),
        ('<item objectid="20"/>', TEN_FOLD, "expected at most 10000 objects, 100 within each other, got more"),
        ('<item objectid="9"/>', "", "expected an object '9', got none"),
        ("", "", "expected faces, got none"),
        ('<item objectid="2"/>', NO_VERTICES, "expected vertex numbers from 0 to -1, got 2"),
    ],
)
def test_3mf_without_its_objects_is_refused(tmp_path: Path, items: str, more: str, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        rc.load_mesh(write_3mf(tmp_path / "box.3mf", items, more=more))
    assert str(caught.value).startswith(str(tmp_path / "box.3mf"))


@pytest.mark.parametrize(
    ("name", "missing", "message"),
    [
        ("part.stl", "trimesh", r"part\.stl: reading \.stl files needs trimesh: pip install radarcore\[mesh\]"),
        ("part.step", "cascadio", r"\.step files needs trimesh and cascadio: pip install radarcore\[mesh\] cascadio"),
        ("part.dae", "collada", r"part\.dae: .* needs pycollada: pip install radarcore\[mesh\]"),
    ],
)
def test_packages_that_a_format_needs_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, missing: str, message: str
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)  # an import of it now fails
    (tmp_path / name).write_text("ISO-10303-21;")
    with pytest.raises(ImportError, match=message):
        rc.load_mesh(tmp_path / name)


def test_unit_that_trimesh_knows_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """3DXML has a unit: the same box in millimetres."""
    trimesh: ModuleType = pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    box = trimesh.Trimesh(1000.0 * BOX.vertices, BOX.triangles)
    box.units = "mm"
    monkeypatch.setattr(trimesh, "load_mesh", lambda path: box)
    (tmp_path / "box.3dxml").touch()
    assert_box(rc.load_mesh(tmp_path / "box.3dxml"))
