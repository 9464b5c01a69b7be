"""From paths to samples: the times of a frame at which paths are taken, their sum, and what the receiver delivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core, notice
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.simulate.synthesis import sample_dtype
from radarcore.units import SPEED_OF_LIGHT

# Delays and amplitudes are each taken at as many Chebyshev times as the tolerance needs; amplitudes of surfaces that
# turn out of sight have a kink, which no number of times follows exactly, and twice as many little better.
_NODE_COUNTS = (4, 6, 8, 12, 16, 24, 32, 48, 64)
_ENOUGH_FOR_KINKS = 16
# Numbers of times at which some paths are looked at, to choose one up to that.
_PROBED_COUNTS = (8, 16, 32, 64)
# Delays are followed to this phase [rad] whatever the tolerance where few times are enough: it costs little, and other
# processing may need it.
_PHASE_GOAL = 1e-7
# Those that most courses need.
_USUAL_COUNTS = (8, 6, 4)
# Paths that are looked at to choose the number of times.
_NUM_PROBES = 512
# Work and memory of one piece of the sum: path-samples (half a second), and numbers per path.
_PIECE_PATH_SAMPLES = 2**28
_PIECE_NUMBERS = 2**25

Times = NDArray[np.float64]

Follow = Callable[[Times, Times, slice], tuple[NDArray[np.float64], NDArray[np.complex128]]]
"""Delays [s] and amplitudes [sqrt(W)], (time, channel, path), of some paths.

