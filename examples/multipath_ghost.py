"""Where does a wall beside a target put its ghosts?

The wall is a mirror: echoes of the ball come by way of the wall as well. Once: at half of both ways together, from the
direction of the ball and of its mirror image. On both ways: at the image itself. Vary the distance and material of the
wall, and `max_bounces`: 1 has no ghost, 2 has no third one.
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
ball = rc.Body(rc.shapes.sphere(RADIUS), motion=rc.Pose(BALL), name="ball")
beside = rc.Pose.from_rpy([4.0, WALL_Y, 0.0], [0.0, 0.0, np.pi / 2])
wall = rc.Body(rc.shapes.plate(6.0, 2.0), motion=beside, name="wall")
# The ball scatters rays over the wall: they must be fine, and the third ghost's level is good to 3 dB only.
rays = {"field_of_view_deg": (100.0, 6.0), "resolution": (96, 1600)}
simulator = rc.Simulator(rc.Scene([ball, wall]), radar, max_bounces=3, **rays)


def main(output: Path) -> None:
    frame, near, far = simulator.frame(), np.linalg.norm(BALL), np.linalg.norm(IMAGE)
    cosine = np.sqrt(0.5 + 0.5 * BALL @ IMAGE / (near * far))  # of half the angle by which the ball turns the wave
    ghost = 0.5 * (near + far) - RADIUS * cosine
    expected = {"ball": (BALL, near - RADIUS, ghost), "mirror image": (IMAGE, ghost, far - RADIUS)}
    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    view = {"max_range": 6.5, "field_of_view_deg": 120.0, "dynamic_range_db": 25.0}
    ax = rc.plot.range_angle_map(frame, figure.subplots(), method="capon", **view)
    ax.plot([WALL_Y, WALL_Y], [1.0, 6.3], color="tab:cyan", linewidth=2.5)
    for name, (place, *ranges) in expected.items():
        azimuth, ranges = np.arctan2(place[1], place[0]), np.array(ranges)
        power = rc.range_angle(frame, method="capon", azimuth=azimuth, num_range_bins=1024)[:, 0]
        strongest = sorted(find_peaks(power)[0], key=lambda k: -power[k])[:2]
        found = np.sort(waveform.range_axis(1024)[strongest])
        print(f"towards the {name}: {found.round(2)} m, expected {ranges.round(2)} m")
        ax.plot(np.sin(azimuth) * ranges, np.cos(azimuth) * ranges, "wo", fillstyle="none", markersize=15.0)
    for x, y, which in ((4.0, 4.6, "both ways"), (3.2, 2.5, "one way"), (-0.9, 4.5, "one way")):
        ax.text(x, y, f"{which}\nby the wall", color="white", va="center", fontsize=9)
    ax.set_title("A ball and its ghosts; rings: expected")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/multipath_ghost.png"))
    main(**vars(options.parse_args()))
