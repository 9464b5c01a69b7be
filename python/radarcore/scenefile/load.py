"""Loading of scene files: scene, radar and run, ready to simulate."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from radarcore import notice
from radarcore.motion.protocol import Motion
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.recording.bare import configuration
from radarcore.recording.recording import Recording
from radarcore.scene.scene import Scene
from radarcore.scenefile import read
from radarcore.scenefile.build.bodies import Parts, materials_of
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.build.motions import Recorded, sensor_motion_of
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.read import located
from radarcore.scenefile.tables import RunTable, SceneTable, TimesTable
from radarcore.simulate.placement import Placement
from radarcore.simulate.simulator import Simulator
from radarcore.simulate.warnings import check_antennas


@dataclass(frozen=True, eq=False)
class Simulation:
    """Content of a scene file, ready to simulate.

    Attributes
    ----------
    scene : Scene
        Bodies, points, people, arms and interferers, in this order.
    radar : Radar
    radar_motion : motion
        Sensor to world.
    run : RunTable
        The table `run` of the file: `start`, `stop`, `rate`, `resolution`, ...
    path : Path, optional
        The file, for messages.

    See Also
    --------
    load_scene : Makes it.
    Simulator : The simulator behind it.

    Examples
    --------
    >>> simulation = rc.load_scene(scene_file)
    >>> simulation.simulator().frame(0.0)
    <Frame at 0 s: 3 channels x 64 chirps x 128 samples, float32, truth of ball>
    """

    scene: Scene
    radar: Radar
    radar_motion: Motion
    run: RunTable
    path: Path | None = None

    def simulator(self, *, threads: int | None = None) -> Simulator:
        """The simulator of this scene, with the settings of the run."""
        settings = self.run.model_dump(exclude=set(TimesTable.model_fields))
        return Simulator(self.scene, self.radar, radar_motion=self.radar_motion, threads=threads, **settings)

    def record(
        self,
        path: str | PathLike[str] | None = None,
        *,
        overwrite: bool = False,
        progress: bool = True,
        threads: int | None = None,
        source: dict[str, Any] | None = None,
    ) -> Recording:
        """Simulate the run; parameters as in `Simulator` and `Simulator.record`.

        Warns of a scene without bodies, whose recording has no echoes.

        See Also
        --------
        Simulator.record : Called by it.
        Recording : The result.

        Examples
        --------
        >>> rc.load_scene(scene_file).record(progress=False)
        <Recording of 4 frames in 0.075 s: 3 channels x 64 chirps x 128 samples, float32, truth of ball>
        """
        run = self.run
        if not self.scene.bodies and not self.scene.interferers:
            file = "scene" if self.path is None else self.path
            notice.warn(f"{file}: expected a [[body]], [[point]], [[human]] or [[arm]], got none: there are no echoes")
        return self.simulator(threads=threads).record(
            run.start, run.stop, run.rate, progress=progress, path=path, overwrite=overwrite, source=source
        )


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
        One line per fault, with file and key, the expected and the given value.

    See Also
    --------
    Simulation : The result.
    load_radar : The radar alone.
    Scene : Scene in Python.

    Examples
    --------
    >>> rc.load_scene(scene_file).scene
    <Scene: ball>
    """
    file = Path(path)
    return simulation(read.table(file), file, recorded)


def load_radar(path: str | PathLike[str]) -> Radar:
    """Read a radar: of a scene file, of a recording, or of the settings of a chip.

    Parameters
    ----------
    path : path
        TOML: only the table ``[radar]`` counts; JSON: of a recording, of `Radar.to_dict`,
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
        return radar_of(table, file.parent, BuildCache())


def simulation(
    table: SceneTable, file: Path, recorded: Recorded | None = None, kept: BuildCache | None = None
) -> Simulation:
    """Scene, radar and run from the tables of a file, with motions that were recorded.

    `kept` holds what several scenes of the same file have in common.
    """
    kept = BuildCache() if kept is None else kept
    with located(f"{file}: "):
        with located("radar: "):
            radar = radar_of(table.radar, file.parent, kept)
        parts, carriers = Parts(file.parent, materials_of(table.material), recorded, kept).build(table)
        with located("sensor: "):
            motion = sensor_motion_of(table.sensor, carriers, recorded)
        run = _run(table.run, recorded, radar)
        found = Simulation(Scene(parts), radar, motion, run, file)
        with located("run: "):
            found.simulator()
            _ = run.times
        with located("sensor: "):
            poses = Placement(found.scene, motion, radar.waveform).poses_at([found.run.start])[0]
            check_antennas(found.scene, poses, radar, found.run.start, name="pose")
    return found


def _run(run: RunTable, recorded: Recorded | None, radar: Radar) -> RunTable:
    """The run, by default at the radar's rate, of the frames that lie within the times of all recorded motions."""
    times = {"rate": frame_rate(radar.waveform)}
    if recorded is not None and recorded.span is not None:
        duration = max(part.waveform.duration for part in radar.sequences())
        first, last = recorded.span
        times |= {"start": first, "stop": last - duration}
    return run.model_copy(update={name: time for name, time in times.items() if name not in run.model_fields_set})
