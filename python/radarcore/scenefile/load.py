"""Loading of scene files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from radarcore.radar.radar import Radar
from radarcore.recording.radar_files import configuration
from radarcore.recording.recording import Recording
from radarcore.scenefile import read
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.build.kept import Kept
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

    See Also
    --------
    Simulation : What it returns.
    load_radar : The radar alone.
    Scene : Scene in Python.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> rc.load_scene("scene.toml").scene
    <Scene: point 0>
    """
    file = Path(path)
    return simulation(read.table(file), file, recorded)


def load_radar(path: str | PathLike[str]) -> Radar:
    """Read a radar: of a scene file, of a recording, or of the settings of a chip.

    Parameters
    ----------
    path : path
        TOML, of which only the table ``[radar]`` counts; JSON: that of a recording, what `Radar.to_dict` gives,
        ``config.json`` of Infineon's tools, ``.mmwave.json`` or ``.setup.json`` of TI's mmWave Studio; or the commands
        for the demo of TI's SDK, ``.cfg``; or the radar of a recording, a folder or ``.npz``.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        For another suffix, and one line per fault of the file.

    See Also
    --------
    bgt60tr13c : A real one.
    load_scene : All of a scene file.
    Recording.load : Takes such files as `config`.

    Examples
    --------
    >>> np.savetxt("radar.toml", ['radar.preset = "bgt60tr13c"', "radar.num_chirps = 32"], fmt="%s")
    >>> rc.load_radar("radar.toml")
    <Radar 60.05 to 61 GHz, 32 chirps of 128 samples, 1 TX, 3 RX, 40 Hz>
    """
    file = Path(path)
    if file.is_dir() or file.suffix == ".npz":
        return Recording.load(file).radar
    if file.suffix != ".toml":
        return configuration(file).radar
    table = read.table(file).radar
    with located(f"{file}: radar."):
        return radar_of(table, file.parent, Kept())
