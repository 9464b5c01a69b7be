"""Best fit of a plane wave to the channels of a cell: phases of an array, and the search of the direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from radarcore.products import product
from radarcore.radar.radar import Radar

_SHORTEST_EXTENT = 1e-3
"""Smallest extent of an array that measures an angle [wavelengths]; below, phases are fractions of a degree."""

_CELLS_PER_LOBE = 4
"""Grid points per ``wavelength / extent``: the highest lies within an eighth of a lobe from the peak, where power is
concave."""

_FINER = 4
"""Factor of more grid points for an array with an extent along x: its lobes are narrow in sines far from the front."""

_NUM_STEPS = 10
"""Largest number of scoring steps from the grid, which errs by at most an eighth of a lobe; four are usual."""

_SMALL_STEP = 1e-8
"""Iteration stops after a step below this [grid points]."""

_AMBIGUOUS = 0.99
"""Power of a grating lobe over the main lobe; above it, noise decides between them."""

PLACES_OF_TWO = 4
"""Least number of channels at different places along an axis for a test of two waves by the residual."""

_BLOCK = 2**20
"""Elements of the largest intermediate array, 16 MB."""

_Reals = NDArray[np.float64]
_Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Array:
    """Positions in units of phase per sine: a wave with sines (u_y, u_z) has the phase ``-(x u_x + y u_y + z u_z)``."""

    x: _Reals  # (channel,) [rad]
    across: _Reals  # (channel, 2), along y and z; zero along unobservable axes
    observable: tuple[bool, bool]
    antennas: _Reals
    """Transmitters, if each has its own channels, and receivers, (antenna, 3), from the array's centre [m]."""
    num_rx: int
    wavenumber: float
    """[rad/m]."""
    half_view: float
    """Half of the wider view of the antennas in the planes with observable directions [rad]."""

    @cached_property
    def channels(self) -> _Reals:
        """Positions in units of phase along x, y and z, (channel, 3)."""
        return np.column_stack([self.x, self.across])

    @cached_property
    def ambiguities(self) -> _Reals:
        """See `_ambiguities`."""
        return _ambiguities(self)

    @cached_property
    def ambiguous_beyond(self) -> float:
        """Half of the smallest difference of sines with the same phases, as an angle from the front [rad]."""
        difference = np.linalg.norm(self.ambiguities[1:], axis=1).min(initial=2.0)
        return float(np.arcsin(min(0.5 * difference, 1.0)))

    def num_freedoms(self, num_waves: int) -> int:
        """Real degrees of freedom of the residual: amplitude, phase and direction of every wave are fitted."""
        return 2 * len(self.x) - num_waves * (2 + sum(self.observable))

    @cached_property
    def num_places(self) -> tuple[int, int]:
        """Number of different places of channels along y and z, 1 along unobservable axes."""
        places = np.round(self.across / (2.0 * np.pi * _SHORTEST_EXTENT))
        return len(np.unique(places[:, 0])), len(np.unique(places[:, 1]))

    @cached_property
    def separates_waves(self) -> bool:
        """True with four places along an axis: channels at three places fit any two waves."""
        return max(self.num_places) >= PLACES_OF_TWO

    @cached_property
    def step(self) -> _Reals:
        """Distance of grid points in both sines, (2,)."""
        extent = np.ptp(self.across, axis=0) / (2.0 * np.pi)
        cells_per_lobe = _CELLS_PER_LOBE * (_FINER if self.x.any() else 1)
        step: _Reals = 1.0 / (cells_per_lobe * np.maximum(extent, 1.0))
        return step

    def grid(self, largest: float) -> _Reals:
        """Sines up to `largest` in length, (cell, 2); zero along an unobservable axis."""
        axes = [
            np.linspace(-largest, largest, 2 * int(np.ceil(largest / step)) + 1) if observable else np.zeros(1)
            for observable, step in zip(self.observable, self.step, strict=True)
        ]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        kept: _Reals = cells[np.square(cells).sum(axis=1) <= largest**2 * (1.0 + 1e-9)]
        return kept

    @cached_property
    def front(self) -> _Reals:
        """Search grid.

        It extends past the horizon: a target near the horizon may have its highest grid point on the other side.
        """
        return self.grid(1.0 if self.x.any() else 1.0 + float(self.step.max()))

    @cached_property
    def aligning(self) -> tuple[_Reals, _Reals] | None:
        """Matrix from phases relative to the first channel to sines (channel - 1, 2), and shifts by whole turns.

        For a flat array with one channel more than observable sines: one direction then aligns the phases of all
        channels, which gives the largest possible power. None for other arrays.
        """
        axes = np.flatnonzero(self.observable)
        if self.x.any() or len(axes) == 0 or len(self.across) != len(axes) + 1:
            return None
        undone = np.zeros((len(axes), 2))
        undone[:, axes] = -np.linalg.inv(self.across[1:, axes] - self.across[0, axes]).T
        # All shifts from within half a turn in every channel to a direction, with a small margin.
        reach = 1.01 + float(np.pi * np.linalg.norm(undone, axis=1).sum())
        most = np.ceil(reach * np.linalg.norm(np.diff(self.across, axis=0), axis=1).sum() / (2.0 * np.pi))
        turns = np.stack(np.meshgrid(*len(axes) * [np.arange(-most, most + 1)]), axis=-1).reshape(-1, len(axes))
        shifts = 2.0 * np.pi * turns @ undone
        return undone, shifts[np.square(shifts).sum(axis=1) <= reach**2]

    def forward(self, sines: _Reals) -> _Reals:
        """Component of the direction along x."""
        y, z = sines[..., 0], sines[..., 1]
        forward: _Reals = np.sqrt(np.maximum(1.0 - y * y - z * z, 0.0))
        return forward

    def phases(self, sines: _Reals) -> _Reals:
        """Phases that compensate the phases of a wave, (..., channel)."""
        phases: _Reals = product(sines, self.across.T)
        return phases + self.forward(sines)[..., None] * self.x if self.x.any() else phases

    def curvature(self, sines: _Reals, distance: _Reals) -> _Reals:
        """Phases of spherical waves from `distance` (cell,) [m] minus plane waves of equal sines, (cell, channel)."""
        toward = np.column_stack([self.forward(sines), sines])
        farther = np.linalg.norm(distance[:, None, None] * toward[:, None] - self.antennas, axis=2) - distance[:, None]
        of_tx, of_rx = farther[:, : -self.num_rx], farther[:, -self.num_rx :]
        paths = (of_tx[:, :, None] + of_rx[:, None]).reshape(len(sines), -1) if of_tx.shape[1] else of_rx
        curvature: _Reals = self.wavenumber * paths + self.phases(sines)
        return curvature

    def slopes(self, sines: _Reals) -> _Reals:
        """Derivatives of the phases by both sines about their mean, (..., channel, 2); of a flat array (channel, 2)."""
        if not self.x.any():
            return self.across
        tangent = sines / np.maximum(self.forward(sines), 1e-3)[..., None]  # finite at the rim
        slopes = (self.across - self.x[:, None] * tangent[..., None, :]) * np.array(self.observable)
        about_mean: _Reals = slopes - slopes.mean(axis=-2, keepdims=True)
        return about_mean

    @cached_property
    def plane_inverse(self) -> _Reals:
        """`inverse_information` of a flat array."""
        return self.inverse_information(self.across)

    def inverse_information(self, slopes: _Reals) -> _Reals:
        """Covariance of both sines times twice the SNR, ([...,] 2, 2), from `slopes`; 1 for an unobservable sine."""
        information = slopes.mT @ slopes + np.diag(~np.array(self.observable))
        return np.asarray(np.linalg.inv(information), dtype=np.float64)


