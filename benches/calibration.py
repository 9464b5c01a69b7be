"""Calibration with a corner reflector: directions of a target before and after.

python benches/calibration.py         print the table
python benches/calibration.py --write also write the section of docs/calibration.md
python benches/calibration.py --tiny  one set of errors

A radar with two transmitters in turn and four receivers has random errors of its channels: the simulated cubes are
multiplied by them. ``rc.calibrate`` measures the errors with a trihedral corner. ``rc.detect`` then measures targets
with the raw radar and with ``Radar(channel_weights=...)``.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, table, write_section

TEXT = """\
## Accuracy

{num_seeds} sets of channel errors (gain within {gain:g} dB, phase within {phase:g} degrees, 7 cm too much range) of a
77 GHz radar with two transmitters in turn and four receivers. One frame of a trihedral corner of 5 cm at 1.5 m
calibrates it. The target is at 4 m. Written by `python benches/calibration.py --write`.

{tables}
"""

WAVEFORM = rc.Waveform(
    start_frequency=77e9, slope=20e12, sample_rate=4e6, num_samples=128, num_chirps=32, chirp_interval=80e-6
)
HALF = 0.5 * WAVEFORM.wavelength
RADAR = rc.Radar(
    WAVEFORM,
    tx=[[0.0, 4.0 * HALF * i, 0.0] for i in range(2)],
    rx=[[0.0, HALF * i, 0.0] for i in range(4)],
    receiver=rc.Receiver(noise_figure_db=12.0),
    tx_power_dbm=12.0,
    schedule=rc.Schedule.tdm(),
)
CORNER = (1.5, 0.1, 0.0)
"""Apex of the corner [m]."""
GAIN_DB, PHASE_DEG, RANGE_BIAS = 1.5, 40.0, 0.07
"""Largest errors of the channels, and the error of all ranges [m]."""
AZIMUTHS_DEG = (-40.0, -20.0, 0.0, 20.0, 40.0)
DISTANCE, SPEED = 4.0, 1.0
"""Range [m] and range rate [m/s] of the target."""
NUM_SEEDS = 10

Complex = NDArray[np.complex128]


def errors_of(seed: int) -> Complex:
    """Errors of the channels and of the range, as factors of samples (channel, 1, sample)."""
    rng = np.random.default_rng(seed)
    gain = 10.0 ** (rng.uniform(-GAIN_DB, GAIN_DB, RADAR.num_channels) / 20.0)
    phase = np.deg2rad(rng.uniform(-PHASE_DEG, PHASE_DEG, RADAR.num_channels))
    delay = 2.0 * RANGE_BIAS / 299_792_458.0
    shift = np.exp(2j * np.pi * WAVEFORM.slope * delay * WAVEFORM.sample_times)
    return (gain * np.exp(1j * phase))[:, None, None] * shift


def measured(frame: rc.Frame, errors: Complex) -> rc.Frame:
    """The frame of a radar with errors."""
    return rc.Frame((frame.cube * errors).astype(np.complex64), frame.time, frame.radar)


def corner_frame(seed: int) -> rc.Frame:
    """A trihedral corner and a wall behind it."""
    conductor = rc.materials["perfect_conductor"]
    corner = rc.Body(rc.shapes.trihedral(0.05), material=conductor, motion=rc.Pose(list(CORNER)), name="corner")
    wall = rc.PointTarget([3.0, -0.5, 0.0], rcs=10.0)
    view = {"field_of_view_deg": (20.0, 10.0), "max_bounces": 3, "seed": seed}
    return rc.Simulator(rc.Scene([corner, wall]), RADAR, **view).frame()


def target_frame(azimuth_deg: float, seed: int) -> rc.Frame:
    """A target that moves away."""
    away = np.array([np.cos(np.deg2rad(azimuth_deg)), np.sin(np.deg2rad(azimuth_deg)), 0.0])
    start = (DISTANCE - SPEED * RADAR.middle) * away + RADAR.array_center
    return rc.Simulator(rc.Scene([rc.PointTarget(start, rcs=0.1, velocity=SPEED * away)]), RADAR, seed=seed).frame()


def strongest(frame: rc.Frame, radar: rc.Radar) -> tuple[float, float, bool]:
    """Azimuth [degrees] and range [m] of the strongest detection, and whether one target explains it."""
    found = rc.detect(frame.cube, radar)
    best = int(found.snr_db.argmax())
    return float(np.rad2deg(found.azimuth[best])), float(found.range[best]), bool(found.is_resolved[best])


def tables(num_seeds: int) -> str:
    """Tables of the calibration and of the directions."""
    left: list[Complex] = []
    offsets: list[float] = []
    found: dict[float, list[tuple[float, ...]]] = {azimuth: [] for azimuth in AZIMUTHS_DEG}
    ranges: list[tuple[float, float]] = []
    for seed in range(num_seeds):
        errors = errors_of(seed)
        calibration = rc.calibrate(measured(corner_frame(seed), errors), at=CORNER)
        calibrated = replace(RADAR, channel_weights=calibration.channel_weights)
        offsets.append(calibration.range_offset)
        rest = calibration.channel_weights * errors[:, 0, 0] / np.exp(1j * np.angle(errors[0, 0, 0]))
        left.append(rest / np.abs(rest).mean())
        for azimuth in AZIMUTHS_DEG:
            seen = measured(target_frame(azimuth, seed), errors)
            raw, better = strongest(seen, RADAR), strongest(seen, calibrated)
            found[azimuth].append((raw[0] - azimuth, better[0] - azimuth, raw[2], better[2]))
            ranges.append((raw[1] - DISTANCE, raw[1] - calibration.range_offset - DISTANCE))
    gains, phases = 20.0 * np.log10(np.abs(left)), np.rad2deg(np.angle(left))
    rows = []
    for azimuth, each in found.items():
        before, after, was_single, is_single = np.array(each, dtype=float).T
        rms = [f"{np.sqrt(np.mean(np.square(values))):.2f}" for values in (before, after)]
        shares = [f"{100.0 * np.mean(values):.0f}" for values in (was_single, is_single)]
        rows.append([f"{azimuth:.0f}", *rms, f"{np.abs(before).max():.2f}", f"{np.abs(after).max():.2f}", *shares])
    header = ["azimuth [deg]", "rms error before [deg]", "after", "largest before", "after"]
    header += ["one target explains it, before [%]", "after [%]"]
    range_errors = np.sqrt(np.mean(np.square(ranges), axis=0))
    return (
        f"{table(header, rows)}\n\n"
        f"Errors of the weights: {np.sqrt(np.mean(gains**2)):.3f} dB and {np.sqrt(np.mean(phases**2)):.2f} degrees "
        f"(rms). Error of the range offset: at most {1e3 * np.abs(np.array(offsets) - RANGE_BIAS).max():.2f} mm. Error "
        f"of the target's range: {1e3 * range_errors[0]:.1f} mm before, {1e3 * range_errors[1]:.1f} mm after (rms)."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/calibration.md")
    options = parser.parse_args()
    num_seeds = 1 if options.tiny else NUM_SEEDS
    text = tables(num_seeds)
    print(text)
    if options.write:
        values = {"num_seeds": num_seeds, "gain": GAIN_DB, "phase": PHASE_DEG, "tables": text}
        write_section(DOCS / "calibration.md", "calibration", TEXT.format(**values))


if __name__ == "__main__":
    main()
