"""Pictures of a whole recording over time: ranges, velocities, and tracks against the truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.plot import canvas
from radarcore.processing.spectra.noise import noise_of_picture
from radarcore.processing.spectra.time_frequency import USUAL_LENGTH, RangeTime, Spectrogram
from radarcore.processing.spectra.time_frequency import range_time as power_of_ranges
from radarcore.processing.spectra.time_frequency import spectrogram as power_of_velocities
from radarcore.processing.tracking.tracks import Track, Tracks, assign_to_truth
from radarcore.recording.recording import Recording, middles, usual_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_Floats = NDArray[np.float64]

_MOST_APART = 8
"""Largest number of tracks with distinct colours."""

QUANTITIES = {"range": ("Range [m]", "range_resolution"), "velocity": ("Velocity [m/s]", "velocity_resolution")}
"""Quantities that `tracks` draws: label, and the attribute of `Waveform` that is one bin."""


_MARKERS = (".", "^", "s", "D")
"""Markers of tracks, the next when the colours begin again."""


def range_time(
    recording: Recording,
    ax: Axes | None = None,
    *,
    channel: int | None = None,
    names: Sequence[str] | None = None,
    subtract_mean: bool = False,
    dynamic_range_db: float | None = None,
    max_range: float | None = None,
) -> Axes:
    """Power over time [s] and range [m], in dB over the noise where it is known; the truth as dashed lines.

    Parameters
    ----------
    recording : Recording
        At least one frame.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    channel : int, optional
        One channel; default: the powers of all, added.
    names : sequence of str, optional
        Bodies whose true range is drawn; default: all.
    subtract_mean : bool
        Leave out what stands still throughout, see `radarcore.range_time`.
    dynamic_range_db : float, optional
        Largest range of levels that colours span [dB]; default: 60, and not deeper than the noise.
    max_range : float, optional
        End of the range axis [m]; default: as in `range_doppler_map`.

    See Also
    --------
    range_time : The numbers.
    plot.spectrogram : Velocities over time.
    plot.tracks : Estimates over time.

    Examples
    --------
    >>> ax = rc.plot.range_time(recording, names=["ball"])
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('Time [s]', 'Range [m]')
    """
    check_recording(recording)
    wf = recording.radar.waveform
    found = power_of_ranges(
        recording, channel=channel, subtract_mean=subtract_mean, num_bins=canvas.padded(wf.num_samples)
    )
    ax = canvas.new_axes() if ax is None else ax
    _draw_power(ax, recording, found, found.range, dynamic_range_db)
    end = canvas.axis_end(recording, "range", max_range, found.range, canvas.stands_out(found.power, axis=0))
    title = f"Range{', static echoes removed' if subtract_mean else ''}"
    ax.set(ylim=(0.0, end), title=title, ylabel="Range [m]")
    _draw_truth(ax, recording, "range", names)
    return ax


def spectrogram(
    recording: Recording,
    ax: Axes | None = None,
    *,
    channel: int | None = None,
    window_length: int | None = None,
    overlap: float = 0.5,
    min_range: float | None = None,
    max_range: float | None = None,
    names: Sequence[str] = (),
    subtract_mean: bool = False,
    dynamic_range_db: float | None = None,
    max_velocity: float | None = None,
) -> Axes:
    """Power over time [s] and velocity [m/s, receding positive], in dB over the noise where it is known.

    Parameters
    ----------
    recording : Recording
        At least one frame; its chirps must follow each other at equal intervals within a frame.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    channel, window_length, overlap, min_range, max_range, subtract_mean
        As in `radarcore.processing.spectra.time_frequency`.
    names : sequence of str
        Bodies whose true velocity is drawn as a dashed line; default: none.
    dynamic_range_db : float, optional
        Largest range of levels that colours span [dB]; default: 60, and not deeper than the noise.
    max_velocity : float, optional
        End of the velocity axis to either side [m/s]; default: as in `range_doppler_map`.

    See Also
    --------
    spectrogram : The numbers.
    plot.range_time : Ranges over time.

    Examples
    --------
    >>> ax = rc.plot.spectrogram(recording, max_velocity=2.0)
    >>> print(ax.get_ylabel(), "to", ax.get_ylim()[1])
    Velocity [m/s, receding positive] to 2.0
    """
    check_recording(recording)
    wf = recording.radar.waveform
    usual = wf.num_chirps if wf.num_chirps > 1 else USUAL_LENGTH
    length = usual if window_length is None else check.count("window_length", window_length)
    found = power_of_velocities(
        recording,
        channel=channel,
        window_length=window_length,
        overlap=overlap,
        min_range=min_range,
        max_range=max_range,
        subtract_mean=subtract_mean,
        num_velocity_bins=canvas.padded(length),
    )
    if np.isnan(found.velocity).any():
        raise ValueError("recording: expected windows of several chirps, got a single chirp, which has no velocity")
    ax = canvas.new_axes() if ax is None else ax
    _draw_power(ax, recording, found, found.velocity, dynamic_range_db)
    is_something = canvas.stands_out(found.power, axis=0)
    fastest = canvas.axis_end(recording, "velocity", max_velocity, found.velocity, is_something)
    fastest = min(fastest, canvas.edges(found.velocity, 0.0)[1])  # less than the waveform's for single-chirp frames
    title = f"Spectrogram{', static echoes removed' if subtract_mean else ''}"
    ax.set(ylim=(-fastest, fastest), title=title, ylabel="Velocity [m/s, receding positive]")
    _draw_truth(ax, recording, "velocity", names)
    return ax


def tracks(
    recording: Recording,
    estimates: Mapping[str, Any] | Tracks,
    ax: Axes | None = None,
    quantity: str = "range",
    *,
    colors: Mapping[str, str] | None = None,
) -> Axes:
    """Estimates as dots over the truth as lines, with the errors in the legend.

    Parameters
    ----------
    recording : Recording
        At least one frame; its truth holds for the middle of every frame.
    estimates : dict or Tracks
        By the name of a body (or any other: dots without truth), a dict or an object with arrays `time` [s],
        `range` [m] and `velocity` [m/s, receding positive], (estimate,); NaN where there is none. Without any
        estimates the truth of all bodies is drawn. `Tracks` are drawn in a colour each over the truth of all bodies in
        grey, whose names are at the lines, with open circles where a frame had no detection; each is named for the
        body that it follows, if any. The parts of a person or arm share a name.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    quantity : "range" or "velocity"
    colors : dict, optional
        Colours by name; default: in turn.

    Returns
    -------
    ax : matplotlib Axes
        Errors in the legend are in bins of the waveform, against the truth interpolated to the times of the
        estimates.

    See Also
    --------
    track : Tracks of a recording.
    plot.tracks_from_above : Their ways.
    compare : Errors in tables.

    Examples
    --------
    >>> ax = rc.plot.tracks(recording, {}, quantity="velocity")
    >>> ax.get_ylabel()
    'Velocity [m/s]'
    """
    check_recording(recording)
    check.choice("quantity", quantity, tuple(QUANTITIES))
    if isinstance(estimates, Tracks):
        return _draw_tracks(recording, estimates, ax, quantity, colors)
    ax = draw_estimates(recording, estimates, ax, quantity, colors)
    add_legends(ax)
    return ax


def draw_estimates(
    recording: Recording, estimates: object, ax: Axes | None, quantity: str, colors: Mapping[str, str] | None
) -> Axes:
    """Draw `tracks` of a dict without the legend."""
    label, bin_name = QUANTITIES[quantity]
    if not isinstance(estimates, Mapping):
        raise TypeError(f"estimates: expected a dict of tracks by name, got {type(estimates).__name__}")
    wf = recording.radar.waveform
    truth_time = middles(recording)
    points = {name: _track(name, track, quantity) for name, track in estimates.items()}
    truth = _truth(recording, quantity, None)
    ax = canvas.new_axes() if ax is None else ax
    if not points:
        return _finished(_draw_all_truth(ax, truth_time, truth, colors), recording, label)
    palette = canvas.color_cycle(points, colors)
    for name in points:
        time, values = points[name]
        text = _plain(name)
        if name in truth:
            ax.plot(truth_time, truth[name], color=palette[name], linewidth=4.0, alpha=0.35, solid_capstyle="round")
            text += _error_text(_errors(time, values, truth_time, truth[name]) / getattr(wf, bin_name))
        ax.plot(time, values, ".", color=palette[name], label=text, markersize=4.5)
    return _finished(ax, recording, label)


def add_legends(*axes: Axes) -> None:
    """Legends at the top of axes of one figure, in the most columns that fit, above all drawn objects."""
    shown = [ax for ax in axes if ax.get_legend_handles_labels()[0]]
    for ax in shown:
        ax.margins(y=0.08)
    if shown and (figure := shown[0].get_figure(root=True)) is not None:
        figure.draw_without_rendering()
        for ax in shown:
            _add_legend(ax, figure.dpi)


def _draw_all_truth(ax: Axes, time: _Floats, truth: Mapping[str, _Floats], colors: Mapping[str, str] | None) -> Axes:
    """Lines of all bodies; the parts of one thing share a colour and an entry of the legend."""
    parts = Counter(map(canvas.thing, truth))
    palette = canvas.color_cycle(parts, colors)
    named: set[str] = set()
    for name, values in truth.items():
        thing = canvas.thing(name)
        text = "" if thing in named else _plain(name if parts[thing] == 1 else thing)
        named.add(thing)
        color = (colors or {}).get(name, palette[thing])
        ax.plot(time, values, color=color, label=text, linewidth=1.8, solid_capstyle="round")
    return ax


def _draw_tracks(
    recording: Recording, found: Tracks, ax: Axes | None, quantity: str, colors: Mapping[str, str] | None
) -> Axes:
    """Tracks in colours by id, over the truth of all bodies."""
    label, bin_name = QUANTITIES[quantity]
    width = getattr(recording.radar.waveform, bin_name)
    truth_time, truth = middles(recording), _truth(recording, quantity, None)
    bodies: Mapping[int, str | None] = {}
    if recording.truth is not None and len(found.time) == len(recording):
        bodies = assign_to_truth(found, recording.truth)

    ax = canvas.new_axes() if ax is None else ax
    # Bodies that a track follows are broad; the other parts of a person are thin, to leave the dots in view.
    style: dict[str, Any] = {"color": canvas.GREY, "alpha": 0.4, "solid_capstyle": "round"}
    lines = [
        ax.plot(truth_time, values, linewidth=5.0 if name in bodies.values() else 0.7, **style)[0]
        for name, values in truth.items()
    ]
    if lines:
        max(lines, key=lambda line: line.get_linewidth()).set_label("truth")
    # A few tracks have a colour and an entry of the legend each; of many, all that follow one thing share them.
    groups: dict[str, list[Track]] = {}
    for one in found:
        body = bodies.get(one.id)
        shares = len(found) > _MOST_APART and body is not None
        groups.setdefault(canvas.thing(body) if shares and body is not None else f"track {one.id}", []).append(one)
    palette = canvas.color_cycle(groups, colors)
    for count, (name, members) in enumerate(groups.items()):
        marker = _MARKERS[count // len(canvas.COLORS) % len(_MARKERS)]
        size = 7.0 if marker == "." else 3.0
        followed = {body for one in members if (body := bodies.get(one.id)) is not None}
        text = f"{_plain(name)}, {len(members)} tracks" if len(members) > 1 else _plain(name)
        if len(members) == 1 and followed and not followed <= {name}:
            text = f"{text}: {_plain(*followed)}"
        errors = [
            _errors(one.time, getattr(one, quantity), truth_time, truth[body]) / width
            for one in members
            if (body := bodies.get(one.id)) in truth
        ]
        text += _error_text(np.concatenate([np.empty(0), *errors]))
        for one in members:
            values, seen = getattr(one, quantity), one.is_detected
            ax.plot(one.time[seen], values[seen], marker, color=palette[name], label=text, markersize=size)
            ax.plot(one.time[~seen], values[~seen], "o", color=palette[name], fillstyle="none", markersize=4.0)
            text = ""  # one entry per group
    add_legends(_finished(ax, recording, label))

    names = [label for name, values in truth.items() for label in canvas.line_name(name, truth_time, values)]
    canvas.place_names((ax, names, "white"))
    return ax


def _error_text(errors: _Floats) -> str:
    """Errors in bins, for a legend."""
    return f": median {np.median(errors):.2f}, max {errors.max():.2f} bins" if errors.size > 0 else ""


def _finished(ax: Axes, recording: Recording, label: str) -> Axes:
    """Limits and labels."""
    first, last = float(recording.time.min()), float(recording.time.max())
    ax.set(xlim=(first, last + usual_interval(recording)), xlabel="Time [s]", ylabel=label)
    ax.grid(alpha=0.3)
    return ax


def check_recording(recording: object) -> None:
    """Refuse anything but a recording with frames to draw."""
    recording = check.instance("recording", recording, Recording)
    if len(recording) == 0:
        raise ValueError("recording: expected at least one frame, got none")


def _draw_power(
    ax: Axes, recording: Recording, found: RangeTime | Spectrogram, values: _Floats, dynamic_range_db: float | None
) -> None:
    """Power (column, value) over time; a pause much longer than that between frames is grey."""
    noise = noise_of_picture(recording, found.power, found.noise)
    scale = canvas.scale(found.power, noise, dynamic_range_db)
    # Columns of frames that overlap are in disorder.
    order = np.argsort(found.time, kind="stable")
    time, level = found.time[order], scale.level_db(found.power[order])

    # A column reaches half way to its neighbours, in a pause as far as it would in an ordinary one.
    usual = usual_interval(recording)
    reach = np.minimum(0.5 * np.diff(time), 0.75 * usual)
    outer = reach[[0, -1]] if len(reach) > 0 else np.full(2, 0.5 * usual)
    left = time - np.append(outer[0], reach)
    right = time + np.append(reach, outer[1])
    is_pause = left[1:] > right[:-1] + 1e-9 * usual
    edges = np.sort(np.concatenate([left, right[:-1][is_pause], right[-1:]]))
    columns = np.insert(level, np.flatnonzero(is_pause) + 1, np.nan, axis=0)

    rows = np.linspace(*canvas.edges(values, 1.0), len(values) + 1)
    picture = ax.pcolorfast(edges, rows, np.ma.masked_invalid(columns.T), **scale.colors)
    ax.set(xlim=(float(edges[0]), float(edges[-1])), xlabel="Time [s]")
    canvas.color_bar(ax, picture, scale.label)


def _draw_truth(ax: Axes, recording: Recording, quantity: str, names: Sequence[str] | None) -> None:
    """Dashed lines with their names."""
    time, labels = middles(recording), []
    for name, values in _truth(recording, quantity, names).items():
        ax.plot(time, values, color="white", linewidth=1.0, linestyle=(0, (5, 4)), path_effects=canvas.outlined(2.2))
        labels += canvas.line_name(name, time, values, ax.get_ylim(), "white")
    canvas.place_names((ax, labels, "black"))


def _truth(recording: Recording, quantity: str, names: Sequence[str] | None) -> dict[str, _Floats]:
    """Truth by name, (frame,), without bodies that were never visible."""
    if recording.truth is None:
        if names:
            raise ValueError("names: expected none, because the recording has no truth")
        return {}
    truth = recording.truth if names is None else recording.truth.select(names)
    columns = getattr(truth, quantity).T
    return {name: values for name, values in zip(truth.names, columns, strict=True) if np.isfinite(values).any()}


def _track(name: str, track: object, quantity: str) -> tuple[_Floats, _Floats]:
    """Times and values of the estimates of one body that are numbers."""
    columns = []
    for key in ("time", quantity):
        values = track.get(key) if isinstance(track, Mapping) else getattr(track, key, None)
        if values is None:
            raise TypeError(
                f"estimates[{name!r}]: expected a dict or an object with time and {quantity}, got one without {key}"
            )
        columns.append(check.numbers(f"estimates[{name!r}].{key}", values))
    time, values = columns
    if time.ndim != 1 or time.shape != values.shape:
        raise ValueError(
            f"estimates[{name!r}]: expected time and {quantity} of one shape (n,), got {time.shape} and {values.shape}"
        )
    is_there = np.isfinite(time) & np.isfinite(values)
    return time[is_there], values[is_there]


def _errors(time: _Floats, values: _Floats, truth_time: _Floats, truth: _Floats) -> _Floats:
    """Absolute errors where the truth is known on both sides, or at the time itself."""
    rounding = 1e-6  # [s]
    nearest = np.clip(time, truth_time[0], truth_time[-1])
    errors = np.abs(values - np.interp(nearest, truth_time, truth))
    return np.asarray(errors[np.isfinite(errors) & (np.abs(time - nearest) <= rounding)])


def _add_legend(ax: Axes, dpi: float) -> None:
    """Legend in the most columns that fit, with room for it above all drawn objects."""
    view = ax.get_window_extent()
    for num_columns in range(min(4, len(ax.get_legend_handles_labels()[1])), 0, -1):
        legend = ax.legend(
            loc="upper left", ncols=num_columns, fontsize=8, columnspacing=1.4, handletextpad=0.3, borderaxespad=0.3
        )
        box = legend.get_window_extent()
        if box.width <= 0.97 * view.width:
            break
    low, high = ax.get_ylim()
    taken = min(0.6, (box.height + 0.08 * dpi) / view.height)
    ax.set_ylim(low, low + (high - low) / (1.0 - taken))


def _plain(name: str) -> str:
    """A name that a legend shows as it is: a dollar sign is no formula, a leading underscore hides nothing."""
    return ("\u200b" if name.startswith("_") else "") + name.replace("$", r"\$")
