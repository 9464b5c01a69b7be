"""The core's simulator: made for a radar, asked for ideal frames, and its counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import hypot
from typing import Any

import numpy as np

from radarcore import _core
from radarcore.radar.radar import Radar
from radarcore.receive.filters import responses
from radarcore.simulate.schedule import ramps_of
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
