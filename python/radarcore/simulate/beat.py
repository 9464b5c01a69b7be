"""Beat signal of given paths: the synthesis without a scene."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.radar.waveform import Waveform

Number = TypeVar("Number", np.float64, np.complex128)

_Reals = NDArray[np.float64]
_Paths = tuple[_Reals, NDArray[np.complex128], _Reals | None, _Reals | None]
"""Delays, amplitudes, rates and accelerations."""

METHODS = ("auto", "direct", "grid")
"""Ways to form the sum over paths."""

MAX_THREADS = 1024
"""Largest number of threads that the core starts."""


def beat_signal(
    delay: ArrayLike,
    amplitude: ArrayLike,
    waveform: Waveform,
    *,
    delay_rate: ArrayLike | None = None,
    delay_acceleration: ArrayLike | None = None,
    tolerance: float = 1e-3,
    method: str = "auto",
    threads: int | None = None,
    progress: bool = True,
) -> NDArray[np.complex64] | NDArray[np.complex128]:
    """Samples of an ideal I/Q receiver for a set of paths, docs/theory.md eq. (1).

    Sum over the paths of ``conj(amplitude) exp(2 pi j (f0 tau + S tau t - S tau**2 / 2))`` with
    ``tau = delay + delay_rate T + delay_acceleration T**2 / 2``, T since the start of the frame, t since the
    start of the chirp's ramp.

    Parameters
    ----------
    delay : (path,), (channel, path) or (node, channel, path) array_like
        Two-way delay [s] at the start of the frame; with three axes the delays at ``waveform.delay_times(num_nodes)``,
        for any motion.
    amplitude : (path,), (channel, path) or (node, channel, path) array_like of complex
        Amplitude without the phase of propagation [sqrt(W)]. With three axes: together with delays at nodes, at its own
        number of nodes.
    waveform : Waveform
    delay_rate, delay_acceleration : like `delay`, optional
        First and second derivative of the delay [s/s], [s/s^2]; not with nodal delays.
    tolerance : float
        Bound on rms(error over the samples of a channel) / l2(amplitudes of that channel), 1e-12 to 1e-1; amplitudes at
        nodes count with their mean power. The rounding of the given delays comes on top, and the rounding of
        complex64, at most 6e-8 of the samples: 6e-8 sqrt(n) in this measure for n equal paths in phase, 1.9e-5 for 1e5.
        Below 1e-6 the samples are complex128.
    method : "auto", "direct" or "grid"
        Auto: the fastest that keeps the tolerance. Direct: every sample of every path in double precision. Grid: the
        faster of the two NUFFTs that take the paths, however few they are.
    threads : int, optional
        Threads to use; default: all cores. The result does not depend on it.
    progress : bool
        Show a progress bar in a terminal when a direct sum takes more than a second.

    Returns
    -------
    samples : (channel, chirp, sample) complex64, complex128 for tolerances below 1e-6

    Raises
    ------
    ValueError
        For shapes that do not fit together, numbers that are not finite, and phases beyond 1e12 turns.
    TypeError
        For complex delays and values that are no numbers.
    MemoryError
        For samples that do not fit into memory.

    See Also
    --------
    Simulator.paths : Paths of a scene.
    Waveform.delay_times : Times of nodal delays.

    Examples
    --------
    >>> waveform = rc.Waveform(start_frequency=60e9, slope=50e12, sample_rate=2e6, num_samples=64, num_chirps=4)
    >>> samples = rc.beat_signal([2 * 3.0 / 299792458.0], [1.0], waveform)  # an echo at 3 m
    >>> samples.shape, round(rc.strongest_peak(samples, waveform).range, 2)
    ((1, 4, 64), 3.0)
    """
    samples: NDArray[np.complex64] | NDArray[np.complex128]
    check.instance("waveform", waveform, Waveform)
    paths = _paths(delay, amplitude, delay_rate, delay_acceleration)
    total = math.prod(paths[0].shape[-2:-1]) * waveform.num_chirps
    # Other sums have no steps that are worth counting.
    shown = progress and method == "direct"
    with notice.progress_if_long("direct sum", "chirp", total, shown=shown) as report:
        samples, *_ = _core.beat_signal(
            **core_rows(*paths),
            waveform=waveform._core,
            tolerance=check_tolerance(tolerance),
            method=check.choice("method", method, METHODS),
            threads=check_threads(threads),
            report=report,
        )
    return samples


def check_tolerance(tolerance: float) -> float:
    """Checked tolerance."""
    return check.within("tolerance", tolerance, 1e-12, 0.1)


def check_threads(threads: int | None) -> int | None:
    """Checked number of threads, or None for all cores."""
    return None if threads is None else check.count("threads", threads, maximum=MAX_THREADS)


def _paths(
    delay: ArrayLike,
    amplitude: ArrayLike,
    delay_rate: ArrayLike | None,
    delay_acceleration: ArrayLike | None,
) -> _Paths:
    """Delays, amplitudes, rates and accelerations as the core takes them: of one shape, or amplitudes without nodes."""
    delays = _with_axes("delay", check.numbers("delay", delay))
    amplitudes = _with_axes("amplitude", check.complex_numbers("amplitude", amplitude))
    is_nodal = delays.ndim == 3
    # Amplitudes have no nodes, or some of their own.
    shape = (*amplitudes.shape[:-2], *delays.shape[1:]) if is_nodal else delays.shape

    def derivative(name: str, value: ArrayLike | None) -> _Reals | None:
        if value is not None and is_nodal:
            raise ValueError(f"{name}: expected none together with delays at nodes {delays.shape}")
        return None if value is None else _like(name, check.numbers(name, value), delays.shape)

    rate, acceleration = derivative("delay_rate", delay_rate), derivative("delay_acceleration", delay_acceleration)
    if acceleration is not None and rate is None:
        rate = np.zeros_like(delays)
    return delays, _like("amplitude", amplitudes, shape), rate, acceleration


def core_rows(delay: _Reals, amplitude: NDArray[np.complex128], *derivatives: _Reals | None) -> dict[str, Any]:
    """Paths as the core takes them: rows (channel, path) of delays and their derivatives, or of both at nodes."""
    terms = (delay, *(derivative for derivative in derivatives if derivative is not None))
    is_nodal = delay.ndim == 3
    return {
        "delay": list(delay) if is_nodal else [np.atleast_2d(term) for term in terms],
        "amplitude": list(amplitude) if amplitude.ndim == 3 else [np.atleast_2d(amplitude)],
        "is_nodal": is_nodal,
    }


def _with_axes(name: str, array: NDArray[Number]) -> NDArray[Number]:
    if array.ndim > 3:
        raise ValueError(f"{name}: expected (path,), (channel, path) or (node, channel, path), got {array.shape}")
    return np.ascontiguousarray(np.atleast_1d(array))


def _like(name: str, array: NDArray[Number], shape: tuple[int, ...]) -> NDArray[Number]:
    try:
        return np.ascontiguousarray(np.broadcast_to(array, shape))
    except ValueError:
        raise ValueError(f"{name}: expected shape {shape} or one that broadcasts to it, got {array.shape}") from None