Takes absolute times [s] of delays and of amplitudes; amplitudes that never change may come at one time.
"""


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
    """Times of a frame at which delays and amplitudes are taken [s], and the errors of the series through them.

    Errors of phases and of amplitudes, relative to l2(amplitudes).
    """

    times: Times
    amplitude_times: Times
    phase: float = 0.0
    weight: float = 0.0

    @property
    def residual(self) -> float:
        """Both errors together."""
        return float(np.hypot(self.phase, self.weight))

    def warn_beyond(self, tolerance: float) -> bool:
        """Warn and say so when the series is worse than the tolerance."""
        if self.residual <= tolerance:
            return False
        reason = (
            "phases (fast motion, or large absolute times)"
            if self.phase > self.weight
            else "amplitudes (turning edges)"
        )
        notice.warn(
            f"{reason} are followed within a frame to {self.residual:.1e} only, tolerance is {tolerance:.1e}",
        )
        return True


def follow_nodes(course: Course, waveform: Waveform, start: float, tolerance: float) -> Nodes:
    """Times at which the paths of the frame that begins at `start` [s] have to be taken for a tolerance."""
    if course.is_static:
        once = start + waveform.delay_times(1)
        return Nodes(once, once)
    probes = slice(0, course.num_paths, max(1, course.num_paths // _NUM_PROBES))
    highest = max(waveform.start_frequency, waveform.center_frequency) + 0.5 * waveform.bandwidth
    goal = 0.1 * tolerance
    last_weight = np.inf
    for probed in _PROBED_COUNTS:
        counts = [count for count in _NODE_COUNTS if count <= probed]
        times = start + waveform.delay_times(probed)
        errors = _series_errors(*course.follow(times, times, probes), highest, counts)
        phase_goal = min(goal, _PHASE_GOAL) if probed == _PROBED_COUNTS[0] else goal
        chosen = [
            next(
                ((n, error) for n, error in zip(counts, of_counts, strict=True) if error <= wanted),
                (probed, of_counts[-1]),
            )
            for of_counts, wanted in zip(errors, (phase_goal, goal), strict=True)
        ]
        (_, phase), (_, weight) = chosen
        if phase <= goal and (weight <= goal or (probed >= _ENOUGH_FOR_KINKS and weight > 0.05 * last_weight)):
            break
        last_weight = weight
    (num_delays, phase), (num_amplitudes, weight) = chosen
    if phase > goal:
        # Rounding of large absolute times is the limit: fewer times do as well.
        enough = 2.0 * min(errors[0])
        num_delays, phase = next((n, e) for n, e in zip(counts, errors[0], strict=True) if e <= enough)
    return Nodes(start + waveform.delay_times(num_delays), start + waveform.delay_times(num_amplitudes), phase, weight)


def first_times(waveform: Waveform, start: float) -> list[Times]:
    """The sets of times [s] that most courses need."""
    return [start + waveform.delay_times(count) for count in _USUAL_COUNTS]


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
    once = np.array([start])
    worst, farthest = Nodes(once, once), 0.0
    plans: list[str] = []
    rows = rows_skipped = num_still = 0
    for course in courses:
        if course.num_paths == 0:
            continue
        nodes = follow_nodes(course, waveform, start, tolerance)
        for samples, longest, report in _sum_pieces(course, nodes, waveform, num_channels, tolerance, method, threads):
            if course.order > 0:
                samples *= _over_frequency(waveform, course.order).astype(samples.real.dtype)
            cube = samples if not plans else cube + samples
            farthest = max(farthest, longest) if course.order == 0 else farthest
            rows += report.rows
            rows_skipped += report.rows_skipped
            num_still += sum(part[1] for part in report.parts() if part[0] == "still") // num_channels
            plans.append(f"delays at {_times(nodes.times)}, amplitudes at {_times(nodes.amplitude_times)}; {report}")
        if nodes.residual >= worst.residual:
            worst = nodes
    stats = {
        "delay_nodes": len(worst.times),
        "amplitude_nodes": len(worst.amplitude_times),
        "series_residual": worst.residual,
        "still_paths": num_still,
        "velocity_rows": rows,
        "velocity_rows_skipped": rows_skipped,
        "plan": "\n".join(plans) or "no paths",
    }
    return Synthesis(cube, farthest, worst, stats)


def _times(times: Times) -> str:
    return f"{len(times)} time{'s' * (len(times) > 1)}"


def _over_frequency(waveform: Waveform, order: int) -> NDArray[np.float64]:
    """What fields that fall with a power of the frequency are over those at the centre of the band, (sample,)."""
    frequency = waveform.start_frequency + waveform.slope * waveform.sample_times
    weights: NDArray[np.float64] = (waveform.center_frequency / frequency) ** order
    return weights


def _sum_pieces(
    course: Course,
    nodes: Nodes,
    waveform: Waveform,
    num_channels: int,
    tolerance: float,
    method: str,
    threads: int | None,
) -> Iterator[tuple[NDArray[Any], float, _core.Report]]:
    """Samples of some paths after others, taken at the `nodes` of a frame, and the longest of them [m].

    Piece by piece: bounded memory, and Ctrl-C is heard between pieces.
    """
    size = max(1, _PIECE_NUMBERS // (num_channels * max(len(nodes.times), len(nodes.amplitude_times))))
    if method == "direct":
        cube_size = num_channels * waveform.num_chirps * waveform.num_samples
        size = max(1, min(size, _PIECE_PATH_SAMPLES // cube_size))
    for first in range(0, course.num_paths, size):
        piece = slice(first, min(first + size, course.num_paths), 1)
        delay, amplitude = course.follow(nodes.times, nodes.amplitude_times, piece)
        longest = _longest(delay, amplitude)
        samples, report = _core.beat_signal(
            delay, amplitude, waveform=waveform._core, tolerance=tolerance, method=method, threads=threads
        )
        yield samples, 0.5 * SPEED_OF_LIGHT * longest, report


def _longest(delay: NDArray[np.float64], amplitude: NDArray[np.complex128]) -> float:
    """Longest delay of paths that carry power [s], 0 without any."""
    # Nearly always that of all of them does.
    at = np.unravel_index(delay.argmax(), delay.shape)
    _, channel, path = at
    if amplitude[:, channel, path].any():
        return float(delay[at])
    return float(delay.max(initial=0.0, where=amplitude.any(axis=0)))


def warn_beyond_range(farthest: float, radar: Radar) -> bool:
    """Warn and say so when echoes come from beyond what the waveform tells apart."""
    if farthest <= radar.max_range:
        return False
    notice.warn(
        f"the scene reaches to {farthest:.2f} m, beyond max_range {radar.max_range:.2f} m of the waveform: echoes from "
        "there appear at wrong ranges",
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


def _series_errors(
    delay: NDArray[np.float64], amplitude: NDArray[np.complex128], frequency: float, counts: Sequence[int]
) -> tuple[list[float], list[float]]:
    """Errors of Chebyshev series of some lengths through delays and amplitudes (node, channel, path).

    Of phases and of amplitudes, rms over the frame relative to l2(amplitudes), the worst channel's: twice the l2 norm
    of the coefficients beyond a length, as a series through so many times folds them back; for the last length, that of
    the whole series, four times the larger of the last two coefficients.
    """
    power = (amplitude.real**2 + amplitude.imag**2).max(axis=0)
    total = np.maximum(np.sqrt(power.sum(axis=-1, keepdims=True)), np.finfo(float).tiny)

    def left_out(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        """What series of `counts` leave out, (channel, count, number), of coefficients (channel, order, number)."""
        squares = coefficients * coefficients
        beyond = 2.0 * np.sqrt(np.cumsum(squares[:, ::-1], axis=1)[:, ::-1][:, counts[:-1]])
        last = 4.0 * np.sqrt(squares[:, -2:].max(axis=1, keepdims=True))
        return np.concatenate([beyond, last], axis=1)

    # Without the first of the delays, the rounding of whole delays is no part of the phases.
    phases = 2.0 * np.pi * frequency * left_out(_coefficients(delay - delay[0]))
    of_phases = np.sqrt(np.einsum("ckp,ckp,cp->ck", phases, phases, power, optimize=False)) / total
    if len(amplitude) > 1:
        weights = left_out(_coefficients(amplitude.view(np.float64)))
        of_weights = np.sqrt(np.einsum("ckp,ckp->ck", weights, weights)) / total
    else:
        of_weights = np.zeros_like(of_phases)
    return of_phases.max(axis=0).tolist(), of_weights.max(axis=0).tolist()


def _coefficients(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Chebyshev coefficients (channel, order, number) of the series through values (node, channel, number).

    Channel by channel, too little to wake other threads for.
    """
    n = len(values)
    angles = np.pi * (2 * np.arange(n)[::-1] + 1) / (2 * n)
    matrix = np.cos(np.arange(n)[:, None] * angles) * (2.0 / n)
    matrix[0] *= 0.5
    coefficients: NDArray[np.float64] = matrix @ np.swapaxes(values, 0, 1)
    return coefficients
