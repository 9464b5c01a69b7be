"""All pictures: their errors, and no global effect of import and drawing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from picture_scenes import frame, image, recording, room
from radarcore import plot
from radarcore.plot.canvas import new_axes

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")


def test_missing_matplotlib_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    one = recording([0.0])
    drawers: list[Any] = [
        lambda: plot.depth_image(image()),
        lambda: plot.overview(frame(), image()),
        lambda: plot.range_time(one),
        lambda: plot.tracks(one, {}),
        lambda: plot.scene_from_above(room()),
        lambda: plot.experiment(one, room()),
    ]
    for draw in drawers:
        with pytest.raises(ImportError, match=r"pip install radarcore\[plot\]"):
            draw()


def test_importing_needs_no_matplotlib_and_drawing_no_pyplot_and_both_touch_nothing_global() -> None:
    code = (
        "import sys, radarcore.plot; assert not any(n.startswith(('matplotlib', 'scipy')) for n in sys.modules)\n"
        f"sys.path[:0] = {[str(folder) for folder in Path(__file__).parents[:2]]!r}\n"
        "import matplotlib, picture_scenes; from radarcore import plot\n"
        "settings = lambda: {k: matplotlib.rcParams[k] for k in matplotlib.rcParams if k != 'backend'}\n"
        "before = settings()\n"
        "plot.scene_from_above(picture_scenes.room())\n"
        "plot.range_time(picture_scenes.recording())\n"
        "plot.depth_image(picture_scenes.image())\n"
        "assert settings() == before and 'matplotlib.pyplot' not in sys.modules"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


def picture(distance: Any, *angles: float) -> Any:
    return plot.depth_image(SimpleNamespace(distance=distance, field_of_view_deg=angles))


def tracks(estimates: Any) -> Any:
    return plot.tracks(recording(), estimates)


ARM = r"estimates\['arm'\]"

REFUSED: list[tuple[Any, type[Exception], str]] = [
    (lambda: plot.chirp(frame(), channel=1), ValueError, "channel: expected an index below 1, got 1"),
    (lambda: picture(np.ones(3), 60, 60), ValueError, r"image: expected arrays of shape \(row, column\), got \(3,\)"),
    (lambda: picture(np.ones((3, 3)), 180, 60), ValueError, "field_of_view_deg: expected angles between 0 and 180"),
    (lambda: plot.range_time(recording([])), ValueError, "recording: expected at least one frame, got none"),
    (lambda: plot.range_time(recording(), names=["leg"]), KeyError, "no truth of 'leg'; there is wall, arm"),
    (
        lambda: plot.range_time(recording(truth=False), names=["arm"]),
        ValueError,
        "expected none, because the recording",
    ),
    (lambda: tracks([1.0]), TypeError, "estimates: expected a dict of tracks by name, got list"),
    (lambda: tracks({"arm": {"time": [0.0]}}), TypeError, f"{ARM}: expected a dict or an object with .* without range"),
    (lambda: tracks({"arm": {"time": [0], "range": [1, 2]}}), ValueError, rf"{ARM}: .* shape \(n,\), got \(1,\) and"),
    (lambda: tracks({"arm": {"time": [0], "range": ["far"]}}), TypeError, rf"{ARM}\.range: expected numbers, got list"),
    (lambda: plot.scene_from_above(room(), 3), TypeError, "radar_motion: expected Pose"),  # type: ignore[arg-type]
    (lambda: plot.scene_from_above(room(), None, []), ValueError, "times: expected at least one time"),
    (lambda: plot.range_angle_map(frame(), field_of_view_deg=181.0), ValueError, "field_of_view_deg: expected"),
    (lambda: plot.rcs([0.0], [1.0, 2.0]), ValueError, r"rcs_m2: expected shape \(1,\), got \(2,\)"),
    (lambda: plot.rcs([], []), ValueError, "azimuth_deg: expected at least one angle, got none"),
    (lambda: plot.experiment(recording([]), room()), ValueError, "recording: expected at least one frame"),
]


@pytest.mark.parametrize(("draw", "error", "message"), REFUSED)
def test_silly_input_is_refused_by_name(draw: Any, error: Any, message: str) -> None:
    with pytest.raises(error, match=message):
        draw()


def test_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        plot.overview(frame(), None, tmp_path / "file" / "overview.png")


ROW = [[0.0, 2.5e-3 * k, 0.0] for k in range(4)]
ARRAY = rc.Radar(rc.bgt60tr13c().waveform, rx=ROW)


@pytest.mark.parametrize(
    "draw",
    [
        lambda ax: plot.depth_image(image(), ax),
        lambda ax: plot.reflectance_image(image(), ax),
        lambda ax: plot.chirp(frame(), ax=ax),
        lambda ax: plot.range_profile(frame(), ax=ax),
        lambda ax: plot.range_doppler_map(frame(), ax=ax),
        lambda ax: plot.range_angle_map(rc.Simulator(rc.Scene(), ARRAY).frame(), ax),
        lambda ax: plot.virtual_array(ARRAY, ax),
        lambda ax: plot.antenna_pattern(ARRAY, ax),
        lambda ax: plot.array_pattern(ARRAY, ax),
        lambda ax: plot.rcs([0.0, 1.0], [1.0, 2.0], ax),
    ],
)
def test_pictures_go_into_given_axes(draw: Any) -> None:
    ax = new_axes()
    assert draw(ax) is ax
    assert ax.has_data()
