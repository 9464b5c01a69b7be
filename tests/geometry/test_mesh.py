"""Meshes: errors, dropped triangles, warnings, and files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from solids import CUBE_VERTICES

SQUARE = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]
HALVES = [[0, 2, 1], [0, 3, 2]]

CUBE = f"""# a cube of edge 1, as quads
o cube
{CUBE_VERTICES}f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""


@pytest.mark.parametrize(("vertices", "triangles"), [([], []), (SQUARE, []), (np.zeros((0, 3)), np.zeros((0, 3), int))])
def test_mesh_without_triangles_is_a_mesh(vertices: Any, triangles: Any) -> None:
    mesh = rc.Mesh(vertices, triangles)
    assert (mesh.triangles.shape, mesh.num_dropped, mesh.area, mesh.volume) == ((0, 3), 0, 0.0, 0.0)
    assert np.isnan(mesh.bounds).all()


def test_degenerate_triangles_are_dropped_and_counted() -> None:
    vertices = [*SQUARE, [0.0, 2.0, 2.0], [0.0, 1e-10, 0.0]]
    mesh = rc.Mesh(vertices, [[0, 2, 1], [0, 0, 1], [0, 2, 4], [0, 3, 2], [0, 5, 5]])
    assert mesh.num_dropped == 3
    np.testing.assert_array_equal(mesh.triangles, HALVES)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    assert mesh.area == pytest.approx(1.0, rel=1e-15)
    assert "3 dropped" in repr(mesh)


def test_mesh_of_nothing_but_degenerate_triangles_warns() -> None:
    with pytest.warns(UserWarning, match="got 2 degenerate ones; the mesh is empty"):
        mesh = rc.Mesh(SQUARE, [[0, 0, 1], [1, 1, 1]])
    assert (len(mesh.triangles), mesh.num_dropped) == (0, 2)


def test_mesh_keeps_its_own_copy() -> None:
    vertices, triangles = np.array(SQUARE), np.array(HALVES, dtype=np.uint32)
    mesh = rc.Mesh(vertices, triangles)
    vertices[:], triangles[:] = 7.0, 0
    np.testing.assert_array_equal(mesh.vertices, SQUARE)
    np.testing.assert_array_equal(mesh.triangles, HALVES)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1.0


def test_arrays_of_any_layout_and_type_make_the_same_mesh() -> None:
    expected = rc.Mesh(SQUARE, HALVES)
    for dtype in ("float32", ">f8", "int16"):
        for index in ("int8", "uint64", ">i4"):
            mesh = rc.Mesh(np.asfortranarray(SQUARE, dtype=dtype), np.asfortranarray(HALVES, dtype=index))
            np.testing.assert_array_equal(mesh.vertices, expected.vertices)
            np.testing.assert_array_equal(mesh.triangles, expected.triangles)
            assert (mesh.vertices.dtype, mesh.triangles.dtype) == (np.float64, np.uint32)


RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=1))


def depth_of_a_prism(**options: Any) -> float:
    """Depth of the middle of a facet of a cylinder of 1 m with 24 facets of 15 degrees."""
    shape = rc.shapes.cylinder(1.0, 2.0, segments=24)
    body = rc.Body(
        rc.Mesh(shape.vertices, shape.triangles, **options), motion=rc.Pose.from_rpy([5, 0, 0], [0, 0, np.pi / 24])
    )
    sim = rc.Simulator(rc.Scene([body]), RADAR, resolution=1, field_of_view_deg=(0.1, 0.1), sampling="point")
    (delay,) = sim.paths().delay.ravel()
    return float(0.5 * 299_792_458.0 * delay)


def test_facets_below_the_crease_angle_stand_for_a_curved_surface() -> None:
    facet = 5.0 - np.cos(np.pi / 24)
    round_depth = depth_of_a_prism()
    # The sagitta is 8.6 mm; the diagonal of every side turns the normals by a sixth of 15 degrees, a third of it.
    assert abs(round_depth - 4.0) <= 0.4 * (facet - 4.0)
    assert depth_of_a_prism(crease_angle_deg=16.0) == round_depth
    for flat in ({"crease_angle_deg": 14.0}, {"crease_angle_deg": 0.0}, {"shading": "flat"}):
        assert depth_of_a_prism(**flat) == pytest.approx(facet, rel=1e-13)


def written(tmp_path: Path, text: str, name: str = "part.obj") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_cube_of_quads_is_read_as_twelve_triangles_of_volume_one(tmp_path: Path) -> None:
    path = written(tmp_path, CUBE)
    for given in (path, str(path)):
        mesh = rc.load_mesh(given)
        assert (len(mesh.triangles), mesh.vertices.shape, mesh.num_dropped) == (12, (8, 3), 0)
        assert mesh.volume == pytest.approx(1.0, rel=1e-15)
        assert mesh.area == pytest.approx(6.0, rel=1e-15)
        np.testing.assert_array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 1]])


