"""Frames shown as they come: in a window, or as pictures where no window can be opened."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarcore import check
from radarcore.output import already_exists, make_folder
from radarcore.plot import canvas
from radarcore.plot.live.view import SIZE, LiveView
from radarcore.recording.frame import Frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUT = Path("out/view")
"""Directory of the pictures without a window."""

STATIC_KEY = "m"
"""Key that removes and shows what stands still; matplotlib has no use for it."""

_WAITING = 16
"""Frames that wait for the window at most; then the source waits."""

_PATIENCE = 2.0
"""Time that the source may take for its last frame after the window is closed [s]."""


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
    tell = say if say is not None else _silent

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
    """A picture of every so many seconds, and one of the last frame however the frames end."""
    if not overwrite and (taken := next(directory.glob("view-*.png"), None)) is not None:
        raise already_exists(taken, "a picture of an earlier view; overwrite=True replaces it")
    live: LiveView | None = None
    num_frames = num_pictures = 0
    is_shown, due = True, 0.0

    def picture() -> None:
        nonlocal num_pictures, is_shown
        if live is not None and not is_shown:
            live.save(directory / f"view-{num_frames - 1:06d}.png", overwrite=overwrite)
            num_pictures, is_shown = num_pictures + 1, True

    try:
        for frame in frames:
            if live is None:
                live, due = live_of(frame), frame.time + every
                make_folder(directory)
                say(f"{directory}: a picture every {every:g} s")
            live.update(frame)
            num_frames, is_shown = num_frames + 1, False
            if not due - every <= frame.time < due:  # also where a source starts again
                picture()
                due = frame.time + every
    except KeyboardInterrupt:
        pass
    finally:
        picture()
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
    except ImportError:  # a backend was asked for by name that does not work here
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
    num_frames, is_open, is_wanted = 0, True, True

    def close(_: object) -> None:
        nonlocal is_open
        is_open = False

    def stop() -> None:
        nonlocal is_wanted
        is_wanted = False

    def press(event: Any) -> None:
        if event.key == STATIC_KEY and live is not None:
            live.subtract_mean = not live.subtract_mean
            live.draw()

    figure.canvas.mpl_connect("close_event", close)
    figure.canvas.mpl_connect("key_press_event", press)
    with _ctrl_c(stop):
        source = _Source(frames, paced)
        try:
            while is_open and is_wanted and (source.has_more or (hold and source.error is None)):
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
            if is_open:
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
    """Frames taken in a thread of their own, a few of which wait to be drawn."""

    def __init__(self, frames: Iterable[Frame], paced: bool) -> None:
        self.error: BaseException | None = None
        """Error that ended the frames; None at the end of the source."""
        self._frames, self._paced = frames, paced
        self._waiting: queue.Queue[Frame] = queue.Queue(_WAITING)
        self._unwanted = threading.Event()
        self._thread = threading.Thread(target=self._run, name="frames to show", daemon=True)
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
        self._thread.join(_PATIENCE)

    def _run(self) -> None:
        """Read frames until they end or the window is closed."""
        began, start = 0.0, None
        try:
            for frame in self._frames:
                if start is None or frame.time < start:  # the first, or the source starts again
                    began, start = time.perf_counter(), frame.time
                if self._paced:
                    self._unwanted.wait(max(0.0, began + frame.time - start - time.perf_counter()))
                while not self._unwanted.is_set():
                    try:
                        self._waiting.put(frame, timeout=0.1)
                        break
                    except queue.Full:
                        pass
                if self._unwanted.is_set():
                    return
        except BaseException as error:  # of whatever kind: it is raised again where the frames are shown
            self.error = error


def _silent(_: str) -> None:
    pass
