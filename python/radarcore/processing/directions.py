"""Directions of detections: the single plane wave that fits the channels of a range-Doppler cell best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.processing.steering import channel_corrections
from radarcore.radar.radar import Radar

_SHORTEST_EXTENT = 1e-3
"""Extent of an array [wavelengths] below which it tells no angle: fractions of a degree of phase."""

_CELLS_PER_LOBE = 4
"""Grid points per ``wavelength / extent``: the highest is within an eighth of the peak, where power is concave."""

_FINER = 4
"""Times as many for an array with an extent along x, whose lobes are narrow in sines far from the front."""

_NUM_STEPS = 4
"""Newton steps from the grid, an eighth of a lobe off at most: errors of 1e-8 of a lobe and then of rounding."""

_AMBIGUOUS = 0.99
"""Power of a grating lobe over that of the main lobe above which noise decides between them."""

_BLOCK = 2**20
"""Numbers of an array worked on at a time, 16 MB."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Directions:
    """Directions of detections; NaN for what the array cannot tell.

    Attributes
    ----------
    azimuth, elevation : (detection,) float64
        Angles [rad], positive to the left and up.
    covariance : (detection, 2, 2) float64
        Of azimuth and elevation [rad^2]: the least that noise allows (Cramer-Rao); NaN without an SNR.
    """

    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.azimuth)


def directions(
    snapshots: ArrayLike,
    radar: Radar,
    *,
    velocity: ArrayLike | None = None,
    snr_db: ArrayLike | None = None,
    channel_phase: ArrayLike | None = None,
) -> Directions:
    """Direction of the strongest plane wave in the channels of every detection.

    The maximum of ``abs(a^H s)`` over directions to the front, a the steering vector of `Radar.virtual_array` and s
    the snapshot: the estimate of maximum likelihood for one target in white noise. An array without an extent along y
    tells no azimuth, one without an extent along z no elevation, and its targets count as being at elevation 0
    (azimuth 0). An array along an oblique line tells neither. Where antennas are so far apart that several directions
    give the same phases (above half a wavelength between channels), the one nearest to the front is taken. With an
    array that is not flat (an extent along x), directions more than 70 degrees from the front may be missed.

    Parameters
    ----------
    snapshots : (detection, channel) array_like of complex
        Cells of ``range_doppler(...)``, all channels; NaN where they are NaN, infinite or zero.
    radar : Radar
    velocity : (detection,) array_like, optional
        Range rate [m/s], receding positive. In time-division multiplex a moving target turns the phase of channels
        whose chirps come later (`Radar.channel_offsets`); that is taken off. None, NaN: nothing is taken off.
    snr_db : (detection,) array_like, optional
        Power over the noise in the cell of one channel [dB], for `Directions.covariance`.
    channel_phase : (channel,) array_like, optional
        Phases of the channels [rad] (lines of different length, as measured on a target in front), to be taken off.
        Default: those of the receiver, `Radar.channel_phases`.

    Returns
    -------
    directions : Directions

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the radar, and for what are no numbers.
    """
    # Check all arguments before any work.
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
    values = _snapshots(snapshots, radar.num_channels)
    number = len(values)
    speeds, levels = _per_detection("velocity", velocity, number), _per_detection("snr_db", snr_db, number)
    corrections = channel_corrections(radar, speeds, channel_phase)

    # Take off what is not direction; what has no direction stays NaN.
    azimuth, elevation = np.full(number, np.nan), np.full(number, np.nan)
    covariance = np.full((number, 2, 2), np.nan)
    array, ambiguities = _array(radar)
    size = np.abs(values).max(axis=1, initial=0.0)
    known = np.isfinite(size) & (size > 0.0)
    if not known.any() or not any(array.told):
        return Directions(azimuth, elevation, covariance)
    waves = values[known] / size[known, None] * (corrections if corrections.ndim == 1 else corrections[known])

    # The highest point of a grid, its peak, and the peak of the same height that is nearest to the front. The grid
    # reaches beyond the horizon: what is near to it on one side may have its highest grid point on the other.
    grid = array.grid(1.0 if array.x.any() else 1.0 + float(array.step.max()))
    sines = _refined(waves, array, _highest(waves, array, grid))
    sines = _nearest_to_front(sines, ambiguities)
    sines = _refined(waves, array, _within(sines, 1.0), largest=1.0, num_steps=3)

    # Angles, and how sure they are.
    el = np.arcsin(np.clip(sines[:, 1], -1.0, 1.0))
    az = np.arctan2(sines[:, 0], array.forward(sines))
    if array.told[0]:
        azimuth[known] = az
    if array.told[1]:
        elevation[known] = el
    if levels is not None:
        covariance[known] = _least_covariance(array, sines, az, el, 10.0 ** (0.1 * levels[known]))
    return Directions(azimuth, elevation, covariance)


