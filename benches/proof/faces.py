"""Physical optics of plates and boxes: Gauss-Legendre quadrature over the faces that the sensor sees."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import radarcore as rc
from proof.measure import Phasors, Reals

ORIGIN = np.zeros((1, 3))

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
WAVELENGTHS = 2.5
"""Length of an interval of 16 nodes: the phase turns five times there, which they integrate to 1e-7."""


def quadrature(edges: list[Reals], k: Reals) -> tuple[Reals, Reals]:
    """Places from 0 to 1 and their weights, along edges on either side of a face."""
    number = 1 + int(np.linalg.norm(edges, axis=1).max() * k.max() / (2.0 * np.pi * WAVELENGTHS))
    places = (np.arange(number)[:, None] + 0.5 * (1.0 + NODES)) / number
    return places.ravel(), np.tile(0.5 * WEIGHTS / number, number)


Reflection = Callable[[Reals], Any]
"""Reflection coefficient at cosines of incidence."""


def conductor(cosine: Reals) -> Reals:
    return -np.ones_like(cosine)


def polygon_field(
    corners: Reals, k: Reals, tx: Reals = ORIGIN, rx: Reals = ORIGIN, reflection: Reflection = conductor
) -> Phasors:
    """H of a flat convex surface that nothing hides, (channel, wavenumber), from quadrilaterals."""
    total = np.zeros((len(tx) * len(rx), len(k)), dtype=complex)
    for first in range(1, len(corners) - 1, 2):
        a, b, c, d = corners[[0, first, first + 1, min(first + 2, len(corners) - 1)]]
        s, weights_s = quadrature([b - a, c - d], k)
        t, weights_t = quadrature([d - a, c - b], k)
        s, t = s[:, None, None], t[:, None]
        points = (1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * d + s * c)
        by_s, by_t = (1.0 - t) * (b - a) + t * (c - d), (1.0 - s) * (d - a) + s * (c - b)
        areas = np.linalg.norm(np.cross(by_s, by_t), axis=-1) * np.outer(weights_s, weights_t)
        normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
        to_tx, to_rx = (
            [(np.linalg.norm(points - antenna, axis=-1), abs(normal @ (a - antenna))) for antenna in antennas]
            for antennas in (tx, rx)
        )
        for channel, ((r_t, height_t), (r_r, height_r)) in enumerate(product(to_tx, to_rx)):
            cosine = 0.5 * (height_t / r_t + height_r / r_r)
            amplitudes = 1j / (4.0 * np.pi) * reflection(cosine) * cosine / (r_t * r_r) * areas
            total[channel] += [(amplitudes * np.exp(-1j * each * (r_t + r_r))).sum() for each in k]
    return total


@dataclass(frozen=True)
class Cuboid:
    """A box, or a plate where the edge along x is zero."""

    edges: Reals
    pose: rc.Pose

    def body(self, material: rc.Material = rc.materials["perfect_conductor"]) -> rc.Body:
        """Its mesh where it stands."""
        mesh = rc.shapes.box(self.edges) if self.edges[0] else rc.shapes.plate(*self.edges[1:])
        return rc.Body(mesh, material=material, motion=self.pose)

    def faces(self) -> Iterator[Reals]:
        """Corners of the faces that the sensor sees."""
        for axis, side in product(range(3), (-1.0, 1.0)):
            corners = np.insert([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], axis, side, axis=1)
            corners = self.pose.apply(0.5 * self.edges * corners)
            if np.delete(self.edges, axis).all() and side * self.pose.rotation[:, axis] @ corners[0] < 0.0:
                yield corners

    def field(self, k: Reals, **options: Any) -> Phasors:
        """H, (channel, wavenumber); options as in `polygon_field`."""
        total: Phasors = np.sum([polygon_field(face, k, **options) for face in self.faces()], axis=0)
        return total


def placed(rng: np.random.Generator, tilt_deg: float | None, *, is_box: bool) -> Cuboid:
    """Edges of 1 to 30 cm, 0.3 to 3 m away within 30 degrees of the boresight; a box leaves room before the sensor."""
    while True:
        edges, distance = rng.uniform(0.01, 0.3, 3), rng.uniform(0.3, 3.0)
        tilt = rng.uniform(0.0, 70.0) if tilt_deg is None else tilt_deg
        sight = Rotation.from_euler("zy", rng.uniform(-30.0, 30.0, 2), degrees=True)
        turn = Rotation.from_euler("xyx", [rng.uniform(0.0, 360.0), tilt, rng.uniform(0.0, 360.0)], degrees=True)
        edges[0] *= is_box
        if np.linalg.norm(edges) < 1.2 * distance:
            return Cuboid(edges, rc.Pose(sight.apply([distance, 0.0, 0.0]), (sight * turn).as_matrix()))


def section(field: Phasors, distance: float | Reals, k: Reals) -> Reals:
    """Mean cross-section over the wavenumbers [m²]."""
    mean: Reals = 16.0 * np.pi * distance**4 * np.mean(np.abs(k * field) ** 2, axis=-1)
    return mean
