"""Mesh reports against answers known on paper."""

from __future__ import annotations

import dataclasses
import json
import pickle
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli.main import main
from radarcore.geometry.mesh_report import MeshReport

C = 299_792_458.0


@cache
def of_sphere(radius: float, subdivisions: int) -> MeshReport:
    """Report of a sphere, made once."""
    return rc.mesh_report(rc.shapes.sphere(radius, subdivisions=subdivisions))


def counts(report: MeshReport) -> tuple[int, ...]:
    """Parts, open, non-manifold and inconsistent edges."""
    edges = report.num_open_edges, report.num_nonmanifold_edges, report.num_inconsistent_edges
    return report.num_parts, *edges


def joined(*meshes: rc.Mesh) -> rc.Mesh:
    """All in one, each with vertices of its own."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    rows = [mesh.triangles + int(start) for mesh, start in zip(meshes, starts, strict=False)]
    return rc.Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(rows))


def moved(mesh: rc.Mesh, by: Any) -> rc.Mesh:
    return rc.Mesh(mesh.vertices + np.asarray(by), mesh.triangles)


@pytest.mark.parametrize(("radius", "subdivisions"), [(0.1, 3), (0.01, 2)])
def test_sagitta_of_a_sphere_is_what_its_facets_lack_in_radius(subdivisions: int, radius: float) -> None:
    mesh = rc.shapes.sphere(radius, subdivisions=subdivisions)
    report = of_sphere(radius, subdivisions)
    corners = mesh.vertices[mesh.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    lacking = radius - np.linalg.norm(corners.mean(axis=1), axis=1)
    # The surface is quadratic between the corners: off by the sagitta over the radius.
    second_order = lacking.max() / radius
    assert report.largest_sagitta == pytest.approx(lacking.max(), rel=1.1 * second_order)
    assert report.mean_sagitta == pytest.approx((lacking * area).sum() / area.sum(), rel=1.1 * second_order)
    assert report.largest_phase == pytest.approx(4.0 * np.pi * 60e9 / C * report.largest_sagitta, rel=1e-12)
    assert report.mean_phase == pytest.approx(4.0 * np.pi * 60e9 / C * report.mean_sagitta, rel=1e-12)
    assert report.smooth_share == 1.0
    assert report.area == pytest.approx(mesh.area, rel=1e-12)
    assert report.num_triangles == len(mesh.triangles)
    assert counts(report) == (1, 0, 0, 0)


def test_sagitta_of_a_cylinder_is_that_of_its_facets() -> None:
    # Over the middle of a triangle, at a third of the width w of a side, an arc of the angle d is at w d / 9; whichever
    # way the diagonals run, as both triangles of a side count as one.
    n, a, length = 48, 0.01, 0.03
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = np.stack([a * np.cos(angle), a * np.sin(angle)], 1)
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (0.0, length)])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    triangles = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    tube = rc.Mesh(vertices, triangles)
    report = rc.mesh_report(tube)
    width = 2.0 * a * np.sin(np.pi / n)
    assert report.largest_sagitta == pytest.approx(width * 2.0 * np.pi / n / 9.0, rel=2e-3)
    assert report.mean_sagitta == pytest.approx(report.largest_sagitta, rel=1e-6)
    # Open at both ends.
    assert counts(report) == (1, 2 * n, 0, 0)
    assert report.smooth_share == 1.0


def test_box_is_closed_and_flat_and_the_same_either_way() -> None:
    box = rc.shapes.box([0.1, 0.2, 0.3])
    for mesh in (box, rc.Mesh(box.vertices, box.triangles, shading="flat")):
        report = rc.mesh_report(mesh)
        assert counts(report) == (1, 0, 0, 0)
        assert report.smooth_share == 0.0
        assert (report.largest_sagitta, report.mean_sagitta, report.largest_phase) == (0.0, 0.0, 0.0)
        assert report.area == pytest.approx(2.0 * (0.02 + 0.03 + 0.06), rel=1e-12)
        assert report.verdict == "All facets are flat: the radar sees them as they are."


def test_flat_mesh_is_looked_at_as_if_it_were_smooth() -> None:
    ball = rc.shapes.sphere(0.02, subdivisions=3)
    assert rc.mesh_report(rc.Mesh(ball.vertices, ball.triangles, shading="flat")) == of_sphere(0.02, 3)
    # With a crease angle below that between its facets it has none to be smooth.
    sharp = rc.Mesh(ball.vertices, ball.triangles, crease_angle_deg=1.0)
    assert rc.mesh_report(sharp).smooth_share == 0.0


def test_phase_of_the_sagitta_counts_in_wavelengths() -> None:
    # Sagitta and phase go down by four with every subdivision: 1280 facets on 10 cm are up to 0.46 mm inside.
    reports = [of_sphere(0.1, subdivisions) for subdivisions in (3, 4, 5)]
    for coarse, fine in pairwise(reports):
        assert fine.mean_phase == pytest.approx(coarse.mean_phase / 4.0, rel=0.03)
    low = rc.mesh_report(rc.shapes.sphere(0.1, subdivisions=3), frequency=6e9)
    same = rc.mesh_report(rc.shapes.sphere(0.01, subdivisions=3), frequency=60e9)
    assert low.mean_phase == pytest.approx(same.mean_phase, rel=1e-6)
    assert low.largest_phase == pytest.approx(0.1 * reports[0].largest_phase, rel=1e-12)


def test_one_flipped_triangle_has_three_inconsistent_edges() -> None:
    ball = rc.shapes.sphere(0.02, subdivisions=2)
    triangles = ball.triangles.copy()
    triangles[7] = triangles[7, ::-1]
    report = rc.mesh_report(rc.Mesh(ball.vertices, triangles))
    assert counts(report) == (1, 0, 0, 3)
    assert 0.9 < report.smooth_share < 1.0


def test_boxes_that_touch_are_one_part_where_they_share_edges() -> None:
    box = rc.shapes.box([0.1, 0.1, 0.1])
    apart = joined(box, moved(box, [0.2, 0.0, 0.0]))
    assert counts(rc.mesh_report(apart)) == (2, 0, 0, 0)
    corner = joined(box, moved(box, [0.1, 0.1, 0.1]))
    assert counts(rc.mesh_report(corner)) == (2, 0, 0, 0)
    edge = joined(box, moved(box, [0.1, 0.1, 0.0]))
    assert counts(rc.mesh_report(edge)) == (1, 0, 1, 0)
    # Face on face: four edges round it; its diagonals may differ.
    face = rc.mesh_report(joined(box, moved(box, [0.1, 0.0, 0.0])))
    assert (face.num_parts, face.num_open_edges) == (1, 0)
    assert face.num_nonmanifold_edges in (4, 5)


def test_three_sheets_on_one_edge_are_non_manifold() -> None:
    vertices = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]]
    report = rc.mesh_report(rc.Mesh(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    assert counts(report) == (1, 6, 1, 0)
    assert report.area == pytest.approx(0.5 + 2 * 0.5 * np.sqrt(2.0))


def test_doubled_thin_and_degenerate_triangles_are_counted() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.009, 0], [0.5, 0.011, 0], [0, 0, 0]]
    once, again, turned = [0, 1, 2], [1, 2, 5], [2, 1, 0]
    thin, not_quite, none = [0, 1, 3], [0, 1, 4], [0, 0, 1]
    report = rc.mesh_report(rc.Mesh(vertices, [once, again, turned, thin, not_quite, none]))
    assert (report.num_triangles, report.num_dropped) == (5, 1)
    assert (report.num_duplicates, report.num_thin) == (2, 1)


@pytest.mark.parametrize(
    ("order", "shading"), [("behind", "smooth"), ("in turn", "flat"), ("mixed", "flat"), ("own vertices", "smooth")]
)
def test_surface_in_both_windings_is_the_surface(order: str, shading: str) -> None:
    """pi r^2 of a sphere, at 60 GHz; no walls at right angles on a cylinder. Normals face outwards."""
    ball, can = rc.shapes.sphere(0.1, subdivisions=4), rc.shapes.cylinder(0.1, 0.3)

    def doubled(mesh: rc.Mesh) -> rc.Mesh:
        turned = mesh.triangles[:, [1, 0, 2]]
        both = np.stack([mesh.triangles, turned])
        both = both.swapaxes(0, 1).reshape(-1, 3) if order == "in turn" else both.reshape(-1, 3)
        vertices = mesh.vertices
        if order == "mixed":
            np.random.default_rng(7).shuffle(both)
        if order == "own vertices":
            vertices = np.vstack([vertices, vertices])
            both[len(turned) :] += len(mesh.vertices)
        return rc.Mesh(vertices, both, shading=shading)

    mesh = doubled(ball)
    assert mesh.num_merged == len(ball.triangles)
    assert mesh.volume == pytest.approx(ball.volume, rel=1e-12)
    single = rc.Mesh(ball.vertices, ball.triangles, shading=shading)
    expected = rc.rcs(single, 60e9, azimuth_deg=[0.0, 30.0, 77.0])
    np.testing.assert_allclose(rc.rcs(mesh, 60e9, azimuth_deg=[0.0, 30.0, 77.0]), expected, rtol=1e-6)
    if shading == "smooth":
        np.testing.assert_allclose(10.0 * np.log10(expected), -15.03, atol=0.3)
    report = rc.mesh_report(doubled(rc.shapes.sphere(0.1, subdivisions=1)))
    assert counts(report) == (1, 0, 0, 0)
    assert report.num_merged == 80
    body = rc.Body(doubled(can), motion=rc.Pose.from_rpy([2.0, 0.0, 0.0], [0.1, 0.2, 0.3]))
    rc.Simulator(rc.Scene([body]), rc.bgt60tr13c()).frame(0.0)  # without a warning


def test_two_windings_stay_where_they_are_no_double_surface() -> None:
    """Two boxes that share a face, triangle by triangle; a triangle without neighbours; a copy in the same winding."""
    box = rc.shapes.box(0.1)
    assert joined(box, moved(box, [0.1, 0.0, 0.0])).num_merged == 0
    assert rc.Mesh(np.eye(3), [[0, 1, 2], [2, 1, 0]]).num_merged == 0
    assert joined(box, box).num_merged == 0
    # A body of no thickness, whose two sides coincide, is a plate; pickles keep the count.
    plate = rc.shapes.plate(0.1, 0.1)
    thin = rc.Mesh(plate.vertices, np.vstack([plate.triangles, plate.triangles[:, ::-1]]))
    assert (thin.num_merged, thin.area) == (2, pytest.approx(plate.area))
    assert repr(pickle.loads(pickle.dumps(thin))) == repr(thin) == "<Mesh: 2 triangles, 2 merged, 4 vertices, smooth>"


def test_mesh_without_triangles_has_a_report() -> None:
    report = rc.mesh_report(rc.Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)))
    assert counts(report) == (0, 0, 0, 0)
    assert (report.area, report.smooth_share, report.mean_phase) == (0.0, 0.0, 0.0)
    assert report.verdict == "No triangle has an area: the radar sees nothing."


def test_verdict_distinguishes_fine_from_coarse() -> None:
    assert of_sphere(0.1, 5).verdict.startswith("Fine enough: facets are up to 0.0")
    coarse = of_sphere(0.1, 3).verdict
    assert coarse.startswith("Coarse: facets are up to 0.4")
    assert "Use a finer mesh; expect peak errors of about 5.9 dB." in coarse


def test_report_is_frozen_and_reads_as_lines() -> None:
    report = rc.mesh_report(rc.shapes.box([0.1, 0.1, 0.1]))
    with pytest.raises(dataclasses.FrozenInstanceError):
        report.area = 1.0  # type: ignore[misc]  # that is the point
    lines = str(report).splitlines()
    assert lines[0].split() == ["triangles", "12"]
    assert lines[-1] == report.verdict
    assert len({line.rindex("  ") for line in lines[: len(report.facts())]}) == 1, "values in one column"


def test_info_of_a_mesh_file_is_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "box.obj"
    box = rc.shapes.box([100.0, 200.0, 300.0])  # in millimetres
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in box.triangles]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert main(["info", str(path), "--scale", "1e-3"]) == 0
    assert capsys.readouterr().out.strip() == str(rc.mesh_report(rc.load_mesh(path, scale=1e-3)))
    assert main(["info", str(path), "--scale", "1e-3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["mesh"], found["triangles"], found["open edges"]) == (str(path), 12, 0)
    assert found["area [m^2]"] == pytest.approx(0.22, rel=1e-9)
    assert found["verdict"] == "All facets are flat: the radar sees them as they are."
    assert main(["info", str(tmp_path / "none.obj")]) == 1
    assert "none.obj" in capsys.readouterr().err
