"""Does a radar on a moving robot arm find a person who walks among metal and walls?

Everything that stands still moves past the radar. As it is, the strongest echo is the post or a wall; `remove_static`
takes off what has the velocity of the ground, by the motion of the sensor. Vary the path, and the speed of the arm.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc

radar = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61.5e9)
arm = rc.models.RobotArm.ur10()
start = np.deg2rad([0.0, -112.0, 134.6, -22.6, 90.0, 0.0])
line = rc.models.cartesian_line(arm, start, direction=[1.0, 0.0, 0.0], speed=0.25, duration=2.0)
moving = arm.moving(line, base=rc.Pose([0.0, 0.0, 0.7]))
mounting = rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0
motion = rc.Attached(moving.link_motion("tool0"), mounting)

walls = rc.materials["plasterboard"]
room = rc.Body(rc.shapes.box([6.6, 6.0, 2.8]), material=walls, motion=rc.Pose([2.5, 0.0, 1.4]), name="room")
post = rc.Body(rc.shapes.cylinder(0.06, 0.5), motion=rc.Pose([2.4, 0.16, 1.04]), name="post")
person = rc.models.Human(height=1.75, speed=1.0, path=[[4.8, -1.5], [2.6, 1.5]])

scene = rc.Scene([room, post, *person.bodies(name="person"), *moving.bodies(name="arm")])
simulator = rc.Simulator(scene, radar, radar_motion=motion, field_of_view_deg=(90.0, 60.0))


def main(output: Path, num_frames: int) -> None:
    middle = radar.middle
    recording = simulator.record(0.0, 0.1 * num_frames, rate=10.0)
    truth, time = recording.truth.select(["person/trunk"]).range[:, 0], recording.time + middle
    filtered = rc.remove_static(recording, motion)

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    above, ax = figure.subplots(1, 2)
    rc.plot.scene_from_above(scene, motion, recording.time[[0, -1]], above)
    ax.plot(time, truth, color="tab:blue", linewidth=6.0, alpha=0.3, label="truth: trunk of the person")
    for one, marker, name in ((recording, "rx", "as it is"), (filtered, "k.", "without what stands still")):
        ranges = np.array([peak.range if (peak := rc.strongest_peak(frame)) else np.nan for frame in one.frames()])
        ax.plot(time, ranges, marker, label=f"strongest echo, {name}")
        found = np.abs(ranges - truth) < 0.4  # trunk to limbs
        print(f"{name}: the person is the strongest echo in {found.sum()} of {len(found)} frames")
    ax.set(xlabel="Time [s]", ylabel="Range [m]", ylim=(0.0, 6.5))
    ax.legend(loc="upper right")
    ax.grid(alpha=0.3)
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/walker_from_moving_arm.png"))
    options.add_argument("--num-frames", type=int, default=21)
    main(**vars(options.parse_args()))
