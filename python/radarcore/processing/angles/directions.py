"""Directions of detections: the single plane wave that fits the channels of a range-Doppler cell best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.processing.angles.steering import channel_corrections
from radarcore.products import product
from radarcore.radar.radar import Radar

_SHORTEST_EXTENT = 1e-3
"""Extent of an array [wavelengths] below which it tells no angle: fractions of a degree of phase."""

_CELLS_PER_LOBE = 4
"""Grid points per ``wavelength / extent``: the highest is within an eighth of the peak, where power is concave."""

_FINER = 4
"""Times as many for an array with an extent along x, whose lobes are narrow in sines far from the front."""

_NUM_STEPS = 10
"""Most steps of scoring from the grid, an eighth of a lobe off at most; four are usual."""

_SMALL_STEP = 1e-8
"""Steps below this [grid points] are the last."""

_AMBIGUOUS = 0.99
"""Power of a grating lobe over that of the main lobe above which noise decides between them."""

_CHANCE = 1e-3
"""Largest probability that noise makes a single target appear as several."""

_UNEQUAL = 0.01
"""Share of the power that one wave may leave unexplained: receiver gains differ by some tenths of a dB."""

_BLOCK = 2**20
"""Numbers of an array worked on at a time, 16 MB."""

_TINY = 1e-16
"""Least cosine, or its square, at the horizon: about that of the number next to pi / 2."""

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
        Cramer-Rao bound of azimuth and elevation [rad^2]; NaN without an SNR. If `is_resolved` is False, the residual
        of the single wave counts as noise.
    is_resolved : (detection,) bool
        False if a single target does not explain the channels, as for two targets in one cell: the unexplained power
        exceeds the noise and 1 %. True without an SNR.
    ambiguous_beyond : float
        Angle from the front [rad]. A target beyond it has the same phases as a direction nearer to the front, which is
        returned. pi / 2 for an array without ambiguity.

    See Also
    --------
    directions : Makes them.

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
    the snapshot: the estimate of maximum likelihood for one target in white noise. An array without an extent along y
    tells no azimuth, one without an extent along z no elevation, and its targets count as being at elevation 0
    (azimuth 0). An array along an oblique line tells neither. Where antennas are so far apart that several directions
    give the same phases (above half a wavelength between channels), the one nearest to the front is taken, see
    `Directions.ambiguous_beyond`. With an
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
        Power over the noise in the cell of one channel [dB], for `Directions.covariance` and `is_resolved`.
    range : (detection,) array_like, optional
        Distance from the centre of the array [m] for a spherical wave. None, NaN: a plane wave, which errs by 0.4
        degrees at 0.3 m with a BGT60.
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

    Warns
    -----
    UserWarning
        For an array that is ambiguous within the field of view of its antennas.

    See Also
    --------
    steering_weights : Phases of a direction.
    range_angle : Power over angles.
    detect : Detections with their directions.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> toward = rc.steering_weights(radar.virtual_array, radar.waveform.wavelength, np.deg2rad(20.0)).conj()
    >>> np.rad2deg(rc.directions([toward], radar).azimuth).round(3).tolist()
    [20.0]
    """
    # Check all arguments before any work.
    check.instance("radar", radar, Radar)
    values = check.complex_numbers("snapshots", snapshots, (None, radar.num_channels))
    speeds, levels, distances = (
        None if given is None else check.numbers(name, given, (len(values),))  # NaN among them
        for name, given in (("velocity", velocity), ("snr_db", snr_db), ("range", range))
    )
    return waves_of(values, radar, speeds, None if levels is None else 10.0 ** (0.1 * levels), distances, channel_phase)


