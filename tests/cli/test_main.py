"""Words that are commands, and words that are none: help, errors, exit statuses, and output on a terminal."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from io import StringIO
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import numpy as np
import pytest

import radarcore as rc
from radarcore.__main__ import run
from radarcore.cli.main import COMMANDS, application, main
from radarcore.cli.sources import path_and_topic
from radarcore.table import Table

HEAVY = ("scipy", "pydantic", "matplotlib", "tqdm", "radarcore.simulate", "radarcore.scenefile", "radarcore.sensor")
ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


def test_package_loads_no_command_line_and_help_no_command() -> None:
    program = f"""
import sys
import radarcore
assert not set(sys.modules) & {{"cyclopts", "rich", "attrs", "radarcore.cli"}}
from radarcore.cli.main import main
main(["--help"])
assert not set(sys.modules) & set({HEAVY!r})
"""
    subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.words)
def test_every_command_has_help_and_an_example_that_is_right(command, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.words.split(), "--help"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith(f"Usage: radarcore {command.words}")
    assert printed.err == ""
    assert "\x1b" not in printed.out
    assert f"  {command.example}\n" in printed.out
    assert command.example.startswith(f"radarcore {command.words}")
    function, _, _ = application().parse_args(shlex.split(command.example)[1:])
    assert function.__module__.startswith("radarcore.cli.")


def test_help_lists_commands_in_groups_and_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-h"]) == 0
    text = capsys.readouterr().out
    places = [text.index(f"\n{word}") for word in ("Simulate:", "  demo:", "Look:", "  plot:", "Boards:", "  sensor:")]
    assert places == sorted(places)
    assert main(["view", "--help"]) == 0
    assert "board (default: the first board that responds)\n" in capsys.readouterr().out, "no line is broken"
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"radarcore {rc.__version__}\n"


@pytest.mark.parametrize("words", [[], ["sensor"]])
def test_no_command_is_an_error_with_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("Usage: radarcore ")
    assert printed.err.endswith("radarcore: expected a command\n")


@pytest.mark.parametrize(
    ("words", "message", "command"),
    [
        ("plt scene.toml", 'Did you mean "plot"?', ""),
        ("sensor recrod", 'Did you mean "record"?', "sensor"),
        ("plot rec -o a.png --kin map", "Unknown option: --kin. Did you mean --kind?", "plot"),
        ("process rec --keep-men", "Did you mean --keep-mean?", "process"),
        ("plot rec -o a.png --kind detection", 'Did you mean "detections"?', "plot"),
        ("sensor selftest --only nose", 'Did you mean "noise"?', "sensor selftest"),
        ("dataset make scene.toml", "Expected --count, got none", "dataset make"),
        ("plot rec -o a.png --frame 1.5", "--frame: expected a whole number, got '1.5'", "plot"),
        ("process rec --max-range far", '--max-range: unable to convert "far" into float', "process"),
        ("sensor serve rec --speed fast", "--speed: expected a number or max, got 'fast'", "sensor serve"),
        ("view rec more", "Unused Tokens: ['more']", "view"),
        ("view rec --rerun -o new", "expected one of --output and --rerun, got both", "view"),
        ("plot rec --subtract-mean --keep-mean", "--keep-mean specified multiple times", "plot"),
        ("sensor record -o rec --frames 3 --duration 2", "expected one of --duration and --frames", "sensor record"),
    ],
)
def test_what_is_no_command_is_a_line_with_a_hint(
    words: str,
    message: str,
    command: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("radarcore: ")
    assert message in line
    assert line.endswith(f" See `{' '.join(['radarcore', *command.split()])} --help`.")
    assert list(tmp_path.iterdir()) == []


# Faults of every kind of argument; ``scene.toml`` and ``rec`` exist, ``bare.npy`` and ``bare.bin`` hold its samples.
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("simulate none.toml -o new", "none.toml: No such file or directory"),
        ("simulate scene.toml -o new.npz", "expected a directory (no suffix) to write frame by frame, got 'new.npz'"),
        ("simulate rec -o new", "rec: expected a scene file (TOML), got a folder; load_radar and --radar read the"),
        ("simulate scene.toml -o new --bag none", "none: no such bag"),
        ("info none", "none: no such recording"),
        ("info bare.npy", "bare.npy: expected the radar's settings, got an array (3, 3, 8, 128) of float32 without"),
        ("info bare.npy --config scene.toml --shape frame,rx,sample,chirp", "got (3, 3, 8, 128)"),
        ("info bare.bin --config scene.toml", "bare.bin: expected the type of its numbers"),
        ("plot rec -o new.png --kind depth", "expected a scene file for a picture of kind 'depth', got a recording"),
        ("plot rec -o new.png --frame 3", "--frame: expected an index below 3, got 3"),
        ("plot rec -o new.png --kind chirp --max-range 3", "--max-range: expected a picture of kind overview"),
        ("plot rec -o new.txt", "new.txt: expected a picture (.png, .pdf, .svg, .jpg), got suffix '.txt'"),
        ("process rec --false-alarm-rate 2", "--false-alarm-rate: expected a probability below 1, got 2.0"),
        ("process rec --config radar.x", "rec is no bare file, got 'radar.x'"),
        ("process rec --samples", "--samples: expected --bag as well, got none"),
        ("compare rec -o new.txt", "new.txt: expected a report or a picture (.html, .png, .pdf, .svg)"),
        ("compare rec --targets bal", "--targets: expected bodies of the truth, got 'bal'; did you mean 'ball'?"),
        ("compare rec --truth none.csv", "none.csv: No such file or directory"),
        ("compare rec --radius ball=0.1", "--radius: expected --truth with motion capture (Motive's .csv, or a bag)"),
        ("demo --no-robots --duration -1", "--duration: expected a positive number [s], got -1.0"),
        ("demo --no-robots -o /dev/null/demo", "/dev/null/demo"),
        ("view scene.toml -o new.rrd --config rec", "scene.toml: expected no option of recordings with a scene file"),
        ("view /dev/none --start 1", "/dev/none: expected no option of recordings with a board, got --start"),
        ("view rec -o new.png", "new.png: expected the name of a folder, got the suffix .png of a file"),
        ("view rec -o new --max-velocity 2", "--max-velocity: expected a board, which it sets, got rec"),
        ("view rec -o new.rrd --max-range 2", "--max-range: expected a board, which it sets, got rec"),
        ("view COMPLETE", "COMPLETE: no such recording"),
        ("info /dev/none", "/dev/none"),
        ("sensor record /dev/none -o new", "/dev/none"),
        ("sensor record /dev/none -o new --rx 4", "--rx: expected some of 1,2,3, or how many of three receivers"),
        ("sensor record /dev/none -o new --radar none.toml", "none.toml"),
        ("sensor record /dev/none -o rec", "rec: expected no such path, got a recording; --overwrite replaces it"),
        ("sensor serve rec", "rec: expected at least one frame with codes of an ADC, got none"),
    ],
)
def test_faults_are_one_line_and_nothing_is_written(
    words: str,
    message: str,
    scene: Path,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if words.startswith(("plot", "compare", "demo", "view")):
        pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    folder = scene.parent
    monkeypatch.chdir(folder)
    rc.Recording.load(recording).save("rec")
    np.save("bare.npy", np.load("rec/cube.npy"))
    np.load("rec/cube.npy").tofile("bare.bin")
    before = sorted(folder.rglob("*"))
    assert main(words.split()) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("radarcore: ")
    assert message in line
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(
    ("words", "made", "needs"),
    [
        ("simulate scene.toml -o new -q", "new/cube.npy", "numpy"),
        ("process rec -o new --quiet", "new/tracks.csv", "numpy"),
        ("compare rec -q", "rec-comparison.html", "matplotlib"),
        ("compare rec -o new.html -q", "new.html", "matplotlib"),
        ("convert -q rec new.npz", "new.npz", "numpy"),
        ("plot rec -o new.png -q", "new.png", "matplotlib"),
        ("view rec -o new.rrd -q", "new.rrd", "rerun"),
        ("dataset make scene.toml -o new --count 1 --workers 1 -q", "new/zarr.json", "zarr"),
        ("view rec -o new -q", "new", "matplotlib"),
    ],
)
def test_quiet_commands_show_nothing_and_no_bar_on_a_terminal(
    words: str,
    made: str,
    needs: str,
    scene: Path,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    on_terminal,
) -> None:
    pytest.importorskip(needs)
    monkeypatch.chdir(scene.parent)
    rc.Recording.load(recording).save("rec")
    assert on_terminal(*words.split(), with_errors=True) == ""
    assert Path(made).exists()
    if words.startswith(("process", "compare")):
        loud = [word for word in words.split() if word not in ("-q", "--quiet")]
        assert "3/3" in on_terminal(*loud, "--overwrite", with_errors=True), "a bar of progress"


@pytest.mark.filterwarnings("default:.*there are no echoes")
def test_quiet_commands_show_warnings_errors_failures_and_json(
    scene: Path, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene.write_text(scene.read_text().partition("[[body]]")[0] + "[run]\nstop = 0.05\n")
    assert main(["simulate", str(scene), "-o", str(scene.parent / "new"), "-q"]) == 0
    printed = capsys.readouterr()
    assert (printed.out, "there are no echoes" in printed.err) == ("", True)
    assert main(["simulate", str(scene), "-o", str(scene.parent / "new"), "-q"]) == 1
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert main(["sensor", "selftest", "/dev/none", "-q"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("FAIL  open")
    assert main(["process", str(recording), "-q", "--json"]) == 0
    assert '"frames": 3' in capsys.readouterr().out
    assert main(["info", str(recording), "-q"]) == 2, "it would show nothing at all"
    capsys.readouterr()
    assert main(["info", str(recording)]) == 0
    assert "frames" in capsys.readouterr().out, "the next command is not quiet"


def test_last_of_an_option_counts_and_numbers_may_be_negative() -> None:
    def bound(words: str) -> dict[str, object]:
        return application().parse_args(shlex.split(words))[1].arguments

    plot = bound("plot rec -o a.png --frame 3 -o b.png --frame -1")
    assert (plot["output"], plot["frame"]) == (Path("b.png"), -1)
    assert bound("compare a b --offset -0.2,0.1")["offset"] == "-0.2,0.1"
    assert bound("sensor selftest --only noise --only frames")["only"] == ["noise", "frames"]
    assert bound("sensor serve rec --speed max")["speed"] is None
    assert bound("demo --no-robots")["robots"] is False


def test_shells_complete_commands_options_and_choices() -> None:
    script = application().generate_completion(shell="bash")
    for word in ("simulate", "selftest", "max-velocity", "range-angle"):
        assert word in script


def test_reader_that_leaves_early_is_no_error() -> None:
    done = subprocess.run(
        f"'{sys.executable}' -m radarcore schema | head -n 1", shell=True, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 1


def test_interrupt_while_the_program_is_read_is_a_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted:
        def __getattr__(self, _: str) -> None:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "radarcore.cli.main", Interrupted())
    assert run() == 130
    assert capsys.readouterr().err == "radarcore: interrupted\n"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (PurePosixPath("/data/take.mcap:/robot/radar"), ("/data/take.mcap", "/robot/radar")),
        (PurePosixPath("/data/take.mcap"), ("/data/take.mcap", "")),
        (PureWindowsPath(r"C:\data\take.mcap:/radar"), ("C:/data/take.mcap", "/radar")),
        (r"C:\data\take.mcap", (r"C:\data\take.mcap", "")),
    ],
)
def test_drive_of_windows_is_no_topic_of_a_bag(source: PurePath | str, expected: tuple[str, str]) -> None:
    assert path_and_topic(source) == (Path(expected[0]), expected[1])


# --- On a terminal


@pytest.fixture
def on_terminal(monkeypatch: pytest.MonkeyPatch):
    """A function that runs a command with its output on a terminal of 80 columns, and returns that."""

    class Terminal(StringIO):
        def isatty(self) -> bool:
            return True

    def run(*words: str | Path, status: int = 0, no_color: str = "", with_errors: bool = False) -> str:
        stream = Terminal()
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stdout", stream)
            if with_errors:  # else they are captured: bars of progress would be among the lines
                patched.setattr(sys, "stderr", stream)
            for name, value in (("TERM", "xterm-256color"), ("NO_COLOR", no_color), ("COLUMNS", "80")):
                patched.setenv(name, value)
            assert main([*map(str, words)]) == status
        return stream.getvalue()

    return run


def test_facts_and_wide_tables_are_coloured_and_the_same_text(
    on_terminal, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    for words, coloured in (
        (("info", recording), "\x1b[36mslope"),
        (("compare", recording, "-o", tmp_path / "rec.html", "--overwrite"), "\x1b[1mErrors of rec against"),
    ):
        assert main([*map(str, words)]) == 0
        plain = capsys.readouterr().out
        shown = on_terminal(*words)
        assert coloured in shown
        assert [line.rstrip() for line in ESCAPE.sub("", shown).splitlines()] == plain.splitlines()
        assert on_terminal(*words, no_color="1") == plain
    assert max(map(len, plain.splitlines())) > 120, "wider than the terminal, and not cut"


def test_errors_and_results_have_their_colours(on_terminal) -> None:
    shown = on_terminal("info", "none", status=1, with_errors=True)
    assert shown == "\x1b[1;31mradarcore: \x1b[0mnone: no such recording\n"
    shown = on_terminal("sensor", "selftest", "/dev/none", status=1)
    assert shown.startswith("\x1b[1;31mFAIL  \x1b[0mopen                   /dev/none")


@pytest.mark.filterwarnings("ignore:Glyph")  # the report's pictures have no signs for them
def test_names_do_not_command_the_terminal(
    on_terminal, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names of bodies and files may contain anything; control characters are shown as text."""
    monkeypatch.chdir(tmp_path)
    name = "ev\x1b]0;il\x07\u202e\x9b31m"
    body = rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name=name)
    rc.Simulator(rc.Scene([body]), rc.bgt60tr13c(num_chirps=16), seed=1).record(0.0, 0.2, path=name, progress=False)
    for words in (
        ["info", name],
        ["compare", name, "--overwrite"],
        ["process", name, "--overwrite"],
        ["info", f"{name}.toml"],
    ):
        status = int(words[1].endswith(".toml"))
        assert main(words) == status
        plain = capsys.readouterr()
        shown = on_terminal(*words, status=status) + capsys.readouterr().err
        for text in (plain.out + plain.err, ESCAPE.sub("", shown)):
            assert not any(letter in text for letter in "\x1b\x07\u202e\x9b"), words
            assert r"ev\x1b]0;il\x07\u202e\x9b31m" in text.replace("\n", "")


def test_text_of_a_table_is_no_markup_and_its_numbers_are_to_the_right() -> None:
    table = Table(["[m]", "a\nb"], [["[red]x", "1"], ["[/]", "10.5"]], "[title]", "[note]")
    assert str(table).splitlines() == [
        "[title]",
        "           a",
        "[m]        b",
        "[red]x     1",
        "[/]     10.5",
        "[note]",
    ]
    assert str(Table((), [["name", "value"]], num_left=2)) == "name  value"
