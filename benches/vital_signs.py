"""Breathing and heart rate of a simulated person at rest.

python benches/vital_signs.py         print the table
python benches/vital_signs.py --write also write the section of docs/vital-signs.md
python benches/vital_signs.py --tiny  one person

A chest at 0.6 m moves by breaths and heartbeats, with a static echo of equal power beside it and a wall. The samples
are the closed form of ``rc.beat_signal`` for the delay at every chirp, without the simulator.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, table, write_section

TEXT = """\
## Accuracy

{num_seeds} persons for each row: 4 mm of breathing at 10 to 22 breaths per minute, 50 to 100 heartbeats per minute, one
SNR of 20 dB in the cell of the chest, in each of three channels of a BGT60TR13C with 20 frames per second. Irregular:
every breath and beat differs in length by 5 % rms. Wrong: a heart rate more than 3 per minute off. Written by
`python benches/vital_signs.py --write`.

{tables}
"""

RATE, SNR_DB, DISTANCE = 20.0, 20.0, 0.6
"""Frames per second, SNR of the chest in a cell of a frame [dB], and its range [m]."""

RADAR = rc.bgt60tr13c(
    start_frequency=58.5e9, stop_frequency=63.5e9, num_samples=64, num_chirps=8, frame_interval=1.0 / RATE
)
BREATH = 4e-3
"""Movement of the chest by a breath, peak to peak [m]."""
WITHIN = 3.0 / 60.0
"""Largest error of a heart rate [Hz]."""
NUM_SEEDS = 10

Array = NDArray[np.float64]


@dataclass
class Person:
    """A recording of a person at rest, and the true mean rates [Hz]."""

    recording: rc.Recording
    breathing: float
    heart: float


def cycles(rng: np.random.Generator, rate: float, irregular: float, duration: float) -> tuple[Array, Array]:
    """Times [s] at which cycles begin, each of its own length, and the numbers of the cycles."""
    lengths = (1.0 + irregular * rng.standard_normal(int(3.0 * rate * duration) + 5)) / rate
    return np.concatenate([[0.0], np.cumsum(lengths)]) - rng.uniform() / rate, np.arange(len(lengths) + 1.0)


def person(seed: int, heart: float, *, duration: float = 60.0, irregular: float = 0.0) -> Person:
    """Somebody whose heart moves the chest by `heart`, peak to peak [m]."""
    rng = np.random.default_rng(seed)
    waveform = RADAR.waveform
    starts = np.arange(round(duration * RATE)) / RATE
    time = starts[:, None] + waveform.chirp_times  # (frame, chirp)
    ends = np.array([0.0, duration])
    movement, rates = np.zeros(time.shape), []
    for mean, size, harmonics in (
        (rng.uniform(10.0, 22.0) / 60.0, BREATH, (1.0, 0.2, 0.05)),
        (rng.uniform(50.0, 100.0) / 60.0, heart, (1.0, 0.3, 0.0)),
    ):
        moments, numbers = cycles(rng, mean, irregular, duration)
        rates.append(float(np.diff(np.interp(ends, moments, numbers))[0]) / duration)
        phase = 2.0 * np.pi * np.interp(time, moments, numbers)
        movement += size * wave(phase, harmonics) / np.ptp(wave(np.linspace(0.0, 2.0 * np.pi, 1000), harmonics))

    # Beat signals of the chest, of a static echo in the same cell, and of a wall.
    places = np.array([[DISTANCE, 0.0, 0.0], [DISTANCE + 0.01, 0.05, 0.0], [0.85, 0.0, 0.0]])
    cube = np.zeros((len(starts), RADAR.num_channels, waveform.num_chirps, waveform.num_samples), np.float32)
    for place, level, moves in zip(places, (1.0, 1.0, 3.0), (True, False, False), strict=True):
        paths = np.linalg.norm(place - RADAR.tx[0]) + np.linalg.norm(place - RADAR.rx, axis=1)
        both = paths[:, None] + 2.0 * (movement[:, None] if moves else np.zeros((1, 1, 1)))  # (frame, channel, chirp)
        delay = both[..., None] / 299_792_458.0
        ramp = waveform.start_frequency + waveform.slope * (waveform.sample_times - 0.5 * delay)
        cube += level * np.cos(2.0 * np.pi * ramp * delay)

    # A cell of a frame has the mean of the chirps: of a real tone sum(w) / 2, and of noise sum(w^2) / chirps.
    window = np.hanning(waveform.num_samples + 1)[:-1]
    signal = (0.5 * window.sum()) ** 2 * 10.0 ** (-0.1 * SNR_DB)
    cube += rng.normal(0.0, np.sqrt(signal * waveform.num_chirps / np.square(window).sum()), cube.shape)
    return Person(rc.Recording(cube, starts, RADAR), *rates)


def wave(phase: Array, harmonics: tuple[float, ...]) -> Array:
    """A movement with harmonics."""
    return np.sum([size * np.sin((k + 1) * phase + 0.7 * k) for k, size in enumerate(harmonics)], axis=0)


def row(label: str, heart: float, num_seeds: int, **settings: float) -> list[str]:
    """Errors of persons with one movement of the heart [m]."""
    breathing, sizes, found = [], [], []
    for seed in range(num_seeds):
        one = person(seed, heart, **settings)
        signs = rc.processing.vital_signs(one.recording)
        breathing.append(signs.breathing_rate / one.breathing - 1.0)
        sizes.append(signs.amplitude)
        found.append(signs.heart_rate - one.heart)
    errors, known = np.abs(found), np.isfinite(found)
    right = known & (np.nan_to_num(errors, nan=np.inf) <= WITHIN)
    largest = f"{60.0 * np.max(errors[known]):.2f}" if known.any() else "-"
    return [
        label,
        f"{1e3 * heart:g}",
        f"{100.0 * np.nanmax(np.abs(breathing)):.2f}",
        f"{np.isnan(breathing).sum()}",
        f"{1e3 * np.nanmean(sizes):.2f}",
        f"{right.sum()}",
        f"{(known & ~right).sum()}",
        f"{(~known).sum()}",
        largest,
    ]


def tables(num_seeds: int) -> str:
    """Table of all persons."""
    cases: list[tuple[str, float, dict[str, float]]] = [
        ("regular, 60 s", 0.5e-3, {}),
        ("regular, 60 s", 0.35e-3, {}),
        ("regular, 60 s", 0.2e-3, {}),
        ("irregular, 60 s", 0.5e-3, {"irregular": 0.05}),
        ("irregular, 60 s", 0.2e-3, {"irregular": 0.05}),
        ("regular, 20 s", 0.35e-3, {"duration": 20.0}),
        ("no heart, 60 s", 0.0, {}),
        ("irregular, no heart", 0.0, {"irregular": 0.05}),
    ]
    header = ["person", "heart [mm]", "breathing: largest error [%]", "NaN", "amplitude [mm]"]
    header += ["heart: within 3/min", "wrong", "NaN", "largest error [1/min]"]
    return table(header, [row(label, heart, num_seeds, **settings) for label, heart, settings in cases])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/vital-signs.md")
    options = parser.parse_args()
    num_seeds = 1 if options.tiny else NUM_SEEDS
    text = tables(num_seeds)
    print(text)
    if options.write:
        write_section(DOCS / "vital-signs.md", "vital_signs", TEXT.format(num_seeds=num_seeds, tables=text))


if __name__ == "__main__":
    main()
