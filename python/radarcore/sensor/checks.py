"""Checks of a board's samples, and the measurements and statistics behind all checks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.recording.frame import NUM_CODES
from radarcore.sensor.bgt60.registers import test_pattern
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.messages import unpack_bits
from radarcore.sensor.errors import SensorError
from radarcore.sensor.interface import Board, RawFrame
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.strata.slices import pack_msb

Result = Literal["PASS", "FAIL", "SKIP"]

_MANY_REASONS = 3
"""Reasons of losses that a text has at most."""

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
"""Noise of a receiver in working order [codes]; none was published for boards with ComLib."""

_WIDE: dict[str, Any] = {"start_frequency": 58e9, "stop_frequency": 63.5e9}
_NARROW: dict[str, Any] = {"start_frequency": 60e9, "stop_frequency": 60.5e9}
"""A sweep with little leakage, which would fill the ADC at high gain."""

_WARM_UP = 8
"""Chirps of a frame until they are alike: the first differ by a few tenths of a code."""

_SETTLING = 16
"""Samples of a chirp after which the noise of its start has gone."""


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes
    ----------
    name : str
    result : str
        ``"PASS"``, ``"FAIL"``, or ``"SKIP"`` for what this board, protocol or chip does not offer.
    measured, expected : str
        Texts for people.
    values : dict
        Numbers behind them, ready for JSON.

    See Also
    --------
    sensor.Sensor.selftest : Makes them.

    Examples
    --------
    >>> check = rc.sensor.Check("frames", "PASS", measured="100 frames", expected="100 frames")
    >>> check.result
    'PASS'
    """

    name: str
    result: Result
    measured: str
    expected: str
    values: dict[str, Any] = field(default_factory=dict)


def judged(name: str, is_good: object, measured: str, expected: str, /, **values: Any) -> Check:
    """A check that passes if what was measured is good, and is skipped where that is None."""
    result: Result = "SKIP" if is_good is None else "PASS" if is_good else "FAIL"
    return Check(name, result, measured, expected, values)


def set_to(board: Board, radar: Radar, **options: Any) -> float:
    """Configure a board; the interval of frames that it has then [s]."""
    try:
        return board.configure(radar, **options).waveform.frame_interval
    except ValueError as error:
        raise SensorError(f"{board.info.port}: the board's own settings are beyond its limits: {error}") from error


def reasons_of(frames: list[RawFrame]) -> str:
    """Reasons of losses between frames in words: the first ones, as each may have numbers of its own."""
    reasons = list(dict.fromkeys(reason for frame in frames for reason in frame.lost_reasons))
    more = f" and {len(reasons) - _MANY_REASONS} more" if len(reasons) > _MANY_REASONS else ""
    return ", ".join(reasons[:_MANY_REASONS]) + more


def measure(board: Board, num_frames: int, interval: float) -> list[RawFrame]:
    """Some frames of a board every `interval` [s]; SensorError where they take far too long."""
    frames: list[RawFrame] = []
    longest = 2.0 + 1.5 * num_frames * interval
    board.start()
    try:
        deadline = time.monotonic() + longest
        while len(frames) < num_frames:
            frames += board.read(0.1)
            if len(frames) < num_frames and time.monotonic() > deadline:
                reasons = "; ".join(filter(None, [reasons_of(frames), board.damage()]))
                raise SensorError(
                    f"{board.info.port}: {len(frames)} of {num_frames} frames, which take "
                    f"{num_frames * interval:.2g} s, came in {longest:.1f} s{': ' + reasons if reasons else ''}"
                )
    finally:
        board.stop()
    return frames[:num_frames]


def with_rx(radar: Radar, indices: list[int]) -> Radar:
    """Radar with some of the receivers of another."""
    return Radar(radar.waveform, tx=radar.tx, rx=radar.rx[indices], pattern=radar.pattern, receiver=radar.receiver)


def pattern_checks(board: StrataBoard) -> Iterator[Check]:
    """The chip's own sequence in place of RX1's samples: reveals changes between the chip and here."""
    radar = bgt60tr13c(num_samples=64, num_chirps=128, chirp_interval=100e-6, frame_interval=50e-3)
    frames = measure(board, 3, set_to(board, with_rx(radar, [0]), has_test_pattern=True))
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
    expected = "001 800 400 200 100 880 440 220 ..., a word per sample"
    yield judged("test pattern", text.startswith("all"), text, expected, first_words=begin, num_words=words.size)


def _difference(words: NDArray[np.uint16], expected: NDArray[np.uint16]) -> str:
    """Places where words differ from the test pattern, and the kind of change if it is a usual one."""
    is_wrong = words != expected
    where = int(np.argmax(is_wrong))
    text = f"word {where} is {words[where]:03X} in place of {expected[where]:03X}"
    text += f", {np.count_nonzero(is_wrong)} of {words.size} differ"
    changes: dict[str, NDArray[Any]] = {
        "bits in reverse order": np.sum([(expected >> bit & 1) << 11 - bit for bit in range(12)], axis=0),
        "samples of each pair exchanged": expected.reshape(-1, 2)[:, ::-1].reshape(-1),
        "packed with the least significant bit first": unpack_bits(pack_msb(expected), len(expected), 12),
        "all bits inverted": expected ^ 0xFFF,
    }
    for name, changed in changes.items():
        if np.array_equal(words, changed):
            return f"{text}: {name}"
    return f"{text}: no pattern, perhaps the receiver's own samples" if is_wrong.mean() > 0.9 else text


