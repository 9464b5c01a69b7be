"""Commands for the demos of TI's SDKs, ``.cfg``: one a line, its name and numbers.

TI, "mmWave SDK User Guide", configuration (.cfg) file format; antGeometry0, antGeometry1 and antPhaseRot: TI, "3D
People Counting", configuration parameters; frameCfg with 8 numbers and antGeometryCfg: TI, MCU+ SDK for xWR29xx. Of the
mmWave L-SDK (xWRL6432, xWRL6844): ``mmw_cli.c`` of its demos. Only commands that decide on samples are read, and
``sensorPosition``: ``eulerRot`` of TI's Applications Visualizer has the signs of its angles.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from radarcore import check
from radarcore.recording.ti.boards import Board, of_channels
from radarcore.recording.ti.configuration import NUM_RX, Profile, Settings, chirps_of_frame

_PLATFORM = re.compile(r"%\s*Platform\s*:\s*(\S+)", re.IGNORECASE)
"""Comment in which TI's visualizer says what a file is for."""

_LENGTHS = {
    "dfeDataOutputMode": (1,),
    "channelCfg": (3,),
    "adcCfg": (2,),
    "adcbufCfg": (4, 5),
    "profileCfg": (14,),
    "chirpCfg": (8,),
    "frameCfg": (7, 8),
    "bpmCfg": (4,),
    "lvdsStreamCfg": (4,),
    "compRangeBiasAndRxChanPhase": tuple(1 + 2 * NUM_RX * num_tx for num_tx in (1, 2, 3, 4)),
    "antGeometry0": (4, 8, 12),
    "antGeometry1": (4, 8, 12),
    "antPhaseRot": (4, 8, 12),
    "antGeometryCfg": (34,),
    "sensorPosition": (3, 5),
}
"""Numbers of the commands that count."""

_L_LENGTHS = {
    "channelCfg": (3,),
    "chirpComnCfg": (7,),
    "chirpTimingCfg": (5,),
    "frameCfg": (6,),
    "antGeometryCfg": (12, 14, 32, 34),
    "antGeometryTX": (8,),
    "antGeometryRX": (8,),
    "antGeometryDist": (2,),
    "antGeometry0": (16,),
    "antGeometry1": (16,),
    "antPhaseRot": (16,),
    "compRangeBiasAndRxChanPhase": (13, 33),
    "adcLogging": (1, 2, 3, 4, 5),
    "sensorPosition": (3, 5),
}
"""Commands of the L-SDK, likewise."""

_OF_L_SDK = re.compile(r"^\s*chirp(Comn|Timing)Cfg\b", re.MULTILINE)
"""Commands of the SDK for chips such as xWRL6432, whose other commands have different arguments."""

_L_BOARD = re.compile(r"^\s*antGeometryBoard\s+(\S+)", re.MULTILINE)

_LOGGING = (0.0, 2.0, 0.0)
"""Sideband, swizzling and scrambler of captures that are read, by ``adcLogging`` of an xWRL6432."""

_Commands = dict[str, list[list[float]]]


def settings(text: str, where: str) -> Settings:
    """Settings of a chip from the text of a .cfg file."""
    if _OF_L_SDK.search(text):
        return _l_settings(text, where)
    commands = _commands(text, where, _LENGTHS)
    if commands.get("dfeDataOutputMode", [[1.0]])[-1][0] != 1.0 or "advFrameCfg" in commands:
        raise ValueError(f"{where}: expected chirps in frames (dfeDataOutputMode 1), got sub-frames or no frames")
    _check_stream(commands, where)
    rx_mask, _, _ = _only(commands, "channelCfg", where)
    bits, output = (int(value) for value in _only(commands, "adcCfg", where))
    # The number of the sub-frame came with later versions.
    is_real, swap, is_apart, _ = _only(commands, "adcbufCfg", where)[-4:]
    first, last, num_loops, *_, frame_interval, _, _ = _only(commands, "frameCfg", where)
    masks, number = _chirps(commands, int(first), int(last), where)
    if (output == 0) != bool(is_real):
        got = f"adcCfg {bits} {output} and {'real' if is_real else 'complex'} samples by adcbufCfg"
        raise ValueError(f"{where}: expected adcCfg of the samples that adcbufCfg has, got {got}")
    return Settings(
        profile=_profile(commands, number, where),
        tx_masks=masks,
        num_loops=int(num_loops),
        frame_interval=1e-3 * frame_interval,
        rx_mask=int(rx_mask),
        output=output,
        bits=bits,
        num_lanes=2 if is_apart else 4,
        has_q_first=bool(swap),
        is_interleaved=not is_apart,
        device=match[1] if (match := _PLATFORM.search(text)) else "",
        **_compensation(commands, where),
        board=_geometry(commands, where),
        mount=_mount(commands, where),
    )


