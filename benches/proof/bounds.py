"""Bounds of the samplings, beside the measured errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from proof.measure import floor_text
from proof.oblique import Quiet
from proof.real_meshes import ProfileErrors, ViewResult, Way
from proof.targets import MattPower, Measured


@dataclass(frozen=True)
class Bound:
    """An upper bound of some numbers."""

    what: str
    quantity: str
    bound: float
    measured: list[float]
    is_typical: bool = False
    """True if the median is bounded, not the worst."""

    @property
    def is_held(self) -> bool:
        """True if none is larger, or the median is not."""
        return bool((np.median if self.is_typical else np.max)(self.measured) <= self.bound)


def single_bounds(mirror: list[Measured], budgets: list[Measured]) -> Iterator[Bound]:
    """Spheres, plates, discs and the cylinder at 1 m."""

    def of(rows: list[Measured], sampling: str, setting: str, *kinds: str) -> list[Measured]:
        return [
            row
            for row in rows
            if (row.sampling, row.setting) == (sampling, setting)
            and row.case.name.startswith(kinds)
            and row.case.has_budgets
        ]

    for what, setting, kinds, level, phase in (
        ("footprint, 512 pixels, spheres", "512", ("sphere",), 0.25, 0.04),
        ("footprint, 512 pixels, plates and discs", "512", ("disc", "square"), 0.6, None),
        ("footprint, 256 pixels, single bodies", "256", ("disc", "square", "sphere", "cylinder"), 0.5, None),
    ):
        rows = of(mirror, "footprint", setting, *kinds)
        if rows:
            yield Bound(what, "level [dB]", level, [row.level for row in rows], is_typical=setting == "256")
            if phase:
                yield Bound(what, "phase [rad]", phase, [row.phase for row in rows])
    for budget, level, phase in (("10000", 0.4, 0.06), ("40000", 0.2, 0.025), ("70000", 0.1, 0.015)):
        rows = [row for row in budgets if row.setting == budget]
        what = f"adaptive, edge terms, {budget} rays, single bodies"
        if budget == "10000":
            # The line of stationary phase of a cylinder takes more.
            what += " but cylinders"
            rows = [row for row in rows if not row.case.name.startswith("cylinder")]
        if rows:
            yield Bound(what, "level [dB]", level, [row.level for row in rows])
            yield Bound(what, "phase [rad]", phase, [row.phase for row in rows])


def quiet_bounds(oblique: list[Quiet], doppler: list[Quiet]) -> Iterator[Bound]:
    """Tilted walls and plates, and a sphere that moves evenly."""
    for name, bound in (("wall", -60.0), ("square", -44.0)):
        for row in oblique:
            is_bounded = row.sampling == "adaptive, edge terms" and row.setting == floor_text(1e-5)
            if row.name.startswith(name) and is_bounded:
                quantity = "echo [dB]" if name == "wall" else "error [dB]"
                yield Bound(f"{row.sampling}, {row.setting}, {row.name}", quantity, bound, [row.level])
    # A frame follows its points: only a cast per chirp shows what sampling adds to the side lobes of the window.
    for sampling in ("point", "footprint", "adaptive"):
        levels = [row.level for row in doppler if row.sampling == sampling and row.name != "one frame"]
        yield Bound(f"{sampling}, sphere that moves evenly, cast anew per chirp", "Doppler floor [dB]", -65.0, levels)


def matt_bounds(matt: list[MattPower]) -> Iterator[Bound]:
    """Mean power of what has enough points to have a mean."""
    rows = [row for row in matt if row.num_paths >= 1000]
    if rows:
        deviations = [100.0 * abs(row.of_paths - 1.0) for row in rows]
        yield Bound("diffuse targets, from 1000 paths on", "mean power [%]", 1.0, deviations)


MESH_BOUNDS: list[tuple[Way, tuple[float, float, float, float | None], tuple[float, float] | None]] = [
    (Way("adaptive", "floor", 1e-1), (1.5, 12.0, 45.0, -38.0), (4.0, 25.0)),
    (Way("adaptive", "floor", 1e-2), (1.0, 7.0, 21.0, -38.0), (3.5, 15.0)),
    (Way("adaptive", "floor", 1e-3), (0.8, 6.0, 18.0, -41.0), (2.5, 15.0)),
    (Way("adaptive", "rays", 40_000), (1.0, 2.0, 21.0, -38.0), None),
    (Way("adaptive", "rays", 100_000), (0.8, 1.6, 12.0, -41.0), (2.5, 15.0)),
    (Way("adaptive", "rays", 260_000), (0.3, 1.2, 7.0, -43.0), (2.0, 10.0)),
    (Way("footprint", "pixels", 512), (1.8, 4.3, 25.0, None), None),
    (Way("footprint", "pixels", 1024), (1.3, 2.9, 12.0, None), None),
]
"""Bounds of strongest peak [dB], peaks [dB rms], profile [%] and floor [dB] for arm and human, and of peaks and profile
for rooms. A floor of 1e-2 m² is that of the default, 1e-1 m² that of fast sampling."""


def mesh_bounds(results: list[ViewResult]) -> Iterator[Bound]:
    """Real meshes."""
    for way, alone, in_room in MESH_BOUNDS:
        what = f"{way.name}, {way.text}"
        errors = errors_of(results, way, is_room=False)
        if errors:
            name = f"{what}, arm and human"
            yield Bound(name, "strongest peak [dB]", alone[0], [abs(e.strongest) for e in errors])
            yield Bound(name, "peaks [dB rms]", alone[1], [e.peaks for e in errors])
            yield Bound(name, "range profile [%]", alone[2], [100.0 * e.relative for e in errors])
            if alone[3]:
                yield Bound(name, "error floor [dB]", alone[3], [e.floor for e in errors])
        errors = errors_of(results, way, is_room=True)
        if in_room and errors:
            name = f"{what}, room"
            yield Bound(name, "peaks [dB rms]", in_room[0], [e.peaks for e in errors])
            yield Bound(name, "range profile [%]", in_room[1], [100.0 * e.relative for e in errors])


def errors_of(results: list[ViewResult], way: Way, *, is_room: bool) -> list[ProfileErrors]:
    """Of a way, over all views of rooms or of all else."""
    return [
        row.errors
        for result in results
        if result.group.startswith("room") == is_room
        for row in result.sampled
        if row.way == way
    ]


def bound_rows(bounds: list[Bound]) -> Iterator[list[str]]:
    for b in bounds:
        worst, typical = max(b.measured), float(np.median(b.measured))
        yield [
            b.what,
            b.quantity,
            f"{b.bound:g}" + (" typically" if b.is_typical else ""),
            f"{worst:.2g}",
            f"{typical:.2g}",
            "yes" if b.is_held else "no",
        ]
