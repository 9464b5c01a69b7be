"""Power over direction from the covariance of the channels: Bartlett, Capon, MUSIC, and FFT beams."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.processing.angles.steering import channel_corrections
from radarcore.processing.inputs import require_uniform_chirps
from radarcore.processing.spectra.spectra import fast_spectrum
from radarcore.processing.spectra.windows import Window, window_weights
from radarcore.products import product
from radarcore.radar.radar import Radar

_Matrices = NDArray[np.complex128]
_Powers = NDArray[np.float64]

_BEAMS_PER_ELEMENT = 64
"""FFT beams per element; linear interpolation of power between them errs at a peak by ``(2 pi / 64)^2 / 48`` = 2e-4."""

_LEAST_EIGENVALUE = 1e-14
"""Eigenvalues below this part of the largest are rounding errors."""


def bartlett(covariances: _Matrices, steering: _Matrices) -> _Powers:
    """``a^H R a / N^2``: power per channel of a single wave from each direction, (..., angle).

    Parameters
    ----------
    covariances : (..., N, N) complex128
    steering : (angle, N) complex128
    """
    powers: _Powers = _quadratic(covariances, steering) / steering.shape[-1] ** 2
    return powers


def capon(covariances: _Matrices, steering: _Matrices, loading: float) -> _Powers:
    """``1 / (a^H R^-1 a)``: least output power of weights that pass a wave from each direction, (..., angle).

    Diagonal loading adds `loading` times the mean diagonal of R. Without it, few chirps or a direction between two
    steering vectors would let the beamformer suppress the wave as interference. Capon, High-resolution
    frequency-wavenumber spectrum analysis, Proceedings of the IEEE 57, 1969.
    """
    number = covariances.shape[-1]
    level = np.trace(covariances, axis1=-2, axis2=-1).real / number
    level = np.where(level > 0.0, level, 1.0)[..., None, None]  # zero power stays zero
    loaded: _Matrices = covariances / level
    loaded[..., range(number), range(number)] += loading
    least = np.linalg.inv(loaded).astype(np.complex128, copy=False)
    with np.errstate(invalid="ignore"):  # NaN passes through
        powers: _Powers = level[..., 0] / _quadratic(least, steering)
    silent = (covariances == 0.0).all(axis=(-2, -1), keepdims=True)[..., 0]
    return np.where(silent, 0.0, powers)


def music(covariances: _Matrices, steering: _Matrices, num_sources: int | None, num_snapshots: int) -> _Powers:
    """MUSIC spectrum ``N / (a^H E E^H a)``, E the noise eigenvectors: dimensionless, at least 1, (..., angle).

    Schmidt, Multiple emitter location and signal parameter estimation, IEEE Transactions on Antennas and Propagation
    34, 1986. The default number of sources is the minimum description length of the eigenvalues, at each range.
    """
    finite = np.isfinite(np.sum(covariances, axis=(-2, -1), keepdims=True))
    values, vectors = np.linalg.eigh(np.where(finite, covariances, 0.0))
    number = values.shape[-1]
    counts = shortest_description(values, num_snapshots) if num_sources is None else np.asarray(num_sources)
    is_noise = np.arange(number) < number - counts[..., None]  # eigenvalues increase
    noise = vectors * is_noise[..., None, :]
    projections = np.abs(product(np.swapaxes(noise, -1, -2).conj(), steering.T)) ** 2  # [..., eigenvector, angle]
    spectra = number / np.maximum(projections.sum(axis=-2), number * 1e-30)
    return np.where(finite[..., 0], spectra, np.nan)


def shortest_description(values: NDArray[np.float64], num_snapshots: int) -> NDArray[np.intp]:
    """Number of sources (...,) from the increasing eigenvalues (..., N) of a covariance over `num_snapshots`.

    Minimum description length: Wax, Kailath, Detection of signals by information theoretic criteria, IEEE Transactions
    on Acoustics, Speech, and Signal Processing 33, 1985. At most N - 1; 0 where all eigenvalues are zero.
    """
    number = values.shape[-1]
    largest = values[..., -1:]
    safe = np.maximum(values, _LEAST_EIGENVALUE * np.where(largest > 0.0, largest, 1.0))
    num_noise = np.arange(1, number + 1)
    arithmetic = np.cumsum(safe, axis=-1) / num_noise
    geometric = np.cumsum(np.log(safe), axis=-1) / num_noise
    counts = number - num_noise
    length = num_snapshots * num_noise * (np.log(arithmetic) - geometric)
    length = length + 0.5 * counts * (2 * number - counts) * np.log(num_snapshots)
    shortest: NDArray[np.intp] = counts[length.argmin(axis=-1)]
    return shortest


def fft_beams(
    covariances: _Matrices, order: NDArray[np.intp], step: NDArray[np.float64], directions: NDArray[np.float64]
) -> _Powers:
    """`bartlett` of a uniform row by a Fourier transform along it, (..., angle).

    Parameters
    ----------
    order, step
        As `uniform_row` gives them, the step in wavelengths.
    directions : (angle, 3) float64
        Unit vectors.
    """
    in_row = covariances[..., order[:, None], order]
    number = len(order)
    # The power of the beams is the transform of the covariance over the distance between elements (in steps).
    lags = np.stack([np.trace(in_row, offset=-k, axis1=-2, axis2=-1) for k in range(number)], axis=-1)
    num_beams = 1 << (_BEAMS_PER_ELEMENT * number - 1).bit_length()
    beams = np.fft.irfft(lags, num_beams, norm="forward") / number**2
    at = (directions @ step) % 1.0 * num_beams
    left = at.astype(np.intp) % num_beams
    part = at - np.floor(at)
    powers: _Powers = (1.0 - part) * beams[..., left] + part * beams[..., (left + 1) % num_beams]
    return powers


def _quadratic(matrices: _Matrices, steering: _Matrices) -> _Powers:
    """``a^H M a``, real, of Hermitian matrices (..., N, N) and vectors (angle, N): (..., angle)."""
    turned = product(matrices, steering.T)  # [..., N, angle]
    forms: _Powers = np.einsum("an,...na->...a", steering.conj(), turned).real
    return forms


Beamformer = Callable[[_Matrices], _Powers]
"""Covariances (..., channel, channel) to power over direction (..., angle)."""


def range_covariances(
    samples: NDArray[Any],
    radar: Radar,
    *,
    window: Window,
    doppler_window: Window,
    num_range_bins: int | None,
    channel_phase: ArrayLike | None,
    bins: slice = slice(None),
) -> NDArray[np.complex128]:
    """Covariance of the channels over the chirps, (..., range, channel, channel).

    In time-division multiplex the mean is over Doppler cells instead, after correction of each cell's phase for the
    motion between transmitters. The scale is the same: for constant power the result equals the mean over chirps.

    Parameters
    ----------
    samples : (..., channel, chirp, sample) array
    bins : slice
        Range bins to compute.
    """
    # Check all arguments before any work.
    wf = radar.waveform
    weights = window_weights("doppler_window", doppler_window, wf.num_chirps)
    takes_turns = bool(radar.channel_offsets.any())
    if takes_turns:
        require_uniform_chirps(wf)
    velocity = np.fft.ifftshift(wf.velocity_axis()) if takes_turns else None
    corrections = channel_corrections(radar, velocity, channel_phase)  # [channel] or [doppler, channel]

    profile = fast_spectrum(samples, wf, window=window, num_bins=num_range_bins)[..., bins].astype(np.complex128)
    scale = 1.0 / wf.num_chirps
    if takes_turns:
        profile = np.fft.fft(profile * weights[:, None], axis=-2)
        scale = 1.0 / (wf.num_chirps * float(np.square(weights).sum()))  # Parseval
    profile *= np.atleast_2d(corrections).T[..., None]  # [channel, chirp or doppler, 1]
    snapshots = np.moveaxis(profile, -1, -3)  # [..., range, channel, chirp]
    covariances: NDArray[np.complex128] = product(snapshots, np.swapaxes(snapshots, -1, -2).conj())
    covariances *= scale
    return covariances


def smoothed(covariances: NDArray[np.complex128], order: NDArray[np.intp], length: int) -> NDArray[np.complex128]:
    """Forward-backward spatial smoothing: mean over the subarrays of a uniform row, (..., length, length).

    Static echoes at one range are coherent: their covariance has rank one, and its eigenvector is no steering vector.
    Along the row the relative phases of these echoes change, so the mean over shifted subarrays restores the rank
    (Shan, Wax, Kailath, On spatial smoothing for direction-of-arrival estimation of coherent signals, IEEE
    Transactions on Acoustics, Speech, and Signal Processing 33, 1985; forward-backward: Pillai, Kwon, 37, 1989).
    """
    in_row = covariances[..., order[:, None], order]
    starts = range(len(order) - length + 1)
    forward = np.mean([in_row[..., k : k + length, k : k + length] for k in starts], axis=0)
    both: NDArray[np.complex128] = 0.5 * (forward + forward[..., ::-1, ::-1].conj())
    return both