def _l_settings(text: str, where: str) -> Settings:
    """Settings of a low-power chip: real samples, chirps in bursts, transmitters in turn."""
    commands = _commands(text.replace("antGeometryRx", "antGeometryRX"), where, _L_LENGTHS)
    match = _L_BOARD.search(text) or _PLATFORM.search(text)
    device = match[1] if match else ""
    rx_mask, tx_mask, _ = (int(value) for value in _only(commands, "channelCfg", where))
    places = commands.get("antGeometryCfg", [[]])[0]
    is_in_cabin = "antGeometry0" in commands
    is_6844 = "L684" in device or "antGeometryTX" in commands or is_in_cabin or rx_mask > 7 or len(places) > 14
    if is_6844 and not is_in_cabin:  # two bits per antenna
        rx_mask, tx_mask = (sum(bool(mask >> 2 * k & 3) << k for k in range(4)) for mask in (rx_mask, tx_mask))
    divider, _, _, num_samples, pattern, ramp_end, _ = _only(commands, "chirpComnCfg", where)
    idle, skipped, _, slope, start = _only(commands, "chirpTimingCfg", where)
    num_chirps, accumulated, burst_interval, num_bursts, frame_interval, _ = _only(commands, "frameCfg", where)
    rate = (200e3 if is_6844 else 100e3) / check.positive("chirpComnCfg", divider)
    tx_masks = tuple(1 << k for k in range(4) if tx_mask >> k & 1)
    if accumulated > 1.0:
        raise ValueError(f"{where}: expected chirps one by one (frameCfg), got sums of {accumulated:g}")
    if pattern != 1.0 and len(tx_masks) > 1:
        raise ValueError(f"{where}: expected transmitters that take turns (chirpComnCfg, pattern 1), got {pattern:g}")
    num_loops, rest = divmod(int(num_chirps * num_bursts), max(1, len(tx_masks)))
    if rest or not tx_masks:
        raise ValueError(
            f"{where}: expected equal numbers of chirps per transmitter (frameCfg), got {num_loops} and {rest}"
        )
    has_pauses = num_bursts > 1.0 and abs(burst_interval - num_chirps * (idle + ramp_end)) > 1e-6
    if has_pauses and num_chirps != len(tx_masks):
        raise ValueError(f"{where}: expected bursts of one chirp per transmitter, or without pauses between them")
    is_logged, *logging = commands.get("adcLogging", [[0.0]])[-1]
    is_rdif = is_logged == 1.0 and not is_6844
    if is_rdif and tuple(logging[:3]) != _LOGGING:
        got = " ".join(f"{value:g}" for value in (is_logged, *logging))
        raise ValueError(f"{where}: expected samples alone in known bits (adcLogging 1 0 2 0, or 0), got {got}")
    return Settings(
        profile=Profile(start, slope, idle, 1e3 * skipped / rate, ramp_end, num_samples, rate),
        tx_masks=tx_masks,
        num_loops=num_loops,
        frame_interval=1e-3 * frame_interval,
        rx_mask=rx_mask,
        output=0,
        bits=0 if is_rdif else 2,
        num_lanes=2 if is_6844 else 4 if is_rdif else 0,
        has_q_first=False,
        is_interleaved=is_rdif,
        is_rdif=is_rdif,
        device=device or ("xWRL6844" if is_6844 else "xWRL6432"),
        **_compensation(commands, where, 4 if is_6844 else 3),
        board=_l_geometry(commands, places, where) or _geometry(commands, where),
        round_interval=1e-6 * burst_interval if has_pauses else None,
        mount=_mount(commands, where),
    )


def _mount(commands: _Commands, where: str) -> dict[str, list[float]] | None:
    """Pose of the radar over the floor: TI has x to the right, azimuths to the right, elevations down, in degrees."""
    if "sensorPosition" not in commands:
        return None
    *place, azimuth, elevation = _only(commands, "sensorPosition", where)
    right, forward, up = place if len(place) == 3 else (0.0, 0.0, *place)
    return {"position": [forward, -right, up], "rpy": [0.0, math.radians(elevation), -math.radians(azimuth)]}


def _geometry(commands: _Commands, where: str) -> Board | None:
    """Antennas that the file has: antGeometry0 counts to the right and antGeometry1 up, rows of antGeometryCfg down."""
    if "antGeometryCfg" in commands:
        *steps, across, down = _only(commands, "antGeometryCfg", where)
        pairs = np.array(steps).reshape(-1, 2)
        return of_channels(np.column_stack([2.0 * across * pairs[:, 1], -2.0 * down * pairs[:, 0]]), NUM_RX, where)
    if not {"antGeometry0", "antGeometry1"} <= commands.keys():
        return None
    right, up = (np.array(_only(commands, name, where)) for name in ("antGeometry0", "antGeometry1"))
    signs = _only(commands, "antPhaseRot", where) if "antPhaseRot" in commands else np.ones(len(right))
    if not len(right) == len(up) == len(signs):
        raise ValueError(f"{where}: expected antGeometry0, antGeometry1 and antPhaseRot of the same channels")
    return of_channels(np.column_stack([-right, up]), NUM_RX, where, signs)


