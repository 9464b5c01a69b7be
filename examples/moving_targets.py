"""How well are targets with different motions separated: at constant velocity, along a curve, carried by another?"""

import numpy as np

import radarcore as rc

waveform = rc.Waveform(
    start_frequency=77e9, slope=-20e12, sample_rate=5e6, num_samples=128, num_chirps=64, chirp_interval=100e-6
)
radar = rc.Radar(waveform, rx=[[0.0, 0.00195, 0.0], [0.0, 0.0, 0.0], [0.0, -0.00195, 0.0]])

ball = rc.Body(
    rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([4.0, 0.5, 0.0]), velocity=[-2.0, 0.0, 0.0]), name="ball"
)
curve = rc.Trajectory(
    [0.0, 0.5, 1.0],
    [
        rc.Pose([3.0, -1.0, -0.3]),
        rc.Pose.from_rpy([2.6, -0.4, -0.3], np.deg2rad([0.0, 0.0, 45.0])),
        rc.Pose.from_rpy([2.6, 0.4, -0.3], np.deg2rad([0.0, 0.0, 90.0])),
    ],
)
cart = rc.Body(rc.shapes.box([0.4, 0.3, 0.3]), motion=curve, name="cart")
# Stands on the cart.
corner = rc.Body(rc.shapes.dihedral(0.1, 0.2), motion=rc.Attached(curve, rc.Pose([0.0, 0.0, 0.26])), name="corner")
drone = rc.PointTarget([5.0, 0.0, 1.0], rcs=0.01, velocity=[3.0, 0.0, 0.0], name="drone")

simulator = rc.Simulator(rc.Scene([ball, cart, corner, drone]), radar, field_of_view_deg=(80.0, 50.0), max_bounces=2)

if __name__ == "__main__":
    recording = simulator.record(0.0, 1.0, rate=20.0)
    for frame in recording.frames():
        peak = rc.strongest_peak(frame)
        found = "nothing" if peak is None else f"at {peak.range:.2f} m, {peak.velocity:+.2f} m/s"
        print(f"{frame.time:.2f} s: strongest echo {found}")