def waves_of(
    values: _Complexes,
    radar: Radar,
    velocity: _Reals | None,
    snr: _Reals | None,
    distance: _Reals | None,
    channel_phase: ArrayLike | None = None,
) -> Directions:
    """`directions` of snapshots (detection, channel) without checks."""
    number, array = len(values), _array(radar)
    azimuth, elevation = np.full((2, number), np.nan)
    covariance, is_resolved = np.full((number, 2, 2), np.nan), np.ones(number, dtype=bool)
    found = Directions(azimuth, elevation, covariance, is_resolved, array.ambiguous_beyond)
    size = np.abs(values).max(axis=1, initial=0.0)
    known = np.flatnonzero((size > 0.0) & (size < np.inf))
    if len(known) == 0 or not any(array.observable):
        return found
    if array.ambiguous_beyond < array.half_view:
        spacing, limit = (0.5 / np.sin(angle) for angle in (array.ambiguous_beyond, array.half_view))
        notice.warn(
            f"radar: expected a channel spacing below {limit:.3g} wavelengths for antennas that see "
            f"{np.rad2deg(array.half_view):.0f} deg to each side, got {spacing:.3g}: directions are ambiguous beyond "
            f"{np.rad2deg(array.ambiguous_beyond):.0f} deg from the front"
        )

    # Take off what is not direction.
    corrections = channel_corrections(radar, velocity, channel_phase)
    waves = values[known] / size[known, None] * (corrections if corrections.ndim == 1 else corrections[known])

    # In closed form where the phases of all channels can be undone at once; else, and beyond the horizon, by search.
    sines = _aligned(waves, array)
    lost = ~(np.vecdot(sines, sines) <= 1.0)
    if lost.any():
        sines[lost] = _searched(waves[lost], array)

    # Near targets have spherical waves.
    sines, missing = _core.fit_spheres(
        waves,
        np.ascontiguousarray(sines),
        np.full(len(waves), np.inf) if distance is None else np.ascontiguousarray(distance[known]),
        array.antennas,
        array.channels,
        num_receivers=array.num_rx,
        wavenumber=array.wavenumber,
        observable=array.observable,
    )

    # Angles, and how sure they are.
    if array.observable[0]:
        azimuth[known] = np.arctan2(sines[:, 0], array.forward(sines))
    if array.observable[1]:
        elevation[known] = np.arcsin(np.minimum(np.maximum(sines[:, 1], -1.0), 1.0))
    if snr is not None:
        # Unexplained power over the noise, if it is more than that.
        residual = missing * (len(array.x) * (snr[known] + 1.0))
        is_several = (residual > array.largest_residual) & (missing > _UNEQUAL)
        is_resolved[known] = ~is_several
        excess = np.where(is_several, residual / (0.5 * array.num_freedoms), 1.0)
        covariance[known] = _least_covariance(array, sines, snr[known] / excess)
    return found


