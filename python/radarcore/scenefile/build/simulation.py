"""Builds scene, radar and run from the tables of a scene file."""

from __future__ import annotations

from pathlib import Path

from radarcore.scene.scene import Scene
from radarcore.scenefile.build.bodies import Parts
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.build.materials import materials_of
from radarcore.scenefile.build.motions import sensor_motion_of
from radarcore.scenefile.build.radar import radar_of
from radarcore.scenefile.simulation import Simulation
from radarcore.scenefile.tables import SceneTable
from radarcore.simulate.clearance import check_antennas
from radarcore.simulate.placement import Placement
from radarcore.simulate.times import frame_times


def simulation(table: SceneTable, file: Path) -> Simulation:
    """Scene, radar and run from the tables of a file."""
    with located(f"{file}: "):
        with located("radar: "):
            radar = radar_of(table.radar, file.parent)
        parts, carriers = Parts(file.parent, materials_of(table.material)).build(table)
        with located("sensor: "):
            motion = sensor_motion_of(table.sensor, carriers)
        found = Simulation(Scene(parts), radar, motion, table.run, file)
        with located("run: "):
            found.simulator()
            frame_times(table.run.start, table.run.stop, table.run.rate)
        with located("sensor: "):
            poses = Placement(found.scene, motion, radar.waveform).poses_at(found.run.start)
            check_antennas(found.scene, poses, radar, found.run.start, name="pose")
    return found
