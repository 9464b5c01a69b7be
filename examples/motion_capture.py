"""How well does a radar measure a cart that motion capture followed? From Motive's CSV file to errors.

The file is made here, of a known motion: 120 frames per second, 0.1 mm of noise, and the cart hidden for 0.4 s. Give
the path of another file to see its bodies.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import radarcore as rc
from radarcore.adapters.optitrack import read_motive_csv

RADIUS = 0.1


def distance(t):
    """Distance of the cart's middle, along x [m]."""
    return 2.0 + 0.4 * np.sin(1.5 * t)


def write_take(path):
    """Take of 3 s as Motive writes it: y is up, so the cart's height of 1 m is y."""
    rng = np.random.default_rng(0)
    kinds = ["Rotation"] * 4 + ["Position"] * 3
    lines = [
        "Format Version,1.23,Take Name,cart,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
        "Total Exported Frames,361,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global",
        "",
        ",Type" + ",Rigid Body" * 7,
        ",Name" + ",cart" * 7,
        ",ID" + ',"4CF0"' * 7,
        "," + "".join(f",{kind}" for kind in kinds),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z",
    ]
    for k in range(361):
        x, y, z = np.array([distance(k / 120.0), 1.0, 0.0]) + 1e-4 * rng.normal(size=3)
        seen = f"0,0,0,1,{x:.6f},{y:.6f},{z:.6f}" if not 120 < k < 168 else ",,,,,,"
        lines.append(f"{k},{k / 120.0:.6f},{seen}")
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8")


def main():
    if len(sys.argv) > 1:
        print(read_motive_csv(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cart.csv"
        write_take(path)
        capture = read_motive_csv(path)
    print(capture)
    motion = capture.trajectory("cart", extrapolate="error")
    for first, last in motion.gaps:
        print(f"not seen from {first:.3f} to {last:.3f} s")

    radar = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61.5e9, num_samples=128, num_chirps=64)
    cart = rc.Body(rc.shapes.sphere(RADIUS), motion=motion, name="cart")
    simulator = rc.Simulator(rc.Scene([cart]), radar, radar_motion=rc.Pose([0.0, 0.0, 1.0]))
    errors = []
    for start in np.arange(0.1, 2.9, 0.2):
        middle = start + radar.middle
        if not motion.known([start, start + radar.waveform.duration]).all():
            continue
        peak = rc.strongest_peak(simulator.frame(start))
        speed = 0.6 * np.cos(1.5 * middle)
        errors.append([peak.range - (distance(middle) - RADIUS), peak.velocity - speed])
    range_error, velocity_error = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"{len(errors)} frames: errors of {1e3 * range_error:.1f} mm and {1e3 * velocity_error:.1f} mm/s (rms)")


if __name__ == "__main__":
    main()
