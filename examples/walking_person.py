"""What does the micro-Doppler signature of a walking person look like?

The trunk is a line at the walking speed, feet and hands swing about it: a foot stands still, then flies at four times
the speed. The person comes nearer for 2.1 s, then walks across. Vary speed, height and path.
"""

import argparse
from pathlib import Path

import numpy as np

import radarcore as rc

waveform = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=64, num_chirps=64, chirp_interval=240e-6
)
radar = rc.Radar(waveform, receiver=rc.Receiver(output="iq", noise_figure_db=12.0))

person = rc.models.Human(height=1.8, speed=1.2, path=[[4.5, 0.0], [2.0, 0.0], [2.0, 3.0]])

simulator = rc.Simulator(
    rc.Scene(person.bodies(name="person")),
    radar,
    radar_motion=rc.Pose([0.0, 0.0, 1.0]),
    field_of_view_deg=(90.0, 70.0),
)


def main(output: Path, duration: float) -> None:
    from matplotlib.figure import Figure

    recording = simulator.record(0.0, duration, rate=40.0)
    truth = recording.truth.select(["person/trunk", "person/right_foot"]).velocity
    peaks = [rc.strongest_peak(frame) for frame in recording.frames()]
    error = np.median([abs(peak.velocity - trunk) for peak, trunk in zip(peaks, truth[:, 0], strict=True)])
    print(f"strongest echo and trunk: {error:.2f} m/s apart (median), bins are {waveform.velocity_resolution:.2f} m/s")
    print(f"fastest foot: {np.nanmax(np.abs(truth[:, 1])):.1f} m/s")

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    names = ["person/trunk", "person/right_foot"]
    ax = rc.plot.spectrogram(recording, figure.subplots(), names=names)
    ax.set_title("Micro-Doppler of a walking person; dashed: truth")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/walking_person.png"))
    options.add_argument("--duration", type=float, default=3.0, help="[s]")
    main(**vars(options.parse_args()))
