"""The live view shows targets at their true places, does not grow, and ends cleanly with any end of frames."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore import plot
from radarcore.plot.live.stream import Stream
from radarcore.recording.frame import Frame, Truth
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

matplotlib = pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
backend_bases = pytest.importorskip("matplotlib.backend_bases")
imread = pytest.importorskip("matplotlib.image").imread

INTERVAL = 0.05  # [s], of frames
NOISE = 1e-6  # standard deviation of a sample, sqrt(W): echoes stand 41 dB over it


def radar(*, real: bool = True, slope: float = 100e12, **changes: Any) -> rc.Radar:
    """Two channels; bins of 4.7 cm, and of 0.39 m/s with 16 chirps."""
    settings: dict[str, Any] = {"num_samples": 64, "num_chirps": 16, "chirp_interval": 400e-6} | changes
    wf = rc.Waveform(start_frequency=60e9, slope=slope, sample_rate=2e6, frame_interval=INTERVAL, **settings)
    return rc.Radar(wf, rx=[[0, 0, 0], [0, 0.0025, 0]], receiver=rc.Receiver(output="real") if real else None)


RADAR = radar()


def frame(
    range_: float = 0.8, velocity: float = -0.9, number: int = 0, of: rc.Radar = RADAR, *, static: float = 0.0
) -> Frame:
    """An echo that is `range_` away in the middle of the frame, noise, and what leaks, `static` times as strong."""
    wf = of.waveform
    start = np.array([range_ - 0.5 * wf.duration * velocity, 0.03])
    rates = 2.0 * np.array([velocity, 0.0]) / SPEED_OF_LIGHT
    cube = beat_signal_reference(2.0 * start / SPEED_OF_LIGHT, [1e-5, 1e-5 * static], wf, rates)
    samples = np.broadcast_to(cube, (2, *cube.shape[1:]))
    rng = np.random.default_rng(number)
    noise = NOISE * (rng.standard_normal(samples.shape) + 1j * rng.standard_normal(samples.shape))
    values = (samples + noise).astype(np.complex64)
    return Frame(values.real.copy() if of.is_real else values, number * INTERVAL, of)


def approach(num_frames: int, first: int = 0, **options: Any) -> list[Frame]:
    """A target that comes nearer at 0.12 m/s from 0.8 m: 6 mm per frame, 2.5 waves there and back."""
    return [frame(0.8 - 0.12 * INTERVAL * i, -0.12, i, **options) for i in range(first, first + num_frames)]


def stream(frames: Iterable[Frame], **options: Any) -> Stream:
    """State of the view after some frames, without drawing."""
    taken: Stream | None = None
    for each in frames:
        taken = taken or Stream(each.radar, **options)
        taken.take(each)
    assert taken is not None
    return taken


def shown(live: plot.LiveView) -> dict[str, Any]:
    """The axes by their title."""
    return {ax.get_title().partition(",")[0]: ax for ax in live.figure.axes if ax.get_title()}


def texts(live: plot.LiveView) -> str:
    return "|".join(text.get_text() for ax in live.figure.axes for text in ax.texts)


def columns(live: plot.LiveView) -> NDArray[np.bool_]:
    """True for columns of the history with a level, oldest first."""
    levels = shown(live)["Range over time"].images[0].get_array()
    return ~np.ma.getmaskarray(levels).all(axis=0)


@pytest.mark.parametrize(
    ("real", "slope", "velocity"),
    [(True, 100e12, -2.2), (True, -100e12, 0.0), (False, 100e12, 1.7), (False, -100e12, -2.2)],
)
def test_moving_target_is_detected_where_it_is(real: bool, slope: float, velocity: float) -> None:
    of = radar(real=real, slope=slope, adc_delay=2e-6)
    (found,) = stream([frame(0.83, velocity, of=of)], subtract_mean=False).detections
    # The parabola on a four times finer grid is good to 0.02 bins. At 2.2 m/s the Doppler frequency moves the beat
    # frequency by 0.03 bins, up or down with the slope.
    assert abs(found.range - 0.83) <= 0.02 * of.waveform.range_resolution
    assert abs(found.velocity - velocity) <= 0.02 * of.waveform.velocity_resolution


def test_detection_is_marked_and_listed() -> None:
    live = plot.LiveView(RADAR, subtract_mean=False)
    live.update(frame(0.8, -0.9))
    (found,) = live.detections
    (rings,) = shown(live)["Range and velocity"].lines
    np.testing.assert_array_equal(rings.get_xydata(), [[found.velocity, found.range]])
    listed = f"1 {found.range:.2f} {found.velocity:+.2f} {found.level_db:.0f}"
    assert listed.split() in [text.split() for text in texts(live).split("|")]
    assert "-0.00" not in texts(live)

    # The cell of the target is the brightest of the map, and of the newest column.
    picture = shown(live)["Range and velocity"].images[0]
    level = picture.get_array().argmax()
    left, right, nearest, farthest = picture.get_extent()
    rows, width = picture.get_array().shape[:2]
    row, column = np.unravel_index(level, (rows, width))
    assert abs(nearest + (row + 0.5) * (farthest - nearest) / rows - 0.8) <= 0.5 * RADAR.waveform.range_resolution
    assert abs(left + (column + 0.5) * (right - left) / width + 0.9) <= 0.5 * RADAR.waveform.velocity_resolution
    newest = shown(live)["Range over time"].images[0].get_array()[:, -1]
    assert newest[row] == newest.max()


def test_level_is_power_over_the_noise_of_a_cell() -> None:
    # One real tone of amplitude a in white noise of variance s^2, Hann windows with the mean square 3/8: the cell
    # has (a/2)^2 (N/2)^2 (M/2)^2 over s^2 (3/8) N (3/8) M, once per channel.
    levels = [stream([frame(number=i)], subtract_mean=False).detections[0].level_db for i in range(20)]
    wf = RADAR.waveform
    ratio = (0.5e-5) ** 2 * wf.num_samples * wf.num_chirps / 16.0 / (NOISE**2 * (3.0 / 8.0) ** 2)
    expected = 10.0 * np.log10(ratio)
    # The median of a few hundred training cells scatters by 4 % (0.2 dB); the fit is not off the maximum.
    assert np.mean(levels) == pytest.approx(expected, abs=0.2)


def test_noise_alone_and_a_limit_of_none_have_no_detections() -> None:
    assert stream([frame()], subtract_mean=False, max_detections=0).detections == []
    rng = np.random.default_rng(3)
    for number in range(20):
        noise = rng.standard_normal(frame().cube.shape).astype(np.float32)
        assert stream([Frame(noise, number * INTERVAL, RADAR)], subtract_mean=False).detections == []


def test_static_echoes_are_shown_or_removed() -> None:
    live = plot.LiveView(RADAR)
    for i in range(4):
        live.update(frame(0.8, 0.0, i))
    assert live.detections == ()
    assert "removed" in shown(live)["Range over time"].get_title()
    assert columns(live).any()

    live.subtract_mean = False
    assert not columns(live).any()
    live.update(frame(0.8, 0.0, 4))
    assert len(live.detections) == 1
    assert "shown" in shown(live)["Range over time"].get_title()


def test_slow_target_is_found_behind_leakage_40_db_above_it() -> None:
    (found,) = stream(approach(20, static=100.0)).detections
    assert abs(found.range - (0.8 - 0.12 * INTERVAL * 19)) <= 0.01 * RADAR.waveform.range_resolution


def test_history_scrolls_by_time_and_shows_pauses() -> None:
    taken = stream(approach(10), history=2.0)  # 40 columns of a frame each
    expected = np.zeros(40, dtype=bool)
    expected[-10:] = True
    np.testing.assert_array_equal(np.isfinite(taken.history).all(axis=1), expected)
    np.testing.assert_array_equal(np.isfinite(taken.history).any(axis=1), expected)

    for each in approach(5, first=15):  # five frames are missing
        taken.take(each)
    expected[-20:] = True
    expected[-10:-5] = False
    np.testing.assert_array_equal(np.isfinite(taken.history).all(axis=1), expected)

    for number in (1000, 3):  # a long pause, and a source that starts again
        taken.take(frame(number=number))
        assert np.isfinite(taken.history).all(axis=1).nonzero()[0].tolist() == [39]


def test_history_has_no_holes_where_frames_are_slow_and_uneven() -> None:
    rng = np.random.default_rng(5)
    times = 3.3 * INTERVAL * np.arange(8) + 0.3 * INTERVAL * rng.random(8)
    taken = stream((Frame(frame(number=i).cube, t, RADAR) for i, t in enumerate(times)), history=2.0)
    filled = np.isfinite(taken.history).all(axis=1)
    assert filled[np.argmax(filled) :].all()
    assert filled.sum() == 1 + round((times[-1] - times[0]) / INTERVAL)


def test_unknown_losses_count_as_none() -> None:
    first, second = frame(), frame(number=1)
    told = (
        Frame(each.cube, each.time, RADAR, stats={"lost_before": lost}) for each, lost in ((first, None), (second, 2))
    )
    assert stream(told).num_lost == 2


def test_headline_tells_number_time_rate_and_losses() -> None:
    live = plot.LiveView(RADAR, title="Hall $2")
    assert "frame" not in texts(live)
    for each in approach(3):
        live.update(each)
    first = frame(number=8)
    live.update(Frame(first.cube, first.time, RADAR, stats={"lost_before": 5}))
    # Four frames received in 8 intervals of 50 ms.
    assert "frame 8   ·   0.40 s   ·   7.5 frames/s   ·   5 lost" in texts(live)
    assert "Hall $2" in texts(live)


def test_long_title_takes_no_room_from_the_picture(tmp_path: Path) -> None:
    live = plot.LiveView(RADAR, title=40 * "a-long-path/")
    live.update(frame())
    live.save(tmp_path / "view.png")  # matplotlib warns of a layout without room for axes


def test_updates_add_no_artists_and_redraw_no_background(tmp_path: Path) -> None:
    live = plot.LiveView(RADAR, history=2.0)
    counts, redrawn = [], []
    live.figure.canvas.mpl_connect("draw_event", redrawn.append)
    for i in range(4):
        live.update(frame(0.8 - 0.002 * i, -0.9, i))
        live.draw()
        live.save(tmp_path / f"{i}.png")
        counts.append(len(live.figure.findobj()))
    assert len(set(counts[1:])) == 1
    assert len(redrawn) == 1
    assert not np.array_equal(imread(tmp_path / "2.png"), imread(tmp_path / "3.png"))


def test_partial_drawing_leaves_the_picture_of_a_whole_one() -> None:
    live = plot.LiveView(RADAR)
    for each in approach(6, static=1.0):
        live.update(each)
        live.draw()
    painted: Any = live.figure.canvas
    partial = np.array(painted.buffer_rgba())
    painted.draw()
    whole = np.array(painted.buffer_rgba())
    for name in ("Range and velocity", "Range over time"):
        box = shown(live)[name].bbox.padded(-2)  # within the spines
        rows = slice(len(whole) - int(box.y1), len(whole) - int(box.y0))
        columns = slice(int(box.x0), int(box.x1))
        assert whole[rows, columns].std() > 5.0
        np.testing.assert_array_equal(partial[rows, columns], whole[rows, columns])


@pytest.mark.parametrize(
    "chirps",
    [{"num_chirps": 1}, {"num_chirps": 2}, {"num_chirps": 3, "chirp_interval": None, "chirp_times": [0.0, 4e-4, 1e-3]}],
)
def test_frames_without_velocity_show_range_alone(chirps: dict[str, Any]) -> None:
    of = radar(**chirps)
    live = plot.LiveView(of, subtract_mean=False)
    live.update(frame(0.8, 0.0, of=of))
    (found,) = live.detections
    assert abs(found.range - 0.8) <= 0.1 * of.waveform.range_resolution  # noise 29 dB below it: 0.02 bins
    assert np.isnan(found.velocity)
    assert "Range and velocity" not in shown(live)
    profile = shown(live)["Range"].lines[0]
    peak = profile.get_xdata()[np.argmax(profile.get_ydata())]
    assert abs(peak - 0.8) <= 0.5 * of.waveform.range_resolution
    assert "–" in texts(live)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf], ids=["silence", "nan", "inf"])
def test_frames_without_content_show_nothing_and_do_not_spoil_the_next(value: float) -> None:
    taken = stream(approach(3), subtract_mean=False)
    cube = np.zeros_like(frame().cube)
    cube[0, 3, 5] = value
    taken.take(Frame(cube, 3 * INTERVAL, RADAR))
    assert taken.detections == []
    assert np.isfinite(taken.level).all() == (value == 0.0)
    for each in approach(3, first=4):
        taken.take(each)
    assert len(taken.detections) == 1
    taken.subtract_mean = True
    for each in approach(3, first=7):
        taken.take(each)
    assert len(taken.detections) == 1


def test_frame_that_is_not_finite_is_drawn_as_missing() -> None:
    live = plot.LiveView(RADAR, history=2.0)
    live.update(frame())
    live.update(Frame(np.full_like(frame().cube, np.nan), INTERVAL, RADAR))
    live.draw()
    assert columns(live)[-2:].tolist() == [True, False]
    assert np.ma.getmaskarray(shown(live)["Range and velocity"].images[0].get_array()).all()


@pytest.mark.parametrize(("real", "num_samples"), [(True, 1), (True, 2), (False, 1), (False, 3)])
def test_tiny_frames_have_levels(real: bool, num_samples: int) -> None:
    of = radar(real=real, num_samples=num_samples, num_chirps=3)
    taken = stream(frame(number=i, of=of) for i in range(3))
    assert np.isfinite(taken.level).all()
    assert taken.level.shape == (12, len(taken.ranges))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: plot.LiveView(RADAR, max_range=-1.0), ValueError, "max_range"),
        (lambda: plot.LiveView(RADAR, history=0.0), ValueError, "history"),
        (lambda: plot.LiveView(RADAR, threshold_db=np.nan), ValueError, "threshold_db"),
        (lambda: plot.LiveView(RADAR, max_detections=-1), ValueError, "max_detections"),
        (lambda: plot.LiveView("bgt60tr13c"), TypeError, "radar: expected Radar"),  # type: ignore[arg-type]
        (lambda: plot.LiveView(RADAR).update(frame(of=radar(num_samples=32))), ValueError, "frame: expected one of th"),
        (lambda: plot.LiveView(RADAR).update(3), TypeError, "frame: expected Frame, got int"),  # type: ignore[arg-type]
        (lambda: plot.view([], every=0.0), ValueError, "every"),
        (lambda: plot.view([3], output="nowhere"), TypeError, "frames: expected Frame, got int"),  # type: ignore[list-item]
    ],
)
def test_silly_arguments_are_refused(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_pictures_are_written_by_the_time_of_frames_and_at_the_end(tmp_path: Path) -> None:
    said: list[str] = []
    frames = approach(25)
    assert plot.view(frames, output=tmp_path / "a" / "b", every=0.5, title="Room", say=said.append) == 25
    names = sorted(path.name for path in (tmp_path / "a" / "b").iterdir())
    assert names == ["view-000010.png", "view-000020.png", "view-000024.png"]
    for name in names:
        picture = imread(tmp_path / "a" / "b" / name)
        assert picture.shape[1] == 1100
        assert picture[..., :3].std() > 0.1  # a blank one has 0
    assert said[0].endswith("a picture every 0.5 s")
    assert said[-1].endswith("3 pictures of 25 frames")


def test_simulated_frames_show_what_is_static_and_measured_ones_do_not(tmp_path: Path) -> None:
    def last(truth: Truth | None) -> NDArray[Any]:
        frames = [Frame(frame(0.8, 0.0, i).cube, i * INTERVAL, RADAR, truth) for i in range(3)]
        plot.view(frames, output=tmp_path, overwrite=True)
        return np.asarray(imread(tmp_path / "view-000002.png"))

    zero = np.zeros(1)
    measured, simulated = last(None), last(Truth(("wall",), zero + 0.8, zero, zero, zero))
    # The list of detections lies below the maps.
    rows = slice(int(0.83 * len(measured)), None)
    assert (simulated[rows, :, :3] < 0.5).sum() > 1.02 * (measured[rows, :, :3] < 0.5).sum()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere a window does not need DISPLAY")
@pytest.mark.parametrize("display", ["", ":1"], ids=["no display", "a backend without windows"])
def test_without_a_window_pictures_go_to_out_view(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, display: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setitem(matplotlib.rcParams, "backend", "Agg")
    said: list[str] = []
    plot.view(approach(2), say=said.append)
    assert (tmp_path / "out" / "view" / "view-000001.png").is_file()
    assert display or "no display" in said[0]


def test_no_frames_make_no_pictures(tmp_path: Path) -> None:
    said: list[str] = []
    assert plot.view([], output=tmp_path / "none", say=said.append) == 0
    assert not (tmp_path / "none").exists()
    assert said == ["no frames came"]


def interrupted(error: BaseException) -> Iterator[Frame]:
    yield from approach(3)
    raise error


def test_ctrl_c_and_errors_of_the_source_end_with_the_last_picture(tmp_path: Path) -> None:
    assert plot.view(interrupted(KeyboardInterrupt()), output=tmp_path) == 3
    with pytest.raises(OSError, match="unplugged"):
        plot.view(interrupted(OSError("unplugged")), output=tmp_path / "again")
    for folder in (tmp_path, tmp_path / "again"):
        assert [path.name for path in folder.glob("*.png")] == ["view-000002.png"]


def play(frames: Any, *, paced: bool = False, hold: bool = False) -> tuple[int, plot.LiveView | None]:
    """Window on a canvas without one: event loop, callbacks and blitting are real."""
    from radarcore.plot import canvas
    from radarcore.plot.live.view import SIZE, _play

    figure, made = canvas.new_figure(*SIZE), []

    def live(first: Frame) -> plot.LiveView:
        made.append(plot.LiveView(first.radar, figure=figure))
        return made[0]

    given = frames(figure.canvas) if callable(frames) else frames
    return _play(given, live, figure, paced=paced, hold=hold), made[0] if made else None


def test_window_takes_every_frame_and_ends_with_them() -> None:
    number, live = play(approach(40))
    assert number == 40
    assert live is not None
    assert columns(live).sum() == 40
    assert play([])[0] == 0


ENDLESS = 5_000


def endless(stop: Callable[[], object]) -> Iterator[Frame]:
    """Frames for far longer than the window is open, which the sixth stops."""
    for i in range(ENDLESS):
        if i == 5:
            stop()
        yield frame(number=i)
        time.sleep(0.002)


def close(canvas: Any) -> None:
    canvas.callbacks.process("close_event", backend_bases.CloseEvent("close_event", canvas))


def test_window_ends_when_it_is_closed_though_frames_go_on() -> None:
    assert play(lambda canvas: endless(lambda: close(canvas)))[0] < ENDLESS


def test_held_window_stays_until_it_is_closed() -> None:
    began: list[float] = []

    def frames(canvas: Any) -> Iterator[Frame]:
        yield from approach(2)
        began.append(time.perf_counter())
        threading.Timer(0.3, close, (canvas,)).start()

    assert play(frames, hold=True)[0] == 2
    assert time.perf_counter() - began[0] >= 0.3


def test_window_passes_on_what_the_source_raises_but_not_ctrl_c() -> None:
    with pytest.raises(OSError, match="unplugged"):
        play(interrupted(OSError("unplugged")), hold=True)
    assert play(interrupted(KeyboardInterrupt()))[0] <= 3


def test_window_ends_at_ctrl_c_and_leaves_its_handling_as_it_was() -> None:
    before = signal.getsignal(signal.SIGINT)
    assert play(endless(lambda: os.kill(os.getpid(), signal.SIGINT)))[0] < ENDLESS
    assert signal.getsignal(signal.SIGINT) is before


def test_paced_frames_come_no_faster_than_their_times() -> None:
    began = time.perf_counter()
    play(approach(5), paced=True)
    assert time.perf_counter() - began >= 4 * INTERVAL


def test_key_shows_what_is_static() -> None:
    pressed = []

    def frames(canvas: Any) -> list[Frame]:
        def events(_: float) -> None:  # in the thread of the window, like a user's
            shown = [text.get_text() for ax in canvas.figure.axes for text in ax.texts]
            if not pressed and any("frame 2" in text for text in shown):
                pressed.append("m")
                canvas.callbacks.process("key_press_event", backend_bases.KeyEvent("key_press_event", canvas, "m"))

        canvas.start_event_loop = events
        return approach(3)

    _, live = play(frames)
    assert live is not None
    assert not live.subtract_mean


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs Xvfb, a display without a screen")
def test_window_opens_shows_frames_and_ends_at_ctrl_c(tmp_path: Path) -> None:
    pytest.importorskip("tkinter")
    script = """
import itertools, sys, time
from test_live import frame
from radarcore import plot
def frames():
    for i in itertools.count():
        time.sleep(0.02)
        yield frame(number=i)
        if i == 20:
            print('running', flush=True)
print(plot.view(frames(), title='Window'), 'frames')
"""
    screen = ["Xvfb", "-displayfd", "1", "-screen", "0", "1280x800x24"]
    with subprocess.Popen(screen, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        try:
            assert server.stdout is not None
            display = f":{int(server.stdout.readline())}"
            environment = os.environ | {"DISPLAY": display, "MPLBACKEND": "TkAgg", "PYTHONPATH": ":".join(sys.path)}
            with subprocess.Popen(
                [sys.executable, "-c", script], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
            ) as window:
                try:
                    assert window.stdout is not None
                    assert window.stdout.readline() == "running\n"
                    window.send_signal(signal.SIGINT)
                    said, _ = window.communicate(timeout=60)
                finally:
                    window.kill()
        finally:
            server.terminate()
    assert window.returncode == 0
    number, word = said.split()
    assert (int(number) > 0, word) == (True, "frames")
    assert not (tmp_path / "out").exists()  # no pictures: it was a window
