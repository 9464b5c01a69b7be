"""Pictures of directions: power in front of the sensor, places of the channels, and levels over an angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.plot import canvas
from radarcore.plot.frame import mark
from radarcore.processing.angles.array_pattern import Steer
from radarcore.processing.angles.array_pattern import array_pattern as gain_of_array
from radarcore.processing.angles.maps import range_angle
from radarcore.processing.spectra.noise import known_noise, noise_of_picture
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.radar.pattern import Pattern
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.units import decibels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NUM_ANGLES = 181


PARTS = {"two-way": "two_way_db", "transmit": "transmit_db", "receive": "receive_db"}
"""Parts of an array's pattern that `array_pattern` draws."""

_AXIS_LABELS = {"azimuth": "Azimuth [°, positive to the left]", "elevation": "Elevation [°]"}


def range_angle_map(
    frame: Frame,
    ax: Axes | None = None,
    *,
    method: str = "bartlett",
    elevation: float = 0.0,
    num_sources: int | None = None,
    channel_phase: ArrayLike | None = None,
    field_of_view_deg: float = 180.0,
    dynamic_range_db: float | None = 40.0,
    max_range: float | None = None,
) -> Axes:
    """Power in front of the sensor: x (forward) up, y to the left [m]; truth as crosses.

    In dB over the receiver's noise in a beam of all channels, as in `range_doppler_map`. "music" is no power: in dB
    below the largest.

    Parameters
    ----------
    frame : Frame
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    method, elevation, num_sources, channel_phase
        As in `radarcore.range_angle`; one elevation [rad].
    field_of_view_deg : float
        Width of the sector shown [degrees], 1 to 180.
    dynamic_range_db : float or None
        Largest range of levels below the maximum that colours span [dB]; None: 60, and not deeper than the noise.
    max_range : float, optional
        Radius of the sector [m]; default: as in `range_doppler_map`.

    See Also
    --------
    range_angle : The numbers.
    plot.range_doppler_map : Power over range and velocity.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> ax = rc.plot.range_angle_map(frame, method="capon")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('y [m], to the left', 'x [m], forward')
    """
    check.instance("frame", frame, Frame)
    width = check.within("field_of_view_deg", field_of_view_deg, 1.0, 180.0, "degrees")
    wf = frame.radar.waveform
    n = canvas.padded(wf.num_samples)
    half = np.deg2rad(0.5 * width)
    sides = np.linspace(-half, half, _NUM_ANGLES + 1)
    power = range_angle(
        frame,
        method=method,
        azimuth=0.5 * (sides[1:] + sides[:-1]),
        elevation=check.number("elevation", elevation, "rad"),
        num_sources=num_sources,
        num_range_bins=n,
        channel_phase=channel_phase,
    )
    ranges = wf.range_axis(n)[: len(power)]
    last = canvas.axis_end(frame, "range", max_range, ranges, canvas.stands_out(power, axis=1))
    shown = ranges <= last
    known = known_noise(frame, window_weights("window", "hann", wf.num_samples))
    noise = noise_of_picture(frame, power, known and known / frame.radar.num_channels)
    scale = canvas.scale(power[shown], None if method == "music" else noise, dynamic_range_db)

    # Cells about the range bins, from one side of the sector to the other.
    ax = canvas.new_axes() if ax is None else ax
    step = ranges[1] if len(ranges) > 1 else last
    rims = np.clip(np.append(ranges[shown] - 0.5 * step, ranges[shown][-1] + 0.5 * step), 0.0, last)[:, None]
    x, y = rims * np.sin(sides), rims * np.cos(sides)
    picture = ax.pcolormesh(x, y, scale.level_db(power[shown]), rasterized=True, **scale.colors)
    reach = last * np.sin(half)
    what = "Pseudo-spectrum" if method == "music" else "Power"
    ax.set(xlim=(reach, -reach), ylim=(0.0, last), aspect="equal", title=f"{what} in front at {frame.time:.3f} s")
    ax.set(xlabel="y [m], to the left", ylabel="x [m], forward")
    canvas.color_bar(ax, picture, scale.label.replace("Power", what))
    if frame.truth is not None:
        places = frame.truth.range[..., None] * unit_vectors(frame.truth.azimuth, frame.truth.elevation)
        forward, left, _ = np.moveaxis(places, -1, 0)
        canvas.place_names((ax, mark(ax, left, forward, frame.truth.names), "black"))
    return ax


