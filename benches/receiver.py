"""The simulated receiver of a BGT60TR13C against a recording of a real one: noise, leakage, codes, phase noise, time.

python benches/receiver.py                        numbers of the model alone
python benches/receiver.py RECORDING              beside a recording of an empty or quiet scene
python benches/receiver.py RECORDING --write      also write the section of docs/receiver.md
python benches/receiver.py RECORDING --picture    also draw docs/receiver.png
python benches/receiver.py --tiny                 a few frames
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, printed_into
from radarcore.receive.chain import receive
from radarcore.receive.phase_noise import phase_density
from radarcore.units import SPEED_OF_LIGHT

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "receiver.png"

WIDE = {"start_frequency": 58e9, "stop_frequency": 63.5e9, "chirp_interval": 591.125e-6, "frame_interval": 77.26885e-3}
"""Sweep and times of the chip at power-up, with which recordings of quiet scenes are made."""

ROWS = {
    "mean code": "{:.0f}",
    "leakage, peak to peak [LSB]": "{:.0f}",
    "offset from chirp to chirp [LSB]": "{:.2f}",
    "noise within a chirp [LSB]": "{:.2f}",
    "noise, upper half of the range bins [LSB]": "{:.2f}",
    "odd codes [%]": "{:.0f}",
}


class Statistics:
    """Numbers of codes (frame, rx, chirp, sample), each (rx,), and curves over samples and range bins."""

    def __init__(self, raw: NDArray[np.uint16]) -> None:
        codes = raw.astype(np.float64)
        num_samples = codes.shape[-1]
        self.chirp = codes.mean(axis=(0, 2))
        # From one chirp to the next a scene is almost static: the difference is twice the noise power.
        change = np.diff(codes, axis=2) / np.sqrt(2.0)
        offset = change.mean(axis=-1, keepdims=True)
        self.change = change - offset
        spectrum = np.fft.rfft(self.chirp - self.chirp.mean(axis=1, keepdims=True))
        self.leakage = np.abs(spectrum[:, 1:10]) ** 2
        self.density = (np.abs(np.fft.rfft(self.change)) ** 2).mean(axis=(0, 2)) / num_samples
        upper = self.density[:, len(self.density[0]) // 2 :].mean(axis=1)
        self.rows = dict(
            zip(
                ROWS,
                [
                    codes.mean(axis=(0, 2, 3)),
                    np.ptp(self.chirp, axis=1),
                    offset.std(axis=(0, 2, 3)),
                    self.change.std(axis=(0, 2, 3)),
                    np.sqrt(upper),
                    100.0 * (raw & 1).mean(axis=(0, 2, 3)),
                ],
                strict=True,
            )
        )


def simulated(radar: rc.Radar, num_frames: int) -> NDArray[np.uint16]:
    """Codes of an empty scene."""
    simulator = rc.Simulator(rc.Scene(), radar, resolution=8, seed=1)
    interval = radar.waveform.frame_interval
    return np.stack([simulator.frame(k * interval).raw for k in range(num_frames)])


def measured_like(waveform: rc.Waveform, *, as_codes: bool = False) -> rc.Radar:
    """The preset with the measured receiver and a waveform; with the widths of codes as measured, or even ones."""
    preset = rc.bgt60tr13c(
        receiver="measured",
        start_frequency=waveform.start_frequency,
        slope=waveform.slope,
        sample_rate=waveform.sample_rate,
        num_samples=waveform.num_samples,
        num_chirps=waveform.num_chirps,
        chirp_interval=waveform.chirp_interval,
        frame_interval=waveform.frame_interval,
        adc_delay=waveform.adc_delay,
    )
    errors = replace(preset.receiver.adc_errors, odd_width=0.26 if as_codes else None)
    receiver = replace(preset.receiver, adc_errors=errors)
    return rc.Radar(
        preset.waveform, tx=preset.tx, rx=preset.rx, pattern=preset.pattern, tx_power_dbm=4.0, receiver=receiver
    )


def residual_phase(ranges: NDArray[np.float64], num_frames: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Phase noise of echoes at ranges [degrees rms]: simulated, and by the formula."""
    pairs = ((100e3, -80.0),)
    quiet = rc.bgt60tr13c(**WIDE, num_chirps=16, receiver=rc.Receiver())
    noisy = rc.bgt60tr13c(**WIDE, num_chirps=16, receiver=rc.Receiver(phase_noise=pairs))
    found = []
    for distance in ranges:
        scene = rc.Scene([rc.PointTarget([distance, 0.0, 0.0])])
        ideal = rc.Simulator(scene, quiet, resolution=8).frame().cube
        simulator = rc.Simulator(scene, noisy, resolution=8)
        turns = [simulator.frame(0.1 * k).cube / ideal for k in range(num_frames)]
        found.append(np.rad2deg(np.std(np.angle(turns))))
    offset = np.linspace(0.0, 0.5 * quiet.waveform.sample_rate, 20_001)[1:]
    delay = 2.0 * ranges / SPEED_OF_LIGHT
    power = phase_density(pairs, offset) * 4.0 * np.sin(np.pi * np.outer(delay, offset)) ** 2
    return np.array(found), np.rad2deg(np.sqrt(power.sum(axis=1) * offset[0]))


