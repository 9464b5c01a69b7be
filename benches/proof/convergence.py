"""Error against time and against the settings of every sampling: a file, docs/accuracy.png and a table."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

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


COLUMNS = ("target", "sampling", "setting", "value", "error", "rays", "time [s]")


def write_points(path: Path, points: list[Point]) -> None:
    """Write all points; the setting is pixels along a side, a floor [m²] or the default."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for p in points:
            numbers = (f"{number:.6g}" for number in (p.way.number, p.error, p.rays, p.seconds))
            writer.writerow((p.target, p.way.sampling, p.way.knob, *numbers))


def read_points(path: Path) -> list[Point]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [Point(row[0], Way(row[1], row[2], float(row[3])), *map(float, row[4:])) for row in rows]


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
    """Above: error against time by target; below: against the settings."""
    targets = list(dict.fromkeys(p.target for p in points))
    figure = Figure(figsize=(3.0 * max(len(targets), 3), 8.0), layout="constrained")
    top, bottom = figure.subfigures(2, 1)
    axes = top.subplots(1, len(targets), squeeze=False, sharex=True, sharey=True)[0]
    for ax, target in zip(axes, targets, strict=True):
        for label, (curve, style, color) in CURVES.items():
            chosen = [p for p in points if p.target == target and (p.way.sampling, p.way.knob) == curve]
            draw(ax, [1e3 * p.seconds for p in chosen], chosen, style, color, label)
        ax.set_title(target)
        ax.xaxis.set(major_locator=LogLocator(subs=(1.0, 2.0, 5.0)), major_formatter="{x:g}", minor_formatter="")
    top.supxlabel("time of a frame [ms]", fontsize="medium")
    top.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(CURVES))

    by_pixels, by_floor = bottom.subplots(1, 2, sharey=True)
    for target, color in zip(targets, TARGET_COLORS, strict=False):
        for sampling, style in (("footprint", "o-"), ("point", "s:")):
            chosen = [p for p in points if p.target == target and p.way.sampling == sampling]
            draw(by_pixels, [p.way.number for p in chosen], chosen, style, color)
        chosen = [p for p in points if p.target == target and p.way.knob == "floor"]
        draw(by_floor, [p.way.number for p in chosen], chosen, "D-", color, target)
    by_pixels.set(title="footprint (solid) and point (dotted)", xlabel="pixels along a side of the image")
    by_pixels.set_xscale("log", base=2)
    by_pixels.xaxis.set_major_formatter("{x:g}")
    by_floor.set(title="adaptive", xlabel="rcs_floor [m²]")
    by_floor.invert_xaxis()
    bottom.legend(*by_floor.get_legend_handles_labels(), loc="outside lower center", ncols=len(targets))
    for ax in (axes[0], by_pixels):
        ax.set_ylabel("error of the range profile [%]")
    return figure


def draw(ax: Axes, x: list[float], points: list[Point], style: str, color: str, label: str | None = None) -> None:
    is_default = style == "*"
    size, face = (14, color) if is_default else (5, "none")
    errors = [100.0 * p.error for p in points]
    ax.plot(x, errors, style, color=color, markerfacecolor=face, markersize=size, label=label, zorder=3 + is_default)
    ax.set(xscale="log", yscale="log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.grid(which="major", alpha=0.3)
