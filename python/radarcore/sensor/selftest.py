"""Checks of a board that a first owner runs: identity, registers, test pattern, noise, transmitter, pace of frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60.readback import COMPARED, stuck_bits, unusual_resets
from radarcore.sensor.bgt60.registers import CHIP_ID, FIFO, chip_name
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.bgt60.slices import choose_slice_size
from radarcore.sensor.board import Board, Lost, RawFrame
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.errors import SensorDisconnectedError, SensorError, SensorTimeoutError
from radarcore.sensor.measured import chirp_noise, clipped, leakage, pace_of
from radarcore.sensor.packing import pack_msb, test_pattern, unpack_lsb
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.transport import KNOWN_BOARDS

Result = Literal["PASS", "FAIL", "SKIP"]

GROUPS = ("identity", "registers", "pattern", "noise", "frames")
"""Groups of checks, in order."""

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

_TEMPERATURES = (0.0, 85.0)
_TEMPERATURE_STEP = 5.0
_RATE_TOLERANCE = 0.01
_JITTER = 5e-3
"""Time by which a host sees frames late now and then [s]; with what is seen, it adds to the tolerance."""
_CLOCK_TOLERANCE = 0.005

_WIDE: dict[str, Any] = {"start_frequency": 58e9, "stop_frequency": 63.5e9}
_NARROW: dict[str, Any] = {"start_frequency": 60e9, "stop_frequency": 60.5e9}
"""A sweep with little leakage, which would fill the ADC at high gain."""


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
    """

    name: str
    result: Result
    measured: str
    expected: str
    values: dict[str, Any] = field(default_factory=dict)


def run_checks(board: Board, groups: Collection[str] = GROUPS, *, duration: float = 2.5) -> Iterator[Check]:
    """Checks of a board, one after the other; it measures only between them, and not at the end.

    Parameters
    ----------
    board : Board
        An open one.
    groups : collection of str
        Some of `GROUPS`.
    duration : float
        Length of the measurement whose frame rate is checked [s].
    """
    if isinstance(board, StrataBoard):
        strata = board
        steps: list[tuple[str, str, Callable[[], Iterator[Check]]]] = [
            ("identity", "identity", lambda: _identity(strata)),
            ("identity", "temperature", lambda: _temperature(strata)),
            ("registers", "registers", lambda: _registers(strata)),
            ("pattern", "test pattern", lambda: _pattern(strata)),
            ("noise", "noise", lambda: _noise(strata)),
            ("frames", "frame rate", lambda: _rate(strata, _usual_radar(), duration)),
            ("frames", "slices", lambda: _slices(strata)),
        ]
    else:
        steps = [
            ("identity", "identity", lambda: _names(board)),
            ("identity", "temperature", lambda: _temperature(board)),
            ("registers", "registers", lambda: _skipped("registers", "the protocol does not show them")),
            ("pattern", "test pattern", lambda: _skipped("test pattern", "the protocol cannot switch it on")),
            ("noise", "noise", lambda: _any_noise(board)),
            ("noise", "transmitter", lambda: _skipped("transmitter", "the protocol cannot switch it off")),
            ("frames", "frame rate", lambda: _rate(board, _present(board, 50e-3), duration)),
            ("frames", "slices", lambda: _skipped("slices", "frames come whole")),
        ]
    is_gone = False
    for group, name, step in steps:
        if group not in groups:
            continue
        if is_gone:
            yield Check(name, "SKIP", "the board does not answer any more", "")
            continue
        try:
            yield from step()
        except SensorError as error:
            # What does not answer a request will not answer the next.
            is_gone = isinstance(error, SensorDisconnectedError | SensorTimeoutError)
            yield Check(name, "FAIL", str(error), "no error")


# Identity


