"""Where does an array look when its transmitters are shifted in phase and its receivers are weighted?"""

import sys

import numpy as np

import radarcore as rc

waveform = rc.Waveform(start_frequency=76.5e9, slope=30e12, sample_rate=4e6, num_samples=128)
half = 0.5 * waveform.wavelength
radar = rc.Radar(
    waveform,
    tx=[[0.0, half * (i - 3.5), 0.01] for i in range(8)],
    rx=[[0.0, half * (i - 3.5), 0.0] for i in range(8)],
    pattern=rc.GaussianPattern(5.0, beamwidth_azimuth_deg=90.0, beamwidth_elevation_deg=60.0),
)
STEER_DEG = (0.0, 15.0, 30.0)
TARGETS_DEG = np.arange(-50.0, 51.0, 5.0)
DISTANCE = 15.0


def echo(azimuth_deg: float) -> np.ndarray:
    """Beat signal (channel, chirp, sample) of a metal point."""
    azimuth = np.deg2rad(azimuth_deg)
    scene = rc.Scene([rc.PointTarget([DISTANCE * np.cos(azimuth), DISTANCE * np.sin(azimuth), 0.0])])
    return rc.Simulator(scene, radar, field_of_view_deg=(120.0, 20.0)).frame(0.0).cube


def level_db(cubes: list[np.ndarray], steer_deg: float) -> np.ndarray:
    """Echo of every target in the steered beam, above that of one pair of isotropic antennas at the same range."""
    tx, rx = (
        rc.steering_weights(places, waveform.wavelength, np.deg2rad(steer_deg)) for places in (radar.tx, radar.rx)
    )
    weights = np.kron(tx, rx) / np.sqrt(tx.size * rx.size)  # channel = tx * num_rx + rx
    beams = [np.abs(np.tensordot(weights, cube, 1)).mean() for cube in cubes]
    isotropic = waveform.wavelength / ((4.0 * np.pi) ** 1.5 * DISTANCE**2)  # radar equation, 1 W and 1 m^2
    return 20.0 * np.log10(np.array(beams) / isotropic)


def save_picture(simulated: dict[float, np.ndarray], path: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 3.8), layout="constrained")
    for (steer_deg, level), ax in zip(simulated.items(), figure.subplots(1, len(simulated)), strict=True):
        rc.plot.array_pattern(radar, ax, steer=np.deg2rad(steer_deg))
        ax.plot(TARGETS_DEG, level, "o", color="black", markersize=4.0, label="simulated points")
        ax.set_ylim(-15.0, 50.0)
        ax.legend(loc="upper right")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    cubes = [echo(angle) for angle in TARGETS_DEG]
    simulated = {steer_deg: level_db(cubes, steer_deg) for steer_deg in STEER_DEG}
    for steer_deg, level in simulated.items():
        pattern = rc.array_pattern(radar, np.deg2rad(TARGETS_DEG), steer=np.deg2rad(steer_deg)).two_way_db
        strong = pattern > pattern.max() - 40.0
        error = np.abs(level - pattern)[strong].max()
        loudest = TARGETS_DEG[level.argmax()]
        print(
            f"steered to {steer_deg:2.0f}: loudest target at {loudest:+.0f} degrees, {level.max():.1f} dB; "
            f"within {error:.2f} dB of the pattern"
        )
    if len(sys.argv) > 1:
        save_picture(simulated, sys.argv[1])
