"""The command `radarcore`: its commands, how they are called and how they end. The file of a command loads on use."""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, NamedTuple

from cyclopts import App, CycloptsError, Group, MissingArgumentError, Parameter
from cyclopts.help import PlainFormatter

from radarcore import notice
from radarcore._core import __version__
from radarcore.cli.options import OPTIONS
from radarcore.cli.terminal import complain, is_coloured
from radarcore.table import Table

_SIMULATE, _LOOK, _EVALUATE, _BOARDS, _MORE = (
    Group(name, sort_key=place) for place, name in enumerate(("Simulate", "Look", "Evaluate", "Boards", "More"))
)


class _Command(NamedTuple):
    """A command: its group in the help, its words, a sentence, and the words after them in an example."""

    group: Group
    words: str
    help: str
    arguments: str

    @property
    def example(self) -> str:
        """A call."""
        return f"radarcore {self.words} {self.arguments}".rstrip()

    @property
    def function(self) -> str:
        """Its function: `run` in the file of its first word, or `run_` and its second word."""
        file, *name = self.words.split()
        return f"radarcore.cli.{file}:{'_'.join(['run', *name])}"


COMMANDS = (
    _Command(_SIMULATE, "demo", "simulate the experiment and compare it with the truth", "--duration 1 -o out/short"),
    _Command(_SIMULATE, "simulate", "simulate a scene file into a recording", "scene.toml -o out/recording"),
    _Command(_SIMULATE, "schema", "list every key of a scene file", "--json"),
    _Command(_LOOK, "info", "summarise a recording, scene file, bag, dataset, mesh or board", "out/recording --json"),
    _Command(_LOOK, "plot", "draw a recording or a scene file", "out/recording -o map.png --kind map --max-range 5"),
    _Command(_LOOK, "view", "show a board, a recording or a scene file, live", "out/recording --speed 0.5"),
    _Command(
        _EVALUATE,
        "process",
        "find detections and tracks in a recording of any length",
        "adc_data.bin --config profile.cfg -o out/results",
    ),
    _Command(
        _EVALUATE,
        "compare",
        "compare recordings with each other and with the truth",
        "out/simulated out/measured --offset auto -o report.html",
    ),
    _Command(_EVALUATE, "convert", "write a recording in another format", "out/recording out/recording.mcap"),
    _Command(
        _SIMULATE,
        "dataset make",
        "simulate samples of a scene file in which values are distributions",
        "scene.toml -o out/set --count 10000 --workers 2",
    ),
    _Command(_SIMULATE, "dataset verify", "check all files of a dataset, simulate samples again", "out/set --again 20"),
    _Command(_SIMULATE, "dataset scene", "print the scene file of a sample, which gives the same frames", "out/set 17"),
    _Command(_BOARDS, "sensor list", "list the boards that respond", ""),
    _Command(
        _BOARDS,
        "sensor record",
        "record from a board, until Ctrl-C or for a duration",
        "-o out/rec --duration 10 --max-range 5 --rate 20",
    ),
    _Command(
        _BOARDS,
        "sensor serve",
        "serve a simulated scene or a recording by a board's protocol",
        "scene.toml --link out/radar",
    ),
    _Command(
        _BOARDS,
        "sensor selftest",
        "check a board: identity, registers, test pattern, noise, frame rate\n\n"
        "Prints PASS, FAIL or SKIP for each check, as measured and as expected. It takes less than 20 s; nothing "
        "should be within half a metre of the board. The exit status is 1 if a check failed.",
        "--only noise -o report.json",
    ),
)


class _PlainHelp(PlainFormatter):
    """Help without broken lines: a pipe has no width."""

    def __call__(self, console: Any, options: Any, panel: Any) -> None:
        console.width = Table.width
        super().__call__(console, options, panel)