def milliseconds(repeats: int) -> float:
    """Median time of the whole chain for 3 x 64 x 128 samples, behind the core."""
    radar = rc.bgt60tr13c(**WIDE, receiver="measured")
    ideal = np.zeros((6, 64, 128), np.complex64)  # echoes, and their part with phase noise
    times = []
    for k in range(repeats):
        began = time.perf_counter()
        receive(ideal, radar, 0.1 * k, seed=1)
        times.append(time.perf_counter() - began)
    return 1e3 * float(np.median(times))


def frame_milliseconds(repeats: int) -> dict[str, float]:
    """Median time of a frame of a ball and a box that move, one thread, by receiver."""
    bodies = [
        rc.Body(rc.shapes.sphere(0.3), motion=rc.Linear(rc.Pose([1.0, 0.0, 0.0]), velocity=[0.3, 0.0, 0.0])),
        rc.Body(rc.shapes.box([0.3, 0.3, 0.3]), motion=rc.Linear(rc.Pose([1.1, 0.7, 0.0]), velocity=[-0.3, 0.0, 0.0])),
    ]
    thermal = rc.Receiver(output="real", noise_figure_db=12.0)
    receivers = {
        "thermal noise": thermal,
        "filters": replace(thermal, high_pass=80e3, low_pass=515e3),
        "phase noise": replace(thermal, phase_noise=[(100e3, -80.0)]),
        "all, as measured": "measured",
    }
    radars = {name: rc.bgt60tr13c(**WIDE, receiver=receiver) for name, receiver in receivers.items()}
    scene = rc.Scene(bodies)
    simulators = {name: rc.Simulator(scene, radar, threads=1, max_bounces=1) for name, radar in radars.items()}
    times: dict[str, list[float]] = {name: [] for name in simulators}
    for k in range(repeats):
        for name, simulator in simulators.items():
            began = time.perf_counter()
            simulator.frame(0.03 * k)
            times[name].append(time.perf_counter() - began)
    return {name: 1e3 * float(np.median(some)) for name, some in times.items()}


def print_table(columns: dict[str, Statistics]) -> None:
    print(f"{'RX1 / RX2 / RX3':<37}" + "".join(f"{name:>26}" for name in columns))
    for row, form in ROWS.items():
        cells = [" / ".join(form.format(value) for value in column.rows[row]) for column in columns.values()]
        print(f"{row:<37}" + "".join(f"{cell:>26}" for cell in cells))


def worst(model: NDArray[np.float64], recorded: NDArray[np.float64], last: tuple[int | None, ...] = (None,) * 3) -> str:
    """The largest difference of powers (rx, bin) in decibels, by receiver."""
    decibels = 10.0 * np.log10(model / recorded)
    return " / ".join(f"{max(row[:end], key=abs):+.1f}" for row, end in zip(decibels, last, strict=True))


