"""Pictures of directions: power over the floor in front of the sensor, and the positions of the channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.plot import canvas
from radarcore.plot.frame import mark
from radarcore.processing.angles.maps import range_angle
from radarcore.processing.spectra.noise import known_noise
from radarcore.processing.spectra.windows import window_weights
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NUM_ANGLES = 181


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

    In dB over the receiver's noise in a beam of all channels where that is known (frames of a `Simulator` whose radar
    has a noise figure), else, and for "music", which is no power, in dB below the largest.

    Parameters
    ----------
    frame : Frame
    ax : matplotlib Axes, optional
        Default: those of a new figure.
    method, elevation, num_sources, channel_phase
        As in `radarcore.range_angle`; one elevation [rad].
    field_of_view_deg : float
        Width of the sector shown [degrees], at most 180.
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
    width = check.positive("field_of_view_deg", field_of_view_deg, "degrees")
    if width > 180.0:
        raise ValueError(f"field_of_view_deg: expected at most 180 degrees, got {width:g}")
    canvas.last_range(frame, max_range)  # refuses what is no range
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
    last = canvas.range_end(frame, max_range, ranges, canvas.stands_out(power, axis=1))
    shown = ranges <= last
    noise = None if method == "music" else known_noise(frame, window_weights("window", "hann", wf.num_samples))
    scale = canvas.scale(power[shown], noise and noise / frame.radar.num_channels, dynamic_range_db)

    # Cells about the range bins, from one side of the sector to the other.
    ax = canvas.new_axes() if ax is None else ax
    step = ranges[1] if len(ranges) > 1 else last
    rims = np.clip(np.append(ranges[shown] - 0.5 * step, ranges[shown][-1] + 0.5 * step), 0.0, last)[:, None]
    picture = ax.pcolormesh(
        rims * np.sin(sides),
        rims * np.cos(sides),
        scale.level_db(power[shown]),
        cmap=canvas.color_map("inferno"),
        vmin=scale.low,
        vmax=scale.high,
        rasterized=True,
    )
    reach = last * np.sin(half)
    ax.set_xlim(reach, -reach)
    ax.set_ylim(0.0, last)
    ax.set_aspect("equal")
    ax.set_xlabel("y [m], to the left")
    ax.set_ylabel("x [m], forward")
    what = "Pseudo-spectrum" if method == "music" else "Power"
    canvas.color_bar(ax, picture, scale.label.replace("Power", what))
    ax.set_title(f"{what} in front at {frame.time:.3f} s")
    if frame.truth is not None:
        places = frame.truth.range[..., None] * unit_vectors(frame.truth.azimuth, frame.truth.elevation)
        forward, left, _ = np.moveaxis(places, -1, 0)
        canvas.place_names(ax, mark(ax, left, forward, frame.truth.names))
    return ax


def virtual_array(radar: Radar, ax: Axes | None = None, *, unit: str = "mm") -> Axes:
    """Transmitters, receivers and virtual channels as seen from behind the sensor: y to the left, z up.

    About the centre of the array, as `Radar.virtual_array`.

    Parameters
    ----------
    radar : Radar
    ax : matplotlib Axes, optional
        Default: those of a new figure.
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
    for positions, label, marker, size, filled in (
        (radar.virtual_array, "virtual channel", "o", 10.0, False),
        (radar.rx - radar.array_center, "receiver", "s", 5.0, True),
        (radar.tx - radar.array_center, "transmitter", "^", 7.0, True),
    ):
        color = canvas.COLORS[("receiver", "transmitter", "virtual channel").index(label)]
        face = color if filled else "none"
        at = scale * positions[:, 1:].T
        ax.plot(*at, marker, color=color, markerfacecolor=face, markersize=size, label=label)
    ax.margins(0.15)
    ax.set_aspect("equal", adjustable="datalim")
    ax.invert_xaxis()
    ax.grid(alpha=0.3)
    ax.set_axisbelow(True)
    ax.set_xlabel(f"y [{unit}], to the left")
    ax.set_ylabel(f"z [{unit}], up")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    return ax
