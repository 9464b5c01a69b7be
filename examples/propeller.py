"""At which rate do the blades of a propeller flash, and how fast are their tips?

Twice per turn two blades stand across the line of sight: their complete length returns in phase, a flash from the
velocity of one tip to the velocity of the other. Between the flashes a tip alone is left: a sine. Vary the number of
blades: three flash six times per turn, to one side at a time.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

import radarcore as rc

NUM_BLADES, LENGTH, TURNS = 2, 0.12, 20.0  # [m], [1/s]
TIP_VELOCITY = 2.0 * np.pi * TURNS * LENGTH

waveform = rc.Waveform.from_sweep(
    start_frequency=24e9, stop_frequency=24.25e9, sample_rate=2e6, num_samples=32, num_chirps=16, chirp_interval=100e-6
)
radar = rc.Radar(waveform, tx_power_dbm=10.0, receiver=rc.Receiver(noise_figure_db=12.0))
shaft = rc.Linear(rc.Pose([1.5, 0.0, 0.0]), angular_velocity=[0.0, 0.0, 2.0 * np.pi * TURNS])
rod = rc.shapes.capsule(0.006, LENGTH)  # its axis is z
blades = []
for k in range(NUM_BLADES):
    azimuth = 2.0 * np.pi * k / NUM_BLADES
    middle = 0.5 * LENGTH * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    motion = rc.Attached(shaft, rc.Pose.from_rpy(middle, [0.0, np.pi / 2, azimuth]))
    blades.append(rc.Body(rod, motion=motion, name=f"blade {k}"))
simulator = rc.Simulator(rc.Scene(blades), radar, field_of_view_deg=(14.0, 4.0))


def main(output: Path, num_turns: float) -> None:
    # Frames without a gap: the windows of the spectrogram run on across them.
    recording = simulator.record(0.0, num_turns / TURNS, rate=1.0 / (waveform.num_chirps * waveform.chirp_interval))
    found = rc.spectrogram(recording, overlap=0.875)
    fast = found.power[:, found.velocity > 0.6 * TIP_VELOCITY].sum(axis=1)
    flashes = found.time[find_peaks(fast, height=0.3 * fast.max(), distance=16)[0]]
    rate = 1.0 / np.diff(flashes).mean()
    print(f"{rate:.1f} flashes per second, expected {NUM_BLADES * TURNS:.1f}")

    figure = Figure(figsize=(7.2, 4.0), layout="constrained")
    ax = rc.plot.spectrogram(recording, figure.subplots(), overlap=0.875)
    for velocity in (-TIP_VELOCITY, TIP_VELOCITY):
        ax.axhline(velocity, color="white", linewidth=1.0, linestyle="--")
    ax.text(found.time[0], TIP_VELOCITY + 0.6, f" tips: {TIP_VELOCITY:.1f} m/s", color="white", va="bottom")
    ax.set_title(f"Propeller of {NUM_BLADES} blades, {TURNS:.0f} turns per second")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/propeller.png"))
    options.add_argument("--num-turns", type=float, default=2.0)
    main(**vars(options.parse_args()))
