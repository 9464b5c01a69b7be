"""The example of motion capture: its errors match its noise, and its frames exclude the occlusion."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "motion_capture.py"


def test_example_measures_the_cart_and_leaves_out_the_gap(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", [str(EXAMPLE)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    printed = capsys.readouterr().out
    assert "not seen from 1.000 to 1.400 s" in printed
    (found,) = re.findall(r"(\d+) frames: errors of ([\d.]+) mm and ([\d.]+) mm/s", printed)
    assert int(found[0]) == 12  # of 14, the frames from 1.1 and 1.3 s on are within the gap
    # A hundredth of a range bin, and the noise of 0.1 mm at 120 Hz.
    assert float(found[1]) < 2.0
    assert float(found[2]) < 3.0 * 0.1 * 120.0
