"""Frames, recordings and codes that do not fit together: the expected and the given value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from radarcore.recording.frame import Frame, Truth, to_codes, to_samples
from radarcore.recording.recording import Recording
from radarcore.sensor.strata.slices import pack_msb, unpack_msb
from recordings import CODES, CUBE, RADAR, SENSOR, WAVEFORM, frame, recording, sensor_frame


def one(time: Any = (0.0,), **others: Any) -> Recording:
    """A recording of a frame."""
    return Recording(CUBE[None], time, RADAR, **others)


def coded(raw: Any) -> Frame:
    return Frame(to_samples(CODES[0]), 0.0, SENSOR, raw=raw)


def of(*frames: Any) -> Recording:
    return Recording.from_frames(list(frames))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: Frame(CUBE[:1], 0.0, RADAR), ValueError, r"\(2, 4, 16\) \[channel, chirp, sample\].*got \(1, 4, 16\)"),
        (lambda: Frame(CUBE.real.astype(int), 0.0, RADAR), TypeError, "cube: expected float32, .*got int64"),
        (lambda: Frame(CUBE, 0.0, WAVEFORM), TypeError, "radar: expected Radar, got Waveform"),
        (lambda: Frame(CUBE, 0.0, RADAR, recording().truth), ValueError, r"arrays of shape \(2,\), got \(3, 2\)"),
        (lambda: coded(CODES[0].astype(np.int32)), TypeError, "raw: expected uint16, got int32"),
        (lambda: coded(CODES), ValueError, r"raw: expected shape \(3, 4, 16\) as the cube, got \(4, 3, 4, 16\)"),
        (lambda: Recording(CUBE, [0.0], RADAR), ValueError, r"\(n, 2, 4, 16\) \[frame, .*got \(2, 4, 16\)"),
        (lambda: one([0.0, 1.0]), ValueError, r"time: expected shape \(1,\)"),
        (lambda: one(lost=[0, 0]), ValueError, r"lost: expected shape \(1,\)"),
        (lambda: one(lost=[-1]), ValueError, "lost: expected .* from 0 on, got -1"),
        (lambda: one(lost=[2**31]), ValueError, "lost: expected numbers"),
        (lambda: one(lost=[0.5]), TypeError, "lost: expected integers"),
        (lambda: one(source=None), TypeError, "source: expected a dict"),
        (lambda: of(frame(1), frame(0)), ValueError, "time: expected increasing times"),
        (lambda: of(), ValueError, "frames: expected at least one frame"),
        (lambda: of(frame(0), CUBE), TypeError, r"frames\[1\]: expected Frame"),
        (lambda: of(frame(0), frame(1, names=None)), ValueError, r"frames\[1\]: expected complex64"),
        (lambda: of(sensor_frame(0, lost_before=-1)), ValueError, "lost_before.*at least 0"),
        (lambda: of(sensor_frame(0, lost_before=2**31)), ValueError, "lost_before.*at most"),
        (lambda: recording().replay(speed=0.0), ValueError, "speed: expected"),
        (lambda: Truth(("a",), *np.zeros((4, 2))), ValueError, r"range: expected shape \(1,\) or \(frame, 1\).*\(2,\)"),
        (lambda: Truth("arm", *np.zeros((4, 3))), TypeError, "names: expected one name per body"),
        (lambda: unpack_msb(b"1234"), ValueError, "data: expected a multiple of 3 bytes, got 4"),
        (lambda: pack_msb([1, 2, 3]), ValueError, "codes: expected an even number of them, got 3"),
        (lambda: pack_msb([1, 4096]), ValueError, "codes: expected 0 to 4095, got 4096"),
        (lambda: pack_msb([1.0]), TypeError, "codes: expected integers, got float64"),
        (lambda: to_samples([70000]), ValueError, "codes: expected 0 to 4095, got 70000"),
        (lambda: to_codes([0.0, float("nan")]), ValueError, "samples: expected numbers, got NaN"),
        (lambda: to_codes([1j]), TypeError, "samples: expected real numbers, got complex128"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()
