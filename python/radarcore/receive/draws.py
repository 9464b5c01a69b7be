"""Random numbers of a frame: of the seed and its start alone, with a stream of their own for every effect."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from radarcore import _core

_EFFECTS = ("thermal noise", "phase noise", "slow phase noise", "kick", "chirp offset", "ADC noise", "segment offset")
_WORD = 2**64


@dataclass(frozen=True)
class Draws:
    """Normally distributed numbers of a frame.

    Parameters
    ----------
    seed : int
        Of the simulation.
    start : float
        Start of the frame [s].
    """

    seed: int
    start: float

    def normal(self, effect: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Numbers of mean 0 and deviation 1."""
        numbers = _core.normal(prod(shape), seed=_key(self.seed, _EFFECTS.index(effect)), start=self.start)
        return numbers.reshape(shape)

    def complex_normal(self, effect: str, shape: tuple[int, ...]) -> NDArray[np.complex64]:
        """Circular numbers whose real and imaginary parts have the deviation 1."""
        numbers: NDArray[np.complex64] = self.normal(effect, (*shape, 2)).view(np.complex64)[..., 0]
        return numbers


def _key(seed: int, stream: int) -> int:
    """Key of a stream.

    The first has the seed itself, as a receiver with thermal noise alone. Others: SplitMix64 (Steele, Lea, Flood, Fast
    splittable pseudorandom number generators, OOPSLA 2014).
    """
    if stream == 0:
        return seed
    word = (seed + stream * 0x9E3779B97F4A7C15) % _WORD
    word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 % _WORD
    word = (word ^ word >> 27) * 0x94D049BB133111EB % _WORD
    return word ^ word >> 31
