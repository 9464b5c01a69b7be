"""Directions of detections: the best fit of one or two plane waves to the channels of a cell."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.processing.angles.pairs import pairs_of
from radarcore.processing.angles.plane_wave import PLACES_OF_TWO, Array, aligned, array_of, searched
from radarcore.processing.angles.steering import channel_corrections
from radarcore.radar.radar import Radar

_CHANCE = 0.01
"""Largest probability that noise makes a single target appear as several."""

_RARELY = 1e-4
"""Probability that noise hides the fit of two waves, whose bias may be 30 standard deviations of a single wave."""

_UNEQUAL = 0.005
"""Share of the power that a fit may leave as residual, because receiver gains differ by some tenths of a dB."""

_LOW_RESIDUAL = 0.25
"""Probability that interference leaves a smaller residual than measured; this sets the power that counts as noise."""

_FAR = 1e6
"""Distance of a plane wave [m]."""

_TINY = 1e-16
"""Smallest cosine, or squared cosine, at the horizon, about cos(pi / 2) in double precision."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Directions:
    """Directions of detections; NaN for unobservable angles.

    Attributes
    ----------
    azimuth, elevation : (detection,) float64
        Angles [rad], positive to the left and up.
    covariance : (detection, 2, 2) float64
        Cramer-Rao bound of azimuth and elevation [rad^2]; NaN without an SNR. If two waves fit significantly better, it
        is the bound with the second wave. Otherwise, the residual counts as noise if `is_resolved` is False.
    is_resolved : (detection,) bool
        False if a single target does not explain the channels, as for two targets in one cell: the residual power
        exceeds the noise (false alarms in 1 % of single targets) and 0.5 %. True without an SNR.
    ambiguous_beyond : float
        Largest unambiguous angle from the front [rad]. A target farther out has the same phases as a direction nearer
        to the front, which is returned. pi / 2 for an array without ambiguity.
    alternatives : (detection, alternative, 2) float64
        Azimuth and elevation [rad] of all other directions with the same phases, by their angle from the front; padded
        with NaN. No columns for an array without ambiguity.

    See Also
    --------
    directions : Makes one.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> found = rc.directions(np.ones((1, 3)), radar, snr_db=[20.0])
    >>> len(found), found.azimuth.round(6).tolist()
    (1, [0.0])
    """

    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    covariance: NDArray[np.float64]
    is_resolved: NDArray[np.bool_]
    ambiguous_beyond: float
    alternatives: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.azimuth)


def directions(
    snapshots: ArrayLike,
    radar: Radar,
    *,
    velocity: ArrayLike | None = None,
    snr_db: ArrayLike | None = None,
    range: ArrayLike | None = None,
    channel_phase: ArrayLike | None = None,
) -> Directions:
    """Direction of the strongest wave in the channels of every detection.

    The maximum of ``abs(a^H s)`` over directions to the front, a the steering vector of `Radar.virtual_array` and s
    the snapshot: the maximum-likelihood estimate for one target in white noise. An array without extent along y
    measures no azimuth, an array without extent along z no elevation; targets are then assumed at elevation 0
    (azimuth 0). An array along an oblique line measures neither. With more than half a wavelength between channels,
    several directions may give the same phases: the direction nearest to the front is returned, see
    `Directions.alternatives`. With an extent along x, directions more than 70 degrees from the front may be missed.

    If one wave does not explain the channels and the array has four places along an axis, two plane waves are fitted.
    If both together fit significantly better, the stronger one is returned.

    Parameters
    ----------
    snapshots : (detection, channel) array_like of complex
        Cells of ``range_doppler(...)``, all channels. NaN, infinite or zero snapshots give NaN.
    radar : Radar
    velocity : (detection,) array_like, optional
        Range rate [m/s], receding positive. In time-division multiplex, motion rotates the phase of channels with later
        chirps (`Radar.channel_offsets`); the velocity corrects this. None, NaN: no correction.
    snr_db : (detection,) array_like, optional
        Power over the noise in the cell of one channel [dB], for `Directions.covariance` and `is_resolved`.
    range : (detection,) array_like, optional
        Distance from the centre of the array [m] for a spherical wave. None, NaN: a plane wave, which errs by 0.4
        degrees at 0.3 m with a BGT60.
    channel_phase : (channel,) array_like, optional
        Phase errors of the channels to subtract [rad], such as line lengths, measured on a target in front. Default:
        multiply the channels by `Radar.channel_corrections`.

    Returns
    -------
    directions : Directions

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the radar, and for other values than numbers.

    Warns
    -----
    UserWarning
        For an array that is ambiguous within the field of view of its antennas.

    See Also
    --------
    processing.steering_weights : Phases of a direction.
    range_angle : Power over angles.
    detect : Detections with their directions.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> toward = rc.processing.steering_weights(radar.virtual_array, radar.waveform.wavelength, np.deg2rad(20.0)).conj()
    >>> np.rad2deg(rc.directions([toward], radar).azimuth).round(3).tolist()
    [20.0]
    """
    # Check all arguments before any work.
    check.instance("radar", radar, Radar)
    values = _snapshots(snapshots, radar.num_channels)
    number = len(values)
    speeds, levels = _per_detection("velocity", velocity, number), _per_detection("snr_db", snr_db, number)
    distances = _per_detection("range", range, number)
    snr = None if levels is None else 10.0 ** (0.1 * levels)
    return waves_of(values, radar, speeds, snr, distances, channel_phase=channel_phase).directions


