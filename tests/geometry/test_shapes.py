"""Shapes: closed, wound outwards, on their surface, with the areas and volumes of the textbook."""

import numpy as np
import pytest

from radarcore.geometry import shapes
from solids import area_vectors, corners, directed_edges, is_closed, volume

# A few roundings of f64 in every coordinate.
ROUNDING = 1e-15


def normals(mesh):
    vectors = area_vectors(mesh)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def area(mesh):
    return np.linalg.norm(area_vectors(mesh), axis=1).sum()


def samples_on_facets(mesh, n=8):
    """Points all over every facet, corners and edges included, (point, 3)."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    weights = np.stack([i, j, n - i - j], axis=-1)[i + j <= n] / n
    return np.einsum("pk,ktx->ptx", weights, np.stack(corners(mesh))).reshape(-1, 3)


def distance_from_axis(points):
    return np.hypot(points[:, 0], points[:, 1])


def distance_from_capsule_core(points, radius, length):
    beyond = np.maximum(np.abs(points[:, 2]) - (0.5 * length - radius), 0.0)
    return np.hypot(distance_from_axis(points), beyond)


CLOSED = {
    "box": lambda: shapes.box((0.1, 0.2, 0.3)),
    "sphere": lambda: shapes.sphere(0.1),
    "icosahedron": lambda: shapes.sphere(0.1, subdivisions=0),
    "cylinder": lambda: shapes.cylinder(0.03, 0.2),
    "triangular prism": lambda: shapes.cylinder(0.03, 0.2, segments=3),
    "odd cylinder": lambda: shapes.cylinder(0.03, 0.2, segments=17),
    "capsule": lambda: shapes.capsule(0.05, 0.3),
    "spherical capsule": lambda: shapes.capsule(0.05, 0.1),
    "coarsest capsule": lambda: shapes.capsule(0.05, 0.3, segments=4),
    "octahedron": lambda: shapes.capsule(0.05, 0.1, segments=4),
}


@pytest.mark.parametrize("name", CLOSED)
def test_solids_are_closed_wound_outwards_and_centred_at_the_origin(name):
    mesh = CLOSED[name]()
    a, b, c = corners(mesh)
    tetrahedra = np.sum(a * np.cross(b, c), axis=1) / 6.0
    centroid = (tetrahedra[:, None] * (a + b + c) / 4.0).sum(axis=0) / tetrahedra.sum()
    assert np.abs(centroid).max() <= 1e-14  # sums of about 1e4 terms below 1 m
    assert is_closed(mesh)
    assert volume(mesh) > 0.0
    # They are convex and hold the origin: every single normal points away from it.
    assert (np.sum(normals(mesh) * a, axis=1) > 0.0).all()
    assert set(mesh.triangles.ravel().tolist()) == set(range(len(mesh.vertices))), "no vertex is left over"
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices), "no vertex comes twice"


def test_plate_faces_the_radar():
    mesh = shapes.plate(0.2, 0.1)
    assert len(mesh.triangles) == 2
    np.testing.assert_array_equal(normals(mesh), [[-1, 0, 0]] * 2)
    np.testing.assert_array_equal(np.ptp(mesh.vertices, axis=0), [0.0, 0.2, 0.1])
    np.testing.assert_array_equal(mesh.vertices.sum(axis=0), 0.0)
    assert area(mesh) == pytest.approx(0.02, rel=ROUNDING)


@pytest.mark.parametrize("segments", [None, 3, 4, 31])
def test_disc_faces_the_radar_and_has_the_area_of_the_disc(segments):
    mesh = shapes.disc(0.05, segments=segments)
    assert np.abs(normals(mesh) - [-1, 0, 0]).max() <= ROUNDING
    assert area(mesh) == pytest.approx(np.pi * 0.05**2, rel=1e-13)
    assert (mesh.vertices[:, 0] == 0.0).all()


@pytest.mark.parametrize("sagitta", [1e-3, 5e-5, 1e-7])
def test_rim_of_a_disc_keeps_to_the_sagitta(sagitta):
    mesh = shapes.disc(0.05, sagitta=sagitta)
    rim = mesh.vertices[:-1]
    middles = 0.5 * (rim + np.roll(rim, -1, axis=0))
    distance = np.linalg.norm(np.vstack([rim, middles]), axis=1)
    assert np.abs(distance - 0.05).max() <= sagitta


def test_box_has_the_given_edges():
    mesh = shapes.box((0.1, 0.2, 0.3))
    assert len(mesh.triangles) == 12
    assert volume(mesh) == pytest.approx(0.006, rel=1e-14)
    assert area(mesh) == pytest.approx(0.22, rel=1e-14)
    np.testing.assert_array_equal(mesh.vertices.max(axis=0), [0.05, 0.1, 0.15])
    assert {tuple(n) for n in normals(mesh).round(15).tolist()} == {
        tuple(v) for v in np.vstack([np.eye(3), -np.eye(3)])
    }
    np.testing.assert_array_equal(shapes.box(0.5).vertices, shapes.box([0.5, 0.5, 0.5]).vertices)


@pytest.mark.parametrize(("radius", "sagitta"), [(0.1, 5e-5), (0.01, 5e-5), (0.5, 5e-5), (0.1, 1e-3), (0.001, 1e-3)])
def test_sphere_keeps_to_the_sagitta(radius, sagitta):
    mesh = shapes.sphere(radius, sagitta=sagitta)
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) / radius - 1.0).max() <= ROUNDING
    distance = np.linalg.norm(samples_on_facets(mesh), axis=1)
    assert radius - sagitta <= distance.min()


def test_sphere_takes_the_fewest_subdivisions_that_will_do():
    chosen = shapes.sphere(0.1, sagitta=5e-5)
    levels = round(np.log2(len(chosen.triangles) / 20) / 2)
    assert 2 < levels <= 7
    coarser = shapes.sphere(0.1, subdivisions=levels - 1)
    depth = 0.1 - np.sum(normals(coarser) * corners(coarser)[0], axis=1)
    assert depth.max() > 5e-5
    assert len(shapes.sphere(1e-3).triangles) == 320, "never below two subdivisions"
    assert [len(shapes.sphere(1.0, subdivisions=level).triangles) for level in (0, 1, 3)] == [20, 80, 1280]


@pytest.mark.parametrize(("radius", "sagitta"), [(0.03, 5e-5), (0.5, 5e-5), (0.03, 1e-6), (0.03, 1.0)])
def test_cylinder_keeps_to_the_sagitta(radius, sagitta):
    mesh = shapes.cylinder(radius, 0.2, sagitta=sagitta, caps=False)
    assert np.abs(distance_from_axis(mesh.vertices) / radius - 1.0).max() <= ROUNDING
    assert distance_from_axis(samples_on_facets(mesh)).min() >= radius - sagitta
    np.testing.assert_array_equal(np.unique(mesh.vertices[:, 2]), [-0.1, 0.1])
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [2 * radius, 2 * radius, 0.2], rtol=ROUNDING)


@pytest.mark.parametrize("segments", [3, 12, 17])
def test_cylinder_has_the_volume_and_area_of_the_prism(segments):
    mesh = shapes.cylinder(0.03, 0.2, segments=segments)
    base = 0.5 * segments * 0.03**2 * np.sin(2 * np.pi / segments)
    side = 2 * segments * 0.03 * np.sin(np.pi / segments) * 0.2
    assert volume(mesh) == pytest.approx(base * 0.2, rel=1e-13)
    assert area(mesh) == pytest.approx(2 * base + side, rel=1e-13)
    assert area(shapes.cylinder(0.03, 0.2, segments=segments, caps=False)) == pytest.approx(side, rel=1e-13)
    assert len(mesh.triangles) == 4 * segments


@pytest.mark.parametrize(
    ("radius", "length", "sagitta"), [(0.05, 0.3, 5e-5), (0.05, 0.1, 5e-5), (0.2, 1.8, 1e-3), (0.01, 0.5, 1e-4)]
)
def test_capsule_keeps_to_the_sagitta(radius, length, sagitta):
    mesh = shapes.capsule(radius, length, sagitta=sagitta)
    on_surface = distance_from_capsule_core(mesh.vertices, radius, length)
    assert np.abs(on_surface - radius).max() <= ROUNDING * length
    assert distance_from_capsule_core(samples_on_facets(mesh), radius, length).min() >= radius - sagitta
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [2 * radius, 2 * radius, length], rtol=ROUNDING)


def test_straight_part_of_a_capsule_is_not_cut_lengthwise():
    mesh = shapes.capsule(0.05, 0.3, segments=16)
    num_half_sphere = 4 * 4**2  # ring by ring: 4 (1 + 3 + 5 + 7)
    assert len(mesh.triangles) == 2 * num_half_sphere + 2 * 16


def test_capsule_as_long_as_wide_is_a_sphere_whatever_the_rounding():
    # 0.1 + 0.2 is 5e-17 more than twice 0.15.
    assert len(shapes.capsule(0.15, 0.1 + 0.2).vertices) == len(shapes.capsule(0.15, 0.3).vertices)


def test_dihedral_is_two_perpendicular_plates_open_towards_the_radar():
    mesh = shapes.dihedral(0.1, 0.2)
    facing = normals(mesh)
    np.testing.assert_allclose(facing @ [-1, 0, 0], np.sqrt(0.5), rtol=ROUNDING)
    assert abs(facing[0] @ facing[-1]) <= ROUNDING
    np.testing.assert_allclose(facing[:, 2], 0.0)
    assert area(mesh) == pytest.approx(2 * 0.1 * 0.2, rel=ROUNDING)
    # The fold is the z axis; the aperture, towards -x, is as wide as the hypotenuse.
    np.testing.assert_array_equal(mesh.vertices[(mesh.vertices[:, :2] == 0).all(axis=1), 2], [-0.1, 0.1])
    assert mesh.vertices[:, 0].max() == 0.0
    assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(0.1 * np.sqrt(2), rel=ROUNDING)
    # The normals look into the corner: towards the other plate.
    outer = np.array([[-1, 1, 0], [-1, -1, 0]]) * np.sqrt(0.5)
    np.testing.assert_allclose(facing[[0, -1]], outer[::-1], atol=ROUNDING)
    np.testing.assert_array_equal(np.ptp(shapes.dihedral(0.1).vertices[:, 2]), 0.1)


@pytest.mark.parametrize(("shape", "plate_area"), [("triangular", 0.5 * 0.1**2), ("square", 0.1**2)])
def test_trihedral_is_three_perpendicular_plates_symmetric_about_boresight(shape, plate_area):
    mesh = shapes.trihedral(0.1, shape=shape)
    facing = normals(mesh)
    np.testing.assert_allclose(facing @ [-1, 0, 0], np.sqrt(1 / 3), rtol=4 * ROUNDING)
    per_plate = facing.reshape(3, -1, 3) if shape == "triangular" else facing.reshape(2, 3, 3).transpose(1, 0, 2)
    assert np.abs(per_plate - per_plate[:, :1]).max() <= ROUNDING
    np.testing.assert_allclose(per_plate[:, 0] @ per_plate[:, 0].T, np.eye(3), atol=ROUNDING)
    assert area(mesh) == pytest.approx(3 * plate_area, rel=1e-14)
    # The inside is where every plate's front is: boresight, and every vertex not on the plate itself.
    assert (facing @ mesh.vertices.T >= -ROUNDING).all()
    # Apex at the origin, one edge in the x-z plane pointing up and towards the radar.
    np.testing.assert_array_equal(mesh.vertices[0], 0.0)
    np.testing.assert_allclose(mesh.vertices[1], [-0.1 / np.sqrt(3), 0.0, 0.1 * np.sqrt(2 / 3)], rtol=4 * ROUNDING)
    assert mesh.vertices[1:, 0].max() < 0.0
    edges = directed_edges(mesh).tolist()
    assert len({tuple(edge) for edge in edges}) == len(edges), "no edge is run through twice in one direction"
