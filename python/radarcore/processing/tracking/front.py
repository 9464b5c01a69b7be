"""Nearest point of a body, from the samples: echoes too weak or too near each other to be detections of their own.

Echoes are separated by orthogonal matching pursuit: the tone that explains most of the map about the track is added,
and all amplitudes are estimated again (Pati, Rezaiifar and Krishnaprasad, 1993). Then each tone is fitted again without
the others, as in RELAX (Li and Stoica, 1996). The nearest point follows by Bayes' rule on a grid of its lead, its
distance in front of the track: a hand or a foot may send no echo, and a weak echo in front may be noise.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.detection.bands import bands_of
from radarcore.processing.spectra.noise import median_of_unit_mean
from radarcore.processing.spectra.spectra import powers, range_doppler
from radarcore.processing.spectra.windows import window_weights
from radarcore.processing.tracking.cluster import wrapped
from radarcore.processing.tracking.kalman import Array
from radarcore.processing.tracking.tracks import TrackState
from radarcore.recording.frame import Frame

_BEFORE, _BEHIND = 9, 7
"""Columns of the map in front of a track and behind it."""

_FINENESS = 2, 4
"""Tones tried per row and per column."""

_MOST = 24
"""Most echoes of a body."""

_NUM_PASSES = 2
"""Fits of each tone without the others."""

_LEAST_SNR_DB = 8.5
"""Least level of an echo [dB]: of noise, one or two cells in a hundred maps have more."""

_RESIDUAL_DB, _RESIDUAL_CELLS = 13.0, 3.0
"""A tone this much weaker than another one within this number of cells may be a residual of its fit."""

_MERGED = 3.0, 1.2
"""Echoes within these numbers of rows and columns are one, at their mean weighted by power."""

_LIMB_SPEED = 3.3
"""Echoes of a body differ from its velocity by up to this [m/s]."""

_STATIC_SPEED, _STATIC_LEAD = 0.15, 0.4
"""Static echoes farther in front of a track [m] are of other things."""

_LEADS = 0.01 * np.arange(-20, 61)
"""Leads of the grid [m]. The numbers below fit ten simulated walks, of shapes and of meshes, other than the demo's."""

_MEAN, _DEVIATION = 0.15, 0.04
"""Lead of a body without echoes [m]."""

_STEP = 0.12
"""Standard deviation of the change of the lead from frame to frame [m]: a hand moves at 3 m/s and more."""

_SEEN = 0.5
"""Probability that the nearest point sends an echo."""

_SPREAD = 0.03
"""Standard deviation of that echo from the nearest point [m]."""

_DENSITY = 9.0
"""Echoes of a body per metre."""

_NOISE_DENSITY, _STRONG_DENSITY = 1.2, 0.02
"""Echoes per metre that are none of the body: at the least level, and of any level."""

_UNEXPLAINED = 0.04
"""Standard deviation that the grid does not explain [m]: makes errors as large as the deviations in simulated walks."""


class Echoes(NamedTuple):
    """Echoes of a body, the strongest first."""

    range: Array
    """[m]."""
    velocity: Array
    """[m/s]."""
    snr_db: Array
    """Power over the noise in a cell [dB]."""


def _kernel(window: Array, offset: Any) -> Array:
    """Transform of a window about its middle at offsets [cells], 1 at 0."""
    middle = np.arange(len(window)) - 0.5 * len(window)
    values: Array = np.cos(2.0 * np.pi / len(window) * np.multiply.outer(offset, middle)) @ window / window.sum()
    return values


class _Grid(NamedTuple):
    """Tones that are tried, of energy 1 in the cells of a patch."""

    windows: tuple[Array, Array]
    places: tuple[Array, Array]
    tones: tuple[Array, Array]
    """(row, place) and (column, place)."""
    energy: float
    """Of a tone of amplitude 1."""


@lru_cache(maxsize=4)
def _grid(num_chirps: int, num_samples: int) -> _Grid:
    lengths, sizes = (num_chirps, num_samples), (num_chirps, _BEFORE + 1 + _BEHIND)
    windows = [window_weights("window", "hann", length) for length in lengths]
    places = [np.arange(size * fine) / fine for size, fine in zip(sizes, _FINENESS, strict=True)]
    tones = [
        _kernel(window, np.arange(size)[:, None] - place)
        for window, size, place in zip(windows, sizes, places, strict=True)
    ]
    energies = [np.square(each).sum(axis=0) for each in tones]
    unit = [each / np.sqrt(energy) for each, energy in zip(tones, energies, strict=True)]
    return _Grid(tuple(windows), tuple(places), tuple(unit), float(energies[0].max() * energies[1].max()))  # type: ignore[arg-type]


def _between(left: float, middle: float, right: float) -> float:
    """Vertex of the parabola through three points, from the middle one."""
    bend = left - 2.0 * middle + right
    return float(np.clip(0.5 * (left - right) / bend, -1.5, 1.5)) if bend < 0.0 else 0.0


