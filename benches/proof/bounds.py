"""Bounds of the samplings, beside the measured errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np

from proof.flat_surfaces import SETTINGS as FLAT_SETTINGS
from proof.flat_surfaces import FlatResult
from proof.measure import floor_text
from proof.oblique import Quiet
from proof.real_meshes import DEFAULT, ProfileErrors, ViewResult, Way
from proof.surfaces import SurfaceResult
from proof.targets import MattPower, Measured

PAPER, SURFACE, FACES, DENSE = "closed form", "exact surface", "faces", "dense integration, ours"
"""References; the page says what each of them is."""

INSTEAD = {
    "point": "it does not converge, and its rays hit other points in every chirp: use the default",
    "footprint": "five pixels across a plate, or those along limbs and long ridges, are too few: use the default, or a "
    "narrower `field_of_view_deg`",
}
"""Advice for a bound that is not held, by the beginning of its name."""


@dataclass(frozen=True)
class Bound:
    """An upper bound of some numbers."""

    what: str
    quantity: str
    reference: str
    bound: float
    measured: list[float]
    is_typical: bool = False
    """True if the median is bounded, not the worst."""

    @property
    def is_held(self) -> bool:
        """True if none is larger, or the median is not."""
        return bool((np.median if self.is_typical else np.max)(self.measured) <= self.bound)


LARGEST = {("disc", "square", "plane"): (0.2, 0.02), ("sphere", "cylinder"): (1.2, 0.18)}
"""Bounds of level [dB] and phase [rad] at any turn and frequency, by the start of the name of the body."""


def single_bounds(mirror: list[Measured]) -> Iterator[Bound]:
    """Spheres, plates, discs and the cylinder at 1 m."""
    flat, curved = LARGEST
    for sampling, setting, name, kinds, level, phase in (
        ("adaptive", "default", "default, plates and discs", flat, 0.1, 0.015),
        ("adaptive", "default", "default, spheres and cylinder", curved, 0.6, 0.06),
        ("footprint", "512", "512 pixels, spheres", ("sphere",), 0.25, 0.04),
        ("footprint", "512", "512 pixels, plates and discs", flat[:2], 0.6, None),
        ("footprint", "256", "256 pixels, single bodies", flat + curved, 0.5, None),
    ):
        rows = [
            row
            for row in mirror
            if (row.sampling, row.setting) == (sampling, setting) and row.case.name.startswith(kinds)
        ]
        if rows and setting == "default":
            what, (most_level, most_phase) = f"{sampling}, {name}, any turn and frequency", LARGEST[kinds]
            yield Bound(what, "level [dB]", PAPER, most_level, [row.largest_level for row in rows])
            yield Bound(what, "phase [rad]", PAPER, most_phase, [row.largest_phase for row in rows])
        if rows:
            what, is_typical = f"{sampling}, {name}", setting == "256"
            yield Bound(what, "level [dB]", PAPER, level, [row.level for row in rows], is_typical)
            if phase:
                yield Bound(what, "phase [rad]", PAPER, phase, [row.phase for row in rows])


FLAT_BOUNDS = (
    ("plates and boxes", ("plate", "box"), (4e-4, 3e-5), 1e-4),
    ("spheres", ("sphere",), (1e-3, 1e-3), 1.2e-3),
    ("partly hidden plates and tables", ("partly hidden",), (1e-2, 1e-3), 1.2e-3),
)
"""Bodies, starts of their names, floors of errors at the two settings [m²], and share of the echo."""


def flat_bounds(results: list[FlatResult]) -> Iterator[Bound]:
    """Plates, boxes and spheres at random: the largest of a floor and a share of the echo."""
    for what, names, floors, share in FLAT_BOUNDS:
        for setting, floor in zip(FLAT_SETTINGS, floors, strict=True):
            rows = [row for row in results if row.setting == setting and row.name.startswith(names)]
            if not rows:
                continue
            ratios = [row.errors / np.maximum(floor, share * row.echoes) for row in rows]
            quantity = f"error over max({floor_text(floor)}, {share:.1e} of the echo)"
            reference = PAPER if what == "spheres" else FACES
            name = f"adaptive, {setting}, {what} at random"
            yield Bound(name, quantity, reference, 1.0, np.concatenate(ratios).tolist())


def flat_lines() -> Iterator[str]:
    """Bounds of `flat_bounds`, one line per kind of body."""
    for what, _, (by_default, by_floor), share in FLAT_BOUNDS:
        floors = f"{floor_text(by_default)} ({floor_text(by_floor)})"
        yield f"- {what}: {floors}, or {share:.1e} of the echo where that is more"


def quiet_bounds(oblique: list[Quiet], doppler: list[Quiet]) -> Iterator[Bound]:
    """Tilted walls and plates, and a sphere that moves evenly."""
    for what, settings, name, quantity, bound in (
        ("any setting", ("default", "1e"), "wall", "echo [dB]", -72.0),
        ("default", ("default",), "square", "error [dB]", -54.0),
        ("any floor", ("1e",), "square", "error [dB]", -66.0),
    ):
        rows = [row for row in oblique if row.sampling == "adaptive" and row.setting.startswith(settings)]
        rows = [row for row in rows if row.name.startswith(name)]
        yield Bound(f"adaptive, {what}, {rows[0].name}", quantity, PAPER, bound, [row.level for row in rows])
    # A frame follows its points: only a cast per chirp shows what sampling adds to the side lobes of the window.
    for sampling in ("point", "footprint", "adaptive"):
        levels = [row.level for row in doppler if row.sampling == sampling and row.name != "one frame"]
        what = f"{sampling}, sphere that moves evenly, cast anew per chirp"
        yield Bound(what, "Doppler floor [dB]", "no line: even motion", -65.0, levels)


def matt_bounds(matt: list[MattPower]) -> Iterator[Bound]:
    """Mean power of what has enough points to have a mean."""
    rows = [row for row in matt if row.num_paths >= 1000]
    if rows:
        deviations = [100.0 * abs(row.of_paths - 1.0) for row in rows]
        yield Bound("diffuse targets, from 1000 paths on", "mean power [%]", "Lambert's law", 1.0, deviations)


SURFACE_BOUNDS = {"capsule": (0.5, 6.0), "tube": (0.5, 20.0), "person": (0.5, 7.0)}
"""Bounds of strongest peak [dB] and profile [%] for meshes of bodies whose exact surface is known."""


def surface_bounds(results: list[SurfaceResult]) -> Iterator[Bound]:
    """Meshes against their exact surfaces, at the default setting."""
    for kind, (strongest, profile) in SURFACE_BOUNDS.items():
        rows = [row.errors for row in results if row.target.startswith(kind) and row.way == DEFAULT.title]
        if rows:
            what = f"{DEFAULT.title}, {kind}, any mesh"
            yield Bound(what, "strongest peak [dB]", SURFACE, strongest, [abs(row.strongest) for row in rows])
            yield Bound(what, "range profile [%]", SURFACE, profile, [100.0 * row.relative for row in rows])


MESH_BOUNDS: list[tuple[Way, tuple[float, float, float, float | None], tuple[float, float] | None]] = [
    (DEFAULT, (1.0, 7.0, 21.0, -38.0), (3.5, 15.0)),
    (Way("adaptive", "floor", 1e-1), (1.5, 12.0, 45.0, -38.0), (4.0, 25.0)),
    (Way("adaptive", "floor", 1e-2), (1.0, 7.0, 21.0, -38.0), (3.5, 15.0)),
    (Way("adaptive", "floor", 1e-3), (0.8, 6.0, 18.0, -41.0), (2.5, 15.0)),
    (Way("footprint", "pixels", 512), (1.8, 4.3, 25.0, None), None),
    (Way("footprint", "pixels", 1024), (1.3, 2.9, 12.0, None), None),
]
"""Bounds of strongest peak [dB], peaks [dB rms], profile [%] and floor [dB] for arm and human, and of peaks and profile
for rooms. The floor of the default follows the echo, at most 1e-2 m²; fast sampling has 1e-1 m²."""


def mesh_bounds(results: list[ViewResult]) -> Iterator[Bound]:
    """Real meshes."""
    for way, alone, in_room in MESH_BOUNDS:
        what = way.title
        errors = errors_of(results, way, is_room=False)
        if errors:
            name = f"{what}, arm and human"
            yield Bound(name, "strongest peak [dB]", DENSE, alone[0], [abs(e.strongest) for e in errors])
            yield Bound(name, "peaks [dB rms]", DENSE, alone[1], [e.peaks for e in errors])
            yield Bound(name, "range profile [%]", DENSE, alone[2], [100.0 * e.relative for e in errors])
            if alone[3]:
                yield Bound(name, "error floor [dB]", DENSE, alone[3], [e.floor for e in errors])
        errors = errors_of(results, way, is_room=True)
        if in_room and errors:
            name = f"{what}, room"
            yield Bound(name, "peaks [dB rms]", DENSE, in_room[0], [e.peaks for e in errors])
            yield Bound(name, "range profile [%]", DENSE, in_room[1], [100.0 * e.relative for e in errors])


def errors_of(results: list[ViewResult], way: Way, *, is_room: bool) -> list[ProfileErrors]:
    """Of a way, over all views of rooms or of all else."""
    return [
        row.errors
        for result in results
        if result.group.startswith("room") == is_room
        for row in result.sampled
        if row.way == way
    ]


def default_bounds(bounds: list[Bound]) -> list[Bound]:
    """Bounds of the default setting, named without it; of single bodies the largest errors alone."""
    single = ("plates and discs", "spheres and cylinder")
    chosen = [b for b in bounds if ", default, " in b.what and not b.what.endswith(single)]
    return [replace(b, what=b.what.partition(", default, ")[2]) for b in chosen]


def bound_rows(bounds: list[Bound]) -> Iterator[list[str]]:
    for b in bounds:
        worst, typical = max(b.measured), float(np.median(b.measured))
        yield [
            b.what,
            b.quantity,
            b.reference,
            f"{b.bound:g}" + (" typically" if b.is_typical else ""),
            f"{worst:.2g}",
            f"{typical:.2g}",
            "yes" if b.is_held else "no",
        ]


def unheld_lines(bounds: list[Bound]) -> Iterator[str]:
    """Why bounds are not held and what to set instead, one line per kind; an error for one without a reason."""
    unheld = [b.what for b in bounds if not b.is_held]
    for what in unheld:
        if not what.startswith(tuple(INSTEAD)):
            raise ValueError(f"INSTEAD: expected what to set in place of {what!r}, whose bound is not held")
    for beginning, instead in INSTEAD.items():
        if any(what.startswith(beginning) for what in unheld):
            yield fill(f"- `{beginning}`: {instead}.", width=120, subsequent_indent="  ", break_on_hyphens=False)
