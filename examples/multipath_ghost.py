"""Where does a wall beside a target put its ghosts?

The wall is a mirror. One way by the wall: an echo at half the sum of both ways, towards the ball and its mirror image.
Both ways: an echo at the image itself. Vary the wall, and `max_bounces`: 1 has no ghost, 2 has no third one.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

import radarcore as rc

RADIUS, WALL_Y = 0.15, 1.5  # [m]
BALL = np.array([4.0, -0.5, 0.0])
IMAGE = BALL * [1.0, -1.0, 1.0] + [0.0, 2.0 * WALL_Y, 0.0]

waveform = rc.Waveform(start_frequency=76.5e9, slope=60e12, sample_rate=10e6, num_samples=128, num_chirps=16)
row = [[0.0, 0.5 * waveform.wavelength * (i - 7.5), 0.0] for i in range(16)]
wide = rc.GaussianPattern(6.0, beamwidth_azimuth_deg=100.0, beamwidth_elevation_deg=30.0)
radar = rc.Radar(waveform, rx=row, pattern=wide, tx_power_dbm=12.0, receiver=rc.Receiver(noise_figure_db=12.0))
up = rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2])  # the radar looks up in the floor plan
ball = rc.Body(rc.shapes.sphere(RADIUS), motion=up @ rc.Pose(BALL), name="ball")
wall = rc.Body(rc.shapes.plate(6.0, 2.0), motion=rc.Pose.from_rpy([-WALL_Y, 4.0, 0.0], [0.0, 0.0, np.pi]), name="wall")
rays = {"field_of_view_deg": (100.0, 6.0), "resolution": (96, 1600)}  # fine; the third ghost's level errs by 3 dB
simulator = rc.Simulator(rc.Scene([ball, wall]), radar, radar_motion=up, max_bounces=3, **rays)


def main(output: Path) -> None:
    frame, near, far = simulator.frame(), np.linalg.norm(BALL), np.linalg.norm(IMAGE)
    cosine = np.sqrt(0.5 + 0.5 * BALL @ IMAGE / (near * far))  # of half the angle by which the ball turns the wave
    ghost = 0.5 * (near + far) - RADIUS * cosine
    expected = {"ball": (BALL, near - RADIUS, ghost), "mirror image": (IMAGE, ghost, far - RADIUS)}
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    plan, ax = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    rc.plot.range_angle_map(frame, ax, method="capon", max_range=6.0, field_of_view_deg=116.0, dynamic_range_db=25.0)
    rc.plot.scene_from_above(simulator.scene, up, ax=plan).set_title("Paths: direct (blue), by the wall (orange)")
    foot = IMAGE * WALL_Y / IMAGE[1]
    for points, style in (([0 * BALL, BALL], "C0-"), ([0 * BALL, foot, BALL], "C1-"), ([foot, IMAGE], "C1o:")):
        plan.plot(*(up.rotation @ np.transpose(points))[:2], style, fillstyle="none")
    for name, (place, *ranges) in expected.items():
        azimuth, ranges = np.arctan2(place[1], place[0]), np.array(ranges)
        power = rc.range_angle(frame, method="capon", azimuth=azimuth, num_range_bins=1024)[:, 0]
        found = np.sort(waveform.range_axis(1024)[sorted(find_peaks(power)[0], key=lambda k: power[k])[-2:]])
        print(f"towards the {name}: {found.round(2)} m, expected {ranges.round(2)} m")
        ax.plot(np.sin(azimuth) * ranges, np.cos(azimuth) * ranges, "wo", fillstyle="none", markersize=15.0)
    for x, y, which in ((3.0, 4.35, "wall both ways"), (2.6, 2.75, "wall one way"), (0.5, 5.05, "wall one way")):
        ax.text(x, y, which, color="white", va="center", fontsize=9)
    ax.set_title("The ball and its ghosts; rings: expected")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/multipath_ghost.png"))
    main(**vars(options.parse_args()))
