"""Figures of several pictures: one frame at a glance, and an experiment."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from radarcore import check
from radarcore.motion.protocol import AnyMotion
from radarcore.plot import above, canvas, history
from radarcore.plot import frame as frame_pictures
from radarcore.plot.canvas import Name
from radarcore.plot.frame import Image
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def overview(
    frame: Frame,
    image: Image | None,
    path: str | os.PathLike[str] | None = None,
    *,
    channel: int | None = None,
    max_range: float | None = None,
    max_velocity: float | None = None,
    moving: Frame | None = None,
    overwrite: bool = False,
) -> Figure:
    """Frame at a glance: depth, reflectance, one chirp, and power over range and velocity, truth as crosses.

    Parameters
    ----------
    frame : Frame
        A frame of a single chirp, or of unevenly spaced ones, shows power over range alone.
    image : DepthImage or None
        Depth image at the time of the frame; None (a measured frame): without the two images.
    path : path, optional
        Save here, in the format of the suffix; missing parents are made.
    channel : int, optional
        One channel; default: the chirp of the first, and the powers of all, added.
    max_range, max_velocity : float, optional
        Ends of the axes of range and velocity [m], [m/s]; default: as in `range_doppler_map`.
    moving : Frame, optional
        The frame without what stands still, such as `remove_mean` gives: its powers are drawn, and the chirp as it
        was received.
    overwrite : bool
        Replace an existing picture.

    Returns
    -------
    figure : matplotlib Figure

    See Also
    --------
    plot.experiment : A recording at a glance.
    plot.range_doppler_map : One of its pictures.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> figure = rc.plot.overview(frame, None)
    >>> len(figure.axes) >= 2
    True
    """
    canvas.picture(path, overwrite)
    wf = frame.radar.waveform
    seen, note = (frame, "") if moving is None else (moving, ", static echoes removed")
    names: list[tuple[Axes, list[Name]]] = []
    figure = canvas.new_figure(11.0, 8.2 if image is not None else 4.4)
    panels = list(figure.subplots(2 if image is not None else 1, 2).flat)
    _headline(figure, f"t = {frame.time:.3f} s", wf)

    # Depth and reflectance, seen from the radar.
    if image is not None:
        frame_pictures.depth_image(image, panels[0]).set_title("Depth")
        frame_pictures.reflectance_image(image, panels[1]).set_title("Reflectance")

    # The measured frame.
    of_chirp = 0 if channel is None else channel
    frame_pictures.chirp(frame, of_chirp, ax=panels[-2]).set_title(f"First chirp, channel {of_chirp}")
    if wf.num_chirps > 1 and wf.has_uniform_chirps:
        drawn = frame_pictures.draw_map(panels[-1], seen, channel, max_range=max_range, max_velocity=max_velocity)
        names.append((panels[-1], drawn))
        panels[-1].set_title(f"Range and velocity{note}")
    else:
        frame_pictures.range_profile(seen, channel, panels[-1], max_range=max_range).set_title(f"Range{note}")
    if image is not None and (truth := frame.truth) is not None:
        across, up = np.tan(truth.azimuth), np.tan(truth.elevation) / np.cos(truth.azimuth)
        names += [(ax, frame_pictures.mark(ax, across, up, truth.names)) for ax in panels[:2]]

    # Names come last, when everything has its place.
    canvas.place_names(*((ax, points, "black") for ax, points in names))
    canvas.save(figure, path, overwrite=overwrite)
    return figure


def experiment(
    recording: Recording,
    scene: Scene,
    radar_motion: AnyMotion | None = None,
    estimates: Mapping[str, Any] | None = None,
    *,
    field_of_view_deg: tuple[float, float] | None = None,
    max_range: float | None = None,
    window_length: int | None = None,
    subtract_mean: bool = True,
    path: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> Figure:
    """A recording at a glance: the scene from above, power over range and velocity, tracks and spectrogram.

    Parameters
    ----------
    recording : Recording
        At least one frame, of more than one chirp at equal intervals.
    scene : Scene
        Scene of the recording.
    radar_motion : motion, optional
        Sensor to world, as `Simulator` takes it; default: the world's own frame.
    estimates : dict, optional
        Tracks by name, as in `tracks`; default: the truth alone.
    field_of_view_deg : (float, float), optional
        Horizontal and vertical angle of view [degrees]; default: from the recorded simulation, if any.
    max_range : float, optional
        End of the range axis of the map [m]; default: the largest unambiguous range.
    window_length : int, optional
        Chirps per column of the spectrogram; default: a frame.
    subtract_mean : bool
        Leave out of the spectrogram what stands still throughout.
    path : path, optional
        Save here, in the format of the suffix; missing parents are made.
    overwrite : bool
        Replace an existing picture.

    Returns
    -------
    figure : matplotlib Figure

    See Also
    --------
    plot.overview : A single frame at a glance.
    plot.spectrogram : One of its pictures.
    compare : Recordings and truth side by side.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> recording = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).record(0.0, 0.1)
    >>> figure = rc.plot.experiment(recording, scene)
    >>> len(figure.axes) > 3
    True
    """
    canvas.picture(path, overwrite)
    history.check_recording(recording)
    check.instance("scene", scene, Scene)
    colors = dict.fromkeys(scene.names, canvas.GREY)
    colors |= above.scene_colors(scene, recording.time, first=estimates or ())
    wf, middle = recording.radar.waveform, recording[len(recording) // 2]
    figure = canvas.new_figure(13.0, 9.4)
    first, last = float(recording.time[0]), float(recording.time[-1]) + wf.duration
    _headline(
        figure, f"{len(recording)} {'frames' if len(recording) > 1 else 'frame'}, {first:.2f} to {last:.2f} s", wf
    )
    grid = figure.add_gridspec(2, 2)
    from_above, on_map, at_bottom = (figure.add_subplot(grid[place]) for place in ((0, 0), (0, 1), (1, 1)))
    below = grid[1, 0].subgridspec(2, 1)
    ranges = figure.add_subplot(below[0])
    velocities = figure.add_subplot(below[1], sharex=ranges)

    # The scene and one frame of what the radar makes of it.
    times = np.linspace(first, last, 4)
    if field_of_view_deg is None:
        field_of_view_deg = recording.source.get("field_of_view_deg")
    scene_names = above.draw_scene(from_above, scene, radar_motion, times, field_of_view_deg, colors)
    from_above.set_title("Scene from above")
    map_names = frame_pictures.draw_map(on_map, middle, max_range=max_range)
    on_map.set_title(f"Range and velocity at {middle.time:.2f} s")

    # The whole recording.
    history.spectrogram(recording, at_bottom, window_length=window_length, subtract_mean=subtract_mean)
    at_bottom.set_title("Spectrogram")
    for ax, quantity in ((ranges, "range"), (velocities, "velocity")):
        history.draw_estimates(recording, estimates or {}, ax, quantity, colors)
        ax.set_xlim(at_bottom.get_xlim())
    figure.align_ylabels([ranges, velocities])
    ranges.set_xlabel("")
    ranges.tick_params(labelbottom=False)
    ranges.set_title("Truth (lines) and estimates (dots)" if estimates else "Truth")
    history.add_legends(ranges, velocities)

    # Names come last, when everything has its place.
    canvas.place_names((from_above, scene_names, "white"), (on_map, map_names, "black"))
    canvas.save(figure, path, overwrite=overwrite)
    return figure


def _headline(figure: Figure, text: str, wf: Waveform) -> None:
    figure.suptitle(
        f"{text}   ·   {wf.center_frequency / 1e9:.2f} GHz   ·   "
        f"bandwidth {wf.bandwidth / 1e9:.2f} GHz   ·   range bin {100.0 * wf.range_resolution:.1f} cm",
        fontsize=11,
        color="0.35",
    )
