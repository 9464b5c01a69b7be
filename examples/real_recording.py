"""How does a person breathe, by a recording of a real sensor? Give its folder: of Infineon's tools, or of radarcore.

The person is tracked in what does not stand still. The phase of the echo there shows the chest to fractions of a
millimetre, though a range bin is centimetres wide: half a wavelength is a turn. The same lines take a simulated
recording. Vary the channel, and the range at which the phase is taken.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import find_peaks

import radarcore as rc


def main(recording: Path, output: Path, max_range: float | None) -> None:
    measured = rc.Recording.load(recording)
    wf = measured.radar.waveform
    tracks = rc.track(replace(measured, cube=rc.remove_mean(measured.cube, axis=0)), num_dimensions=1)
    longest = max(tracks, key=len)
    nearest, farthest = longest.range.min(), longest.range.max()
    print(f"tracked in {len(longest)} of {len(measured)} frames, at {nearest:.2f} to {farthest:.2f} m")

    # Half a wavelength farther away turns the phase of the echo once.
    profile = rc.range_profile(measured.cube.mean(axis=2), wf, num_bins=512).mean(axis=1)
    k = int(np.abs(wf.range_axis(512) - np.median(longest.range)).argmin())
    shift = 1e3 * np.unwrap(np.angle(profile[:, k])) * wf.wavelength / (4.0 * np.pi)
    breaths = measured.time[find_peaks(shift, prominence=1.5)[0]]
    print(f"{60.0 / np.diff(breaths).mean():.0f} breaths per minute")

    figure = Figure(figsize=(8.0, 5.8), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    rc.plot.range_time(measured, upper, subtract_mean=True, max_range=max_range)
    upper.plot(longest.time, longest.range, "c-", label="track")
    upper.legend(loc="upper right")
    upper.set(title="Power over range, without what stands still", xlabel="")
    lower.plot(measured.time, shift - shift.mean())
    lower.set(title="Movement of the chest, by the phase of its echo", xlabel="Time [s]", ylabel="Distance [mm]")
    lower.grid(alpha=0.3)
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("recording", type=Path)
    options.add_argument("-o", "--output", type=Path, default=Path("out/real_recording.png"))
    options.add_argument("--max-range", type=float, help="end of the range axis [m]")
    main(**vars(options.parse_args()))
