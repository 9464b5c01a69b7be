"""Analytic shapes as triangle meshes: targets whose radar cross-section is known on paper.

Every shape is centred at the origin and ready to be put in front of a radar that looks along +x: flat faces
and openings look towards -x, axes of revolution lie along z. A corner reflector has its fold line or apex at
the origin: that is the point its range refers to. Sizes are in metres.

Curved shapes have their vertices exactly on the surface and enough facets to keep every facet within `sagitta` of it.
With smooth shading (the default of `Mesh`) what is left of that distance is corrected to second order at every hit;
`segments` or `subdivisions` set the number of facets by hand.
"""

from __future__ import annotations

from functools import cache
from math import asin, ceil, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.mesh import Mesh, as_reflector

__all__ = ["box", "capsule", "cylinder", "dihedral", "disc", "plate", "sphere", "trihedral"]


def __dir__() -> list[str]:
    """Public names, for completion."""
    return __all__


_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

# Facets of a circle that no sagitta may exceed: a capsule of that many segments has two million triangles.
_MAX_SEGMENTS = 4096
# 327 680 triangles; facets within 1.8e-5 of the radius.
_MAX_SUBDIVISIONS = 7


def plate(width: float, height: float) -> Mesh:
    """Rectangle in the y-z plane, seen from -x.

    Parameters
    ----------
    width, height : float
        Edges along y and along z [m].

    Returns
    -------
    Mesh
        Two triangles with normal -x. Broadside cross-section ``4 pi (width height / wavelength)^2``.

    See Also
    --------
    shapes.disc : A round one.
    rcs : Its cross-section.

    Examples
    --------
    >>> plate = rc.shapes.plate(0.1, 0.1)
    >>> sigma = rc.rcs(plate, 60e9, azimuth_deg=180.0)
    >>> print(f"{sigma[0]:.1f} m^2")
    50.3 m^2
    """
    y = 0.5 * check.positive("width", width, "m")
    z = 0.5 * check.positive("height", height, "m")
    return Mesh([[0, -y, -z], [0, -y, z], [0, y, z], [0, y, -z]], [[0, 1, 2], [0, 2, 3]])


def disc(radius: float, *, segments: int | None = None, sagitta: float = 5e-5) -> Mesh:
    """Disc in the y-z plane, seen from -x.

    Parameters
    ----------
    radius : float
        Radius of the disc [m].
    segments : int, optional
        Corners of the polygon, at least 3; default: from `sagitta`.
    sagitta : float
        Largest distance of the polygon's rim from the circle [m].

    Returns
    -------
    Mesh
        Regular polygon with normal -x and **the area of the disc** (its corners lie slightly outside the
        circle), so that the broadside cross-section ``4 pi (area / wavelength)^2`` is the disc's.

    See Also
    --------
    shapes.plate : A rectangle.
    rcs : Its cross-section.

    Examples
    --------
    >>> disc = rc.shapes.disc(0.1)
    >>> print(f"{disc.area:.6f} m^2 of {np.pi * 0.1**2:.6f} m^2")
    0.031416 m^2 of 0.031416 m^2
    """
    radius, segments = check.positive("radius", radius, "m"), _segments(radius, segments, sagitta)
    angle = 2.0 * pi / segments
    corner_radius = radius * sqrt(angle / sin(angle))
    rim = np.column_stack([np.zeros(segments), corner_radius * _circle(segments)])
    return Mesh(np.vstack([rim, np.zeros(3)]), _fan(segments, np.arange(segments)[::-1]))


def box(size: ArrayLike) -> Mesh:
    """Box with its faces across the axes.

    Parameters
    ----------
    size : float or (3,) array_like
        Edge of a cube, or edges along x, y and z [m].

    Returns
    -------
    Mesh
        Twelve triangles, normals outwards.

    See Also
    --------
    shapes.plate : One face of it.
    load_mesh : Mesh of a file.

    Examples
    --------
    >>> rc.shapes.box((0.6, 0.4, 0.2)).bounds
    array([[-0.3, -0.2, -0.1],
           [ 0.3,  0.2,  0.1]])
    """
    if np.asarray(size, dtype=object).ndim == 0:  # as objects: a ragged list is for `check` to name
        edges = np.full(3, check.positive("size", size, "m"))
    else:
        edges = check.array("size", size, (3,))
        for axis, edge in zip("xyz", edges, strict=True):
            check.positive(f"size along {axis}", float(edge), "m")
    # Corner number 4 ix + 2 iy + iz; the four corners of every face, counter-clockwise from outside.
    corners = edges * (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5)
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Mesh(corners, np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]))


