"""Nearest point of a body, from the samples: echoes too weak or too near each other to be detections of their own.

Echoes are separated by orthogonal matching pursuit: the tone that explains most of the map about the track is added,
and all amplitudes are estimated again (Pati, Rezaiifar and Krishnaprasad, 1993). Then each tone is fitted again without
the others, as in RELAX (Li and Stoica, 1996). The nearest point follows by Bayes' rule on a grid of its lead, its
distance in front of the track: a hand or a foot may send no echo, and a weak echo in front may be noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from radarcore.processing.detection.bands import bands_of
from radarcore.processing.spectra.noise import median_of_unit_mean
from radarcore.processing.spectra.spectra import powers, range_doppler
from radarcore.processing.tracking.cluster import periods_of, wrapped
from radarcore.processing.tracking.kalman import Array
from radarcore.processing.tracking.people import LIMB_SPEED, NEARER, NUM_REPEATS, SPEED_SCALE
from radarcore.processing.tracking.tracks import TrackState
from radarcore.recording.frame import Frame

_BEFORE, _BEHIND = 9, 7
"""Columns of the map in front of a track and behind it."""

_FINENESS = 2, 4
"""Tones tried per row and per column."""

_MOST, _NUM_PASSES = 24, 2
"""Most echoes of a body, and the last fits of each without the others."""

_LEAST_SNR_DB = 8.5
"""Least level of an echo [dB]: of noise, one or two cells in a hundred maps have more."""

_RESIDUAL_DB, _RESIDUAL_CELLS = 13.0, 3.0
"""A tone this much weaker than another one within this number of cells may be a residual of its fit."""

_MERGED = 3.0, 1.2
"""Echoes within these numbers of rows and columns are one, at their mean weighted by power."""

_LEADS = 0.01 * np.arange(-20, 61)
"""Leads of the grid [m]. The numbers below were chosen on simulated walks and the demo."""

_MEAN, _DEVIATION = 0.15, 0.07
"""Lead of a body without echoes [m]."""

_STEP = 0.08
"""Standard deviation of the change of the lead from frame to frame [m]: a hand moves at 3 m/s and more."""

_SEEN, _SPREAD = 0.5, 0.03
"""Probability that the nearest point sends an echo, and the standard deviation of its range [m]."""

_DENSITY, _NOISE_DENSITY = 10.0, 1.2
"""Echoes per metre, of a body and of noise at the least level."""

_UNEXPLAINED = 0.05
"""Standard deviation that the grid does not explain [m], by errors over deviations in benches/nearest.py."""


class Echoes(NamedTuple):
    """Echoes of a body, the strongest first: ranges [m], velocities [m/s], power over the noise in a cell [dB]."""

    range: Array
    velocity: Array
    snr_db: Array


def _hann(offset: Array) -> Array:
    """Transform of a Hann window at offsets [cells], 1 at 0; its squares add up to 1.5."""
    return np.asarray(np.sinc(offset) + 0.5 * (np.sinc(offset - 1.0) + np.sinc(offset + 1.0)))


def _vertex(left: float, middle: float, right: float) -> float:
    """Vertex of the parabola through three points, from the middle one."""
    bend = left - 2.0 * middle + right
    return float(np.clip(0.5 * (left - right) / bend, -1.5, 1.5)) if bend < 0.0 else 0.0


class _Pursuit:
    """Tones that explain a patch of a map, (look, row, column); looks are real and imaginary parts of the channels."""

    def __init__(self, patch: Array) -> None:
        self.patch, self.residual = patch, patch
        sizes = zip(patch.shape[1:], _FINENESS, strict=True)
        tones = self._shape(*(np.arange(size * fine)[:, None] / fine for size, fine in sizes))
        self.tones = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in tones]
        self.places: list[Array] = []
        self.shapes: list[tuple[Array, Array]] = []
        self.amplitudes = np.zeros((0, len(patch)))

    def _shape(self, row: Any, column: Any) -> tuple[Array, Array]:
        """Rows and columns of tones; velocities are periodic."""
        num_rows, num_columns = self.patch.shape[1:]
        return _hann(wrapped(np.arange(num_rows) - row, np.array(num_rows))), _hann(np.arange(num_columns) - column)

    def add(self, least: float) -> bool:
        """Add the tone that explains most, unless its power is below the least."""
        fits = np.square(self.tones[0] @ self.residual @ self.tones[1].T).sum(axis=0)
        inner = fits[:, 2:-5]  # a tone beyond the patch has its largest fit at the edge
        row, column = divmod(int(inner.argmax()), inner.shape[1])
        if inner[row, column] < least * 1.5**2:
            return False
        column += 2
        near = fits[[row - 1, row, (row + 1) % len(fits)], column], fits[row, column - 1 : column + 2]
        self.places.append(np.array([row + _vertex(*near[0]), column + _vertex(*near[1])]) / _FINENESS)
        self.shapes.append(self._shape(*self.places[-1]))
        rows, columns = (np.array(each) for each in zip(*self.shapes, strict=True))
        matrix = (rows @ rows.T) * (columns @ columns.T)
        matrix += 1e-6 * matrix[0, 0] * np.eye(len(matrix))  # tones at one place
        self.amplitudes = np.linalg.solve(matrix, ((rows @ self.patch) * columns).sum(axis=2).T)
        self.residual = self.patch - np.tensordot(self.amplitudes.T, rows[:, :, None] * columns[:, None], 1)
        return True

    def refine(self, step: float = 0.2) -> None:
        """Fit each tone without the others, at places within a step [cells]."""
        for k, (rows, columns) in enumerate(self.shapes):
            alone = self.residual + self.amplitudes[k][:, None, None] * (rows[:, None] * columns)
            tried = self._shape(*(self.places[k][:, None, None] + step * np.array([[-1.0], [0.0], [1.0]])))
            for axis, (profile, three) in enumerate(zip((alone @ columns, rows @ alone), tried, strict=True)):
                fits = np.square(profile @ three.T).sum(axis=0) / np.square(three).sum(axis=1)
                self.places[k][axis] += step * _vertex(*fits)
            rows, columns = self.shapes[k] = self._shape(*self.places[k])
            self.amplitudes[k] = rows @ alone @ columns / (np.square(rows).sum() * np.square(columns).sum())
            self.residual = alone - self.amplitudes[k][:, None, None] * (rows[:, None] * columns)


def echoes(frame: Frame, distance: float, velocity: float) -> Echoes | None:
    """Separated echoes about a track [m, m/s]; None of frames without noise, or without ranges and velocities."""
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
    pursuit = _Pursuit(np.concatenate([patch.real, patch.imag]).astype(np.float64))
    while len(pursuit.places) < _MOST and pursuit.add(noise * 10.0 ** (0.1 * _LEAST_SNR_DB)):
        if len(pursuit.places) % 3 == 0:
            pursuit.refine()
    for _ in range(_NUM_PASSES):
        pursuit.refine()
    snr = np.square(pursuit.amplitudes).sum(axis=1) / noise
    order = np.argsort(-snr)
    row, column = np.array(pursuit.places).reshape(-1, 2)[order].T
    speed = (row - num_rows // 2) * wf.velocity_resolution
    return Echoes((first + column - speed * per_speed) * wf.range_resolution, speed, 10.0 * np.log10(snr[order]))


def _of_body(found: Echoes, cell: Array) -> Echoes:
    """Echoes without residuals of stronger ones. Unresolved ones are one. `cell`: size in range and velocity."""
    places = np.array([found.velocity / cell[1], found.range / cell[0]])
    gaps = np.abs(places[:, :, None] - places[:, None])  # (axis, echo, stronger echo)
    is_weaker = found.snr_db[:, None] < found.snr_db - _RESIDUAL_DB - 6.0 * np.maximum(gaps[1] - 1.0, 0.0)
    is_echo = ~((gaps < _RESIDUAL_CELLS).all(axis=0) & is_weaker).any(axis=1)
    rest, kept = list(np.flatnonzero(is_echo & (found.snr_db > _LEAST_SNR_DB))), []
    while rest:
        is_near = (gaps[0, rest, rest[0]] < _MERGED[0]) & (gaps[1, rest, rest[0]] < _MERGED[1])
        near = np.array(rest)[is_near]
        mean = np.average(found.range[near], weights=10.0 ** (0.1 * found.snr_db[near]))
        kept.append((mean, found.velocity[near[0]], found.snr_db[near[0]]))
        rest = [k for k, is_in in zip(rest, is_near, strict=True) if not is_in]
    return Echoes(*np.array(kept).reshape(-1, 3).T)


def likelihood(frame: Frame, state: TrackState, others: Sequence[TrackState], background: Array) -> Array | None:
    """Likelihood of the leads of the grid, (lead,); None where `echoes` are not known.

    Echoes nearer to other people do not count. `background`: range [m] and velocity [m/s] of static echoes, (echo, 2).
    """
    found = echoes(frame, state.range, state.velocity)
    if found is None:
        return None
    wf = frame.radar.waveform
    cell = np.array([wf.range_resolution, wf.velocity_resolution])
    found = _of_body(found, cell)
    places = np.stack([found.range, found.velocity], axis=1)
    is_static = (np.abs(places[:, None] - background) < cell).all(axis=2).sum(axis=1) >= NUM_REPEATS
    lead = state.range - found.range
    people = np.array([[one.range, one.velocity] for one in (state, *others)])
    gaps = wrapped(places[:, None] - people, periods_of(2.0 * frame.radar.max_velocity)[:2])
    is_own = np.square(gaps / (NEARER, SPEED_SCALE)).sum(axis=2).argmin(axis=1) == 0
    kept = is_own & (np.abs(gaps[:, 0, 1]) < LIMB_SPEED) & (lead > -0.5) & (lead < 0.7) & ~is_static
    return _likelihood(lead[kept], found.snr_db[kept])


def _likelihood(lead: Array, snr_db: Array) -> Array:
    """Likelihood of the leads of the grid: echoes in front are noise, the nearest point may send one."""
    if len(lead) == 0:
        return np.ones(len(_LEADS))
    noise = _NOISE_DENSITY / _DENSITY * 10.0 ** (-0.05 * (snr_db - _LEAST_SNR_DB))
    beyond = (lead[:, None] - _LEADS) / _SPREAD
    others = np.exp(np.log(noise) @ (beyond > 1.0))
    own = np.exp(-0.5 * np.square(beyond)).max(axis=0) / (np.sqrt(2.0 * np.pi) * _SPREAD * _DENSITY)
    return np.asarray(others * (1.0 - _SEEN + _SEEN * own))


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
