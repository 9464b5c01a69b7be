"""Canvas of all pictures: figures, colours, names that keep apart, and levels in decibels."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.output import check_file, new_file
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radarcore.processing.detection.point_cloud import Detections

_MISS = "0.82"
"""Grey of pixels without a value."""

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours that stay apart for colour-blind eyes (Okabe and Ito, Color Universal Design, 2008)."""

GREY = "0.45"
"""Colour of what needs none."""

SHOWN_DPI, WRITTEN_DPI = 100, 150
"""Dots per inch of figures, and of what is written of them."""


class Name(NamedTuple):
    """A name to be put near a point of the data, or near or in a box around it."""

    x: float
    y: float
    text: str
    color: str = "white"
    size: tuple[float, float] = (0.0, 0.0)
    """Width and height of the box."""


def new_axes() -> Axes:
    """Axes of a new figure."""
    return new_figure(6.4, 4.8).add_subplot()


def require() -> None:
    """Refuse to go on without matplotlib, before work is done whose picture cannot be drawn.

    See Also
    --------
    plot.overview : A picture.

    Examples
    --------
    >>> rc.plot.require() is None  # nothing happens where matplotlib is installed
    True
    """
    try:
        import_module("matplotlib.figure")
    except ImportError as error:
        raise ImportError("pictures need matplotlib: pip install radarcore[plot]") from error


def new_figure(width: float, height: float, *, dpi: int = SHOWN_DPI) -> Figure:
    """Figure of a size in inches, not known to pyplot, that can be drawn without a window."""
    require()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from radarcore.plot.layout import Layout

    figure = Figure(figsize=(width, height), dpi=dpi, layout=Layout(w_pad=0.12, h_pad=0.08))
    FigureCanvasAgg(figure)  # keeps its renderer; the canvas of a bare figure makes one for every text that is measured
    return figure


def lay_out(figure: Figure) -> None:
    """Give everything its place, as `Figure.draw_without_rendering` does in twice the time."""
    engine = figure.get_layout_engine()
    if engine is None or any(ax.get_axes_locator() for ax in figure.axes):  # in a figure that was given
        figure.draw_without_rendering()
        return
    engine.execute(figure)
    for ax in figure.axes:
        ax.apply_aspect()


def dpi_for(path: str | os.PathLike[str] | None) -> int:
    """Dots per inch of a figure that will be saved, if anywhere: then its layout is made once, for the file."""
    return SHOWN_DPI if path is None else WRITTEN_DPI


def picture(path: str | os.PathLike[str] | None, overwrite: bool) -> Path | None:
    """Checked path of a picture; a name without a suffix gets matplotlib's default."""
    if path is None:
        return None
    from matplotlib import rcParams

    file = Path(path)
    file = file if file.suffix else file.with_name(f"{file.name}.{rcParams['savefig.format']}")
    check_file(file, overwrite=overwrite)
    return file


def save(
    figure: Figure, path: str | os.PathLike[str] | None, *, overwrite: bool = False, is_laid_out: bool = False
) -> None:
    """Write a figure, if anywhere; missing parents are made. One that was made for the file is then one to be shown."""
    if (file := picture(path, overwrite)) is not None:
        with new_file(file, overwrite=overwrite) as part:
            write(figure, part, dpi=WRITTEN_DPI, is_laid_out=is_laid_out)
        figure.dpi = SHOWN_DPI


def write(figure: Figure, target: str | os.PathLike[str] | IO[bytes], *, dpi: int, is_laid_out: bool = False) -> None:
    """Write a figure as `Figure.savefig` does, which draws all of it once more where it has the layout to make.

    One that has its layout, at these dots per inch, keeps it.
    """
    from matplotlib import rcParams

    engine, own_dpi = figure.get_layout_engine(), figure.dpi
    if rcParams["figure.autolayout"] or rcParams["figure.constrained_layout.use"]:  # then None is no way to have none
        figure.savefig(target, dpi=dpi)
        return
    try:
        if not (is_laid_out and own_dpi == dpi):
            figure.dpi = dpi
            lay_out(figure)
        figure.set_layout_engine(None)
        figure.savefig(target, dpi=dpi)
    finally:
        figure.set_layout_engine(engine)
        figure.dpi = own_dpi


def color_map(name: str) -> Any:
    """Colour map with grey for what is missing."""
    from matplotlib import colormaps

    return colormaps[name].with_extremes(bad=_MISS)


def entitle(ax: Axes, text: str, **style: Any) -> None:
    """Title right above axes of our own; `Axes.set_title` measures them and what is beside them to find that place.

    It does not make way for an axis on top, which axes that are given, or that others go on with, may have.
    """
    ax.set_title(text, y=1.0, **style)


def color_bar(ax: Axes, picture: Any, label: str) -> None:
    """Colour bar as high as the axes."""
    figure = ax.get_figure(root=True)
    if figure is not None:
        figure.colorbar(picture, cax=ax.inset_axes((1.03, 0.0, 0.04, 1.0)), label=label)


