"""Velocities beyond the limit of one transmitter's chirps: how often the right period is found.

python benches/ambiguity.py         print the table
python benches/ambiguity.py --write also write the section of docs/velocity.md
python benches/ambiguity.py --tiny  a few frames
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import radarcore as rc
from page import DOCS, table, write_section
from radarcore.direction import unit_vectors

TEXT = """\
## Velocities beyond the limit

Doppler measures velocities up to whole periods of `2 * radar.max_velocity`.

- **Doppler-division multiplex with an empty band** (`rc.Schedule.ddm(np.arange(n) / (n + 1))`): `rc.detect` finds the
  empty band and thus the first transmitter. All velocities up to `waveform.max_velocity` are unambiguous, and the
  direction uses all pairs of antennas. Two echoes at one range that differ by whole bands are one detection.
- **Transmitters in turn, or a single one**: `rc.processing.velocity_hypotheses(frame, detections, max_velocity=...)`
  returns all possible velocities, each with its probability, range and direction. The likelihood uses all samples,
  with range migration and the phases of later transmitters. `.resolved()` chooses the most probable velocity, or NaN
  for velocity and angles if its probability is below 99 %. For recordings, pass it as the detector of a tracker:

```python
def detector(frame):
    return rc.processing.velocity_hypotheses(frame, rc.detect(frame), max_velocity=9.0).resolved()
```

Call `rc.track(recording, detector=detector, velocity_ambiguity=None)`.

Measured on {frames} simulated frames per line, at 77 GHz, 64 chirps, random velocities and directions, a target at 5 to
12 m. Written by `python benches/ambiguity.py --write`. "right": within half a velocity bin, and a probability of
at least 99 % for hypotheses. "mean probability" is of the best hypothesis, "best right" the share of frames in which
it is right.

{table}
"""

WAVEFORM = rc.Waveform(
    start_frequency=77e9, slope=15e12, sample_rate=10e6, num_samples=128, num_chirps=64, chirp_interval=60e-6
)
HALF = 0.5 * WAVEFORM.wavelength
ROW, TURNS = [[0.0, HALF * i, 0.0] for i in range(4)], rc.Schedule.tdm(20e-6)
WIDE = WAVEFORM.replace(slope=100e12)
RECEIVER = rc.Receiver(noise_figure_db=15.0)


def radar_of(
    waveform: rc.Waveform, spacing: tuple[float, float], num_tx: int, schedule: rc.Schedule | None
) -> rc.Radar:
    """Transmitters at equal steps along y and z [half wavelengths], and a row of receivers."""
    tx = [[0.0, HALF * spacing[0] * i, HALF * spacing[1] * i] for i in range(num_tx)]
    rx = ROW if num_tx > 1 else ROW[:1]
    return rc.Radar(waveform, tx=tx, rx=rx, schedule=schedule, receiver=RECEIVER)


CASES = {
    "DDM with an empty band, row of 3 x 4": (radar_of(WAVEFORM, (4, 0), 3, rc.Schedule.ddm(np.arange(3) / 4)), 0.98),
    "TDM, row of 3 x 4": (radar_of(WAVEFORM, (4, 0), 3, TURNS), 3.0),
    "TDM, 2 above each other, 4 side by side": (radar_of(WAVEFORM, (0, 1), 2, TURNS), 1.9),
    "one channel, 0.2 GHz": (radar_of(WAVEFORM, (0, 0), 1, None), 1.9),
    "one channel, 1.3 GHz": (radar_of(WIDE, (0, 0), 1, None), 1.9),
}
"""Radars, and the largest velocity over the limit of the waveform."""


def row(label: str, radar: rc.Radar, most: float, number: int) -> list[str]:
    """Shares of right, unknown and wrong velocities, and how sure they are."""
    rng, limit = np.random.default_rng(5), most * radar.waveform.max_velocity
    within = 0.5 * radar.waveform.velocity_resolution
    right, unknown, probability, best_right, snr_db = [], [], [], [], []
    for k in range(number):
        velocity, distance = rng.uniform(-limit, limit), rng.uniform(5.0, 12.0)
        toward = unit_vectors(rng.uniform(-0.6, 0.6), 0.0)
        start = distance - velocity * 0.01 * k  # another time is other noise
        scene = rc.Scene([rc.PointTarget(start * toward, velocity=velocity * toward, rcs=0.1)])
        frame = rc.Simulator(scene, radar).frame(0.01 * k)
        found = rc.detect(frame)
        if len(found) == 0:
            right, unknown = [*right, False], [*unknown, False]
            continue
        found = found[int(found.snr_db.argmax())]
        snr_db.append(found.snr_db[0])
        if radar.max_velocity < limit:
            hypotheses = rc.processing.velocity_hypotheses(frame, found, max_velocity=limit)
            best = int(np.nanargmax(hypotheses.probability[0]))
            probability.append(hypotheses.probability[0, best])
            best_right.append(abs(hypotheses.velocity[0, best] - velocity) < within)
            found = hypotheses.resolved()
        right.append(abs(found.velocity[0] - velocity) < within)
        unknown.append(np.isnan(found.velocity[0]))
    wrong = ~np.array(right) & ~np.array(unknown)
    shares = [f"{100.0 * np.mean(each):.1f}" for each in (right, unknown, wrong)]
    sure = [f"{100.0 * np.mean(each):.1f}" if each else "" for each in (probability, best_right)]
    return [label, f"{min(snr_db):.0f} to {max(snr_db):.0f}", f"{limit:.0f}", *shares, *sure]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/velocity.md")
    options = parser.parse_args()
    number = 2 if options.tiny else 100
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*beyond max_velocity")
        rows = [row(label, radar, most, number) for label, (radar, most) in CASES.items()]
    header = [
        "radar",
        "SNR [dB]",
        "up to [m/s]",
        "right [%]",
        "NaN [%]",
        "wrong [%]",
        "mean probability [%]",
        "best right [%]",
    ]
    text = table(header, rows)
    print(text)
    if options.write:
        write_section(DOCS / "velocity.md", "ambiguity", TEXT.format(frames=number, table=text))


if __name__ == "__main__":
    main()
