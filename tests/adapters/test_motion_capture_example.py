"""The example of motion capture: its errors are those of its noise, and its frames leave out the occlusion."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

import radarcore as rc
from doubles.motive import MotionCaptureServer

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "motion_capture.py"


def test_example_measures_the_cart_and_leaves_out_the_gap(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", [str(EXAMPLE)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    printed = capsys.readouterr().out
    assert "not seen from 1.000 to 1.400 s" in printed
    (found,) = re.findall(r"(\d+) frames: errors of ([\d.]+) mm and ([\d.]+) mm/s", printed)
    assert int(found[0]) == 12  # of 14, those from 1.1 and 1.3 s on are within the gap
    # A hundredth of a range bin, and the noise of 0.1 mm at 120 Hz.
    assert float(found[1]) < 2.0
    assert float(found[2]) < 3.0 * 0.1 * 120.0


def test_frames_follow_a_stream_at_its_newest_update() -> None:
    from radarcore.adapters.optitrack import MotionCaptureClient

    live = rc.Live()
    sphere = rc.Body(rc.shapes.sphere(0.1), motion=live, name="ball")
    simulator = rc.Simulator(rc.Scene([sphere]), rc.bgt60tr13c(num_chirps=8), resolution=16)
    motion = rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[0.5, 0.0, 0.0])
    with (
        MotionCaptureServer({"ball": motion}) as server,
        MotionCaptureClient(command_port=server.command_port) as client,
    ):
        frames = client.frames({"ball": live})
        for time in (0.0, 0.01, 0.02):
            server.send(time)
            next(frames)
    frame = simulator.frame()
    assert frame.time == pytest.approx(0.02, abs=1e-7)
    assert frame.truth is not None
    middle = 0.02 + 0.5 * simulator.radar.waveform.duration
    assert frame.truth.range[0] == pytest.approx(1.9 + 0.5 * middle, abs=1e-3)  # pixels of 16 rows
    assert frame.truth.velocity[0] == pytest.approx(0.5, abs=1e-3)
