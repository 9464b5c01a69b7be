"""Ways to measure velocity side by side: deviations against the signal-to-noise ratio, with the Cramér-Rao bounds.

    python benches/velocity.py            print the tables
    python benches/velocity.py --write    also write the section of docs/velocity.md, and docs/velocity.png
    python benches/velocity.py --tiny     run everything once on few trials

Exact samples of one target per trial, at a random range and velocity, with white noise: a frame of chirps for Doppler
and for the changes of the beat frequency, one up- and one down-chirp for the pair.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, printed_into
from radarcore.units import SPEED_OF_LIGHT

PICTURE = DOCS / "velocity.png"

# 4 GHz in a millisecond, 32 times: long and wide, so that all ways can be shown on one scale.
UP = rc.Waveform.from_sweep(
    start_frequency=58e9, stop_frequency=62e9, sample_rate=256e3, num_samples=256, num_chirps=32, chirp_interval=1.1e-3
)
ONE_UP = UP.replace(num_chirps=1)
ONE_DOWN = rc.Waveform.from_sweep(start_frequency=62e9, stop_frequency=58e9, sample_rate=256e3, num_samples=256)

RANGES, FASTEST = (2.0, 6.0), 1.0
"""Ranges [m] and largest velocity [m/s] of the targets; Doppler is unambiguous to 1.14 m/s."""

FROM_DB, PROMISED = 15.0, 1.5
"""From this ratio up, deviations are at most this many times the bound."""

Array = NDArray[np.float64]
Samples = NDArray[np.complex128]


@dataclass(frozen=True)
class Way:
    """A way to measure velocity."""

    name: str
    colour: str
    waveforms: tuple[rc.Waveform, ...]
    estimate: Callable[..., rc.processing.VelocityEstimate]
    """Of the samples of every waveform."""
    bound: Callable[[Array], rc.processing.CramerRaoBound]
    """Of ratios [dB]."""


WAYS = [
    Way(
        "Doppler",
        "tab:blue",
        (UP,),
        lambda up: rc.doppler_velocity(up, UP),
        lambda snr: rc.processing.doppler_bound(UP, snr),
    ),
    Way(
        "up/down pair",
        "tab:orange",
        (ONE_UP, ONE_DOWN),
        lambda up, down: rc.processing.up_down_velocity(up, down, ONE_UP, ONE_DOWN),
        lambda snr: rc.processing.up_down_bound(ONE_UP, ONE_DOWN, snr),
    ),
    Way(
        "chirp rate",
        "tab:red",
        (UP,),
        lambda up: rc.processing.chirp_rate_velocity(up, UP, max_velocity=2.0),
        lambda snr: rc.processing.chirp_rate_bound(UP, snr),
    ),
]


@dataclass(frozen=True)
class Result:
    """Deviations of one way at every ratio."""

    way: Way
    measured: tuple[Array, Array]
    """Rms errors of range [m] and velocity [m/s]."""
    predicted: tuple[Array, Array]
    """Medians of what the estimates predict for themselves."""
    bound: tuple[Array, Array]


def echoes(waveform: rc.Waveform, distance: Array, velocity: Array) -> Samples:
    """Exact samples (trial, 1, chirp, sample) of targets with their range at the middle of the frame."""
    rate = 2.0 * velocity / SPEED_OF_LIGHT
    delay = 2.0 * distance / SPEED_OF_LIGHT - 0.5 * rate * waveform.duration
    amplitude = np.ones((len(delay), 1))
    cube = rc.beat_signal(delay[:, None], amplitude, waveform, delay_rate=rate[:, None], tolerance=1e-9)
    return np.asarray(cube, dtype=np.complex128)[:, None]


def measure(way: Way, ratios: Array, num_trials: int, seed: int) -> Result:
    """Errors over trials at every ratio [dB]."""
    rng = np.random.default_rng(seed)
    measured, predicted = np.empty((2, len(ratios))), np.empty((2, len(ratios)))
    first, last = way.waveforms[0], way.waveforms[-1]
    # The range holds at the middle between the middles of the frames.
    half = 0.5 * (first.frame_interval + 0.5 * last.duration - 0.5 * first.duration) if first is not last else 0.0
    for k, snr_db in enumerate(ratios):
        distance = rng.uniform(*RANGES, num_trials)
        velocity = rng.uniform(-FASTEST, FASTEST, num_trials)
        deviation = np.sqrt(0.5 * 10.0 ** (-0.1 * snr_db))
        noisy = []
        for waveform, since in zip(way.waveforms, (-half, half), strict=False):
            cube = echoes(waveform, distance + velocity * since, velocity)
            noisy.append(cube + deviation * (rng.normal(size=cube.shape) + 1j * rng.normal(size=cube.shape)))
        found = way.estimate(*noisy)
        measured[:, k] = rms(found.range - distance), rms(found.velocity - velocity)
        predicted[:, k] = np.median(found.range_std), np.median(found.velocity_std)
    bound = way.bound(ratios)
    return Result(way, tuple(measured), tuple(predicted), (bound.range, bound.velocity))


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def table(results: list[Result], ratios: Array, which: int) -> list[str]:
    """Lines of bound, measured and predicted deviations of range (0) or velocity (1), every 20 dB."""
    shown = [k for k, snr in enumerate(ratios) if snr % 20.0 == 0.0]
    lines = [
        f"{'':<12}" + "".join(f"{f'at {ratios[k]:.0f} dB':>30}" for k in shown),
        f"{'':<12}" + f"{'bound':>10}{'measured':>10}{'predicted':>10}" * len(shown),
    ]
    for result in results:
        line = f"{result.way.name:<12}"
        for k in shown:
            values = (1e3 * of[which][k] for of in (result.bound, result.measured, result.predicted))
            line += "{:>10.3g}{:>10.3g}{:>10.3g}".format(*values)
        lines.append(line)
    return lines


def draw(results: list[Result], ratios: Array, path: Path) -> None:
    """Deviations of range and velocity against the ratio."""
    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    for which, (axes, quantity) in enumerate(
        zip(figure.subplots(1, 2), ("Range deviation [m]", "Velocity deviation [m/s]"), strict=True)
    ):
        _draw(axes, results, ratios, which, quantity)
    figure.savefig(path, dpi=110)


def _draw(axes: Axes, results: list[Result], ratios: Array, which: int, quantity: str) -> None:
    for result in results:
        way = result.way
        axes.semilogy(ratios, result.bound[which], color=way.colour, label=f"{way.name}: bound")
        axes.semilogy(ratios, result.measured[which], "o", color=way.colour, markersize=5, fillstyle="none")
        axes.semilogy(ratios, result.predicted[which], "x", color=way.colour, markersize=4)
    axes.plot([], [], "ko", fillstyle="none", markersize=5, label="measured")
    axes.plot([], [], "kx", markersize=4, label="predicted")
    axes.axvline(FROM_DB, color="0.7", linewidth=0.8, zorder=0)
    axes.set(xlabel="Signal-to-noise ratio per sample [dB]", ylabel=quantity)
    axes.grid(visible=True, color="0.92")
    if which == 1:
        axes.legend(fontsize=8)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write the section of docs/velocity.md and the picture")
    parser.add_argument("--tiny", action="store_true", help="run everything once on few trials")
    arguments = parser.parse_args()
    ratios = np.array([0.0, 20.0]) if arguments.tiny else np.arange(-10.0, 40.1, 2.5)
    num_trials = 4 if arguments.tiny else 300
    results = [measure(way, ratios, num_trials, seed) for seed, way in enumerate(WAYS)]
    with printed_into(DOCS / "velocity.md", "velocity", write=arguments.write):
        print(f"bound, measured (rms of {num_trials} trials) and predicted (median) deviations")
        for which, title in enumerate(("range [mm]", "velocity [mm/s]")):
            print(f"\n{title}")
            print(*table(results, ratios, which), sep="\n")
        print(f"\nlargest measured deviation over its bound, from {FROM_DB:g} dB up")
        above = ratios >= FROM_DB
        for result in results:
            worst = [float((result.measured[i] / result.bound[i])[above].max()) for i in (0, 1)]
            print(f"{result.way.name:<12}  range {worst[0]:.2f}, velocity {worst[1]:.2f}")
            if not arguments.tiny and max(worst) > PROMISED:
                raise SystemExit(f"{result.way.name}: expected at most {PROMISED} times the bound")
    if arguments.write:
        draw(results, ratios, PICTURE)
        print(f"\n{PICTURE.name}")


if __name__ == "__main__":
    main()
