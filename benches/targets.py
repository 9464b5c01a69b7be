"""A ball and a plate at 20 m, the targets of RadarSimPy's own benchmark: error against closed forms, and run time.

python benches/targets.py            print the table
python benches/targets.py --write    also write its section of benches/results/performance.md
python benches/targets.py --tiny     one frame each
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np

import radarcore as rc
from page import PERFORMANCE, machine, milliseconds, table, write_section
from radarcore.units import SPEED_OF_LIGHT

DISTANCE = 20.0
"""From the radar to the middle of the target [m]."""

RADIUS, SIDE = 0.5, 5.0
"""Of the ball and of the plate [m]."""

PUBLISHED = {"ball of 1 m": 0.218, "plate of 5 x 5 m": 2.23}
"""Run times of RadarSimPy's `bench_sbr` at density 1 on 16 threads [s]."""

TEXT = """\
## One target at 20 m

The targets of RadarSimPy's own benchmark (`bench_sbr`: 76 to 77 GHz, one pulse of 20 samples, one perfectly conducting
mesh), default settings, two threads, {machine}. Written by `python benches/targets.py --write`: medians over {frames}
frames [ms]. "first frame" is for a new simulator; "next frames" copy static parts. "error" is the error of the mean
power, against geometric optics of a sphere and against the image of the radar behind a mirror. "published" is the time
that RadarSimPy gives for 16 threads of another machine, at a density of one ray per wavelength.

{table}
"""


def radar() -> rc.Radar:
    """76 to 77 GHz, isotropic antennas, one chirp of 20 samples: unambiguous up to 3 m only."""
    waveform = rc.Waveform.from_sweep(
        start_frequency=76e9, stop_frequency=77e9, sample_rate=2e6, num_samples=20, num_chirps=1
    )
    return rc.Radar(waveform, pattern=rc.IsotropicPattern(), tx=[[0.0, 0.0, 0.0]], rx=[[0.0, 0.0, 0.0]])


def targets(wavelength: float) -> dict[str, tuple[rc.Mesh, float]]:
    """Mesh and mean power of the samples for 1 W and isotropic antennas, by name."""
    near = DISTANCE - RADIUS
    # The sphere's virtual source spreads by a / (2 (d + a)) on the way back (geometric optics).
    ball = (wavelength / (4.0 * np.pi) * RADIUS / (2.0 * near * (near + RADIUS))) ** 2
    plate = (wavelength / (4.0 * np.pi * 2.0 * DISTANCE)) ** 2
    return {
        "ball of 1 m": (rc.shapes.sphere(RADIUS), ball),
        "plate of 5 x 5 m": (rc.shapes.plate(SIDE, SIDE), plate),
    }


def measure(mesh: rc.Mesh, num_frames: int) -> tuple[float, float, float, int]:
    """Mean power [W], medians of the times of a first and of a further frame [s], number of points."""
    body = rc.Body(mesh, material=rc.materials["perfect_conductor"], motion=rc.Pose([DISTANCE, 0.0, 0.0]))
    scene, first, further = rc.Scene([body]), [], []
    for _ in range(num_frames):
        start = time.perf_counter()
        simulator = rc.Simulator(scene, radar(), threads=2)
        simulator.frame(0.0)
        first.append(time.perf_counter() - start)
        start = time.perf_counter()
        frame = simulator.frame(0.1)
        further.append(time.perf_counter() - start)
    power = float((np.abs(frame.cube) ** 2).mean())
    return power, float(np.median(first)), float(np.median(further)), frame.stats["paths"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="one frame each")
    options = parser.parse_args()
    num_frames = 1 if options.tiny else 30
    warnings.filterwarnings("ignore", message=".*max_range.*")
    waveform = radar().waveform
    rows = []
    for name, (mesh, expected) in targets(SPEED_OF_LIGHT / waveform.center_frequency).items():
        power, first, further, paths = measure(mesh, num_frames)
        error = 10.0 * np.log10(power / expected)
        rows.append(
            [name, f"{error:+.2f} dB", *map(milliseconds, (first, further)), f"{paths}", milliseconds(PUBLISHED[name])]
        )
    text = table(["target", "error", "first frame", "next frames", "paths", "published"], rows)
    print(text)
    if options.write:
        write_section(PERFORMANCE, "targets", TEXT.format(table=text, machine=machine(), frames=num_frames))


if __name__ == "__main__":
    main()
