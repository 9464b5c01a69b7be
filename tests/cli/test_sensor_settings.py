"""Settings of a board, from what a person wishes to see."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cyclopts import App

import radarcore as rc
from boards import SWING
from radarcore.cli.sensor.settings import NOT_SET, BoardSettings, radar_of, sight
from radarcore.sensor.bgt60.settings import Settings
from radarcore.units import SPEED_OF_LIGHT


def radar(words: str = "") -> rc.Radar:
    """The radar of options, which the chip can be."""
    app = App(result_action="return_value")

    @app.default
    def command(settings: BoardSettings = NOT_SET) -> BoardSettings:
        return settings

    found = radar_of(app(words.split(), exit_on_error=False, print_error=False))
    Settings.from_radar(found)  # refuses what the chip cannot do
    return found


@pytest.mark.parametrize(
    "words", ["", "--samples 64", "--samples 32", "--chirps 16", "--bandwidth 5.4GHz", "--rate 10", "--rx 1"]
)
def test_board_sees_a_room_and_a_person_who_walks_unless_asked_otherwise(words: str) -> None:
    found = radar(words)
    assert found.max_range >= 5.0
    assert found.max_velocity >= 2.5


def test_wishes_are_met_together() -> None:
    wf = radar("--max-range 4 --max-velocity 3 --bandwidth 2GHz --rate 20 --chirps 48").waveform
    assert wf.max_range >= 4.0
    assert wf.max_velocity >= 3.0
    assert wf.bandwidth >= 2e9
    assert wf.range_resolution <= SPEED_OF_LIGHT / 4e9
    assert wf.num_chirps == 48
    assert wf.frame_interval == pytest.approx(0.05)


def test_band_alone_costs_range_only_where_it_needs_many_samples() -> None:
    narrow, wide, few = (radar(f"--bandwidth {words}") for words in ("1GHz", "5.4GHz", "4GHz --samples 64"))
    assert narrow.max_range >= 9.5
    assert 5.0 <= wide.max_range < 5.1
    assert wide.waveform.bandwidth >= 5.4e9
    # What was asked for is what there is, however little it sees.
    assert few.waveform.num_samples == 64
    assert few.max_range == pytest.approx(64 * SPEED_OF_LIGHT / (4.0 * 4e9), rel=0.01)


@pytest.mark.parametrize(
    ("words", "receivers"), [("3", [0, 1, 2]), ("2", [0, 2]), ("1", [0]), ("1,3", [0, 2]), ("3,2", [1, 2]), ("2,", [1])]
)
def test_receivers_are_those_of_a_list_or_as_many_as_a_number(words: str, receivers: list[int]) -> None:
    found = radar(f"--rx {words}")
    np.testing.assert_array_equal(found.rx, rc.bgt60tr13c().rx[receivers])
    assert Settings.from_radar(found).rx_indices == tuple(receivers)


def test_radar_of_a_scene_keeps_its_waveform_and_phases(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(re.sub("^receiver = .*$", "measured_receiver = true", SWING, flags=re.MULTILINE))
    scene = rc.load_scene(path).radar
    found = radar(f"--radar {path} --rx 2,3 --rate 10")
    assert found.waveform == scene.waveform.replace(frame_interval=0.1)
    assert found.receiver is not None
    assert found.receiver.rx_phase_deg == (-75.0, 0.0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            # 64 samples of 2 MHz that see 20 m: c 64 / (4 * 20 m), less the step of slopes.
            "--samples 64 --max-range 20 --bandwidth 1GHz",
            "--bandwidth: expected at most 239 MHz beside --max-range 20 m and --samples 64, got 1 GHz",
        ),
        ("--bandwidth 6GHz", "--bandwidth: expected at most 5.4"),
        ("--max-velocity 100", "--max-velocity: expected at most 31.08 m/s, got 100 m/s"),
        ("--rate 1000 --chirps 64", "--rate: expected at most 390 Hz beside --chirps 64, got 1 kHz"),
        ("--max-range 1e6", "--max-range: expected at most 6139 m"),
        ("--max-range -1", "--max-range: expected a positive number"),
        ("--samples 5000", "--samples: expected at most 3266 at 2 MHz, got 5000"),
        ("--chirps 0", "--chirps: expected"),
        ("--bandwidth 4", "--bandwidth: expected a frequency with its unit, as 1.5GHz or 500MHz, got '4'"),
        ("--rx 4", "--rx: expected some of 1,2,3, or how many of three receivers, got '4'"),
        ("--rx 1,1", "--rx: expected some of 1,2,3"),
        ("--rx ,", "--rx: expected some of 1,2,3"),
    ],
)
def test_what_cannot_be_had_is_named_with_what_it_was_asked_beside(words: str, message: str) -> None:
    with pytest.raises(ValueError, match="expected") as caught:
        radar(words)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_wishes_do_not_change_the_waveform_of_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SWING)
    with pytest.raises(ValueError, match="--max-range: expected none beside --radar"):
        radar(f"--radar {path} --max-range 5")


def test_sight_is_in_numbers_that_people_write() -> None:
    assert sight(radar("--max-range 5 --max-velocity 3 --rate 20")) == (
        "sees 5.01 m in steps of 7.82 cm, +-3.01 m/s in steps of 9.41 cm/s, at 20 Hz"
    )
    assert sight(rc.Radar(rc.bgt60tr13c().waveform.replace(slope=0.0, num_chirps=1))) == (
        "sees neither range nor velocity, at 40 Hz"
    )
