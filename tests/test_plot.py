"""Pictures: what is drawn where, that labels stay apart, and that importing and drawing touch nothing global."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarcore import plot
from radarcore.radar import Radar
from radarcore.receiver import Receiver
from radarcore.recording import Frame, Truth
from radarcore.units import SPEED_OF_LIGHT
from radarcore.waveform import Waveform
from reference import beat_signal_reference

figure_module = pytest.importorskip("matplotlib.figure")

NAMES = ("wall", "arm", "hidden", "behind")
RANGE = np.array([1.9, 0.9, np.nan, 50.0])
VELOCITY = np.array([0.0, -0.8, np.nan, 0.0])
AZIMUTH = np.deg2rad([-20.0, 5.0, np.nan, 80.0])
ELEVATION = np.deg2rad([12.0, -3.0, np.nan, 0.0])


def frame(*, real: bool = True, truth: bool = True, **changes: Any) -> Frame:
    """Two targets before a radar, a third hidden and a fourth out of view."""
    settings: dict[str, Any] = {"num_samples": 128, "num_chirps": 32, "chirp_interval": 400e-6} | changes
    wf = Waveform.from_sweep(start_frequency=58e9, stop_frequency=62e9, sample_rate=2e6, **settings)
    radar = Radar(wf, receiver=Receiver(output="real") if real else None)
    start = RANGE[:2] - VELOCITY[:2] * wf.duration / 2.0
    cube = beat_signal_reference(
        2.0 * start / SPEED_OF_LIGHT, [3e-5, 1e-5], wf, delay_rate=2.0 * VELOCITY[:2] / SPEED_OF_LIGHT
    )
    known = Truth(NAMES, RANGE, VELOCITY, AZIMUTH, ELEVATION) if truth else None
    return Frame(cube.real.astype(np.float32) if real else cube.astype(np.complex64), 0.125, radar, known)


def image(hit: bool = True) -> Any:
    """A wall over the right half of the view, nothing on the left."""
    distance = np.full((30, 40), np.inf)
    if hit:
        distance[:, 20:] = np.linspace(1.9, 2.4, 20)
    reflectance = np.where(np.isfinite(distance), 0.4, 0.0)
    return SimpleNamespace(distance=distance, reflectance=reflectance, field_of_view_deg=(60.0, 46.0))


def texts(ax: Any) -> dict[str, Any]:
    return {label.get_text(): label for label in ax.texts}


def colour_bar_label(ax: Any) -> str:
    return str(ax.child_axes[0].get_ylabel())


def test_depth_image_has_azimuth_to_the_left_elevation_up_and_grey_misses() -> None:
    ax: Any = plot.depth_image(image())
    left, right = ax.get_xlim()
    assert left == pytest.approx(np.tan(np.deg2rad(30.0)))
    assert right == -left
    assert ax.get_ylim()[1] == pytest.approx(np.tan(np.deg2rad(23.0)))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Azimuth [°]", "Elevation [°]")
    assert colour_bar_label(ax) == "Distance [m]"
    drawn = ax.images[0]
    assert drawn.get_array().mask[:, :20].all()
    assert not drawn.get_array().mask[:, 20:].any()
    assert drawn.get_clim() == (1.9, 2.4)
    red, green, blue, alpha = drawn.cmap(np.ma.masked)
    assert red == green == blue < 1.0
    assert alpha == 1.0
    # Ticks lie where their angles are on the image plane.
    for position, label in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True):
        assert np.rad2deg(np.arctan(position)) == pytest.approx(float(label.get_text().replace("\N{MINUS SIGN}", "-")))


def test_reflectance_image_starts_at_zero() -> None:
    ax: Any = plot.reflectance_image(image())
    assert ax.images[0].get_clim() == (0.0, 0.4)
    assert colour_bar_label(ax) == "Reflectance"


@pytest.mark.parametrize("draw", [plot.depth_image, plot.reflectance_image])
def test_image_of_nothing_is_all_grey(draw: Any) -> None:
    ax = draw(image(hit=False))
    assert ax.images[0].get_array().mask.all()
    low, high = ax.images[0].get_clim()
    assert low < high


def test_chirp_is_drawn_over_microseconds_in_powers_of_a_thousand() -> None:
    one = frame(adc_delay=3e-6)
    ax: Any = plot.chirp(one, chirp=-1)
    (line,) = ax.get_lines()
    np.testing.assert_allclose(line.get_xdata(), 3.0 + 0.5 * np.arange(128))
    np.testing.assert_allclose(line.get_ydata(), 1e6 * one.cube[0, -1], rtol=1e-6)
    assert ax.get_xlabel() == "Time since start of ramp [µs]"
    assert "10^{-6}" in ax.get_ylabel()
    labels = {line.get_label() for line in plot.chirp(frame(real=False)).get_lines()}
    assert labels == {"I", "Q"}


@pytest.mark.parametrize("real", [True, False])
def test_map_is_brightest_where_the_crosses_are(real: bool) -> None:
    one = frame(real=real)
    ax: Any = plot.range_doppler_map(one)
    wf = one.radar.waveform
    drawn = ax.images[0]
    level, (left, right, bottom, top) = drawn.get_array(), drawn.get_extent()
    row, column = np.unravel_index(np.argmax(level), level.shape)
    velocity = left + (column + 0.5) * (right - left) / level.shape[1]
    distance = bottom + (row + 0.5) * (top - bottom) / level.shape[0]
    assert abs(velocity - 0.0) <= 0.25 * wf.velocity_resolution  # half a cell of the padded grid is 1/8
    assert abs(distance - 1.9) <= 0.25 * wf.range_resolution
    crosses = [(line.get_xdata()[0], line.get_ydata()[0]) for line in ax.get_lines()]
    assert crosses == [(0.0, 1.9), (-0.8, 0.9)]
    assert set(texts(ax)) == {"wall", "arm"}  # the hidden one is NaN, the fourth beyond the range
    assert ax.get_ylim() == (0.0, pytest.approx(one.radar.max_range))
    assert ax.get_xlim() == pytest.approx((-wf.max_velocity, wf.max_velocity))
    assert (level.min(), level.max()) == (pytest.approx(-60.0), pytest.approx(0.0))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Velocity [m/s, receding positive]", "Range [m]")
    assert colour_bar_label(ax) == "Power [dB re maximum]"


def test_map_takes_one_channel_a_dynamic_range_and_a_farthest_range() -> None:
    ax: Any = plot.range_doppler_map(frame(), channel=-1, dynamic_range_db=40, max_range=1.5)
    assert ax.images[0].get_clim() == (-40.0, 0.0)
    assert ax.get_ylim() == (0.0, 1.5)
    assert set(texts(ax)) == {"arm"}


def test_map_of_silence_and_of_nan_is_drawn_without_a_warning() -> None:
    one = frame(truth=False)
    silent = Frame(np.zeros_like(one.cube), 0.0, one.radar)
    ax: Any = plot.range_doppler_map(silent)
    assert (ax.images[0].get_array() == -60.0).all()
    damaged = Frame(np.full_like(one.cube, np.nan), 0.0, one.radar)
    figure = plot.overview(damaged, image(hit=False))
    figure.draw_without_rendering()


def test_pictures_go_into_given_axes() -> None:
    panels = figure_module.Figure().subplots(5)
    one = frame()
    for draw, ax in zip(
        (
            lambda ax: plot.depth_image(image(), ax),
            lambda ax: plot.reflectance_image(image(), ax=ax),
            lambda ax: plot.chirp(one, ax=ax),
            lambda ax: plot.range_profile(one, ax=ax),
            lambda ax: plot.range_doppler_map(one, ax=ax),
        ),
        panels,
        strict=True,
    ):
        assert draw(ax) is ax  # type: ignore[no-untyped-call]
        assert ax.has_data()


def boxes(figure: Any) -> Iterator[tuple[str, Any]]:
    """Everything written in a figure, with its place in pixels."""
    from matplotlib.text import Text

    figure.draw_without_rendering()
    not_drawn = []  # labels of ticks beyond the limits
    for ax in itertools.chain(figure.axes, *(ax.child_axes for ax in figure.axes)):
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            beyond = [tick for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
            not_drawn += [id(label) for tick in beyond for label in (tick.label1, tick.label2)]
    for text in figure.findobj(lambda artist: isinstance(artist, Text) and artist.get_visible()):
        box = text.get_window_extent()
        if id(text) not in not_drawn and text.get_text().strip() and box.width > 0.0:
            yield text.get_text(), box


@pytest.mark.parametrize("options", [{}, {"real": False}, {"num_chirps": 1}])
def test_overview_writes_nothing_over_anything_else(options: Any, tmp_path: Path) -> None:
    figure = plot.overview(frame(**options), image(), tmp_path / "new" / "overview.png")
    assert (tmp_path / "new/overview.png").read_bytes()[:4] == b"\x89PNG"
    assert [ax.get_title() for ax in figure.axes[:3]] == ["Depth", "Reflectance", "First chirp, channel 0"]
    written = [(text, box) for text, box in boxes(figure)]
    assert {"wall", "arm"} <= {text for text, _ in written}
    for (text, box), (other, other_box) in itertools.combinations(written, 2):
        assert not box.overlaps(other_box), f"{text!r} over {other!r}"
    for text, box in written:
        assert figure.bbox.x0 <= box.x0, text
        assert box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.y1 <= figure.bbox.y1, text


def test_names_of_many_bodies_in_one_place_stay_apart() -> None:
    one = frame()
    n = 12
    names = tuple(f"body ${i}" for i in range(n))  # a dollar sign is no formula
    truth = Truth(names, np.linspace(1.0, 1.1, n), np.zeros(n), np.zeros(n), np.zeros(n))
    ax: Any = plot.range_doppler_map(Frame(one.cube, 0.0, one.radar, truth))
    assert len(ax.get_lines()) == n
    extents = [label.get_window_extent() for label in ax.texts]
    assert len(extents) >= 4  # right, left, above and below at least
    assert not any(a.overlaps(b) for a, b in itertools.combinations(extents, 2))


def test_overview_of_a_measured_frame_goes_without_images() -> None:
    figure = plot.overview(frame(truth=False), None)
    assert [ax.get_title() for ax in figure.axes[:2]] == ["First chirp, channel 0", "Range and velocity"]


def test_chirps_at_unequal_intervals_show_range_alone() -> None:
    one = frame(truth=False)
    wf = one.radar.waveform.replace(chirp_times=400e-6 * np.arange(32) + 50e-6 * (np.arange(32) % 2))
    figure = plot.overview(Frame(one.cube, 0.0, Radar(wf, receiver=one.radar.receiver)), None)
    assert figure.axes[1].get_title() == "Range"
    assert figure.axes[1].get_xlabel() == "Range [m]"


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_importing_needs_no_matplotlib_and_drawing_no_pyplot() -> None:
    result = run(
        "import sys, radarcore.plot; assert not any(n.startswith(('matplotlib', 'scipy')) for n in sys.modules)"
    )
    assert result.returncode == 0, result.stderr
    result = run(
        "import sys, numpy as np, types; from radarcore import plot\n"
        "plot.depth_image(types.SimpleNamespace(distance=np.ones((2, 2)), field_of_view_deg=(60, 60)))\n"
        "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    assert result.returncode == 0, result.stderr


def test_missing_matplotlib_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
        plot.depth_image(image())
    with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
        plot.overview(frame(), image())


@pytest.mark.parametrize(
    ("draw", "error", "message"),
    [
        (lambda: plot.chirp(frame(), channel=1), ValueError, "channel: expected an index below 1, got 1"),
        (lambda: plot.chirp(frame(), chirp=-33), ValueError, "chirp: expected at least -32, got -33"),
        (lambda: plot.chirp(frame(), chirp=0.5), TypeError, "chirp: expected an integer"),  # type: ignore[arg-type]
        (lambda: plot.range_doppler_map(frame(), channel=2), ValueError, "channel: expected an index below 1"),
        (lambda: plot.range_doppler_map(frame(), dynamic_range_db=0), ValueError, "dynamic_range_db: expected a posi"),
        (lambda: plot.range_profile(frame(), max_range=-1), ValueError, "max_range: expected a positive"),
        (
            lambda: plot.depth_image(SimpleNamespace(distance=np.ones(3), field_of_view_deg=(60, 60))),
            ValueError,
            r"image: expected arrays of shape \(row, column\), got \(3,\)",
        ),
        (
            lambda: plot.depth_image(SimpleNamespace(distance=np.ones((3, 3)), field_of_view_deg=(180, 60))),
            ValueError,
            "field_of_view_deg: expected two angles between 0 and 180",
        ),
    ],
)
def test_silly_input_is_refused_by_name(draw: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        draw()


def test_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        plot.overview(frame(), None, tmp_path / "file" / "overview.png")
