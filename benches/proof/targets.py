"""Single targets whose echo is known on paper: specular, diffuse, and cross-sections far away."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

import radarcore as rc
from proof.closed_forms import (
    cylinder_echo,
    disc_echo,
    lambertian_disc_power,
    lambertian_patch_power,
    lambertian_sphere_power,
    mirror_level,
    point_echo,
    sphere_echo,
    square_echo,
)
from proof.measure import (
    RADAR,
    SPEED_OF_LIGHT,
    TURNS,
    WAVENUMBERS,
    Phasors,
    Run,
    best_time,
    conductor,
    errors,
    floor_text,
    frame,
    num_cells,
    simulator,
    turned,
)

# Small targets take views of about a degree.
warnings.filterwarnings("ignore", "field_of_view_deg: expected degrees")

FINE_RIM = 2e-6
"""Sagitta of discs [m]: the polygon is the disc to less than a thousandth of a wavelength."""


@dataclass(frozen=True)
class Case:
    """A target whose echo is known on paper: H at all frequencies, 1 W and unit gain."""

    name: str
    target: rc.Body | rc.PointTarget
    echo: Phasors
    field_of_view_deg: float = 60.0
    has_fine: bool = False  # also 1024 x 1024


@cache
def cases() -> list[Case]:
    """All of them; integrals along the rims of plates take a while."""
    return list(new_cases())


def new_cases() -> Iterator[Case]:
    for radius in (0.05, 0.02):
        mesh = rc.shapes.disc(radius, sagitta=FINE_RIM)
        name = f"disc, radius {100 * radius:g} cm, at 1 m"
        is_large = radius == 0.05
        yield Case(name, conductor(mesh, 1.0), disc_echo(radius, 1.0), has_fine=is_large)
    for edge in (0.1, 0.2):
        target = conductor(rc.shapes.plate(edge, edge), 1.0)
        name = f"square, {100 * edge:g} cm, at 1 m"
        yield Case(name, target, square_echo(edge, 1.0), has_fine=edge == 0.2)
    tilt = np.deg2rad(5.0)
    target = conductor(rc.shapes.plate(0.2, 0.2), 1.0, tilt)
    name = "square, 20 cm, at 1 m, tilted 5 degrees"
    yield Case(name, target, square_echo(0.2, 1.0, tilt), has_fine=True)
    for distance, field_of_view in ((10.0, 60.0), (10.0, 6.0), (100.0, 0.6)):
        target = conductor(rc.shapes.plate(0.1, 0.1), distance)
        name = f"square, 10 cm, at {distance:g} m, image of {field_of_view:g} degrees"
        yield Case(name, target, square_echo(0.1, distance), field_of_view)
    plane = conductor(rc.shapes.plate(6.0, 6.0), 1.0)
    yield Case("plane wider than the image, at 1 m", plane, -mirror_level(1.0) * np.exp(-2j * WAVENUMBERS))
    for radius in (0.2, 0.1, 0.05):
        target = conductor(rc.shapes.sphere(radius), 1.0)
        name = f"sphere, radius {100 * radius:g} cm, centre at 1 m"
        yield Case(name, target, sphere_echo(radius, 1.0), has_fine=radius == 0.1)
    target = conductor(rc.shapes.cylinder(0.05, 0.3), 1.0)
    name = "cylinder, radius 5 cm, length 30 cm, axis at 1 m"
    yield Case(name, target, cylinder_echo(0.05, 0.3, 1.0))
    yield Case("point, 1 m², at 2 m", rc.PointTarget([2.0, 0.0, 0.0], rcs=1.0), point_echo(1.0, 2.0))


@dataclass(frozen=True)
class Measured:
    """Errors of one way to sample a case."""

    case: Case
    sampling: str
    setting: str
    level: float
    """Rms over turns and frequencies [dB]."""
    worst: float
    """Error of the worst turn [dB]."""
    phase: float
    """[rad]."""
    largest_level: float
    """At the worst frequency of the worst turn [dB]."""
    largest_phase: float
    """At the worst frequency of the worst turn [rad]."""
    rays: int
    """Of the first turn."""
    paths: int
    seconds: float


def measured(
    case: Case, run: Run, sampling: str, setting: str, side: int, options: dict[str, Any], repeats: int
) -> Measured:
    """`side` is the image side; the radar turns by parts of its pixels."""
    field_of_view = (case.field_of_view_deg, case.field_of_view_deg)
    sims = [
        simulator(
            case.target,
            radar_motion=turned(turn, side, case.field_of_view_deg),
            field_of_view_deg=field_of_view,
            sampling=sampling,
            **options,
        )
        for turn in TURNS[: run.turns]
    ]
    frames = [frame(sim) for sim in sims]
    numbers = errors(np.conj([f.cube[0, 0] for f in frames]), case.echo)
    seconds = best_time(lambda: frame(sims[0].with_radar(RADAR)), repeats) if repeats else np.nan
    stats = frames[0].stats
    return Measured(case, sampling, setting, *numbers, stats["rays_cast"], stats["paths"], seconds)


def measured_by_default(case: Case, run: Run, repeats: int = 0) -> Measured:
    """Errors of `Simulator(scene, radar)`, but for the field of view."""
    return measured(case, run, "adaptive", "default", _side(case), {}, repeats)


def _side(case: Case) -> int:
    """Cells of adaptive sampling: turned by parts of one, a target in the narrowest image would leave it."""
    return max(num_cells(case.field_of_view_deg), 6)


def mirror_results(run: Run) -> Iterator[list[Measured]]:
    """Every target with every sampling and resolution or floor."""
    for case in cases():
        is_point = isinstance(case.target, rc.PointTarget)
        sides = [run.unit] if is_point else run.resolutions + run.finest * case.has_fine
        ways: list[tuple[str, str, int, dict[str, Any]]] = [
            (sampling, str(side), side, {"resolution": side})
            for sampling in (("footprint",) if is_point else ("footprint", "point"))
            for side in sides
        ]
        ways += [
            ("adaptive", floor_text(x), _side(case), {"rcs_floor": x, "ray_budget": math.inf})
            for x in run.floors
            if not is_point
        ]
        rows = [measured(case, run, *way, run.repeats) for way in ways]
        yield rows if is_point else [*rows, measured_by_default(case, run, run.repeats)]


def mirror_rows(results: list[list[Measured]], run: Run) -> Iterator[list[str]]:
    """Error and cost of every target, sampling and resolution or floor."""
    for rows in results:
        unit = next(row.seconds for row in rows if row.setting == str(run.unit))
        for row in rows:
            yield [*_texts(row), f"{row.seconds / unit:.2g}"]


def _texts(row: Measured) -> list[str]:
    numbers = (f"{x:.2g}" for x in (row.level, row.worst, row.phase))
    return [row.case.name, row.sampling, row.setting, *numbers, str(row.rays), str(row.paths)]


@dataclass(frozen=True)
class Matt:
    """A matt target whose mean power over all random phases is known on paper [W]."""

    name: str
    mesh: rc.Mesh
    distance: float
    power: float
    tilt: float = 0.0
    field_of_view_deg: float = 60.0


def matt_targets() -> Iterator[Matt]:
    for radius, distance in ((0.1, 1.0), (0.5, 1.0), (0.3, 2.0)):
        mesh = rc.shapes.disc(radius, sagitta=FINE_RIM)
        power = lambertian_disc_power(1.0, radius, distance)
        yield Matt(f"disc, radius {100 * radius:g} cm, at {distance:g} m", mesh, distance, power)
    power = lambertian_sphere_power(1.0, 0.3, 2.0)
    yield Matt("sphere, radius 30 cm, centre at 2 m", rc.shapes.sphere(0.3), 2.0, power)
    tilt = np.deg2rad(60.0)
    power = lambertian_patch_power(1.0, 0.1**2, tilt, 10.0)
    name = "square, 10 cm, at 10 m, tilted 60 degrees"
    yield Matt(name, rc.shapes.plate(0.1, 0.1), 10.0, power, tilt, field_of_view_deg=1.0)


@dataclass(frozen=True)
class MattPower:
    """Powers over that on paper."""

    target: Matt
    setting: str
    num_paths: int
    of_paths: float
    of_seeds: list[float]


def matt_results(run: Run) -> Iterator[MattPower]:
    """From the paths, whose phases are random, and from frames of many seeds."""
    for matt in matt_targets():
        pose = rc.Pose.from_rpy([matt.distance, 0.0, 0.0], [0.0, 0.0, matt.tilt])
        target = rc.Body(matt.mesh, material=rc.Material.lambertian(1.0), motion=pose)
        view = {"field_of_view_deg": (matt.field_of_view_deg, matt.field_of_view_deg)}
        ways: list[tuple[str, dict[str, Any]]] = [
            (str(side), {"sampling": "footprint", "resolution": side}) for side in run.resolutions
        ]
        ways += [
            (floor_text(x), {"sampling": "adaptive", "rcs_floor": x, "ray_budget": math.inf}) for x in run.floors[:2]
        ]
        for setting, options in ways:
            paths = simulator(target, **view, **options).paths()
            powers = [
                float(np.mean(np.abs(frame(simulator(target, seed=seed, **view, **options)).cube) ** 2)) / matt.power
                for seed in range(run.seeds)
            ]
            total = float((np.abs(paths.amplitude) ** 2).sum()) / matt.power
            yield MattPower(matt, setting, paths.delay.size, total, powers)


def matt_rows(results: list[MattPower]) -> Iterator[list[str]]:
    for row in results:
        powers = np.array(row.of_seeds)
        yield [
            row.target.name,
            row.setting,
            str(row.num_paths),
            f"{100.0 * (row.of_paths - 1.0):+.2f} %",
            f"{100.0 * (powers.mean() - 1.0):+.0f} ± {100.0 * powers.std(ddof=1) / np.sqrt(len(powers)):.0f} %",
        ]


def section_rows(run: Run) -> Iterator[list[str]]:
    """Far-field cross-sections by one reflection and several."""
    frequency, edge = 60e9, run.section_edge
    wavelength = SPEED_OF_LIGHT / frequency
    reflectors: list[tuple[str, rc.Mesh, int, float]] = [
        ("plate", rc.shapes.plate(edge, edge), 1, 4.0 * np.pi * edge**4 / wavelength**2),
        ("sphere", rc.shapes.sphere(edge), 1, np.pi * edge**2),
        ("cylinder", rc.shapes.cylinder(0.5 * edge, edge), 1, np.pi * edge**3 / wavelength),
        ("dihedral", rc.shapes.dihedral(edge), 2, 8.0 * np.pi * edge**4 / wavelength**2),
        ("triangular trihedral", rc.shapes.trihedral(edge), 3, 4.0 * np.pi * edge**4 / (3.0 * wavelength**2)),
        ("square trihedral", rc.shapes.trihedral(edge, shape="square"), 3, 12.0 * np.pi * edge**4 / wavelength**2),
    ]
    for name, mesh, max_bounces, expected in reflectors:
        for polarization in (None, "vertical", "horizontal"):
            got = rc.rcs(mesh, frequency, [-1.0, 0.0, 0.0], max_bounces=max_bounces, polarization=polarization)
            level, paper = 10.0 * np.log10([float(np.squeeze(got)), expected])
            numbers = [f"{level:.2f}", f"{paper:.2f}", f"{level - paper:+.2f}"]
            yield [name, polarization or "none", str(max_bounces), *numbers]