def sphere(radius: float, *, subdivisions: int | None = None, sagitta: float = 5e-5) -> Mesh:
    """Sphere: an icosahedron whose triangles are split in four, level by level.

    Parameters
    ----------
    radius : float
        Radius [m].
    subdivisions : int, optional
        Levels, 0 to 7 (``20 * 4**subdivisions`` triangles); default: the smallest number from 2 on that
        keeps to `sagitta`.
    sagitta : float
        Largest distance of a facet from the sphere [m].

    Returns
    -------
    Mesh
        Closed, normals outwards, vertices on the sphere. Cross-section about ``pi radius^2``.

    Raises
    ------
    ValueError
        Also when `sagitta` would take more than 7 subdivisions (5e-5 m: above a radius of about 2.8 m).

    See Also
    --------
    shapes.capsule : A cylinder that ends in half-spheres.
    PointTarget : A point of a given cross-section.

    Examples
    --------
    >>> sphere = rc.shapes.sphere(0.1)
    >>> sigma = rc.rcs(sphere, 60e9, azimuth_deg=180.0)
    >>> print(f"{sigma[0]:.3f} m^2 of {np.pi * 0.1**2:.3f} m^2")
    0.031 m^2 of 0.031 m^2
    """
    radius, sagitta = check.positive("radius", radius, "m"), check.positive("sagitta", sagitta, "m")
    level = 2 if subdivisions is None else check.count("subdivisions", subdivisions, 0, _MAX_SUBDIVISIONS)
    if subdivisions is None:
        # The edges halve and the sagitta quarters with every level, so the loop ends soon.
        while (depth := radius * _largest_depth(level)) > sagitta:
            if level == _MAX_SUBDIVISIONS:
                raise ValueError(
                    f"sagitta: expected at least {depth:.2g} m ({level} subdivisions of a sphere of {radius:g} m), "
                    f"got {sagitta:g}; give a larger one, or the number of subdivisions"
                )
            level += 1
    vertices, triangles = _unit_sphere(level)
    return Mesh(radius * vertices, triangles)


def cylinder(
    radius: float, length: float, *, segments: int | None = None, sagitta: float = 5e-5, caps: bool = True
) -> Mesh:
    """Circular cylinder with its axis along z.

    Parameters
    ----------
    radius, length : float
        Radius, and length along z [m].
    segments : int, optional
        Facets round the axis, at least 3; default: from `sagitta`. Fewer than 9 make a prism with
        flat sides: they meet at more than the crease angle.
    sagitta : float
        Largest distance of a facet from the cylinder [m].
    caps : bool
        Close the ends; False leaves an open tube.

    Returns
    -------
    Mesh
        Normals outwards, vertices on the cylinder, facets as long as the cylinder. Broadside cross-section
        ``2 pi radius length^2 / wavelength``.

    See Also
    --------
    shapes.capsule : With round ends.
    rcs : Its cross-section.

    Examples
    --------
    >>> cylinder = rc.shapes.cylinder(0.05, 0.3)
    >>> print(f"{1e3 * cylinder.volume:.3f} l of {1e3 * np.pi * 0.05**2 * 0.3:.3f} l")
    2.353 l of 2.356 l
    """
    radius, segments = check.positive("radius", radius, "m"), _segments(radius, segments, sagitta)
    half = 0.5 * check.positive("length", length, "m")
    bottom, top = _ring(radius, -half, segments), _ring(radius, half, segments)
    ring = np.arange(segments)
    vertices, triangles = [bottom, top], [_side(ring, ring + segments)]
    if caps:
        vertices += [np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])]
        triangles += [_fan(2 * segments, ring[::-1]), _fan(2 * segments + 1, ring + segments)]
    return Mesh(np.vstack(vertices), np.vstack(triangles))