def _snapshots(values: ArrayLike, num_channels: int) -> _Complexes:
    try:
        snapshots = np.asarray(values, dtype=np.complex128)
    except (TypeError, ValueError) as error:
        raise TypeError(f"snapshots: expected numbers (n, {num_channels}), got {type(values).__name__}") from error
    if snapshots.ndim != 2 or snapshots.shape[1] != num_channels:
        raise ValueError(f"snapshots: expected shape (n, {num_channels}), got {snapshots.shape}")
    return snapshots


def _per_detection(name: str, values: ArrayLike | None, number: int) -> _Reals | None:
    """One number per detection, NaN among them."""
    if values is None:
        return None
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected numbers of shape ({number},), got {type(values).__name__}") from error
    if numbers.shape != (number,):
        raise ValueError(f"{name}: expected shape ({number},), got {numbers.shape}")
    return numbers


@dataclass(frozen=True, eq=False)
class _Array:
    """Positions in phase per sine: a wave with sines (u_y, u_z) has the phase ``-(x u_x + y u_y + z u_z)``."""

    x: _Reals  # (channel,) [rad]
    across: _Reals  # (channel, 2), along y and z; zero where nothing is told
    told: tuple[bool, bool]

    @cached_property
    def step(self) -> _Reals:
        """Distance of grid points in both sines, (2,)."""
        extent = np.ptp(self.across, axis=0) / (2.0 * np.pi)
        cells_per_lobe = _CELLS_PER_LOBE * (_FINER if self.x.any() else 1)
        step: _Reals = 1.0 / (cells_per_lobe * np.maximum(extent, 1.0))
        return step

    def grid(self, largest: float) -> _Reals:
        """Sines up to `largest` in length, (cell, 2); zero along an axis that is not told."""
        axes = [
            np.linspace(-largest, largest, 2 * int(np.ceil(largest / step)) + 1) if told else np.zeros(1)
            for told, step in zip(self.told, self.step, strict=True)
        ]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        kept: _Reals = cells[np.square(cells).sum(axis=1) <= largest**2 * (1.0 + 1e-9)]
        return kept

    def forward(self, sines: _Reals) -> _Reals:
        """The direction's part along x."""
        forward: _Reals = np.sqrt(np.maximum(1.0 - np.square(sines).sum(axis=-1), 0.0))
        return forward

    def phases(self, sines: _Reals) -> _Reals:
        """Phases that undo those of a wave, (..., channel)."""
        phases: _Reals = sines @ self.across.T
        return phases + self.forward(sines)[..., None] * self.x if self.x.any() else phases

    def slopes(self, sines: _Reals) -> _Reals:
        """Derivatives of the phases by both sines, (..., channel, 2)."""
        if not self.x.any():
            return np.broadcast_to(self.across, (*sines.shape[:-1], *self.across.shape))
        tangent = sines / np.maximum(self.forward(sines), 1e-3)[..., None]  # steep at the rim, but a number
        slopes: _Reals = (self.across - self.x[:, None] * tangent[..., None, :]) * np.array(self.told)
        return slopes


@lru_cache(maxsize=16)
def _array(radar: Radar) -> tuple[_Array, _Reals]:
    """The channels of a radar, and `_ambiguities`."""
    positions = radar.virtual_array / radar.waveform.wavelength
    along, across = (
        2.0 * np.pi * (positions[:, 0] - positions[:, 0].mean()),
        positions[:, 1:] - positions[:, 1:].mean(0),
    )
    told = np.ptp(across, axis=0) > _SHORTEST_EXTENT
    if told.all() and np.linalg.svd(across, compute_uv=False)[-1] <= _SHORTEST_EXTENT:
        told[:] = False
    array = _Array(along, 2.0 * np.pi * across * told, (bool(told[0]), bool(told[1])))
    return array, _ambiguities(array)