def require_two_directions(radar: Radar, max_directions: int) -> None:
    """Raise ValueError for more than two directions per cell, or for two if the array cannot separate them."""
    if max_directions > 2:
        raise ValueError(f"max_directions: expected 1 or 2, got {max_directions}")
    array = array_of(radar)
    if not array.separates_waves:
        raise ValueError(
            f"max_directions: expected 1 with a radar of fewer than {PLACES_OF_TWO} channels at different places along "
            f"y and along z, got {max_directions}; places: {array.num_places[0]} along y, {array.num_places[1]} along z"
        )


class Waves(NamedTuple):
    """Directions of waves: one wave per snapshot, then the second waves of some snapshots."""

    directions: Directions
    snapshot: NDArray[np.intp] | None = None
    """Of every wave; None: one wave per snapshot."""
    share: _Reals | None = None
    """Part of the snapshot's power, likewise."""


def waves_of(
    values: _Complexes,
    radar: Radar,
    velocity: _Reals | None,
    snr: _Reals | None,
    distance: _Reals | None,
    *,
    channel_phase: ArrayLike | None = None,
    max_directions: int = 1,
) -> Waves:
    """`directions` of snapshots (detection, channel) without checks, up to two per snapshot."""
    array = array_of(radar)
    size = np.abs(values).max(axis=1, initial=0.0)
    is_known = (size > 0.0) & (size < np.inf)
    num_known = np.count_nonzero(is_known)  # of a few numbers, quicker than `any` and `all`
    if num_known == 0 or not any(array.observable):
        nothing = np.full((len(values), 3, 2), np.nan)
        return Waves(_directions(array, nothing[:, 0], nothing[:, 1:], np.ones(len(values), dtype=bool)))
    if not (all_known := num_known == len(values)):
        values, size = np.where(is_known[:, None], values, 1.0), np.where(is_known, size, 1.0)
    if array.ambiguous_beyond < array.half_view:
        spacing, limit = (0.5 / np.sin(angle) for angle in (array.ambiguous_beyond, array.half_view))
        notice.warn(
            f"radar: expected a channel spacing below {limit:.3g} wavelengths for antennas that see "
            f"{np.rad2deg(array.half_view):.0f} deg to each side, got {spacing:.3g}: directions are ambiguous beyond "
            f"{np.rad2deg(array.ambiguous_beyond):.0f} deg from the front"
        )

    # Correct phases that do not depend on direction.
    waves = values / size[:, None] * channel_corrections(radar, velocity, channel_phase)

    # Closed form if one direction aligns the phases of all channels; otherwise, or beyond the horizon, by search.
    sines = aligned(waves, array)
    is_lost = ~(np.vecdot(sines, sines) <= 1.0)
    if np.count_nonzero(is_lost):
        sines[is_lost] = searched(waves[is_lost], array)

    # Waves of near targets are spherical.
    sines, missing = _core.fit_spheres(
        waves,
        sines,
        np.full(len(waves), np.inf) if distance is None else np.ascontiguousarray(distance),
        array.antennas,
        array.channels,
        num_receivers=array.num_rx,
        wavenumber=array.wavenumber,
        observable=array.observable,
    )
    if not all_known:
        sines[~is_known] = np.nan
    if snr is None:
        nothing = np.full((len(values), 2, 2), np.nan)
        return Waves(_directions(array, sines, nothing, np.ones(len(values), dtype=bool)))

    # Residual power of one wave, relative to the noise, and its significance.
    power = len(array.x) * (snr + 1.0)
    residual = missing * power
    is_over_noise = is_known & _exceeds_noise(residual, array, 1)
    is_several = is_over_noise & (residual > _UNEQUAL * power)
    variance = 0.5 / snr
    if np.count_nonzero(is_several):
        variance[is_several] *= _interference(residual[is_several], array, 1)
    inverse = array.inverse_information(array.slopes(sines)) if array.x.any() else array.plane_inverse
    covariance = inverse * variance[:, None, None]
    if not all_known:
        covariance[~is_known] = np.nan
    (several,) = is_over_noise.nonzero()
    if not (len(several) and array.separates_waves):
        return Waves(_directions(array, sines, covariance, ~is_several))

    # Two waves if they explain significantly more, by the likelihood ratio at the same noise.
    power, residual, plane = power[several], residual[several], waves[several]
    noise = np.square(np.abs(plane)).sum(axis=1) / power
    if distance is not None:
        far = distance[several]
        plane = plane * np.exp(-1j * array.curvature(sines[several], np.where(np.isfinite(far), far, _FAR)))
    pairs = pairs_of(plane, array, sines[several])
    unexplained = pairs.residual / noise
    explained, unequal = residual - unexplained, _UNEQUAL * power
    is_better = explained > np.log(len(array.x) / _CHANCE)
    is_pair = is_better & (explained > unequal)
    is_more = _exceeds_noise(unexplained, array, 2)
    variance = noise * np.where(is_more, _interference(unexplained, array, 2), 1.0)
    of_pairs = pairs.covariance * variance[:, None, None, None]

    # Two waves or unequal receivers: keep the direction of one wave, and cover its distance from the pair's.
    is_either = is_better & ~is_pair & ~_exceeds_noise(unexplained, array, 2, _RARELY)
    bias = (pairs.sines[:, 0] - sines[several])[is_either]
    covariance[several[is_either]] = of_pairs[is_either, 0] + bias[:, :, None] * bias[:, None]
    which = several[is_pair]
    sines[which], covariance[which] = pairs.sines[is_pair, 0], of_pairs[is_pair, 0]
    if max_directions == 1:
        return Waves(_directions(array, sines, covariance, ~is_several))
    is_more = (is_more & (unexplained > unequal))[is_pair]
    is_several[which] = is_more
    seen = _directions(
        array,
        np.concatenate([sines, pairs.sines[is_pair, 1]]),
        np.concatenate([covariance, of_pairs[is_pair, 1]]),
        ~np.concatenate([is_several, is_more]),
    )
    share = pairs.power[is_pair] / pairs.power[is_pair].sum(axis=1, keepdims=True)
    shares = np.concatenate([np.ones(len(values)), share[:, 1]])
    shares[which] = share[:, 0]
    return Waves(seen, np.concatenate([np.arange(len(values)), which]), shares)


