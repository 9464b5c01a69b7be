"""Tracks from above: the ways of targets on the floor plan of the sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.plot import canvas
from radarcore.plot.canvas import Name
from radarcore.processing.tracking.tracks import Track, Tracks
from radarcore.recording.frame import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DEVIATIONS = 2.0
"""Standard deviations that the ellipse at the end of a track shows: the target is inside in 86 % of all cases."""


def tracks_from_above(
    tracks: Tracks, ax: Axes | None = None, *, truth: Truth | None = None, colors: Mapping[str, str] | None = None
) -> Axes:
    """Ways of targets in the sensor frame: x to the right, y up [m], the sensor at the origin.

    Tracks are lines in a colour each from a dot at their first detection, dotted where frames had no detection; at
    their end is an ellipse of two standard deviations. The truth is grey.

    Parameters
    ----------
    tracks : Tracks
        With positions: of detections that have an azimuth.
    ax : matplotlib Axes, optional
        Default: those of a new figure.
    truth : Truth, optional
        Arrays (frame, body).
    colors : dict, optional
        Colours by name, such as ``"track 0"``; default: in turn.

    See Also
    --------
    track : Tracks of a recording.
    plot.tracks : Ranges and velocities over time.
    plot.scene_from_above : The scene.

    Examples
    --------
    >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.1], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
    >>> ax = rc.plot.tracks_from_above(rc.track(found))
    >>> ax.get_xlabel()
    'x [m]'
    """
    check.instance("tracks", tracks, Tracks)
    if any(np.isnan(one.position).all() for one in tracks):
        raise ValueError("tracks: expected tracks with positions, got some of ranges alone, without angles")
    if truth is not None and not isinstance(truth, Truth):
        raise TypeError(f"truth: expected Truth, got {type(truth).__name__}")
    ax = canvas.new_axes() if ax is None else ax
    names = [Name(0.0, 0.0, "radar", "black")]
    if truth is not None:
        names += _draw_truth(ax, truth)
    palette = canvas.color_cycle([f"track {one.id}" for one in tracks], colors)
    for one in tracks:
        name = f"track {one.id}"
        _draw_track(ax, one, palette[name])
        names.append(Name(float(one.position[-1, 0]), float(one.position[-1, 1]), name, palette[name]))
    ax.plot(0.0, 0.0, "o", color="black", markersize=6.0, zorder=6.0)
    ax.margins(0.08)
    ax.autoscale_view()
    ax.set_aspect("equal", adjustable="datalim")  # the limits grow to the shape of the axes
    ax.grid(alpha=0.3)
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    canvas.place_names(ax, names, outline="white")
    return ax


def _draw_track(ax: Axes, track: Track, color: str) -> None:
    """The way of a target, and how well its end is known."""
    from matplotlib.patches import Ellipse

    places = track.position[:, :2]
    seen = np.where(track.is_detected[:, None], places, np.nan)
    ax.plot(*places.T, color=color, linewidth=1.0, linestyle=":", zorder=3.0)
    ax.plot(*seen.T, color=color, linewidth=1.6, zorder=3.0)
    ax.plot(*places[0], ".", color=color, markersize=6.0, zorder=3.0)
    values, vectors = np.linalg.eigh(track.state_covariance[-1, :2, :2])
    width, height = 2.0 * _DEVIATIONS * np.sqrt(values)
    angle = float(np.rad2deg(np.arctan2(vectors[1, 0], vectors[0, 0])))
    end = (float(places[-1, 0]), float(places[-1, 1]))
    ax.add_patch(
        Ellipse(end, float(width), float(height), angle=angle, facecolor=color, alpha=0.25, edgecolor=color, zorder=2.5)
    )


def _draw_truth(ax: Axes, truth: Truth) -> list[Name]:
    """True ways of all bodies, and their names."""
    places = truth.range[..., None] * unit_vectors(truth.azimuth, np.nan_to_num(truth.elevation))
    x, y, _ = map(np.atleast_2d, np.moveaxis(places, -1, 0))
    names = []
    for name, way in zip(truth.names, np.stack([x, y], axis=-1).transpose(1, 0, 2), strict=True):
        known = way[np.isfinite(way).all(axis=1)]
        if len(known) == 0:
            continue
        ax.plot(*way.T, color=canvas.GREY, linewidth=4.0, alpha=0.35, solid_capstyle="round", zorder=2.0)
        middle = known[len(known) // 2]
        names.append(Name(float(middle[0]), float(middle[1]), name, canvas.GREY))
    return names
