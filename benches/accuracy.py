"""Error of whole frames against closed forms, and what a finer image costs.

    python benches/accuracy.py            print the tables
    python benches/accuracy.py --write    also write docs/accuracy.md
    python benches/accuracy.py --tiny     run everything once on few rays

Targets are perfect conductors or matt surfaces seen by one isotropic antenna, 1 W. A frame of one chirp that sweeps 57
to 64 GHz in a second samples the transfer function H(f): its samples are conj(H), as the delays are nanoseconds.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import exp1

import radarcore as rc
from page import table

SPEED_OF_LIGHT = 299_792_458.0
PAGE = Path(__file__).parent.parent / "docs" / "accuracy.md"

WAVEFORM = rc.Waveform.from_sweep(start_frequency=57e9, stop_frequency=64e9, sample_rate=64.0, num_samples=64)
RADAR = rc.Radar(WAVEFORM)
FREQUENCIES = WAVEFORM.start_frequency + WAVEFORM.slope * WAVEFORM.sample_times
WAVENUMBERS = 2.0 * np.pi * FREQUENCIES / SPEED_OF_LIGHT

FINE_RIM = 2e-6
"""Sagitta of discs [m]: the polygon is the disc to less than a thousandth of a wavelength."""

PAGE_TEXT = """\
# Accuracy

Frames of `radarcore` against closed forms; written by `python benches/accuracy.py --write`.

## Mirror-like targets

{mirror}

Errors are rms over 64 frequencies from 57 to 64 GHz and six turns of the radar by parts of a pixel, of the level and
of the phase of the echo of the whole target; "worst" is the rms of the worst turn, often the one where the target
lies symmetrically on the pixels. "Pixels" is the side of the square image, 60 degrees wide where nothing else is
said, or the `rcs_floor` of adaptive sampling; "rays" and "paths" are of the first turn, and "cost" is the run time of
a frame (one chirp of 64 samples, nothing known from frames before) relative to 256 x 256 footprints of the same
target in the same run.

Read down a target: footprint errors shrink as pixels do, with the staircase at the edges of plates the last to go;
`point`, one phasor per pixel and kept for comparison, need not converge at all; adaptive sampling takes rays to the
edges and to where the phase turns slowly, and what is left of a sphere's error at the lowest floor is that of its
mesh.

## Matt targets

{matt}

Deviation from the mean power over all random phases, albedo 1: of the sum of the powers of the paths, and of the
power in the samples averaged over seeds, with its standard error. Diffuse points of adaptive sampling are spread over
the disc by area, the more the lower the floor. Read the first for accuracy: one seed gives one draw of an exponential
distribution (speckle), as a real measurement of one matt surface does, so the second only narrows as one over the
root of the number of seeds.

## Cross-sections

{sections}

`rc.rcs` at 60 GHz, along the normal, the axis of the corner, or broadside; lengths of edges, legs and radii are 10
cm, the cylinder's is its length, with a radius of 5 cm. Closed forms are those of geometrical and physical optics for
large targets; the rims of trihedrals are staircases of the rays.

## What the model leaves out

