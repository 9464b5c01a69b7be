"""Names of results without `-o`: beside the source, printed, and never of a file that is replaced unasked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import radarcore as rc
from doubles.boards import Numbered
from radarcore.cli.main import main
from radarcore.cli.sources import beside
from radarcore.sensor import virtual_board
from radarcore.sensor.emulator.pty import PtyPort


@pytest.mark.parametrize(
    ("words", "made", "needs"),
    [
        ("simulate scene.toml", "scene", "numpy"),
        ("plot rec", "rec-overview.png", "matplotlib"),
        ("plot 2026.11.30 --kind map", "2026.11.30-map.png", "matplotlib"),
        ("plot scene.toml --kind above", "scene-above.png", "matplotlib"),
        ("plot take.mcap:/radar --kind map", "take-map.png", "rosbags"),
        ("process rec", "rec-results", "numpy"),
        ("compare rec", "rec-comparison.html", "matplotlib"),
    ],
)
def test_result_is_beside_its_source_printed_and_replaced_only_when_asked(
    words: str,
    made: str,
    needs: str,
    scene: Path,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    pytest.importorskip(needs)
    folder = scene.parent / "sources"
    folder.mkdir()
    scene.rename(folder / "scene.toml")
    for name in ("rec", "2026.11.30"):
        rc.Recording.load(recording).save(folder / name)
    if needs == "rosbags":
        assert main(["convert", str(recording), str(folder / "take.mcap")]) == 0
    monkeypatch.chdir(scene.parent)
    command, source, *others = words.split()
    call = [command, str(Path("sources", source)), *others]
    before = set(folder.iterdir())
    capsys.readouterr()
    assert main(call) == 0
    assert str(Path("sources", made)) in capsys.readouterr().out
    assert set(folder.iterdir()) - before == {folder / made}
    assert main(call) == 1
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert main([*call, "--overwrite"]) == 0
    assert sorted(scene.parent.iterdir()) == [folder], "nothing in the working directory"


def test_dataset_is_beside_its_scene_file(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zarr", reason="needs the extra `zarr`: pip install radarcore[zarr]")
    assert main(["dataset", "make", str(scene), "--count", "1", "--workers", "1"]) == 0
    assert str(scene.with_suffix(".zarr")) in capsys.readouterr().out
    assert len(rc.dataset.open_dataset(scene.with_suffix(".zarr"))) == 1


def test_recording_of_a_board_has_its_date_and_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with virtual_board(Numbered()) as board, PtyPort(board) as port:
        assert main(["sensor", "record", port.path, "--frames", "2"]) == 0
    (made,) = tmp_path.iterdir()
    assert re.fullmatch(r"recording-\d{8}-\d{6}", made.name)
    assert f"{made.name}: 2 frames" in capsys.readouterr().out
    assert len(rc.Recording.load(made)) == 2


def test_folder_without_a_name_has_that_of_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rec" / "inner").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "rec" / "inner")
    assert beside(Path(), "-map.png") == tmp_path / "rec" / "inner-map.png"
    assert beside(Path(".."), "-map.png") == tmp_path / "rec-map.png"
    assert beside(Path("a/b.c/walk.npz"), ".png") == Path("a/b.c/walk.png")
