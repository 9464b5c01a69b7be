"""How much stronger than noise is a corner reflector, and how much a plate of the same size?

Both are points with the cross-sections of textbooks: 4 pi a^4 / (3 wavelength^2) and 4 pi a^4 / wavelength^2. The plate
must face the radar to a degree, the corner to 20. Vary the edge a and the distance: near plates return less.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import radarcore as rc

waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=62e9, sample_rate=2e6, num_samples=128)
pattern = rc.GaussianPattern(6.0, beamwidth_azimuth_deg=60.0, beamwidth_elevation_deg=40.0)
receiver = rc.Receiver(output="real", noise_figure_db=12.0)
radar = rc.Radar(waveform, pattern=pattern, tx_power_dbm=4.0, receiver=receiver)

# A corner works by three reflections (max_bounces); all of their paths are as long as that to its apex.
conductor = rc.materials["perfect_conductor"]
corner = rc.Body(rc.shapes.trihedral(0.1), material=conductor, motion=rc.Pose([2.0, 0.0, 1.0]), name="corner")
facing = rc.Pose.look_at([3.0, 0.4, 1.0], [0.0, 0.0, 1.0])
plate = rc.Body(rc.shapes.plate(0.1, 0.1), material=conductor, motion=facing, name="plate")
view = {"radar_motion": rc.Pose([0.0, 0.0, 1.0]), "field_of_view_deg": (24.0, 8.0)}
simulator = rc.Simulator(rc.Scene([corner, plate]), radar, max_bounces=3, **view)


def main(output: Path, step_deg: float) -> None:
    from matplotlib.figure import Figure

    ideal_plate = 4.0 * np.pi * 0.1**4 / waveform.wavelength**2
    theory = {corner: ideal_plate / 3.0, plate: ideal_plate}
    points = [rc.PointTarget(body.motion.position, rcs=sigma) for body, sigma in theory.items()]
    frames = simulator.frame(), replace(simulator, scene=rc.Scene(points)).frame()
    figure = Figure(figsize=(10.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    rc.plot.range_profile(frames[0], ax=left, max_range=4.0).lines[0].set(linewidth=4.0, alpha=0.4)
    rc.plot.range_profile(frames[1], ax=left, max_range=4.0).lines[1].set(color="black", linestyle="--")
    left.set_title("Corner and plate; dashed: points of theory")
    for body, distance, bounces in zip((corner, plate), frames[1].truth.range, (3, 1), strict=True):
        peak, ideal = (rc.strongest_peak(one, min_range=distance - 0.3, max_range=distance + 0.3) for one in frames)
        dbsm = 10.0 * np.log10(theory[body])
        print(f"{body.name}: {peak.range:.3f} m, truth {distance:.3f} m; {peak.snr_db:.0f} dB above noise;", end=" ")
        print(f"{dbsm + 10.0 * np.log10(peak.power / ideal.power):.1f} dBsm, theory {dbsm:.1f} dBsm")
        azimuth = np.arange(-30.0, 30.1, step_deg if body is corner else 0.25)
        sigma = rc.rcs(body, waveform.center_frequency, azimuth_deg=180.0 + azimuth, max_bounces=bounces)
        rc.plot.rcs(azimuth, sigma, right, label=body.name)
        right.axhline(dbsm, color="black", linestyle="--", linewidth=1.0)
    right.set(xlim=(30.0, -30.0), ylim=(-25.0, 20.0), title="Turned away; dashed: theory")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=80)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/corner_reflector.png"))
    options.add_argument("--step-deg", type=float, default=2.0)
    main(**vars(options.parse_args()))
