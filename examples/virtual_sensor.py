"""What does a program for a real board measure when a simulated scene sits behind its port?

A BGT60TR13C is emulated byte by byte on a pty. The driver opens it as it opens a board, writes its registers and reads
frames: the scene is simulated as the registers ask for. Put a board's port (`/dev/ttyACM0`, `COM3`) in place of the
pty's, and the same lines measure your room. Vary the settings, and `speed`: 1.0 is real time.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc
from radarcore.sensor.emulator.pty import PtyPort


def distance(time: np.ndarray) -> np.ndarray:
    """Distance of the middle of a ball that swings [m]."""
    return 1.5 + 0.5 * np.sin(2.5 * time)


ball = rc.Body(rc.shapes.sphere(0.1), motion=lambda time: rc.Pose([distance(time), 0.0, 0.0]), name="ball")
plate = rc.Body(rc.shapes.plate(0.2, 0.2), motion=rc.Pose([2.6, 0.4, 0.0]), name="plate")
simulator = rc.Simulator(rc.Scene([ball, plate]), rc.bgt60tr13c(), field_of_view_deg=(30.0, 10.0))


def main(output: Path, num_frames: int) -> None:
    wanted = rc.bgt60tr13c(range_resolution=0.05, max_range=3.2, num_chirps=32, frame_interval=50e-3)
    with (
        rc.sensor.virtual_board(simulator, speed=None) as board,  # as fast as it is read
        PtyPort(board) as port,
        rc.open_sensor(port.path) as sensor,
    ):
        sensor.configure(wanted)
        measured = rc.Recording.from_frames(sensor.frames(num_frames))
        print(f"{sensor.info.chip}: {len(measured)} frames, {sensor.num_lost} lost")
    peaks = [rc.strongest_peak(frame, max_range=2.3) for frame in measured.frames()]
    middle = measured.time + measured.radar.middle
    errors = [peak.range - (distance(time) - 0.1) for peak, time in zip(peaks, middle, strict=True)]
    print(f"ball: range errors of {1e3 * np.sqrt(np.mean(np.square(errors))):.1f} mm (rms)")

    figure = Figure(figsize=(7.2, 4.0), layout="constrained")
    # The leakage of the board is 40 dB stronger than the ball; it stands still, as the plate does.
    ax = rc.plot.range_time(measured, figure.subplots(), max_range=3.2, dynamic_range_db=30.0, subtract_mean=True)
    ax.plot(middle, distance(middle) - 0.1, "w--", linewidth=1.5, label="truth")
    ax.legend()
    ax.set_title("A swinging ball, measured through the driver, static echoes removed")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/virtual_sensor.png"))
    options.add_argument("--num-frames", type=int, default=100)
    main(**vars(options.parse_args()))
