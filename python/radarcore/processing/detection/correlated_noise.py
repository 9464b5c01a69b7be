"""Noise in a windowed spectrum, whose neighbouring cells depend on each other: what that does to false alarms."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from radarcore.processing.detection.cfar import averaging_factor

_MOST_CELLS = 400
"""Training cells up to which the distribution of their mean is taken as it is, beyond by its variance: so many hardly
scatter."""

_NUM_DRAWS = 60_000
"""Draws, times channels, from which the part of local maxima is counted: to about 0.5 %."""

_NUM_ROUNDS = 6
"""Rounds of iterations that gain more than a digit each."""


def correlation(weights: NDArray[np.float64], lag: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Correlation of the amplitudes of cells `lag` apart in the transform of windowed white noise (Hann: -2/3, 1/6)."""
    n = np.arange(len(weights))
    squares = np.square(weights) / np.sum(np.square(weights))
    lags, inverse = np.unique(lag, return_inverse=True)
    values: NDArray[np.complex128] = (np.exp(-2j * np.pi * np.outer(lags, n) / len(n)) @ squares)[inverse]
    return values.reshape(lag.shape)


def independent_cells(slow: NDArray[np.float64] | None, fast: NDArray[np.float64] | None) -> float:
    """Number of independent cells whose mean scatters as that of all cells of both axes; None: a single cell.

    The cells over the sum of the squared correlations of one with all (Hann: 1.94), which Parseval's theorem gives.
    """
    number = 1.0
    for weights in (slow, fast):
        if weights is not None:
            squares = np.square(weights)
            number *= float(np.square(squares.sum()) / np.square(squares).sum())
    return number


def independent_part(
    slow: NDArray[np.float64],
    fast: NDArray[np.float64],
    guards: tuple[int, int],
    trainings: tuple[int, int],
    false_alarm_rate: float,
    num_looks: int,
) -> float:
    """Number of independent cells over that of the training cells.

    The sum of the powers of training cells is a sum of independent exponential variables, weighted by the eigenvalues
    of the covariance of their amplitudes. It is replaced by a gamma-distributed one with the same false-alarm rate at
    the threshold, for one look, or nearly that, for several.
    """
    return _independent_part(slow.tobytes(), fast.tobytes(), guards, trainings, false_alarm_rate, num_looks)


@lru_cache(maxsize=64)
def _independent_part(
    slow: bytes, fast: bytes, guards: tuple[int, int], trainings: tuple[int, int], rate: float, num_looks: int
) -> float:
    from scipy.optimize import brentq

    weights = np.frombuffer(slow), np.frombuffer(fast)
    # No window is larger than the map.
    reach = [min(g + t, len(w) // 2) for g, t, w in zip(guards, trainings, weights, strict=True)]
    cells = np.array(
        [
            (i, j)
            for i, j in product(range(-reach[0], reach[0] + 1), range(-reach[1], reach[1] + 1))
            if abs(i) > guards[0] or abs(j) > guards[1]
        ]
    )
    if len(cells) < 2:
        return 1.0
    lags = cells[:, None] - cells
    covariance = correlation(weights[0], lags[..., 0]) * correlation(weights[1], lags[..., 1])
    number = float(len(cells) ** 2 / np.sum(np.abs(covariance) ** 2))
    if len(cells) <= _MOST_CELLS:
        shares = np.linalg.eigvalsh(covariance)
        shares = shares[shares > 0.0] / len(cells)
        for _ in range(_NUM_ROUNDS):
            factor = float(averaging_factor(number, rate, num_looks)) / num_looks
            wanted = float(np.log1p(factor * shares).sum())
            number = brentq(lambda n, f=factor, w=wanted: n * np.log1p(f / n) - w, 1e-3, 1e6)
    return min(1.0, number / len(cells))


def independent_part_below(part: float, quantile: float, num_looks: int) -> float:
    """`independent_part` for the ordered statistic: of cells that are counted, whether they are below a quantile.

    Events depend on each other less than the powers do. To first order in the correlation of the powers, by which the
    distribution of a pair of gamma variables is expanded (Laguerre polynomials), it is multiplied by the square of
    ``x^L exp(-x) / Gamma(L)`` over ``L q (1 - q)``, x the quantile q.
    """
    from scipy.special import gammaincinv, gammaln

    x = float(gammaincinv(num_looks, quantile))
    density = np.exp(2.0 * (num_looks * np.log(x) - x - gammaln(num_looks)))
    smaller = density / (num_looks * quantile * (1.0 - quantile))
    return float(1.0 / (1.0 + smaller * (1.0 / part - 1.0)))


def cell_rate(slow: NDArray[np.float64], fast: NDArray[np.float64], false_alarm_rate: float, num_looks: int) -> float:
    """False-alarm rate of cells at which local maxima are as frequent as `false_alarm_rate`.

    A cell of noise above the threshold may have a higher one beside it, and is then not counted. How often is drawn:
    the neighbours of a cell given that it is above.
    """
    return _cell_rate(slow.tobytes(), fast.tobytes(), false_alarm_rate, num_looks)


@lru_cache(maxsize=64)
def _cell_rate(slow: bytes, fast: bytes, false_alarm_rate: float, num_looks: int) -> float:
    from scipy.special import gammainccinv

    weights = np.frombuffer(slow), np.frombuffer(fast)
    sides = [range(-1, 2) if np.count_nonzero(w) > 2 else range(1) for w in weights]
    cells = np.array([cell for cell in product(*sides) if cell != (0, 0)])
    if len(cells) == 0:
        return false_alarm_rate

    # Amplitudes of the neighbours: a part of the middle one's, and the rest.
    lags = cells[:, None] - cells
    part = correlation(weights[0], cells[:, 0]) * correlation(weights[1], cells[:, 1])
    rest = correlation(weights[0], lags[..., 0]) * correlation(weights[1], lags[..., 1]) - np.outer(part, part.conj())
    variances, directions = np.linalg.eigh(rest)
    mixing = directions * np.sqrt(np.maximum(variances, 0.0))
    rng = np.random.default_rng(0)
    num_draws = max(2000, _NUM_DRAWS // num_looks)

    def drawn() -> NDArray[np.complex128]:
        """The rest of the neighbours in one channel, (cell, draw)."""
        draws = rng.standard_normal((2, num_draws, len(cells)))
        return np.asarray(mixing @ (draws[0] + 1j * draws[1]).T / np.sqrt(2.0))

    first = drawn()
    power = _square(first)
    for _ in range(num_looks - 1):
        power += _square(drawn())
    level = (np.arange(num_draws) + 0.5) / num_draws

    # Channels can be turned into each other, so the middle cell's amplitude a may be in the first alone. A neighbour
    # has the power |a part + first|^2 and that of the other channels.
    along, left = 2.0 * (part.conj()[:, None] * first).real, 1.0 - _square(part)
    rate = false_alarm_rate
    for _ in range(_NUM_ROUNDS):
        # The same of one look, which is exponential, in a tenth of the time.
        middle = -np.log(level * rate) if num_looks == 1 else gammainccinv(num_looks, level * rate)
        root, is_largest = np.sqrt(middle), np.ones(num_draws, dtype=bool)
        for i in range(len(cells)):
            is_largest &= left[i] * middle - along[i] * root > power[i]
        last, rate = rate, min(false_alarm_rate / max(float(is_largest.mean()), 1e-2), 0.5)
        if rate == last:
            break
    return rate


def _square(amplitude: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Powers; squares of `np.abs` take several times as long."""
    return np.asarray(amplitude.real**2 + amplitude.imag**2)
