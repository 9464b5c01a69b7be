"""Pictures of frames and depth images: one call each, into given axes or a new figure.

Figures are made without pyplot, so no window opens and no backend changes: save one with
``ax.figure.savefig(path)``, or show it in a notebook by its name (after ``%matplotlib inline``).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check, process
from radarcore.recording import Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MISS = "0.82"
"""Grey of pixels whose ray hit nothing."""


class Image(Protocol):
    """What is drawn of a `DepthImage`: row 0 on top, column 0 on the left."""

    @property
    def distance(self) -> NDArray[Any]:
        """(row, column) distance along the ray [m]; inf where nothing was hit."""

    @property
    def reflectance(self) -> NDArray[Any]:
        """(row, column) reflectance."""

    @property
    def field_of_view_deg(self) -> tuple[float, float]:
        """Horizontal and vertical angle of view [degrees]."""


def depth_image(image: Image, ax: Axes | None = None) -> Axes:
    """Distance of every pixel [m]; what was not hit is grey.

    Parameters
    ----------
    image : DepthImage
    ax : matplotlib Axes, optional
        Default: those of a new figure.

    Returns
    -------
    ax : matplotlib Axes
        Undistorted, marked with azimuth and elevation in degrees, positive to the left and up.
    """
    return _draw_image(image, image.distance, ax, "Distance [m]", "viridis_r", None)


def reflectance_image(image: Image, ax: Axes | None = None) -> Axes:
    """Reflectance of every pixel; what was not hit is grey.

    Parameters and result as `depth_image`.
    """
    return _draw_image(image, image.reflectance, ax, "Reflectance", "magma", 0.0)


def chirp(frame: Frame, channel: int = 0, chirp: int = 0, ax: Axes | None = None) -> Axes:
    """Samples of one chirp over the time since the start of its ramp [us].

    Parameters
    ----------
    frame : Frame
    channel, chirp : int
        Which chirp; negative numbers count from the end.
    ax : matplotlib Axes, optional
        Default: those of a new figure.
    """
    samples = frame.cube[_index("channel", channel, frame.cube.shape[0]), _index("chirp", chirp, frame.cube.shape[1])]
    exponent = _exponent(samples)
    scaled = np.asarray(samples, dtype=np.complex128 if np.iscomplexobj(samples) else np.float64) * 10.0**-exponent
    microseconds = frame.radar.waveform.sample_times * 1e6

    ax = _new_axes() if ax is None else ax
    style: dict[str, Any] = {"linewidth": 1.2, "marker": "." if len(samples) <= 64 else "", "markersize": 4.0}
    if np.iscomplexobj(scaled):
        ax.plot(microseconds, scaled.imag, color="tab:orange", label="Q", **style)
        ax.plot(microseconds, scaled.real, color="tab:blue", label="I", **style)
        ax.legend(*(values[::-1] for values in ax.get_legend_handles_labels()), ncols=2, loc="upper right")
    else:
        ax.plot(microseconds, scaled, color="tab:blue", **style)
    parts = np.abs(np.concatenate([scaled.real, scaled.imag]))
    largest = float(np.max(parts, initial=0.0, where=np.isfinite(parts))) or 1.0
    ax.set_ylim(-1.1 * largest, (1.35 if np.iscomplexobj(scaled) else 1.1) * largest)  # room for the legend
    ax.margins(x=0.0)
    ax.grid(alpha=0.3)
    ax.set_xlabel("Time since start of ramp [µs]")
    unit = r"\sqrt{\mathrm{W}}"
    ax.set_ylabel(f"Amplitude [${unit}$]" if exponent == 0 else rf"Amplitude [$10^{{{exponent}}}\,{unit}$]")
    return ax


def range_profile(
    frame: Frame,
    channel: int | None = None,
    ax: Axes | None = None,
    *,
    dynamic_range_db: float = 60.0,
    max_range: float | None = None,
) -> Axes:
    """Power over range, averaged over chirps [dB below the largest].

    Parameters as `range_doppler_map`.
    """
    floor, last = _view(frame, dynamic_range_db, max_range)
    wf = frame.radar.waveform
    n = _padded(wf.num_samples)
    profile = process.range_profile(_channels(frame, channel), wf, num_bins=n)
    level = _relative_db((np.abs(profile) ** 2).sum(axis=(0, 1)), floor)
    ax = _new_axes() if ax is None else ax
    ax.plot(wf.range_axis(n)[: len(level)], level, color="tab:blue", linewidth=1.4)
    ax.set_xlim(0.0, last)
    ax.set_ylim(floor, 3.0)
    ax.grid(alpha=0.3)
    ax.set_xlabel("Range [m]")
    ax.set_ylabel("Power [dB re maximum]")
    return ax


def range_doppler_map(
    frame: Frame,
    channel: int | None = None,
    ax: Axes | None = None,
    *,
    dynamic_range_db: float = 60.0,
    max_range: float | None = None,
) -> Axes:
    """Power over range [m] and velocity [m/s, receding positive], in dB below the largest; truth as crosses.

    Parameters
    ----------
    frame : Frame
    channel : int, optional
        One channel; default: the powers of all, added.
    ax : matplotlib Axes, optional
        Default: those of a new figure.
    dynamic_range_db : float
        What is further below the maximum has the colour of the floor [dB].
    max_range : float, optional
        End of the range axis [m]; default: the largest unambiguous range.
    """
    floor, last = _view(frame, dynamic_range_db, max_range)
    wf = frame.radar.waveform
    num_range, num_velocity = _padded(wf.num_samples), _padded(wf.num_chirps)
    spectrum = process.range_doppler(
        _channels(frame, channel), wf, num_range_bins=num_range, num_velocity_bins=num_velocity
    )
    level = _relative_db((np.abs(spectrum) ** 2).sum(axis=0), floor).T  # (range, doppler)

    ax = _new_axes() if ax is None else ax
    velocities, ranges = wf.velocity_axis(num_velocity), wf.range_axis(num_range)[: len(level)]
    extent = (*_edges(velocities, 2.0 * wf.max_velocity), *_edges(ranges, wf.max_range))
    picture = ax.imshow(
        level, extent=extent, origin="lower", aspect="auto", cmap=_color_map("inferno"), vmin=floor, vmax=0.0
    )
    ax.set_xlim(-wf.max_velocity, wf.max_velocity)
    ax.set_ylim(0.0, last)
    ax.set_xlabel("Velocity [m/s, receding positive]")
    ax.set_ylabel("Range [m]")
    _color_bar(ax, picture, "Power [dB re maximum]")
    if frame.truth is not None:
        _mark(ax, frame.truth.velocity, frame.truth.range, frame.truth.names)
    return ax


def overview(
    frame: Frame,
    image: Image | None,
    path: str | os.PathLike[str] | None = None,
    *,
    max_range: float | None = None,
) -> Figure:
    """One frame at a glance: depth, reflectance, one chirp, and power over range and velocity, truth as crosses.

    Parameters
    ----------
    frame : Frame
        A frame of a single chirp, or of unevenly spaced ones, shows power over range alone.
    image : DepthImage or None
        What the radar sees; None (a measured frame): without the two images.
    path : path, optional
        Save here, in the format of the suffix; missing parents are made.
    max_range : float, optional
        End of the range axis [m]; default: the largest unambiguous range.

    Returns
    -------
    figure : matplotlib Figure
    """
    wf = frame.radar.waveform
    figure = _new_figure(11.0, 8.2 if image is not None else 4.4)
    panels = list(figure.subplots(2 if image is not None else 1, 2).flat)
    truth = frame.truth
    figure.suptitle(
        f"t = {frame.time:.3f} s   ·   {wf.center_frequency / 1e9:.2f} GHz   ·   "
        f"bandwidth {wf.bandwidth / 1e9:.2f} GHz   ·   range bin {100.0 * wf.range_resolution:.1f} cm",
        fontsize=11,
        color="0.35",
    )

    # What the radar sees.
    if image is not None:
        depth_image(image, panels[0]).set_title("Depth")
        reflectance_image(image, panels[1]).set_title("Reflectance")

    # What it measures.
    chirp(frame, ax=panels[-2]).set_title("First chirp, channel 0")
    if wf.num_chirps > 1 and wf.has_uniform_chirps:
        range_doppler_map(frame, ax=panels[-1], max_range=max_range).set_title("Range and velocity")
    else:
        range_profile(frame, ax=panels[-1], max_range=max_range).set_title("Range")
    if image is not None and truth is not None:
        for ax in panels[:2]:
            _mark(ax, np.tan(truth.azimuth), np.tan(truth.elevation) / np.cos(truth.azimuth), truth.names)

    if path is not None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
    return figure


def _draw_image(
    image: Image, values: NDArray[Any], ax: Axes | None, label: str, colors: str, lowest: float | None
) -> Axes:
    """Pixels on the image plane (y/x, z/x), which keeps planes straight; ticks where whole degrees lie."""
    values = np.asarray(values, dtype=np.float64)
    hit = np.isfinite(np.asarray(image.distance)) & np.isfinite(values)
    if values.ndim != 2:
        raise ValueError(f"image: expected arrays of shape (row, column), got {values.shape}")
    widths = check.array("field_of_view_deg", image.field_of_view_deg, (2,))
    if not ((widths > 0.0) & (widths < 180.0)).all():
        raise ValueError(f"field_of_view_deg: expected two angles between 0 and 180 degrees, got {widths.tolist()}")
    shown = values[hit]
    low = float(shown.min(initial=np.inf)) if lowest is None else lowest
    high = float(shown.max(initial=-np.inf))
    if not low < high:  # nothing hit, or all alike
        low, high = (low, low + 1.0) if np.isfinite(low) else (0.0, 1.0)

    ax = _new_axes() if ax is None else ax
    half_width, half_height = np.tan(np.deg2rad(widths) / 2.0)
    picture = ax.imshow(
        np.ma.masked_array(values, ~hit),
        extent=(half_width, -half_width, -half_height, half_height),
        cmap=_color_map(colors),
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    for axis, width in ((ax.xaxis, widths[0]), (ax.yaxis, widths[1])):
        step = next((step for step in (1, 2, 5, 10, 15, 20, 30) if width / step <= 6.5), 45)
        degrees = step * np.arange(-int(width / 2 / step), int(width / 2 / step) + 1)
        axis.set_ticks(
            np.tan(np.deg2rad(degrees)), [f"{degree:d}".replace("-", "\N{MINUS SIGN}") for degree in degrees]
        )
    ax.set_xlabel("Azimuth [°]")
    ax.set_ylabel("Elevation [°]")
    _color_bar(ax, picture, label)
    return ax


def _mark(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], names: tuple[str, ...]) -> None:
    """Crosses with names where points are in view; a name goes where it covers no other, or is left out."""
    from matplotlib.patheffects import withStroke
    from matplotlib.transforms import Bbox

    # Keep what is in view; NaN is not.
    (left, right), (bottom, top) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    points = [(a, b, name) for a, b, name in zip(x, y, names, strict=True) if left <= a <= right and bottom <= b <= top]
    outline = [withStroke(linewidth=2.5, foreground="black")]
    for a, b, _ in points:
        ax.plot([a], [b], marker="+", color="white", markersize=8.0, markeredgewidth=1.2, path_effects=outline)

    # Try places to the right, left, above and below, further and further off, measured on the finished layout.
    figure = ax.get_figure(root=True)
    if not points or figure is None:
        return
    figure.draw_without_rendering()
    pixels = figure.dpi / 72.0
    view = ax.get_window_extent()
    taken = [
        Bbox.from_extents(*(c - 5 * pixels), *(c + 5 * pixels)) for c in ax.transData.transform([p[:2] for p in points])
    ]
    places = [
        place
        for gap in (7, 18, 30)
        for place in (
            (gap, 0, "left", "center"),
            (-gap, 0, "right", "center"),
            (0, gap, "center", "bottom"),
            (0, -gap, "center", "top"),
        )
    ]
    for a, b, name in points:
        for dx, dy, horizontal, vertical in places:
            label = ax.annotate(
                name,
                (a, b),
                (dx, dy),
                textcoords="offset points",
                horizontalalignment=horizontal,
                verticalalignment=vertical,
                fontsize=9,
                color="white",
                path_effects=outline,
                parse_math=False,
            )
            label.set_in_layout(False)
            box = label.get_window_extent()
            inside = view.x0 <= box.x0 and box.x1 <= view.x1 and view.y0 <= box.y0 and box.y1 <= view.y1
            if inside and not box.count_overlaps(taken):
                taken.append(box)
                break
            label.remove()


def _color_map(name: str) -> Any:
    """Colour map with grey for what is missing."""
    from matplotlib import colormaps

    return colormaps[name].with_extremes(bad=_MISS)


def _color_bar(ax: Axes, picture: Any, label: str) -> None:
    """Colour bar as high as the axes."""
    figure = ax.get_figure(root=True)
    if figure is not None:
        figure.colorbar(picture, cax=ax.inset_axes((1.03, 0.0, 0.04, 1.0)), label=label)


def _new_axes() -> Axes:
    return _new_figure(6.4, 4.8).add_subplot()


def _new_figure(width: float, height: float) -> Figure:
    """Figure of a size in inches, not known to pyplot."""
    try:
        from matplotlib.figure import Figure
        from matplotlib.layout_engine import ConstrainedLayoutEngine
    except ImportError as error:
        raise ImportError("pictures need matplotlib: pip install radarcore[plot]") from error
    return Figure(figsize=(width, height), dpi=100, layout=ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.08))


def _view(frame: Frame, dynamic_range_db: float, max_range: float | None) -> tuple[float, float]:
    """Floor of the levels [dB] and end of the range axis [m]."""
    floor = -check.positive("dynamic_range_db", dynamic_range_db, "dB")
    unambiguous = frame.radar.waveform.max_range * (2.0 if np.iscomplexobj(frame.cube) else 1.0)
    return floor, unambiguous if max_range is None else min(check.positive("max_range", max_range, "m"), unambiguous)


def _channels(frame: Frame, channel: int | None) -> NDArray[Any]:
    """One channel or all, (channel, chirp, sample)."""
    if channel is None:
        return frame.cube
    index = _index("channel", channel, len(frame.cube))
    return frame.cube[index : index + 1]


def _index(name: str, value: int, length: int) -> int:
    """Index from the start."""
    index = check.count(name, value, -length)
    if index >= length:
        raise ValueError(f"{name}: expected an index below {length}, got {index}")
    return index % length


def _padded(length: int) -> int:
    """Length of a transform that shows as a smooth picture."""
    return max(length, min(4 * length, 2048))


def _relative_db(power: NDArray[Any], floor: float) -> NDArray[np.float64]:
    """Level below the maximum, not below `floor` [dB]; silence lies on the floor."""
    largest = np.max(power, initial=0.0, where=np.isfinite(power))
    relative = np.asarray(power, dtype=np.float64) / (largest if largest > 0.0 else 1.0)
    return np.asarray(10.0 * np.log10(np.maximum(relative, 10.0 ** (floor / 10.0))))


def _edges(centres: NDArray[np.float64], width: float) -> tuple[float, float]:
    """Outer edges of equal cells; `width` is that of a single one."""
    half = 0.5 * (centres[1] - centres[0] if len(centres) > 1 else width)
    return float(centres[0] - half), float(centres[-1] + half)


def _exponent(samples: NDArray[Any]) -> int:
    """Power of ten, a multiple of three, in which the samples are plain numbers."""
    largest = float(np.max(np.abs(samples), initial=0.0, where=np.isfinite(samples)))
    return 0 if largest == 0.0 else 3 * int(np.floor(np.log10(largest) / 3.0))
