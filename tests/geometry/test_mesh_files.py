"""Files that are no meshes, or of another kind than their name says."""

from __future__ import annotations

import struct
from pathlib import Path

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
        pytest.importorskip("trimesh", reason="needs the extra `mesh`")
    path = tmp_path / name
    content, message = FILES[name]
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r".") as caught:
        rc.load_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


def test_text_of_an_stl_file_is_an_stl_file(tmp_path: Path) -> None:
    pytest.importorskip("trimesh", reason="needs the extra `mesh`")
    path = tmp_path / "part.stl"
    path.write_text(
        "solid part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        "endsolid part\n",
        encoding="utf-8",
    )
    assert len(rc.load_mesh(path).triangles) == 1


def test_faults_within_an_obj_file_are_told_without_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "part.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"part\.obj:4") as caught:
        rc.load_mesh(path)
    assert "begins" not in str(caught.value)
