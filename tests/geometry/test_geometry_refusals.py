"""Refusals of meshes and shapes. Faults of OBJ files line by line are in rust/geometry/obj/tests.rs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.geometry import shapes

SQUARE = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]
HALVES = [[0, 2, 1], [0, 3, 2]]


def with_row(row: Any) -> rc.Mesh:
    return rc.Mesh([*SQUARE[:3], row], HALVES)


def square(triangles: Any) -> rc.Mesh:
    return rc.Mesh(SQUARE, triangles)


ROWS = "rows of different lengths"

REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: with_row([0, 0, np.nan]), ValueError, r"vertices: expected finite coordinates .* NaN\] at row 3"),
    (lambda: with_row([0, 1e16, 0]), ValueError, "vertices: expected coordinates below 1e15 m"),
    (lambda: with_row([0, 0]), ValueError, rf"vertices: expected shape \(n, 3\), got {ROWS}"),
    (lambda: rc.Mesh(np.zeros((4, 2)), HALVES), ValueError, r"vertices: expected shape \(n, 3\), got \(4, 2\)"),
    (lambda: rc.Mesh("square", HALVES), TypeError, "vertices: expected numbers, got <U6"),
    (lambda: rc.Mesh(None, HALVES), TypeError, "vertices: expected numbers, got object"),  # type: ignore[arg-type]
    (lambda: rc.Mesh(1j * np.eye(3), [[0, 1, 2]]), TypeError, "vertices: expected numbers, got complex128"),
    (lambda: rc.Mesh([], [[0, 1, 2]]), ValueError, "triangles: expected vertex numbers"),
    (lambda: square([[0, 1, 2], [0, 4, 2]]), ValueError, r"numbers from 0 to 3, got \[0, 4, 2\] at row 1"),
    (lambda: square([[0, 1, 2], [0, -1, 2]]), ValueError, r"numbers from 0 to 3, got \[0, -1, 2\] at row 1"),
    (lambda: square([[0, 1, 2**32]]), ValueError, r"numbers from 0 to 3, got \[0, 1, 4294967296\] at row 0"),
    (lambda: square([[0.0, 1.0, 2.0]]), TypeError, "triangles: expected integers, got float64"),
    (lambda: square([[True, False, True]]), TypeError, "triangles: expected integers, got bool"),
    (lambda: square([[0, 1]]), ValueError, r"triangles: expected shape \(m, 3\), got \(1, 2\)"),
    (lambda: square([[0, 1, 2], [0]]), ValueError, rf"triangles: expected shape \(m, 3\), got {ROWS}"),
    (lambda: shapes.plate(0.0, 0.1), ValueError, "width: expected a positive number"),
    (lambda: shapes.box([0.1, 0.0, 0.1]), ValueError, "size along y: expected a positive number"),
    (lambda: shapes.sphere(0.0), ValueError, "radius: expected a positive number"),
    (lambda: shapes.trihedral(-1.0), ValueError, "leg: expected a positive number"),
    (lambda: shapes.capsule(0.1, 0.15), ValueError, "length: expected at least the two half-spheres, 0.2 m"),
    (lambda: shapes.capsule(0.1, 0.3, segments=10), ValueError, "segments: expected a multiple of 4, got 10"),
    (lambda: shapes.sphere(0.1, subdivisions=8), ValueError, "subdivisions: expected at most 7, got 8"),
    (lambda: shapes.sphere(0.1, sagitta=1e-9), ValueError, "sagitta: expected at least .* got 1e-09"),
    (lambda: shapes.disc(0.1, sagitta=1e-12), ValueError, "sagitta: .* takes .* segments, expected at most 4096"),
    (lambda: shapes.disc(1.0, sagitta=5e-324), ValueError, "sagitta: .* segments"),
]


@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("load", [rc.load_mesh, rc.load_meshes])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# nothing\n", r":1: file: expected faces that have an area, got none; the file begins"),
        ("v 0 0 0\nv 1 0 x\n", r":2: vertex: expected three numbers, got `1 0 x`$"),
    ],
)
def test_fault_in_a_file_names_its_line(
    load: Callable[[Path], object], text: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "part.obj"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"part\.obj" + message):
        load(path)


def test_only_obj_files_split(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"path: expected an OBJ file, got .*part\.stl"):
        rc.load_meshes(tmp_path / "part.stl")
