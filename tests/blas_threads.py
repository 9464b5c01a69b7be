"""Work of the package during which threads of BLAS ran, one name a line: python tests/blas_threads.py

Prints "none" where BLAS has no threads.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.linalg  # noqa: F401  # loads SciPy's own OpenBLAS, whose threads are counted, too

import radarcore as rc

TASKS = Path("/proc/self/task")
THREADS = [task / "schedstat" for task in TASKS.iterdir() if task.name != str(os.getpid())]
"""The package has none of its own before the first frame."""


def time_of_threads() -> int:
    """Time that the threads of BLAS have run [ns]."""
    return sum(int(thread.read_text().split()[0]) for thread in THREADS)


def wakes(work: Callable[[], object]) -> bool:
    """True if threads run during work that has been done once before."""
    work()
    while (before := time_of_threads()) != (time.sleep(0.05), time_of_threads())[1]:
        pass  # threads that look for more work
    work()
    time.sleep(0.01)
    return time_of_threads() != before


def works() -> dict[str, Callable[[], object]]:
    """Functions on frames, by name."""
    points = [rc.PointTarget([2.0 + k, 0.3 * k, 0.0], velocity=[-0.5, 0.1 * k, 0.0]) for k in range(4)]
    fast = rc.Waveform(
        start_frequency=77e9, slope=30e12, sample_rate=10e6, num_samples=256, num_chirps=128, chirp_interval=60e-6
    )
    half = 0.5 * fast.wavelength
    receiver = rc.Receiver(noise_figure_db=12.0, phase_noise=((1e5, -85.0), (1e6, -95.0)))
    array = {"tx": [[0.0, 4 * half * k, half * k] for k in range(3)], "rx": [[0.0, half * k, 0.0] for k in range(4)]}
    small = rc.Simulator(
        rc.Scene([*rc.models.Human().bodies(), *points]), rc.bgt60tr13c(num_chirps=128, max_velocity=5.0)
    )
    large = rc.Simulator(rc.Scene(points), rc.Radar(fast, **array, receiver=receiver))
    recording = small.record(0.0, 0.2)
    rng = np.random.default_rng(1)
    channels = rng.normal(size=(2000, 12)) + 1j
    times = np.arange(0.0, 60.0, 0.01)
    walk = np.cos(times**1.5)
    found: dict[str, Callable[[], object]] = {
        "record": lambda: small.record(0.0, 0.2),
        "track": lambda: rc.track(recording, smooth=True),
        "spectrogram": lambda: rc.spectrogram(recording, subtract_mean=True),
        "directions": lambda: rc.directions(channels, large.radar, snr_db=np.full(2000, 20.0)),
        "Pose.apply": lambda: rc.Pose().apply(np.ones((100_000, 3))),
        "clock_offset": lambda: rc.processing.clock_offset(times, walk, times - 0.4, walk, max_offset=1.0),
    }
    for name, sim in (("small", small), ("large", large)):
        frame = sim.frame()
        found |= {
            f"frame, {name}": lambda sim=sim: sim.frame(0.01),
            f"detect, {name}": lambda frame=frame: rc.detect(frame),
            f"detect in double precision, {name}": lambda frame=frame: rc.detect(
                frame.cube.astype(np.complex128), frame.radar
            ),
            f"strongest_peak, {name}": lambda frame=frame: rc.strongest_peak(frame),
            f"doppler_velocity, {name}": lambda frame=frame: rc.doppler_velocity(frame),
        }
        for method in ("doppler", "space-time"):
            found[f"remove_static, {method}, {name}"] = lambda frame=frame, method=method: rc.remove_static(
                frame, [0.8, 0.0, 0.0], method=method
            )
        for method in ("bartlett", "capon", "music"):
            found[f"azimuth_elevation, {method}, {name}"] = lambda frame=frame, method=method: (
                rc.processing.azimuth_elevation(frame, at_range=2.0, method=method)
            )
    return found


if __name__ == "__main__":
    matrix = np.ones((300, 300))
    if not wakes(lambda: matrix @ matrix):
        sys.stdout.write("none\n")
    else:
        for name, work in works().items():
            if wakes(work):
                sys.stdout.write(f"{name}\n")
