"""Raw captures of TI's DCA1000: 16-bit numbers as the chip's LVDS lanes sent them, without any header.

TI, SWRA581 "Mmwave Radar Device ADC Raw Data Capture" has their order. Within a chirp, of samples s and receivers r:

- two lanes (xWR16xx, 18xx, 68xx), receiver after receiver: ``I(s) I(s+1) Q(s) Q(s+1)``; real ones in their order;
- four lanes (xWR12xx, 14xx), sample after sample: ``I(r0) I(r1) I(r2) I(r3) Q(r0) Q(r1) Q(r2) Q(r3)``; real ones
  ``r0 r1 r2 r3``.

Low-power chips (xWRL6432) send real samples of 12 bits over another data interface (RDIF), also sample after sample:
``ar_convertAdcData_xWRLx432.m`` of TI's tools, for its "Pin0-bit0-Cycle3" mode, without sideband and scrambler. Four
numbers, one of each lane, have four samples: bit ``4 m + lane`` of the sample k is bit ``9 - 3 k + m`` of its number.

I and Q are swapped where the chip's configuration swaps them. Chirps follow each other in the order of their
transmitters' turns.

The board sends packets of 1456 bytes behind a counter of 10 bytes (DCA1000EVM User's Guide, 5.2, raw mode). TI's
recorder leaves the counters out and writes zeros for lost packets; other recorders do neither. Packets with counters
come to their places, with zeros between them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.radar.radar import Radar
from radarcore.recording.frame import COUNTS, frame_shape
from radarcore.recording.native import Stored
from radarcore.recording.npy import Converted
from radarcore.units import SPEED_OF_LIGHT

_PART = re.compile(r"(?P<name>.*_Raw_)(?P<number>\d+)(?P<suffix>\.bin)", re.IGNORECASE)
"""Name of one of the files into which the recorder splits a long capture."""

_WORD = np.dtype("<i2")

_PACKET_BYTES = 1456
"""Bytes of samples in a packet."""

_COUNTER_BYTES = 10

_PACKET_WORDS = _PACKET_BYTES // _WORD.itemsize

_PACKET = np.dtype([("number", "<u4"), ("low", "<u4"), ("high", "<u2"), ("words", _WORD, _PACKET_WORDS)])
"""A packet with its counters: its number, the bytes of samples before it (48 bits), samples."""

_MOST_LOST = 100
"""Largest ratio of all bytes by the counters to those in the file."""

_ZERO_WORDS = _PACKET_BYTES // _WORD.itemsize // 2
"""Numbers per group in the search for zeros: half a packet, so that a lost packet covers a whole group."""

_MOST_NAMED = 5
"""Largest number of frames in a message."""


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
        Files that the configuration names; none: the requested file.
    facts : dict
        What a recording's ``source["capture"]`` says besides.
    range_bias : float
        Subtracted from all ranges [m]; of I/Q samples alone.
    is_rdif : bool
        Bits of four samples in four numbers.
    """

    num_lanes: int
    is_real: bool
    has_q_first: bool
    bits: int
    turns: tuple[int, ...]
    files: tuple[Path, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)
    range_bias: float = 0.0
    is_rdif: bool = False


def opened(path: Path, radar: Radar, capture: Capture) -> Stored:
    """Frames of a capture, mapped into memory.

    Warns of lost packets. Leaves out incomplete frames and frames of zeros, which count as lost before the next frame.
    """
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
    kept, lost, num_packets = _whole_frames(files, words)

    row = frame_shape(radar)
    dtype = np.float32 if capture.is_real else np.complex64
    cube: Any = Converted(words, lambda part: samples(part, radar, capture), files[0], row, dtype)
    source = {
        "file": files[0].name,
        **({"files": [file.name for file in files]} if len(files) > 1 else {}),
        "cube_unit": COUNTS,
        "capture": {
            "board": "DCA1000",
            **capture.facts,
            **({"lost_packets": num_packets} if num_packets else {}),
        },
    }
    time = radar.waveform.frame_interval * kept.astype(np.float64)
    return Stored(cube, time, radar, None, source, lost)


def parts_of(path: Path) -> tuple[Path, ...]:
    """Files of the capture that begins in a file: ``NAME_Raw_0.bin`` continues in ``NAME_Raw_1.bin``, ..."""
    match = _PART.fullmatch(path.name)
    if match is None:
        return (path,)
    number = int(match["number"])
    first = path.with_name(f"{match['name']}{number - 1}{match['suffix']}")
    if number > 0 and first.is_file():
        raise ValueError(f"{path}: expected the first file of a capture, got a continuation of {first.name}")
    files = [path]
    while (following := path.with_name(f"{match['name']}{number + len(files)}{match['suffix']}")).is_file():
        files.append(following)
    return tuple(files)


