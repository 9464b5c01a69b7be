"""What is worked out for several bodies at once, remembered until all of them have asked for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

# Most times of all remembered sets together, unless a single set has more: those of a frame are about 20.
_MAX_TIMES = 1024


class Recent:
    """A function of a set of times that remembers what it returned for the last sets, read-only.

    Parameters
    ----------
    function : callable
        Takes times (n,) [s], returns an array.
    """

    def __init__(self, function: Callable[[Matrix], Matrix]) -> None:
        self._function = function
        self._found: dict[bytes, Matrix] = {}
        self._num_times = 0

    def __call__(self, times: Matrix) -> Matrix:
        """What the function returns at times (n,) [s]."""
        key = times.tobytes()
        found = self._found.get(key)
        if found is None:
            found = self._function(times)
            found.flags.writeable = False
            if self._num_times + len(times) > _MAX_TIMES:
                self._found.clear()
                self._num_times = 0
            self._found[key] = found
            self._num_times += len(times)
        return found