Physical optics knows neither the diffraction of edges beyond that of their aperture nor waves that creep round
bodies: exact spheres differ by about 1 / (2 k a), 1 % at a radius of 4 cm. Nothing goes through surfaces. Meshes are
taken for what they are: facets whose sagitta is more than 0.1 mm have a phase of their own (`rc.mesh_report`), and
phases of real things are meaningful as changes in time, not as absolute numbers.
"""

Phasors = NDArray[np.complex128]


@dataclass(frozen=True)
class Case:
    """A target whose echo is known on paper: H at all frequencies, 1 W and unit gain."""

    name: str
    target: rc.Body | rc.PointTarget
    echo: Phasors
    field_of_view_deg: float = 60.0
    has_fine: bool = False  # also 1024 x 1024


@dataclass(frozen=True)
class Run:
    """How much is measured; cost counts in frames of `unit` by `unit` footprints."""

    resolutions: list[int]
    finest: list[int]
    floors: list[float]
    unit: int
    turns: int
    repeats: int
    seeds: int


FULL = Run([128, 256, 512], [1024], [1e-3, 1e-5, 1e-7], unit=256, turns=6, repeats=3, seeds=100)
TINY = Run([32], [], [1.0], unit=32, turns=2, repeats=1, seeds=2)

TURNS = np.array([[0.0, 0.0], [0.5, 0.17], [0.17, 0.67], [0.83, 0.33], [0.33, 0.83], [0.67, 0.5]])
"""Where the rays fall, in pixels from the image's symmetry, down and left. The first, the foot point on a corner of
four pixels, is often the worst."""


# Closed forms. Every echo of a conductor is H = (j / 4 pi) Gamma Int with Int = integral of exp(-2jkR) over the solid
# angle it covers and Gamma = -1: physical optics seen from one antenna.


def echo(integral: Phasors) -> Phasors:
    return -1j / (4.0 * np.pi) * integral


def exponential_integral_2(z: Phasors) -> Phasors:
    """E2(z) = exp(-z) - z E1(z)."""
    return np.exp(-z) - z * exp1(z)


def disc_echo(radius: float, distance: float) -> Phasors:
    rim = np.hypot(distance, radius)
    at_foot, at_rim = (exponential_integral_2(2j * WAVENUMBERS * r) for r in (distance, rim))
    return echo(2.0 * np.pi * (at_foot - distance / rim * at_rim))


def sphere_echo(radius: float, center: float) -> Phasors:
    front, limb = center - radius, np.sqrt(center**2 - radius**2)
    z_front, z_limb = 2j * WAVENUMBERS * front, 2j * WAVENUMBERS * limb
    ends = exponential_integral_2(z_front) / front - exponential_integral_2(z_limb) / limb
    waves = (np.exp(-z_front) - np.exp(-z_limb)) / (2j * WAVENUMBERS)
    return echo(np.pi / center * (limb**2 * ends - waves))


def square_echo(edge: float, center: float, tilt: float = 0.0) -> Phasors:
    """Flat polygon: 2 pi E2(2jkd) inside, less the line integral of (d/R) E2(2jkR) dphi about the foot point."""
    foot_distance, offset = center * np.cos(tilt), center * np.sin(tilt)
    corners = 0.5 * edge * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) + [offset, 0.0]
    nodes, weights = np.polynomial.legendre.leggauss(160)
    total = np.zeros_like(WAVENUMBERS, dtype=complex)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        points = start + 0.5 * (1.0 + nodes)[:, None] * (end - start)
        square = (points**2).sum(axis=1)
        turning = 0.5 * (start[0] * end[1] - start[1] * end[0]) / square  # dphi per unit of the node
        distance = np.sqrt(square + foot_distance**2)
        values = foot_distance / distance * exponential_integral_2(2j * np.outer(WAVENUMBERS, distance))
        total += values @ (weights * turning)
    is_inside = abs(offset) < 0.5 * edge
    return echo(2.0 * np.pi * is_inside * exponential_integral_2(2j * WAVENUMBERS * foot_distance) - total)


def cylinder_echo(radius: float, length: float, center: float) -> Phasors:
    """No closed form: the integral over the lit surface, by Gauss-Legendre in angle and height."""
    nodes, weights = np.polynomial.legendre.leggauss(240)
    limb = np.arccos(radius / center)
    angle, z = limb * nodes[:, None], 0.5 * length * nodes
    x, y = center - radius * np.cos(angle), radius * np.sin(angle)
    distance = np.sqrt(x**2 + y**2 + z**2)
    obliquity = (center * np.cos(angle) - radius) / distance
    area = radius * limb * 0.5 * length * np.outer(weights, weights)
    solid_angle = (obliquity * area / distance**2).ravel()
    return echo(np.array([solid_angle @ np.exp(-2j * k * distance.ravel()) for k in WAVENUMBERS]))


def point_echo(rcs: float, distance: float) -> Phasors:
    amplitude = WAVEFORM.wavelength / (4.0 * np.pi) * np.sqrt(rcs / (4.0 * np.pi)) / distance**2
    return amplitude * np.exp(-2j * WAVENUMBERS * distance)


def lambertian_disc_power(albedo: float, radius: float, distance: float) -> float:
    """Mean power over the random phases."""
    rim = np.hypot(distance, radius)
    return float((WAVEFORM.wavelength / (4 * np.pi)) ** 2 * 0.5 * albedo * distance**2 * (distance**-4 - rim**-4))


# Targets.


def conductor(mesh: rc.Mesh, distance: float, tilt: float = 0.0) -> rc.Body:
    pose = rc.Pose.from_rpy([distance, 0.0, 0.0], [0.0, 0.0, tilt])
    return rc.Body(mesh, material=rc.materials["perfect_conductor"], motion=pose)


def cases() -> Iterator[Case]:
    for radius in (0.05, 0.02):
        mesh = rc.shapes.disc(radius, sagitta=FINE_RIM)
        name = f"disc, radius {100 * radius:g} cm, at 1 m"
        yield Case(name, conductor(mesh, 1.0), disc_echo(radius, 1.0), has_fine=radius == 0.05)
    for edge in (0.1, 0.2):
        target = conductor(rc.shapes.plate(edge, edge), 1.0)
        yield Case(f"square, {100 * edge:g} cm, at 1 m", target, square_echo(edge, 1.0), has_fine=edge == 0.2)
    tilt = np.deg2rad(5.0)
    target = conductor(rc.shapes.plate(0.2, 0.2), 1.0, tilt)
    yield Case("square, 20 cm, at 1 m, tilted 5 degrees", target, square_echo(0.2, 1.0, tilt), has_fine=True)
    for field_of_view in (60.0, 6.0):
        target = conductor(rc.shapes.plate(0.1, 0.1), 10.0)
        name = f"square, 10 cm, at 10 m, image of {field_of_view:g} degrees"
        yield Case(name, target, square_echo(0.1, 10.0), field_of_view)
    for radius in (0.2, 0.1, 0.05):
        target = conductor(rc.shapes.sphere(radius), 1.0)
        name = f"sphere, radius {100 * radius:g} cm, centre at 1 m"
        yield Case(name, target, sphere_echo(radius, 1.0), has_fine=radius == 0.1)
    target = conductor(rc.shapes.cylinder(0.05, 0.3), 1.0)
    yield Case("cylinder, radius 5 cm, length 30 cm, axis at 1 m", target, cylinder_echo(0.05, 0.3, 1.0))
    yield Case("point, 1 m², at 2 m", rc.PointTarget([2.0, 0.0, 0.0], rcs=1.0), point_echo(1.0, 2.0))


# Measurement.


def simulator(target: rc.Body | rc.PointTarget, **options: Any) -> rc.Simulator:
    # Of the tolerance only the double precision below 1e-6 is used: rounding to complex64 would show.
    return rc.Simulator(rc.Scene([target]), RADAR, tolerance=1e-9, **options)


def frame(sim: rc.Simulator) -> rc.Frame:
    with warnings.catch_warnings():
        # The samples are H at 64 frequencies; nobody reads a range from them.
        warnings.filterwarnings("ignore", message="the scene reaches to")
        return sim.frame()


def best_time(action: Callable[[], object], repeats: int) -> float:
    """Shortest of some runs [s]: what else runs on the machine only adds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def turned(pixels: NDArray[np.float64], resolution: int, field_of_view_deg: float) -> rc.Pose:
    """The radar turned about y and z by parts of a pixel: every echo stays what it is, the rays fall elsewhere."""
    pixel = 2.0 * np.tan(np.deg2rad(0.5 * field_of_view_deg)) / resolution
    return rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, *pixels * pixel])


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def errors(got: Phasors, expected: Phasors) -> tuple[float, float, float]:
    """Rms of level [dB] over all turns and frequencies, that of the worst turn, and rms of phase [rad]."""
    ratio = got / expected
    with np.errstate(divide="ignore"):  # nothing hit: infinitely many dB off
        level = 20.0 * np.log10(np.abs(ratio))
    return rms(level), max(map(rms, level)), rms(np.angle(ratio))