def capsule(radius: float, length: float, *, segments: int | None = None, sagitta: float = 5e-5) -> Mesh:
    """Cylinder along z that ends in two half-spheres.

    Parameters
    ----------
    radius : float
        Radius of cylinder and half-spheres [m].
    length : float
        Total length along z [m], half-spheres included: at least ``2 * radius`` (a sphere).
    segments : int, optional
        Facets round the axis, a multiple of 4; default: from `sagitta`.
    sagitta : float
        Largest distance of a facet from the capsule [m].

    Returns
    -------
    Mesh
        Closed, normals outwards, vertices on the capsule.

    See Also
    --------
    shapes.cylinder : With flat ends.
    shapes.sphere : Without a straight part.

    Examples
    --------
    >>> capsule = rc.shapes.capsule(0.1, 0.5)
    >>> print(capsule.bounds.round(3).tolist())
    [[-0.1, -0.1, -0.25], [0.1, 0.1, 0.25]]
    """
    radius, length = check.positive("radius", radius, "m"), check.positive("length", length, "m")
    straight = length - 2.0 * radius
    if straight < -1e-12 * length:
        raise ValueError(f"length: expected at least the two half-spheres, {2.0 * radius:g} m, got {length:g}")
    # The largest facets, near the poles, are right triangles one ring high and pi/2 rings wide.
    segments = _segments(radius, segments, sagitta, chords=hypot(1.0, pi / 2.0))
    if segments % 4:
        raise ValueError(f"segments: expected a multiple of 4, got {segments}")

    # Two half-spheres; the lower one is mirrored with opposite winding.
    upper, triangles = _half_sphere(radius, segments // 4)
    lower, lower_triangles = upper * [1.0, 1.0, -1.0], triangles[:, ::-1]
    equator = np.arange(len(upper) - segments, len(upper))
    if straight > 1e-12 * length:
        offset = 0.5 * straight * np.array([0.0, 0.0, 1.0])
        side = _side(equator + len(upper), equator)
        return Mesh(
            np.vstack([upper + offset, lower - offset]),
            np.vstack([triangles, lower_triangles + len(upper), side]),
        )
    # Without a straight part they share the equator: the last vertices of both.
    number = np.concatenate([np.arange(len(upper) - segments) + len(upper), equator])
    return Mesh(np.vstack([upper, lower[:-segments]]), np.vstack([triangles, number[lower_triangles]]))


def dihedral(width: float, height: float | None = None) -> Mesh:
    """Dihedral corner reflector: two plates at a right angle, open towards -x.

    Parameters
    ----------
    width : float
        Edge of each plate across the fold [m].
    height : float, optional
        Length of the fold line, which lies on the z axis [m]; default: `width`.

    Returns
    -------
    Mesh
        Normals towards the inside. Cross-section ``8 pi (width height / wavelength)^2`` on boresight, with two bounces,
        at the range of the origin.

    Notes
    -----
    `Pose.look_at` turns +x, the back of the reflector, to its target: see `trihedral` for the additional turn.

    See Also
    --------
    shapes.trihedral : Returns the wave from directions above and below, too.
    rcs : Its cross-section.

    Examples
    --------
    >>> sigma = rc.rcs(rc.shapes.dihedral(0.1), 60e9, azimuth_deg=180.0, max_bounces=2)
    >>> print(f"{10 * np.log10(sigma[0]):.0f} dBsm")
    20 dBsm
    """
    width = check.positive("width", width, "m")
    z = 0.5 * (width if height is None else check.positive("height", height, "m"))
    edge = sqrt(0.5) * width
    mesh = Mesh(
        [[0, 0, -z], [0, 0, z], [-edge, edge, -z], [-edge, edge, z], [-edge, -edge, -z], [-edge, -edge, z]],
        [[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]],
    )
    return as_reflector(mesh)


def trihedral(leg: float, *, shape: str = "triangular") -> Mesh:
    """Trihedral corner reflector: three perpendicular plates, open towards -x.

    Parameters
    ----------
    leg : float
        Length of the three edges that meet at the apex [m].
    shape : {"triangular", "square"}
        Shape of the plates.

    Returns
    -------
    Mesh
        Apex at the origin, boresight -x, one edge in the x-z plane pointing up; normals towards the inside.
        Cross-section on boresight, with three bounces: ``4 pi leg^4 / (3 wavelength^2)`` (triangular) or
        ``12 pi leg^4 / wavelength^2`` (square); at the range of the apex.

    Notes
    -----
    `Pose.look_at` turns +x, the back of the reflector, to its target. Another half turn about z opens it towards the
    target. A simulator warns of a reflector that shows its back.

    See Also
    --------
    shapes.dihedral : Two plates.
    rcs : Its cross-section.

    Examples
    --------
    >>> sigma = rc.rcs(rc.shapes.trihedral(0.1), 60e9, azimuth_deg=180.0, max_bounces=3)
    >>> print(f"{10 * np.log10(sigma[0]):.0f} dBsm")
    12 dBsm
    >>> towards = rc.Pose.look_at([2.0, 1.0, 0.5], target=[0.0, 0.0, 0.0]) @ rc.Pose.from_rpy([0, 0, 0], [0, 0, np.pi])
    >>> corner = rc.Body(rc.shapes.trihedral(0.1), motion=towards)
    >>> frame = rc.Simulator(rc.Scene([corner]), rc.bgt60tr13c(num_chirps=16), max_bounces=3).frame()
    >>> print(f"{rc.strongest_peak(frame).range:.2f} m")  # the apex
    2.29 m
    """
    leg = check.positive("leg", leg, "m")
    shape = check.choice("shape", shape, ("triangular", "square"))
    # Perpendicular unit vectors, right-handed, each at the same angle to -x; each is a normal of the other two's plate.
    x, z = -1.0 / sqrt(3.0), 1.0 / sqrt(6.0)
    edges = leg * np.array([[x, 0.0, 2.0 * z], [x, sqrt(0.5), -z], [x, -sqrt(0.5), -z]])
    apex, tips = np.zeros((1, 3)), np.array([1, 2, 3])
    following = np.roll(tips, -1)
    if shape == "triangular":
        return as_reflector(Mesh(np.vstack([apex, edges]), np.column_stack([0 * tips, tips, following])))
    corners = tips + 3
    triangles = np.vstack([np.column_stack([0 * tips, tips, corners]), np.column_stack([0 * tips, corners, following])])
    return as_reflector(Mesh(np.vstack([apex, edges, edges + np.roll(edges, -1, axis=0)]), triangles))


def _segments(radius: float, segments: int | None, sagitta: float, chords: float = 1.0) -> int:
    """Facets round a circle, given or such that no facet is deeper than `sagitta` below the surface.

    A facet is as deep as a chord of `chords` segments. The default is a multiple of 4 (the extent along both
    axes is the diameter) and at least 12 (neighbours meet well below the crease angle).
    """
    sagitta = check.positive("sagitta", sagitta, "m")
    if segments is not None:
        return check.count("segments", segments, 3)
    # Depth r (1 - cos(chord angle / 2)); the sine of the half-angle keeps its digits where the cosine is 1.
    half_angle = 2.0 * asin(sqrt(min(sagitta / (2.0 * radius), 0.5)))
    needed = chords * pi / half_angle if half_angle > 0.0 else np.inf
    if needed > _MAX_SEGMENTS:
        raise ValueError(
            f"sagitta: {sagitta:g} m on a radius of {radius:g} m takes {needed:.3g} segments, "
            f"expected at most {_MAX_SEGMENTS}; give a larger one, or the number of segments"
        )
    return max(12, 4 * ceil(needed / 4.0))


def _circle(segments: int) -> _Floats:
    """Points of the unit circle at equal angles, (segments, 2)."""
    angle = np.arange(segments) * (2.0 * pi / segments)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _ring(radius: float, z: float, segments: int) -> _Floats:
    """Points of a circle about the z axis, counter-clockwise from above, (segments, 3)."""
    return np.column_stack([radius * _circle(segments), np.full(segments, z)])


def _fan(center: int, rim: _Ints) -> _Ints:
    """Triangles from a centre to a closed rim, (len(rim), 3)."""
    return np.column_stack([np.full(len(rim), center), rim, np.roll(rim, -1)])


def _side(lower: _Ints, upper: _Ints) -> _Ints:
    """Triangles of the strip between two rings, normals away from the axis, (2 len(lower), 3)."""
    a, b, c, d = lower, np.roll(lower, -1), np.roll(upper, -1), upper
    return np.column_stack([a, b, c, a, c, d]).reshape(-1, 3)


def _half_sphere(radius: float, num_rings: int) -> tuple[_Floats, _Ints]:
    """Upper half of a sphere: the pole, then rings of 4, 8, ... 4 num_rings points down to the equator.

    Facets are of similar size everywhere, and the equator comes last: exactly at z = 0.
    """
    elevation = np.arange(num_rings)[::-1] * (0.5 * pi / num_rings)
    rings = [_ring(radius * np.cos(e), radius * np.sin(e), 4 * (j + 1)) for j, e in enumerate(elevation)]
    triangles = []
    for j in range(num_rings):
        # Ring j has 4 j points from number 1 + 2 j (j - 1) on; ring 0 is the pole.
        sector = np.arange(4)[:, None]
        inner_start, outer_start = (1 + 2 * j * (j - 1) if j else 0), 1 + 2 * j * (j + 1)
        k = np.arange(j + 1)
        inner = inner_start + (sector * j + k) % max(4 * j, 1)
        outer = outer_start + sector * (j + 1) + k
        outer_next = outer_start + (sector * (j + 1) + k + 1) % (4 * (j + 1))
        triangles.append(np.stack([inner, outer, outer_next], axis=-1).reshape(-1, 3))
        triangles.append(np.stack([inner[:, :-1], outer_next[:, :-1], inner[:, 1:]], axis=-1).reshape(-1, 3))
    return np.vstack([[[0.0, 0.0, radius]], *rings]), np.vstack(triangles)


def _icosahedron() -> tuple[_Floats, _Ints]:
    """Regular icosahedron on the unit sphere, normals outwards: poles on z, two rings of five between them."""
    z, ring = 1.0 / sqrt(5.0), 2.0 / sqrt(5.0)
    longitude = np.arange(10) * (0.2 * pi)
    belt = np.column_stack([ring * np.cos(longitude), ring * np.sin(longitude), np.where(np.arange(10) % 2, -z, z)])
    upper, lower = np.arange(0, 10, 2), np.arange(1, 10, 2)
    triangles = np.vstack(
        [
            _fan(10, upper),
            _fan(11, lower[::-1]),
            np.column_stack([upper, lower, np.roll(upper, -1)]),
            np.column_stack([lower, np.roll(lower, -1), np.roll(upper, -1)]),
        ]
    )
    return np.vstack([belt, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]]), triangles


