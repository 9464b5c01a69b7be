"""Checks of a board that a first owner runs: identity, registers, test pattern, noise, transmitter, pace of frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60.registers import CHIP_ID, COMPARED, FIFO, chip_name, stuck_bits, unusual_resets
from radarcore.sensor.bgt60.settings import Settings, choose_slice_size, registers_of
from radarcore.sensor.checks import (
    Check,
    comlib_noise_checks,
    judged,
    measure,
    noise_checks,
    pattern_checks,
    reasons_of,
    set_to,
    with_rx,
)
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.errors import SensorDisconnectedError, SensorError, SensorTimeoutError
from radarcore.sensor.interface import Board, RawFrame
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.transport.ports import KNOWN_BOARDS

GROUPS = ("identity", "registers", "pattern", "noise", "frames")
"""Groups of checks, in order."""

_TEMPERATURES = (0.0, 85.0)
_TEMPERATURE_STEP = 5.0
_RATE_TOLERANCE = 0.01
_JITTER = 2e-3
"""Time by which a host sees frames late now and then [s]."""
_CLOCK_TOLERANCE = 0.005


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
        steps: list[tuple[str, str, Callable[[], Iterator[Check]]]] = [
            ("identity", "identity", partial(_identity, board)),
            ("identity", "temperature", partial(_temperature, board)),
            ("registers", "registers", partial(_registers, board)),
            ("pattern", "test pattern", partial(pattern_checks, board)),
            ("noise", "noise", partial(noise_checks, board)),
            # Frames of one slice, 40 a second.
            ("frames", "frame rate", partial(_rate, board, bgt60tr13c(num_chirps=16, frame_interval=25e-3), duration)),
            ("frames", "slices", partial(_slices, board)),
        ]
    else:
        assert isinstance(board, ComLibBoard)
        present = board.present_radar
        steps = [
            ("identity", "identity", partial(_names, board)),
            ("identity", "temperature", partial(_temperature, board)),
            ("noise", "noise", partial(comlib_noise_checks, board)),
            ("frames", "frame rate", lambda: _rate(board, present(50e-3), duration)),
        ]
    for group in GROUPS:
        if group in groups and group not in {of_group for of_group, _, _ in steps}:
            yield Check(group, "SKIP", "not in the protocol of this board", "")
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
            # A board that misses one request will miss the next.
            is_gone = isinstance(error, SensorDisconnectedError | SensorTimeoutError)
            yield Check(name, "FAIL", str(error), "no error")


# Identity


def _identity(board: StrataBoard) -> Iterator[Check]:
    told, again = board.identity(), board.identity()
    ids, name, version, chip_id, uuid = (told[key] for key in ("usb_ids", "name", "version", "chip_id", "uuid"))
    known = ", ".join(f"{vendor:04x}:{product:04x}" for vendor, product in KNOWN_BOARDS)
    if ids is None:
        yield judged("USB ids", None, "the board does not tell", known)
    else:
        text = f"{ids[0]:04x}:{ids[1]:04x}"
        yield judged("USB ids", tuple(ids) in KNOWN_BOARDS, text, f"one of {known}", usb_ids=list(ids))
    yield judged("board name", name, repr(name), "a text", name=name)

    extended = told["extended_version"]
    text = f"{version.firmware} ({extended})" if extended else version.firmware
    expected = "a version; 2.5.5, 2.6.0 and 2.9.0 were seen"
    values = {"firmware": version.firmware, "extended_version": extended}
    yield judged("firmware", version[:3] != (0, 0, 0), text, expected, **values)
    protocol = f"{version.protocol_major}.{version.protocol_minor}"
    yield judged("protocol", version.protocol_major == 4, f"Strata {protocol}", "Strata 4", protocol=protocol)
    is_good = chip_id == 0x000303 == again["chip_id"]
    text = f"0x{chip_id:06X}, {chip_name(chip_id)}"
    yield judged("chip id", is_good, text, "0x000303, BGT60TR13C, twice", chip_id=chip_id)
    if uuid is None or not uuid.strip("0-"):
        yield judged("UUID", None, "the board has none", "the same twice")
    else:
        yield judged("UUID", again["uuid"] == uuid, uuid, "the same twice", uuid=uuid)


def _names(board: Board) -> Iterator[Check]:
    info = board.info
    yield judged("board name", info.name, repr(info.name), "a text", name=info.name)
    yield judged("firmware", info.firmware != "0.0.0", info.firmware, "a version", firmware=info.firmware)
    yield Check("protocol", "PASS", "ComLib with RBAS and RFMC", "ComLib with RBAS and RFMC")
    yield judged("chip id", info.chip, repr(info.chip), "a chip in the descriptions", chip=info.chip)


def _temperature(board: Board) -> Iterator[Check]:
    if isinstance(board, ComLibBoard) and not board.has_temperature:
        yield judged("temperature", None, "the board has no sensor", "")
        return
    first = board.temperature()
    time.sleep(0.15)  # the interval between temperature requests
    second = board.temperature()
    low, high = _TEMPERATURES
    is_good = low <= min(first, second) and max(first, second) <= high and abs(second - first) <= _TEMPERATURE_STEP
    text = f"{first:.1f} and {second:.1f} deg C"
    expected = f"{low:g} to {high:g} deg C, within {_TEMPERATURE_STEP:g} deg C of each other"
    yield judged("temperature", is_good, text, expected, temperatures=[first, second])


# The chip's registers and its link


def _registers(board: StrataBoard) -> Iterator[Check]:
    """Two configurations that differ in the most bits, written and read back."""
    radars = (
        (bgt60tr13c(start_frequency=58e9, stop_frequency=63.5e9, num_samples=64, num_chirps=64), {"if_gain_db": 23}),
        (
            with_rx(bgt60tr13c(start_frequency=61e9, stop_frequency=60e9, num_samples=256, num_chirps=3), [1]),
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
    wrong_bits = {f"0x{address:02X}": f"0x{bits:06X}" for address, bits in wrong.items()}
    after_reset = {f"0x{address:02X}": f"0x{value:06X}" for address, value in resets.items()}
    expected = "all as written, but for reserved bits"
    yield judged("registers", not wrong, measured, expected, wrong_bits=wrong_bits, after_reset=after_reset)


# Frames


def _rate(board: Board, radar: Radar, duration: float) -> Iterator[Check]:
    wanted = set_to(board, radar)
    num_frames = max(8, round(duration / wanted))
    frames = measure(board, num_frames, wanted)
    numbers = [frame.index for frame in frames]
    by_host, jitter = pace_of(numbers, [frame.host_time for frame in frames])
    # A slope through N points over T has a deviation of sqrt(12 / N) / T of theirs, half of the jitter; three of these.
    tolerance = _RATE_TOLERANCE + (_JITTER + 6.0 * num_frames**-0.5 * jitter) / (num_frames * wanted)
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
    yield judged("frame rate", is_good, measured, expected, **values)
    yield _lost("frames lost", frames)


def pace_of(indices: Sequence[int], times: Sequence[float]) -> tuple[float, float]:
    """Pace of frames from their numbers and times [s], two or more.

    Returns
    -------
    interval : float
        From one frame to the next [s]: the median over distant pairs, robust to late frames.
    jitter : float
        Deviation from that pace that one frame of twenty has [s].
    """
    number, time = np.asarray(indices, np.float64), np.asarray(times, np.float64)
    steps = number[:, None] - number
    is_far = steps >= 0.5 * steps.max()
    interval = float(np.median((time[:, None] - time)[is_far] / steps[is_far]))
    rest = time - interval * number
    return interval, float(np.percentile(np.abs(rest - np.median(rest)), 95.0))


def _slices(board: StrataBoard) -> Iterator[Check]:
    """Frames that need two slices each."""
    radar = board.configure(bgt60tr13c(num_samples=64, num_chirps=64, frame_interval=75e-3))
    frames = measure(board, 12, radar.waveform.frame_interval)
    size, last = board.slice_size, board.last_slice
    num_slices = frames[0].codes.size // size
    parts = 0 if last is None else last.num_packets
    stamps = "without" if last is None or last.timestamp is None else "with"
    check = _lost("slices", frames)
    facts = f"{num_slices} slices a frame of {size} samples in {parts} packets, {stamps} time stamps"
    values = {"slice_size": size, "packets_per_slice": parts, "has_time_stamps": stamps == "with"}
    yield replace(check, measured=f"{facts}; {check.measured}", values=check.values | values)


def _lost(name: str, frames: list[RawFrame]) -> Check:
    number = frames[-1].index + 1 - len(frames)
    reasons = reasons_of(frames)
    because = f": {reasons}" if reasons else ""
    text = f"{number} of {len(frames) + number} frames lost{because}"
    return judged(name, number == 0, text, "0 lost", lost=number, frames=len(frames), reasons=reasons)