def noise_checks(board: StrataBoard) -> Iterator[Check]:
    """Noise at three gains without the transmitter, then what it changes."""
    wide, narrow = (
        bgt60tr13c(**band, num_samples=64, num_chirps=32, chirp_interval=591.125e-6, frame_interval=25e-3)
        for band in (_WIDE, _NARROW)
    )
    off: dict[int, NDArray[np.uint16]] = {}
    for gain, usual in _NOISE.items():
        off[gain] = _codes(board, wide if gain == 23 else narrow, if_gain_db=gain, is_transmitting=False)
        limits = (usual / _BAND, usual * _BAND)
        yield _noise_within(f"noise, {gain} dB, TX off", off[gain], limits, if_gain_db=gain, is_transmitting=False)
    for gain, radar in ((23, wide), (50, narrow)):
        on = _codes(board, radar, if_gain_db=gain)
        noise, least = chirp_noise(on), _QUIETER * chirp_noise(off[gain])
        values = {"noise": noise.tolist(), "if_gain_db": gain, "is_transmitting": True, "clipped": clipped(on)}
        is_good: bool | None = bool(np.all(noise >= least))
        text = f"{_list(noise)} codes"
        if clipped(on) > _MOST_CLIPPED:
            is_good = None
            text = f"{100.0 * clipped(on):.0f} % of the samples at an end of the ADC: nothing may be near the board"
        yield judged(f"noise, {gain} dB, TX on", is_good, text, f"at least {_list(least)} codes", **values)
        if gain == 23:
            change = leakage(on, off[gain])
            text = f"{_list(change)} codes peak to peak"
            expected = f"at least {_LEAST_LEAKAGE:g} codes; 360 to 1240 were seen"
            is_good = bool(np.all(change >= _LEAST_LEAKAGE))
            yield judged("leakage, 23 dB, TX on", is_good, text, expected, leakage=change.tolist())


def comlib_noise_checks(board: ComLibBoard) -> Iterator[Check]:
    """Noise of a board with ComLib, at the gain that it has."""
    check = _noise_within("noise", _codes(board, board.present_radar(50e-3)), _COMLIB_NOISE)
    yield replace(check, expected=f"{check.expected}: no dead or saturated receivers")


def _noise_within(name: str, codes: NDArray[np.uint16], limits: tuple[float, float], **values: Any) -> Check:
    """Noise of all receivers within limits [codes]."""
    noise, (low, high) = chirp_noise(codes), limits
    is_good = bool(np.all((low <= noise) & (noise <= high)))
    expected = f"{low:.2g} to {high:.3g} codes"
    return judged(name, is_good, f"{_list(noise)} codes", expected, noise=noise.tolist(), **values)


def _codes(board: Board, radar: Radar, **options: Any) -> NDArray[np.uint16]:
    """Codes of five frames, (frame, rx, chirp, sample); the first frame of a measurement is left out."""
    frames = measure(board, 6, set_to(board, radar, **options))
    return np.array([frame.codes for frame in frames[1:]])


def _list(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.0f}" if value >= 100.0 else f"{value:.2f}" for value in values)


# Statistics of samples


def chirp_noise(codes: ArrayLike) -> NDArray[np.float64]:
    """Noise from one chirp to the next of each receiver [codes], whatever stands still in front of it.

    Parameters
    ----------
    codes : (frame, rx, chirp, sample)
        Frames are compared with each other where they have fewer than three chirps; the first chirps of a frame and
        the first samples of a chirp are left out where enough remain.

    Returns
    -------
    noise : (rx,) float64
        Standard deviation.
    """
    values = np.asarray(codes, np.float64)
    num_frames, num_rx, num_chirps, num_samples = values.shape
    if num_samples > 2 * _SETTLING:
        values = values[..., _SETTLING:]
    if num_chirps < 3:
        values = values.transpose(1, 0, 2, 3).reshape(1, num_rx, num_frames * num_chirps, -1)
    else:
        values = values[:, :, min(_WARM_UP, num_chirps - 2) :]
    steps = np.diff(values, axis=2)
    noise: NDArray[np.float64] = np.sqrt(0.5 * np.mean(steps * steps, axis=(0, 2, 3)))
    return noise


def leakage(on: ArrayLike, off: ArrayLike) -> NDArray[np.float64]:
    """Leakage of the transmitter into each receiver [codes]: change of the mean chirp, peak to peak.

    Parameters
    ----------
    on, off : (frame, rx, chirp, sample)
        Codes with the transmitter on and off.

    Returns
    -------
    leakage : (rx,) float64
    """
    with_tx, without = (np.asarray(codes, np.float64).mean(axis=(0, 2)) for codes in (on, off))
    change: NDArray[np.float64] = np.ptp(with_tx - without, axis=-1)
    return change


def clipped(codes: ArrayLike) -> float:
    """Part of the samples that are at an end of the ADC's range."""
    values = np.asarray(codes)
    return float(np.mean((values <= 0) | (values >= NUM_CODES - 1)))
