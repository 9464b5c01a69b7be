"""Does a cart that drives by its radar stop before the wall?

A control loop at 20 Hz: the frame of the moment is simulated, the strongest echo is found, and the cart brakes when its
braking distance is as long as the way that is left. The simulator does not know the future: `rc.Live` has poses one by
one. Vary SPEED, BRAKING and PERIOD, and put something in front of the wall.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc

SPEED, BRAKING, STOP_AT, PERIOD, WALL_X = 1.0, 1.0, 0.6, 0.05, 3.0  # [m/s], [m/s^2], [m], [s], [m]

radar = rc.bgt60tr13c(range_resolution=0.05, max_range=3.4, num_chirps=32)
cart = rc.Live()
wall = rc.Body(
    rc.shapes.plate(2.0, 1.0), material=rc.materials["concrete"], motion=rc.Pose([WALL_X, 0.0, 0.0]), name="wall"
)
simulator = rc.Simulator(rc.Scene([wall]), radar, radar_motion=cart)


def main(output: Path, num_steps: int) -> None:
    x, speed, log = 0.0, SPEED, []
    for step in range(num_steps):
        cart.update(step * PERIOD, rc.Pose([x, 0.0, 0.0]), velocity=[speed, 0.0, 0.0])
        frame = simulator.frame()  # starts at the newest update
        peak = rc.strongest_peak(frame, min_range=0.2)
        log.append((frame.time, peak.range, -peak.velocity, WALL_X - x, speed))
        way_left = max(peak.range - speed * PERIOD - STOP_AT, 0.0)  # when the next step has come
        faster = min(SPEED, np.sqrt(2.0 * BRAKING * way_left))
        x += 0.5 * (speed + faster) * PERIOD
        speed = faster
    time, distance, closing, true_distance, true_speed = np.array(log).T
    print(f"stands {true_distance[-1]:.3f} m before the wall, {STOP_AT:.3f} m wanted, {distance[-1]:.3f} m measured")

    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for ax, measured, true in ((upper, distance, true_distance), (lower, closing, true_speed)):
        ax.plot(time, true, color="tab:orange", linewidth=4.0, alpha=0.5, label="true")
        ax.plot(time, measured, ".", color="tab:blue", label="radar")
        ax.grid(alpha=0.3)
    upper.legend()
    upper.axhline(STOP_AT, color="0.4", linestyle="--", linewidth=1.0)
    upper.text(0.0, STOP_AT + 0.05, f"to stop at {STOP_AT} m", color="0.4")
    upper.set(ylim=(0.0, None), ylabel="Distance [m]", title="Cart that brakes by its own radar")
    lower.set(xlabel="Time [s]", ylabel="Speed [m/s]")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/live_loop.png"))
    options.add_argument("--num-steps", type=int, default=70)
    main(**vars(options.parse_args()))
