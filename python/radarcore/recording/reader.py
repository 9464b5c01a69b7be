"""Reader of recordings that need not fit into memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.recording.description import Description
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.native import Stored
from radarcore.recording.recording import Recording, stored_at

_CHUNK = 16
"""Frames that are read at once."""


class RecordingReader:
    """Frames of a recording on disk, a few at a time in memory, however many there are.

    Parameters
    ----------
    path : path
        As for `Recording.load`. An ``.npz`` file is read whole.
    radar, config, shape, dtype, variable : optional
        Of bare samples, see `Recording.load`.

    Attributes
    ----------
    radar : Radar
    source : dict
        Origin of the frames.
    shape : tuple of int
        Frames, channels, chirps, samples.
    dtype : dtype
        Of the samples.
    time, truth, lost
        Of all frames, see `Recording`.

    See Also
    --------
    Recording.load : All of it.
    RecordingWriter : Writes frame by frame.

    Examples
    --------
    >>> rc.Recording(np.zeros((2, 3, 64, 128), np.float32), [0.0, 0.025], rc.bgt60tr13c()).save("made")
    >>> [frame.time for frame in rc.RecordingReader("made")]
    [0.0, 0.025]
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        radar: Radar | None = None,
        config: str | PathLike[str] | None = None,
        shape: str | Sequence[str | int] | None = None,
        dtype: str | None = None,
        variable: str | None = None,
    ) -> None:
        self._stored: Stored = stored_at(path, description=Description(radar, config, shape, dtype, variable))
        Recording(**self._part(0))  # refuses what does not fit together
        self.radar: Radar = self._stored.radar
        self.source: dict[str, Any] = self._stored.source
        self.shape: tuple[int, ...] = self._stored.cube.shape
        self.dtype: np.dtype[Any] = self._stored.cube.dtype
        self.time: NDArray[np.float64] = self._stored.time
        self.truth: Truth | None = self._stored.truth
        self.lost: NDArray[np.int32] | None = self._stored.lost

    def __len__(self) -> int:
        return len(self._stored.cube)

    def __iter__(self) -> Iterator[Frame]:
        """The frames in order."""
        for first in range(0, len(self), _CHUNK):
            yield from Recording(**self._part(first)).frames()

    def _part(self, first: int) -> dict[str, Any]:
        """Fields of the recording of some frames."""
        stored, rows = self._stored, slice(first, first + _CHUNK)
        truth = None if stored.truth is None else stored.truth[rows]
        lost = None if stored.lost is None else stored.lost[rows]
        return vars(replace(stored, cube=stored.cube[rows], time=stored.time[rows], truth=truth, lost=lost))
