"""Raw captures of TI's DCA1000: 16-bit numbers as the chip's LVDS lanes sent them, without any header.

TI, SWRA581 "Mmwave Radar Device ADC Raw Data Capture" has their order. Within a chirp, of samples s and receivers r:

- two lanes (xWR16xx, 18xx, 68xx), receiver after receiver: ``I(s) I(s+1) Q(s) Q(s+1)``; real ones in their order;
- four lanes (xWR12xx, 14xx), sample after sample: ``I(r0) I(r1) I(r2) I(r3) Q(r0) Q(r1) Q(r2) Q(r3)``; real ones
  ``r0 r1 r2 r3``.

I and Q change places where the chip was told to. Chirps follow each other in the order of their transmitters' turns.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.radar.radar import Radar
from radarcore.recording.frame import COUNTS, frame_shape
from radarcore.recording.native import Stored
from radarcore.recording.npy import Converted

_PART = re.compile(r"(?P<name>.*_Raw_)(?P<number>\d+)(?P<suffix>\.bin)", re.IGNORECASE)
"""Name of one of the files into which the recorder splits a long capture."""

_WORD = np.dtype("<i2")


@dataclass(frozen=True)
class Capture:
    """Order of the numbers of a capture.

    Parameters
    ----------
    num_lanes : 2 or 4
    is_real : bool
        Real samples, one number each; else I/Q.
    has_q_first : bool
        Q before I.
    bits : 12, 14 or 16
        Bits of a sample, the lowest of its number.
    turns : tuple of int
        Index of the transmitter of every chirp of a round, in the order of time.
    files : tuple of Path
        Files that the configuration names; none: the file that was asked for.
    facts : dict
        What a recording's ``source["capture"]`` says besides.
    """

    num_lanes: int
    is_real: bool
    has_q_first: bool
    bits: int
    turns: tuple[int, ...]
    files: tuple[Path, ...] = ()
    facts: tuple[tuple[str, Any], ...] = ()


def opened(path: Path, radar: Radar, capture: Capture) -> Stored:
    """Frames of a capture, mapped into memory; of a last one that is not whole the user is told, and it is left out."""
    files = capture.files if path.suffix.lower() == ".json" else parts_of(path)
    if not files:
        raise ValueError(f"{path}: expected the names of captured files, got none")
    num_words = int(np.prod(frame_shape(radar))) * (1 if capture.is_real else 2)
    words = _Words(files, num_words)
    if len(words) == 0:
        raise ValueError(
            f"{files[0]}: expected frames of {num_words * _WORD.itemsize} bytes by the configuration, "
            f"got {words.num_bytes} bytes"
        )
    if words.left_over:
        notice.warn(f"{files[-1]}: {len(words)} frames, the last {words.left_over} bytes are no whole frame")

    row = frame_shape(radar)
    dtype = np.float32 if capture.is_real else np.complex64
    cube: Any = Converted(words, lambda part: samples(part, radar, capture), files[0], row, dtype)
    source = {
        "file": files[0].name,
        **({"files": [file.name for file in files]} if len(files) > 1 else {}),
        "cube_unit": COUNTS,
        "capture": {"board": "DCA1000", **dict(capture.facts)},
    }
    time = radar.waveform.frame_interval * np.arange(len(words), dtype=np.float64)
    return Stored(cube, time, radar, None, source)


def parts_of(path: Path) -> tuple[Path, ...]:
    """Files of the capture that begins in a file: ``NAME_Raw_0.bin`` goes on in ``NAME_Raw_1.bin``, ..."""
    match = _PART.fullmatch(path.name)
    if match is None:
        return (path,)
    number = int(match["number"])
    first = path.with_name(f"{match['name']}{number - 1}{match['suffix']}")
    if number > 0 and first.is_file():
        raise ValueError(f"{path}: expected the first file of a capture, got one that goes on from {first.name}")
    files = [path]
    while (following := path.with_name(f"{match['name']}{number + len(files)}{match['suffix']}")).is_file():
        files.append(following)
    return tuple(files)


def samples(words: NDArray[np.int16], radar: Radar, capture: Capture) -> NDArray[Any]:
    """Samples (frame, channel, chirp, sample), complex64 or float32, of numbers (frame, word) as they came."""
    num_rx, num_samples, num_turns = len(radar.rx), radar.waveform.num_samples, len(capture.turns)
    chirps = words.reshape(len(words), -1, num_turns, num_rx * num_samples * (1 if capture.is_real else 2))
    values = _signed(chirps, capture.bits)

    # Halves of every group of numbers are I and Q.
    flat: NDArray[Any] = values
    if not capture.is_real:
        groups = values.reshape(*values.shape[:-1], -1, 2, 4 if capture.num_lanes == 4 else 2)
        first, second = groups[..., 0, :], groups[..., 1, :]
        flat = np.empty(first.shape, np.complex64)
        flat.real, flat.imag = (second, first) if capture.has_q_first else (first, second)
        flat = flat.reshape(*values.shape[:-1], -1)

    # (frame, loop, turn, rx, sample) becomes (frame, tx, rx, loop, sample).
    if capture.num_lanes == 4:
        apart = flat.reshape(*flat.shape[:-1], num_samples, num_rx).swapaxes(-1, -2)
    else:
        apart = flat.reshape(*flat.shape[:-1], num_rx, num_samples)
    turn_of = np.argsort(capture.turns)
    ordered = apart[:, :, turn_of].transpose(0, 2, 3, 1, 4)
    result: NDArray[Any] = ordered.reshape(len(words), *frame_shape(radar))
    return result.astype(np.float32 if capture.is_real else np.complex64, copy=False)


def _signed(words: NDArray[np.int16], bits: int) -> NDArray[np.int16]:
    """Numbers of fewer than 16 bits with the sign of their highest bit."""
    if bits == 16:
        return words
    shift = 16 - bits
    signed: NDArray[np.int16] = (words << shift) >> shift
    return signed


class _Words:
    """Whole frames (frame, word) of files that follow each other; a frame may lie in two of them."""

    def __init__(self, files: tuple[Path, ...], num_words: int) -> None:
        sizes = [file.stat().st_size for file in files]
        self.num_bytes = sum(sizes)
        if odd := [file for file, size in zip(files[:-1], sizes, strict=False) if size % _WORD.itemsize]:
            raise ValueError(f"{odd[0]}: expected whole numbers of 16 bits before the next file, got an odd size")
        self._maps = [
            np.memmap(file, _WORD, "r", shape=(size // _WORD.itemsize,))
            for file, size in zip(files, sizes, strict=True)
            if size >= _WORD.itemsize
        ]
        self._ends = np.cumsum([0, *(len(part) for part in self._maps)])
        self._num_words = num_words
        self._length = int(self._ends[-1]) // num_words
        self.left_over = self.num_bytes - self._length * num_words * _WORD.itemsize

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, rows: slice) -> NDArray[np.int16]:
        chosen = range(self._length)[rows]
        start, stop = chosen.start * self._num_words, chosen.stop * self._num_words
        pieces = [
            part[max(0, start - begin) : max(0, stop - begin)]
            for part, begin in zip(self._maps, self._ends.tolist(), strict=False)
        ]
        found = [piece for piece in pieces if len(piece)] or [np.empty(0, _WORD)]
        values: NDArray[np.int16] = found[0] if len(found) == 1 else np.concatenate(found)
        return values.reshape(-1, self._num_words)
