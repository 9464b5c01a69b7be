"""The core's simulator: ramps that it is made for, ideal frames with their counts, and samples at the receivers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.receive.filters import responses
from radarcore.simulate.settings import Settings, core_settings

NUM_TIMES = 17
"""Times of a frame at which motion is placed at first; a motion too fast for them is placed again."""


def new_engine(
    source: _core.Scene | _core.DepthScene,
    materials: list[_core.Material],
    radar: Radar,
    settings: Settings,
    *,
    center: list[float],
    own_threads: int | None = None,
    **debug: Any,
) -> _core.Simulator:
    """Simulator of the core for a radar with one sub-sequence; `own_threads`: threads that no other has."""
    return _core.Simulator(
        source,
        materials,
        antennas=_antennas(radar),
        waveform=ramps_of(radar)._core,
        center=center,
        settings=core_settings(settings, **debug),
        threads=own_threads or settings.threads,
        own_threads=own_threads is not None,
    )


def ideal_frame(
    engine: _core.Simulator,
    motion: _core.Placement,
    place: Callable[[int], _core.Placement],
    rates: _core.Placement | None = None,
) -> _core.IdealFrame:
    """Frame of an ideal receiver.

    `motion`: placed at `NUM_TIMES` times; `place` places it at more times if it is too fast for these. `rates`: its
    time derivatives, for a frame of a single sample.
    """
    ideal, num_times = engine.frame(motion, rates), NUM_TIMES
    while ideal is None:
        num_times = 2 * num_times - 1
        ideal = engine.frame(place(num_times), None)
    return ideal


def counts_of(ideals: Sequence[_core.IdealFrame]) -> dict[str, Any]:
    """Counts of a frame, for `Frame.stats`: sums over its sub-sequences, the worst residual, and the plans of all."""
    total: dict[str, Any] = {}
    residual, plans = 0.0, []
    for ideal in ideals:
        for name, number in ideal.counts.items():
            before = total.get(name, 0)
            total[name] = max(before, number) if name.endswith("_nodes") else before + number
        if ideal.rcs_floor is not None:
            total["rcs_floor"] = max(total.get("rcs_floor", 0.0), ideal.rcs_floor)
        residual = max(residual, hypot(*ideal.series_errors))
        plans.append(ideal.plan)
    return {**total, "series_residual": residual, "plan": "\n".join(plans)}


@lru_cache(maxsize=8)
def _antennas(radar: Radar) -> _core.Antennas:
    """The antennas about the centre of the array.

    With phase noise the transmitters come several times, with the rows of `responses` each.
    """
    gains = None if radar.receiver is None else responses(radar.receiver, radar.waveform)
    times = 1 if gains is None else len(gains[0])
    return _core.Antennas(
        tx=np.tile(radar.tx - radar.array_center, (times, 1)),
        rx=radar.rx - radar.array_center,
        tx_patterns=[pattern._core for pattern in radar.tx_patterns] * times,
        rx_patterns=[pattern._core for pattern in radar.rx_patterns],
        power=radar.tx_power,
        frequency=radar.waveform.center_frequency,
        polarization=radar.polarization_vector,
        responses=None if gains is None else np.repeat(gains[0], len(radar.tx), axis=0),
        longest_path=0.0 if gains is None else gains[1],
    )


def ramps_of(radar: Radar) -> Waveform:
    """Waveform of the ramps of all transmitters of a radar with one sub-sequence; the core sees its times alone."""
    waveform = radar.waveform
    if not _takes_turns(radar):
        return waveform
    starts = np.sort(_starts(radar), axis=None)
    return waveform.replace(num_chirps=len(starts), chirp_times=starts)


def at_receivers(cube: NDArray[Any], radar: Radar) -> NDArray[Any]:
    """Samples that arrive at the receivers, (channel, chirp, sample), in the precision of the cube.

    `cube`: (TX-RX pair, ramp, sample), every transmitter received by itself in all of the `ramps_of` a radar. With
    phase noise there are several such blocks, and one result block for each, in order.
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
    """True if some transmitters send their ramps after others."""
    return radar.schedule is not None and not radar.schedule.is_sum and len(radar.tx) > 1


def _starts(radar: Radar) -> NDArray[np.float64]:
    """Starts of the ramps of transmitters in turn [s], (tx, chirp)."""
    return np.add.outer(radar.channel_offsets[:: len(radar.rx)], radar.waveform.chirp_times)
