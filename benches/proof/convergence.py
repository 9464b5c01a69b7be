"""Error against time, against rays, and against the settings of every sampling: docs/accuracy.png and a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import radarcore as rc
from proof.bounds import DENSE, PAPER
from proof.closed_forms import sphere_echo, square_echo
from proof.dense import Dense
from proof.measure import SPEED_OF_LIGHT, TURNS, Run, conductor, frequencies, num_cells, rms, turned
from proof.real_meshes import RADAR, WAVEFORM, Sampled, View, ViewResult, Way, sampled, ways


@dataclass(frozen=True)
class Point:
    """Relative error, mean rays and median time [s] of a way for a target, over turns or views."""

    target: str
    way: Way
    error: float
    rays: float
    seconds: float


def single_points(run: Run) -> Iterator[Point]:
    """A sphere and a plate, whose range profiles are known on paper."""
    wavenumbers = 2.0 * np.pi * frequencies(WAVEFORM) / SPEED_OF_LIGHT
    targets = {
        # Four times the usual triangles: their own error would show.
        "sphere, 10 cm, at 1 m": (rc.shapes.sphere(0.1, subdivisions=6), sphere_echo(0.1, 1.0, wavenumbers)),
        "plate, 20 cm, at 1 m": (rc.shapes.plate(0.2, 0.2), square_echo(0.2, 1.0, 0.0, wavenumbers)),
    }
    finer = replace(run, mesh_floors=[*run.mesh_floors, run.floors[-1]])
    for name, (mesh, expected) in targets.items():
        scene = rc.Scene([conductor(mesh, 1.0)])
        for way in ways(finer):
            side = int(way.number) if way.knob == "pixels" else num_cells(60.0)
            motions = [turned(turn, side, 60.0) for turn in TURNS[: run.turns : 2]]
            reference = Dense((expected, expected), 0, 0.0, 2.0)
            yield point(name, [sampled(View("", "", scene, RADAR, motion), way, reference) for motion in motions])


def mesh_points(results: list[ViewResult]) -> Iterator[Point]:
    """The groups of real meshes, but for rooms."""
    for group in dict.fromkeys(result.group for result in results):
        if group.startswith("room"):
            continue
        for rows in zip(*(result.sampled for result in results if result.group == group), strict=True):
            yield point(group, list(rows))


def point(target: str, rows: list[Sampled]) -> Point:
    return Point(
        target,
        rows[0].way,
        rms(np.array([row.errors.relative for row in rows])),
        float(np.mean([row.rays for row in rows])),
        float(np.median([row.seconds for row in rows])),
    )


CURVES = {
    "point, by pixels": (("point", "pixels"), "s:", "C7"),
    "footprint, by pixels": (("footprint", "pixels"), "o-", "C0"),
    "adaptive, default": (("adaptive", "default"), "*", "C3"),
    "adaptive, by rcs_floor": (("adaptive", "floor"), "D-", "C3"),
}
"""Line and colour by sampling and what is varied."""

WITHIN_MS = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Times of a frame for which the table has errors [ms]."""


def time_rows(points: list[Point]) -> Iterator[list[str]]:
    """Smallest error [%] of every sampling within a time, target by target."""
    for target in dict.fromkeys(p.target for p in points):
        for label, (curve, _, _) in CURVES.items():
            chosen = [p for p in points if p.target == target and (p.way.sampling, p.way.knob) == curve]
            row = [target, label, PAPER if target.startswith(("sphere", "plate")) else DENSE]
            for most in WITHIN_MS:
                errors = [100.0 * p.error for p in chosen if 1e3 * p.seconds <= most]
                row.append(f"{min(errors):.2g}" if errors else "")
            yield row


TARGET_COLORS = ("C2", "C4", "C5", "C9")


def picture(points: list[Point]) -> Figure:
    """Rows: error against time, against rays, and against the settings."""
    targets = list(dict.fromkeys(p.target for p in points))
    figure = Figure(figsize=(3.75 * max(len(targets), 3), 11.5), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=[2.0, 1.1])
    axes = top.subplots(2, len(targets), squeeze=False, sharey=True)
    for column, target in enumerate(targets):
        of_target = [p for p in points if p.target == target]
        for label, (curve, style, color) in CURVES.items():
            chosen = [p for p in of_target if (p.way.sampling, p.way.knob) == curve]
            errors = [100.0 * p.error for p in chosen]
            by_time, by_rays = axes[:, column]
            draw(by_rays, [p.rays for p in chosen], errors, style, color, label)
            draw(by_time, [1e3 * p.seconds for p in chosen], errors, style, color, label)
        by_time.set(title=target, xlabel="time of a frame [ms]")
        by_rays.set(xlabel="rays cast")
    for ax in axes[:, 0]:
        ax.set_ylabel("error of the range profile [%]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    top.legend(handles, labels, loc="outside upper center", ncols=5, fontsize=10)

    by_pixels, by_floor = bottom.subplots(1, 2, sharey=True)
    for target, color in zip(targets, TARGET_COLORS, strict=False):
        for sampling, style in (("footprint", "o-"), ("point", "s:")):
            chosen = [p for p in points if p.target == target and p.way.sampling == sampling]
            label = target if sampling == "footprint" else None
            draw(by_pixels, [p.way.number for p in chosen], [100.0 * p.error for p in chosen], style, color, label)
        chosen = [p for p in points if p.target == target and p.way.knob == "floor"]
        draw(by_floor, [p.way.number for p in chosen], [100.0 * p.error for p in chosen], "D-", color, target)
    by_pixels.set(
        title="footprint (solid) and point (dotted)",
        xlabel="pixels along a side of the image",
        ylabel="error of the range profile [%]",
    )
    by_pixels.set_xscale("log", base=2)
    by_pixels.xaxis.set_major_formatter("{x:g}")
    by_floor.set(title="adaptive", xlabel="rcs_floor [m²]")
    by_floor.invert_xaxis()
    for ax in (by_pixels, by_floor):
        ax.legend(fontsize=9)
    return figure


def draw(ax: Axes, x: list[float], errors: list[float], style: str, color: str, label: str | None = None) -> None:
    ax.plot(x, errors, style, color=color, markerfacecolor="none", markersize=5, label=label)
    ax.set(xscale="log", yscale="log")
    ax.xaxis.set_minor_formatter("")
    ax.yaxis.set_minor_formatter("")
    ax.grid(which="major", alpha=0.3)
