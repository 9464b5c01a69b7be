"""Ramps of all transmitters of a frame, and what the receivers get of them: schedules before and after the core."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.receive.adc import Use, use_of_all
from radarcore.receive.chain import receive

_SEED_STEP = 0x9E3779B97F4A7C15
"""Step of the seed of noise from one sub-sequence to the next: 2**64 over the golden ratio."""


def ramps_of(radar: Radar) -> Waveform:
    """Waveform of the ramps of all transmitters of a radar with one sub-sequence; the core sees its times alone."""
    waveform = radar.waveform
    if not _takes_turns(radar):
        return waveform
    starts = np.sort(_starts(radar), axis=None)
    return waveform.replace(num_chirps=len(starts), chirp_times=starts)


def received(
    cubes: Sequence[NDArray[Any]],
    radar: Radar,
    start: float,
    *,
    seed: int,
    disturb: Callable[[int, NDArray[Any]], None] | None = None,
) -> tuple[NDArray[Any], Use | None]:
    """Cube of a frame as the receivers deliver it, (channel, chirp, sample), and its use of the ADC's range.

    Parameters
    ----------
    cubes : sequence of arrays
        Of every sub-sequence, as the core gives them for its `ramps_of`.
    radar : Radar
    start : float
        Start of the frame [s].
    seed : int
    disturb : function, optional
        Of the number of a sub-sequence and the samples at its receivers, to which it adds what others send.
    """
    parts: list[NDArray[Any]] = []
    uses: list[Use] = []
    for number, (cube, part) in enumerate(zip(cubes, radar.sequences(), strict=True)):
        samples = _at_receivers(cube, part)
        if disturb is not None:
            disturb(number, samples)
        parts.append(receive(samples, part, start, seed=(seed + number * _SEED_STEP) % 2**64, uses=uses))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1), use_of_all(uses)


def _at_receivers(cube: NDArray[Any], radar: Radar) -> NDArray[Any]:
    """Samples that arrive at the receivers, (channel, chirp, sample), in the precision of the cube.

    `cube`: (TX-RX pair, ramp, sample), every transmitter received by itself in all of the `ramps_of` a radar. With
    phase noise there are several such blocks, and as many of the result, one after the other.
    """
    num_tx, num_rx, waveform = len(radar.tx), len(radar.rx), radar.waveform
    pairs = cube.reshape(-1, num_tx, num_rx, cube.shape[1], waveform.num_samples)
    if _takes_turns(radar):
        starts = _starts(radar)
        ramps = np.searchsorted(np.sort(starts, axis=None), starts)  # (tx, chirp)
        shape = (len(pairs), num_tx, num_rx, waveform.num_chirps, waveform.num_samples)
        turns = np.empty(shape, cube.dtype)  # in the order that the receiver takes
        for tx in range(num_tx):
            turns[:, tx] = pairs[:, tx][:, :, ramps[tx]]
        return turns.reshape(-1, *shape[3:])
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