def virtual_array(radar: Radar, ax: Axes | None = None, *, unit: str = "mm") -> Axes:
    """Transmitters, receivers and virtual channels as seen from behind the sensor: y to the left, z up.

    About the centre of the array, as `Radar.virtual_array`.

    Parameters
    ----------
    radar : Radar
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    unit : "mm" or "wavelengths"

    See Also
    --------
    Radar.virtual_array : The positions.
    plot.array_pattern : Gain of the array.

    Examples
    --------
    >>> ax = rc.plot.virtual_array(rc.bgt60tr13c())
    >>> ax.get_legend_handles_labels()[1]
    ['virtual channel', 'receiver', 'transmitter']
    """
    check.instance("radar", radar, Radar)
    is_in_mm = check.choice("unit", unit, ("mm", "wavelengths")) == "mm"
    scale = 1e3 if is_in_mm else 1.0 / radar.waveform.wavelength
    ax = canvas.new_axes() if ax is None else ax
    receiver, transmitter, channel = canvas.COLORS[:3]
    for positions, label, marker, size, color, fill in (
        (radar.virtual_array, "virtual channel", "o", 10.0, channel, "none"),
        (radar.rx - radar.array_center, "receiver", "s", 5.0, receiver, "full"),
        (radar.tx - radar.array_center, "transmitter", "^", 7.0, transmitter, "full"),
    ):
        at = scale * positions[:, 1:].T
        ax.plot(*at, marker, color=color, fillstyle=fill, markersize=size, label=label)
    ax.margins(0.15)
    ax.set_aspect("equal", adjustable="datalim")
    ax.invert_xaxis()
    ax.grid(alpha=0.3)
    ax.set(axisbelow=True, xlabel=f"y [{unit}], to the left", ylabel=f"z [{unit}], up")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    return ax


