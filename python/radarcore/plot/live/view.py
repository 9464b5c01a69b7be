"""A figure that follows a stream of frames, in a window, or as pictures where no window can be opened."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.output import already_exists, check_folder_name, make_folder, new_file
from radarcore.plot import canvas
from radarcore.plot.live.stream import LOWEST_DB, Detection, Stream
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame
from radarcore.recording.recording import frames_when_due

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (11.0, 6.2)
"""Width and height of a figure [inch]."""

_DYNAMIC_RANGE_DB = 60.0
"""Largest span of the colours [dB]."""

OUTPUT = Path("out/view")
"""Directory of the pictures without a window."""

STATIC_KEY = "m"
"""Key that removes and shows what stands still; matplotlib has no use for it."""

_TEXT_INTERVAL = 0.25
"""Time between two paintings of the headline and the list [s]: letters take as long as the maps."""

_WAITING = 16
"""Frames that wait for the window at most; then the source waits."""

_PATIENCE = 2.0
"""Time that the source may take for its last frame after the window is closed [s]."""


class LiveView:
    """Power over range and velocity of the newest frame, range over the last seconds, and detections.

    Made once for a radar: `update` takes a frame and changes what the artists show, `draw` paints them, alone where
    the canvas can blit. Nothing is added to the figure later.

    Levels are in dB over the noise, by the median of the frame's map (powers of all channels added). The history has
    the strongest velocity of every range; missing columns are grey. A radar of one or two chirps, or of unevenly spaced
    ones, tells no velocities: its newest frame is shown as power over range.

    Detections are the strongest of `detect`, beyond the leakage in the first two range bins, at least `threshold_db`
    over the surrounding noise and at most 25 dB below the strongest.

    Parameters
    ----------
    radar : Radar
        Radar of all frames.
    figure : matplotlib Figure, optional
        An empty one to draw in, such as a window's; default: a new one, not known to pyplot.
    title : str
        Headline.
    subtract_mean : bool
        Subtract the mean of the samples over the last seconds: static echoes, and the leakage of a real sensor.
    max_range : float, optional
        End of the range axis [m]; default: the largest unambiguous range.
    history : float
        Length of the time axis [s].
    threshold_db : float
        Smallest level of a detection [dB].
    max_detections : int
        Largest number to show.

    Attributes
    ----------
    figure : matplotlib Figure

    See Also
    --------
    plot.view : Shows frames in a window.
    plot.overview : A single frame at a glance.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> view = rc.plot.LiveView(frame.radar, subtract_mean=False)
    >>> view.update(frame)
    >>> [round(float(each.range), 1) for each in view.detections]
    [2.1]
    """

    def __init__(
        self,
        radar: Radar,
        *,
        figure: Figure | None = None,
        title: str = "",
        subtract_mean: bool = True,
        max_range: float | None = None,
        history: float = 10.0,
        threshold_db: float = 15.0,
        max_detections: int = 5,
    ) -> None:
        self._stream = Stream(
            radar,
            subtract_mean=subtract_mean,
            max_range=max_range,
            history=history,
            threshold_db=threshold_db,
            max_detections=max_detections,
        )
        self.figure: Figure = canvas.new_figure(*SIZE) if figure is None else figure
        self._limits = (0.0, 0.0)  # of the colours, set by the first frame
        self._background: Any = None  # painted beneath all artists that change
        self._with_texts: Any = None  # the background with the texts, painted beneath the pictures
        self._texts_due = 0.0
        self._pictures, self._texts = self._make_axes(title)
        self._pictures += self._make_marks(max_detections)
        for artist in [*self._pictures, *self._texts]:
            artist.set_animated(self.figure.canvas.supports_blit)
            artist.set_in_layout(False)
        self.figure.canvas.mpl_connect("draw_event", self._on_draw)
        self.subtract_mean = subtract_mean  # titles the history, shows that there is nothing yet

    @property
    def detections(self) -> tuple[Detection, ...]:
        """Range [m], velocity [m/s] and level [dB] of the newest frame's detections, by increasing range."""
        return tuple(self._stream.detections)

    @property
    def subtract_mean(self) -> bool:
        """True when static echoes are removed; a change empties the history."""
        return self._stream.subtract_mean

    @subtract_mean.setter
    def subtract_mean(self, value: bool) -> None:
        if value != self._stream.subtract_mean:
            self._stream.forget()
        self._stream.subtract_mean = check.flag("subtract_mean", value)
        self._history_axes.set_title(f"Range over time, static echoes {'removed' if value else 'shown'}")
        self._background = None
        self._show()

    def update(self, frame: Frame) -> None:
        """Show a frame: its number, map and detections, and one column more of the history.

        Raises
        ------
        ValueError
            For a frame of another radar.

        See Also
        --------
        plot.LiveView.draw : Paint what has changed.

        Examples
        --------
        >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
        >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
        >>> view = rc.plot.LiveView(frame.radar)
        >>> view.update(frame)
        >>> [(round(float(each.range), 1), round(float(each.velocity), 1)) for each in view.detections]
        [(2.1, -0.5)]
        """
        self._stream.take(frame)
        self._show()

    def draw(self) -> None:
        """Paint the changes of `update`: maps at once, texts a few times per second; everything if the scale changed.

        See Also
        --------
        plot.LiveView.save : Write a picture.

        Examples
        --------
        >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
        >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
        >>> view = rc.plot.LiveView(frame.radar)
        >>> view.update(frame)
        >>> view.draw()
        >>> [ax.get_title() for ax in view.figure.axes if ax.get_title()]
        ['Range and velocity', 'Range over time, static echoes removed']
        """
        painting: Any = self.figure.canvas
        if self._background is None:
            painting.draw()
        else:
            self._paint()
            painting.blit(self.figure.bbox)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the figure as a PNG picture; missing parents are made.

        Parameters
        ----------
        path : path
        overwrite : bool
            Replace an existing picture.

        See Also
        --------
        plot.view : A picture every second of any frames.

        Examples
        --------
        >>> import os
        >>> scene = rc.Scene([rc.PointTarget([2.0, 0.5, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
        >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
        >>> view = rc.plot.LiveView(frame.radar)
        >>> view.update(frame)
        >>> view.save("live.png")
        >>> os.path.getsize("live.png") > 0
        True
        """
        from matplotlib.image import imsave

        painting: Any = self.figure.canvas
        with new_file(Path(path), overwrite=overwrite, kind=".png") as part:
            if painting.supports_blit:  # the painted pixels, several times faster than `savefig`
                self._texts_due = 0.0
                self.draw()
                imsave(part, painting.buffer_rgba(), format="png", dpi=self.figure.dpi)
            else:
                self.figure.savefig(part, dpi=self.figure.dpi)

    def _make_axes(self, title: str) -> tuple[list[Artist], list[Artist]]:
        """Make the axes; the pictures and the texts in them that change."""
        stream = self._stream
        axes = self.figure.subplot_mosaic(
            [["headline", "headline"], ["now", "history"], ["list", "list"]],
            height_ratios=(0.06, 1.0, 0.22),
            width_ratios=(1.0, 1.2),
        )
        self._now_axes, self._history_axes = left, right = axes["now"], axes["history"]
        nearest, farthest = canvas.edges(stream.ranges, stream.radar.waveform.range_resolution)
        self._history = _image(right, stream.history.T, (-stream.seconds, 0.0, nearest, farthest))
        right.set(xlabel="Time [s, now is 0]", ylabel="Range [m]", ylim=(0.0, farthest))
        canvas.color_bar(right, self._history, "Power [dB over noise]")
        self._newest: Any
        if stream.velocities is None:
            (self._newest,) = left.plot(stream.ranges, np.full(len(stream.ranges), np.nan), linewidth=1.4)
            left.set(xlabel="Range [m]", ylabel="Power [dB over noise]", title="Range", xlim=(0.0, farthest))
            left.grid(alpha=0.3)
        else:
            extent = (*canvas.edges(stream.velocities, 1.0), nearest, farthest)
            self._newest = _image(left, stream.level.T, extent)
            left.set(xlabel="Velocity [m/s, receding positive]", ylabel="Range [m]", ylim=(0.0, farthest))
            left.set_title("Range and velocity")

        # The layout ignores clipped text, however long it is.
        style: dict[str, Any] = {"verticalalignment": "top", "parse_math": False, "clip_on": True}
        top, bottom = axes["headline"], axes["list"]
        top.set_axis_off()
        bottom.set_axis_off()
        top.text(0.0, 1.0, title, fontsize=12, fontweight="bold", **style)
        self._status = top.text(1.0, 1.0, "", fontsize=11, color="0.25", horizontalalignment="right", **style)
        style |= {"fontsize": 10, "linespacing": 1.4, "family": "monospace"}
        bottom.text(0.0, 1.0, "Detection\nRange [m]\nVelocity [m/s]\nOver noise [dB]", **style)
        self._list = bottom.text(0.12, 1.0, "", **style)
        return [self._history, self._newest], [self._status, self._list]

    def _make_marks(self, number: int) -> list[Artist]:
        """Rings with numbers, out of sight until something is detected."""
        from matplotlib.patheffects import withStroke

        inner, outer = ("C1", "white") if self._stream.velocities is None else ("white", "black")
        outline = [withStroke(linewidth=2.8, foreground=outer)]
        ring: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markersize": 11.0, "markeredgewidth": 1.4}
        (self._rings,) = self._now_axes.plot([], [], linestyle="", color=inner, path_effects=outline, **ring)
        text: dict[str, Any] = {"fontweight": "bold", "verticalalignment": "center", "clip_on": True, "visible": False}
        self._numbers = [
            self._now_axes.annotate(
                str(i + 1), (0.0, 0.0), (9, 0), textcoords="offset points", color=inner, path_effects=outline, **text
            )
            for i in range(number)
        ]
        return [self._rings, *self._numbers]

    def _show(self) -> None:
        """Hand the newest numbers to the artists."""
        stream = self._stream
        rate = "" if np.isnan(stream.rate) else f"{stream.rate:.1f} frames/s   ·   "
        number = stream.num_frames + stream.num_lost - 1
        status = f"frame {number}   ·   {stream.time:.2f} s   ·   {rate}{stream.num_lost} lost" if number >= 0 else ""
        self._status.set_text(status)
        self._list.set_text(_table(stream.detections))

        # The scale covers the whole history, in steps, so that it rarely changes.
        strongest = np.fmax.reduce(stream.history, axis=None)
        highest = 10.0 * np.ceil(max(20.0, 0.0 if np.isnan(strongest) else float(strongest)) / 10.0)
        limits = (max(0.0, highest - _DYNAMIC_RANGE_DB), highest)
        if limits != self._limits:
            self._limits, self._background = limits, None
            self._history.set_clim(*limits)
            if stream.velocities is None:
                self._now_axes.set_ylim(limits[0] + LOWEST_DB, highest + 5.0)

        self._history.set_data(stream.history.T)
        if stream.velocities is None:
            self._newest.set_ydata(stream.level[0])
            points = [(found.range, found.level_db) for found in stream.detections]
        else:
            self._newest.set(data=stream.level.T, clim=limits)
            points = [(found.velocity, found.range) for found in stream.detections]
        self._rings.set_data([x for x, _ in points], [y for _, y in points])
        for label in self._numbers:
            label.set_visible(False)
        for label, point in zip(self._numbers, points, strict=False):
            label.set_visible(True)
            label.xy = point

    def _on_draw(self, _: object) -> None:
        """Keep the drawn background, after any redraw, and draw the moving parts on top."""
        painting: Any = self.figure.canvas
        self._background = None
        if painting.supports_blit and not painting.is_saving():
            self._background = painting.copy_from_bbox(self.figure.bbox)
            self._texts_due = 0.0
            self._paint()

    def _paint(self) -> None:
        """Paint the artists that change over the background."""
        painting: Any = self.figure.canvas
        if (now := time.perf_counter()) >= self._texts_due:
            painting.restore_region(self._background)
            for text in self._texts:
                self.figure.draw_artist(text)
            self._with_texts = painting.copy_from_bbox(self.figure.bbox)
            self._texts_due = now + _TEXT_INTERVAL
        painting.restore_region(self._with_texts)
        for picture in self._pictures:
            self.figure.draw_artist(picture)


def _image(ax: Axes, levels: NDArray[np.float32], extent: tuple[float, float, float, float]) -> Any:
    """Cells of equal size; levels without a value are grey."""
    return ax.imshow(
        levels,
        cmap=canvas.color_map("inferno"),
        vmin=0.0,
        vmax=1.0,
        extent=extent,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )


def _table(found: Sequence[Detection]) -> str:
    """Detections side by side, in letters of one width."""
    columns = []
    for number, one in enumerate(found, 1):
        velocity = "–" if np.isnan(one.velocity) else f"{round(one.velocity, 2) + 0.0:+.2f}"  # no "-0.00"
        columns.append((f"{number}", f"{one.range:.2f}", velocity, f"{one.level_db:.0f}"))
    return "\n".join("".join(f"{cell:>9}" for cell in cells) for cells in zip(*columns, strict=True))


def view(
    frames: Iterable[Frame],
    *,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    every: float = 1.0,
    title: str = "",
    subtract_mean: bool | None = None,
    paced: bool = False,
    hold: bool = False,
    say: Callable[[str], None] | None = None,
    **options: Any,
) -> int:
    """Show frames until they end, the window is closed, or Ctrl-C is pressed.

    In a window every frame enters the history, and the newest is drawn as often as drawing allows; frames are taken
    in a thread of their own, so that a slow source does not freeze the window. Key `m` removes and shows what stands
    still. Without a display, with a backend that has no windows, or with `output`, pictures are written instead.

    Parameters
    ----------
    frames : iterable of Frame
        Frames of one radar: a sensor's, a recording's, a simulator's.
    output : path, optional
        Directory for PNG pictures instead of a window; made if missing. Default without a window: ``out/view``.
    overwrite : bool
        Replace pictures of an earlier view.
    every : float
        A picture whenever this much time of the frames has passed [s], and one of the last frame.
    title : str
        Headline.
    subtract_mean : bool, optional
        As in `LiveView`; default: yes, unless the first frame has truth, as simulated ones do: where nothing moves,
        there would be nothing to see.
    paced : bool
        In a window, take frames no faster than their times tell: for recordings and quick simulations.
    hold : bool
        Leave the window open after the last frame, until it is closed.
    say : callable, optional
        Gets a line of text about what is going on, such as where pictures are.
    **options
        Further keywords of `LiveView`.

    Returns
    -------
    num_frames : int
        Shown or, in a window, passed over for newer ones.

    Raises
    ------
    Exception
        Errors of the source, after the last picture is written.

    See Also
    --------
    plot.LiveView : The figure alone, for windows of one's own.
    sensor.Sensor.frames : Frames of a board.
    Recording.replay : Frames of a recording, each when it is due.

    Examples
    --------
    >>> rc.plot.view(recording.frames(), output="pictures", every=10.0)
    12
    """
    canvas.require()
    check.positive("every", every, "s")
    tell = say or (lambda _: None)

    def live(first: Frame, figure: Figure | None = None) -> LiveView:
        check.instance("frames", first, Frame)
        removes = first.truth is None if subtract_mean is None else subtract_mean
        return LiveView(first.radar, figure=figure, title=title, subtract_mean=removes, **options)

    if output is not None:
        return _write(frames, live, Path(output), every, tell, overwrite)
    figure = _new_window(title)
    if figure is not None:
        tell(f"key {STATIC_KEY} shows or removes what stands still; close the window or press Ctrl-C to end")
        return _play(frames, lambda first: live(first, figure), figure, paced=paced, hold=hold)
    tell("no window: there is no display, or matplotlib has no backend for it; writing pictures")
    return _write(frames, live, OUTPUT, every, tell, overwrite)


def _write(
    frames: Iterable[Frame],
    live_of: Callable[[Frame], LiveView],
    directory: Path,
    every: float,
    say: Callable[[str], None],
    overwrite: bool,
) -> int:
    """A picture at regular intervals, and one of the last frame, with any end of the frames."""
    check_folder_name(directory)
    if not overwrite and (taken := next(directory.glob("view-*.png"), None)) is not None:
        raise already_exists(taken, "a picture of an earlier view; overwrite=True replaces it")
    live: LiveView | None = None
    num_frames = num_pictures = num_shown = 0
    due = 0.0
    try:
        for frame in frames:
            if live is None:
                live, due = live_of(frame), frame.time + every
                make_folder(directory)
                say(f"{directory}: a picture every {every:g} s")
            live.update(frame)
            num_frames += 1
            if not due - every <= frame.time < due:  # also where a source starts again
                live.save(directory / f"view-{num_frames - 1:06d}.png", overwrite=overwrite)
                num_pictures, num_shown, due = num_pictures + 1, num_frames, frame.time + every
    except KeyboardInterrupt:
        pass
    finally:
        if live is not None and num_shown < num_frames:
            live.save(directory / f"view-{num_frames - 1:06d}.png", overwrite=overwrite)
            num_pictures += 1
        say(f"{directory}: {num_pictures} pictures of {num_frames} frames" if num_frames else "no frames came")
    return num_frames


def _new_window(title: str) -> Figure | None:
    """Empty figure in a window of pyplot's; None if there can be none."""
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not has_display:
        return None
    try:
        from matplotlib import pyplot as plt

        figure = plt.figure(figsize=SIZE, dpi=100)
    except ImportError:  # a backend requested by name does not work here
        return None
    if figure.canvas.required_interactive_framework is None or figure.canvas.manager is None:
        plt.close(figure)
        return None
    figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.08)
    figure.canvas.manager.set_window_title(title or "radarcore")
    figure.show()
    return figure


def _play(
    frames: Iterable[Frame], live_of: Callable[[Frame], LiveView], figure: Figure, *, paced: bool, hold: bool
) -> int:
    """Draw the newest frame whenever the last is drawn, and let the window live in between."""
    from matplotlib import pyplot as plt

    live: LiveView | None = None
    num_frames = 0
    is_closed, is_stopped = threading.Event(), threading.Event()

    def press(event: Any) -> None:
        if event.key == STATIC_KEY and live is not None:
            live.subtract_mean = not live.subtract_mean
            live.draw()

    figure.canvas.mpl_connect("close_event", lambda _: is_closed.set())
    figure.canvas.mpl_connect("key_press_event", press)
    with _ctrl_c(is_stopped.set):
        source = _Source(frames_when_due(frames) if paced else frames)
        try:
            while not (is_closed.is_set() or is_stopped.is_set()) and (
                source.has_more or (hold and source.error is None)
            ):
                news = list(source.waiting())
                for frame in news:
                    live = live_of(frame) if live is None else live
                    live.update(frame)
                num_frames += len(news)
                if live is not None and news:
                    live.draw()
                figure.canvas.start_event_loop(0.001 if news else 0.01)
        finally:
            source.stop()
            if not is_closed.is_set():
                plt.close(figure)
    if source.error is not None and not isinstance(source.error, KeyboardInterrupt):
        raise source.error
    return num_frames


@contextmanager
def _ctrl_c(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` at Ctrl-C instead of raising, which a window's own callbacks may swallow."""
    if threading.current_thread() is not threading.main_thread():  # others get no signals
        yield
        return
    before = signal.signal(signal.SIGINT, lambda *_: stop())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Source:
    """Frames taken in a separate thread; a few wait for drawing."""

    def __init__(self, frames: Iterable[Frame]) -> None:
        self.error: BaseException | None = None
        """Error that ended the frames; None at the end of the source."""
        self._waiting: queue.Queue[Frame] = queue.Queue(_WAITING)
        self._unwanted = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(frames,), name="frames to show", daemon=True)
        self._thread.start()

    @property
    def has_more(self) -> bool:
        """True while frames wait, or may come."""
        return self._thread.is_alive() or not self._waiting.empty()

    def waiting(self) -> Iterator[Frame]:
        """The frames that wait now, in order."""
        for _ in range(self._waiting.qsize()):
            yield self._waiting.get_nowait()

    def stop(self) -> None:
        """Take no more frames. A source that is stuck is left behind."""
        self._unwanted.set()
        list(self.waiting())  # room for a frame that waits to be put
        self._thread.join(_PATIENCE)

    def _run(self, frames: Iterable[Frame]) -> None:
        """Read frames until they end or the window is closed."""
        try:
            for frame in frames:
                self._waiting.put(frame)
                if self._unwanted.is_set():
                    return
        except BaseException as error:  # of whatever kind: it is raised again where the frames are shown
            self.error = error