def _identity(board: StrataBoard) -> Iterator[Check]:
    told, again = board.identity(), board.identity()
    ids, name = told["usb_ids"], told["name"]
    known = ", ".join(f"{vendor:04x}:{product:04x}" for vendor, product in KNOWN_BOARDS)
    if ids is None:
        yield Check("USB ids", "SKIP", "the board does not tell", known)
    else:
        text = f"{ids[0]:04x}:{ids[1]:04x}"
        yield _check("USB ids", tuple(ids) in KNOWN_BOARDS, text, f"one of {known}", {"usb_ids": list(ids)})
    yield _check("board name", bool(name), repr(name), "a text", {"name": name})

    version = told["version"]
    extended = f" ({told['extended_version']})" if told["extended_version"] else ""
    yield _check(
        "firmware",
        version[:3] != (0, 0, 0),
        version.firmware + extended,
        "a version; 2.5.5, 2.6.0 and 2.9.0 were seen",
        {"firmware": version.firmware, "extended_version": told["extended_version"]},
    )
    protocol = f"{version.protocol_major}.{version.protocol_minor}"
    yield _check("protocol", version.protocol_major == 4, f"Strata {protocol}", "Strata 4", {"protocol": protocol})
    chip_id = told["chip_id"]
    yield _check(
        "chip id",
        chip_id == 0x000303 and again["chip_id"] == chip_id,
        f"0x{chip_id:06X}, {chip_name(chip_id)}",
        "0x000303, BGT60TR13C, twice",
        {"chip_id": chip_id},
    )
    uuid = told["uuid"]
    if uuid is None or not uuid.strip("0-"):
        yield Check("UUID", "SKIP", "the board has none", "the same twice")
    else:
        yield _check("UUID", again["uuid"] == uuid, uuid, "the same twice", {"uuid": uuid})


def _names(board: Board) -> Iterator[Check]:
    info = board.info
    yield Check("USB ids", "SKIP", "the protocol does not tell", "")
    yield _check("board name", bool(info.name), repr(info.name), "a text", {"name": info.name})
    yield _check("firmware", info.firmware != "0.0.0", info.firmware, "a version", {"firmware": info.firmware})
    yield Check("protocol", "PASS", "ComLib with RBAS and RFMC", "ComLib with RBAS and RFMC")
    yield _check("chip id", info.chip != "", repr(info.chip), "a chip in the descriptions", {"chip": info.chip})
    yield Check("UUID", "SKIP", "the protocol has none", "")


def _temperature(board: Board) -> Iterator[Check]:
    if isinstance(board, ComLibBoard) and not board.has_temperature:
        yield Check("temperature", "SKIP", "the board has no sensor", "")
        return
    values = [board.temperature()]
    time.sleep(0.15)  # a temperature is not asked for more often
    values.append(board.temperature())
    low, high = _TEMPERATURES
    yield _check(
        "temperature",
        all(low <= value <= high for value in values) and abs(values[1] - values[0]) <= _TEMPERATURE_STEP,
        f"{values[0]:.1f} and {values[1]:.1f} deg C",
        f"{low:g} to {high:g} deg C, within {_TEMPERATURE_STEP:g} deg C of each other",
        {"temperatures": values},
    )


# The chip's registers and its link


def _registers(board: StrataBoard) -> Iterator[Check]:
    """Two configurations that differ in as many bits as two can, written and read back."""
    radars = (
        (bgt60tr13c(**_WIDE, num_samples=64, num_chirps=64), {"if_gain_db": 23}),
        (
            _with_rx(bgt60tr13c(start_frequency=61e9, stop_frequency=60e9, num_samples=256, num_chirps=3), [1]),
            {"if_gain_db": 60, "tx_power_level": 10, "highpass_cutoff": 20e3, "is_transmitting": True},
        ),
    )
    board.reset()
    resets = board.read_registers(range(FIFO))
    wrong: dict[int, int] = {}
    first = ""
    try:
        for radar, options in radars:
            settings = Settings.from_radar(radar, **options)
            image = registers_of(settings, choose_slice_size(settings))
            board.write_registers(image)
            read = board.read_registers(range(FIFO))
            for address, bits in stuck_bits(image, read).items():
                first = first or f"0x{address:02X} is 0x{read[address]:06X} in place of 0x{image[address]:06X}"
                wrong[address] = wrong.get(address, 0) | bits
            if read[CHIP_ID] != resets[CHIP_ID]:
                wrong[CHIP_ID] = read[CHIP_ID] ^ resets[CHIP_ID]
                first = first or f"CHIP_ID is 0x{read[CHIP_ID]:06X} in place of 0x{resets[CHIP_ID]:06X}"
    finally:
        board.reset()
    unusual = unusual_resets(resets)
    measured = f"{len(wrong)} of {len(COMPARED)} differ: {first}" if wrong else f"{len(COMPARED)} as written, twice"
    if unusual:
        others = ", ".join(f"0x{address:02X}" for address in list(unusual)[:4])
        measured += f"; {len(unusual)} unlike published values after a reset: {others}"
    yield _check(
        "registers",
        not wrong,
        measured,
        "all as written, but for reserved bits",
        {
            "wrong_bits": {f"0x{address:02X}": f"0x{bits:06X}" for address, bits in wrong.items()},
            "after_reset": {f"0x{address:02X}": f"0x{value:06X}" for address, value in resets.items()},
        },
    )


