"""Which of two targets at the same range does an array of 3 transmitters and 4 receivers tell apart?"""

import sys

import numpy as np

import radarcore as rc

waveform = rc.Waveform(
    start_frequency=76.5e9, slope=30e12, sample_rate=4e6, num_samples=128, num_chirps=32, chirp_interval=120e-6
)
half = 0.5 * waveform.wavelength
radar = rc.Radar(
    waveform,
    tx=[[0.0, 4 * half * i, 0.0] for i in (-1, 0, 1)],  # three times the row of receivers: a row of 12 channels
    rx=[[0.0, half * (i - 1.5), 0.0] for i in range(4)],
    pattern=rc.GaussianPattern(8.0, beamwidth_azimuth_deg=90.0, beamwidth_elevation_deg=30.0),
    tx_power_dbm=12.0,
    receiver=rc.Receiver(noise_figure_db=12.0),
    schedule=rc.Schedule.tdm(),
)

# The beam of 12 channels is 8.5 degrees wide: the pair is closer, the single target is far from both.
TRUTH_DEG = {"pair left": -12.5, "pair right": -17.5, "single": 20.0}
DISTANCE = 8.0
ANGLES_DEG = np.arange(-60.0, 60.1, 0.25)


def point(name: str, azimuth_deg: float) -> rc.PointTarget:
    azimuth = np.deg2rad(azimuth_deg)
    return rc.PointTarget([DISTANCE * np.cos(azimuth), DISTANCE * np.sin(azimuth), 0.0], name=name)


simulator = rc.Simulator(
    rc.Scene([point(name, angle) for name, angle in TRUTH_DEG.items()]), radar, field_of_view_deg=(120.0, 20.0)
)


def peaks_deg(power: np.ndarray, least: float) -> np.ndarray:
    """Local maxima above some level."""
    places = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    return ANGLES_DEG[places[power[places] > least]]


def save_picture(frame: rc.Frame, path: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 3)
    rc.plot.virtual_array(radar, axes[0], unit="wavelengths")
    for method, ax in zip(("bartlett", "music"), axes[1:], strict=True):
        rc.plot.range_angle_map(frame, ax, method=method, field_of_view_deg=90.0, max_range=12.0)
        ax.set_title({"bartlett": "Bartlett", "music": "MUSIC"}[method])
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    frame = simulator.frame(0.0)
    nearest = np.abs(waveform.range_axis() - DISTANCE).argmin()
    print("truth    ", *(f"{angle:+6.1f}" for angle in sorted(TRUTH_DEG.values())), "degrees")
    for method in ("bartlett", "fft", "capon", "music"):
        power = rc.range_angle(frame, method=method, azimuth=np.deg2rad(ANGLES_DEG))[nearest]
        least = 10.0 if method == "music" else 0.1 * power.max()  # MUSIC is 1 and above, no power
        print(f"{method:9}", *(f"{angle:+6.1f}" for angle in peaks_deg(power, least)))
    if len(sys.argv) > 1:
        save_picture(frame, sys.argv[1])
