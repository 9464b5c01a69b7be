"""The commands of `radarcore`: names, groups, help and examples. The file of a command is loaded on its use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import BoundArguments
from typing import Any, NamedTuple

from cyclopts import App, Group, Parameter

from radarcore._core import __version__
from radarcore.cli import terminal
from radarcore.cli.options import OPTIONS
from radarcore.cli.plain_help import PlainHelp

_SIMULATE, _LOOK, _EVALUATE, _BOARDS, _MORE = (
    Group(name, sort_key=place) for place, name in enumerate(("Simulate", "Look", "Evaluate", "Boards", "More"))
)


class _Command(NamedTuple):
    """A command: its function, where help lists it and what it says, and examples."""

    name: str
    function: str
    group: Group
    help: str
    examples: tuple[str, ...]


_COMMANDS = (
    _Command(
        "demo",
        "demo.command:run",
        _SIMULATE,
        "simulate the experiment and compare it with the truth",
        ("radarcore demo", "radarcore demo --duration 1 -o out/short"),
    ),
    _Command(
        "simulate",
        "simulate:run",
        _SIMULATE,
        "simulate a scene file, or depth images of a bag, into a recording",
        (
            "radarcore simulate scene.toml -o out/recording",
            "radarcore simulate --bag camera.mcap --radar scene.toml -o out/recording",
        ),
    ),
    _Command(
        "schema",
        "schema:run",
        _SIMULATE,
        "list every key of a scene file with unit and default",
        ("radarcore schema", "radarcore schema --json"),
    ),
    _Command(
        "info",
        "info:run",
        _LOOK,
        "summarise a recording, a scene file or a bag, or report on a mesh",
        ("radarcore info scene.toml", "radarcore info out/recording --json"),
    ),
    _Command(
        "plot",
        "plot:run",
        _LOOK,
        "draw a recording or a scene file",
        (
            "radarcore plot out/recording -o overview.png",
            "radarcore plot scene.toml -o depth.png --kind depth",
            "radarcore plot out/recording -o map.png --kind map --frame -1 --max-range 5",
        ),
    ),
    _Command(
        "view",
        "view:run",
        _LOOK,
        "show a scene file or a recording in the viewer Rerun (extra `rerun`)",
        ("radarcore view scene.toml", "radarcore view out/recording -o recording.rrd"),
    ),
    _Command(
        "process",
        "process:run",
        _EVALUATE,
        "find detections and tracks in a recording of any length",
        (
            "radarcore process out/recording -o out/results",
            "radarcore process adc_data.bin --config profile.cfg --max-range 8",
        ),
    ),
    _Command(
        "compare",
        "compare:run",
        _EVALUATE,
        "compare recordings with each other and with the truth",
        (
            "radarcore compare out/simulated out/measured --offset auto -o report.html",
            "radarcore compare out/measured --truth take.csv --radius ball=0.05",
        ),
    ),
)

_SENSOR_HELP = "real sensors, and virtual sensors of simulated scenes"

_SENSOR_COMMANDS = (
    _Command("list", "boards:run_list", _BOARDS, "list the boards that respond", ("radarcore sensor list",)),
    _Command(
        "info",
        "boards:run_info",
        _BOARDS,
        "print type and temperature of a board",
        ("radarcore sensor info", "radarcore sensor info /dev/ttyACM0"),
    ),
    _Command(
        "report",
        "boards:run_report",
        _BOARDS,
        "collect the USB descriptors of the boards, for a bug report",
        ("radarcore sensor report -o report.json",),
    ),
    _Command(
        "record",
        "measure:run_record",
        _BOARDS,
        "record from a board, until Ctrl-C or for a duration",
        (
            "radarcore sensor record -o out/rec --duration 10",
            "radarcore sensor record -o out/rec --max-range 5 --rate 20",
        ),
    ),
    _Command(
        "view",
        "measure:run_view",
        _BOARDS,
        "live view of a board, a recording or a scene",
        ("radarcore sensor view", "radarcore sensor view out/rec --speed 0.5"),
    ),
    _Command(
        "serve",
        "serve:run",
        _BOARDS,
        "serve a simulated scene or a recording by a board's protocol",
        ("radarcore sensor serve scene.toml --link out/radar",),
    ),
    _Command(
        "selftest",
        "selftest:run",
        _BOARDS,
        "check a board: identity, registers, test pattern, noise, frame rate\n\n"
        "Prints PASS, FAIL or SKIP for each thing, as measured and as expected. It takes less than 20 s; nothing "
        "should be within half a metre of the board. The exit status is 1 if a check failed.",
        ("radarcore sensor selftest", "radarcore sensor selftest --only noise -o report.json"),
    ),
)

_DATASET_HELP = "datasets of many labelled frames of a scene that varies (extra `zarr`)"

_DATASET_COMMANDS = (
    _Command(
        "make",
        "dataset:run_make",
        _SIMULATE,
        "simulate samples of a scene file in which values are distributions",
        (
            "radarcore dataset make scene.toml -o out/set --count 10000 --workers 2",
            "radarcore dataset make scene.toml -o out/set --count 10000 --resume",
            "radarcore dataset make scene.toml -o set --count 99 --scheduler tcp://a:8786",
        ),
    ),
    _Command(
        "verify",
        "dataset:run_verify",
        _SIMULATE,
        "check checksums and numbers of a dataset, and simulate samples of it again",
        ("radarcore dataset verify out/set", "radarcore dataset verify out/set --again 20"),
    ),
    _Command("info", "dataset:run_info", _SIMULATE, "summarise a dataset", ("radarcore dataset info out/set",)),
    _Command(
        "scene",
        "dataset:run_scene",
        _SIMULATE,
        "print the scene file of a sample, which gives the same frames alone",
        ("radarcore dataset scene out/set 17",),
    ),
    _Command(
        "export",
        "dataset:run_export",
        _SIMULATE,
        "write a dataset as HDF5, as WebDataset, or a sample of it as MCAP",
        ("radarcore dataset export out/set -o set.h5 --format hdf5",),
    ),
)

_HELP_FLAGS = ("--help", "-h")


def application() -> App:
    """The command line, without the files of its commands."""
    app = App(
        name="radarcore",
        help="FMCW radar simulation for robotics.",
        version=f"radarcore {__version__}",
        version_flags="--version",
        help_flags=_HELP_FLAGS,
        help_format="plaintext",
        help_formatter=None if terminal.is_coloured() else PlainHelp(),
        group_parameters=OPTIONS,
        default_parameter=Parameter(negative=(), allow_repeating=True),  # the last of an option counts
        result_action="return_value",
        exit_on_error=False,
        print_error=False,
    )
    sensor = App(name="sensor", help=_SENSOR_HELP, group=_BOARDS)
    dataset = App(name="dataset", help=_DATASET_HELP, group=_SIMULATE)
    for owner, folder, commands in (
        (app, "radarcore.cli", _COMMANDS),
        (dataset, "radarcore.cli", _DATASET_COMMANDS),
        (sensor, "radarcore.cli.sensor", _SENSOR_COMMANDS),
    ):
        for place, command in enumerate(commands):
            owner.command(
                f"{folder}.{command.function}",
                name=command.name,
                help=command.help,
                group=command.group,
                sort_key=place,
                help_epilogue="\n  ".join(("Examples:", *command.examples)),
            )
    app.command(dataset)
    app.command(sensor)
    app.register_install_completion_command(help="make shells complete commands and options", group=_MORE)
    for flag, text in (("--version", "print the version"), ("--help", "print help, of a command as well")):
        app[flag].group, app[flag].help = _MORE, text
    return app


def examples() -> dict[str, tuple[str, ...]]:
    """Examples of every command, by its words."""
    found = {command.name: command.examples for command in _COMMANDS}
    for group, commands in (("sensor", _SENSOR_COMMANDS), ("dataset", _DATASET_COMMANDS)):
        found |= {f"{group} {command.name}": command.examples for command in commands}
    return found


def parse(app: App, words: Sequence[str]) -> tuple[Callable[..., Any], BoundArguments]:
    """The function that some words call, with its arguments; or a CycloptsError."""
    function, arguments, _ = app.parse_args(words)
    return function, arguments


def lacks_command(words: Sequence[str]) -> bool:
    """True when nothing is asked for: neither a command nor help."""
    return list(words) in ([], ["sensor"], ["dataset"])
