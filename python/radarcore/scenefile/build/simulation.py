"""Builds scene, radar and run from the tables of a scene file."""

from __future__ import annotations

from pathlib import Path

from radarcore.scene.scene import Scene
from radarcore.scenefile.build.bodies import Parts
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.build.materials import materials_of
from radarcore.scenefile.build.motions import Recorded, sensor_motion_of
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.simulation import Simulation
from radarcore.scenefile.tables import RunTable, SceneTable
from radarcore.simulate.clearance import check_antennas
from radarcore.simulate.placement import Placement
from radarcore.simulate.times import frame_times


def simulation(table: SceneTable, file: Path, recorded: Recorded | None = None) -> Simulation:
    """Scene, radar and run from the tables of a file, with motions that were recorded."""
    with located(f"{file}: "):
        with located("radar: "):
            radar = radar_of(table.radar, file.parent)
        parts, carriers = Parts(file.parent, materials_of(table.material), recorded).build(table)
        with located("sensor: "):
            motion = sensor_motion_of(table.sensor, carriers, recorded)
        run = table.run if recorded is None else _run_within(table.run, recorded)
        found = Simulation(Scene(parts), radar, motion, run, file)
        with located("run: "):
            found.simulator()
            frame_times(run.start, run.stop, run.rate)
        with located("sensor: "):
            poses = Placement(found.scene, motion, radar.waveform).poses_at(found.run.start)
            check_antennas(found.scene, poses, radar, found.run.start, name="pose")
    return found


def _run_within(run: RunTable, recorded: Recorded) -> RunTable:
    """The run, by default over the times that all recorded motions have in common."""
    if recorded.span is None:
        return run
    times = dict(zip(("start", "stop"), recorded.span, strict=True))
    return run.model_copy(update={name: time for name, time in times.items() if name not in run.model_fields_set})
