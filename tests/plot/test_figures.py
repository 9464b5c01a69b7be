"""Figures of several panels: names and titles do not overlap."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picture_scenes import frame, image, recording, room, texts_apart
from radarcore import plot
from radarcore.geometry.pose import Pose
from radarcore.plot import canvas
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame, Truth
from radarcore.scene.scene import Scene

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
figure_module = pytest.importorskip("matplotlib.figure")


@pytest.mark.parametrize("options", [{}, {"real": False}, {"num_chirps": 1}])
def test_overview_writes_nothing_over_anything_else(options: Any, tmp_path: Path) -> None:
    path = tmp_path / "new" / "overview.png" if options == {} else None
    figure = plot.overview(frame(**options), image(), path)
    assert path is None or path.read_bytes()[:4] == b"\x89PNG"
    assert figure.dpi == 100  # as of one that was not written
    assert [ax.get_title() for ax in figure.axes[:3]] == ["Depth", "Reflectance", "First chirp, channel 0"]
    assert {"wall", "arm"} <= texts_apart(figure)


def test_names_of_many_bodies_in_one_place_stay_apart() -> None:
    one = frame()
    n = 12
    names = tuple(f"body ${i}" for i in range(n))  # a dollar sign is no formula
    truth = Truth(names, np.linspace(1.0, 1.1, n), np.zeros(n), np.zeros(n), np.zeros(n))
    ax: Any = plot.range_doppler_map(Frame(one.cube, 0.0, one.radar, truth))
    assert len(ax.get_lines()) == n
    extents = [label.get_window_extent() for label in ax.texts]
    assert len(extents) >= 4
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


@pytest.mark.parametrize("with_estimates", [True, False])
def test_experiment_writes_nothing_over_anything_else(
    with_estimates: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    one = recording()
    middles = one.time + 0.5 * one.radar.waveform.duration
    arm = {"time": middles, "range": 1.5 - 0.8 * middles, "velocity": np.full(12, -0.8)}
    path = tmp_path / "new" / "experiment.png" if with_estimates else None
    estimates = {"arm": arm} if with_estimates else None
    figure = plot.experiment(one, room(), Pose(), estimates, max_range=3.0, path=path)
    assert path is None or path.read_bytes()[:4] == b"\x89PNG"
    assert figure.dpi == 100
    titles = [ax.get_title() for ax in figure.axes[:5]]
    tracks = "Truth (lines) and estimates (dots)" if with_estimates else "Truth"
    assert titles == ["Scene from above", "Range and velocity at 0.15 s", "Spectrogram", tracks, ""]
    assert {"room", "wall", "arm", "point", "radar", "x [m]", "Range [m]", "Velocity [m/s]"} <= texts_apart(figure)
    for ax in figure.axes[2:5]:
        assert ax.get_xlim() == figure.axes[2].get_xlim()
    assert not caplog.records  # matplotlib logs what it could not do


def test_experiment_of_one_measured_frame_and_an_empty_scene() -> None:
    figure = plot.experiment(recording([0.0], truth=False), Scene())
    assert any(text.startswith("1 frame, ") for text in texts_apart(figure))


def test_name_of_a_point_out_of_view_is_left_out() -> None:
    ax = canvas.new_axes()
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    canvas.place_names((ax, [canvas.Name(0.1, 0.5, "wall", "k"), canvas.Name(3.0, 0.5, "far", "k")], "black"))
    (name,) = ax.texts
    assert name.get_text() == "wall"


@pytest.mark.parametrize("is_given", [False, True])
def test_titles_make_way_for_an_axis_on_top(is_given: bool) -> None:
    given = figure_module.Figure().subplots() if is_given else None
    above = given.twiny() if given is not None else None
    ax = plot.range_doppler_map(frame(truth=False), ax=given)
    top = ax.secondary_xaxis("top") if above is None else above
    ax.figure.draw_without_rendering()
    beside = top.xaxis.get_tightbbox()
    assert beside is not None
    assert ax.title.get_window_extent().y0 >= beside.y1 - 1e-6
