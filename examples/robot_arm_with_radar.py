"""What does a radar on the flange of a robot arm see while the arm moves towards a cylinder?"""

import numpy as np

import radarcore as rc

radar = rc.bgt60tr13c(
    start_frequency=60e9,
    stop_frequency=61.5e9,
    num_samples=128,
    num_chirps=32,
    chirp_interval=300e-6,
    frame_interval=25e-3,
)

arm = rc.models.RobotArm.ur10()
start = np.deg2rad([0.0, -120.0, 120.0, 0.0, 90.0, 0.0])
line = rc.models.cartesian_line(arm, start, direction=[1.0, 0.0, 0.0], speed=0.25, duration=1.0)
moving = arm.moving(line)

cylinder = rc.Body(rc.shapes.cylinder(0.05, 0.4), motion=rc.Pose([1.3, 0.16, 0.55]), name="cylinder")

# 5 cm out along the flange, looking along it.
mounting = rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0
simulator = rc.Simulator(
    rc.Scene([cylinder, *moving.bodies(name="arm")]),
    radar,
    radar_motion=rc.Attached(moving.link_motion("tool0"), mounting),
)

if __name__ == "__main__":
    recording = simulator.record(0.0, 1.0, rate=10.0)
    truth = recording.truth.select(["cylinder"])
    for frame, distance in zip(recording.frames(), truth.range[:, 0], strict=True):
        peak = rc.strongest_peak(frame, min_range=distance - 0.2, max_range=distance + 0.2)
        found = "nothing" if peak is None else f"{peak.range:.3f} m, {peak.velocity:+.2f} m/s"
        print(f"{frame.time:.2f} s: {found}; truth {distance:.3f} m")