def color_cycle(names: Iterable[str], given: Mapping[str, str] | None = None) -> dict[str, str]:
    """A colour for every name, in turn; those given stay."""
    known = dict(given or {})
    return known | dict(zip((name for name in names if name not in known), itertools.cycle(COLORS), strict=False))


def thing(name: str) -> str:
    """Owner of a body: the arm of ``arm/forearm_link``, the body itself otherwise."""
    return name.partition("/")[0]


def once_per_thing(names: Sequence[Name]) -> list[Name]:
    """The parts of one thing named together, at the first of them."""
    parts = Counter(thing(name.text) for name in names)
    first = {thing(name.text): name for name in reversed(names)}
    return [name if parts[of] == 1 else name._replace(text=of) for of, name in reversed(first.items())]


def place_names(ax: Axes, names: Sequence[Name], *, outline: str = "black", above_first: bool = False) -> None:
    """Names where each covers no other and no point, or not at all; limits must be final.

    Tries the inside of its box, then places to the right, left, above and below (or above and below first),
    further and further off, and takes the one that hides the least of the lines. Parts of one thing are named once.
    """
    figure = ax.get_figure(root=True)
    if names and figure is not None:
        lay_out(figure)
        place_names_in_layout(ax, names, outline=outline, above_first=above_first)


def place_names_in_layout(
    ax: Axes, names: Sequence[Name], *, outline: str = "black", above_first: bool = False
) -> None:
    """Names as `place_names` puts them, in a figure that has its layout: names do not change it, and it takes long."""
    names = once_per_thing(names)
    from matplotlib.patheffects import withStroke
    from matplotlib.transforms import Bbox

    figure = ax.get_figure(root=True)
    if not names or figure is None:
        return
    pixels = figure.dpi / 72.0
    view = ax.get_window_extent()
    points = np.array([(name.x, name.y) for name in names])
    halves = 0.5 * np.array([name.size for name in names])
    centres = ax.transData.transform(points)
    reaches = np.abs(ax.transData.transform(points + halves) - centres)
    boxes = [
        Bbox.from_extents(*(centre - np.maximum(reach, 5 * pixels)), *(centre + np.maximum(reach, 5 * pixels)))
        for centre, reach in zip(centres, reaches, strict=True)
    ]
    placed: list[Bbox] = []
    sides = [(1, 0, "left", "center"), (-1, 0, "right", "center"), (0, 1, "center", "bottom"), (0, -1, "center", "top")]
    if above_first:
        sides = sides[2:] + sides[:2]
    places = [(0, (0, 0, "center", "center")), *itertools.product((7, 18, 30), sides)]
    drawn = _corners_drawn(ax)
    for k, name in enumerate(names):
        taken = placed + [box for i, box in enumerate(boxes) if i != k]
        label = ax.annotate(
            name.text,
            (name.x, name.y),
            (0, 0),
            textcoords="offset points",
            fontsize=9,
            color=name.color,
            path_effects=[withStroke(linewidth=2.5, foreground=outline)],
            parse_math=False,
            annotation_clip=False,  # or a name whose point is out of view would have no size
        )
        label.set_in_layout(False)
        size = np.array(label.get_window_extent().size)  # the same wherever it is
        label.set_annotation_clip(None)
        best: tuple[int, tuple[Any, ...], Bbox] | None = None
        for gap, (right, up, horizontal, vertical) in places:
            towards = np.array([right, up])
            beside = ax.transData.transform(points[k] + towards * halves[k])
            middle = beside + towards * (gap * pixels + 0.5 * size)
            box = Bbox([middle - 0.5 * size, middle + 0.5 * size])
            is_free = _lies_within(box, view if gap > 0 else boxes[k]) and not box.count_overlaps(taken)
            if is_free and ax.contains_point((beside[0], beside[1])):
                hidden = int(((drawn > box.min) & (drawn < box.max)).all(axis=1).sum())
                if best is None or hidden < best[0]:
                    best = hidden, (gap, right, up, horizontal, vertical), box
        if best is None:
            label.remove()
            continue
        _, (gap, right, up, horizontal, vertical), box = best
        label.xy = (name.x + right * halves[k, 0], name.y + up * halves[k, 1])
        label.set(position=(gap * right, gap * up), horizontalalignment=horizontal, verticalalignment=vertical)
        placed.append(box)


def _corners_drawn(ax: Axes) -> NDArray[np.float64]:
    """Corners of all lines and outlines, (n, 2) pixels; NaN where a line is interrupted."""
    lines = [ax.transData.transform(line.get_xydata()) for line in ax.lines]
    outlines = [patch.get_transform().transform(patch.get_path().vertices) for patch in ax.patches]
    return np.concatenate([np.empty((0, 2)), *lines, *outlines])


def _lies_within(box: Any, frame: Any) -> bool:
    """True when one box is inside another."""
    return bool(frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1)


class Scale(NamedTuple):
    """Scale of levels in decibels."""

    reference: float
    """Power of 0 dB."""
    low: float
    high: float
    label: str

    def level_db(self, power: NDArray[Any]) -> NDArray[np.float64]:
        """Levels, not below the lowest [dB]; silence lies there."""
        relative = np.asarray(power, dtype=np.float64) / self.reference
        return np.asarray(10.0 * np.log10(np.maximum(relative, 10.0 ** (self.low / 10.0))))