def _l_geometry(commands: _Commands, places: list[float], where: str) -> Board | None:
    """Antennas that the file has: rows upwards and columns to the left, with their spacing in mm."""
    if places:
        distances = places[-2:] if len(places) in (14, 34) else None
        pairs = np.array(places[:12] if len(places) < 32 else places[:32]).reshape(-1, 2)
        num_rx = 3 if len(pairs) == 6 else NUM_RX
    elif {"antGeometryTX", "antGeometryRX"} <= commands.keys():
        tx, rx = (np.array(_only(commands, f"antGeometry{kind}", where)).reshape(-1, 2) for kind in ("TX", "RX"))
        pairs, num_rx = (tx[:, None] + rx).reshape(-1, 2), NUM_RX
        distances = commands.get("antGeometryDist", [None])[0]
    else:
        return None
    spacing = None if distances is None else (1e-3 * distances[0], 1e-3 * distances[1])
    return of_channels(pairs[:, ::-1], num_rx, where, spacing=spacing)


def _commands(text: str, where: str, lengths_of: dict[str, tuple[int, ...]]) -> _Commands:
    """Numbers of the commands that count, by name."""
    found: _Commands = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("%")[0].split()
        if not words or words[0] not in {*lengths_of, "advFrameCfg"}:
            continue
        name, values = words[0], words[1:]
        expected = lengths_of.get(name, (len(values),))
        try:
            numbers = [check.number(name, float(value)) for value in values]
        except ValueError:
            raise ValueError(f"{where}, line {number}: expected numbers after {name}, got {line.strip()!r}") from None
        if len(numbers) not in expected:
            lengths = " or ".join(map(str, expected))
            raise ValueError(f"{where}, line {number}: expected {lengths} numbers after {name}, got {len(numbers)}")
        found.setdefault(name, []).append(numbers)
    return found


def _only(commands: _Commands, name: str, where: str) -> list[float]:
    """Numbers of a command; of several lines they must be the same."""
    lines = commands.get(name, [])
    if not lines:
        raise ValueError(f"{where}: expected the command {name}, got none")
    if any(line != lines[0] for line in lines):
        raise ValueError(f"{where}: expected one {name}, got {len(lines)} that differ")
    return lines[0]


def _check_stream(commands: _Commands, where: str) -> None:
    """Refuse streams of something else than samples, and binary phases."""
    if any(line[1] != 0.0 for line in commands.get("bpmCfg", [])):
        raise ValueError(f"{where}: expected transmitters that take turns, got binary phase modulation (bpmCfg)")
    for _, has_header, content, is_by_software in commands.get("lvdsStreamCfg", []):
        if (has_header, content, is_by_software) != (0.0, 1.0, 0.0):
            got = f"{has_header:g} {content:g} {is_by_software:g}"
            raise ValueError(f"{where}: expected samples alone (lvdsStreamCfg -1 0 1 0), got {got}")


def _chirps(commands: _Commands, first: int, last: int, where: str) -> tuple[tuple[int, ...], int]:
    """Masks of the transmitters of the chirps of a loop, and the number of their profile."""
    entries = [
        ("changes" if any(changes) else "", int(start), int(stop), int(profile), int(mask))
        for start, stop, profile, *changes, mask in commands.get("chirpCfg", [])
    ]
    return chirps_of_frame(entries, first, last, "chirpCfg", where)


def _compensation(commands: _Commands, where: str, num_rx: int = NUM_RX) -> dict[str, Any]:
    """Range bias and factors of the channels: pairs of real and imaginary parts, receivers of TX1 first.

    The demo subtracts the bias from ranges and multiplies a channel by its factor before it looks for angles.
    """
    if "compRangeBiasAndRxChanPhase" not in commands:
        return {}
    bias, *parts = _only(commands, "compRangeBiasAndRxChanPhase", where)
    pairs = np.array(parts).reshape(-1, num_rx, 2)
    return {"range_bias": bias, "coefficients": pairs[..., 0] + 1j * pairs[..., 1]}


def _profile(commands: _Commands, number: int, where: str) -> Profile:
    lines = {int(line[0]): line for line in commands.get("profileCfg", [])}
    if number not in lines:
        raise ValueError(f"{where}: expected profileCfg {number}, which chirps have, got {sorted(lines) or 'none'}")
    _, start, idle, adc_start, ramp_end, _, _, slope, _, num_samples, rate, *_ = lines[number]
    return Profile(start, slope, idle, adc_start, ramp_end, num_samples, rate)