class _Pursuit:
    """Tones that explain a patch of a map, (look, row, column); looks are real and imaginary parts of the channels."""

    def __init__(self, patch: Array, grid: _Grid) -> None:
        self.patch, self.residual, self.grid = patch, patch, grid
        self.places: list[Array] = []
        self.shapes: list[tuple[Array, Array]] = []
        self.amplitudes = np.zeros((0, len(patch)))

    def _shape(self, place: Array) -> tuple[Array, Array]:
        rows, columns = (
            _kernel(window, np.arange(size) - at)
            for window, size, at in zip(self.grid.windows, self.patch.shape[1:], place, strict=True)
        )
        return rows, columns

    def add(self, least: float) -> bool:
        """Add the tone that explains most, unless its power is below the least."""
        along, across = self.grid.tones
        fits = np.square(along.T @ self.residual @ across).sum(axis=0)
        inner = fits[:, 2:-5]  # a tone beyond the patch has its largest fit at the edge
        row, column = divmod(int(inner.argmax()), inner.shape[1])
        column += 2
        if fits[row, column] < least * self.grid.energy:
            return False
        near = fits[[row - 1, row, (row + 1) % len(fits)], column], fits[row, column - 1 : column + 2]
        exact = [
            places[at] + _between(*values) * places[1]
            for places, at, values in zip(self.grid.places, (row, column), near, strict=True)
        ]
        self.places.append(np.array(exact))
        self.shapes.append(self._shape(self.places[-1]))
        rows, columns = (np.array(each) for each in zip(*self.shapes, strict=True))
        matrix = (rows @ rows.T) * (columns @ columns.T)
        matrix += 1e-6 * matrix[0, 0] * np.eye(len(matrix))  # tones at one place
        measured = ((rows @ self.patch) * columns).sum(axis=2)
        self.amplitudes = np.linalg.solve(matrix, measured.T)
        self.residual = self.patch - np.tensordot(self.amplitudes.T, rows[:, :, None] * columns[:, None], 1)
        return True

    def refine(self, step: float = 0.2) -> None:
        """Fit each tone without the others, at places within a step [cells]."""
        for k, (rows, columns) in enumerate(self.shapes):
            alone = self.residual + self.amplitudes[k][:, None, None] * (rows[:, None] * columns)
            tried = [self._shape(self.places[k] + shift) for shift in (-step, step)]
            fits = []
            for axis, profile in enumerate((alone @ columns, rows @ alone)):
                shapes = np.array([tried[0][axis], self.shapes[k][axis], tried[1][axis]])
                fits.append(np.square(profile @ shapes.T).sum(axis=0) / np.square(shapes).sum(axis=1))
            self.places[k] = self.places[k] + step * np.array([_between(*values) for values in fits])
            rows, columns = self.shapes[k] = self._shape(self.places[k])
            self.amplitudes[k] = rows @ alone @ columns / (np.square(rows).sum() * np.square(columns).sum())
            self.residual = alone - self.amplitudes[k][:, None, None] * (rows[:, None] * columns)