def _pattern(board: StrataBoard) -> Iterator[Check]:
    """The chip's own sequence in place of RX1's samples: what has been changed between the chip and here."""
    radar = bgt60tr13c(num_samples=64, num_chirps=128, chirp_interval=100e-6, frame_interval=50e-3)
    frames, _ = _measure(board, 3, _set(board, _with_rx(radar, [0]), has_test_pattern=True))
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
    yield _check(
        "test pattern",
        text.startswith("all"),
        text,
        "001 800 400 200 100 880 440 220 ..., a word per sample",
        {"first_words": begin, "num_words": words.size},
    )


def _difference(words: NDArray[np.uint16], expected: NDArray[np.uint16]) -> str:
    """Where words are not those of the test pattern, and how they were changed if that is one of the usual ways."""
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


def _noise(board: StrataBoard) -> Iterator[Check]:
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
        yield _check(
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
            yield _check(name, is_good, f"{_list(noise)} codes", f"at least {_list(least)} codes", values)
        if gain == 23:
            change = leakage(on, off[gain])
            yield _check(
                "leakage, 23 dB, TX on",
                bool(np.all(change >= _LEAST_LEAKAGE)),
                f"{_list(change)} codes peak to peak",
                f"at least {_LEAST_LEAKAGE:g} codes; 360 to 1240 were seen",
                {"leakage": change.tolist()},
            )


def _any_noise(board: Board) -> Iterator[Check]:
    noise = chirp_noise(_codes(board, _present(board, 50e-3)))
    low, high = _COMLIB_NOISE
    yield _check(
        "noise",
        bool(np.all((low <= noise) & (noise <= high))),
        f"{_list(noise)} codes",
        f"{low:g} to {high:g} codes: receivers neither dead nor saturated",
        {"noise": noise.tolist()},
    )


def _codes(board: Board, radar: Radar, **options: Any) -> NDArray[np.uint16]:
    """Codes of five frames, (frame, rx, chirp, sample); the first frame of a measurement is left out."""
    frames, _ = _measure(board, 6, _set(board, radar, **options))
    return np.array([frame.codes for frame in frames[1:]])


# Frames


def _rate(board: Board, radar: Radar, duration: float) -> Iterator[Check]:
    wanted = _set(board, radar)
    num_frames = max(8, round(duration / wanted))
    frames, lost = _measure(board, num_frames, wanted)
    numbers = [frame.index for frame in frames]
    by_host, jitter = pace_of(numbers, [frame.host_time for frame in frames])
    tolerance = _RATE_TOLERANCE + (_JITTER + 2.0 * jitter) / (num_frames * wanted)
    is_good = abs(by_host / wanted - 1.0) <= tolerance
    measured = f"{1.0 / by_host:.2f} Hz by the host's clock with {1e3 * jitter:.1f} ms of jitter"
    values = {"wanted": 1.0 / wanted, "host": 1.0 / by_host, "jitter": jitter}
    stamps = [frame.device_time for frame in frames if frame.device_time is not None]
    if len(stamps) == len(frames):
        by_board, _ = pace_of(numbers, stamps)
        is_good = is_good and abs(by_board / wanted - 1.0) <= _CLOCK_TOLERANCE
        measured += f", {1.0 / by_board:.3f} Hz by the board's"
        values["board"] = 1.0 / by_board
    else:
        measured += ", no time stamps of the board"
    expected = f"{1.0 / wanted:.3f} Hz within {tolerance:.1%}, {_CLOCK_TOLERANCE:.1%} by the board's clock"
    yield _check("frame rate", is_good, measured, expected, values)
    yield _lost("frames lost", frames, lost)


def _slices(board: StrataBoard) -> Iterator[Check]:
    """Frames that need two slices each."""
    radar = board.configure(bgt60tr13c(num_samples=64, num_chirps=64, frame_interval=75e-3))
    frames, lost = _measure(board, 12, radar.waveform.frame_interval)
    size, last = board.slice_size, board.last_slice
    num_slices = frames[0].codes.size // size
    parts = 0 if last is None else last.num_packets
    stamps = "without" if last is None or last.timestamp is None else "with"
    check = _lost("slices", frames, lost)
    facts = f"{num_slices} slices a frame of {size} samples in {parts} packets, {stamps} time stamps"
    values = {"slice_size": size, "packets_per_slice": parts, "has_time_stamps": stamps == "with"}
    yield replace(check, measured=f"{facts}; {check.measured}", values=check.values | values)


def _usual_radar() -> Radar:
    """Frames of one slice, 40 a second."""
    return bgt60tr13c(num_samples=128, num_chirps=16, frame_interval=25e-3)


def _lost(name: str, frames: list[RawFrame], lost: list[Lost]) -> Check:
    number = sum(loss.num_frames for loss in lost)
    reasons = ", ".join(dict.fromkeys(loss.reason for loss in lost))
    because = f": {reasons}" if reasons else ""
    text = f"{number} of {len(frames) + number} frames lost{because}"
    return _check(name, number == 0, text, "0 lost", {"lost": number, "frames": len(frames), "reasons": reasons})


def _present(board: Board, interval: float) -> Radar:
    """The radar that a board with ComLib is set to, at its fastest or every `interval` [s]."""
    if not isinstance(board, ComLibBoard):
        raise SensorError(f"{board.info.port}: expected a board with Strata or ComLib, got {board.info.protocol}")
    radar = board.present_radar()
    waveform = radar.waveform
    return replace(radar, waveform=waveform.replace(frame_interval=max(interval, waveform.frame_interval)))


def _set(board: Board, radar: Radar, **options: Any) -> float:
    """Configure a board; the interval of frames that it has then [s]."""
    try:
        return board.configure(radar, **options).waveform.frame_interval
    except ValueError as error:
        if not isinstance(board, ComLibBoard):
            raise
        raise SensorError(f"{board.info.port}: the board's own settings are beyond its limits: {error}") from error


def _measure(board: Board, num_frames: int, interval: float) -> tuple[list[RawFrame], list[Lost]]:
    """Frames of a measurement, and losses among them; SensorError where they take far too long."""
    frames: list[RawFrame] = []
    lost: list[Lost] = []
    board.start()
    try:
        deadline = time.monotonic() + 2.0 + 1.5 * num_frames * interval
        while len(frames) < num_frames:
            for item in board.read(0.1):
                if isinstance(item, RawFrame):
                    frames.append(item)
                else:
                    lost.append(item)
            if len(frames) < num_frames and time.monotonic() > deadline:
                reasons = ", ".join(dict.fromkeys(loss.reason for loss in lost))
                raise SensorError(
                    f"{board.info.port}: {len(frames)} of {num_frames} frames came in "
                    f"{2.0 + 1.5 * num_frames * interval:.1f} s{': ' + reasons if reasons else ''}"
                )
    finally:
        board.stop()
    return frames[:num_frames], lost


def _with_rx(radar: Radar, indices: list[int]) -> Radar:
    """Radar with some of the receivers of another."""
    return Radar(radar.waveform, tx=radar.tx, rx=radar.rx[indices], pattern=radar.pattern, receiver=radar.receiver)


def _skipped(name: str, reason: str) -> Iterator[Check]:
    yield Check(name, "SKIP", reason, "")


def _check(name: str, is_good: bool, measured: str, expected: str, values: dict[str, Any] | None = None) -> Check:
    return Check(name, "PASS" if is_good else "FAIL", measured, expected, values or {})


def _list(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.0f}" if value >= 100.0 else f"{value:.2f}" for value in values)
