"""Figures of a comparison: maps side by side, and ranges and velocities over time on top of the truth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.comparison.record import Record, Side
from radarcore.plot import canvas, history
from radarcore.plot import frame as frame_pictures
from radarcore.plot.canvas import Name
from radarcore.recording.frame import TRUTH_FIELDS, Frame, Truth
from radarcore.recording.recording import usual_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

_COLORS = (canvas.COLORS[0], canvas.COLORS[1])
"""Colours of recordings A and B."""

_MARKERS: tuple[dict[str, Any], ...] = (
    {"marker": "o", "fillstyle": "none", "markersize": 4.5},
    {"marker": ".", "markersize": 4.0},
)
"""Rings of A around the dots of B."""

_OWN_BINS = 3.0
"""Range bins where leakage of the transmitter is stronger than echoes."""

_LEAST_SPAN_DB = 30.0
"""Least span of the colours of a map [dB]."""

_ROOM = 1.15
"""End of the axes relative to the targets."""


def draw(
    comparison: Record,
    path: str | os.PathLike[str] | None,
    *,
    time: float | None = None,
    max_range: float | None = None,
    overwrite: bool = False,
) -> Figure:
    """The figure of `Comparison.figure`."""
    canvas.picture(path, overwrite)
    sides = comparison.sides
    when = _middle(sides) if time is None else _within(sides, check.number("time", time, "s"))
    end = _range_end(comparison) if max_range is None else check.positive("max_range", max_range, "m")
    figure = canvas.new_figure(12.0, 10.0)
    grid = figure.add_gridspec(3, 1, height_ratios=[1.25, 1.0, 1.0])
    maps = grid[0].subgridspec(1, len(sides))

    # The maps nearest in time, with the truth as crosses.
    named: list[tuple[Axes, list[Name]]] = []
    pictures: list[AxesImage] = []
    fastest = _velocity_end(comparison)
    for k, side in enumerate(sides):
        ax = figure.add_subplot(maps[k])
        frame = _frame(comparison, side, when)
        wf = frame.radar.waveform
        if wf.num_chirps > 1 and wf.has_uniform_chirps:
            named.append((ax, frame_pictures.draw_map(ax, frame, max_range=end, max_velocity=fastest)))
            _show_targets(ax, side)
            pictures += ax.images
        else:
            frame_pictures.range_profile(frame, ax=ax, max_range=end)
        ax.set_title(f"{side.name}, {frame.time:.3f} s", color=_COLORS[k])

    _show_alike(pictures)

    # Both over the truth.
    ranges = figure.add_subplot(grid[1])
    velocities = figure.add_subplot(grid[2], sharex=ranges)
    for ax, quantity, label in ((ranges, "range", "Range [m]"), (velocities, "velocity", "Velocity [m/s]")):
        named.append((ax, _draw_series(ax, comparison, quantity)))
        ax.set_ylabel(label)
        ax.grid(alpha=0.3)
    ranges.set_ylim(0.0, end)
    ranges.set_xlim(*_span(sides))
    ranges.tick_params(labelbottom=False)
    handles, labels = ranges.get_legend_handles_labels()
    ranges.legend(handles, labels, loc="upper right", ncols=len(labels), fontsize=9)
    velocities.set_xlabel("Time [s]")
    figure.align_ylabels([ranges, velocities])
    for side, color in zip(sides, _COLORS, strict=False):
        for one in side.dropped:
            for ax in (ranges, velocities):
                ax.plot(one.time, 0.0, "|", color=color, markersize=9.0, transform=ax.get_xaxis_transform())

    # Names are placed last, into the final layout.
    canvas.place_names(*((ax, names, "white" if ax in (ranges, velocities) else "black") for ax, names in named))
    figure.set_layout_engine("none")
    canvas.save(figure, path, overwrite=overwrite)
    return figure


def over_time(comparison: Record, *, max_range: float | None = None) -> Figure:
    """Power of the recordings over common time and range, one below the other."""
    end = _range_end(comparison) if max_range is None else check.positive("max_range", max_range, "m")
    figure = canvas.new_figure(12.0, 3.4 * len(comparison.sides))
    rows: Any = figure.subplots(len(comparison.sides), 1, squeeze=False)[:, 0]
    for ax, side in zip(rows, comparison.sides, strict=True):
        shifted = replace(
            side.recording, time=side.recording.time + side.offset.seconds, truth=_named(comparison, side)
        )
        history.range_time(shifted, ax, max_range=end)
        ax.set_title(side.name)
        ax.set_xlim(*_span(comparison.sides))
    return figure


def _show_targets(ax: Axes, side: Side) -> None:
    """Limit the colours of a map to its strongest echo beyond the leakage."""
    (picture,) = ax.images
    levels: Any = picture.get_array()  # (range, velocity)
    bottom, top = picture.get_extent()[2:]
    ranges = np.linspace(bottom, top, len(levels))
    beyond = levels[(ranges > _OWN_BINS * side.bins[0]) & (ranges < max(ax.get_ylim()))]
    low, high = picture.get_clim()
    if beyond.size > 0 and (largest := float(beyond.max())) < high:
        picture.set_clim(min(low, largest - _LEAST_SPAN_DB), largest)


def _show_alike(pictures: Sequence[AxesImage]) -> None:
    """One scale of colours for maps in dB over noise; levels below the largest of each map are 0 or less."""
    limits = np.array([picture.get_clim() for picture in pictures])
    if all(high > 0.0 for _, high in limits):
        for picture in pictures:
            picture.set_clim(*limits.max(axis=0))


def _draw_series(ax: Axes, comparison: Record, quantity: str) -> list[Name]:
    """Draw truth as lines and estimates as rings and dots; return the names of the targets."""
    names = []
    for target in comparison.targets:
        column = ("range", "velocity").index(quantity)
        if target.truth is not None:
            for side, known in zip(comparison.sides, target.truth, strict=True):
                ax.plot(side.time, known[column], color=canvas.GREY, linewidth=3.5, alpha=0.4, solid_capstyle="round")
        series = zip(comparison.sides, target.estimates, _COLORS, _MARKERS, strict=False)
        for _, found, color, marker in series:
            ax.plot(found.time, getattr(found, quantity), color=color, linestyle="", markeredgewidth=0.9, **marker)
        best = getattr(target.estimates[0], quantity) if target.truth is None else target.truth[0][column]
        names += canvas.line_name(target.name, target.estimates[0].time, best, color="0.2")
    if comparison.truth_source:
        ax.plot([], [], color=canvas.GREY, linewidth=3.5, alpha=0.4, label="truth")
    for side, color, marker in zip(comparison.sides, _COLORS, _MARKERS, strict=False):
        ax.plot([], [], color=color, linestyle="", label=side.name.replace("$", r"\$"), **marker)
    return names


def _frame(comparison: Record, side: Side, time: float) -> Frame:
    """Frame of a recording nearest to a common time, with its common time and the truth of the targets."""
    index = int(np.abs(side.time - time).argmin())
    frame = side.recording[index]
    truth = _named(comparison, side)
    return replace(frame, time=frame.time + side.offset.seconds, truth=None if truth is None else truth[index])


def _named(comparison: Record, side: Side) -> Truth | None:
    """Truth of the compared targets under their names, over the frames of a recording."""
    which = comparison.sides.index(side)
    columns = [
        (target.name, *target.truth[which])
        for target in comparison.targets
        if target.truth is not None and np.isfinite(target.truth[which][0]).any()
    ]
    if not columns:
        return None
    rows = np.full((len(TRUTH_FIELDS), len(side.time), len(columns)), np.nan)
    for k, (_, distance, velocity) in enumerate(columns):
        rows[0, :, k], rows[1, :, k] = distance, velocity
    return Truth(tuple(name for name, *_ in columns), *rows)


def _middle(sides: Sequence[Side]) -> float:
    """Middle of the recordings' overlap, or of A without overlap [s]."""
    first, last = max(side.time[0] for side in sides), min(side.time[-1] for side in sides)
    return float(0.5 * (first + last) if first <= last else sides[0].time.mean())