def echoes(frame: Frame, distance: float, velocity: float) -> Echoes | None:
    """Echoes about a range and velocity, separated from each other; None from frames without noise or velocities.

    Parameters
    ----------
    frame : Frame
    distance, velocity : float
        Of the track [m, m/s].
    """
    wf = frame.radar.waveform
    if wf.is_cw or wf.num_chirps < 2 or not wf.has_uniform_chirps or bands_of(frame.radar) is not None:
        return None
    cells = range_doppler(frame)
    num_channels, num_rows, num_columns = cells.shape
    size = _BEFORE + 1 + _BEHIND
    noise = float(np.median(powers(cells).sum(axis=0))) / median_of_unit_mean(num_channels)
    if num_columns <= size or not noise > 0.0:
        return None

    # The cells about the track, with phases that make the transforms of the windows real.
    per_speed = wf.center_frequency / wf.slope / wf.range_resolution
    middle = round(distance / wf.range_resolution + velocity * per_speed)
    first = min(max(middle - _BEFORE, 1), num_columns - size)
    signs = (-1.0) ** np.add.outer(np.arange(num_rows) - num_rows // 2, first + np.arange(size))
    patch = cells[:, :, first : first + size] * signs
    pursuit = _Pursuit(np.concatenate([patch.real, patch.imag]).astype(np.float64), _grid(num_rows, wf.num_samples))
    while len(pursuit.places) < _MOST and pursuit.add(noise * 10.0 ** (0.1 * _LEAST_SNR_DB)):
        if len(pursuit.places) % 3 == 0:
            pursuit.refine()
    for _ in range(_NUM_PASSES):
        pursuit.refine()
    if not pursuit.places:
        return Echoes(*np.zeros((3, 0)))
    snr = np.square(pursuit.amplitudes).sum(axis=1) / noise
    order = np.argsort(-snr)
    row, column = np.array(pursuit.places)[order].T
    speed = (row - num_rows // 2) * wf.velocity_resolution
    return Echoes((first + column - speed * per_speed) * wf.range_resolution, speed, 10.0 * np.log10(snr[order]))


def _of_body(found: Echoes, cell: tuple[float, float]) -> Echoes:
    """Echoes without residuals of stronger ones, and with those as one that are not resolved; `cell` is its size."""
    places = np.array([found.velocity / cell[0], found.range / cell[1]])
    apart = np.abs(places[:, :, None] - places[:, None])  # (axis, echo, stronger echo)
    is_weaker = found.snr_db[:, None] < found.snr_db - _RESIDUAL_DB - 6.0 * np.maximum(apart[1] - 1.0, 0.0)
    is_echo = ~((apart < _RESIDUAL_CELLS).all(axis=0) & is_weaker).any(axis=1)
    rest, kept = list(np.flatnonzero(is_echo & (found.snr_db > _LEAST_SNR_DB))), []
    while rest:
        is_near = (apart[0, rest, rest[0]] < _MERGED[0]) & (apart[1, rest, rest[0]] < _MERGED[1])
        near = np.array(rest)[is_near]
        mean = np.average(found.range[near], weights=10.0 ** (0.1 * found.snr_db[near]))
        kept.append((mean, found.velocity[near[0]], found.snr_db[near[0]]))
        rest = [k for k, is_in in zip(rest, is_near, strict=True) if not is_in]
    return Echoes(*np.array(kept).reshape(-1, 3).T)


def likelihood(frame: Frame, state: TrackState) -> NDArray[np.float64] | None:
    """Likelihood of the leads of the grid, (lead,); None where `echoes` are not known."""
    found = echoes(frame, state.range, state.velocity)
    if found is None:
        return None
    wf = frame.radar.waveform
    found = _of_body(found, (wf.velocity_resolution, wf.range_resolution))
    lead = state.range - found.range
    towards = np.nan_to_num(state.position - state.sensor_pose[:, 3]) / state.range
    is_static = np.abs(found.velocity + towards @ state.sensor_velocity) < _STATIC_SPEED
    is_near = np.abs(wrapped(found.velocity - state.velocity, np.array(2.0 * frame.radar.max_velocity))) < _LIMB_SPEED
    kept = is_near & (lead > -0.5) & (lead < 0.7) & ~(is_static & (lead > _STATIC_LEAD))
    return _likelihood(lead[kept], found.snr_db[kept])


def _likelihood(lead: Array, snr_db: Array) -> NDArray[np.float64]:
    """Likelihood of the leads of the grid: echoes in front are none of the body, the nearest point may send one."""
    if len(lead) == 0:
        return np.ones(len(_LEADS))
    noise = _NOISE_DENSITY * 10.0 ** (-0.05 * (snr_db - _LEAST_SNR_DB)) + _STRONG_DENSITY
    beyond = (lead[:, None] - _LEADS) / _SPREAD
    in_front = 1.0 / (1.0 + np.exp(np.clip((1.5 - beyond) / 0.4, -50.0, 50.0)))
    others = np.exp(np.log(noise / _DENSITY) @ in_front)
    own = np.exp(-0.5 * np.square(beyond)).max(axis=0) / (np.sqrt(2.0 * np.pi) * _SPREAD * _DENSITY)
    result: NDArray[np.float64] = others * (1.0 - _SEEN + _SEEN * own)
    return result


@lru_cache(maxsize=1)
def _walk() -> tuple[Array, Array]:
    """Prior of the leads, and the matrix of their changes from frame to frame (Metropolis): the prior is stationary."""
    prior = np.exp(-0.5 * np.square((_LEADS - _MEAN) / _DEVIATION))
    prior /= prior.sum()
    steps = np.exp(-0.5 * np.square((_LEADS[:, None] - _LEADS) / _STEP))
    changes = steps / steps.sum(axis=0).max() * np.minimum(1.0, prior[:, None] / prior)
    return prior, changes + np.diag(1.0 - changes.sum(axis=0))


def leads(likelihoods: Array, smooth: bool) -> tuple[Array, Array]:
    """Means and standard deviations of the lead in every frame, (row,) each [m], from likelihoods (row, lead).

    By the likelihoods until each frame, or by all: forwards and backwards through the hidden Markov model.
    """
    belief, changes = _walk()
    beliefs = np.empty(likelihoods.shape)
    for k, each in enumerate(likelihoods):
        belief = (changes @ belief if k else belief) * each
        beliefs[k] = belief = belief / belief.sum()
    later = np.ones(len(_LEADS))
    for k in reversed(range(len(likelihoods) - 1) if smooth else ()):
        later = (later * likelihoods[k + 1]) @ changes
        later /= later.sum()
        beliefs[k] *= later
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    mean = beliefs @ _LEADS
    variance = np.square(_LEADS - mean[:, None])
    return mean, np.sqrt((beliefs * variance).sum(axis=1) + _UNEXPLAINED**2)
