"""Pictures of one frame: depth, reflectance, a chirp, power over range and velocity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry.camera import checked_field_of_view
from radarcore.plot import canvas
from radarcore.plot.canvas import Name
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.inputs import require_one_waveform
from radarcore.processing.spectra import spectra
from radarcore.processing.spectra.noise import known_noise, noise_of_picture
from radarcore.processing.spectra.windows import window_weights
from radarcore.recording.frame import Frame, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_BELOW_NOISE = 10.0
"""Depth of the axis below the mean of the noise [dB]: a line of powers would lie on the axis else."""


class Image(Protocol):
    """Parts of a `DepthImage` that are drawn: row 0 on top, column 0 on the left.

    See Also
    --------
    DepthImage : One of a simulation.
    plot.depth_image : Draws it.

    Examples
    --------
    >>> class Loaded:
    ...     distance = np.full((3, 4), 2.0)
    ...     reflectance = np.ones((3, 4))
    ...     field_of_view_deg = (40.0, 30.0)
    >>> rc.plot.depth_image(Loaded()).get_images()[0].get_array().shape
    (3, 4)
    """

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
    """Distance of every pixel [m]; pixels without a hit are grey.

    Parameters
    ----------
    image : DepthImage
    ax : matplotlib Axes, optional
        Default: axes of a new figure.

    Returns
    -------
    ax : matplotlib Axes
        Undistorted, marked with azimuth and elevation in degrees, positive to the left and up.

    See Also
    --------
    Simulator.depth_image : The numbers.
    plot.reflectance_image : Reflectance of surfaces.

    Examples
    --------
    >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Pose([1.0, 0.0, 0.0]))
    >>> image = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(), resolution=32).depth_image()
    >>> rc.plot.depth_image(image).get_images()[0].get_array().shape
    (32, 32)
    """
    return _draw_image(image, image.distance, ax, "Distance [m]", "viridis_r", None)


def reflectance_image(image: Image, ax: Axes | None = None) -> Axes:
    """Reflectance of every pixel; pixels without a hit are grey.

    Parameters and result as `depth_image`.

    See Also
    --------
    plot.depth_image : Distances.
    Simulator.depth_image : The numbers.

    Examples
    --------
    >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Pose([1.0, 0.0, 0.0]))
    >>> image = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(), resolution=32).depth_image()
    >>> rc.plot.reflectance_image(image).get_images()[0].get_array().shape
    (32, 32)
    """
    return _draw_image(image, image.reflectance, ax, "Reflectance", "magma", 0.0)


def chirp(frame: Frame, channel: int = 0, chirp: int = 0, ax: Axes | None = None) -> Axes:
    """Samples of one chirp over the time since the start of its ramp [us].

    Parameters
    ----------
    frame : Frame
    channel, chirp : int
        Indices of the chirp; negative numbers count from the end.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.

    See Also
    --------
    plot.range_profile : The same in ranges.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> ax = rc.plot.chirp(frame, channel=1)
    >>> ax.get_xlabel()
    'Time since start of ramp [µs]'
    """
    samples = frame.cube[
        check.index("channel", channel, frame.cube.shape[0]), check.index("chirp", chirp, frame.cube.shape[1])
    ]
    exponent = _exponent(samples)
    scaled = np.asarray(samples, dtype=np.complex128 if np.iscomplexobj(samples) else np.float64) * 10.0**-exponent
    microseconds = frame.radar.waveform.sample_times * 1e6

    ax = canvas.new_axes() if ax is None else ax
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
    given = unit_of(frame)
    unit = r"\sqrt{\mathrm{W}}" if given is None else rf"\mathrm{{{given.replace(' ', chr(92) + ' ')}}}"
    ax.set_ylabel(f"Amplitude [${unit}$]" if exponent == 0 else rf"Amplitude [$10^{{{exponent}}}\,{unit}$]")
    title = f"Chirp {chirp}, channel {channel}, at {frame.time:.3f} s"
    ax.set(xlabel="Time since start of ramp [µs]", title=title)
    return ax


def range_profile(
    frame: Frame,
    channel: int | None = None,
    ax: Axes | None = None,
    *,
    dynamic_range_db: float | None = None,
    max_range: float | None = None,
) -> Axes:
    """Power over range, averaged over chirps, in decibels as in `range_doppler_map`.

    Parameters as `range_doppler_map`.

    See Also
    --------
    range_profile : The numbers.
    plot.range_time : Over a recording.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> ax = rc.plot.range_profile(frame, max_range=4.0)
    >>> print(ax.get_xlabel(), "to", ax.get_xlim()[1])
    Range [m] to 4.0
    """
    wf = frame.radar.waveform
    n = canvas.padded(wf.num_samples)
    samples = _channels(frame, channel)
    profile = spectra.range_profile(samples, wf, num_bins=n)
    power = (np.abs(profile) ** 2).mean(axis=1).sum(axis=0)
    noise = known_noise(frame, window_weights("window", "hann", wf.num_samples))
    noise = noise_of_picture(frame, power, noise and noise * len(samples))
    scale = canvas.scale(power, noise, dynamic_range_db)
    if noise is not None:
        scale = scale._replace(low=scale.low - _BELOW_NOISE)
    ranges = wf.range_axis(n)[: len(power)]
    ax = canvas.new_axes() if ax is None else ax
    ax.plot(ranges, scale.level_db(power), color="tab:blue", linewidth=1.4)
    end = canvas.axis_end(frame, "range", max_range, ranges, canvas.stands_out(power))
    ax.set(xlabel="Range [m]", ylabel=scale.label, title=f"Range at {frame.time:.3f} s", xlim=(0.0, end))
    ax.set_ylim(scale.low, scale.high + 3.0)
    ax.grid(alpha=0.3)
    return ax


def range_doppler_map(
    frame: Frame,
    channel: int | None = None,
    ax: Axes | None = None,
    *,
    detections: Detections | None = None,
    dynamic_range_db: float | None = None,
    max_range: float | None = None,
    max_velocity: float | None = None,
) -> Axes:
    """Power over range [m] and velocity [m/s, receding positive]; truth as crosses, detections as rings.

    In dB over the receiver's noise: known of a simulated noise figure, else the median of a measured frame. In dB below
    the largest power for simulated samples without a noise figure.

    Parameters
    ----------
    frame : Frame
    channel : int, optional
        One channel; default: the powers of all, added.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    detections : Detections, optional
        Detections of the frame, see `radarcore.detect`.
    dynamic_range_db : float, optional
        Largest range of levels that colours span [dB]; default: 60, and not deeper than the noise.
    max_range, max_velocity : float, optional
        Ends of the axes [m], [m/s]. Default: the limits of the radar; for a frame with truth a little beyond the truth,
        the detections, and all echoes 15 dB over the median and within 40 dB of the strongest.

    See Also
    --------
    range_doppler : The numbers.
    plot.range_profile : Ranges alone.
    plot.range_angle_map : Power over range and angle.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> ax = rc.plot.range_doppler_map(frame, detections=rc.detect(frame))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('Velocity [m/s, receding positive]', 'Range [m]')
    """
    ax = canvas.new_axes() if ax is None else ax
    limits = {"dynamic_range_db": dynamic_range_db, "max_range": max_range, "max_velocity": max_velocity}
    canvas.place_names((ax, draw_map(ax, frame, channel, detections=detections, **limits), "black"))
    return ax


def draw_map(
    ax: Axes,
    frame: Frame,
    channel: int | None = None,
    *,
    detections: Detections | None = None,
    dynamic_range_db: float | None = None,
    max_range: float | None = None,
    max_velocity: float | None = None,
) -> list[Name]:
    """The range-velocity map and crosses for the truth; the names to be put there."""
    wf = frame.radar.waveform
    num_range, num_velocity = canvas.padded(wf.num_samples), canvas.padded(wf.num_chirps)
    samples = _channels(frame, channel)
    spectrum = spectra.range_doppler(samples, wf, num_range_bins=num_range, num_velocity_bins=num_velocity)
    power = (np.abs(spectrum) ** 2).sum(axis=0).T  # (range, doppler)
    windows = [window_weights("window", "hann", length) for length in (wf.num_samples, wf.num_chirps)]
    known = known_noise(frame, *windows)
    noise = noise_of_picture(frame, power, known and known * len(samples))
    scale = canvas.scale(power, noise, dynamic_range_db)

    velocities, ranges = wf.velocity_axis(num_velocity), wf.range_axis(num_range)[: len(power)]
    extent = (*canvas.edges(velocities, 2.0 * wf.max_velocity), *canvas.edges(ranges, wf.max_range))
    picture = ax.imshow(scale.level_db(power), extent=extent, origin="lower", aspect="auto", **scale.colors)
    fastest = canvas.axis_end(frame, "velocity", max_velocity, velocities, canvas.stands_out(power, axis=0), detections)
    farthest = canvas.axis_end(frame, "range", max_range, ranges, canvas.stands_out(power, axis=1), detections)
    ax.set(xlabel="Velocity [m/s, receding positive]", xlim=(-fastest, fastest), ylim=(0.0, farthest))
    ax.set(ylabel="Range [m]", title=f"Range and velocity at {frame.time:.3f} s")
    canvas.color_bar(ax, picture, scale.label)
    if detections is not None:
        ring(ax, detections.velocity, detections.range)
    if frame.truth is None:
        return []
    return mark(ax, frame.truth.velocity, frame.truth.range, frame.truth.names)


def ring(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Rings around points, within the limits of the axes."""
    limits = ax.axis()
    style: dict[str, Any] = {"linestyle": "", "marker": "o", "markerfacecolor": "none", "markersize": 10.0}
    ax.plot(x, y, color="white", markeredgewidth=1.3, path_effects=canvas.outlined(3.0), **style)
    ax.axis(limits)


