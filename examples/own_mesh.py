"""What does a sensor see of my own part, which turns on a table?"""

from pathlib import Path

import radarcore as rc

radar = rc.bgt60tr13c(max_range=1.5, range_resolution=0.03, num_chirps=16)

part = rc.Body(
    rc.load_mesh(Path(__file__).with_name("wedge.obj"), scale=1e-3),
    material=rc.Material(reflection=-0.9, albedo=0.1),
    motion=rc.Linear(rc.Pose([0.8, 0.0, 0.29]), angular_velocity=[0.0, 0.0, 1.5]),
    name="part",
)
table = rc.Body(
    rc.shapes.box([0.8, 0.8, 0.04]), material=rc.materials["wood"], motion=rc.Pose([0.8, 0.0, 0.2]), name="table"
)

simulator = rc.Simulator(
    rc.Scene([part, table]),
    radar,
    radar_motion=rc.Pose.look_at([0.0, 0.0, 0.6], [0.8, 0.0, 0.25]),
)

if __name__ == "__main__":
    recording = simulator.record(0.0, 0.5, rate=10.0)
    print("cube [frame, channel, chirp, sample]:", recording.cube.shape, recording.cube.dtype)
    print("nearest point of the part [m]:", recording.truth.range[:, 0].round(3))
