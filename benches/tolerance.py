"""Error of the sum over paths by tolerance, beside other errors of the same frames: a table of docs/synthesis.md.

python benches/tolerance.py            print the table
python benches/tolerance.py --write    also write the section of docs/synthesis.md
python benches/tolerance.py --tiny     one frame
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from frame import scene
from page import DOCS, table, write_section

RADAR = replace(
    rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6),
    receiver=None,
)
NOISY = replace(RADAR, receiver=rc.Receiver(output="iq", noise_figure_db=10.0))

WAYS: dict[str, tuple[rc.Radar, dict[str, Any]]] = {
    "tolerance 1e-2": (RADAR, {"tolerance": 1e-2}),
    "tolerance 1e-3, the default": (RADAR, {}),
    "tolerance 1e-4": (RADAR, {"tolerance": 1e-4}),
    "12 bits at full scale": (RADAR, {"tolerance": 1e-9}),
    "rcs_floor 1e-3, not 1e-2": (RADAR, {"tolerance": 1e-9, "rcs_floor": 1e-3}),
    "thermal noise, 10 dB": (NOISY, {"tolerance": 1e-9}),
}
"""Radar and settings; the reference has no noise and a tolerance of 1e-9."""


def cubes(radar: rc.Radar, times: list[float], **settings: Any) -> list[NDArray[np.complex64]]:
    bodies, sensors, _ = scene()
    simulator = rc.Simulator(bodies, radar, radar_motion=sensors["sensor on the arm"], **settings)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*has a radial speed of")  # feet, whose errors count as well
        return [simulator.frame(time).cube for time in times]


def in_bits(cube: NDArray[np.complex64]) -> NDArray[np.complex128]:
    """Real and imaginary parts as codes of 12 bits."""
    step = max(np.abs(cube.real).max(), np.abs(cube.imag).max()) / 2048
    return step * (np.rint(cube.real / step) + 1j * np.rint(cube.imag / step))


def errors(got: NDArray[Any], expected: NDArray[Any]) -> tuple[float, float, float]:
    """Rms of samples relative to theirs; largest and rms of a range-Doppler map relative to its peak."""
    off, whole = got - expected, np.abs(rc.range_doppler(expected, RADAR.waveform)).max()
    cells = np.abs(rc.range_doppler(off.astype(np.complex64), RADAR.waveform)) / whole
    return float(np.linalg.norm(off) / np.linalg.norm(expected)), float(cells.max()), float(np.sqrt(np.mean(cells**2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of docs/synthesis.md")
    parser.add_argument("--tiny", action="store_true", help="one frame")
    options = parser.parse_args()
    times = [0.5] if options.tiny else [0.3, 0.6, 0.9, 1.2, 1.5]
    reference = cubes(RADAR, times, tolerance=1e-9)
    rows = []
    for name, (radar, settings) in WAYS.items():
        got = [in_bits(cube) for cube in reference] if "bits" in name else cubes(radar, times, **settings)
        samples, largest, rms = np.max([errors(*pair) for pair in zip(got, reference, strict=True)], axis=0)
        rows.append([name, f"{samples:.1e}", f"{20.0 * np.log10(largest):.0f}", f"{20.0 * np.log10(rms):.0f}"])
    text = table(["error", "rms of samples", "largest cell [dB]", "rms of map [dB]"], rows)
    print(text)
    if options.write:
        write_section(DOCS / "synthesis.md", "tolerance", text)


if __name__ == "__main__":
    main()
