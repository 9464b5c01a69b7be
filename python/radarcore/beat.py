"""The beat signal of given paths: the synthesis without a scene."""

from __future__ import annotations

from typing import TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check
from radarcore.waveform import Waveform

Number = TypeVar("Number", np.float64, np.complex128)

METHODS = ("auto", "direct")
"""Ways to form the sum over paths."""

SINGLE_PRECISION_TOLERANCE = 1e-6
"""Tolerances below this give complex128 and float64, others complex64 and float32."""

MAX_THREADS = 1024
"""More than this the core does not start."""


class WaveformNumbers(TypedDict):
    """The numbers of a waveform, as keywords of the core."""

    start_frequency: float
    slope: float
    sample_rate: float
    adc_delay: float
    num_samples: int
    chirp_times: NDArray[np.float64]


def beat_signal(
    delay: ArrayLike,
    amplitude: ArrayLike,
    waveform: Waveform,
    *,
    delay_rate: ArrayLike | None = None,
    delay_acceleration: ArrayLike | None = None,
    tolerance: float = 1e-4,
    method: str = "auto",
    threads: int | None = None,
) -> NDArray[np.complex64] | NDArray[np.complex128]:
    """Samples of an ideal I/Q receiver for a set of paths, README eq. (1).

    Sum over the paths of ``conj(amplitude) exp(2 pi j (f0 tau + S tau t - S tau**2 / 2))`` with
    ``tau = delay + delay_rate T + delay_acceleration T**2 / 2``, T since the start of the frame, t since the
    start of the chirp's ramp.

    Parameters
    ----------
    delay : (path,), (channel, path) or (node, channel, path) array_like
        Two-way delay [s] at the start of the frame; with three axes the delays at ``waveform.delay_times(num_nodes)``,
        for any motion.
    amplitude : (path,), (channel, path) or (node, channel, path) array_like of complex
        Amplitude without the phase of propagation [sqrt(W)]. With three axes: at the nodes of `delay`.
    waveform : Waveform
    delay_rate, delay_acceleration : like `delay`, optional
        First and second derivative of the delay [s/s], [s/s^2]; not with nodal delays.
    tolerance : float
        Bound on rms(error over the samples of a channel) / l2(amplitudes of that channel).
    method : "auto" or "direct"
        Direct: every sample of every path in double precision.
    threads : int, optional
        Threads to use; default: all cores. The result does not depend on it.

    Returns
    -------
    samples : (channel, chirp, sample) complex64, complex128 for tolerances below 1e-6

    Raises
    ------
    ValueError
        For shapes that do not fit together and numbers that are not finite.
    TypeError
        For complex delays and things that are no numbers.
    """
    if not isinstance(waveform, Waveform):
        raise TypeError(f"waveform: expected Waveform, got {type(waveform).__name__}")
    check.choice("method", method, METHODS)
    dtype = sample_dtype(tolerance)
    delays = _numbers("delay", delay, np.float64)
    amplitudes = _numbers("amplitude", amplitude, np.complex128)
    is_nodal = delays.ndim == 3

    # Delays to (term, channel, path).
    derivatives = [("delay_rate", delay_rate), ("delay_acceleration", delay_acceleration)]
    if is_nodal:
        for name, value in derivatives:
            if value is not None:
                raise ValueError(f"{name}: expected none together with delays at nodes {delays.shape}")
        terms = delays
    else:
        rows = [delays] + [
            np.zeros_like(delays) if value is None else _like(name, _numbers(name, value, np.float64), delays.shape)
            for name, value in derivatives
        ]
        terms = np.stack([np.atleast_2d(row) for row in rows])

    # Amplitudes to (term, channel, path).
    shape = terms.shape if is_nodal and amplitudes.ndim == 3 else (1, *terms.shape[1:])
    weights = _like("amplitude", amplitudes, shape)

    samples: NDArray[np.complex128] = _core.beat_signal(
        np.ascontiguousarray(terms),
        np.ascontiguousarray(weights),
        is_chebyshev=is_nodal,
        threads=check_threads(threads),
        **core_waveform(waveform),
    )
    return samples.astype(np.complex64) if dtype is np.complex64 else samples


def sample_dtype(tolerance: float) -> type[np.complex64] | type[np.complex128]:
    """The type of samples that honours a tolerance."""
    bound = check.positive("tolerance", tolerance)
    if not 1e-12 <= bound <= 1e-1:
        raise ValueError(f"tolerance: expected 1e-12 to 1e-1, got {tolerance!r}")
    return np.complex128 if bound < SINGLE_PRECISION_TOLERANCE else np.complex64


def core_waveform(waveform: Waveform) -> WaveformNumbers:
    """The numbers of a waveform as the core takes them."""
    return {
        "start_frequency": waveform.start_frequency,
        "slope": waveform.slope,
        "sample_rate": waveform.sample_rate,
        "adc_delay": waveform.adc_delay,
        "num_samples": waveform.num_samples,
        "chirp_times": waveform.chirp_times,
    }


def check_threads(threads: int | None) -> int | None:
    """A number of threads, or None for all cores."""
    if threads is None:
        return None
    num_threads = check.count("threads", threads)
    if num_threads > MAX_THREADS:
        raise ValueError(f"threads: expected at most {MAX_THREADS}, got {num_threads}")
    return num_threads


def _numbers(name: str, value: ArrayLike, dtype: type[Number]) -> NDArray[Number]:
    kind = "complex numbers" if dtype is np.complex128 else "real numbers"
    try:
        array = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise TypeError(f"{name}: expected {kind}, got {type(value).__name__}: {error}") from None
    if array.dtype.kind not in ("iufc" if dtype is np.complex128 else "iuf"):
        raise TypeError(f"{name}: expected {kind}, got {array.dtype}")
    if array.ndim > 3:
        raise ValueError(f"{name}: expected (path,), (channel, path) or (node, channel, path), got {array.shape}")
    return np.atleast_1d(array.astype(dtype))


def _like(name: str, array: NDArray[Number], shape: tuple[int, ...]) -> NDArray[Number]:
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name}: expected shape {shape} or one that broadcasts to it, got {array.shape}") from None
