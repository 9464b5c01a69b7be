"""Samples of a dataset as exports and streams read them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from numpy.typing import NDArray

from radarcore.radar.radar import Radar


class Samples(Protocol):
    """Samples with their variables: a `Dataset`, or an object with these parts of one."""

    attrs: dict[str, Any]
    """Scene file, seed and radar that they were made from."""
    names: tuple[str, ...]
    """Variables."""

    def __len__(self) -> int:
        """Number of samples."""
        ...

    def __getitem__(self, index: int) -> dict[str, NDArray[Any]]:
        """Variables of a sample, without the axis `sample`."""
        ...

    @property
    def num_shards(self) -> int:
        """Parts that are read together."""
        ...

    def of_shard(self, shard: int) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
        """The samples of a part that were made, with their indices."""
        ...

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    @property
    def radar(self) -> Radar:
        """Radar of the samples."""
        ...

    def values(self, name: str) -> NDArray[Any]:
        """A variable or coordinate as a whole."""
        ...

    def axes(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a variable or coordinate."""
        ...

    def attributes(self, name: str) -> dict[str, Any]:
        """Unit and meaning of a variable or coordinate."""
        ...
