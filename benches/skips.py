"""Cost of frames without skips of empty tiles, copied tiles and directions outside of the beam.

python benches/skips.py            print the table
python benches/skips.py --write    also write its section of benches/results/performance.md
python benches/skips.py --tiny     one frame each
"""

from __future__ import annotations

import argparse

import numpy as np

import radarcore as rc
from frame import RATE, boxes, measure, scene
from page import PERFORMANCE, machine, milliseconds, table, write_section

SKIPS: dict[str, dict[str, bool]] = {
    "as it is": {},
    "no tile is copied": {"reuse_tiles": False},
    "no tile is skipped as empty": {"skip_empty": False},
    "neither": {"reuse_tiles": False, "skip_empty": False},
}
"""Options of the core by what is not skipped."""

NO_BEAM = "rays outside of the beam as well"

TEXT = """\
## Skips

The frames of "A frame, stage by stage" without what they skip, on {machine}, two threads. Written by
`python benches/skips.py --write`: medians over {frames} frames [ms], and the largest difference of samples from the
first row, relative to the largest sample.

{table}
"""


def row(name: str, simulators: dict[str, rc.Simulator], expected: list[np.ndarray], num_frames: int) -> list[str]:
    """Run times and differences of a row."""
    cells = [name]
    for number, simulator in enumerate(simulators.values()):
        column = measure(name, simulator, num_frames)
        cube = simulator.frame((num_frames + 1) / RATE).cube
        if len(expected) == number:
            expected.append(cube)
        difference = np.abs(cube - expected[number]).max() / np.abs(expected[number]).max()
        cells += [milliseconds(float(np.median(column.stages["all"]))), f"{difference:.0e}" if difference else "0"]
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    parser.add_argument("--tiny", action="store_true", help="one frame each")
    options = parser.parse_args()
    num_frames = 1 if options.tiny else 40
    bodies, sensors, _ = scene()
    radar = rc.bgt60tr13c(
        start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )

    def simulators(skips: dict[str, bool], **settings: float) -> dict[str, rc.Simulator]:
        made = {
            name: rc.Simulator(bodies, radar, radar_motion=motion, threads=2, **settings)
            for name, motion in sensors.items()
        }
        made["ten boxes"] = rc.Simulator(boxes(), radar, threads=2, **settings)
        for simulator in made.values():
            vars(simulator)["_engines"] = simulator._new_engines(**skips)
        return made

    expected: list[np.ndarray] = []
    rows = [row(name, simulators(skips), expected, num_frames) for name, skips in SKIPS.items()]
    rows.append(row(NO_BEAM, simulators({}, gain_floor_db=np.inf), expected, num_frames))
    names = [part for name in [*sensors, "ten boxes"] for part in (name, "difference")]
    text = table(["not skipped", *names], rows)
    print(text)
    if options.write:
        write_section(PERFORMANCE, "skips", TEXT.format(table=text, machine=machine(), frames=num_frames))


if __name__ == "__main__":
    main()