def _within(sides: Sequence[Side], time: float) -> float:
    """The time [s]; raises ValueError if a recording has no frame near it."""
    for side in sides:
        margin = usual_interval(side.recording)
        first, last = side.time[0] - margin, side.time[-1] + margin
        if not first <= time <= last:
            span = f"{side.time[0]:g} to {side.time[-1]:g} s"
            raise ValueError(f"time: expected one within the frames of {side.name!r}, {span}, got {time:g}")
    return time


def _span(sides: Sequence[Side]) -> tuple[float, float]:
    """Time span from the first to the last frame of all recordings [s]."""
    first, last = min(side.time[0] for side in sides), max(side.time[-1] for side in sides)
    margin = 0.01 * max(float(last - first), 1e-3)
    return float(first) - margin, float(last) + margin


def _range_end(comparison: Record) -> float:
    """End of the range axes: 15 % above the farthest target [m]."""
    known = [values[np.isfinite(values)].max(initial=0.0) for values in _all(comparison, "range")]
    farthest = max(known, default=0.0)
    return float(farthest * _ROOM) if farthest > 0.0 else comparison.sides[0].recording.radar.max_unambiguous_range


def _velocity_end(comparison: Record) -> float:
    """End of the velocity axis: 15 % above the fastest target, at least four bins [m/s]."""
    known = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in _all(comparison, "velocity")]
    return float(max(_ROOM * max(known, default=0.0), 4.0 * max(side.bins[1] for side in comparison.sides)))


def _all(comparison: Record, quantity: str) -> list[NDArray[np.float64]]:
    """All series of a quantity, estimated and true."""
    column = ("range", "velocity").index(quantity)
    estimated = [getattr(one, quantity) for target in comparison.targets for one in target.estimates]
    true = [known[column] for target in comparison.targets for known in target.truth or ()]
    return [*estimated, *true]
