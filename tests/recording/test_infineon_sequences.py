"""Settings of a BGT60 in other forms: the tree of the SDK's sequences, and the names of older SDKs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import radarcore as rc
from infineon_folders import FOLDER, SHAPE, folder, text
from radarcore.cli.main import main


def sequence(*, chirps: int = 1, **changes: Any) -> list[Any]:
    """The tree of ifxradarsdk: a loop of frames of a loop of chirps of a chirp."""
    names = {"num_samples_per_chirp": "num_samples", "aaf_cutoff_Hz": "lp_cutoff_Hz"}
    of_frame = [name for name in SHAPE if "repetition" in name or name in ("num_chirps_per_frame", "mimo_mode")]
    chirp = {names.get(name, name): value for name, value in SHAPE.items() if name not in of_frame}
    chirp = {name: value for name, value in chirp.items() if not name.endswith("_antennas")} | {
        "rx_mask": 7,
        "tx_mask": 1,
    }

    def loop(number: int, interval: str, inner: list[Any]) -> list[Any]:
        return [{"loop": {"num_repetitions": number, "repetition_time_s": SHAPE[interval], "sub_sequence": inner}}]

    inner = loop(SHAPE["num_chirps_per_frame"], "chirp_repetition_time_s", chirps * [{"chirp": chirp | changes}])
    return loop(0, "frame_repetition_time_s", inner)


OLDER = {"lower_frequency_Hz": SHAPE["start_frequency_Hz"], "upper_frequency_Hz": SHAPE["end_frequency_Hz"]} | {
    name: value for name, value in SHAPE.items() if name not in ("start_frequency_Hz", "end_frequency_Hz")
}


@pytest.mark.parametrize(
    "values",
    [
        sequence(),
        sequence()[0],
        {"sequence": sequence()},
        {"device_config": sequence()},
        OLDER,
        {"device_config": {"fmcw_single_shape": OLDER}},
    ],
)
def test_sequences_and_older_names_are_the_same_settings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], values: Any
) -> None:
    expected = rc.Recording.load(folder(tmp_path / "today")).radar
    path = folder(tmp_path / "rec", config_json=text(values))
    rec = rc.Recording.load(path)
    assert rec.radar == expected
    assert rc.load_radar(path / FOLDER / "config.json") == expected
    rec.save(tmp_path / "same", "infineon")
    assert rc.Recording.load(tmp_path / "same").radar == expected
    main(["info", str(path)])
    assert "33" in next(line for line in capsys.readouterr().out.splitlines() if "gain" in line)


@pytest.mark.parametrize(
    ("values", "got"),
    [
        (sequence(chirps=2), "got 2 elements in place of the chirp"),
        (sequence()[0]["loop"]["sub_sequence"], "got 'chirp' in place of the loop of chirps"),
        ([{"delay": 1e-3}], "got 'delay' in place of the loop of frames"),
        ({"loop": {"repetition_time_s": 0.1}}, "got NoneType in place of the loop of chirps"),
    ],
)
def test_sequences_of_other_forms_are_refused(tmp_path: Path, values: Any, got: str) -> None:
    (tmp_path / "config.json").write_bytes(text(values))
    with pytest.raises(ValueError, match=got) as error:
        rc.load_radar(tmp_path / "config.json")
    assert str(error.value).startswith(str(tmp_path / "config.json"))
