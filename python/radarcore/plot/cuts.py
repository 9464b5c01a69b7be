"""Levels over an angle, in polar or Cartesian axes: patterns of antennas and arrays, radar cross-sections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.plot import canvas
from radarcore.processing.angles.array_pattern import Steer
from radarcore.processing.angles.array_pattern import array_pattern as gain_of_array
from radarcore.processing.spectra.windows import Window
from radarcore.radar.pattern import Pattern
from radarcore.radar.radar import Radar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PARTS = {"two-way": "two_way_db", "transmit": "transmit_db", "receive": "receive_db"}
"""Parts of an array's pattern that `array_pattern` draws."""

_AXIS = {"azimuth": "Azimuth [°, positive to the left]", "elevation": "Elevation [°]"}


def antenna_pattern(
    antenna: Radar | Pattern, ax: Axes | None = None, *, polar: bool = True, dynamic_range_db: float = 30.0
) -> Axes:
    """Gain [dBi] of an antenna over azimuth (at elevation 0) and over elevation (at azimuth 0).

    Parameters
    ----------
    antenna : Radar or pattern
        Of a radar the patterns of all elements, each once.
    ax : matplotlib Axes, optional
        Polar or Cartesian; default: those of a new figure.
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
            cuts.append((angle_deg, _db(pattern.gain(**angles)), ", ".join(filter(None, (name, axis)))))
    ax = _new_axes(polar) if ax is None else ax
    top = _top(np.concatenate([level for _, level, _ in cuts]))
    for i, (angle_deg, level, label) in enumerate(cuts):
        color = canvas.COLORS[(i // 2) % len(canvas.COLORS)]
        style = {"linestyle": "-" if i % 2 == 0 else (0, (4, 2)), "linewidth": 1.6, "label": label}
        _draw(ax, angle_deg, level, top - depth, color=color, **style)
    return _finish(ax, (top - depth, top), "Gain [dBi]", "Angle [°, positive to the left and up]")


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
        Polar or Cartesian; default: those of a new figure.
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
    axis = check.choice("cut", cut, tuple(_AXIS))
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
    ax = _new_axes(polar) if ax is None else ax
    top = _top(np.concatenate([ahead, level]))
    if steer is not None:
        _draw(ax, angle_deg, ahead, top - depth, color=canvas.GREY, linewidth=1.0, label="not steered")
    place = float(np.rad2deg(to[0 if axis == "azimuth" else 1]))
    label = "not steered" if steer is None else f"steered to {place:.4g}°"
    _draw(ax, angle_deg, level, top - depth, color=canvas.COLORS[0], linewidth=1.6, label=label)
    ax = _finish(ax, (top - depth, top), f"{part.capitalize()} gain [dB]", _AXIS[axis])
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
        Polar or Cartesian, of an earlier call too; default: those of a new figure.
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
    ax = _new_axes(polar) if ax is None else ax
    level = _db(sections)
    lowest, top = _top(level) - depth, _top(level)
    if not is_first:
        lowest, highest = ax.get_ylim()  # the floor of the first, to which its curve was drawn
        top = max(highest, top)
    color = canvas.COLORS[len(ax.lines) % len(canvas.COLORS)]
    _draw(ax, angles, level, lowest, color=color, linewidth=1.4, label=label or "")
    return _finish(ax, (lowest, top), "Radar cross-section [dBsm]", _AXIS["azimuth"])


def _patterns(antenna: Radar | Pattern) -> dict[Pattern, str]:
    """Distinct patterns and the names of the elements that have them; no name if there is one."""
    if isinstance(antenna, Pattern):
        return {antenna: ""}
    if not isinstance(antenna, Radar):
        raise TypeError(f"antenna: expected Radar or a pattern, got {type(antenna).__name__}")
    elements: dict[Pattern, list[str]] = {}
    for kind, patterns in (("TX", antenna.tx_patterns), ("RX", antenna.rx_patterns)):
        for pattern in dict.fromkeys(patterns):
            which = [str(i) for i, other in enumerate(patterns) if other == pattern]
            name = kind if len(which) == len(patterns) else f"{kind} {', '.join(which)}"
            elements.setdefault(pattern, []).append(name)
    if len(elements) == 1:
        return dict.fromkeys(elements, "")
    return {pattern: " and ".join(names) for pattern, names in elements.items()}


def _new_axes(polar: bool) -> Axes:
    if not polar:
        return canvas.new_axes()
    axes: Axes = canvas.new_figure(5.6, 5.4).add_subplot(projection="polar")
    return axes


def _db(power: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(divide="ignore"):  # nothing is -inf, below the floor
        level: NDArray[np.float64] = 10.0 * np.log10(power)
    return level


def _top(level: NDArray[np.float64]) -> float:
    """Upper end of the axis: the largest level, up to the next 5 dB."""
    largest = float(level.max(initial=-np.inf))
    return 5.0 * float(np.floor(largest / 5.0) + 1.0) if np.isfinite(largest) else 0.0


def _draw(ax: Axes, angle_deg: NDArray[np.float64], level: NDArray[np.float64], floor: float, **style: Any) -> None:
    if ax.name == "polar":  # a radius below the floor would be drawn on the other side
        angle_deg, level = np.deg2rad(angle_deg), np.maximum(level, floor)
    ax.plot(angle_deg, level, **style)


def _finish(ax: Axes, limits: tuple[float, float], level_label: str, angle_label: str) -> Axes:
    """Limits, grid, labels and legend."""
    from matplotlib.ticker import MaxNLocator

    polar: Any = ax
    ax.set_ylim(*limits)
    ax.grid(alpha=0.4)
    if ax.name == "polar":
        polar.set_theta_zero_location("N")
        angles = np.concatenate([line.get_xdata() for line in ax.lines])
        if np.abs(angles).max() <= 0.5 * np.pi + 1e-9:
            polar.set_thetalim(-0.5 * np.pi, 0.5 * np.pi)
            degrees, turn = np.arange(-90.0, 91.0, 30.0), 0.0
        else:
            degrees, turn = np.arange(-150.0, 181.0, 30.0), 360.0
            polar.set_thetalim(0.0, 2.0 * np.pi)
        ax.set_xticks(
            np.deg2rad(np.where(degrees < 0.0, degrees + turn, degrees)),
            [f"{degree:.0f}°".replace("-", "\N{MINUS SIGN}") for degree in degrees],
        )
        polar.set_rlabel_position(75.0)
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        ax.set_title(level_label, fontsize="medium")
    else:
        ax.margins(x=0.0)
        ax.set_xlabel(angle_label)
        ax.set_ylabel(level_label)
        if angle_label == _AXIS["azimuth"] and not ax.xaxis_inverted():
            ax.invert_xaxis()
    if any(line.get_label() and not str(line.get_label()).startswith("_") for line in ax.lines):
        outside: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.06), "ncols": 2, "frameon": False}
        ax.legend(**outside if ax.name == "polar" else {"loc": "upper right"})
    return ax