@lru_cache(maxsize=16)
def array_of(radar: Radar) -> Array:
    """Array of a radar's channels."""
    positions = radar.virtual_array / radar.waveform.wavelength
    along, across = (
        2.0 * np.pi * (positions[:, 0] - positions[:, 0].mean()),
        positions[:, 1:] - positions[:, 1:].mean(0),
    )
    observable = np.ptp(across, axis=0) > _SHORTEST_EXTENT
    if observable.all() and np.linalg.svd(across, compute_uv=False)[-1] <= _SHORTEST_EXTENT:
        observable[:] = False
    antennas = np.concatenate([radar.tx if len(radar.rx) < radar.num_channels else radar.tx[:0], radar.rx])
    return Array(
        along,
        2.0 * np.pi * across * observable,
        (bool(observable[0]), bool(observable[1])),
        antennas - radar.array_center,
        len(radar.rx),
        2.0 * np.pi / radar.waveform.wavelength,
        0.5 * float(np.deg2rad(np.array(radar.field_of_view_deg)[observable].max(initial=0.0))),
    )


def aligned(waves: _Complexes, array: Array) -> _Reals:
    """Sines nearest to the front that align the phases of all channels, (detection, 2); NaN where there are none."""
    if array.aligning is None:
        return np.full((len(waves), 2), np.nan)
    undone, shifts = array.aligning
    over_first = waves[:, 1:] * waves[:, :1].conj()
    sines = nearest_to_front(np.arctan2(over_first.imag, over_first.real) @ undone, shifts)
    if np.count_nonzero(over_first) < over_first.size:
        sines[(over_first == 0.0).any(axis=1)] = np.nan  # a channel without power has no phase
    return sines


