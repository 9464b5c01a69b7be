"""Slices: samples that are read at once."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from radarcore.radar.bgt60 import MAX_SAMPLES
from radarcore.sensor.bgt60.limits import LimitError
from radarcore.sensor.bgt60.registers import SFCTL, image_of
from radarcore.sensor.bgt60.settings import Settings, registers_of

MAX_SLICE_SIZE = 8192
"""Samples of a slice that leave the host half the memory's time to fetch it."""


def slice_size_of(registers: Mapping[int, int]) -> int:
    """Samples after which the chip asks to be read (SFCTL.FIFO_CREF)."""
    return 2 * ((image_of(registers)[SFCTL] & 0x1FFF) + 1)


def choose_slice_size(settings: Settings) -> int:
    """Samples to read at once, so that frames and slices stay in step.

    One slice is one frame. Larger frames than `MAX_SLICE_SIZE` are cut into as few equal slices as possible. Above
    200 frames per second a slice holds as many frames as bring that down to 200 slices per second, if they fit. As
    slices hold pairs of samples, frames with an odd number of them are read by the two.

    Raises
    ------
    ValueError
        For settings beyond the chip's limits, and for odd frames of more than 4096 samples.
    """
    registers_of(settings, 2)
    frame = settings.frame_size
    pair = 2 if frame % 2 else 1
    fitting = MAX_SLICE_SIZE // (pair * frame) * pair
    if fitting:
        wanted = pair * math.ceil(1.0 / (200.0 * settings.frame_time * pair))
        return frame * min(wanted, fitting)
    if pair == 2:
        samples = (n for n in (settings.num_samples - 1, settings.num_samples + 1) if 1 <= n <= MAX_SAMPLES)
        chirps = (n for n in (settings.num_chirps - 1, settings.num_chirps + 1) if n >= 1)
        raise LimitError(
            "num_samples",
            f"expected an even number of samples in a frame of more than {MAX_SLICE_SIZE // 2}, got "
            f"{len(settings.rx_indices)} receivers x {settings.num_chirps} chirps x {settings.num_samples} samples; "
            f"the nearest are {' or '.join(map(str, samples))} samples, or {' or '.join(map(str, chirps))} chirps",
        )
    return next(size for size in range(MAX_SLICE_SIZE, 0, -2) if frame % size == 0)


def sdk_slice_size(settings: Settings) -> int:
    """Samples that the vendor's host reads at once (Strata, slice size); `settings` as they are `achieved`.

    Raises
    ------
    ValueError
        For settings beyond the chip's limits, and for an odd result.
    """
    registers_of(settings, 2)
    frame = settings.frame_size
    size = frame // -(-frame // MAX_SLICE_SIZE)
    rate = frame / size / float(np.float32(settings.frame_time))
    if rate > 20.0:
        size = min(size * math.floor(rate / 20.0), MAX_SLICE_SIZE)
    if size % 2:
        raise ValueError(f"settings: expected frames that are cut into even slices, got slices of {size} samples")
    return size
