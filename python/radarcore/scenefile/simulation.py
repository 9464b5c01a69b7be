"""What a scene file describes: scene, radar and run."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

from radarcore.motion.protocol import Motion
from radarcore.radar.radar import Radar
from radarcore.recording.recording import Recording
from radarcore.scene.scene import Scene
from radarcore.scenefile.tables import RunTable
from radarcore.simulate.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Simulation:
    """What a scene file describes.

    Attributes
    ----------
    scene : Scene
        Bodies, points, people and arms, in this order.
    radar : Radar
    radar_motion : motion
        Sensor to world.
    run : RunTable
        The table `run` of the file: `start`, `stop`, `rate`, `resolution`, ...
    """

    scene: Scene
    radar: Radar
    radar_motion: Motion
    run: RunTable

    def simulator(self, *, threads: int | None = None) -> Simulator:
        """The simulator of this scene, with the settings of the run."""
        run = self.run
        return Simulator(
            self.scene,
            self.radar,
            radar_motion=self.radar_motion,
            resolution=run.resolution,
            field_of_view_deg=run.field_of_view_deg,
            sampling=run.sampling,
            rcs_floor=run.rcs_floor,
            ray_budget=run.ray_budget,
            end_points=run.end_points,
            tolerance=run.tolerance,
            gain_floor_db=run.gain_floor_db,
            max_bounces=run.max_bounces,
            bounce_floor_db=run.bounce_floor_db,
            retrace_deg=run.retrace_deg,
            seed=run.seed,
            threads=threads,
        )

    def record(
        self,
        path: str | PathLike[str] | None = None,
        *,
        overwrite: bool = False,
        progress: bool = True,
        threads: int | None = None,
    ) -> Recording:
        """Simulate the run; the parameters are those of `Simulator` and `Simulator.record`."""
        run = self.run
        return self.simulator(threads=threads).record(
            run.start, run.stop, run.rate, progress=progress, path=path, overwrite=overwrite
        )