@dataclass(frozen=True, eq=False)
class _Array:
    """Positions in phase per sine: a wave with sines (u_y, u_z) has the phase ``-(x u_x + y u_y + z u_z)``."""

    x: _Reals  # (channel,) [rad]
    across: _Reals  # (channel, 2), along y and z; zero along unobservable axes
    observable: tuple[bool, bool]
    antennas: _Reals
    """Transmitters, if they have channels of their own, and receivers, (antenna, 3), from the array's centre [m]."""
    num_rx: int
    wavenumber: float
    """[rad/m]."""
    half_view: float
    """Half of the wider view of the antennas in the planes with observable directions [rad]."""

    @cached_property
    def channels(self) -> _Reals:
        """Positions in phase along x, y and z, (channel, 3)."""
        return np.column_stack([self.x, self.across])

    @cached_property
    def ambiguities(self) -> _Reals:
        """Differences of sines that give the same phases in all channels, (difference, 2), zero first.

        Of arrays across x; with an extent along x, phases of different directions are never quite the same.
        """
        none = np.zeros((1, 2))
        if self.x.any() or not any(self.observable):
            return none
        grid, num_channels = self.grid(2.0), len(self.across)
        block = max(1, _BLOCK // num_channels)
        blocks = (grid[k : k + block] for k in range(0, len(grid), block))
        near = np.concatenate([cells[self.common_power(cells) >= 0.7] for cells in blocks])
        peaks = _refined(np.ones((len(near), num_channels), np.complex128), self, near)
        peaks = peaks[(self.common_power(peaks) >= _AMBIGUOUS) & (np.abs(peaks) > self.step).any(axis=1)]
        return np.concatenate([none, np.unique(np.round(peaks, 9), axis=0)])

    def common_power(self, differences: _Reals) -> _Reals:
        """Power of a beam over that in its middle at such a difference of sines, (difference,)."""
        power: _Reals = np.abs(np.exp(1j * self.phases(differences)).mean(axis=-1)) ** 2
        return power

    @cached_property
    def ambiguous_beyond(self) -> float:
        """Half of the smallest difference of sines with the same phases, as an angle from the front [rad]."""
        difference = np.linalg.norm(self.ambiguities[1:], axis=1).min(initial=2.0)
        return float(np.arcsin(min(0.5 * difference, 1.0)))

    @cached_property
    def largest_residual(self) -> float:
        """Largest residual of noise over the noise power of a channel."""
        from scipy.special import gammainccinv  # here: importing radarcore imports numpy and nothing heavier

        return float(gammainccinv(0.5 * self.num_freedoms, _CHANCE))

    @property
    def num_freedoms(self) -> int:
        """Real degrees of freedom of the residual: amplitude, phase and direction are fitted."""
        return 2 * len(self.x) - 2 - sum(self.observable)

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
        """The grid that is searched.

        It reaches beyond the horizon: what is near to that on one side may have its highest grid point on the other.
        """
        return self.grid(1.0 if self.x.any() else 1.0 + float(self.step.max()))

    @cached_property
    def aligning(self) -> tuple[_Reals, _Reals] | None:
        """Sines by the phases over the first channel (channel - 1, 2), and what differences of whole turns add to them.

        For a flat array with one channel more than it has observable sines: some direction then brings all channels in
        phase, which is the largest power possible. None for other arrays.
        """
        axes = np.flatnonzero(self.observable)
        if self.x.any() or len(axes) == 0 or len(self.across) != len(axes) + 1:
            return None
        undone = np.zeros((len(axes), 2))
        undone[:, axes] = -np.linalg.inv(self.across[1:, axes] - self.across[0, axes]).T
        # All that lead from within half a turn in every channel to a direction, by a little more than can be needed.
        reach = 1.01 + float(np.pi * np.linalg.norm(undone, axis=1).sum())
        most = np.ceil(reach * np.linalg.norm(np.diff(self.across, axis=0), axis=1).sum() / (2.0 * np.pi))
        turns = np.stack(np.meshgrid(*len(axes) * [np.arange(-most, most + 1)]), axis=-1).reshape(-1, len(axes))
        shifts = 2.0 * np.pi * turns @ undone
        return undone, shifts[np.square(shifts).sum(axis=1) <= reach**2]

    def forward(self, sines: _Reals) -> _Reals:
        """The direction's part along x."""
        y, z = sines[..., 0], sines[..., 1]
        forward: _Reals = np.sqrt(np.maximum(1.0 - y * y - z * z, 0.0))
        return forward

    def phases(self, sines: _Reals) -> _Reals:
        """Phases that undo those of a wave, (..., channel)."""
        phases: _Reals = product(sines, self.across.T)
        return phases + self.forward(sines)[..., None] * self.x if self.x.any() else phases

    def slopes(self, sines: _Reals) -> _Reals:
        """Derivatives of the phases by both sines about their mean, (..., channel, 2); of a flat array (channel, 2)."""
        if not self.x.any():
            return self.across
        tangent = sines / np.maximum(self.forward(sines), 1e-3)[..., None]  # steep at the rim, but a number
        slopes = (self.across - self.x[:, None] * tangent[..., None, :]) * np.array(self.observable)
        about_mean: _Reals = slopes - slopes.mean(axis=-2, keepdims=True)
        return about_mean

    def inverse_information(self, slopes: _Reals) -> _Reals:
        """Covariance of both sines times twice the SNR, ([...,] 2, 2), by `slopes`; 1 for an unobservable one."""
        information = slopes.mT @ slopes + np.diag(~np.array(self.observable))
        return np.asarray(np.linalg.inv(information), dtype=np.float64)


@lru_cache(maxsize=16)
def _array(radar: Radar) -> _Array:
    """The channels of a radar."""
    positions = radar.virtual_array / radar.waveform.wavelength
    positions -= positions.mean(axis=0)
    across = positions[:, 1:]
    observable = np.ptp(across, axis=0) > _SHORTEST_EXTENT
    if observable.all() and np.linalg.svd(across, compute_uv=False)[-1] <= _SHORTEST_EXTENT:
        observable[:] = False
    antennas = np.concatenate([radar.tx if len(radar.rx) < radar.num_channels else radar.tx[:0], radar.rx])
    return _Array(
        2.0 * np.pi * positions[:, 0],
        2.0 * np.pi * across * observable,
        (bool(observable[0]), bool(observable[1])),
        antennas - radar.array_center,
        len(radar.rx),
        2.0 * np.pi / radar.waveform.wavelength,
        0.5 * float(np.deg2rad(np.array(radar.field_of_view_deg)[observable].max(initial=0.0))),
    )


def _aligned(waves: _Complexes, array: _Array) -> _Reals:
    """Sines nearest to the front in which all channels add up in phase, (detection, 2); NaN where there are none."""
    if array.aligning is None:
        return np.full((len(waves), 2), np.nan)
    undone, shifts = array.aligning
    over_first = waves[:, 1:] * waves[:, :1].conj()
    sines = _nearest_to_front(np.arctan2(over_first.imag, over_first.real) @ undone, shifts)
    if not over_first.all():
        sines[(over_first == 0.0).any(axis=1)] = np.nan  # a channel without power tells nothing
    return sines


def _searched(waves: _Complexes, array: _Array) -> _Reals:
    """Sines of the highest point of a grid, of its peak, and of the equally high peak that is nearest to the front."""
    sines = _refined(waves, array, _highest(waves, array, array.front))
    sines = _within(_nearest_to_front(sines, array.ambiguities), 1.0)
    return _refined(waves, array, sines, largest=1.0)


def _highest(waves: _Complexes, array: _Array, grid: _Reals) -> _Reals:
    """The grid's sines of most power, (detection, 2)."""
    highest, largest = np.zeros((len(waves), 2)), np.full(len(waves), -1.0)
    block = max(1, _BLOCK // max(waves.shape))
    for k in range(0, len(grid), block):
        cells = grid[k : k + block]
        power = np.abs(product(waves, np.exp(1j * array.phases(cells)).T))
        best = power.argmax(axis=1)
        level = power[np.arange(len(waves)), best]
        higher = level > largest
        highest[higher], largest[higher] = cells[best[higher]], level[higher]
    return highest


def _refined(waves: _Complexes, array: _Array, sines: _Reals, *, largest: float = np.inf) -> _Reals:
    """Sines of the peak of power by Fisher's scoring from nearby, (detection, 2), at most `largest` in length."""
    for _ in range(_NUM_STEPS):
        # Power |b|^2; b is the sum of the channels with the wave's phases undone.
        terms = waves * np.exp(1j * array.phases(sines))
        total = terms.sum(axis=1, keepdims=True)
        slopes = array.slopes(sines)
        score = (terms * total.conj()).imag[:, None] @ slopes  # (detection, 1, 2)
        power = np.maximum(np.square(np.abs(total)), 1e-300)
        step = -(score @ array.inverse_information(slopes))[:, 0] * len(array.x) / power
        step = np.minimum(np.maximum(step, -array.step), array.step)
        sines = _within(sines + step, largest)
        if not (np.abs(step) > _SMALL_STEP * array.step).any():
            break
    return sines


def _within(sines: _Reals, largest: float) -> _Reals:
    """Sines shortened to at most `largest`."""
    lengths = np.sqrt(np.square(sines).sum(axis=1))
    within: _Reals = sines * np.minimum(1.0, largest / np.maximum(lengths, 1e-300))[:, None]
    return within


def _nearest_to_front(sines: _Reals, ambiguities: _Reals) -> _Reals:
    """Of the directions that give the same phases, the one nearest to the front."""
    candidates = sines[:, None] + ambiguities
    which = np.vecdot(candidates, candidates).argmin(axis=1)
    nearest: _Reals = sines + ambiguities[which]
    return nearest


def _least_covariance(array: _Array, sines: _Reals, snr: _Reals) -> _Reals:
    """Cramer-Rao bound of azimuth and elevation of one plane wave of unknown amplitude and phase in white noise.

    The Fisher information of the sines is ``2 snr`` times the sum over the channels of the squared slopes of the phase
    about their mean (Van Trees, Optimum Array Processing, 8.4).
    """
    # Angles by sines: u_x = cos(el) cos(az) forward, u_y = cos(el) sin(az), u_z = sin(el). At the horizon, steep.
    y, z = sines.T
    square = np.maximum(1.0 - z * z, _TINY)  # cos(el)^2
    by_sines = np.zeros((len(sines), 2, 2))
    by_sines[:, 0, 0] = 1.0 / np.maximum(array.forward(sines), _TINY)
    by_sines[:, 0, 1] = by_sines[:, 0, 0] * y * z / square
    by_sines[:, 1, 1] = 1.0 / np.sqrt(square)
    inverse = array.inverse_information(array.slopes(sines))
    covariance: _Reals = by_sines @ inverse @ by_sines.mT * (0.5 / snr)[:, None, None]
    unobservable = ~np.array(array.observable)
    covariance[:, unobservable] = covariance[:, :, unobservable] = np.nan
    return covariance
