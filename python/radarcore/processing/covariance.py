"""Covariance of the channels at every range, over the chirps of a frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.processing.inputs import require_uniform_chirps
from radarcore.processing.spectra import fast_spectrum
from radarcore.processing.steering import channel_corrections
from radarcore.processing.windows import Window, window_weights
from radarcore.products import product
from radarcore.radar.radar import Radar


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
    """Mean over the chirps of the channels times their conjugates, (..., range, channel, channel).

    Where transmitters take turns, over Doppler cells, each with the movement between the turns taken off; scaled so
    that the mean over chirps of what is constant in power comes out.

    Parameters
    ----------
    samples : (..., channel, chirp, sample) array
    bins : slice
        Range bins wanted.
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
    """Mean over the subarrays of a uniform row, forwards and backwards, (..., length, length).

    Echoes of one range that do not change over the chirps are copies of each other to the covariance, one source of
    a shape that no direction has. Shifted along the row their phases change, each in its own way, and so they become
    several (Shan, Wax, Kailath, On spatial smoothing for direction-of-arrival estimation of coherent signals, IEEE
    Transactions on Acoustics, Speech, and Signal Processing 33, 1985; backwards too: Pillai, Kwon, 37, 1989).
    """
    in_row = covariances[..., order[:, None], order]
    starts = range(len(order) - length + 1)
    forward = np.mean([in_row[..., k : k + length, k : k + length] for k in starts], axis=0)
    both: NDArray[np.complex128] = 0.5 * (forward + forward[..., ::-1, ::-1].conj())
    return both
