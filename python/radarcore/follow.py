"""From paths to samples: the times of a frame at which paths are taken, their sum, and what the receiver delivers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.beat import sample_dtype
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
    order : int
        By which power of the frequency amplitudes fall; `follow` has those at the centre of the band.
    """

    num_paths: int
    is_static: bool
    follow: Follow
    order: int = 0


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


def first_times(waveform: Waveform, start: float) -> list[NDArray[np.float64]]:
    """The sets of times [s] that `follow_nodes` begins with: few courses need others."""
    return [start + waveform.delay_times(num_nodes) for num_nodes in _NODE_COUNTS[:3]]


@dataclass(frozen=True, eq=False)
class Synthesis:
    """The ideal beat signal of some courses and how it came about.

    Attributes
    ----------
    cube : (channel, chirp, sample) complex
    farthest : float
        Half the length of the longest path that carries power [m], of those of order 0.
    nodes : Nodes
        Of the course whose series is the worst.
    stats : dict
        For `Frame.stats`.
    """

    cube: NDArray[Any]
    farthest: float
    nodes: Nodes
    stats: dict[str, Any]


def synthesise(
    courses: Sequence[Course],
    waveform: Waveform,
    num_channels: int,
    start: float,
    *,
    tolerance: float,
    method: str,
    threads: int | None,
) -> Synthesis:
    """Ideal beat signal of a frame that begins at `start` [s]."""
    cube = np.zeros((num_channels, waveform.num_chirps, waveform.num_samples), sample_dtype(tolerance))
    worst, farthest = Nodes(np.array([start])), 0.0
    plans: list[str] = []
    rows = rows_skipped = num_still = 0
    for course in courses:
        if course.num_paths == 0:
            continue
        nodes = follow_nodes(course, waveform, start, tolerance)
        for samples, longest, report in _sum_pieces(
            course, nodes.times, waveform, num_channels, tolerance, method, threads
        ):
            if course.order > 0:
                samples *= _over_frequency(waveform, course.order).astype(samples.real.dtype)
            cube = samples if not plans else cube + samples
            farthest = max(farthest, longest) if course.order == 0 else farthest
            rows += report.rows
            rows_skipped += report.rows_skipped
            num_still += sum(part[1] for part in report.parts() if part[0] == "still") // num_channels
            plans.append(f"delays at {len(nodes.times)} time{'s' * (len(nodes.times) > 1)}; {report}")
        if nodes.residual >= worst.residual:
            worst = nodes
    stats = {
        "delay_nodes": len(worst.times),
        "series_residual": worst.residual,
        "still_paths": num_still,
        "velocity_rows": rows,
        "velocity_rows_skipped": rows_skipped,
        "plan": "\n".join(plans) or "no paths",
    }
    return Synthesis(cube, farthest, worst, stats)


def _over_frequency(waveform: Waveform, order: int) -> NDArray[np.float64]:
    """What fields that fall with a power of the frequency are over those at the centre of the band, (sample,)."""
    frequency = waveform.start_frequency + waveform.slope * waveform.sample_times
    weights: NDArray[np.float64] = (waveform.center_frequency / frequency) ** order
    return weights


def _sum_pieces(
    course: Course,
    times: NDArray[np.float64],
    waveform: Waveform,
    num_channels: int,
    tolerance: float,
    method: str,
    threads: int | None,
) -> Iterator[tuple[NDArray[Any], float, _core.Report]]:
    """Samples of some paths after others, taken at the Chebyshev `times` of a frame, and the longest of them [m].

    Piece by piece: bounded memory, and Ctrl-C is heard between pieces.
    """
    size = max(1, _PIECE_NUMBERS // (num_channels * len(times)))
    if method == "direct":
        cube_size = num_channels * waveform.num_chirps * waveform.num_samples
        size = max(1, min(size, _PIECE_PATH_SAMPLES // cube_size))
    for first in range(0, course.num_paths, size):
        delay, amplitude = course.follow(times, slice(first, min(first + size, course.num_paths), 1))
        longest = _longest(delay, amplitude)
        samples, report = _core.beat_signal(
            delay, amplitude, waveform=waveform._core, tolerance=tolerance, method=method, threads=threads
        )
        yield samples, 0.5 * SPEED_OF_LIGHT * longest, report


def _longest(delay: NDArray[np.float64], amplitude: NDArray[np.complex128]) -> float:
    """Longest delay of paths that carry power [s], 0 without any."""
    # Nearly always that of all of them does.
    at = np.unravel_index(delay.argmax(), delay.shape)
    if amplitude[at] != 0.0:
        return float(delay[at])
    return float(delay.max(initial=0.0, where=amplitude != 0.0))


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


def receive(ideal: NDArray[Any], radar: Radar, start: float, *, seed: int, tolerance: float) -> NDArray[Any]:
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

    def end(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The last two coefficients, (channel, 2, number); channel by channel, too little to wake other threads for."""
        coefficients: NDArray[np.float64] = last @ np.swapaxes(values, 0, 1)
        return coefficients

    power = (amplitude.real**2 + amplitude.imag**2).max(axis=0)
    total = np.maximum(np.sqrt(power.sum(axis=-1)), np.finfo(float).tiny)
    # Without the first of the delays, the rounding of whole delays is no part of the phases.
    phases = 2.0 * np.pi * frequency * np.abs(end(delay - delay[0])).max(axis=1)
    phase = np.sqrt((phases**2 * power).sum(axis=-1)) / total
    parts = end(amplitude.view(np.float64)) ** 2
    weight = np.sqrt((parts[..., ::2] + parts[..., 1::2]).max(axis=1).sum(axis=-1)) / total
    return float(phase.max(initial=0.0)), float(weight.max(initial=0.0))
