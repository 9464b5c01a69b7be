"""Factors of thresholds over an estimated background, for a given false-alarm rate."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

_NODES = 1000
"""Nodes of the integral over the background's distribution; 300 differ from it by less than 1e-12."""

_TAIL = 1e-20
"""What is left out of the background's density, relative to its largest value and to the false-alarm rate."""


def averaging_factor(num_cells: ArrayLike, false_alarm_rate: float, num_looks: float = 1.0) -> NDArray[np.float64]:
    """Threshold over the mean of training cells; inf where there are none.

    The power of a cell is gamma-distributed, with shape `num_looks`, and so is the sum of n of them, with shape
    ``n num_looks``: a part of both together is beta-distributed. For one look that is
    ``n (false_alarm_rate**(-1 / n) - 1)`` (Gandhi and Kassam, Analysis of CFAR processors in nonhomogeneous
    background, 1988, eq. 13).

    Parameters
    ----------
    num_cells : array_like
        Training cells; where cells depend on each other, the number of independent ones that scatter as much.
    false_alarm_rate : float
        Probability that a cell of noise is above the threshold.
    num_looks : float
        Independent exponentially distributed powers that are added in every cell.

    Returns
    -------
    factor : ndarray of float64, of the shape of `num_cells`
    """
    from scipy.special import betaincinv  # here: importing radarcore imports numpy and nothing heavier

    cells = np.asarray(num_cells, dtype=np.float64)
    some = np.maximum(cells, 1e-3)  # below, the factor is no number any more
    if num_looks == 1.0:
        with np.errstate(over="ignore"):
            return np.where(cells > 0.0, some * np.expm1(-np.log(false_alarm_rate) / some), np.inf)
    # The part of the training cells falls below `share` with the probability asked for.
    share = betaincinv(some * num_looks, num_looks, false_alarm_rate)
    with np.errstate(divide="ignore"):
        return np.where(cells > 0.0, some * (1.0 - share) / share, np.inf)


@lru_cache(maxsize=4096)
def ordered_factor(num_cells: float, rank: float, false_alarm_rate: float, num_looks: float = 1.0) -> float:
    """Threshold over the `rank`-th smallest of the training cells.

    For one look the false-alarm rate is the product over i < rank of ``(n - i) / (n - i + factor)`` (Rohling, Radar
    CFAR thresholding in clutter and multiple target situations, 1983, eq. 37), written with gamma functions; for more
    it is the mean, over the distribution of the ordered cell, of the probability to be above `factor` times it.
    Numbers of cells and ranks need not be whole. Arguments otherwise as of `averaging_factor`.
    """
    from scipy.optimize import brentq
    from scipy.special import gammaincc, gammaln

    n, k, looks = float(num_cells), float(rank), float(num_looks)
    if looks == 1.0:
        # ln of the product: Gamma(n + 1) / Gamma(n + 1 - k) over the same with `factor` added to both.
        constant = gammaln(n + 1.0) - gammaln(n + 1.0 - k)

        def rate(factor: float) -> float:
            return float(constant - gammaln(n + 1.0 + factor) + gammaln(n + 1.0 - k + factor))

    else:
        power, weights = _ordered_density(n, k, looks, false_alarm_rate)

        def rate(factor: float) -> float:
            return float(np.log(np.maximum(weights @ gammaincc(looks, factor * power), 1e-300)))

    wanted, highest = np.log(false_alarm_rate), 2.0
    while rate(highest) > wanted:
        highest *= 2.0
    return float(brentq(lambda factor: rate(factor) - wanted, 0.0, highest, xtol=1e-13 * highest, rtol=1e-13))


def _ordered_density(
    n: float, k: float, looks: float, false_alarm_rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Powers and the probabilities of the k-th smallest of n gamma-distributed cells about them, which add to 1.

    Over the logarithm of the power the density falls off exponentially on both sides, so that equal steps converge
    faster than any power of their number.
    """
    from scipy.special import gammainc, gammaincc, gammaln

    def log_density(log_power: NDArray[np.float64]) -> NDArray[np.float64]:
        power = np.exp(log_power)
        with np.errstate(divide="ignore"):
            below, above = np.log(gammainc(looks, power)), np.log(gammaincc(looks, power))
        above = np.where(np.isfinite(above), above, (looks - 1.0) * log_power - power - gammaln(looks))
        below = np.where(np.isfinite(below), below, looks * log_power - gammaln(looks + 1.0))
        return np.asarray((k - 1.0) * below + (n - k) * above + looks * log_power - power)

    # The density on a coarse grid, then on a fine one where it counts.
    grid = np.linspace(-300.0, np.log(looks) + 7.0, 8 * _NODES)
    density = log_density(grid)
    counts = np.flatnonzero(density > density.max() + np.log(_TAIL) + np.log(false_alarm_rate))
    grid = np.linspace(grid[max(counts[0] - 1, 0)], grid[min(counts[-1] + 1, len(grid) - 1)], _NODES)
    density = log_density(grid)
    weights = np.exp(density - density.max())
    return np.exp(grid), weights / weights.sum()
