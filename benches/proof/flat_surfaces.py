"""Errors of plates, boxes and spheres at random places."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

import radarcore as rc
from proof.closed_forms import sphere_echo
from proof.faces import Cuboid, placed, polygon_field, section
from proof.measure import (
    SPEED_OF_LIGHT,
    Phasors,
    Reals,
    Run,
    conductor,
    decibels,
    floor_text,
    frame,
    frequencies,
    sweep,
)

WAVEFORM = sweep(8)
WAVENUMBERS = 2.0 * np.pi * frequencies(WAVEFORM) / SPEED_OF_LIGHT


def half_hidden(rng: np.random.Generator) -> tuple[list[rc.Body], Phasors, float]:
    """A plate behind a parallel one whose shadow ends in its middle."""
    rear, nearer = placed(rng, None, is_box=False), rng.uniform(0.5, 0.9)
    aside = 0.5 * rear.edges[1] * rear.pose.rotation[:, 1]
    front = Cuboid(nearer * rear.edges, rc.Pose(nearer * (rear.pose.position + aside), rear.pose.rotation))
    seen = Cuboid(rear.edges * [1.0, 0.5, 1.0], rc.Pose(rear.pose.position - 0.5 * aside, rear.pose.rotation))
    field = front.field(WAVENUMBERS) + seen.field(WAVENUMBERS)
    return [front.body(), rear.body()], field[0], float(np.linalg.norm(rear.pose.position))


def on_a_table(rng: np.random.Generator) -> tuple[list[rc.Body], Phasors, float]:
    """A box of 5 to 15 cm on a table of 1.2 m, 0.8 m below the sensor, which shadows a polygon of the table."""
    edges, table_z = rng.uniform(0.05, 0.15, 3), -0.8
    place = [rng.uniform(0.8, 1.0), rng.uniform(-0.2, 0.2), table_z + 0.5 * edges[2]]
    box = Cuboid(edges, rc.Pose.from_rpy(place, [0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)]))
    table = Cuboid(np.array([0.0, 1.2, 1.2]), rc.Pose.from_rpy([1.0, 0.0, table_z], [0.0, 0.5 * np.pi, 0.0]))
    corners = box.pose.apply(0.5 * edges * np.array(list(product([-1.0, 1.0], repeat=3))))
    shadows = corners * (table_z / corners[:, 2:])
    shadow = shadows[ConvexHull(shadows[:, :2]).vertices]
    field = box.field(WAVENUMBERS) + table.field(WAVENUMBERS) - polygon_field(shadow, WAVENUMBERS)
    return [box.body(), table.body()], field[0], float(np.linalg.norm(place))


def single(rng: np.random.Generator, tilt_deg: float | None, *, is_box: bool) -> tuple[list[rc.Body], Phasors, float]:
    target = placed(rng, tilt_deg, is_box=is_box)
    return [target.body()], target.field(WAVENUMBERS)[0], float(np.linalg.norm(target.pose.position))


def sphere(rng: np.random.Generator) -> tuple[list[rc.Body], Phasors, float]:
    radius, distance = rng.uniform(0.01, 0.15), rng.uniform(0.3, 3.0)
    return [conductor(rc.shapes.sphere(radius), distance)], sphere_echo(radius, distance, WAVENUMBERS), distance


TARGETS: dict[str, Callable[[np.random.Generator], tuple[list[rc.Body], Phasors, float]]] = {
    "plate that faces the radar": partial(single, tilt_deg=0.0, is_box=False),
    **{f"plate, tilted {tilt:g} degrees": partial(single, tilt_deg=tilt, is_box=False) for tilt in (10.0, 30.0, 60.0)},
    "box": partial(single, tilt_deg=None, is_box=True),
    "sphere": sphere,
    "partly hidden plate": half_hidden,
    "partly hidden table with a box": on_a_table,
}
"""Bodies, their field and their distance [m] for a random placement."""

SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    floor_text(1e-4): {"rcs_floor": 1e-4, "ray_budget": math.inf},
}

STRONG = 1e-2
"""Least cross-section of echoes whose level and phase are compared [m²]."""


@dataclass(frozen=True)
class FlatResult:
    """All placements of a target with one setting."""

    name: str
    setting: str
    errors: Reals
    """Cross-sections of the difference from the reference, by placement [m²]."""
    echoes: Reals
    """Cross-sections of the reference [m²]."""
    levels: Reals
    """Largest error over the frequencies, of echoes above `STRONG` [dB]."""
    phases: Reals
    """[rad]."""
    rays: float
    paths: float
    seconds: float
    """CPU time of a second frame."""


def flat_results(run: Run, names: Iterable[str] = TARGETS) -> Iterator[FlatResult]:
    for name in list(names)[: run.flat_targets]:
        rng = np.random.default_rng(0)
        placements = [TARGETS[name](rng) for _ in range(run.placements)]
        fields, distances = np.array([field for _, field, _ in placements]), np.array([d for *_, d in placements])
        echoes = section(fields, distances, WAVENUMBERS)
        for setting, options in SETTINGS.items():
            got, costs = zip(*(seen(bodies, options) for bodies, *_ in placements), strict=True)
            ratio = (np.array(got) / fields)[echoes > STRONG]
            errors = section(np.array(got) - fields, distances, WAVENUMBERS)
            yield FlatResult(
                name,
                setting,
                errors,
                echoes,
                np.abs(decibels(ratio)).max(axis=1),
                np.abs(np.angle(ratio)).max(axis=1),
                *np.median(costs, axis=0),
            )


def seen(bodies: list[rc.Body], options: dict[str, Any]) -> tuple[Phasors, tuple[float, float, float]]:
    """H, and rays, paths and CPU time of a frame [s]."""
    sim = rc.Simulator(rc.Scene(bodies), rc.Radar(WAVEFORM), tolerance=1e-9, threads=1, **options)
    first, start = frame(sim), time.process_time()
    frame(sim)
    seconds = time.process_time() - start
    return np.conj(first.cube[0, 0]), (first.stats["rays_cast"], first.stats["paths"], seconds)


def flat_rows(results: list[FlatResult]) -> Iterator[list[str]]:
    for row in results:
        sections = (np.median(row.echoes), np.median(row.errors), row.errors.max())
        strong = [f"{x.max():.2g}" if len(x) else "" for x in (row.levels, row.phases)]
        costs = [f"{row.rays:.0f}", f"{row.paths:.0f}", f"{1e3 * row.seconds:.2g}"]
        yield [row.name, row.setting, *(f"{x:.1e}" for x in sections), *strong, *costs]
