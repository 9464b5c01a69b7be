"""The paper's figure 6 without hardware: physics, stream of motion capture, driver and board, a bag, comparison."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import mujoco_models  # noqa: F401  # loads MuJoCo, or skips
from radarcore.cli.main import main
from radarcore.models import robots

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "figure6"
START, NUM_FRAMES = 0.6, 32
"""The arm begins to move at 0.75 s."""

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")
pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
if sys.platform == "win32":
    pytest.skip("needs a pty", allow_module_level=True)
if not robots.is_available():
    pytest.skip("needs the extra `robots`: pip install radarcore[robots]", allow_module_level=True)


@pytest.fixture(scope="module")
def experiment() -> Any:
    sys.path.insert(0, str(FOLDER))
    try:
        return import_module("run")
    finally:
        sys.path.remove(str(FOLDER))


@pytest.mark.filterwarnings("ignore::UserWarning")  # lost frames, feet faster than max_velocity, few rays
def test_clock_drops_ranges_and_velocities_are_found(
    experiment: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "experiment.mcap"
    num_lost = experiment.record(bag, START, NUM_FRAMES, ray_budget=30_000)
    assert num_lost > 0
    assert main([*experiment.comparison(bag), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    simulated, measured = facts["recordings"]
    assert (simulated["name"], measured["name"]) == ("simulated", "emulated board")
    assert measured["frames"] == NUM_FRAMES
    assert simulated["dropped"] == []

    # The board's clock is known within 2 ms, and all frames that it lost are listed.
    assert measured["offset"] == pytest.approx(START + experiment.CLOCK_OFFSET, abs=2e-3)
    assert sum(one["count"] for one in measured["dropped"] if one["is_counted"]) == num_lost

    targets = {target["name"]: target for target in facts["targets"]}
    assert targets.keys() == {"cylinder", "person"}
    for errors in targets["cylinder"]["errors"]:
        assert errors["num_frames"] >= NUM_FRAMES
        assert errors["num_frames"] == errors["num_range_within"] == errors["num_velocity_within"]
        assert errors["range_error"]["largest_bins"] < 0.1  # 1.6 cm
    for errors in targets["person"]["errors"]:
        assert errors["num_range_within"] > 0.5 * errors["num_frames"]
        assert errors["num_velocity_within"] > 0.5 * errors["num_frames"]
    # Both see the same cylinder, in different units: the level stays, and the phase too.
    echo = targets["cylinder"]["echo"]
    assert echo["ratio_spread_db"] < 2.0  # few rays
    assert echo["phase_spread_deg"] < 60.0

    # Missing topics raise errors that list the existing ones.
    for arguments, message in (
        ([f"{bag}:/radar", "--truth", str(bag)], "topic: no topic '/radar'"),
        (
            [str(bag), "--truth", str(bag)],
            f"{bag}: expected {bag}:TOPIC with frames of a radar, of /measured, /simulated",
        ),
        (
            [f"{bag}:/simulated", "--truth", str(bag), "--radar", "rader"],
            f"--radar: expected a body of {bag}, got 'rader'",
        ),
    ):
        assert main(["compare", *arguments]) == 1
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1
        assert lines[0].startswith(f"radarcore: {message}")