def samples(words: NDArray[np.int16], radar: Radar, capture: Capture) -> NDArray[Any]:
    """Samples (frame, channel, chirp, sample), complex64 or float32, of numbers (frame, word) as they came."""
    num_rx, num_samples, num_turns = len(radar.rx), radar.waveform.num_samples, len(capture.turns)
    words = _of_lanes(words) if capture.is_rdif else words
    chirps = words.reshape(len(words), -1, num_turns, num_rx * num_samples * (1 if capture.is_real else 2))
    values = (chirps << 16 - capture.bits) >> 16 - capture.bits  # the highest bit becomes the sign

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
    result = result.astype(np.float32 if capture.is_real else np.complex64, copy=False)
    return result * _shifts(radar, capture.range_bias) if capture.range_bias else result


def _of_lanes(words: NDArray[np.int16]) -> NDArray[np.int16]:
    """Samples of 12 bits (frame, sample) of numbers (frame, word) from four lanes."""
    bits: NDArray[Any] = words.reshape(len(words), -1, 1, 4) >> np.arange(12, dtype=_WORD)[:, None] & 1
    digits: NDArray[Any] = (bits @ (1 << np.arange(4, dtype=_WORD))).reshape(len(words), -1, 4, 3)[:, :, ::-1]
    found: NDArray[np.int16] = (digits @ (1 << 4 * np.arange(3, dtype=_WORD))).reshape(words.shape)
    return found


def _shifts(radar: Radar, range_bias: float) -> NDArray[np.complex64]:
    """Factors (sample,) that subtract a range from all ranges."""
    waveform = radar.waveform
    delay = 2.0 * range_bias / SPEED_OF_LIGHT
    times = np.arange(waveform.num_samples) / waveform.sample_rate
    shifts: NDArray[np.complex64] = np.exp(-2j * np.pi * waveform.slope * delay * times).astype(np.complex64)
    return shifts