def _highest(waves: _Complexes, array: _Array, grid: _Reals) -> _Reals:
    """The grid's sines of most power, (detection, 2)."""
    highest, largest = np.zeros((len(waves), 2)), np.full(len(waves), -1.0)
    block = max(1, _BLOCK // max(waves.shape))
    for k in range(0, len(grid), block):
        cells = grid[k : k + block]
        power = np.abs(waves @ np.exp(1j * array.phases(cells)).T)
        best = power.argmax(axis=1)
        level = power[np.arange(len(waves)), best]
        higher = level > largest
        highest[higher], largest[higher] = cells[best[higher]], level[higher]
    return highest


def _refined(
    waves: _Complexes, array: _Array, sines: _Reals, *, largest: float = np.inf, num_steps: int = _NUM_STEPS
) -> _Reals:
    """Sines of the peak of power by Newton's method from nearby, (detection, 2), at most `largest` in length."""
    told = np.array(array.told)
    for _ in range(num_steps):
        # Power |b|^2 and its derivatives; b is the sum of the channels with the wave's phases undone.
        slopes = array.slopes(sines)
        terms = waves * np.exp(1j * array.phases(sines))
        total = terms.sum(axis=1).conj()
        first = np.einsum("nc,nci->ni", terms, slopes)
        second = np.einsum("nc,nci,ncj->nij", terms, slopes, slopes)
        gradient = -(total[:, None] * first).imag
        curvature = (first[:, :, None] * first[:, None].conj() - total[:, None, None] * second).real
        # Uphill also where power is not concave: shift the larger eigenvalue below zero.
        half, difference = 0.5 * np.trace(curvature, axis1=1, axis2=2), curvature[:, 0, 0] - curvature[:, 1, 1]
        larger = half + np.hypot(0.5 * difference, curvature[:, 0, 1])
        shift = np.where(told.all(), np.maximum(larger, 0.0), np.maximum(2.0 * half, 0.0))
        damped = curvature - (1.5 * shift[:, None, None]) * np.eye(2)
        damped[:, ~told, ~told] = -1.0
        step = -_solved(damped, gradient)
        sines = _within(sines + np.clip(step, -array.step, array.step), largest)
    return sines


def _within(sines: _Reals, largest: float) -> _Reals:
    """Sines shortened to at most `largest`."""
    lengths = np.sqrt(np.square(sines).sum(axis=1))
    within: _Reals = sines * np.minimum(1.0, largest / np.maximum(lengths, 1e-300))[:, None]
    return within


def _solved(matrices: _Reals, vectors: _Reals) -> _Reals:
    """Solutions of systems of two equations, (n, 2, 2) and (n, 2); zero where there is none."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    determinant = a * d - b * c
    adjoint = np.stack([d * vectors[:, 0] - b * vectors[:, 1], a * vectors[:, 1] - c * vectors[:, 0]], axis=1)
    solved: _Reals = np.divide(
        adjoint, determinant[:, None], out=np.zeros_like(adjoint), where=determinant[:, None] != 0.0
    )
    return solved


def _ambiguities(array: _Array) -> _Reals:
    """Differences of sines that give the same phases in all channels, (difference, 2), zero first.

    Of arrays across x; with an extent along x, phases of different directions are never quite the same.
    """
    none = np.zeros((1, 2))
    if array.x.any() or not any(array.told):
        return none
    grid = array.grid(2.0)
    num_channels = len(array.across)
    block = max(1, _BLOCK // num_channels)
    blocks = (grid[k : k + block] for k in range(0, len(grid), block))
    near = np.concatenate([cells[_common_power(array, cells) >= 0.7] for cells in blocks])
    peaks = _refined(np.ones((len(near), num_channels), np.complex128), array, near)
    peaks = peaks[(_common_power(array, peaks) >= _AMBIGUOUS) & (np.abs(peaks) > array.step).any(axis=1)]
    return np.concatenate([none, np.unique(np.round(peaks, 9), axis=0)])


def _common_power(array: _Array, differences: _Reals) -> _Reals:
    """Power of a beam over that in its middle at such a difference of sines, (difference,)."""
    power: _Reals = np.abs(np.exp(1j * array.phases(differences)).mean(axis=-1)) ** 2
    return power


def _nearest_to_front(sines: _Reals, ambiguities: _Reals) -> _Reals:
    """Of the directions that give the same phases, the one nearest to the front."""
    candidates = sines[:, None] + ambiguities
    which = np.square(candidates).sum(axis=-1).argmin(axis=1)
    nearest: _Reals = candidates[np.arange(len(sines)), which]
    return nearest


def _least_covariance(array: _Array, sines: _Reals, az: _Reals, el: _Reals, snr: _Reals) -> _Reals:
    """Cramer-Rao bound of azimuth and elevation of one plane wave of unknown amplitude and phase in white noise.

    The Fisher information of the sines is ``2 snr`` times the sum over the channels of the squared slopes of the phase
    about their mean (Van Trees, Optimum Array Processing, 8.4).
    """
    told = np.array(array.told)
    slopes = array.slopes(sines)
    about_mean = slopes - slopes.mean(axis=1, keepdims=True)
    information = 2.0 * snr[:, None, None] * np.einsum("nci,ncj->nij", about_mean, about_mean)
    information[:, ~told, ~told] = 1.0
    unit = np.eye(2)
    of_sines = np.stack([_solved(information, np.broadcast_to(row, (len(snr), 2))) for row in unit], axis=1)
    # Angles by sines: u_y = cos(el) sin(az), u_z = sin(el).
    with np.errstate(divide="ignore", invalid="ignore"):
        to_angles = np.zeros((len(snr), 2, 2))
        to_angles[:, 0, 0] = 1.0 / (np.cos(az) * np.cos(el))
        to_angles[:, 0, 1] = np.tan(az) * np.tan(el) / np.cos(el)
        to_angles[:, 1, 1] = 1.0 / np.cos(el)
        covariance: _Reals = to_angles @ of_sines @ np.swapaxes(to_angles, 1, 2)
    covariance[:, ~told, :] = np.nan
    covariance[:, :, ~told] = np.nan
    return covariance
