"""Meshes of bodies with a known exact surface, at three resolutions, against that surface: capsule, tube, person."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

import radarcore as rc
from proof.dense import Dense
from proof.exact import PERSON, Line, Profile, capsule, ellipsoid_nodes, exact_echo, revolution_nodes, tube
from proof.measure import Phasors, Run
from proof.real_meshes import DEFAULT, RADAR, WAVEFORM, ProfileErrors, View, Way, integrated, profile_errors, sampled

FINE = Way("adaptive", "floor", 1e-4)
"""Sampling whose own errors are small."""

SAGITTAS = (5e-4, 5e-5, 5e-6)
"""Largest distances of facets of capsules and tubes from the surface [m]."""

SUBDIVISIONS = (3, 4, 5)
"""Of the spheres that become the person's ellipsoids."""


@dataclass(frozen=True)
class Target:
    """A body before the radar: its meshes, one per resolution, and the nodes of its exact surface."""

    name: str
    pose: rc.Pose
    meshes: Callable[[int], list[rc.Mesh]]
    """By resolution, from the coarsest."""
    profile: Profile | None
    """Outline of a body of revolution; None for the person."""
    num_nodes: int

    def echo(self, share: float = 1.0) -> Phasors:
        """H of the exact surface, from `num_nodes` nodes or a share of them."""
        number, position, rotation = round(share * self.num_nodes), self.pose.position, self.pose.rotation
        if self.profile is None:
            nodes = ellipsoid_nodes(list(PERSON.values()), position, rotation, number)
        else:
            nodes = [revolution_nodes(self.profile, position, rotation, number)]
        return exact_echo(nodes, WAVEFORM)

    def scene(self, fineness: int) -> rc.Scene:
        """The body as meshes."""
        conductor = rc.materials["perfect_conductor"]
        return rc.Scene([rc.Body(mesh, material=conductor, motion=self.pose) for mesh in self.meshes(fineness)])


def targets(run: Run) -> Iterator[Target]:
    """The bodies, each from some sides."""
    for tilt_deg in (0.0, 20.0, 70.0)[: run.aspects]:
        pose = rc.Pose.from_rpy([1.2, 0.1, -0.05], [0.0, np.deg2rad(tilt_deg), 0.0])
        yield Target(f"capsule, tilted {tilt_deg:g}°", pose, capsule_meshes, capsule(0.06, 0.4), run.nodes)
        yield Target(
            f"tube with rounded rims, tilted {tilt_deg:g}°", pose, tube_meshes, tube(0.06, 0.4, 0.01), run.nodes
        )
    for heading_deg in (0.0, 40.0, 90.0)[: run.aspects]:
        pose = rc.Pose.from_rpy([2.5, 0.0, -0.9], [0.0, 0.0, np.pi + np.deg2rad(heading_deg)])
        yield Target(f"person of ellipsoids, {heading_deg:g}°", pose, person_meshes, None, run.nodes)


def turned_mesh(profile: Profile, sagitta: float) -> rc.Mesh:
    """Mesh of a body of revolution about z, whose facets are at most `sagitta` from its surface [m]."""
    outline: list[tuple[float, float]] = []
    for part in profile:
        if isinstance(part, Line):
            points = np.array([part.start, part.end])
        else:
            steps = int(np.ceil(0.5 * (part.end - part.start) / np.arccos(1.0 - sagitta / part.radius)))
            angle = np.linspace(part.start, part.end, max(steps, 2) + 1)
            points = part.center + part.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        outline += [tuple(point) for point in points if not outline or np.hypot(*(point - outline[-1])) > 1e-9]
    radius, height = np.array(outline).T
    around = 4 * int(np.ceil(0.25 * np.pi / np.arccos(1.0 - sagitta / radius.max())))
    angle = 2.0 * np.pi / around * np.arange(around)
    # Rings between the two poles.
    rings = np.stack(
        [
            np.outer(radius[1:-1], np.cos(angle)),
            np.outer(radius[1:-1], np.sin(angle)),
            np.outer(height[1:-1], angle**0),
        ],
        axis=-1,
    )
    vertices = np.vstack([[0.0, 0.0, height[0]], rings.reshape(-1, 3), [0.0, 0.0, height[-1]]])
    ring, last = np.arange(around), len(vertices) - 1
    following = np.roll(ring, -1)
    triangles = [np.stack([0 * ring, 1 + following, 1 + ring], axis=1)]
    for first in range(1, last - around, around):
        a, b, c, d = first + ring, first + following, first + around + following, first + around + ring
        triangles += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    triangles.append(np.stack([last - around + ring, last - around + following, last + 0 * ring], axis=1))
    return rc.Mesh(vertices, np.concatenate(triangles))


@cache
def capsule_meshes(fineness: int) -> list[rc.Mesh]:
    """The shape of radarcore."""
    return [rc.shapes.capsule(0.06, 0.4, sagitta=SAGITTAS[fineness])]


@cache
def tube_meshes(fineness: int) -> list[rc.Mesh]:
    """The outline, turned."""
    return [turned_mesh(tube(0.06, 0.4, 0.01), SAGITTAS[fineness])]


@cache
def person_meshes(fineness: int) -> list[rc.Mesh]:
    """Spheres, stretched and moved."""
    sphere = rc.shapes.sphere(1.0, subdivisions=SUBDIVISIONS[fineness])
    return [
        rc.Mesh(sphere.vertices * ellipsoid.semi_axes + ellipsoid.center, sphere.triangles)
        for ellipsoid in PERSON.values()
    ]


@dataclass(frozen=True)
class SurfaceResult:
    """A mesh by one way, against the exact surface."""

    target: str
    num_triangles: int
    way: str
    """Name of the sampling, or the dense integration."""
    errors: ProfileErrors
    own_error: float
    """Relative difference of the reference from one of two thirds of its nodes."""


def surface_results(run: Run) -> Iterator[SurfaceResult]:
    for target in targets(run):
        expected = target.echo()
        own_error = profile_errors(target.echo(2.0 / 3.0), expected, *SPAN).relative
        for fineness in range(run.finenesses):
            scene = target.scene(fineness)
            number = sum(len(mesh.triangles) for mesh in target.meshes(fineness))
            view, reference = View("", "", scene, RADAR, rc.Pose()), Dense((expected, expected), 0, *SPAN)
            for way in (DEFAULT, FINE):
                got = sampled(view, way, reference)
                yield SurfaceResult(target.name, number, way.title, got.errors, own_error)
            summed = integrated(view, run.pitch, run.shifts)
            errors = profile_errors(summed.transfer_function, expected, *SPAN)
            yield SurfaceResult(target.name, number, "dense integration", errors, own_error)


SPAN = (0.5, 3.5)
"""Ranges in which floors are measured [m]."""


def surface_rows(results: list[SurfaceResult]) -> Iterator[list[str]]:
    for row in results:
        yield [
            row.target,
            str(row.num_triangles),
            row.way,
            f"{row.errors.strongest:+.2f}",
            f"{row.errors.peaks:.2f}",
            f"{100.0 * row.errors.relative:.1f}",
            f"{100.0 * row.own_error:.2g}",
        ]
