"""Commands on bare samples and captures: described by options, as recordings else."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from dca1000_files import Scene, commands
from radarcore.cli.main import main
from recordings import CODES

SCENE = Scene(num_frames=4)
TOML = '[radar]\npreset = "bgt60tr13c"\nnum_chirps = 4\nnum_samples = 16\n'


@pytest.fixture
def capture(tmp_path: Path) -> list[str]:
    """Words of a capture with its configuration."""
    SCENE.numbers("lanes2", q_first=True).tofile(tmp_path / "adc_data.bin")
    (tmp_path / "profile.cfg").write_text(commands(SCENE))
    return [str(tmp_path / "adc_data.bin"), "--config", str(tmp_path / "profile.cfg")]


def test_info_of_a_capture_has_its_radar(capture: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", *capture, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["cube [frame, channel, chirp, sample]"] == [4, 8, 16, 64]
    assert facts["dtype"] == "complex64"
    assert facts["transmitters"] == 2
    assert facts["schedule"] == "tdm"
    assert facts["source"]["capture"]["antennas"] == "xWR1843BOOST"


def test_process_finds_the_target_of_a_capture(
    capture: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["process", *capture, "-o", str(tmp_path / "results"), "--max-range", "8"]) == 0
    lines = (tmp_path / "results" / "detections.csv").read_text().splitlines()
    rows = [dict(zip(lines[0].split(","), line.split(","), strict=True)) for line in lines[1:]]
    loudest = max((row for row in rows if row["frame"] == "0"), key=lambda row: float(row["snr_db"]))
    assert float(loudest["range"]) == pytest.approx(SCENE.range, abs=0.02)
    assert float(loudest["velocity"]) == pytest.approx(SCENE.velocity, abs=0.1)
    assert float(loudest["azimuth_deg"]) == pytest.approx(20.0, abs=0.02)


def test_leakage_of_a_capture_is_neither_drawn_nor_the_strongest_peak(
    capture: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    from matplotlib.figure import Figure

    # A tone of a tenth of a range bin, the same in every chirp, 20 dB over the target.
    leak = np.exp(0.2j * np.pi * np.arange(64) / 64.0)
    chirp = np.stack([leak.imag, leak.real], -1).reshape(32, 2, 2).transpose(0, 2, 1)  # Q Q I I
    numbers = SCENE.numbers("lanes2", q_first=True).reshape(-1, 32, 2, 2)
    (numbers + np.rint(1e4 * chirp).astype("<i2")).tofile(capture[0])
    frame = rc.Recording.load(capture[0], config=capture[2])[0]
    loudest, peak = rc.strongest_peak(frame, min_range=0.0), rc.strongest_peak(frame)
    assert loudest is not None
    assert loudest.range_index == 0
    assert peak is not None
    assert peak.range == pytest.approx(SCENE.range, abs=0.02)

    titles: list[str] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: titles.append(figure.axes[0].get_title()))
    assert main(["plot", *capture, "-o", str(tmp_path / "map.png"), "--kind", "map"]) == 0
    assert "static echoes removed" in titles[0]


def test_plot_draws_a_capture(capture: list[str], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    assert main(["plot", *capture, "-o", str(tmp_path / "map.png"), "--kind", "map"]) == 0
    assert (tmp_path / "map.png").stat().st_size > 1000


def test_axes_numbers_and_variables_are_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from scipy.io import savemat

    (tmp_path / "scene.toml").write_text(TOML)
    turned = CODES.transpose(2, 1, 3, 0)
    np.save(tmp_path / "a.npy", turned)
    turned.tofile(tmp_path / "a.bin")
    savemat(tmp_path / "a.mat", {"adc": turned, "other": turned})
    described = ["--config", str(tmp_path / "scene.toml"), "--shape", "chirp,rx,sample,frame", "--json"]
    for name, more in (("a.npy", []), ("a.bin", ["--dtype", "uint16"]), ("a.mat", ["--variable", "adc"])):
        if name == "a.bin":  # of raw numbers nothing says how many frames there are, but their length
            described[3] = "chirp,rx,sample,frame=4"
        assert main(["info", str(tmp_path / name), *described, *more]) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["cube [frame, channel, chirp, sample]"] == [4, 3, 4, 16]
        assert facts["source"]["file"] == name


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a.npy"], "a.npy: expected the radar's settings, got an array (4, 3, 4, 16) of uint16 without any; pass"),
        (["a.npy", "--config", "none.toml"], "none.toml: No such file or directory"),
        (["a.npy", "--config", "scene.toml", "--shape", "rx,frame,chirp,sample"], "got (4, 3, 4, 16)"),
        (["a.bin", "--config", "scene.toml"], "a.bin: expected the type of its numbers"),
    ],
)
def test_what_is_missing_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", CODES)
    CODES.tofile("a.bin")
    Path("scene.toml").write_text(TOML)
    assert main(["info", *words]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


def test_variable_of_an_npz_file_is_named_by_an_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "radar.toml").write_text(TOML)
    np.savez(tmp_path / "a.npz", adc=CODES.astype(float), other=CODES.astype(float))
    words = ["info", str(tmp_path / "a.npz"), "--config", str(tmp_path / "radar.toml"), "--json"]
    assert main([*words, "--variable", "adc"]) == 0
    assert json.loads(capsys.readouterr().out)["cube [frame, channel, chirp, sample]"] == list(CODES.shape)
    assert main(words) != 0
    assert "--variable NAME" in capsys.readouterr().err