def test_normals_in_a_file_are_ignored(tmp_path: Path) -> None:
    ball = rc.shapes.sphere(0.1, subdivisions=2)
    vertices = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in ball.vertices.tolist())
    plain, wrong = (
        "".join(f"f {a + 1}{normal} {b + 1}{normal} {c + 1}{normal}\n" for a, b, c in ball.triangles)
        for normal in ("", "//1")
    )
    one = rc.load_mesh(written(tmp_path, vertices + plain))
    other = rc.load_mesh(written(tmp_path, vertices + "vn 0 0 1\n" + wrong))
    for body in (one, other):
        np.testing.assert_array_equal(body.triangles, ball.triangles)
    at_rest = rc.Pose([1.0, 0.0, 0.0])
    images = [rc.Simulator(rc.Scene([rc.Body(mesh, motion=at_rest)]), RADAR).depth_image() for mesh in (one, other)]
    np.testing.assert_array_equal(images[0].normals, images[1].normals)


def test_scale_and_shading_are_passed_on(tmp_path: Path) -> None:
    mesh = rc.load_mesh(written(tmp_path, CUBE), scale=1e-3, shading="flat", crease_angle_deg=30.0)
    assert mesh.volume == pytest.approx(1e-9, rel=1e-12)
    assert (mesh.shading, mesh.crease_angle_deg) == ("flat", 30.0)
    for scale in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="scale: expected"):
            rc.load_mesh(written(tmp_path, CUBE), scale=scale)


@pytest.mark.parametrize("name", ["missing.obj", "missing.stl"])
def test_missing_file_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(FileNotFoundError) as caught:
        rc.load_mesh(path)
    assert (caught.value.filename, caught.value.strerror) == (str(path), "No such file or directory")


@pytest.mark.parametrize("name", ["folder", "folder.obj", "folder.stl"])
def test_directory_is_not_a_mesh(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.mkdir()
    with pytest.raises(IsADirectoryError, match=name):
        rc.load_mesh(path)


def test_material_files_need_not_exist(tmp_path: Path) -> None:
    text = CUBE.replace("o cube", "mtllib nowhere.mtl\nusemtl steel")
    (mesh,) = rc.load_meshes(written(tmp_path, text), split_by="material").values()
    assert len(mesh.triangles) == 12


TWO_PARTS = """v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
v 1 0 1
v 0 1 1
f 1 2 3
o lower
g left
usemtl steel
f 1 2 3
usemtl glass
f 1 3 2
o upper
g left
f 4 5 6
g right
f 4 6 5
o nothing
"""


@pytest.mark.parametrize(
    ("split_by", "counts"),
    [
        ("object", {"": 1, "lower": 2, "upper": 2}),
        ("group", {"": 1, "left": 3, "right": 1}),
        ("material", {"": 1, "steel": 1, "glass": 3}),
    ],
)
def test_file_splits_by_objects_groups_or_materials(tmp_path: Path, split_by: str, counts: dict[str, int]) -> None:
    meshes = rc.load_meshes(written(tmp_path, TWO_PARTS), split_by=split_by, scale=2.0, shading="flat")
    assert list(meshes) == list(counts), "in the order of the file"
    assert {name: len(mesh.triangles) for name, mesh in meshes.items()} == counts
    for mesh in meshes.values():
        assert mesh.area == pytest.approx(2.0 * len(mesh.triangles), rel=1e-15)
        assert mesh.shading == "flat"
        assert set(mesh.triangles.ravel().tolist()) == set(range(len(mesh.vertices))), "no vertex of another part"


@pytest.mark.parametrize("suffix", ["stl", "ply", "glb"])
def test_other_formats_are_read_through_trimesh(tmp_path: Path, suffix: str) -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    path = tmp_path / f"part.{suffix}"
    trimesh.creation.box(extents=(0.1, 0.2, 0.3)).export(path)
    mesh = rc.load_mesh(path, scale=10.0)
    assert len(mesh.triangles) == 12
    assert mesh.volume == pytest.approx(6.0, rel=1e-6)  # files in single precision


def test_format_that_nobody_reads_is_an_error_with_the_path(tmp_path: Path) -> None:
    pytest.importorskip("trimesh", reason="needs the extra `mesh`: pip install radarcore[mesh]")
    with pytest.raises(ValueError, match=r"part\.xyzzy"):
        rc.load_mesh(written(tmp_path, "nonsense", "part.xyzzy"))
