"""Times of a run: starts of its frames, ramps of all transmitters, and what the receivers get of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.receive.adc import Use, use_of_all
from radarcore.receive.chain import receive
from radarcore.receive.noise import GOLDEN


def ramps_of(radar: Radar) -> Waveform:
    """Waveform of the ramps of all transmitters of a radar with one sub-sequence; the core sees its times alone."""
    waveform = radar.waveform
    if not _takes_turns(radar):
        return waveform
    starts = np.sort(_starts(radar), axis=None)
    return waveform.replace(num_chirps=len(starts), chirp_times=starts)


def received(
    samples: Sequence[NDArray[Any]], sequences: Sequence[Radar], start: float, *, seed: int
) -> tuple[NDArray[Any], Use | None]:
    """Cube of a frame as the receivers deliver it, (channel, chirp, sample), and its use of the ADC's range.

    Parameters
    ----------
    samples : sequence of arrays
        `at_receivers`, of every sub-sequence.
    sequences : sequence of Radar
        Of the same sub-sequences.
    start : float
        Start of the frame [s].
    seed : int
    """
    parts: list[NDArray[Any]] = []
    uses: list[Use] = []
    for number, (arriving, part) in enumerate(zip(samples, sequences, strict=True)):
        parts.append(receive(arriving, part, start, seed=(seed + number * GOLDEN) % 2**64, uses=uses))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1), use_of_all(uses) if uses else None


def at_receivers(cube: NDArray[Any], radar: Radar) -> NDArray[Any]:
    """Samples that arrive at the receivers, (channel, chirp, sample), in the precision of the cube.

    `cube`: (TX-RX pair, ramp, sample), every transmitter received by itself in all of the `ramps_of` a radar. With
    phase noise there are several such blocks, and as many of the result, one after the other.
    """
    num_tx, num_rx, waveform = len(radar.tx), len(radar.rx), radar.waveform
    pairs = cube.reshape(-1, num_tx, num_rx, cube.shape[1], waveform.num_samples)
    if _takes_turns(radar):
        starts = _starts(radar)
        ramps = np.searchsorted(np.sort(starts, axis=None), starts)  # (tx, chirp)
        turns = np.stack([np.take(pairs[:, tx], ramps[tx], axis=2) for tx in range(num_tx)], axis=1)
        return turns.reshape(-1, *turns.shape[3:])
    if radar.schedule is None or not radar.schedule.is_sum:
        return cube
    weights = radar.schedule.tx_weights(radar.tx, waveform.wavelength, waveform.num_chirps).conj().astype(cube.dtype)
    total: NDArray[Any] = pairs[:, 0] * weights[:, 0, None]
    for tx in range(1, num_tx):
        total += pairs[:, tx] * weights[:, tx, None]
    return total.reshape(-1, *total.shape[2:])


def _takes_turns(radar: Radar) -> bool:
    """True if ramps of some transmitters come after those of others."""
    return radar.schedule is not None and not radar.schedule.is_sum and len(radar.tx) > 1


def _starts(radar: Radar) -> NDArray[np.float64]:
    """Starts of the ramps of transmitters in turn [s], (tx, chirp)."""
    return np.add.outer(radar.channel_offsets[:: len(radar.rx)], radar.waveform.chirp_times)


_MAX_FRAMES = 10_000_000
"""Largest number of frames of a recording: a day at 100 Hz."""


def frame_times(start: float, stop: float, rate: float) -> list[float]:
    """Starts of the frames before `stop` [s]."""
    first, last = check.number("start", start, "s"), check.number("stop", stop, "s")
    per_second = check.positive("rate", rate, "Hz")
    if last <= first:
        raise ValueError(f"stop: expected a time after start {first:g} s, got {last:g} s")
    # A stop that is a whole number of frames away, but for rounding, is not the start of one more.
    num_frames = max(1.0, float(np.ceil((last - first) * per_second - 1e-6)))
    if num_frames > _MAX_FRAMES:
        raise ValueError(f"rate, stop: expected at most {_MAX_FRAMES} frames, got {num_frames:.3g}")
    return [first + i / per_second for i in range(int(num_frames))]
