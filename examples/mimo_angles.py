"""Which targets at the same range does an array of 3 transmitters and 4 receivers separate?

Three transmitters in turn and four receivers are a row of twelve channels. Its beam, 8.5 degrees wide, merges the pair;
MUSIC, which looks for directions orthogonal to the noise, parts it. Vary the angles, and the number of receivers.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

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
TRUTH_DEG, DISTANCE = np.array([-17.5, -12.5, 20.0]), 8.0
ANGLES_DEG = np.arange(-60.0, 60.1, 0.25)
places = [DISTANCE * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) for azimuth in np.deg2rad(TRUTH_DEG)]
simulator = rc.Simulator(rc.Scene([rc.PointTarget(place) for place in places]), radar, field_of_view_deg=(120.0, 20.0))


def main(output: Path) -> None:
    frame, nearest = simulator.frame(), np.abs(waveform.range_axis() - DISTANCE).argmin()
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    array, ax, above = figure.subplot_mosaic("ac;mc", height_ratios=(1.0, 4.0), width_ratios=(1.2, 1.0)).values()
    rc.plot.virtual_array(radar, array, unit="wavelengths").set_ylabel("z, up")
    view = {"method": "capon", "max_range": 10.0, "field_of_view_deg": 120.0, "dynamic_range_db": 30.0}
    rc.plot.range_angle_map(frame, above, **view).set_title("Capon: one spot for the pair at the right")
    print("truth    ", *(f"{angle:+6.1f}" for angle in TRUTH_DEG), "degrees")
    for method in ("bartlett", "fft", "capon", "music"):
        power = rc.range_angle(frame, method=method, azimuth=np.deg2rad(ANGLES_DEG))[nearest]
        least = 10.0 if method == "music" else 0.1 * power.max()  # MUSIC is 1 and above, no power
        print(f"{method:9}", *(f"{angle:+6.1f}" for angle in ANGLES_DEG[find_peaks(power, height=least)[0]]))
        if method != "fft":  # the same as "bartlett"
            ax.plot(ANGLES_DEG, 10.0 * np.log10(power / power.max()), label=method)
    ax.vlines(TRUTH_DEG, -60.0, 3.0, color="black", linestyle="--", linewidth=1.0, label="truth")
    ax.set(xlim=(45.0, -45.0), ylim=(-60.0, 3.0), xlabel="Azimuth [°]", ylabel="Level [dB]", title="At 8 m")
    ax.legend(loc="lower center", ncols=2)
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=80)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/mimo_angles.png"))
    main(**vars(options.parse_args()))
