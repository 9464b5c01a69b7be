"""Builds scene, radar and run from the tables of a scene file."""

from __future__ import annotations

from pathlib import Path

from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.scene.scene import Scene
from radarcore.scenefile.build.bodies import Parts
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.build.kept import Kept
from radarcore.scenefile.build.materials import materials_of
from radarcore.scenefile.build.motions import Recorded, sensor_motion_of
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.simulation import Simulation
from radarcore.scenefile.tables import RunTable, SceneTable
from radarcore.simulate.placement import Placement
from radarcore.simulate.schedule import frame_times
from radarcore.simulate.warnings import check_antennas


def simulation(table: SceneTable, file: Path, recorded: Recorded | None = None, kept: Kept | None = None) -> Simulation:
    """Scene, radar and run from the tables of a file, with motions that were recorded.

    `kept` holds what several scenes of the same file have in common.
    """
    kept = Kept() if kept is None else kept
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
            frame_times(run.start, run.stop, run.rate)
        with located("sensor: "):
            poses = Placement(found.scene, motion, radar.waveform).poses_at(found.run.start)
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
