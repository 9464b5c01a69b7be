"""From paths to samples: the times of a frame at which paths are taken, their sum, and what the receiver delivers."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.beat import core_waveform, sample_dtype
from radarcore.radar import Radar
from radarcore.receiver import Receiver
from radarcore.units import SPEED_OF_LIGHT
from radarcore.waveform import Waveform

# Delays and amplitudes are taken at as many Chebyshev times as the tolerance needs; amplitudes of surfaces that turn
# out of sight have a kink, which no number of times follows exactly.
_NODE_COUNTS = (4, 6, 8, 12, 16, 24, 32, 48, 64)
_MAX_NODES_FOR_AMPLITUDES = 16
# Delays are followed to this phase [rad] whatever the tolerance: it costs little, and other processing may need it.
_PHASE_GOAL = 1e-7
# Paths that are looked at to choose the number of times.
_NUM_PROBES = 2048
# Work and memory of one piece of the sum: path-samples (half a second), and numbers per path.
_PIECE_PATH_SAMPLES = 2**28
_PIECE_NUMBERS = 2**25

Follow = Callable[[NDArray[np.float64], slice], tuple[NDArray[np.float64], NDArray[np.complex128]]]
"""Delays [s] and amplitudes [sqrt(W)], (time, channel, path), of some paths at absolute times (n,) [s]."""


@dataclass(frozen=True)
class Course:
    """Paths that run through time.

    Parameters
    ----------
    num_paths : int
    is_static : bool
        Delays and amplitudes never change.
    follow : callable
        Takes times [s] and a slice of the paths, see `Follow`.
    """

    num_paths: int
    is_static: bool
    follow: Follow


@dataclass(frozen=True, eq=False)
class Nodes:
    """Times of a frame at which paths are taken [s], and the errors of the series through them.

    Errors of phases and of amplitudes, relative to l2(amplitudes).
    """

    times: NDArray[np.float64]
    phase: float = 0.0
    weight: float = 0.0

    @property
    def residual(self) -> float:
        """Both errors together."""
        return float(np.hypot(self.phase, self.weight))

    def warn_beyond(self, tolerance: float, stacklevel: int) -> bool:
        """Warn and say so when the series is worse than the tolerance."""
        if self.residual <= tolerance:
            return False
        reason = (
            "phases (fast motion, or large absolute times)"
            if self.phase > self.weight
            else "amplitudes (turning edges)"
        )
        warnings.warn(
            f"{reason} are followed within a frame to {self.residual:.1e} only, tolerance is {tolerance:.1e}",
            stacklevel=stacklevel + 1,
        )
        return True


def follow_nodes(course: Course, waveform: Waveform, start: float, tolerance: float) -> Nodes:
    """Times at which the paths of the frame that begins at `start` [s] have to be taken for a tolerance."""
    if course.is_static:
        return Nodes(start + waveform.delay_times(1))
    probes = slice(0, course.num_paths, max(1, course.num_paths // _NUM_PROBES))
    highest = max(waveform.start_frequency, waveform.center_frequency) + 0.5 * waveform.bandwidth
    last_phase = np.inf
    for num_nodes in _NODE_COUNTS:
        times = start + waveform.delay_times(num_nodes)
        delay, amplitude = course.follow(times, probes)
        phase, weight = _series_residuals(delay, amplitude, highest)
        # Rounding of absolute time ends the improvement before the goal where time is large.
        goal = 0.1 * tolerance
        phase_is_done = phase <= min(goal, _PHASE_GOAL) or (phase <= goal and phase > 0.5 * last_phase)
        weight_is_done = weight <= goal or num_nodes >= _MAX_NODES_FOR_AMPLITUDES
        if phase_is_done and weight_is_done:
            break
        last_phase = phase
    return Nodes(times, phase, weight)


def sum_paths(
    course: Course, times: NDArray[np.float64], radar: Radar, threads: int | None
) -> tuple[NDArray[np.complex128], float]:
    """Ideal beat signal (channel, chirp, sample) of paths taken at the Chebyshev `times` of a frame.

    Also returns half the length of the longest path that carries power [m]. Piece by piece: bounded memory, and Ctrl-C
    is heard between pieces.
    """
    waveform, num_paths = radar.waveform, course.num_paths
    cube = np.zeros((radar.num_channels, waveform.num_chirps, waveform.num_samples), dtype=np.complex128)
    longest = 0.0
    size = max(1, min(_PIECE_PATH_SAMPLES // cube.size, _PIECE_NUMBERS // (radar.num_channels * len(times))))
    for first in range(0, num_paths, size):
        delay, amplitude = course.follow(times, slice(first, min(first + size, num_paths), 1))
        longest = max(longest, float(delay.max(initial=0.0, where=amplitude != 0.0 if delay.size else True)))
        cube += _core.beat_signal(delay, amplitude, is_chebyshev=True, threads=threads, **core_waveform(waveform))
    return cube, 0.5 * SPEED_OF_LIGHT * longest


def warn_beyond_range(farthest: float, radar: Radar, stacklevel: int) -> bool:
    """Warn and say so when echoes come from beyond what the waveform tells apart."""
    if farthest <= radar.max_range:
        return False
    warnings.warn(
        f"the scene reaches to {farthest:.2f} m, beyond max_range {radar.max_range:.2f} m of the waveform: echoes from "
        "there appear at wrong ranges",
        stacklevel=stacklevel + 1,
    )
    return True


def receive(ideal: NDArray[np.complex128], radar: Radar, start: float, *, seed: int, tolerance: float) -> NDArray[Any]:
    """The cube as the radar's receiver delivers it; the noise belongs to the seed and the frame's start."""
    receiver = radar.receiver or Receiver()
    time_bits = int(np.float64(start + 0.0).view(np.uint64))
    cube = receiver.receive(ideal, radar.waveform.sample_rate, np.random.default_rng([seed, time_bits]))
    single = sample_dtype(tolerance) is np.complex64
    if np.iscomplexobj(cube):
        return cube.astype(np.complex64 if single else np.complex128, copy=False)
    return cube.astype(np.float32 if single else np.float64, copy=False)


def _series_residuals(
    delay: NDArray[np.float64], amplitude: NDArray[np.complex128], frequency: float
) -> tuple[float, float]:
    """Error of the Chebyshev series through delays and amplitudes (node, channel, path), relative to l2(amplitudes).

    Of phases and of amplitudes, the worst channel's; from the last two coefficients, which for smooth motion are larger
    than all that follow.
    """
    n = len(delay)
    angles = np.pi * (2 * np.arange(n)[::-1] + 1) / (2 * n)
    last = np.cos(np.arange(n - 2, n)[:, None] * angles) * (2.0 / n)

    def end(values: NDArray[Any]) -> NDArray[np.float64]:
        coefficients: NDArray[np.float64] = np.abs(np.tensordot(last, values - values[0], axes=1)).max(axis=0)
        return coefficients

    strength = np.abs(amplitude).max(axis=0)
    total = np.maximum(np.linalg.norm(strength, axis=-1), np.finfo(float).tiny)
    phase = np.linalg.norm(2.0 * np.pi * frequency * end(delay) * strength, axis=-1) / total
    weight = np.linalg.norm(end(amplitude), axis=-1) / total
    return float(phase.max(initial=0.0)), float(weight.max(initial=0.0))
