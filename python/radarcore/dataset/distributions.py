"""Distributions of a value of a scene file.

A draw is the inverse of the distribution function at one uniform number: the same number gives the same value on any
machine, of a normal distribution with the same version of SciPy.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from itertools import accumulate
from math import ceil, floor, inf, isfinite
from typing import Any, ClassVar

from scipy.special import ndtr, ndtri

from radarcore import check
from radarcore.scenefile.read import DISTRIBUTIONS

Value = Any
"""Value of a scene file: a number, a word, true or false, a list or a table."""

_SMALLEST_SHARE = 1e-9
"""Least probability between the bounds of a normal distribution: below, its quantiles lose their digits."""


@dataclass(frozen=True)
class _Interval:
    """Values from `low` to `high`.

    Like all distributions it has its word in scene files (`kind`), its extreme values (`ends`; for a choice all
    values), and its quantiles (`at`).
    """

    low: Any
    high: Any
    kind: ClassVar[str]

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"{self.kind}: expected the smaller end first, got [{self.low}, {self.high}]")

    @property
    def ends(self) -> tuple[Value, ...]:
        """Smallest and largest value."""
        return self.low, self.high


@dataclass(frozen=True)
class Uniform(_Interval):
    """Numbers of equal density, or of equal probability on a grid of `step`."""

    step: float | None = None
    kind = "uniform"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_step(self.step, self.high - self.low, "ends")

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return self.low, self.high if self.step is None else self._on_grid(self._num_steps)

    def at(self, share: float) -> float:
        """Quantile."""
        if self.step is None:
            return float(self.low + share * (self.high - self.low))
        return self._on_grid(int(share * (self._num_steps + 1)))

    @property
    def _num_steps(self) -> int:
        assert self.step is not None  # only asked of grids
        return int((self.high - self.low) / self.step * (1.0 + 1e-12))

    def _on_grid(self, k: int) -> float:
        assert self.step is not None  # only asked of grids
        return float(f"{self.low + k * self.step:.12g}")  # 1.65, not 1.6500000000000001


@dataclass(frozen=True)
class Normal:
    """Numbers of a normal distribution, cut at `min` and `max`: nothing piles up there.

    With a `step` they are rounded to the mean plus or minus whole steps.
    """

    mean: float
    deviation: float
    min: float = -inf
    max: float = inf
    step: float | None = None
    kind = "normal"

    def __post_init__(self) -> None:
        check.positive("normal: standard deviation", self.deviation)
        if not self.min < self.max:
            raise ValueError(f"max: expected more than min, {self.min:g}, got {self.max:g}")
        _check_step(self.step, self.max - self.min, "bounds")
        _, low, high = self._probabilities
        if abs(high - low) < _SMALLEST_SHARE:
            raise ValueError(
                f"{'min' if self.min > self.mean else 'max'}: expected bounds that keep some of the distribution, got "
                f"{self.min:g} to {self.max:g} for a mean of {self.mean:g} and a standard deviation of "
                f"{self.deviation:g}"
            )

    @property
    def ends(self) -> tuple[float, ...]:
        """The bounds that there are, and the mean if it lies between them."""
        bounds = self.min, self.max
        low, high = (end if self.step is None or not isfinite(end) else self._on_grid(end) for end in bounds)
        middle = self.mean if self.min <= self.mean <= self.max else self.at(0.5)
        return tuple(dict.fromkeys(value for value in (low, middle, high) if isfinite(value)))

    def at(self, share: float) -> float:
        """Quantile."""
        sign, low, high = self._probabilities
        probability = min(max(low + share * (high - low), 2.0**-54), 1.0 - 2.0**-53)
        value = self.mean + sign * self.deviation * float(ndtri(probability))
        value = min(max(value, self.min), self.max)
        return value if self.step is None else self._on_grid(value)

    def _on_grid(self, value: float) -> float:
        assert self.step is not None  # only asked of grids
        first, last = ((end - self.mean) / self.step for end in (self.min, self.max))
        k = round((value - self.mean) / self.step)
        k = k if k <= last * (1.0 + 1e-12) else floor(last)
        k = k if k >= first * (1.0 + 1e-12) else ceil(first)
        return float(f"{self.mean + k * self.step:.12g}")

    @property
    def _probabilities(self) -> tuple[float, float, float]:
        """A sign, and the probabilities of values below both bounds, or above them with sign -1: exact far above."""
        sign = -1.0 if self.min > self.mean else 1.0
        low, high = (float(ndtr(sign * (end - self.mean) / self.deviation)) for end in (self.min, self.max))
        return sign, low, high


@dataclass(frozen=True)
class LogUniform(_Interval):
    """Positive numbers whose logarithms have equal density."""

    kind = "log_uniform"

    def __post_init__(self) -> None:
        check.positive("log_uniform", self.low)
        super().__post_init__()

    def at(self, share: float) -> float:
        """Quantile."""
        return float(min(max(self.low ** (1.0 - share) * self.high**share, self.low), self.high))


@dataclass(frozen=True)
class Integers(_Interval):
    """Integers of equal probability, both ends among them."""

    kind = "integers"

    def __post_init__(self) -> None:
        if not (isinstance(self.low, int) and isinstance(self.high, int)):
            raise ValueError(f"integers: expected two integers, got [{self.low}, {self.high}]")
        if self.low != self.high:
            super().__post_init__()

    def at(self, share: float) -> int:
        """Quantile."""
        return int(self.low) + int(share * (self.high - self.low + 1))


@dataclass(frozen=True)
class Choice:
    """One of several values, which may be tables and lists."""

    values: Sequence[Value]
    weights: Any = ()
    """One per value; default: all alike."""
    kind = "choice"

    def __post_init__(self) -> None:
        values, weights = self.values, self.weights or [1.0] * len(self.values)
        if not isinstance(weights, Sequence) or len(weights) != len(values):
            raise ValueError(f"weights: expected a list of {len(values)} numbers, one per value, got {weights!r}")
        if sum(check.non_negative("weights", weight) for weight in weights) == 0.0:
            raise ValueError(f"weights: expected one above zero, got {weights!r}")
        object.__setattr__(self, "values", tuple(values))
        object.__setattr__(self, "weights", tuple(map(float, weights)))

    @property
    def ends(self) -> tuple[Value, ...]:
        """All values that may be drawn."""
        return tuple(value for value, weight in zip(self.values, self.weights, strict=True) if weight > 0.0)

    def at(self, share: float) -> Value:
        """Value of the share, by the order of the values."""
        return self.values[self.number_at(share)]

    def number_at(self, share: float) -> int:
        """Number of that value."""
        sums = list(accumulate(self.weights))
        number = bisect_right(sums, share * sums[-1])
        # A sum that was rounded down may leave nothing to the last.
        return min(number, max(k for k, weight in enumerate(self.weights) if weight > 0.0))


def is_distribution(value: object) -> bool:
    """True for a table that has the name of a distribution among its keys."""
    return isinstance(value, Mapping) and any(name in value for name in DISTRIBUTIONS)


Distribution = Uniform | Normal | LogUniform | Integers | Choice

_KINDS: dict[str, Callable[..., Distribution]] = {
    each.kind: each for each in (Uniform, Normal, LogUniform, Integers, Choice)
}


def distribution_of(table: Mapping[str, Value]) -> Distribution:
    """The distribution of a table such as ``{ uniform = [0.5, 2.0] }``; a ValueError says what is wrong."""
    kind, *others = [name for name in DISTRIBUTIONS if name in table]
    if others:
        raise ValueError(f"{others[0]}: expected one distribution, got {kind} as well")
    value, options = table[kind], {name: option for name, option in table.items() if name != kind}
    known = [name for name in signature(_KINDS[kind]).parameters if name in ("step", "min", "max", "weights")]
    for name in options:
        if name not in known:
            raise ValueError(f"unknown key {name!r} of a distribution; {check.near_names(name, (kind, *known))}")
    if kind == "choice":
        if not isinstance(value, list) or not value:
            raise ValueError(f"choice: expected a list of values, got {value!r}")
        return Choice(value, **options)
    is_pair = isinstance(value, list) and len(value) == 2
    if not is_pair or any(isinstance(end, bool) or not isinstance(end, int | float) for end in value):
        meaning = "the mean and the standard deviation" if kind == "normal" else "the smallest and the largest value"
        raise ValueError(f"{kind}: expected two numbers, {meaning}, got {value!r}")
    numbers = [check.number(kind, end) for end in value]
    ends = value if kind == "integers" else numbers
    return _KINDS[kind](*ends, **{name: check.number(name, option) for name, option in options.items()})


def _check_step(step: float | None, width: float, between: str) -> None:
    if step is not None and check.positive("step", step) > width:
        raise ValueError(f"step: expected at most {width:g}, the distance of the {between}, got {step:g}")
