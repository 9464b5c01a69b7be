"""COLLADA files: unit, up axis and transforms of nodes, against boxes known on paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import radarcore as rc

pytest.importorskip("collada", reason="needs the extra `mesh`: pip install radarcore[mesh]")

SIZES = np.array([1.0, 2.0, 4.0])
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 4)], dtype=float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [row for a, b, c, d in QUADS for row in ((a, b, c), (a, c, d))]

FILE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset>{asset}</asset>
  <library_geometries><geometry id="box" name="box"><mesh>
    <source id="corners"><float_array id="numbers" count="24">{corners}</float_array><technique_common>
      <accessor source="#numbers" count="8" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="vertices"><input semantic="POSITION" source="#corners"/></vertices>
    {faces}
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
INSTANCE = '<instance_geometry url="#box"/>'
INPUT = '<input semantic="VERTEX" source="#vertices" offset="0"/>'
AS_TRIANGLES = f'<triangles count="12">{INPUT}<p>{" ".join(str(i) for row in TRIANGLES for i in row)}</p></triangles>'
AS_QUADS = (
    f'<polylist count="6">{INPUT}<vcount>{"4 " * 6}</vcount>'
    f"<p>{' '.join(str(i) for row in QUADS for i in row)}</p></polylist>"
)


def load(
    folder: Path, *, asset: str = "<up_axis>Z_UP</up_axis>", node: str = "", faces: str = AS_TRIANGLES, body: str = ""
) -> rc.Mesh:
    path = folder / "box.dae"
    nodes = body or f'<node id="n">{node}{INSTANCE}</node>'
    corners = " ".join(map(str, CORNERS.ravel()))
    path.write_text(FILE.format(asset=asset, corners=corners, faces=faces, nodes=nodes))
    return rc.load_mesh(path)


def check_box(mesh: rc.Mesh, low: object, high: object) -> None:
    """A closed box between two corners, with its normals outwards."""
    np.testing.assert_allclose(mesh.bounds, [low, high], atol=1e-6)  # node transforms are float32 in pycollada
    assert len(mesh.triangles) == 12
    assert mesh.volume == pytest.approx(np.prod(mesh.bounds[1] - mesh.bounds[0]), rel=1e-6)


@pytest.mark.parametrize("faces", [AS_TRIANGLES, AS_QUADS])
def test_box_without_a_transform_is_as_its_file_says(tmp_path: Path, faces: str) -> None:
    check_box(load(tmp_path, faces=faces), [0, 0, 0], SIZES)


CENTIMETRES = '<unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis>'
# Scaled to 2 x 2 x 4, turned by 90 degrees about z: x from -2 to 0; then moved by 10 along x.
INNER = f'<node id="b"><rotate>0 0 1 90</rotate><scale>2 1 1</scale>{INSTANCE}</node>'


@pytest.mark.parametrize(
    ("given", "low", "high"),
    [
        ({"asset": CENTIMETRES}, [0, 0, 0], 0.01 * SIZES),
        # Translations of nodes are in the file's unit as well.
        ({"asset": CENTIMETRES, "node": "<translate>100 0 0</translate>"}, [1, 0, 0], [1.01, 0.02, 0.04]),
        # The side along the up axis (4, 2 and 1 m) becomes the height; (x, y, z) -> (x, -z, y) and (-y, -z, x).
        ({"asset": "<up_axis>Z_UP</up_axis>"}, [0, 0, 0], [1, 2, 4]),
        ({"asset": "<up_axis>Y_UP</up_axis>"}, [0, -4, 0], [1, 0, 2]),
        ({"asset": "<up_axis>X_UP</up_axis>"}, [-2, -4, 0], [0, 0, 1]),
        ({"asset": ""}, [0, -4, 0], [1, 0, 2]),  # y by COLLADA's rule
        ({"body": f'<node id="a"><translate>10 0 0</translate>{INNER}</node>'}, [8, 0, 0], [10, 2, 4]),
        # A mirrored node keeps its normals outwards.
        ({"node": "<matrix>-1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1</matrix>"}, [-1, 0, 0], [0, 2, 4]),
    ],
)
def test_unit_axes_and_transforms_of_a_file_place_the_box(
    tmp_path: Path, given: dict[str, str], low: object, high: object
) -> None:
    check_box(load(tmp_path, **given), low, high)


def test_geometry_that_is_shown_twice_is_there_twice(tmp_path: Path) -> None:
    body = f'<node id="a">{INSTANCE}</node><node id="b"><translate>5 0 0</translate>{INSTANCE}</node>'
    mesh = load(tmp_path, body=body)
    assert len(mesh.triangles) == 24
    assert mesh.volume == pytest.approx(16.0)
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [6, 2, 4]])


def test_scale_of_the_call_comes_on_top(tmp_path: Path) -> None:
    load(tmp_path)
    check_box(rc.load_mesh(tmp_path / "box.dae", scale=0.5), [0, 0, 0], 0.5 * SIZES)


def test_visual_of_a_urdf_file_is_scaled_and_put_at_its_origin(tmp_path: Path) -> None:
    load(tmp_path, asset='<unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis>')
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"><visual><origin xyz="5 0 0" rpy="0 0 1.5707963267948966"/>'
        '<geometry><mesh filename="box.dae" scale="10 10 10"/></geometry></visual></link></robot>'
    )
    mesh = rc.models.RobotArm.from_urdf(tmp_path / "arm.urdf", meshes="visual").links["base"]
    # 1 x 4 x 2 cm with z up, from y = -4 cm to 0; ten times as large; turned from y to -x; moved by 5 m.
    assert mesh is not None
    check_box(mesh, [5.0, 0.0, 0.0], [5.4, 0.1, 0.2])


def test_file_without_a_shown_face_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"box\.dae: expected faces, got none"):
        load(tmp_path, body='<node id="empty"/>')