def mirror_rows(run: Run) -> Iterator[list[str]]:
    """Error and cost of every target, sampling and resolution or floor."""
    for case in cases():
        is_point, fov = isinstance(case.target, rc.PointTarget), case.field_of_view_deg
        sides = [run.unit] if is_point else run.resolutions + run.finest * case.has_fine
        ways: list[tuple[str, str, int, dict[str, Any]]] = [
            (sampling, str(side), side, {"resolution": side})
            for sampling in (("footprint",) if is_point else ("footprint", "point"))
            for side in sides
        ]
        cells = round(64 * fov / 60.0)
        ways += [("adaptive", floor(x), cells, {"rcs_floor": x}) for x in run.floors if not is_point]
        rows, durations = [], {}
        for sampling, setting, side, options in ways:
            sims = [
                simulator(
                    case.target,
                    radar_motion=turned(turn, side, fov),
                    field_of_view_deg=(fov, fov),
                    sampling=sampling,
                    **options,
                )
                for turn in TURNS[: run.turns]
            ]
            frames = [frame(sim) for sim in sims]
            numbers = errors(np.conj([f.cube[0, 0] for f in frames]), case.echo)
            durations[sampling, setting] = best_time(lambda sim=sims[0]: frame(sim.with_radar(RADAR)), run.repeats)
            stats = frames[0].stats
            rows.append((sampling, setting, *(f"{x:.2g}" for x in numbers), stats["rays_cast"], stats["paths"]))
        unit = durations["footprint", str(run.unit)]
        for row in rows:
            yield [case.name, *map(str, row), f"{durations[row[:2]] / unit:.2g}"]