def searched(waves: _Complexes, array: Array) -> _Reals:
    """Sines of the highest peak, from the highest grid point; of equally high peaks, the nearest to the front."""
    sines = _refined(waves, array, _highest(waves, array))
    sines = within(nearest_to_front(sines, array.ambiguities), 1.0)
    return _refined(waves, array, sines, largest=1.0)


def blocks_of(array: Array, num_waves: int) -> Iterator[tuple[_Reals, _Complexes]]:
    """Blocks of the front grid, (cell, 2), and the factors that compensate phases of waves from there, (channel, cell).

    The block size keeps the powers of `num_waves` waves in all directions of a block in memory.
    """
    size = max(1, _BLOCK // max(num_waves, len(array.x)))
    for k in range(0, len(array.front), size):
        cells = array.front[k : k + size]
        yield cells, np.exp(1j * array.phases(cells)).T


def _highest(waves: _Complexes, array: Array) -> _Reals:
    """Grid sines of the largest power, (detection, 2)."""
    highest, largest = np.zeros((len(waves), 2)), np.full(len(waves), -1.0)
    for cells, undone in blocks_of(array, len(waves)):
        power = np.abs(product(waves, undone))
        best = power.argmax(axis=1)
        level = power[np.arange(len(waves)), best]
        higher = level > largest
        highest[higher], largest[higher] = cells[best[higher]], level[higher]
    return highest


def _refined(waves: _Complexes, array: Array, sines: _Reals, *, largest: float = np.inf) -> _Reals:
    """Sines of the power's peak by Fisher's scoring from nearby sines, (detection, 2), at most `largest` in length."""
    for _ in range(_NUM_STEPS):
        # Power |b|^2; b is the sum of the channels after phase compensation.
        terms = waves * np.exp(1j * array.phases(sines))
        total = terms.sum(axis=1, keepdims=True)
        slopes = array.slopes(sines)
        score = (terms * total.conj()).imag[:, None] @ slopes  # (detection, 1, 2)
        power = np.maximum(np.square(np.abs(total)), 1e-300)
        step = -(score @ array.inverse_information(slopes))[:, 0] * len(array.x) / power
        step = np.minimum(np.maximum(step, -array.step), array.step)
        sines = within(sines + step, largest)
        if not (np.abs(step) > _SMALL_STEP * array.step).any():
            break
    return sines


def within(sines: _Reals, largest: float) -> _Reals:
    """Sines (..., 2) shortened to at most `largest`."""
    lengths = np.sqrt(np.square(sines).sum(axis=-1, keepdims=True))
    shortened: _Reals = sines * np.minimum(1.0, largest / np.maximum(lengths, 1e-300))
    return shortened


def _ambiguities(array: Array) -> _Reals:
    """Differences of sines that give the same phases in all channels, (difference, 2), zero first.

    Only for flat arrays; with an extent along x, different directions never have exactly the same phases.
    """
    none = np.zeros((1, 2))
    if array.x.any() or not any(array.observable):
        return none
    grid = array.grid(2.0)
    num_channels = len(array.across)
    block = max(1, _BLOCK // num_channels)
    blocks = (grid[k : k + block] for k in range(0, len(grid), block))
    near = np.concatenate([cells[_common_power(array, cells) >= 0.7] for cells in blocks])
    peaks = _refined(np.ones((len(near), num_channels), np.complex128), array, near)
    peaks = peaks[(_common_power(array, peaks) >= _AMBIGUOUS) & (np.abs(peaks) > array.step).any(axis=1)]
    return np.concatenate([none, np.unique(np.round(peaks, 9), axis=0)])


def _common_power(array: Array, differences: _Reals) -> _Reals:
    """Power of a beam at a difference of sines, relative to its middle, (difference,)."""
    power: _Reals = np.abs(np.exp(1j * array.phases(differences)).mean(axis=-1)) ** 2
    return power


def nearest_to_front(sines: _Reals, ambiguities: _Reals) -> _Reals:
    """Direction nearest to the front among all directions with the same phases, (..., 2)."""
    candidates = sines[..., None, :] + ambiguities
    which = np.vecdot(candidates, candidates).argmin(axis=-1)
    nearest: _Reals = sines + ambiguities[which]
    return nearest
