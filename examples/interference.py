"""What does another car's radar do to ours: one chirp with the burst, and the floor of the range-velocity map?

Falling ramps cross our rising ones: their difference sweeps through our filter, a burst in the chirp and noise in the
map. Vary the slope of the other radar: the closer to ours, the longer the burst.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc

horn = rc.GaussianPattern(13.0, beamwidth_azimuth_deg=60.0, beamwidth_elevation_deg=15.0)
ours = rc.Waveform.from_sweep(
    start_frequency=76.4e9, stop_frequency=76.8e9, sample_rate=20e6, num_samples=512, adc_delay=4e-6
).replace(num_chirps=128, chirp_interval=32e-6)
theirs = rc.Waveform.from_sweep(
    start_frequency=76.9e9, stop_frequency=76.3e9, sample_rate=20e6, num_samples=1000
).replace(num_chirps=100, chirp_interval=57e-6, frame_interval=7e-3)
radar = rc.Radar(ours, pattern=horn, tx_power_dbm=12.0, receiver=rc.Receiver(noise_figure_db=12.0))
other = rc.Radar(theirs, pattern=horn, tx_power_dbm=12.0)
targets = [
    rc.PointTarget([40.0, -2.0, 0.0], rcs=10.0, velocity=[5.0, 0.0, 0.0], name="car"),
    rc.PointTarget([25.0, 2.0, 0.0], rcs=1.0, velocity=[-6.0, 0.0, 0.0], name="cyclist"),
    rc.PointTarget([18.0, -4.0, 0.0], rcs=0.02, velocity=[0.0, 1.0, 0.0], name="child"),
]
oncoming = rc.Linear(rc.Pose.look_at([30.0, 3.5, 0.0], [0.0, 3.5, 0.0]), velocity=[-10.0, 0.0, 0.0])
interferer = rc.Interferer(other, oncoming, start=0.3e-3, name="oncoming")
simulator = rc.Simulator(rc.Scene([*targets, interferer]), radar)


def main(output: Path) -> None:
    frames = {"alone": rc.Simulator(rc.Scene(targets), radar).frame(), "disturbed": simulator.frame()}
    stats = frames["disturbed"].stats
    print(f"received {10.0 * np.log10(stats['strongest_interferer']) + 30.0:.1f} dBm, {stats['chirps_hit']} chirps hit")
    burst = ours.sample_rate**2 / abs(ours.slope - theirs.slope)
    print(f"a crossing lasts {1e6 * burst / ours.sample_rate:.2f} us, {burst:.0f} of {ours.num_samples} samples")
    floors, found = [], {name: [] for name in frames}
    figure = Figure(figsize=(8.6, 5.4), layout="constrained")
    for (name, frame), (upper, lower) in zip(frames.items(), figure.subplots(2, 2).T, strict=True):
        rc.plot.chirp(frame, chirp=12, ax=upper).set(title=f"One chirp, {name}", ylim=(-30.0, 40.0))
        rc.plot.range_doppler_map(frame, ax=lower, max_range=60.0, max_velocity=12.0).set_title(f"Map, {name}")
        floors.append(10.0 * np.log10(rc.processing.noise_level(np.abs(rc.range_doppler(frame)) ** 2)))
        for target, r, v in zip(frame.truth.names, frame.truth.range, frame.truth.velocity, strict=True):
            around = {"min_range": r - 1.0, "max_range": r + 1.0, "min_velocity": v - 1.0, "max_velocity": v + 1.0}
            found[name].append(f"{target} {rc.strongest_peak(frame, min_snr_db=0.0, **around).snr_db:.1f}")
        print(f"dB over the floor, {name}: {', '.join(found[name])}")
    lower.annotate("lost in the noise", (v, r), (1.5, 5.0), color="white", arrowprops={"arrowstyle": "->", "ec": "w"})
    print(f"floor raised by {floors[1] - floors[0]:.1f} dB")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=80)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/interference.png"))
    main(**vars(options.parse_args()))