def floor(rcs_floor: float) -> str:
    return f"{rcs_floor:.0e} m²"


def matt_rows(run: Run) -> Iterator[list[str]]:
    """Mean power of matt discs: from the paths, whose phases are random, and from frames of many seeds."""
    for radius, distance in ((0.1, 1.0), (0.5, 1.0), (0.3, 2.0)):
        mesh = rc.shapes.disc(radius, sagitta=FINE_RIM)
        target = rc.Body(mesh, material=rc.Material.lambertian(1.0), motion=rc.Pose([distance, 0.0, 0.0]))
        expected = lambertian_disc_power(1.0, radius, distance)
        ways: list[tuple[str, dict[str, Any]]] = [(str(side), {"resolution": side}) for side in run.resolutions]
        ways += [(floor(x), {"sampling": "adaptive", "rcs_floor": x}) for x in run.floors[:2]]
        for setting, options in ways:
            paths = simulator(target, **options).paths()
            sums = (np.abs(paths.amplitude) ** 2).sum() / expected
            powers = np.array(
                [
                    np.mean(np.abs(frame(simulator(target, seed=seed, **options)).cube) ** 2) / expected
                    for seed in range(run.seeds)
                ]
            )
            yield [
                f"disc, radius {100 * radius:g} cm, at {distance:g} m",
                setting,
                str(paths.delay.size),
                f"{100.0 * (sums - 1.0):+.2f} %",
                f"{100.0 * (powers.mean() - 1.0):+.0f} ± {100.0 * powers.std(ddof=1) / np.sqrt(len(powers)):.0f} %",
            ]


def section_rows() -> Iterator[list[str]]:
    """Far-field cross-sections by one reflection and several."""
    frequency, edge = 60e9, 0.1
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


def main() -> None:
    parser = argparse.ArgumentParser(description="Error of frames against closed forms.")
    parser.add_argument("--tiny", action="store_true", help="once, on few rays")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.parent.name}/{PAGE.name}")
    arguments = parser.parse_args()
    run = TINY if arguments.tiny else FULL

    mirror = table(
        ["target", "sampling", "pixels", "error [dB]", "worst [dB]", "error [rad]", "rays", "paths", "cost"],
        mirror_rows(run),
    )
    print(mirror, end="\n\n")
    matt = table(["target", "pixels", "paths", "power of the paths", f"mean of {run.seeds} seeds"], matt_rows(run))
    print(matt, end="\n\n")
    sections = table(["target", "polarisation", "reflections", "dBsm", "on paper", "error [dB]"], section_rows())
    print(sections)

    if arguments.write:
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(PAGE_TEXT.format(mirror=mirror, matt=matt, sections=sections), encoding="utf-8")


if __name__ == "__main__":
    main()
