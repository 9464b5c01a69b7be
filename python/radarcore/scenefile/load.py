"""Loading of scene files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from radarcore.radar.radar import Radar
from radarcore.recording.native import radar_from_json
from radarcore.scenefile import read
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.build.motions import Recorded
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.build.simulation import simulation
from radarcore.scenefile.simulation import Simulation


def load_scene(path: str | PathLike[str], *, recorded: Recorded | None = None) -> Simulation:
    """Read a scene file.

    Parameters
    ----------
    path : path
        TOML; ``radarcore schema`` lists the keys. Paths in it are relative to it.
    recorded : BagMotions, optional
        Motions for tables of kind ``"bag"``, see `radarcore.adapters.ros.BagMotions`. The run then has by default the
        times that all of them have in common.

    Returns
    -------
    Simulation
        `record` simulates the run; `simulator`, `scene`, `radar` and `radar_motion` are for other uses.

    Raises
    ------
    FileNotFoundError
        When the file, or a mesh it names, does not exist.
    ValueError
        One line per fault, each naming file and key, what was expected and what came.
    """
    file = Path(path)
    return simulation(read.table(file), file, recorded)


def load_radar(path: str | PathLike[str]) -> Radar:
    """Read a radar: the table ``[radar]`` of a scene file, or the ``meta.json`` of a recording.

    Parameters
    ----------
    path : path
        TOML, of which only the table ``[radar]`` counts; or JSON: that of a recording, or what `Radar.to_dict` gives.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        For another suffix, and one line per fault of the file.
    """
    file = Path(path)
    if file.suffix == ".json":
        return radar_from_json(file.read_bytes(), str(file))
    if file.suffix != ".toml":
        raise ValueError(f"{file}: expected a scene file (.toml) or the meta.json of a recording, got {file.suffix!r}")
    table = read.table(file).radar
    with located(f"{file}: radar."):
        return radar_of(table, file.parent)