def mark(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], names: tuple[str, ...]) -> list[Name]:
    """Draw crosses at points in view (NaN is out of view), and return the names to place beside them."""
    (left, right), (bottom, top) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    points = [
        Name(a, b, text) for a, b, text in zip(x, y, names, strict=True) if left <= a <= right and bottom <= b <= top
    ]
    style: dict[str, Any] = {"marker": "+", "markersize": 8.0, "markeredgewidth": 1.2}
    for point in points:
        ax.plot([point.x], [point.y], color="white", path_effects=canvas.outlined(2.5), **style)
    return points


def _draw_image(
    image: Image, values: NDArray[Any], ax: Axes | None, label: str, colors: str, lowest: float | None
) -> Axes:
    """Pixels on the image plane (y/x, z/x), which keeps planes straight; ticks where whole degrees lie."""
    values = np.asarray(values, dtype=np.float64)
    hit = np.isfinite(np.asarray(image.distance)) & np.isfinite(values)
    if values.ndim != 2:
        raise ValueError(f"image: expected arrays of shape (row, column), got {values.shape}")
    widths = checked_field_of_view(image.field_of_view_deg)
    shown = values[hit]
    low = float(shown.min(initial=np.inf)) if lowest is None else lowest
    high = float(shown.max(initial=-np.inf))
    if not low < high:  # nothing hit, or all alike
        low, high = (low, low + 1.0) if np.isfinite(low) else (0.0, 1.0)

    ax = canvas.new_axes() if ax is None else ax
    half_width, half_height = np.tan(0.5 * np.deg2rad(widths))
    picture = ax.imshow(
        np.ma.masked_array(values, ~hit),
        extent=(half_width, -half_width, -half_height, half_height),
        cmap=canvas.color_map(colors),
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    for axis, width in ((ax.xaxis, widths[0]), (ax.yaxis, widths[1])):
        step = next((step for step in (1, 2, 5, 10, 15, 20, 30) if width / step <= 6.5), 45)
        degrees = step * np.arange(-int(width / 2 / step), int(width / 2 / step) + 1)
        axis.set_ticks(np.tan(np.deg2rad(degrees)), [canvas.with_minus(f"{degree:d}") for degree in degrees])
    ax.set(xlabel="Azimuth [°]", ylabel="Elevation [°]")
    canvas.color_bar(ax, picture, label)
    return ax


def _channels(frame: Frame, channel: int | None) -> NDArray[Any]:
    """Samples of one channel or all, (channel, chirp, sample), of one waveform."""
    require_one_waveform(frame.radar)
    if channel is None:
        return frame.cube
    index = check.index("channel", channel, len(frame.cube))
    return frame.cube[index : index + 1]


def _exponent(samples: NDArray[Any]) -> int:
    """Power of ten, a multiple of three, in which the samples are plain numbers."""
    largest = float(np.max(np.abs(samples), initial=0.0, where=np.isfinite(samples)))
    return 0 if largest == 0.0 else 3 * int(np.floor(np.log10(largest) / 3.0))