@cache
def _unit_sphere(level: int) -> tuple[_Floats, _Ints]:
    """Icosahedron whose triangles are split in four `level` times; spheres of all radii share it."""
    vertices, triangles = _icosahedron() if level == 0 else _subdivide(*_unit_sphere(level - 1))
    vertices.flags.writeable = triangles.flags.writeable = False
    return vertices, triangles


def _subdivide(vertices: _Floats, triangles: _Ints) -> tuple[_Floats, _Ints]:
    """Split every triangle in four at the middles of its edges, which move out to the unit sphere."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    # One number per edge: np.unique on pairs is many times slower.
    key, middle = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True)
    points = vertices[key // len(vertices)] + vertices[key % len(vertices)]
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    a, b, c = triangles.T
    ab, bc, ca = (len(vertices) + middle.reshape(-1, 3)).T
    split = np.column_stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]).reshape(-1, 3)
    return np.vstack([vertices, points]), split


@cache
def _largest_depth(level: int) -> float:
    """Largest depth of a facet's plane below the unit sphere."""
    vertices, triangles = _unit_sphere(level)
    a, b, c = (vertices[corner] for corner in triangles.T)
    normal = np.cross(b - a, c - a)
    return float(1.0 - (np.sum(normal * a, axis=1) / np.linalg.norm(normal, axis=1)).min())
