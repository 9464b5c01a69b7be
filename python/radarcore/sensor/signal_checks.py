"""Checks of a board's samples: the chip's test pattern, noise of the receivers, leakage of the transmitter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.sensor.board import Board
from radarcore.sensor.checks import Check, judged, measure, present_radar, set_to, with_rx
from radarcore.sensor.packing import pack_msb, test_pattern, unpack_lsb
from radarcore.sensor.signal_statistics import chirp_noise, clipped, leakage
from radarcore.sensor.strata.board import StrataBoard

_NOISE = {23: 1.1, 50: 5.5, 55: 9.8}
"""Noise from chirp to chirp by IF gain [dB: codes], as measured on boards."""
_BAND = 2.0
"""Factor by which the noise of a healthy board may differ from that: gain 3 dB, noise figure 2 dB, other rooms."""
_QUIETER = 0.8
"""With the transmitter on there is no less noise, but for the accuracy of its measurement."""
_LEAST_LEAKAGE = 40.0
"""Leakage of the transmitter at 23 dB and 5.5 GHz, peak to peak [codes]: 360 to 1240 were measured."""
_MOST_CLIPPED = 0.01

_COMLIB_NOISE = (0.2, 500.0)
"""Noise of a receiver that is neither dead nor saturated [codes]; none was published for boards with ComLib."""

_WIDE: dict[str, Any] = {"start_frequency": 58e9, "stop_frequency": 63.5e9}
_NARROW: dict[str, Any] = {"start_frequency": 60e9, "stop_frequency": 60.5e9}
"""A sweep with little leakage, which would fill the ADC at high gain."""


def pattern_checks(board: StrataBoard) -> Iterator[Check]:
    """The chip's own sequence in place of RX1's samples: what has been changed between the chip and here."""
    radar = bgt60tr13c(num_samples=64, num_chirps=128, chirp_interval=100e-6, frame_interval=50e-3)
    frames, _ = measure(board, 3, set_to(board, with_rx(radar, [0]), has_test_pattern=True))
    words = np.array([frame.codes.reshape(-1) for frame in frames])
    size = words.shape[1]
    running = np.array([test_pattern(size, frame.index * size) for frame in frames])
    again = np.array([test_pattern(size)] * len(frames))
    if np.array_equal(words, running):
        text = f"all of {words.size} words, in one run"
    elif np.array_equal(words, again):
        text = f"all of {words.size} words, begun anew with every frame"
    else:
        text = _difference(words.reshape(-1), running.reshape(-1))
    begin = [f"{word:03X}" for word in words[0, :12].tolist()]
    yield judged(
        "test pattern",
        text.startswith("all"),
        text,
        "001 800 400 200 100 880 440 220 ..., a word per sample",
        {"first_words": begin, "num_words": words.size},
    )


def _difference(words: NDArray[np.uint16], expected: NDArray[np.uint16]) -> str:
    """Places where words differ from the test pattern, and the kind of change if it is a usual one."""
    is_wrong = words != expected
    where = int(np.argmax(is_wrong))
    text = f"word {where} is {words[where]:03X} in place of {expected[where]:03X}"
    text += f", {np.count_nonzero(is_wrong)} of {words.size} differ"
    changes: dict[str, NDArray[Any]] = {
        "bits in reverse order": np.sum([(expected >> bit & 1) << 11 - bit for bit in range(12)], axis=0),
        "samples of each pair exchanged": expected.reshape(-1, 2)[:, ::-1].reshape(-1),
        "packed with the least significant bit first": unpack_lsb(pack_msb(expected), len(expected)),
        "all bits inverted": expected ^ 0xFFF,
    }
    for name, changed in changes.items():
        if np.array_equal(words, changed):
            return f"{text}: {name}"
    return f"{text}: no pattern, perhaps the receiver's own samples" if is_wrong.mean() > 0.9 else text


# Receivers and transmitter


def noise_checks(board: StrataBoard) -> Iterator[Check]:
    """Noise at three gains without the transmitter, then what it changes."""
    wide, narrow = (
        bgt60tr13c(**band, num_samples=64, num_chirps=32, chirp_interval=591.125e-6, frame_interval=25e-3)
        for band in (_WIDE, _NARROW)
    )
    off: dict[int, NDArray[np.uint16]] = {}
    for gain, usual in _NOISE.items():
        off[gain] = _codes(board, wide if gain == 23 else narrow, if_gain_db=gain, is_transmitting=False)
        noise = chirp_noise(off[gain])
        low, high = usual / _BAND, usual * _BAND
        yield judged(
            f"noise, {gain} dB, TX off",
            bool(np.all((low <= noise) & (noise <= high))),
            f"{_list(noise)} codes",
            f"{low:.2g} to {high:.2g} codes",
            {"noise": noise.tolist(), "if_gain_db": gain, "is_transmitting": False},
        )
    for gain, radar in ((23, wide), (50, narrow)):
        on = _codes(board, radar, if_gain_db=gain)
        noise, least = chirp_noise(on), _QUIETER * chirp_noise(off[gain])
        name = f"noise, {gain} dB, TX on"
        values = {"noise": noise.tolist(), "if_gain_db": gain, "is_transmitting": True, "clipped": clipped(on)}
        if clipped(on) > _MOST_CLIPPED:
            text = f"{100.0 * clipped(on):.0f} % of the samples at an end of the ADC: nothing may be near the board"
            yield Check(name, "SKIP", text, f"at least {_list(least)} codes", values)
        else:
            is_good = bool(np.all(noise >= least))
            yield judged(name, is_good, f"{_list(noise)} codes", f"at least {_list(least)} codes", values)
        if gain == 23:
            change = leakage(on, off[gain])
            yield judged(
                "leakage, 23 dB, TX on",
                bool(np.all(change >= _LEAST_LEAKAGE)),
                f"{_list(change)} codes peak to peak",
                f"at least {_LEAST_LEAKAGE:g} codes; 360 to 1240 were seen",
                {"leakage": change.tolist()},
            )


def any_noise_checks(board: Board) -> Iterator[Check]:
    """Noise of a board with ComLib, at the gain that it has."""
    noise = chirp_noise(_codes(board, present_radar(board, 50e-3)))
    low, high = _COMLIB_NOISE
    yield judged(
        "noise",
        bool(np.all((low <= noise) & (noise <= high))),
        f"{_list(noise)} codes",
        f"{low:g} to {high:g} codes: receivers neither dead nor saturated",
        {"noise": noise.tolist()},
    )


def _codes(board: Board, radar: Radar, **options: Any) -> NDArray[np.uint16]:
    """Codes of five frames, (frame, rx, chirp, sample); the first frame of a measurement is left out."""
    frames, _ = measure(board, 6, set_to(board, radar, **options))
    return np.array([frame.codes for frame in frames[1:]])


def _list(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.0f}" if value >= 100.0 else f"{value:.2f}" for value in values)