class _Packets:
    """Words of packets in the order of their counters, with zeros in place of lost ones.

    The words begin with the frame that the first packet belongs to.
    """

    def __init__(self, path: Path, num_frame_words: int) -> None:
        size = path.stat().st_size
        self._packets = np.memmap(path, _PACKET, "r", shape=(size // _PACKET.itemsize,))
        # The last packet may be shorter; a rest without a whole counter is ignored.
        rest = size % _PACKET.itemsize
        self._last = np.zeros(int(rest > _COUNTER_BYTES), _PACKET)
        if len(self._last):
            with path.open("rb") as file:
                file.seek(size - rest)
                self._last.view(np.uint8)[:rest] = np.frombuffer(file.read(rest), np.uint8)
        parts = (self._packets, self._last)
        sent = np.concatenate([part["low"] + (part["high"].astype(np.int64) << 32) for part in parts]) // _WORD.itemsize
        starts, self._order = np.unique(sent, return_index=True)
        self._starts = starts - starts[0] // num_frame_words * num_frame_words
        gaps = np.diff(self._starts, prepend=-_PACKET_WORDS) - _PACKET_WORDS
        if (gaps[1:] < 0).any() or self._starts[-1] > _MOST_LOST * max(size, num_frame_words):
            raise ValueError(f"{path}: expected packets of the DCA1000 one after the other, got damaged counters")
        self.num_lost = int((-(-gaps // _PACKET_WORDS)).sum())
        is_short = len(self._last) and self._order[-1] == len(self._packets)
        last = (rest - _COUNTER_BYTES) // _WORD.itemsize if is_short else _PACKET_WORDS
        self._num_words = int(self._starts[-1]) + last

    def __len__(self) -> int:
        return self._num_words

    def __getitem__(self, place: slice) -> NDArray[np.int16]:
        start, stop, _ = place.indices(len(self))
        words = np.zeros(max(0, stop - start), _WORD)
        first, last = np.searchsorted(self._starts, [start - _PACKET_WORDS, stop], side="right")
        for begin, index in zip(self._starts[first:last].tolist(), self._order[first:last].tolist(), strict=True):
            packets, at = (self._packets, index) if index < len(self._packets) else (self._last, 0)
            low, high = max(begin, start), min(begin + _PACKET_WORDS, stop)
            words[low - start : high - start] = packets[at]["words"][low - begin : high - begin]
        return words


def _has_counters(path: Path) -> bool:
    """True for packets that still have their counters."""
    with path.open("rb") as file:
        start = file.read(2 * _PACKET.itemsize)
    if len(start) < 2 * _PACKET.itemsize:
        return False
    packets = np.frombuffer(start, _PACKET)
    numbers, sent = packets["number"].astype(np.int64), packets["low"] + (packets["high"].astype(np.int64) << 32)
    num_packets = numbers[1] - numbers[0]
    return bool(num_packets > 0 and sent[1] - sent[0] == num_packets * _PACKET_BYTES)


def _whole_frames(files: tuple[Path, ...], words: _Words) -> tuple[NDArray[np.int64], NDArray[np.int32] | None, int]:
    """Indices of the frames with samples, frames lost before each (None: not counted), and number of zeroed packets.

    Warns of an incomplete last frame and of zeros in place of packets.
    """
    if words.left_over:
        notice.warn(f"{files[-1]}: {len(words)} frames, the last {words.left_over} bytes are no whole frame")
    shares = words.shares_of_zeros()
    kept = np.flatnonzero(shares < 1.0)
    if not (shares.any() or words.num_lost):
        return kept, None, 0
    if len(kept) == 0:
        notice.warn(f"{files[0]}: all samples are zeros")
        return np.arange(len(words)), None, 0
    # Without counters the zeros tell.
    num_packets = words.num_lost or max(1, round(shares.sum() * words.num_frame_bytes / _PACKET_BYTES))
    about = "" if words.num_lost else "about "
    named = [f"frame {index} ({shares[index]:.0%})" for index in np.flatnonzero(shares)]
    more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
    places = ", ".join(named[:_MOST_NAMED]) or "parts of frames"
    notice.warn(
        f"{files[0]}: zeros in place of {about}{num_packets} lost packets, in {places}{more}; "
        "frames of zeros alone are left out"
    )
    words.keep(kept)
    return kept, (np.diff(kept, prepend=-1) - 1).astype(np.int32), num_packets


class _Words:
    """Whole frames (frame, word) of files that follow each other; a frame may lie in two of them."""

    def __init__(self, files: tuple[Path, ...], num_words: int) -> None:
        sizes = [file.stat().st_size for file in files]
        self.num_bytes, self.num_lost = sum(sizes), 0
        self.num_frame_bytes = num_words * _WORD.itemsize
        self._maps: list[Any]
        if _has_counters(files[0]):
            if len(files) > 1:
                raise ValueError(f"{files[1]}: expected one file of packets with counters, got {len(files)}")
            packets = _Packets(files[0], num_words)
            self._maps, self.num_lost, self.num_bytes = [packets], packets.num_lost, len(packets) * _WORD.itemsize
        else:
            if odd := [file for file, size in zip(files[:-1], sizes, strict=False) if size % _WORD.itemsize]:
                raise ValueError(f"{odd[0]}: expected whole numbers of 16 bits before the next file, got an odd size")
            self._maps = [
                np.memmap(file, _WORD, "r", shape=(size // _WORD.itemsize,))
                for file, size in zip(files, sizes, strict=True)
                if size >= _WORD.itemsize
            ]
        self._ends = np.cumsum([0, *(len(part) for part in self._maps)])
        self._num_words = num_words
        self._kept = np.arange(int(self._ends[-1]) // num_words)
        self.left_over = self.num_bytes - len(self) * self.num_frame_bytes

    def __len__(self) -> int:
        return len(self._kept)

    def __getitem__(self, rows: slice) -> NDArray[np.int16]:
        pieces = [piece for frame in self._kept[rows].tolist() for piece in self._pieces(frame)]
        values: NDArray[np.int16] = np.concatenate(pieces or [np.empty(0, _WORD)])
        return values.reshape(-1, self._num_words)

    def keep(self, frames: NDArray[np.int64]) -> None:
        """Keep only these frames."""
        self._kept = self._kept[frames]

    def shares_of_zeros(self) -> NDArray[np.float64]:
        """Share of each frame (frame,) in zeros of at least half a packet."""
        length = min(_ZERO_WORDS, self._num_words)
        num_groups = self._num_words // length
        frames = (self[index : index + 1][0, : num_groups * length] for index in range(len(self)))
        return np.array([1.0 - words.reshape(-1, length).any(axis=-1).mean() for words in frames])

    def _pieces(self, frame: int) -> list[NDArray[np.int16]]:
        """Numbers of a frame, file by file."""
        start, stop = frame * self._num_words, (frame + 1) * self._num_words
        return [
            part[max(0, start - begin) : stop - begin]
            for part, begin in zip(self._maps, self._ends.tolist(), strict=False)
            if start < begin + len(part) and begin < stop
        ]
