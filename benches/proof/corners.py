"""Corner reflectors in frames: paths of two and three reflections."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from typing import Any

import numpy as np

import radarcore as rc
from proof.measure import SPEED_OF_LIGHT, Run, conductor, decibels, simulator, tone

FREQUENCY = 60e9
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY
LEG = 0.1
"""Of all corners [m]."""

FAR = 100.0
"""A distance [m] at which the spheres of waves are flat over the corner to a tenth of a radian."""

ON_PAPER = {
    "dihedral": 8.0 * np.pi * LEG**4 / WAVELENGTH**2,
    "triangular trihedral": 4.0 * np.pi * LEG**4 / (3.0 * WAVELENGTH**2),
    "square trihedral": 12.0 * np.pi * LEG**4 / WAVELENGTH**2,
}
"""Far-field cross-sections [m²]."""

NEAR = (0.5, 1.0, 2.0)
"""Distances [m] of the apex of the triangular trihedral at which its far field has not begun."""

SAMPLINGS = ("point", "footprint", "adaptive")


@dataclass(frozen=True)
class Corner:
    """Measurement of a corner, by one sampling; cross-sections in dBsm, the phase re that on paper [rad]."""

    name: str
    distance: float
    polarization: str | None
    sampling: str
    side: int
    rays: int
    level: float
    on_paper: float
    phase: float | None


@cache
def near_db(distance: float, pitch: float = 4e-4) -> float:
    """Apparent cross-section of the triangular trihedral at a distance [m] of its apex, over that far away [dB].

    Mirror images of the antenna light the last plate of every order of reflections, as far as the straight lines from
    them meet the plates before; the last plate radiates by physical optics, summed over points at a pitch [m]. It uses
    no rays and no meshes of the simulator. As in the simulator, the rims of plates before the last one do not diffract.
    """
    # The plates lie in x = 0, y = 0 and z = 0, and the antenna on their diagonal.
    antenna = np.full(3, distance / np.sqrt(3.0))
    steps = np.arange(0.5 * pitch, LEG, pitch)
    across, up = (values.ravel() for values in np.meshgrid(steps, steps))
    # Cells that the long side cuts count for their share.
    share = np.clip((LEG - across - up) / pitch + 0.5, 0.0, 1.0)
    wavenumber, total = 2.0 * np.pi / WAVELENGTH, 0.0 + 0.0j
    for number in (1, 2, 3):
        for plates in permutations(range(3), number):
            *before, last = plates
            points = np.zeros((share.size, 3))
            points[:, [axis for axis in range(3) if axis != last]] = np.column_stack([across, up])
            images = [antenna]
            for plate in before:
                images.append(images[-1] * np.where(np.arange(3) == plate, -1.0, 1.0))
            lit, target = np.ones(share.size, dtype=bool), points
            for plate, image in zip(reversed(before), reversed(images[1:]), strict=True):
                # Where the line from the image to the target passes the plate.
                part = image[plate] / (image[plate] - target[:, plate])
                target = image + part[:, None] * (target - image)
                lit &= (target > -1e-12).all(axis=1) & (target.sum(axis=1) < LEG)
            there, back = np.linalg.norm(points - images[-1], axis=1), np.linalg.norm(points - antenna, axis=1)
            cosines = np.abs(images[-1][last]) / there + antenna[last] / back
            phasor = np.exp(-1j * wavenumber * (there + back)) / (there * back)
            total += (-1.0) ** number * (lit * share * 0.5 * cosines * phasor).sum() * pitch**2
    sigma = 4.0 * np.pi * abs(total * distance**2 / WAVELENGTH) ** 2
    return float(10.0 * np.log10(sigma / ON_PAPER["triangular trihedral"]))


@cache
def integral_near_db(distance: float, pitch: float = 1e-3, reflections: int = 6) -> float:
    """Near level by an integral over all three plates with all their rims, up to a number of reflections [dB].

    Every point of a plate re-radiates -1 times the incident field, ``(j / wavelength) (cos_in + cos_out) / 2
    exp(-jkR) / R dA``, to the antenna and to the other two plates. The field is scalar. The integral is
    independent of the simulator and of mirror images.
    """
    steps = np.arange(0.5 * pitch, LEG, pitch)
    x, y = (values.ravel() for values in np.meshgrid(steps, steps))
    share = np.clip((LEG - x - y) / pitch + 0.5, 0.0, 1.0)
    x, y, share = x[share > 0.0], y[share > 0.0], share[share > 0.0]
    # On the plate z = 0; by symmetry the others have the same fields, and (y, x) the same as (x, y).
    mirrored = np.empty(x.size, dtype=int)
    mirrored[np.lexsort((x, y))] = np.lexsort((y, x))
    height, wavenumber, areas = distance / np.sqrt(3.0), 2.0 * np.pi / WAVELENGTH, share * pitch**2
    far = np.sqrt((x - height) ** 2 + (y - height) ** 2 + height**2)
    wave, cosine = np.exp(-1j * wavenumber * far) / far, height / far
    # The incident field, and the same times the cosine of its direction.
    arriving, slanting = wave, wave * cosine
    total = 0.0 + 0.0j
    for number in range(reflections):
        if number > 0:
            sums = np.empty((2, x.size), dtype=complex)
            for rows in np.array_split(np.arange(x.size), 1 + x.size // 400):
                # From (0, x, y) of the plate x = 0 to (x, y, 0).
                to_x, to_y = x[rows, None], y[rows, None]
                length = np.sqrt(to_x**2 + (to_y - x) ** 2 + y**2)
                sent = 0.5 * (slanting + to_x / length * arriving) * areas
                parts = -1j / WAVELENGTH * sent * np.exp(-1j * wavenumber * length) / length
                sums[:, rows] = parts.sum(axis=1), (parts * (y / length)).sum(axis=1)
            arriving, slanting = sums + sums[:, mirrored]  # from the plate y = 0 as well
        total -= 3.0 * (areas * 0.5 * (slanting + cosine * arriving) * wave).sum()
    sigma = 4.0 * np.pi * abs(total * distance**2 / WAVELENGTH) ** 2
    return float(10.0 * np.log10(sigma / ON_PAPER["triangular trihedral"]))


def near_rows(run: Run) -> Iterator[list[str]]:
    """Both references of the near trihedral, over its far field [dB]."""
    for distance in NEAR:
        images, integral = near_db(distance, run.near_pitch), integral_near_db(distance, 2.5 * run.near_pitch)
        yield [f"{distance:g}", f"{images:.1f}", f"{integral:.1f}", f"{integral - images:+.1f}"]


def corner_results(run: Run) -> Iterator[Corner]:
    meshes = {
        "dihedral": rc.shapes.dihedral(LEG),
        "triangular trihedral": rc.shapes.trihedral(LEG),
        "square trihedral": rc.shapes.trihedral(LEG, shape="square"),
    }
    for name, mesh in meshes.items():
        on_paper = 10.0 * np.log10(ON_PAPER[name])
        for polarization in (None, "vertical", "horizontal"):
            for sampling in SAMPLINGS:
                yield corner(run, name, mesh, FAR, polarization, sampling, on_paper)
    for distance in NEAR:
        difference = near_db(distance, run.near_pitch)
        for sampling in SAMPLINGS:
            name = "triangular trihedral"
            on_paper = 10.0 * np.log10(ON_PAPER[name]) + difference
            yield corner(run, name, meshes[name], distance, None, sampling, on_paper)


def corner(
    run: Run, name: str, mesh: rc.Mesh, distance: float, polarization: str | None, sampling: str, on_paper: float
) -> Corner:
    """One corner, in an image a little wider than it."""
    h, rays = echo_of(run, mesh, distance, polarization=polarization, sampling=sampling)
    section = 4.0 * np.pi * (abs(h) * distance**2 * 4.0 * np.pi / WAVELENGTH) ** 2
    # A plate at the apex returns -j exp(-2jkR) times a positive number. Three mirrors at right angles turn the field
    # round once more, E -> 2 n (n.E) - E three times being +E; without a polarisation three changes of sign leave -1.
    # The sign of a dihedral depends on the polarisation. Near the radar the sphere of the wave counts.
    phase = None
    if distance == FAR:
        turns = h * np.exp(2j * np.pi * FREQUENCY * 2.0 * distance / SPEED_OF_LIGHT) / -1j
        if name == "dihedral":
            phase = float(np.angle(turns**2) / 2.0)
        else:
            phase = float(np.angle(turns if polarization is None else -turns))
    level = float(10.0 * np.log10(section))
    return Corner(name, distance, polarization, sampling, run.corner_side, rays, level, float(on_paper), phase)


def echo_of(run: Run, mesh: rc.Mesh, distance: float, **options: Any) -> tuple[complex, int]:
    """H at one frequency of a corner whose apex is straight ahead, and the rays that it took."""
    polarization, roll = options.pop("polarization", None), options.pop("roll", 0.0)
    target = conductor(mesh, distance)
    if roll:
        pose = rc.Pose.from_rpy([distance, 0.0, 0.0], [roll, 0.0, 0.0])
        target = rc.Body(mesh, material=target.material, motion=pose)
    angle = 2.2 * np.rad2deg(np.arctan2(0.095, distance - LEG))
    sim = simulator(
        target,
        rc.Radar(tone(FREQUENCY), polarization=polarization),
        resolution=run.corner_side,
        field_of_view_deg=(angle, angle),
        max_bounces=3,
        **options,
    )
    frame = sim.frame()
    rays = frame.stats["rays_cast"] + frame.stats["bounce_rays"]
    return complex(np.conj(frame.cube[0, 0, 0])), rays


def corner_rows(results: list[Corner]) -> Iterator[list[str]]:
    for c in results:
        yield [
            c.name,
            f"{c.distance:g}",
            c.polarization or "none",
            c.sampling,
            str(c.rays),
            f"{c.level:.2f}",
            f"{c.on_paper:.2f}",
            f"{c.level - c.on_paper:+.2f}",
            "" if c.phase is None else f"{c.phase:+.3f}",
        ]


def null_db(run: Run) -> float:
    """Echo of a dihedral turned by 45 degrees about the boresight, relative to the upright one [dB].

    It turns vertical polarisation into horizontal: on paper nothing comes back to an antenna of the same.
    """
    mesh = rc.shapes.dihedral(LEG)
    upright, turned = (
        echo_of(run, mesh, FAR, polarization="vertical", sampling="footprint", roll=roll)[0]
        for roll in (0.0, np.pi / 4)
    )
    return float(decibels(turned / upright))
