"""Steering vectors: phases of a plane wave in the channels of an array, and the weights that align them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.products import product
from radarcore.radar.radar import Radar

_UNEQUAL = 1e-3
"""Steps between elements are equal if they differ by less than this part of their mean (rounded positions)."""


def steering_vectors(
    positions: NDArray[np.float64], wavelength: float, directions: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Beat signal of plane waves from directions (..., 3) at positions (channel, 3) [m], (..., channel).

    ``exp(-2 pi j position . direction / wavelength)``: an antenna nearer to the target has less delay, and the beat
    phase grows with delay.
    """
    turns = product(directions, positions.T) / wavelength
    vectors: NDArray[np.complex128] = np.exp(-2j * np.pi * turns)
    return vectors


def steering_weights(
    positions: ArrayLike, wavelength: float, azimuth: ArrayLike, elevation: ArrayLike = 0.0
) -> NDArray[np.complex128]:
    """Weights of modulus 1 that steer an array: ``sum(weights * channels)`` adds echoes from a direction in phase.

    The weights multiply beat signals. A phase shifter in front of an antenna rotates the wave and needs the opposite
    phase, because the beat signal is the transmitted signal times the conjugate received signal.

    Parameters
    ----------
    positions : (element, 3) array_like
        Transmitters, receivers or channels (`Radar.virtual_array`) in the sensor frame [m].
    wavelength : float
        [m], as `Waveform.wavelength`.
    azimuth, elevation : array_like
        Steering angles [rad], positive to the left and up, broadcast together.

    Returns
    -------
    weights : (..., element) complex128

    See Also
    --------
    array_pattern : Gain of a steered array.
    directions : Directions of echoes.
    Schedule.steered : Steered transmit beams.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> azimuth = np.deg2rad([0.0, 30.0])
    >>> weights = rc.processing.steering_weights(radar.virtual_array, radar.waveform.wavelength, azimuth)
    >>> weights.shape, np.abs(weights).round(6).max().item()
    ((2, 3), 1.0)
    """
    places = check.array("positions", positions, (None, 3))
    length = check.positive("wavelength", wavelength, "m")
    return steering_vectors(places, length, unit_vectors(*checked_angles(azimuth, elevation))).conj()


def uniform_row(positions: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]] | None:
    """Order of elements along a line and the step (3,) [m] from one to the next; None unless all steps are equal."""
    if len(positions) < 2:
        return None
    from_first = positions - positions[0]
    line = from_first[np.square(from_first).sum(axis=1).argmax()]
    order = np.argsort(from_first @ line, kind="stable")
    steps = np.diff(positions[order], axis=0)
    step = steps.mean(axis=0)
    length = float(np.linalg.norm(step))
    is_uniform = length > 0.0 and bool((np.linalg.norm(steps - step, axis=1) <= _UNEQUAL * length).all())
    return (order, step) if is_uniform else None


def checked_angles(azimuth: ArrayLike, elevation: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Finite angles [rad] that broadcast together; warns if they look like degrees."""
    az, el = (
        check.radians(name, check.array(name, value, (None,) * np.ndim(value)))
        for name, value in (("azimuth", azimuth), ("elevation", elevation))
    )
    try:
        np.broadcast_shapes(az.shape, el.shape)
    except ValueError:
        raise ValueError(
            f"elevation: expected a shape that broadcasts with azimuth's, {az.shape}, got {el.shape}"
        ) from None
    return az, el


def channel_corrections(
    radar: Radar, velocity: ArrayLike | None, channel_phase: ArrayLike | None
) -> NDArray[np.complex128]:
    """Factors that correct the channels for everything except direction, (..., channel) or (channel,).

    They undo the phase of a target with `velocity` (...,) [m/s], receding positive, in channels with later chirps, and
    `channel_phase` (channel,) [rad], by default `Radar.channel_corrections`. NaN or None: no velocity correction.
    """
    factors: NDArray[np.complex128] = radar.channel_corrections
    if channel_phase is not None:
        factors = np.exp(-1j * check.array("channel_phase", channel_phase, (radar.num_channels,)))
    if velocity is not None and (offsets := radar.channel_offsets).any():
        doppler = 2.0 * np.nan_to_num(np.asarray(velocity, np.float64)) / radar.waveform.wavelength
        factors = factors * np.exp(-2j * np.pi * doppler[..., None] * offsets)
    return factors
