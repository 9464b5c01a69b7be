"""Loading of scene files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from radarcore.scenefile import read
from radarcore.scenefile.build.simulation import simulation
from radarcore.scenefile.simulation import Simulation


def load_scene(path: str | PathLike[str]) -> Simulation:
    """Read a scene file.

    Parameters
    ----------
    path : path
        TOML; ``radarcore schema`` lists the keys. Paths in it are relative to it.

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
    return simulation(read.table(file), file)