def _directions(array: Array, sines: _Reals, covariance: _Reals, is_resolved: NDArray[np.bool_]) -> Directions:
    """Directions from sines of waves (wave, 2) and their covariance (wave, 2, 2)."""
    # All others with the same phases, by their angle from the front.
    others = sines[:, None] + array.ambiguities[1:]
    square = np.vecdot(others, others)
    is_front = square <= 1.0
    alternatives = np.full(others.shape, np.nan)
    if np.count_nonzero(is_front):
        others[~is_front] = np.nan
        order = np.where(is_front, square, np.inf).argsort(axis=1)
        others = np.take_along_axis(others, order[..., None], axis=1)
        alternatives = np.stack(_angles(array, others, array.forward(others)), axis=-1)

    # Derivatives of angles by sines: u_x = cos(el) cos(az) forward, u_y = cos(el) sin(az), u_z = sin(el).
    (y, z), forward = sines.T, array.forward(sines)
    square = np.maximum(1.0 - z * z, _TINY)  # cos(el)^2
    by_sines = np.zeros((len(sines), 2, 2))
    by_sines[:, 0, 0] = by_y = 1.0 / np.maximum(forward, _TINY)
    by_sines[:, 0, 1] = by_y * y * z / square
    by_sines[:, 1, 1] = 1.0 / np.sqrt(square)
    of_angles: _Reals = by_sines @ covariance @ by_sines.mT
    for axis, is_observable in enumerate(array.observable):
        if not is_observable:
            of_angles[:, axis] = of_angles[:, :, axis] = np.nan
    return Directions(*_angles(array, sines, forward), of_angles, is_resolved, array.ambiguous_beyond, alternatives)


def _angles(array: Array, sines: _Reals, forward: _Reals) -> tuple[_Reals, _Reals]:
    """Azimuth and elevation of sines (..., 2), NaN for unobservable ones."""
    y, z = sines[..., 0], sines[..., 1]
    azimuth = np.arctan2(y, forward) if array.observable[0] else np.full(y.shape, np.nan)
    elevation = np.arcsin(np.minimum(np.maximum(z, -1.0), 1.0)) if array.observable[1] else np.full(z.shape, np.nan)
    return azimuth, elevation


def _interference(residual: _Reals, array: Array, num_waves: int) -> _Reals:
    """Noise power [noise of a channel] that leaves a larger residual with the probability 3/4; at least 1."""
    return np.maximum(residual / _residual_quantile(array.num_freedoms(num_waves), _LOW_RESIDUAL), 1.0)


def _exceeds_noise(residual: _Reals, array: Array, num_waves: int, chance: float = _CHANCE) -> NDArray[np.bool_]:
    """True where noise leaves a smaller residual [noise of a channel] with the probability 1 - chance."""
    return residual > _residual_quantile(array.num_freedoms(num_waves), 1.0 - chance)


@lru_cache(maxsize=16)
def _residual_quantile(num_freedoms: int, probability: float) -> float:
    """Quantile of the power of unit complex noise with `num_freedoms` real degrees of freedom."""
    from scipy.special import gammaincinv  # here: importing radarcore imports numpy and nothing heavier

    return float(gammaincinv(0.5 * num_freedoms, probability))


def _snapshots(values: ArrayLike, num_channels: int) -> _Complexes:
    return check.complex_numbers("snapshots", values, (None, num_channels))


def _per_detection(name: str, values: ArrayLike | None, number: int) -> _Reals | None:
    """One number per detection, NaN allowed."""
    return None if values is None else check.numbers(name, values, (number,))
