"""Where does an array look when its transmitters are shifted in phase and its receivers are weighted?

Dots are the echoes of points at many angles, one after the other; the line is the array's pattern. Beams far to the
side are wider and weaker. Vary the angles, and the distance: near waves are not plane.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc

waveform = rc.Waveform(start_frequency=76.5e9, slope=30e12, sample_rate=4e6, num_samples=128)
row = 0.5 * waveform.wavelength * (np.arange(8) - 3.5)
patch = rc.GaussianPattern(5.0, beamwidth_azimuth_deg=90.0, beamwidth_elevation_deg=60.0)
radar = rc.Radar(waveform, tx=[[0.0, y, 0.01] for y in row], rx=[[0.0, y, 0.0] for y in row], pattern=patch)
STEER_DEG, TARGETS_DEG, DISTANCE = (0.0, 15.0, 30.0), np.arange(-50.0, 51.0, 5.0), 15.0


def echo(azimuth: float) -> np.ndarray:
    """Beat signal (channel, chirp, sample) of a metal point."""
    point = rc.PointTarget([DISTANCE * np.cos(azimuth), DISTANCE * np.sin(azimuth), 0.0])
    return rc.Simulator(rc.Scene([point]), radar, field_of_view_deg=(120.0, 20.0)).frame(0.0).cube


def level_db(cubes: list[np.ndarray], steer: float) -> np.ndarray:
    """Echo of every target in the steered beam, relative to one pair of isotropic antennas at the same range."""
    tx, rx = (rc.processing.steering_weights(places, waveform.wavelength, steer) for places in (radar.tx, radar.rx))
    weights = np.kron(tx, rx) / np.sqrt(tx.size * rx.size)  # channel = tx * num_rx + rx
    beams = [np.abs(np.tensordot(weights, cube, 1)).mean() for cube in cubes]
    isotropic = waveform.wavelength / ((4.0 * np.pi) ** 1.5 * DISTANCE**2)  # radar equation, 1 W and 1 m^2
    return 20.0 * np.log10(np.array(beams) / isotropic)


def main(output: Path) -> None:
    cubes = [echo(azimuth) for azimuth in np.deg2rad(TARGETS_DEG)]
    figure = Figure(figsize=(12.0, 3.6), layout="constrained")
    for steer_deg, ax in zip(STEER_DEG, figure.subplots(1, 3), strict=True):
        level = level_db(cubes, np.deg2rad(steer_deg))
        pattern = rc.array_pattern(radar, np.deg2rad(TARGETS_DEG), steer=np.deg2rad(steer_deg)).two_way_db
        error = np.abs(level - pattern)[pattern > pattern.max() - 40.0].max()
        loudest = f"loudest target at {TARGETS_DEG[level.argmax()]:+.0f} degrees, {level.max():.1f} dB"
        print(f"steered to {steer_deg:2.0f}: {loudest}; within {error:.2f} dB of the pattern")
        rc.plot.array_pattern(radar, ax, steer=np.deg2rad(steer_deg))
        ax.plot(TARGETS_DEG, level, "o", color="black", markersize=4.0, label="simulated points")
        ax.set(ylim=(-15.0, 50.0))
        ax.legend(loc="upper right")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=80)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/beam_steering.png"))
    main(**vars(options.parse_args()))