def scale(power: NDArray[Any], noise: float | None, dynamic_range_db: float | None) -> Scale:
    """Scale of a picture of powers.

    In dB over the mean power of the noise where it is known, from there up to the strongest, at least to 30 dB, so that
    noise alone is dark; else in dB below the largest power, down to a floor that the label says.

    Parameters
    ----------
    power : array
    noise : float or None
        Mean power of the noise in a cell; None: not known.
    dynamic_range_db : float or None
        Largest span of levels [dB]. None: 60, and not deeper than the noise, which is then the median less 3 dB.
    """
    most = 60.0 if dynamic_range_db is None else check.positive("dynamic_range_db", dynamic_range_db, "dB")
    shown = power[np.isfinite(power) & (power > 0.0)]
    largest = float(shown.max(initial=0.0)) or 1.0
    if noise is not None:
        high = max(30.0, 10.0 * np.log10(largest / noise))
        return Scale(noise, max(0.0, high - most), high, "Power [dB over noise]")
    low = -most
    if dynamic_range_db is None and shown.size > 0:
        low = float(np.clip(10.0 * np.log10(np.median(shown) / largest) - 3.0, -60.0, -20.0))
    return Scale(largest, low, 0.0, f"Power [dB re maximum, floor {low:.0f}]".replace("-", "\N{MINUS SIGN}"))


def stands_out(power: NDArray[Any], axis: int | None = None) -> NDArray[np.bool_]:
    """Cells of what is worth a look: 15 dB over the median power and within 40 dB of the largest.

    With an axis: the cells of the other one in which there is any.
    """
    shown = power[np.isfinite(power)]
    largest, median = (shown.max(), np.median(shown)) if shown.size > 0 else (0.0, 0.0)
    is_there = (power >= max(10.0**1.5 * median, 1e-4 * largest)) & (power > 0.0)
    return np.asarray(is_there if axis is None else is_there.any(axis=axis))


def reach(values: NDArray[np.float64], is_there: NDArray[np.bool_], known: Iterable[float], margin: float) -> float:
    """Largest magnitude of an axis at which something is there or known to be, and a fifth more; inf without any.

    Parameters
    ----------
    values : (cell,) array
        The axis.
    is_there : (cell,) array of bool
    known : iterable of float
        Values that must be in view; NaN is not.
    margin : float
        Least room around it.
    """
    magnitudes = [*np.abs(values[is_there]), *(abs(value) for value in known if np.isfinite(value))]
    largest = max(magnitudes, default=np.inf)
    return largest + max(0.2 * largest, margin)


def last_range(frame: Frame | Recording, max_range: float | None) -> float:
    """End of the range axis [m]."""
    unambiguous = frame.radar.waveform.max_range * (2.0 if np.iscomplexobj(frame.cube) else 1.0)
    return unambiguous if max_range is None else min(check.positive("max_range", max_range, "m"), unambiguous)


def range_end(
    frame: Frame | Recording,
    max_range: float | None,
    ranges: NDArray[np.float64],
    is_there: NDArray[np.bool_],
    detections: Detections | None = None,
) -> float:
    """End of the range axis [m]: `max_range`, or a little beyond all echoes, detections and bodies.

    Without truth, as of a sensor, the largest range of the radar: weak echoes may be anywhere.
    """
    last = last_range(frame, max_range)
    if max_range is not None or frame.truth is None:
        return last
    known = [value for value in frame.truth.range.flat if value <= last]
    known += [] if detections is None else detections.range.tolist()
    return min(last, reach(ranges, is_there, known, 10.0 * frame.radar.waveform.range_resolution))


def velocity_end(
    frame: Frame | Recording,
    max_velocity: float | None,
    velocities: NDArray[np.float64],
    is_there: NDArray[np.bool_],
    detections: Detections | None = None,
) -> float:
    """End of the velocity axis to either side [m/s], as `range_end`."""
    wf = frame.radar.waveform
    if max_velocity is not None:
        return min(check.positive("max_velocity", max_velocity, "m/s"), wf.max_velocity)
    if frame.truth is None:
        return wf.max_velocity
    known = [value for value in frame.truth.velocity.flat if abs(value) <= wf.max_velocity]
    known += [] if detections is None else detections.velocity.tolist()
    return min(wf.max_velocity, reach(velocities, is_there, known, 3.0 * wf.velocity_resolution))


def padded(length: int) -> int:
    """Length of a transform that shows as a smooth picture; odd, so that velocities fill their axis to both ends."""
    return max(length, min(4 * length, 2048)) | 1


def edges(centres: NDArray[np.float64], width: float) -> tuple[float, float]:
    """Outer edges of equal cells; `width` is that of a single one."""
    half = 0.5 * (centres[1] - centres[0] if len(centres) > 1 else width)
    return float(centres[0] - half), float(centres[-1] + half)
