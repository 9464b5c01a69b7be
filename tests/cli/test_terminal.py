"""Colours: on a terminal, and nowhere else."""

from __future__ import annotations

import os
import re
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli import terminal
from radarcore.cli.main import main
from radarcore.sensor.interface import BoardInfo
from scene_files import APPROACHING

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pty")

ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


@pytest.fixture
def on_terminal(monkeypatch: pytest.MonkeyPatch):
    """A function that runs a command with its output on a terminal of 80 columns, and returns that."""

    def run(
        *words: str | Path, status: int = 0, term: str = "xterm-256color", no_color: str = "", with_errors: bool = False
    ) -> str:
        parent, child = os.openpty()
        parts: list[bytes] = []

        def read() -> None:
            try:
                while part := os.read(parent, 4096):
                    parts.append(part)
            except OSError:  # the other side is closed
                pass

        reader = threading.Thread(target=read)
        reader.start()
        with os.fdopen(child, "w") as stream, monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", stream)
            if with_errors:  # else they are captured: bars of progress would be among the lines
                patched.setattr(sys, "stderr", stream)
            for name, value in (("TERM", term), ("NO_COLOR", no_color), ("COLUMNS", "80")):
                patched.setenv(name, value)
            assert main([*map(str, words)]) == status
        reader.join(10.0)
        os.close(parent)
        return b"".join(parts).decode().replace("\r\n", "\n")

    return run


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("terminal")
    (folder / "scene.toml").write_text(APPROACHING)
    rc.load_scene(folder / "scene.toml").record(folder / "rec", progress=False)
    return folder / "rec"


def cells(text: str) -> list[list[str]]:
    """Words of the lines of a text without colours and rules."""
    lines = [re.sub("─+", "", ESCAPE.sub("", line)).split() for line in text.splitlines()]
    return [line for line in lines if line]


def test_facts_are_coloured_on_a_terminal_and_the_same_words(
    on_terminal, recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(recording.parent)  # a short path, which no terminal breaks
    assert main(["info", "scene.toml"]) == 0
    plain = capsys.readouterr().out
    shown = on_terminal("info", "scene.toml")
    assert "\x1b[36mslope" in shown
    assert [" ".join(line) for line in cells(shown)][1:] == [" ".join(line) for line in cells(plain)][1:]
    assert "14.9004 MHz/us" in shown, "as people write it"
    assert "\x1b" not in plain


@pytest.mark.parametrize("environment", [{"no_color": "1"}, {"term": "dumb"}])
def test_terminal_without_colours_shows_the_plain_text(
    on_terminal, recording: Path, capsys: pytest.CaptureFixture[str], environment: dict[str, str]
) -> None:
    for words in (["info", str(recording)], ["compare", str(recording)], ["--help"], ["plot", "--help"]):
        assert main(words) == 0
        assert on_terminal(*words, **environment) == capsys.readouterr().out


def test_wide_tables_are_coloured_and_whole(on_terminal, recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Wider than the terminal: lines are broken by it, as those of plain text, rather than numbers cut."""
    assert main(["compare", str(recording)]) == 0
    plain = capsys.readouterr().out
    shown = on_terminal("compare", recording)
    assert max(map(len, plain.splitlines())) > 120
    assert "\x1b[1mErrors of rec against the truth\x1b[0m" in shown
    assert "…" not in shown
    assert cells(shown) == cells(plain)


def test_names_do_not_command_the_terminal(
    on_terminal, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names of bodies and files may contain anything; control characters are shown as text."""
    monkeypatch.chdir(tmp_path)
    name = "ev\x1b]0;il\x07\u202e\x9b31m"
    body = rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name=name)
    rc.Simulator(rc.Scene([body]), rc.bgt60tr13c(num_chirps=16), seed=1).record(0.0, 0.2, path=name, progress=False)
    for words in (["info", name], ["compare", name], ["process", name], ["info", f"{name}.toml"]):
        status = int(words[1].endswith(".toml"))
        assert main(words) == status
        plain = capsys.readouterr()
        shown = on_terminal(*words, status=status) + capsys.readouterr().err
        for text in (plain.out + plain.err, ESCAPE.sub("", shown)):
            assert not any(letter in text for letter in "\x1b\x07\u202e\x9b"), words
            assert r"ev\x1b]0;il\x07\u202e\x9b31m" in text.replace("\n", "")


def test_tracks_are_a_table(on_terminal, recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["process", str(recording)]) == 0
    plain = capsys.readouterr().out.splitlines()
    shown = on_terminal("process", recording)
    assert "\x1b[36mfarthest [m]" in shown
    assert cells(shown)[-3:-1] == cells("\n".join(plain))[-3:-1]
    track = np.array(plain[2].split(), float)
    np.testing.assert_allclose(track[[0, 3]], [0, 3])


def test_errors_are_coloured_on_a_terminal(on_terminal) -> None:
    assert (
        on_terminal("info", "none", status=1, with_errors=True)
        == "\x1b[1;31mradarcore:\x1b[0m none: no such recording\n"
    )
    assert "did you mean 'plot'?" in on_terminal("plt", status=2, with_errors=True)


def test_results_of_checks_have_their_colours(on_terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = on_terminal("sensor", "selftest", "/dev/none", status=1)
    assert shown.startswith("\x1b[1;31mFAIL\x1b[0m  open                   /dev/none")


def test_boards_are_a_table(on_terminal, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    boards = [
        BoardInfo("/dev/ttyACM0", "strata", "Radar Baseboard MCU7", "BGT60TR13C", "2.6.0", "0123"),
        BoardInfo("usb:1-4", "strata", "Radar Baseboard MCU7", "BGT60TR13C", "2.5.1", ""),
    ]
    monkeypatch.setattr("radarcore.sensor.list_sensors", lambda: boards)
    assert main(["sensor", "list"]) == 0
    assert capsys.readouterr().out == (
        "/dev/ttyACM0: Radar Baseboard MCU7, BGT60TR13C, firmware 2.6.0, serial number 0123\n"
        "usb:1-4: Radar Baseboard MCU7, BGT60TR13C, firmware 2.5.1\n"
    )
    header, *rows = cells(on_terminal("sensor", "list"))
    assert header == ["port", "board", "chip", "firmware", "serial", "number"]
    assert rows[0] == ["/dev/ttyACM0", "Radar", "Baseboard", "MCU7", "BGT60TR13C", "2.6.0", "0123"]
    assert rows[1] == ["usb:1-4", "Radar", "Baseboard", "MCU7", "BGT60TR13C", "2.5.1"]


def test_text_with_brackets_is_no_markup(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(terminal, "is_coloured", lambda *_: True)
    terminal.show(terminal.Table(["[m]", "[bold]"], [["[red]a", "[/]"]], [], "[title]", "[note]"))
    text = capsys.readouterr().out
    assert all(word in text for word in ("[m]", "[bold]", "[red]a", "[/]", "[title]", "[note]"))
