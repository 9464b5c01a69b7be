"""False-alarm rates, people near walls, errors and run time of detection, and the picture of docs/detection.md.

python benches/detections.py                              print the numbers
python benches/detections.py --write                      also write the section of docs/detection.md
python benches/detections.py --picture docs/detection.png also draw a map with its detections
python benches/detections.py --tiny                       a few frames each
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincc, gammainccinv
from scipy.stats import binomtest

import radarcore as rc
from page import DOCS, printed_into
from radarcore import plot
from radarcore.units import SPEED_OF_LIGHT

WAVEFORM = rc.Waveform.from_sweep(
    start_frequency=60e9,
    stop_frequency=61e9,
    sample_rate=2e6,
    num_samples=128,
    num_chirps=64,
    chirp_interval=300e-6,
)
RADAR = rc.Radar(
    WAVEFORM,
    rx=[[0.0, 2.5e-3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 2.5e-3]],
    receiver=rc.Receiver(output="real", noise_figure_db=12.0),
)
"""Three channels of 64 chirps of 128 real samples, as of a BGT60TR13C."""

SHAPE = (3, 64, 128)
SNR_DB, FADING_DB = (18.0, 24.0, 30.0), 24.0
"""Median SNR in a cell of a channel of people near a wall, and of a fading point [dB]."""

FIRST_BINS = 3
"""Range bins of a frame that `detect` does not test: two next to the radar and the last."""


def false_alarms(num_cells: int) -> None:
    """Rates of `cfar` in exponential noise, in all cells and in cells with cut windows."""
    print("cfar: rate of false alarms over its setting, 1e-3; of the cells whose windows are cut")
    rng = np.random.default_rng(1)
    for axes, shape, guard, training in ((1, (64,), 1, 8), (2, (64, 64), 2, 6)):
        power = rng.exponential(size=(num_cells // np.prod(shape), *shape)).astype(np.float32)
        cut = np.ones(shape, dtype=bool)
        cut[(slice(guard + training, -guard - training),) * axes] = False
        for method in ("ca", "os"):
            options = {"guard": guard, "training": training, "false_alarm_rate": 1e-3, "method": method}
            mask = rc.cfar(power, axes=-1 if axes == 1 else None, **options)
            rates = mask.mean() / 1e-3, mask[:, cut].mean() / 1e-3
            print(f"  {axes}-D {method}: {rates[0]:.3f} of {mask.size:.1e} cells; {rates[1]:.3f}")


def frames_of_noise(num_frames: int) -> None:
    """Detections of noise per cell over the setting, and in frames at a rate of 1e-9."""
    print("detect: detections of noise per cell over the setting")
    rng = np.random.default_rng(2)
    for rate, number in ((1e-3, num_frames), (1e-4, 4 * num_frames)):
        cubes = (rng.standard_normal(SHAPE, dtype=np.float32) for _ in range(number))
        found = sum(len(rc.detect(cube, RADAR, false_alarm_rate=rate)) for cube in cubes)
        expected = rate * number * 64 * (65 - FIRST_BINS)
        print(f"  {rate:g}: {found / expected:.3f} +- {1.0 / np.sqrt(expected):.3f}")
    cubes = (rng.standard_normal(SHAPE, dtype=np.float32) for _ in range(5 * num_frames))
    found = sum(len(rc.detect(cube, RADAR, false_alarm_rate=1e-9)) for cube in cubes)
    print(f"  1e-9: {found} detections in {5 * num_frames} frames")


def echo(distance: float, velocity: float) -> NDArray[np.float64]:
    """Real samples of amplitude 1 of a target that is at `distance` [m] in the middle of the frame."""
    rate = 2.0 * velocity / SPEED_OF_LIGHT
    delay = 2.0 * distance / SPEED_OF_LIGHT - rate * 0.5 * WAVEFORM.duration
    cube = rc.beat_signal([delay], [1.0], WAVEFORM, delay_rate=[rate], tolerance=1e-9, method="direct")
    return np.asarray(cube[0].real)


def errors(num_frames: int) -> None:
    """Errors of range and velocity over the Cramer-Rao bound from all samples."""
    print("detect: rms errors over the Cramer-Rao bound, range and velocity; SNR of a channel, all samples")
    rng = np.random.default_rng(3)
    coupling = WAVEFORM.velocity_resolution * WAVEFORM.center_frequency / WAVEFORM.slope
    for snr_db in (15.0, 20.0, 30.0, 40.0, 50.0):
        deviation = np.sqrt(64 * 128 / 4.0 / 10.0 ** (snr_db / 10.0))
        off = []
        for _ in range(num_frames):
            distance, velocity = rng.uniform(1.2, 8.0), rng.uniform(-2.5, 2.5)
            noise = deviation * rng.standard_normal(SHAPE)
            found = rc.detect((echo(distance, velocity) + noise).astype(np.float32), RADAR)
            if len(found):
                best = found[int(np.argmax(found.snr_db))]
                off.append((best.range[0] - distance, best.velocity[0] - velocity))
        variance = 6.0 / (4.0 * np.pi**2 * 3.0 * 10.0 ** (snr_db / 10.0))  # [bins^2], three channels
        per_bin = np.array([WAVEFORM.range_resolution**2 + coupling**2, WAVEFORM.velocity_resolution**2])
        ratio = np.sqrt(np.mean(np.square(off), axis=0) / (variance * per_bin))
        print(f"  {snr_db:.0f} dB: {ratio[0]:.2f} {ratio[1]:.2f}, found in {len(off)} of {num_frames} frames")


def peak_db(cubes: NDArray[np.float64]) -> NDArray[np.float64]:
    """SNR of the strongest cell of each frame with Hann windows, mean of the channels, for noise of variance 1 [dB]."""
    fast, slow = (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n) for n in (cubes.shape[-1], cubes.shape[-2]))
    cells = np.fft.fft(np.fft.rfft(cubes * fast * slow[:, None]), axis=-2)[..., 2:-1]
    power = np.mean(np.abs(cells) ** 2, axis=1) / (np.sum(fast**2) * np.sum(slow**2))
    return np.asarray(10.0 * np.log10(power.max(axis=(1, 2))))


def walks_and_walls(
    num_walks: int, num_frames: int
) -> Iterator[tuple[rc.Recording, rc.Recording, NDArray[np.float64]]]:
    """A person who walks, a point on the same path, and samples of a wall 1 m behind, in ten seeds, without noise."""
    radar = rc.bgt60tr13c(receiver=rc.Receiver(output="real"))
    view = {"radar_motion": rc.Pose([0.0, 0.0, 1.0]), "sampling": "fast"}
    for walk in range(num_walks):
        rng = np.random.default_rng(walk % 10 + 10 * (walk // 10))
        azimuth, heading = np.deg2rad(rng.uniform(-30.0, 30.0)), np.deg2rad(rng.uniform(-45.0, 45.0))
        middle = rng.uniform(1.5, 3.5) * np.array([np.cos(azimuth), np.sin(azimuth)])
        speed = rng.uniform(0.6, 1.2)
        way = 0.5 * speed * num_frames / 40.0 * rng.choice([-1.0, 1.0]) * np.array([np.cos(heading), np.sin(heading)])
        person = rc.models.Human(
            height=rng.uniform(1.6, 1.9), speed=speed, path=[middle - way, middle + way], phase=rng.uniform()
        )
        point = rc.PointTarget([*(middle - way), 1.0], velocity=[*(2.0 * way * 40.0 / num_frames), 0.0])
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*has a radial speed of")  # feet
            walked, moved = (
                rc.Simulator(rc.Scene(bodies), radar, **view).record(0.0, num_frames / 40.0, rate=40.0, progress=False)
                for bodies in (person.bodies(name="person"), [point])
            )
        shape, place = rc.shapes.box([0.1, 4.0, 2.8]), rc.Pose([middle[0] + 1.05, 0.0, 1.4])
        wall = rc.Body(shape, material=rc.materials["plasterboard"], motion=place)
        yield walked, moved, np.asarray(rc.Simulator(rc.Scene([wall]), radar, **view).frame().cube, dtype=np.float64)


def near_walls(num_walks: int, num_frames: int) -> None:
    """Frames in which a moving target is found 1 m in front of a wall of 44 dB: a person, or a point that fades.

    The median of a person's SNR is over the frames of a walk. The point's power is exponential from frame to frame.
    """
    print("detect: frames with a walking target found, 1 m in front of a wall of 44 dB; median SNR of a channel")
    rng = np.random.default_rng(5)
    hits: dict[tuple[str, float], list[bool]] = {}
    for walked, moved, wall in walks_and_walls(num_walks, num_frames):
        wall *= 10.0 ** ((44.0 - peak_db(wall[None])[0]) / 20.0)
        of_person, of_point = (peak_db(recording.cube.astype(np.float64)) for recording in (walked, moved))
        cases = [("person", snr_db, walked, snr_db - np.median(of_person) + 0.0 * of_person) for snr_db in SNR_DB]
        fading_db = 10.0 * np.log10(rng.exponential(1.0 / np.log(2.0), len(of_point)))
        cases.append(("Swerling-1 point", FADING_DB, moved, FADING_DB + fading_db - of_point))
        for name, snr_db, source, gains_db in cases:
            for cube, ranges, gain_db in zip(source.cube, source.truth.range, gains_db, strict=True):
                noisy = 10.0 ** (gain_db / 20.0) * cube + wall + rng.standard_normal(cube.shape)
                found = rc.detect(noisy.astype(np.float32), source.radar)
                is_near = np.abs(found.range - np.clip(found.range, np.nanmin(ranges), np.nanmax(ranges))) < 0.2
                hits.setdefault((name, snr_db), []).append(bool((is_near & (np.abs(found.velocity) > 0.06)).any()))
    for (name, snr_db), are_found in hits.items():
        low, high = binomtest(sum(are_found), len(are_found)).proportion_ci(method="wilson")
        shares = f"{np.mean(are_found):.1%} of {len(are_found)} frames ({low:.1%} to {high:.1%})"
        print(f"  {name}, {snr_db:.0f} dB: {shares}")
    print(f"  Swerling-1 point without a wall, closed form: {fading_rate(FADING_DB):.1%}")


def fading_rate(median_db: float) -> float:
    """Probability to detect an exponential power in the sum of three cells of known noise (Swerling, 1960)."""
    looks, false_alarm_rate = 3, 1e-6
    threshold, total = gammainccinv(looks, false_alarm_rate), looks * 10.0 ** (0.1 * median_db) / np.log(2.0)
    share = 1.0 + 1.0 / total
    above = share ** (looks - 1) * gammainc(looks - 1, threshold / share) * np.exp(-threshold / (1.0 + total))
    return float(gammaincc(looks - 1, threshold) + above)


def times(num_frames: int) -> None:
    """Processor time of a frame."""
    rng = np.random.default_rng(4)
    for number in (0, 1, 4):
        echoes = sum((0.1 * echo(1.5 + 1.6 * i, 0.7 * i - 1.0) for i in range(number)), np.zeros(SHAPE[1:]))
        cube = (echoes + 0.3 * rng.standard_normal(SHAPE)).astype(np.float32)
        found, taken = rc.detect(cube, RADAR), []
        for _ in range(num_frames):
            start = time.process_time()
            found = rc.detect(cube, RADAR)
            taken.append(time.process_time() - start)
        print(f"detect: {number} echoes: {1e3 * np.median(taken):.2f} ms a frame, {len(found)} detections")


def picture(path: Path) -> None:
    """Map of a noisy frame with its detections and their truth."""
    points = [
        rc.PointTarget([2.0, 0.4, 0.0], rcs=0.003, velocity=[1.2, 0.0, 0.0], name="person"),
        rc.PointTarget([3.1, -0.8, 0.3], rcs=0.001, velocity=[-0.9, 0.0, 0.0], name="hand"),
        rc.PointTarget([4.5, 1.0, 0.0], rcs=0.01, velocity=[-2.0, 0.5, 0.0], name="robot"),
        rc.PointTarget([6.0, -1.0, 0.0], rcs=0.02, velocity=[0.0, 0.0, 0.0], name="post"),
    ]
    frame = rc.Simulator(rc.Scene(points), RADAR).frame()
    found = rc.detect(frame)
    for row in zip(found.range, found.velocity, np.rad2deg(found.azimuth), found.snr_db, strict=True):
        print("  {:.3f} m, {:+.3f} m/s, {:+.1f} degrees, {:.0f} dB".format(*row))
    ax = plot.range_doppler_map(frame)
    ax.plot(found.velocity, found.range, "o", markersize=14, markerfacecolor="none", markeredgecolor="white")
    ax.figure.savefig(path, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    number = 3 if arguments.tiny else 200
    if arguments.picture:
        picture(arguments.picture)
    with printed_into(DOCS / "detection.md", "detections", write=arguments.write):
        false_alarms(20_000 if arguments.tiny else 10**7)
        frames_of_noise(number)
        errors(number if arguments.tiny else 1000)
        near_walls(*((1, 4) if arguments.tiny else (50, 40)))
    times(number)


if __name__ == "__main__":
    main()
