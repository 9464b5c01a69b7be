"""Does a radar on a moving robot arm find a person who walks among metal and walls?"""

import numpy as np

import radarcore as rc

radar = rc.bgt60tr13c(
    start_frequency=60e9,
    stop_frequency=61.5e9,
    num_samples=128,
    num_chirps=64,
    chirp_interval=300e-6,
    frame_interval=25e-3,
)

arm = rc.models.RobotArm.ur10()
start = np.deg2rad([0.0, -112.0, 134.6, -22.6, 90.0, 0.0])
line = rc.models.cartesian_line(arm, start, direction=[1.0, 0.0, 0.0], speed=0.25, duration=2.0)
moving = arm.moving(line, base=rc.Pose([0.0, 0.0, 0.7]))
mounting = rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0
motion = rc.Attached(moving.link_motion("tool0"), mounting)

room = rc.Body(
    rc.shapes.box([6.6, 6.0, 2.8]), material=rc.materials["plasterboard"], motion=rc.Pose([2.5, 0.0, 1.4]), name="room"
)
post = rc.Body(rc.shapes.cylinder(0.06, 0.5), motion=rc.Pose([2.4, 0.16, 1.04]), name="post")
person = rc.models.Human(height=1.75, speed=1.0, path=[[4.8, -1.5], [2.6, 1.5]])

simulator = rc.Simulator(
    rc.Scene([room, post, *person.bodies(name="person"), *moving.bodies(name="arm")]),
    radar,
    radar_motion=motion,
    field_of_view_deg=(90.0, 60.0),
)


def sensor_velocity(time: float) -> np.ndarray:
    """Velocity of the sensor over the ground, along its own axes [m/s]."""
    return motion.at(time).rotation.T @ motion.rate_at(time)[:, 3]


def text(peak: rc.Peak | None) -> str:
    """Range and velocity of an echo."""
    return "     nothing     " if peak is None else f"{peak.range:5.2f} m {peak.velocity:+.2f} m/s"


if __name__ == "__main__":
    middle = 0.5 * radar.waveform.duration
    recording = simulator.record(0.0, 2.0, rate=10.0)
    filtered = rc.remove_static(recording, [sensor_velocity(time + middle) for time in recording.time])
    truth = recording.truth.select(["person/trunk"])
    print("            strongest peak            without what stands still     trunk of the person")
    for k, time in enumerate(recording.time):
        raw, walker = (text(rc.strongest_peak(one[k])) for one in (recording, filtered))
        print(
            f"{time:.2f} s      {raw}         {walker}             "
            f"{truth.range[k, 0]:5.2f} m {truth.velocity[k, 0]:+.2f} m/s"
        )
