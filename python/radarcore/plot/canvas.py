"""Canvas of all pictures: figures, colours, names without overlap, and levels in decibels."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

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

Floats = NDArray[np.float64]

_MISS = "0.82"
"""Grey of pixels without a value."""

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours that colour-blind readers can distinguish (Okabe and Ito, Color Universal Design, 2008)."""

GREY = "0.45"
"""Colour of what needs none."""

_PER_SEGMENT = 8
"""Points of each segment of a line that names keep off."""

_SHOWN_DPI, _WRITTEN_DPI = 100, 150
"""Dots per inch of figures, and of what is written of them."""


class Name(NamedTuple):
    """A name to be put near a point of the data."""

    x: float
    y: float
    text: str
    color: str = "white"


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


def new_figure(width: float, height: float) -> Figure:
    """Figure of a size in inches, not known to pyplot, that can be drawn without a window."""
    require()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=_SHOWN_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def picture(path: str | os.PathLike[str] | None, overwrite: bool) -> Path | None:
    """Checked path of a picture; a name without a suffix gets matplotlib's default."""
    if path is None:
        return None
    from matplotlib import rcParams

    file = Path(path)
    file = file if file.suffix else file.with_name(f"{file.name}.{rcParams['savefig.format']}")
    check_file(file, overwrite=overwrite)
    return file


def save(figure: Figure, path: str | os.PathLike[str] | None, *, overwrite: bool = False) -> None:
    """Write a figure, if anywhere; missing parents are made."""
    if (file := picture(path, overwrite)) is not None:
        with new_file(file, overwrite=overwrite) as part:
            figure.savefig(part, dpi=_WRITTEN_DPI)


def color_map(name: str) -> Any:
    """Colour map with grey for what is missing."""
    from matplotlib import colormaps

    return colormaps[name].with_extremes(bad=_MISS)


