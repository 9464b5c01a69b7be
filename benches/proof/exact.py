"""Echoes of exact surfaces, by physical optics: capsules, tubes with rounded rims, a person of ellipsoids.

H = -(j / 4 pi) times the integral of exp(-2jkR) over the solid angle of what the radar sees, with nodes on the surfaces
themselves: no mesh, no ray, nothing of radarcore but the numbers of its waveform.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

import radarcore as rc
from proof.measure import Phasors, Reals
from proof.range_spectrum import CELLS, add, spectrum

Nodes = tuple[Reals, Reals]
"""Distances [m] and solid angles of the nodes of a quadrature."""


def exact_echo(nodes: Iterable[Nodes], waveform: rc.Waveform) -> Phasors:
    """H at the frequencies of a sweep, from the nodes of all surfaces; Gamma is -1."""
    histogram = np.zeros(CELLS)
    for distance, solid_angle in nodes:
        add(histogram, waveform, distance, -solid_angle)
    return spectrum(histogram, waveform)


def gauss(number: int, start: Reals | float = 0.0, end: Reals | float = 1.0) -> tuple[Reals, Reals]:
    """Nodes and weights by Gauss and Legendre, with an axis for these at the end."""
    nodes, weights = legendre(number)
    half = 0.5 * (np.asarray(end) - start)[..., None]
    return np.asarray(start)[..., None] + half * (1.0 + nodes), half * weights


@cache
def legendre(number: int) -> tuple[Reals, Reals]:
    """Nodes and weights from -1 to 1."""
    return np.polynomial.legendre.leggauss(number)


# Bodies of revolution about z: convex, so that nothing shadows anything.


@dataclass(frozen=True)
class Line:
    """Straight part of a profile, from one (radius, z) to another [m]; the outside is on its right."""

    start: tuple[float, float]
    end: tuple[float, float]

    def at(self, number: int) -> Reals:
        """Radius, z, components of the normal along both, and length of the nodes, (5, number)."""
        share, weight = gauss(number)
        (r0, z0), (r1, z1) = self.start, self.end
        length = np.hypot(r1 - r0, z1 - z0)
        normal = [np.full(number, (z1 - z0) / length), np.full(number, (r0 - r1) / length)]
        return np.array([r0 + share * (r1 - r0), z0 + share * (z1 - z0), *normal, length * weight])


@dataclass(frozen=True)
class Arc:
    """Round part of a profile, bulging outwards: centre (radius, z), radius [m], angles from the plane z = 0 [rad]."""

    center: tuple[float, float]
    radius: float
    start: float
    end: float

    def at(self, number: int) -> Reals:
        """As of `Line`."""
        angle, weight = gauss(number, self.start, self.end)
        normal = np.cos(angle), np.sin(angle)
        (r, z), a = self.center, self.radius
        return np.array([r + a * normal[0], z + a * normal[1], *normal, a * weight])


Profile = Sequence[Line | Arc]
"""Parts of the outline of a body of revolution, from its lowest point up."""


def capsule(radius: float, length: float) -> Profile:
    """Cylinder that ends in half-spheres, as `shapes.capsule` [m]."""
    z, quarter = 0.5 * length - radius, 0.5 * np.pi
    return (
        Arc((0.0, -z), radius, -quarter, 0.0),
        Line((radius, -z), (radius, z)),
        Arc((0.0, z), radius, 0.0, quarter),
    )


def tube(radius: float, length: float, rim: float) -> Profile:
    """Closed tube whose rims are rounded with a radius `rim` [m]."""
    r, z, quarter = radius - rim, 0.5 * length, 0.5 * np.pi
    return (
        Line((0.0, -z), (r, -z)),
        Arc((r, rim - z), rim, -quarter, 0.0),
        Line((radius, rim - z), (radius, z - rim)),
        Arc((r, z - rim), rim, 0.0, quarter),
        Line((r, z), (0.0, z)),
    )


def revolution_nodes(profile: Profile, position: Reals, rotation: Reals, number: int) -> Nodes:
    """Nodes of what a radar at the origin sees of a body of revolution.

    Parameters
    ----------
    profile : sequence of Line and Arc
    position : (3,)
        Of the body's origin [m].
    rotation : (3, 3)
        From the body's axes to the radar's.
    number : int
        Nodes along every part of the profile, and half around it.
    """
    x, y, height = -position @ rotation
    across = np.hypot(x, y)
    radius, z, out, up, length = np.concatenate([part.at(number) for part in profile], axis=1)

    # Lit where the normal points to the radar: a cos(angle) > b, with the angle from the radar's side.
    a, b = out * across, out * radius - up * (height - z)
    lit = np.where(a > 0.0, np.arccos(np.clip(b / np.where(a > 0.0, a, 1.0), -1.0, 1.0)), np.pi * (b < 0.0))
    angle, weight = gauss(number, 0.0 * lit, lit)
    cosine = np.cos(angle)
    square = across**2 + radius[:, None] ** 2 - 2.0 * across * radius[:, None] * cosine + (height - z[:, None]) ** 2
    # Twice: both halves are alike.
    area = 2.0 * (radius * length)[:, None] * weight
    solid_angle = area * (a[:, None] * cosine - b[:, None]) / square**1.5
    return np.sqrt(square).ravel(), solid_angle.ravel()


# Ellipsoids, which may be in each other's way.


@dataclass(frozen=True)
class Ellipsoid:
    """Centre [m] and semi-axes [m] along the axes of a person."""

    center: tuple[float, float, float]
    semi_axes: tuple[float, float, float]

    def placed(self, position: Reals, rotation: Reals) -> tuple[Reals, Reals]:
        """Centre, and matrix of the semi-axes, of a person at a pose before the radar."""
        return position + rotation @ np.array(self.center), rotation * self.semi_axes


PERSON = {
    "head": Ellipsoid((0.0, 0.0, 1.62), (0.10, 0.08, 0.12)),
    "torso": Ellipsoid((0.0, 0.0, 1.15), (0.12, 0.20, 0.30)),
    "left arm": Ellipsoid((0.02, 0.27, 1.12), (0.05, 0.045, 0.32)),
    "right arm": Ellipsoid((0.02, -0.27, 1.12), (0.05, 0.045, 0.32)),
    "left leg": Ellipsoid((0.0, 0.10, 0.42), (0.08, 0.075, 0.42)),
    "right leg": Ellipsoid((0.0, -0.10, 0.42), (0.08, 0.075, 0.42)),
}
"""Separate ellipsoids; a person who faces +x and stands at z = 0."""


def ellipsoid_nodes(ellipsoids: Sequence[Ellipsoid], position: Reals, rotation: Reals, number: int) -> Iterable[Nodes]:
    """Nodes of what a radar at the origin sees of ellipsoids: `number` from pole to limb of each, twice that around.

    On the unit sphere u of an ellipsoid c + A u the radar is at q = -A^-1 c, the lit part is a cap about q, and the
    solid angle is det(A) (q.u - 1) du / R^3.
    """
    placed = [ellipsoid.placed(position, rotation) for ellipsoid in ellipsoids]
    for index, (center, matrix) in enumerate(placed):
        radar = np.linalg.solve(matrix, -center)
        far = np.linalg.norm(radar)
        cosine, weight = gauss(number, 1.0 / far, 1.0)
        turn = np.pi / number * np.arange(2 * number)
        pole = radar / far
        side = np.cross(pole, np.eye(3)[np.abs(pole).argmin()])
        side /= np.linalg.norm(side)
        around = np.outer(np.cos(turn), side) + np.outer(np.sin(turn), np.cross(pole, side))
        on_sphere = cosine[:, None, None] * pole + np.sqrt(1.0 - cosine**2)[:, None, None] * around
        points = (center + on_sphere @ matrix.T).reshape(-1, 3)
        distance = np.linalg.norm(points, axis=1)
        area = np.linalg.det(matrix) * (far * cosine - 1.0) * weight * np.pi / number
        solid_angle = np.repeat(area, 2 * number) / distance**3
        others = [one for other, one in enumerate(placed) if other != index]
        yield distance, solid_angle * ~is_occluded(points, others)


def is_occluded(points: Reals, ellipsoids: Iterable[tuple[Reals, Reals]]) -> Reals:
    """True for points (n, 3) whose line to the origin meets an ellipsoid, given by centre and matrix."""
    occluded = np.zeros(len(points), dtype=bool)
    for center, matrix in ellipsoids:
        inverse = np.linalg.inv(matrix)
        start, along = -inverse @ center, points @ inverse.T
        a, half, c = (along**2).sum(axis=1), along @ start, start @ start - 1.0
        discriminant = half**2 - a * c
        first = (-half - np.sqrt(np.maximum(discriminant, 0.0))) / a
        occluded |= (discriminant > 0.0) & (first > 0.0) & (first < 1.0)
    return occluded
