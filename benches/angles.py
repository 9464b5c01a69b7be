"""Two targets in one cell: whether their channels show it, and the directions of both.

python benches/angles.py         print the tables
python benches/angles.py --write also write the section of benches/results/angles.md
python benches/angles.py --tiny  a few cases
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import RESULTS, table, write_section

TEXT = """\
## Two targets in one cell

Written by `python benches/angles.py --write`. The SNR is of the stronger target, in its cell of one channel; the weaker
target is up to {difference:.0f} dB below. Phases and directions up to 50 degrees from the front are random.

`rc.bgt60tr13c()` has three channels in an L. A direction is wrong if it is farther than a third of the beam width from
both targets. Any three phases fit one wave, so only unequal amplitudes reveal the second target. A residual below the
noise of a channel cannot reveal it.

{three}

Uniform arrays with half-wavelength spacing, `rc.detect` of {frames} simulated frames per line, SNR 20 to 30 dB. Errors
are rms errors divided by the predicted standard deviation. "of both": for two detections; "of one": for the single
detection with `max_directions=1`. Beam widths are half-power widths.

{arrays}
"""

Array = NDArray[np.float64]

VIEW = np.sin(np.deg2rad(50.0))
"""Largest sine of the angle from the front."""

DIFFERENCE_DB = 10.0
"""The weaker target is up to this much below the stronger one."""

BEAM_WIDTH = 0.886
"""Half-power beam width of a row of channels, in wavelengths over its length (number times spacing)."""


def noise(rng: np.random.Generator, shape: tuple[int, ...], power: Any = 1.0) -> NDArray[np.complex128]:
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) * np.sqrt(0.5 * power)


def in_view(rng: np.random.Generator, number: int) -> Array:
    """Sines of directions, (number, 2)."""
    angle, radius = 2.0 * np.pi * rng.random(number), VIEW * np.sqrt(rng.random(number))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def three_channels_table(number: int) -> str:
    """Pairs in front of three channels: wrong directions, and the share with `is_resolved` False."""
    radar = rc.bgt60tr13c()
    places = radar.virtual_array[:, 1:] / radar.waveform.wavelength
    rng, rows = np.random.default_rng(1), []
    third = BEAM_WIDTH / (2.0 * np.ptp(places[:, 0])) / 3.0
    for label, snr_db in (
        *((f"{snr:.0f}", [snr, snr]) for snr in (15.0, 20.0, 25.0, 30.0, 40.0)),
        ("15 to 30", [15, 30]),
    ):
        snr = 10.0 ** (0.1 * rng.uniform(*snr_db, number))[:, None]
        truth = np.stack([in_view(rng, number), in_view(rng, number)], axis=1)
        waves = np.sqrt(snr)[:, None] * np.exp(-2j * np.pi * truth @ places.T)
        weaker = 10.0 ** (-0.05 * rng.uniform(0.0, DIFFERENCE_DB, (number, 1)))
        both = waves[:, 0] + weaker * np.exp(2j * np.pi * rng.random((number, 1))) * waves[:, 1]
        found = seen(radar, both + noise(rng, both.shape))
        alone = seen(radar, waves[:, 0] + noise(rng, both.shape))
        sines = np.stack([np.sin(found.azimuth) * np.cos(found.elevation), np.sin(found.elevation)], axis=1)
        is_wrong = (np.linalg.norm(sines[:, None] - truth, axis=2) > third).all(axis=1)
        power = np.square(np.abs(both)).sum(axis=1)
        residual = power - np.square(np.abs(both).sum(axis=1)) / 3.0  # any three phases fit
        shares = [is_wrong, ~found.is_resolved[is_wrong], residual[is_wrong] < 1.0, ~alone.is_resolved]
        rows.append([label, *(f"{100.0 * np.mean(share):.1f}" for share in shares)])
    header = [
        "SNR [dB]",
        "wrong [%]",
        "of these flagged [%]",
        "of these below the noise [%]",
        "single targets flagged [%]",
    ]
    return table(header, rows)


def seen(radar: rc.Radar, snapshots: NDArray[np.complex128]) -> rc.processing.Directions:
    """Directions with the SNR that the snapshots have."""
    snr = np.maximum(np.square(np.abs(snapshots)).mean(axis=1) - 1.0, 0.1)
    return rc.directions(snapshots, radar, snr_db=10.0 * np.log10(snr))


WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=16, chirp_interval=60e-6
)
RANGE = 5.0
"""[m]"""


def row_radar(number: int, num_rows: int = 1) -> rc.Radar:
    """One or several rows of channels with half-wavelength spacing."""
    half = 0.5 * WAVEFORM.wavelength
    return rc.Radar(
        WAVEFORM, tx=[[0, 0, half * i] for i in range(num_rows)], rx=[[0, half * i, 0] for i in range(number)]
    )


def frames_of(
    radar: rc.Radar, sines: Array, snr_db: float, weaker_db: float, rng: np.random.Generator
) -> tuple[rc.Frame, ...]:
    """Frames of two targets in directions (2, 2) at one range and of the first alone, with its SNR in a cell."""
    forward = np.sqrt(1.0 - np.square(sines).sum(axis=1))
    ranges = RANGE + np.array([0.0, 0.5 * radar.waveform.wavelength * rng.random()])
    places = radar.array_center + ranges[:, None] * np.column_stack([forward, sines])
    rcs = [1.0, 10.0 ** (-0.1 * weaker_db)]
    scene = rc.Scene([rc.PointTarget(place, rcs=each) for place, each in zip(places, rcs, strict=True)])
    cube = rc.Simulator(scene, radar).frame().cube
    alone = rc.Simulator(rc.Scene([rc.PointTarget(places[0])]), radar).frame().cube
    wf = radar.waveform
    power = np.mean(np.square(np.abs(alone))) / 10.0 ** (0.1 * snr_db) * wf.num_samples * wf.num_chirps / 1.5**2
    return tuple(rc.Frame(each + noise(rng, cube.shape, power), 0.0, radar) for each in (cube, alone))


def array_table(number: int) -> str:
    """Pairs in front of rows of channels: pairs found, and errors over deviations."""
    rows = []
    for num_channels, num_rows in ((8, 1), (16, 1), (8, 4)):
        radar = row_radar(num_channels, num_rows)
        for low, high in ((0.5, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 4.0)):
            rng = np.random.default_rng(num_channels)
            split, flagged, false, both, single = [], [], [], [], []
            for _ in range(number):
                beam = 2.0 * BEAM_WIDTH / num_channels
                middle = 0.3 * rng.uniform(-1.0, 1.0, 2) * [1.0, num_rows > 1]
                apart = 0.5 * beam * rng.uniform(low, high) * np.array([1.0, 0.0])
                sines = middle + np.array([[-1.0], [1.0]]) * apart * rng.choice([-1.0, 1.0])
                snr_db, weaker_db = rng.uniform(20.0, 30.0), rng.uniform(0.0, DIFFERENCE_DB)
                frame, alone = frames_of(radar, sines, snr_db, weaker_db, rng)
                found, one = (rc.detect(frame, max_directions=k) for k in (2, 1))
                truth = np.column_stack(
                    [np.arctan2(sines[:, 0], np.sqrt(1 - np.square(sines).sum(1))), np.arcsin(sines[:, 1])]
                )
                split.append(len(found) == 2)
                false.append(len(rc.detect(alone, max_directions=2)) == 2)
                flagged.append(not one.is_resolved[0])
                single.append(errors(one, truth)[0])
                if len(found) == 2:
                    both += errors(found, truth)
            ratios = [f"{np.sqrt(np.mean(each) / (1 + (num_rows > 1))):.2f}" if each else "" for each in (both, single)]
            shares = [f"{100.0 * np.mean(each):.1f}" for each in (split, flagged, false)]
            rows.append([f"{num_channels} x {num_rows}", f"{low} to {high}", *shares, *ratios])
    header = [
        "channels",
        "distance [beams]",
        "two found [%]",
        "one flagged [%]",
        "single as two [%]",
        "of both",
        "of one",
    ]
    return table(header, rows)


def errors(found: rc.Detections, truth: Array) -> list[float]:
    """Squared errors over their covariance, of every detection, against the nearest truth."""
    is_seen = np.isfinite([found.azimuth[0], found.elevation[0]])
    squared = []
    for k in range(len(found)):
        error = (np.array([found.azimuth[k], found.elevation[k]]) - truth)[:, is_seen]
        error = error[np.linalg.norm(error, axis=1).argmin()]
        squared.append(float(error @ np.linalg.solve(found.covariance[k, 2:, 2:][np.ix_(is_seen, is_seen)], error)))
    return squared


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/angles.md")
    options = parser.parse_args()
    num_snapshots, num_frames = (200, 2) if options.tiny else (50_000, 200)
    three, arrays = three_channels_table(num_snapshots), array_table(num_frames)
    print(three, arrays, sep="\n\n")
    if options.write:
        text = TEXT.format(difference=DIFFERENCE_DB, three=three, frames=num_frames, arrays=arrays)
        write_section(RESULTS / "angles.md", "angles", text)


if __name__ == "__main__":
    main()
