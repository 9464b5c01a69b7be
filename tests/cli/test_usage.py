"""Words that are commands, and words that are none: help, hints and exit statuses."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import radarcore as rc
from radarcore.cli.commands import application, examples, parse
from radarcore.cli.main import main

HEAVY = ("scipy", "pydantic", "matplotlib", "tqdm", "radarcore.simulate", "radarcore.scenefile", "radarcore.sensor")


def loaded(program: str, names: tuple[str, ...]) -> set[str]:
    """Those of some modules that a program loads."""
    end = f"\nprint(*(set(sys.modules) & set({names!r})), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}{end}"], capture_output=True, text=True, check=True
    )
    return set(done.stderr.split())


def test_help_of_all_commands_loads_none_of_them() -> None:
    assert loaded("from radarcore.cli.main import main\nmain(['--help'])", HEAVY) == set()


def test_package_loads_nothing_of_the_command_line() -> None:
    assert loaded("import radarcore", ("cyclopts", "rich", "attrs", "radarcore.cli")) == set()


@pytest.mark.parametrize("command", ["", "sensor", *examples()])
def test_every_command_has_help_and_examples_that_are_right(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), "--help"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith(f"Usage: radarcore {command}".rstrip())
    assert printed.err == ""
    assert "\x1b" not in printed.out
    for line in examples().get(command, ()):
        assert f"  {line}\n" in printed.out
        words = shlex.split(line)
        assert words[: 1 + len(command.split())] == ["radarcore", *command.split()]
        function, _ = parse(application(), words[1:])
        assert function.__module__.startswith("radarcore.cli.")


def test_help_lists_commands_in_groups(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-h"]) == 0
    text = capsys.readouterr().out
    places = [text.index(f"\n{word}") for word in ("Simulate:", "  demo ", "Look:", "  plot ", "Boards:", "  sensor ")]
    assert places == sorted(places)


@pytest.mark.parametrize("words", [[], ["sensor"]])
def test_no_command_is_an_error_with_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("Usage: radarcore ")
    assert printed.err.endswith("radarcore: expected a command\n")


def test_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"radarcore {rc.__version__}\n"


@pytest.mark.parametrize(
    ("words", "message", "command"),
    [
        ("plt scene.toml", "expected a command, got 'plt'; did you mean 'plot'?", ""),
        ("--verson", "expected a command, got '--verson'; did you mean '--version'?", ""),
        ("zzz", "expected a command, got 'zzz'; known: demo, simulate, schema, info, ", ""),
        ("sensor recrod", "sensor: expected a command, got 'recrod'; did you mean 'record'?", "sensor"),
        ("plot rec -o a.png --kin map", "plot: unknown option --kin; did you mean --kind?", "plot"),
        (
            "sensor view --max-velocty 3",
            "sensor view: unknown option --max-velocty; did you mean --max-velocity",
            "sensor view",
        ),
        ("process rec --keep-statc", "process: unknown option --keep-statc; did you mean --keep-static?", "process"),
        ("demo --jsn", "demo: unknown option --jsn; did you mean --json?", "demo"),
        ("info rec -x", "info: unknown option -x", "info"),
        ("plot rec -o a.png --kind detection", "got 'detection'; did you mean 'detections'", "plot"),
        ("process rec --method cfar", "process: --method: expected ca, os, got 'cfar'", "process"),
        (
            "sensor selftest --only nose",
            "--only: expected identity, registers, pattern, noise, frames, got 'nose'; did you mean 'noise'?",
            "sensor selftest",
        ),
        ("plot rec", "plot: expected --output, got none", "plot"),
        ("plot -o a.png", "plot: expected SOURCE, got none", "plot"),
        ("plot rec -o", "plot: -o: expected a value, got none", "plot"),
        ("plot rec -o a.png --frame 1.5", "plot: --frame: expected a whole number, got '1.5'", "plot"),
        ("process rec --max-range far", "process: --max-range: expected a number, got 'far'", "process"),
        ("simulate -o rec --field-of-view 60", "simulate: --field-of-view: expected 2 values, got 1", "simulate"),
        (
            "sensor serve rec --speed fast",
            "sensor serve: --speed: expected a number or max, got 'fast'",
            "sensor serve",
        ),
        ("view rec more", "view: expected no more arguments, got 'more'", "view"),
        (
            "view rec --remove-static --keep-static",
            "view: --keep-static: expected once, and not beside its opposite",
            "view",
        ),
        (
            "sensor record -o rec --frames 3 --duration 2",
            "expected one of --duration and --frames, got both",
            "sensor record",
        ),
    ],
)
def test_what_is_no_command_is_a_line_and_a_hint(
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
    line, hint = printed.err.splitlines()
    assert line.startswith("radarcore: ")
    assert message in line
    assert hint == f"radarcore: see `{' '.join(['radarcore', *command.split()])} --help`"
    assert list(tmp_path.iterdir()) == []


def test_last_of_an_option_counts_and_numbers_may_be_negative() -> None:
    _, bound = parse(application(), shlex.split("plot rec -o a.png --frame 3 -o b.png --frame -1"))
    assert (bound.arguments["output"], bound.arguments["frame"]) == (Path("b.png"), -1)
    _, bound = parse(application(), shlex.split("compare a b --offset -0.2,0.1"))
    assert bound.arguments["offset"] == "-0.2,0.1"
    _, bound = parse(application(), shlex.split("sensor selftest --only noise --only frames"))
    assert bound.arguments["only"] == ["noise", "frames"]
    _, bound = parse(application(), shlex.split("sensor serve rec --speed max"))
    assert bound.arguments["speed"] is None


@pytest.mark.parametrize(("option", "value"), [("--robots", True), ("--no-robots", False)])
def test_option_and_its_opposite(option: str, value: bool) -> None:
    _, bound = parse(application(), ["demo", option])
    assert bound.arguments["robots"] is value


def test_completion_is_installed_in_the_home_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    assert main(["--install-completion", "--shell", "bash", "-o", str(tmp_path / "completion")]) == 0
    assert "complete -F" in (tmp_path / "completion").read_text()
    assert str(tmp_path / "completion") in (tmp_path / ".bashrc").read_text()
    assert str(tmp_path / "completion") in capsys.readouterr().out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_commands_options_and_choices(shell: str) -> None:
    script = application().generate_completion(shell=shell)  # type: ignore[arg-type]
    for word in ("simulate", "selftest", "max-velocity", "range-angle"):
        assert word in script