def draw(columns: dict[str, Statistics], waveform: rc.Waveform, num_frames: int) -> None:
    """Leakage over a chirp, noise over range, distribution of noise, phase noise over range."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10.0, 7.0), constrained_layout=True)
    styles = dict(zip(columns, ("-", "--", ":"), strict=False))
    colors = ("tab:blue", "tab:orange", "tab:green")
    shown = list(columns)[:2]
    bins = waveform.range_axis(waveform.num_samples)[: len(columns[shown[0]].density[0])]
    for name in shown:
        for rx, color in enumerate(colors):
            label = f"RX{rx + 1}, {name}"
            style = {"color": color, "linestyle": styles[name], "label": label, "linewidth": 1.3}
            axes[0, 0].plot(waveform.sample_times * 1e6, columns[name].chirp[rx], **style)
            axes[0, 1].plot(bins[1:], 10.0 * np.log10(columns[name].density[rx, 1:]), **style)
            edges = np.arange(-4.0, 4.01, 0.2)
            widths = "recording" if name == "recording" else "model, codes as measured"
            counts, _ = np.histogram(columns[widths].change[:, rx], edges, density=True)
            axes[1, 0].plot(0.5 * (edges[1:] + edges[:-1]), counts, **style)
    axes[0, 0].set(xlabel="time in the ramp [us]", ylabel="mean code", title="Leakage and offset")
    axes[0, 1].set(xlabel="range [m]", ylabel="power per bin [dB over 1 LSB²]", title="Noise from chirp to chirp")
    axes[1, 0].set(
        xlabel="change from chirp to chirp / √2 [LSB]",
        ylabel="density",
        title="Noise within a chirp, codes as measured",
    )
    axes[0, 0].legend(fontsize=7, ncols=2)
    ranges = np.geomspace(0.1, 1.5, 7)
    found, formula = residual_phase(ranges, num_frames)
    axes[1, 1].loglog(ranges, formula, "-", color="0.4", label="formula")
    axes[1, 1].loglog(ranges, found, "o", color="tab:red", label="simulated echoes")
    axes[1, 1].set(xlabel="range [m]", ylabel="phase noise [degrees rms]", title="Phase noise with range correlation")
    axes[1, 1].legend()
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.savefig(PICTURE, dpi=110)
    print(f"wrote {PICTURE}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", nargs="?", help="of a BGT60TR13C at 23 dB and 80 kHz, three receivers")
    parser.add_argument("--picture", action="store_true", help="draw docs/receiver.png")
    parser.add_argument("--write", action="store_true", help="write the section of docs/receiver.md")
    parser.add_argument("--tiny", action="store_true", help="a few frames")
    options = parser.parse_args()
    columns, waveform, num_frames = (
        {},
        rc.bgt60tr13c(**WIDE, num_samples=64, num_chirps=8).waveform,
        4 if options.tiny else 256,
    )
    if options.recording is None:
        print("no recording given: numbers of the model alone; give the folder of one to compare")
    else:
        recording = rc.Recording.load(options.recording)
        waveform = recording.radar.waveform
        columns["recording"] = Statistics(recording.raw)
    columns["model"] = Statistics(simulated(measured_like(waveform), num_frames))
    columns["model, codes as measured"] = Statistics(simulated(measured_like(waveform, as_codes=True), num_frames))
    with printed_into(DOCS / "receiver.md", "receiver", write=options.write):
        print_table(columns)
        for row in list(ROWS)[1:5] if "recording" in columns else ():
            decibels = 20.0 * np.log10(columns["model"].rows[row] / columns["recording"].rows[row])
            print(f"{row.partition(' [')[0]}, model [dB]: " + " / ".join(f"{value:+.1f}" for value in decibels))
        if "recording" in columns:
            model, recorded = columns["model"], columns["recording"]
            print(f"noise, worst range bin, model [dB]: {worst(model.density[:, 1:], recorded.density[:, 1:])}")
            # From bin 3 on RX3 has less leakage than echoes of the room.
            leaks = worst(model.leakage, recorded.leakage, last=(9, 9, 2))
            print(f"leakage, worst of range bins 1 to 9 (RX3: 2), model [dB]: {leaks}")
        found, formula = residual_phase(np.array([0.3, 1.2]), 1 if options.tiny else 20)
        for distance, got, expected in zip((0.3, 1.2), found, formula, strict=True):
            print(f"phase noise at {distance} m [degrees]: {got:.4f}, formula {expected:.4f}")
    print(f"whole chain, 3 x 64 x 128 samples: {milliseconds(5 if options.tiny else 300):.2f} ms")
    frames = frame_milliseconds(1 if options.tiny else 30)
    print("frame of two bodies, one thread: " + ", ".join(f"{name} {ms:.1f} ms" for name, ms in frames.items()))
    if options.picture:
        draw(columns, waveform, 1 if options.tiny else 20)


if __name__ == "__main__":
    main()