def outlined(width: float, color: str = "black") -> list[Any]:
    """Path effects of lines and letters with an outline."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground=color)]


def with_minus(text: str) -> str:
    """Text with a minus sign in place of a hyphen."""
    return text.replace("-", "\N{MINUS SIGN}")


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


def line_name(
    text: str, x: Floats, y: Floats, limits: tuple[float, float] = (-np.inf, np.inf), color: str = GREY
) -> list[Name]:
    """The name in the middle of the part of a line whose y is within limits; none where no part is."""
    (shown,) = np.nonzero((y >= limits[0]) & (y <= limits[1]))
    return [Name(float(x[at]), float(y[at]), text, color) for at in shown[len(shown) // 2 :][:1]]


def place_names(*named: tuple[Axes, Sequence[Name], str]) -> None:
    """Names of axes of one figure, beside their points and outlined in a colour; limits must be final.

    A name that would cover another name or a point everywhere is left out. Each takes the free place that hides the
    least of the lines. Parts of one thing are named once.
    """
    shown = [(ax, once_per_thing(names), outline) for ax, names, outline in named if names]
    if shown and (figure := shown[0][0].get_figure(root=True)) is not None:
        figure.draw_without_rendering()
        for ax, names, outline in shown:
            _place_names(ax, names, outline, figure.dpi)


def _place_names(ax: Axes, names: Sequence[Name], outline: str, dpi: float) -> None:
    """Names of axes in a figure that is laid out."""
    from matplotlib.transforms import Bbox

    view, drawn = ax.get_window_extent(), _corners_drawn(ax)
    reach = 5.0 * dpi / 72.0
    taken = [
        Bbox.from_extents(x - reach, y - reach, x + reach, y + reach)
        for x, y in ax.transData.transform([(name.x, name.y) for name in names])
    ]
    for k, name in enumerate(names):
        label = ax.annotate(
            name.text,
            (name.x, name.y),
            (0, 0),
            textcoords="offset points",
            fontsize=9,
            color=name.color,
            path_effects=outlined(2.5, outline),
            parse_math=False,
        )
        label.set_in_layout(False)
        places: dict[int, tuple[dict[str, Any], Bbox]] = {}
        for gap, (right, up) in itertools.product((7, 18, 30), ((1, 0), (-1, 0), (0, 1), (0, -1))):
            place: dict[str, Any] = {
                "position": (gap * right, gap * up),
                "horizontalalignment": ("center", "left", "right")[right],
                "verticalalignment": ("center", "bottom", "top")[up],
            }
            label.set(**place)
            box = label.get_window_extent()
            others = taken[:k] + taken[k + 1 :]
            if not _lies_within(box, view) or box.count_overlaps(others):
                continue
            hidden = int(((drawn > box.min) & (drawn < box.max)).all(axis=1).sum())
            places.setdefault(hidden, (place, box))
        if not places:
            label.remove()
            continue
        place, box = places[min(places)]
        label.set(**place)
        taken.append(box)


def _corners_drawn(ax: Axes) -> Floats:
    """Points along all lines and corners of outlines, (n, 2) pixels; NaN where a line is interrupted."""
    paths = [line.get_path() for line in ax.lines]
    lines = [ax.transData.transform(path.interpolated(_PER_SEGMENT).vertices) for path in paths if len(path) > 0]
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

    @property
    def colors(self) -> dict[str, Any]:
        """Arguments of matplotlib for pictures of levels."""
        return {"cmap": color_map("inferno"), "vmin": self.low, "vmax": self.high}

    def level_db(self, power: NDArray[Any]) -> Floats:
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
    return Scale(largest, low, 0.0, with_minus(f"Power [dB re maximum, floor {low:.0f}]"))


def stands_out(power: NDArray[Any], axis: int | None = None) -> NDArray[np.bool_]:
    """Cells of what is worth a look: 15 dB over the median power and within 40 dB of the largest.

    With an axis: the cells of the other one in which there is any.
    """
    shown = power[np.isfinite(power)]
    largest, median = (shown.max(), np.median(shown)) if shown.size > 0 else (0.0, 0.0)
    is_there = (power >= max(10.0**1.5 * median, 1e-4 * largest)) & (power > 0.0)
    return np.asarray(is_there if axis is None else is_there.any(axis=axis))


def axis_end(
    frame: Frame | Recording,
    quantity: str,
    most: float | None,
    values: Floats,
    is_there: NDArray[np.bool_],
    detections: Detections | None = None,
) -> float:
    """End of an axis of ranges [m] or of velocities, to either side [m/s].

    That is `most`, or a fifth beyond all echoes, detections and bodies. Without truth, as of a sensor, it is the
    largest value of the radar: weak echoes may be anywhere.

    Parameters
    ----------
    frame : Frame or Recording
    quantity : "range" or "velocity"
    most : float or None
    values : (cell,) array
        The axis.
    is_there : (cell,) array of bool
        Cells with an echo.
    detections : Detections, optional
        They must be in view; NaN is not.
    """
    wf = frame.radar.waveform
    if quantity == "range":
        limit, margin = wf.max_range * (2.0 if np.iscomplexobj(frame.cube) else 1.0), 10.0 * wf.range_resolution
    else:
        limit, margin = wf.max_velocity, 3.0 * wf.velocity_resolution
    if most is not None:
        return min(check.positive(f"max_{quantity}", most, "m" if quantity == "range" else "m/s"), limit)
    if frame.truth is None:
        return limit
    known = [getattr(one, quantity).ravel() for one in (frame.truth, detections) if one is not None]
    sizes = np.abs(np.concatenate([values[is_there], *known]))
    farthest = max(sizes[sizes <= limit].tolist(), default=limit)
    return min(limit, farthest + max(0.2 * farthest, margin))


def padded(length: int) -> int:
    """Length of a transform that shows as a smooth picture; odd, so that velocities fill their axis to both ends."""
    return max(length, min(4 * length, 2048)) | 1


def edges(centres: Floats, width: float) -> tuple[float, float]:
    """Outer edges of equal cells; `width` is the width of a single cell."""
    half = 0.5 * (centres[1] - centres[0] if len(centres) > 1 else width)
    return float(centres[0] - half), float(centres[-1] + half)
