"""Bare NPY files of samples, which say nothing of their radar."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.recording.frame import CUBE_TYPES, frame_shape
from radarcore.recording.native import Stored
from radarcore.recording.npy import Converted, naming

COUNTS = "counts"
"""``source["cube_unit"]`` of samples that were integers."""

UNKNOWN = "unknown"
"""Unit of other samples: nothing says that they are in sqrt(W)."""


def opened(path: Path, radar: Radar) -> Stored:
    """Frames of an NPY file, mapped into memory, a frame interval apart.

    Four axes are ``[frame, channel, chirp, sample]``, three a single frame. Integers become float32 counts when they
    are asked for, `Converted`.
    """
    with naming(path):
        try:
            values = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise ValueError(f"{path}: damaged or not an NPY file ({error})") from error
    values = values[None] if values.ndim == 3 else values
    shape = frame_shape(radar)
    if values.shape[1:] != shape or values.ndim != 4:
        raise ValueError(
            f"{path}: expected shape {check.shape_text((None, *shape))} [frame, channel, chirp, sample] of the radar, "
            f"got {values.shape}"
        )
    source: dict[str, Any] = {"file": path.name}
    cube: Any = values
    if values.dtype.kind in "iu":
        cube = Converted(values, _as_float, path)
        source["cube_unit"] = COUNTS
    elif values.dtype.name not in CUBE_TYPES:
        raise ValueError(f"{path}: expected integers or {', '.join(CUBE_TYPES)}, got {values.dtype}")
    else:
        source["cube_unit"] = UNKNOWN
    time = radar.waveform.frame_interval * np.arange(len(values), dtype=np.float64)
    return Stored(cube, time, radar, None, source)


def _as_float(values: NDArray[Any]) -> NDArray[np.float32]:
    return values.astype(np.float32)