def application() -> App:
    """The command line, without the files of its commands."""
    app = App(
        name="radarcore",
        help="FMCW radar simulation for robotics.",
        version=f"radarcore {__version__}",
        version_flags="--version",
        help_format="plaintext",
        help_formatter=None if is_coloured() else _PlainHelp(),
        group_parameters=OPTIONS,
        default_parameter=Parameter(negative=(), allow_repeating=True),  # the last of an option counts
        result_action="return_value",
        exit_on_error=False,
        print_error=False,
    )
    app.command(App(name="dataset", help="datasets of many labelled frames of a varying scene", group=_SIMULATE))
    app.command(App(name="sensor", help="real sensors, and virtual sensors of simulated scenes", group=_BOARDS))
    for command in COMMANDS:
        *owners, name = command.words.split()
        owner = app[owners[0]] if owners else app
        owner.command(
            command.function,
            name=name,
            help=command.help,
            group=command.group,
            help_epilogue=f"Example:\n  {command.example}",
        )
    app.register_install_completion_command(help="make shells complete commands and options", group=_MORE)
    for flag in ("--version", "--help"):
        app[flag].group = _MORE
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns
    -------
    status : int
        Exit status: 0, 1 for bad input, 2 for words that are no command, 130 when interrupted, 143 after SIGTERM.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _interrupted_by_signals(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = _run(words)
            sys.stdout.flush()
            return status
    except KeyboardInterrupt as interrupt:
        number = signal.Signals(interrupt.args[0] if interrupt.args else signal.SIGINT)
        complain("interrupted" if number == signal.SIGINT else f"ended by {number.name}")
        return 128 + number
    except BrokenPipeError:  # the reader of our output has ended: `radarcore schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _run(words: list[str]) -> int:
    app = application()
    if words in ([], ["dataset"], ["sensor"]):
        app.help_print(words, console=app.error_console)
        complain("expected a command")
        return 2
    try:
        function, bound, _ = app.parse_args(words)
    except CycloptsError as error:
        error.verbose = False
        text = " ".join(str(error).split())
        # Cyclopts says that an option "requires an argument", which reads as if the option had been typed.
        if isinstance(error, MissingArgumentError) and error.argument is not None and not error.unused_tokens:
            text = f"Expected {error.argument.name}, got none."
        complain(f"{text} See `{' '.join(['radarcore', *(error.command_chain or ())])} --help`.")
        return 2
    notice.quiet.set(bool(bound.arguments.get("_quiet")))
    try:
        return int(function(*bound.args, **bound.kwargs) or 0)
    except BrokenPipeError:
        raise
    except (ValueError, TypeError, OSError, ImportError, MemoryError) as error:
        arguments = app.parse_commands(words)[1][-1].assemble_argument_collection()
        options = {argument.field_info.name: argument.name for argument in arguments}
        for line in _lines(error, options):
            complain(line)
        return 1
    finally:
        notice.quiet.set(False)


def _lines(error: BaseException, options: dict[str, str]) -> list[str]:
    """The message of an error, a line per fault, with options in place of the arguments that it names."""
    text = str(error) or type(error).__name__
    if isinstance(error, OSError) and error.filename is not None:
        text = f"{error.filename}: {error.strerror}"
    name, colon, rest = text.partition(": ")
    text = f"{options.get(name, name)}{colon}{rest}"
    return text.replace("overwrite=True", "--overwrite").replace("resume=True", "--resume").splitlines()


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    complain(str(message), "warning")


@contextmanager
def _interrupted_by_signals() -> Iterator[None]:
    """End at SIGTERM, and when the terminal closes, as Ctrl-C does; signals that are ignored, as by nohup, stay so."""

    def end(number: int, _: FrameType | None) -> None:
        raise KeyboardInterrupt(number)

    is_main = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
    caught = [number for number in numbers if is_main and signal.getsignal(number) is signal.SIG_DFL]
    for number in caught:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in caught:
            signal.signal(number, signal.SIG_DFL)