def antenna_pattern(
    antenna: Radar | Pattern, ax: Axes | None = None, *, polar: bool = True, dynamic_range_db: float = 30.0
) -> Axes:
    """Gain [dBi] of an antenna over azimuth (at elevation 0) and over elevation (at azimuth 0).

    Parameters
    ----------
    antenna : Radar or pattern
        Of a radar the patterns of all elements, each once.
    ax : matplotlib Axes, optional
        Polar or Cartesian; default: axes of a new figure.
    polar : bool
        Of a new figure: polar, 0 on top, positive angles to the left.
    dynamic_range_db : float
        Range of levels below the largest that is shown [dB].

    See Also
    --------
    plot.array_pattern : Of an array of antennas.
    GaussianPattern : Gain of an element.

    Examples
    --------
    >>> ax = rc.plot.antenna_pattern(rc.GaussianPattern(6.0, 60.0, 40.0), polar=False)
    >>> [line.get_label() for line in ax.lines]
    ['azimuth', 'elevation']
    """
    depth = check.positive("dynamic_range_db", dynamic_range_db, "dB")
    patterns = _patterns(antenna)
    cuts = []
    for pattern, name in patterns.items():
        for axis, angle_deg in (("azimuth", np.arange(-180.0, 180.5, 0.5)), ("elevation", np.arange(-90.0, 90.5, 0.5))):
            angles = {"azimuth": 0.0, "elevation": 0.0} | {axis: np.deg2rad(angle_deg)}
            cuts.append((angle_deg, decibels(pattern.gain(**angles)), ", ".join(filter(None, (name, axis)))))
    ax = _cut_axes(polar) if ax is None else ax
    top = _top(np.concatenate([level for _, level, _ in cuts]))
    for i, (angle_deg, level, label) in enumerate(cuts):
        color = canvas.COLORS[(i // 2) % len(canvas.COLORS)]
        style = {"linestyle": "-" if i % 2 == 0 else (0, (4, 2)), "linewidth": 1.6, "label": label}
        _draw_cut(ax, angle_deg, level, top - depth, color=color, **style)
    return _finish_cut(ax, (top - depth, top), "Gain [dBi]", "Angle [°, positive to the left and up]")


def array_pattern(
    radar: Radar,
    ax: Axes | None = None,
    *,
    steer: Steer = None,
    cut: str = "azimuth",
    part: str = "two-way",
    tx_window: Window = None,
    rx_window: Window = None,
    polar: bool = False,
    dynamic_range_db: float = 40.0,
) -> Axes:
    """Gain [dB] of an array over azimuth or elevation: steered, and thin in grey not steered.

    Parameters
    ----------
    radar : Radar
    ax : matplotlib Axes, optional
        Polar or Cartesian; default: axes of a new figure.
    steer : float or (float, float), optional
        Azimuth, or azimuth and elevation, to steer to [rad]; the cut goes through there. Default: not steered.
    cut : "azimuth" or "elevation"
    part : "two-way", "transmit" or "receive"
    tx_window, rx_window
        As in `radarcore.array_pattern`, of both curves.
    polar : bool
        Of a new figure: polar, 0 on top, positive angles to the left.
    dynamic_range_db : float
        Range of levels below the largest that is shown [dB].

    See Also
    --------
    array_pattern : The numbers.
    plot.antenna_pattern : Of single elements.

    Examples
    --------
    >>> row = [[0.0, 2.5e-3 * k, 0.0] for k in range(8)]
    >>> ax = rc.plot.array_pattern(rc.Radar(rc.bgt60tr13c().waveform, rx=row), steer=np.deg2rad(20.0))
    >>> ax.get_ylabel()
    'Two-way gain [dB]'
    """
    axis = check.choice("cut", cut, tuple(_AXIS_LABELS))
    attribute = PARTS[check.choice("part", part, tuple(PARTS))]
    depth = check.positive("dynamic_range_db", dynamic_range_db, "dB")
    to = np.zeros(2) if steer is None else np.resize(np.append(check.numbers("steer", steer), 0.0), 2)
    angle_deg = np.linspace(-90.0, 90.0, 1801)

    def gain(through: NDArray[np.float64], to: Steer) -> NDArray[np.float64]:
        angles = np.deg2rad(angle_deg)
        azimuth, elevation = (angles, through[1]) if axis == "azimuth" else (through[0], angles)
        pattern = gain_of_array(radar, azimuth, elevation, steer=to, tx_window=tx_window, rx_window=rx_window)
        level: NDArray[np.float64] = getattr(pattern, attribute)
        return level

    level, ahead = gain(to, steer), gain(np.zeros(2), None)
    ax = _cut_axes(polar) if ax is None else ax
    top = _top(np.concatenate([ahead, level]))
    if steer is not None:
        _draw_cut(ax, angle_deg, ahead, top - depth, color=canvas.GREY, linewidth=1.0, label="not steered")
    place = float(np.rad2deg(to[0 if axis == "azimuth" else 1]))
    label = "not steered" if steer is None else f"steered to {place:.4g}°"
    _draw_cut(ax, angle_deg, level, top - depth, color=canvas.COLORS[0], linewidth=1.6, label=label)
    ax = _finish_cut(ax, (top - depth, top), f"{part.capitalize()} gain [dB]", _AXIS_LABELS[axis])
    if ax.name != "polar":
        ax.set_xlim((90.0, -90.0) if axis == "azimuth" else (-90.0, 90.0))
        ax.set_xticks(np.arange(-90.0, 91.0, 30.0))
    return ax


def rcs(
    azimuth_deg: ArrayLike,
    rcs_m2: ArrayLike,
    ax: Axes | None = None,
    *,
    polar: bool = True,
    label: str | None = None,
    dynamic_range_db: float = 40.0,
) -> Axes:
    """Radar cross-section over azimuth [dBsm], in polar form: 0 on top, positive angles to the left.

    Parameters
    ----------
    azimuth_deg : (direction,) array_like
        [degrees].
    rcs_m2 : (direction,) array_like
        As `radarcore.rcs` gives it [m^2].
    ax : matplotlib Axes, optional
        Polar or Cartesian, of an earlier call too; default: axes of a new figure.
    polar : bool
        Of a new figure.
    label : str, optional
        For a legend.
    dynamic_range_db : float
        Range of levels below the largest that is shown [dB].

    See Also
    --------
    rcs : The numbers.

    Examples
    --------
    >>> azimuth = np.linspace(150.0, 210.0, 61)
    >>> sigma = rc.rcs(rc.shapes.plate(0.05, 0.05), 60e9, azimuth_deg=azimuth)
    >>> ax = rc.plot.rcs(azimuth, sigma, polar=False)
    >>> ax.get_ylabel()
    'Radar cross-section [dBsm]'
    """
    angles = check.array("azimuth_deg", azimuth_deg, (None,))
    sections = check.array("rcs_m2", rcs_m2, (len(angles),))
    if len(angles) == 0:
        raise ValueError("azimuth_deg: expected at least one angle, got none")
    if (sections < 0.0).any():
        raise ValueError(f"rcs_m2: expected zero or positive numbers [m^2], got {sections.min():g}")
    depth = check.positive("dynamic_range_db", dynamic_range_db, "dB")
    is_first = ax is None or not ax.lines
    ax = _cut_axes(polar) if ax is None else ax
    level = decibels(sections)
    top = _top(level)
    # The first curve was drawn down to this floor.
    lowest, top = (top - depth, top) if is_first else (ax.get_ylim()[0], max(ax.get_ylim()[1], top))
    color = canvas.COLORS[len(ax.lines) % len(canvas.COLORS)]
    _draw_cut(ax, angles, level, lowest, color=color, linewidth=1.4, label=label or "")
    return _finish_cut(ax, (lowest, top), "Radar cross-section [dBsm]", _AXIS_LABELS["azimuth"])


def _patterns(antenna: Radar | Pattern) -> dict[Pattern, str]:
    """Distinct patterns and the names of the elements that have them; no name if there is one."""
    if isinstance(antenna, Pattern):
        return {antenna: ""}
    if not isinstance(antenna, Radar):
        raise TypeError(f"antenna: expected Radar or a pattern, got {type(antenna).__name__}")
    names: dict[Pattern, str] = {}
    for kind, patterns in (("TX", antenna.tx_patterns), ("RX", antenna.rx_patterns)):
        for pattern in dict.fromkeys(patterns):
            which = [str(i) for i, other in enumerate(patterns) if other == pattern]
            name = kind if len(which) == len(patterns) else f"{kind} {', '.join(which)}"
            names[pattern] = f"{names[pattern]} and {name}" if pattern in names else name
    return names if len(names) > 1 else dict.fromkeys(names, "")


def _cut_axes(polar: bool) -> Axes:
    if not polar:
        return canvas.new_axes()
    axes: Axes = canvas.new_figure(5.6, 5.4).add_subplot(projection="polar")
    return axes


def _top(level: NDArray[np.float64]) -> float:
    """Upper end of the axis: the largest level, up to the next 5 dB."""
    largest = float(level.max(initial=-np.inf))
    return 5.0 * float(np.floor(largest / 5.0) + 1.0) if np.isfinite(largest) else 0.0


def _draw_cut(ax: Axes, angle_deg: NDArray[np.float64], level: NDArray[np.float64], floor: float, **style: Any) -> None:
    if ax.name == "polar":  # a radius below the floor would be drawn on the other side
        angle_deg, level = np.deg2rad(angle_deg), np.maximum(level, floor)
    ax.plot(angle_deg, level, **style)


def _finish_cut(ax: Axes, limits: tuple[float, float], level_label: str, angle_label: str) -> Axes:
    """Limits, grid, labels and legend."""
    from matplotlib.ticker import MaxNLocator

    polar: Any = ax
    ax.set_ylim(*limits)
    ax.grid(alpha=0.4)
    if ax.name == "polar":
        polar.set_theta_zero_location("N")
        is_half = max(np.abs(line.get_xdata()).max() for line in ax.lines) <= 0.5 * np.pi + 1e-9
        polar.set_thetalim(*(-0.5 * np.pi, 0.5 * np.pi) if is_half else (0.0, 2.0 * np.pi))
        degrees = np.arange(-90.0, 91.0, 30.0) if is_half else np.arange(-150.0, 181.0, 30.0)
        places = degrees if is_half else degrees % 360.0
        ax.set_xticks(np.deg2rad(places), [canvas.with_minus(f"{degree:.0f}°") for degree in degrees])
        polar.set_rlabel_position(75.0)
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        ax.set_title(level_label, fontsize="medium")
    else:
        ax.margins(x=0.0)
        ax.set(xlabel=angle_label, ylabel=level_label)
        if angle_label == _AXIS_LABELS["azimuth"] and not ax.xaxis_inverted():
            ax.invert_xaxis()
    if ax.get_legend_handles_labels()[0]:
        if ax.name == "polar":
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2, frameon=False)
        else:
            ax.legend(loc="upper right")
    return ax
