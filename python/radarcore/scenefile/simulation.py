"""Content of a scene file: scene, radar and run."""

from __future__ import annotations

from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarcore import notice
from radarcore.motion.protocol import Motion
from radarcore.radar.radar import Radar
from radarcore.recording.recording import Recording
from radarcore.scene.scene import Scene
from radarcore.simulate.settings import Settings
from radarcore.simulate.simulator import Simulator

if TYPE_CHECKING:
    from radarcore.scenefile.tables import RunTable


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
    Simulator : What it runs.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> simulation = rc.load_scene("scene.toml")
    >>> simulation.simulator().frame(0.0)
    <Frame at 0 s: 3 channels x 64 chirps x 128 samples, float32, truth of point 0>
    """

    scene: Scene
    radar: Radar
    radar_motion: Motion
    run: RunTable
    path: Path | None = None

    def simulator(self, *, threads: int | None = None) -> Simulator:
        """The simulator of this scene, with the settings of the run."""
        named = {field.name for field in fields(Settings)} & set(type(self.run).model_fields)
        settings = {name: getattr(self.run, name) for name in named}
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
        """Simulate the run; the parameters are those of `Simulator` and `Simulator.record`.

        Warns of a scene without bodies, whose recording has no echoes.

        See Also
        --------
        Simulator.record : What it calls.
        Recording : What it returns.

        Examples
        --------
        >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.1", "[[point]]", "position = [2.0, 0.0, 0.0]"]
        >>> np.savetxt("scene.toml", lines, fmt="%s")
        >>> rc.load_scene("scene.toml").record(progress=False)
        <Recording of 4 frames in 0.075 s: 3 channels x 64 chirps x 128 samples, float32, truth of point 0>
        """
        run = self.run
        if not self.scene.bodies and not self.scene.interferers:
            file = "scene" if self.path is None else self.path
            notice.warn(f"{file}: expected a [[body]], [[point]], [[human]] or [[arm]], got none: there are no echoes")
        return self.simulator(threads=threads).record(
            run.start, run.stop, run.rate, progress=progress, path=path, overwrite=overwrite, source=source
        )
