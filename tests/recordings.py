"""Distinguishable frames and recordings, in watts and of a sensor."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.pattern import GaussianPattern
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth, to_samples
from radarcore.recording.recording import Recording

WAVEFORM = Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e6, num_samples=16, num_chirps=4)
RADAR = Radar(
    WAVEFORM,
    rx=[[0.0, 0.0, 0.0], [0.0, 0.1 + 0.2, 0.0]],  # 0.30000000000000004 must come back as it is
    pattern=GaussianPattern(5.0, 60.0, 30.0),
    receiver=Receiver(noise_figure_db=12.0),
)
FILES = ["cube.npy", "time.npy", "truth_range.npy", "truth_velocity.npy", "truth_azimuth.npy", "truth_elevation.npy"]
CUBE = np.zeros((2, 4, 16), np.complex64)

SENSOR = bgt60tr13c(num_samples=16, num_chirps=4)
CODES = np.random.default_rng(3).integers(0, 4096, (4, 3, 4, 16), dtype=np.uint16)
FRAME_TIMES = [1.7e9, 1.7e9 + 0.031, 1.7e9 + 0.0999, 1.7e9 + 7.0]  # by the clock of a host: irregular


def frame(index: int, *, dtype: str = "complex64", names: tuple[str, ...] | None = ("arm", "wall")) -> Frame:
    """A frame that differs from all others."""
    rng = np.random.default_rng(index)
    cube = rng.standard_normal((2, 4, 16)) + (1j * rng.standard_normal((2, 4, 16)) if "complex" in dtype else 0.0)
    truth = None if names is None else Truth(names, *rng.standard_normal((4, len(names))))
    return Frame(cube.astype(dtype), 0.025 * index, RADAR, truth, {"rays_cast": index})


def recording(num_frames: int = 3, **options: Any) -> Recording:
    return Recording.from_frames((frame(i, **options) for i in range(num_frames)), source={"kind": "test"})


def assert_same(given: Recording, expected: Recording, num_frames: int | None = None) -> None:
    """Compare a recording with the first frames of another, bit for bit."""
    n = len(expected) if num_frames is None else num_frames
    assert len(given) == n
    assert given.cube.dtype == expected.cube.dtype
    np.testing.assert_array_equal(given.cube, expected.cube[:n])
    np.testing.assert_array_equal(given.time, expected.time[:n])
    assert given.radar == expected.radar
    assert given.source == expected.source
    assert (given.truth is None) == (expected.truth is None)
    if given.truth is not None and expected.truth is not None:
        assert given.truth.names == expected.truth.names
        for name in ("range", "velocity", "azimuth", "elevation"):
            np.testing.assert_array_equal(getattr(given.truth, name), getattr(expected.truth, name)[:n])


def real_recording() -> Path:
    """A recording of a real sensor, before which somebody sits; skips the test where there is none."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    path = Path(os.environ.get("RADARCORE_RECORDINGS", beside)) / "bgt60tr13c-8chirp"
    if not path.is_dir():
        pytest.skip(f"no recording of a real sensor at {path} (see CONTRIBUTING.md: RADARCORE_RECORDINGS)")
    return path


def npy(array: Any) -> bytes:
    """The bytes of a .npy file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def refused(message: str, path: Path, error: type[Exception] = ValueError, **description: Any) -> None:
    """Check the error of loading something."""
    with pytest.raises(error, match=message):
        Recording.load(path, **description)


def cut(path: Path, num_bytes: int) -> None:
    """Leave the first bytes of a file only."""
    with path.open("r+b") as file:
        file.truncate(num_bytes)


def sensor_frame(index: int, **stats: int) -> Frame:
    """A frame of a real sensor, with the codes of its ADC."""
    return Frame(to_samples(CODES[index]), FRAME_TIMES[index], SENSOR, stats=stats, raw=CODES[index])
