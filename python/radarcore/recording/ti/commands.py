"""Commands for the demo of TI's mmWave SDK, ``.cfg``: one a line, its name and numbers.

TI, "mmWave SDK User Guide", configuration (.cfg) file format. Only what decides on samples is read.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from radarcore import check
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
    "frameCfg": (7,),
    "bpmCfg": (4,),
    "lvdsStreamCfg": (4,),
    "compRangeBiasAndRxChanPhase": tuple(1 + 2 * NUM_RX * num_tx for num_tx in (1, 2, 3, 4)),
}
"""Numbers of the commands that count."""

_OF_L_SDK = ("chirpComnCfg", "chirpTimingCfg")
"""Commands of the SDK for chips such as xWRL6432, whose other commands have different arguments."""

_Commands = dict[str, list[list[float]]]


def settings(text: str, where: str) -> Settings:
    """Settings of a chip from the text of a .cfg file."""
    if other := next((name for name in _OF_L_SDK if re.search(rf"^\s*{name}\b", text, re.MULTILINE)), None):
        raise ValueError(
            f"{where}: expected commands of TI's mmWave SDK (xWR1xxx, xWR6xxx), got {other} of the mmWave L-SDK for "
            "low-power chips (xWRL6432, xWRL1432), which is not read; describe the radar in a scene file"
        )
    commands = _commands(text, where)
    if commands.get("dfeDataOutputMode", [[1.0]])[-1][0] != 1.0 or "advFrameCfg" in commands:
        raise ValueError(f"{where}: expected chirps in frames (dfeDataOutputMode 1), got sub-frames or no frames")
    _check_stream(commands, where)
    rx_mask, _, _ = _only(commands, "channelCfg", where)
    bits, output = (int(value) for value in _only(commands, "adcCfg", where))
    # The number of the sub-frame came with later versions.
    is_real, swap, is_apart, _ = _only(commands, "adcbufCfg", where)[-4:]
    first, last, num_loops, _, frame_interval, _, _ = _only(commands, "frameCfg", where)
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
    )


def _commands(text: str, where: str) -> _Commands:
    """Numbers of the commands that count, by name."""
    found: _Commands = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("%")[0].split()
        if not words or words[0] not in {*_LENGTHS, "advFrameCfg"}:
            continue
        name, values = words[0], words[1:]
        expected = _LENGTHS.get(name, (len(values),))
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


def _compensation(commands: _Commands, where: str) -> dict[str, Any]:
    """Range bias and factors of the channels: pairs of real and imaginary parts, receivers of TX1 first.

    The demo subtracts the bias from ranges and multiplies a channel by its factor before it looks for angles.
    """
    if "compRangeBiasAndRxChanPhase" not in commands:
        return {}
    bias, *parts = _only(commands, "compRangeBiasAndRxChanPhase", where)
    pairs = np.array(parts).reshape(-1, NUM_RX, 2)
    return {"range_bias": bias, "coefficients": pairs[..., 0] + 1j * pairs[..., 1]}


def _profile(commands: _Commands, number: int, where: str) -> Profile:
    lines = {int(line[0]): line for line in commands.get("profileCfg", [])}
    if number not in lines:
        raise ValueError(f"{where}: expected profileCfg {number}, which chirps have, got {sorted(lines) or 'none'}")
    _, start, idle, adc_start, ramp_end, _, _, slope, _, num_samples, rate, *_ = lines[number]
    return Profile(start, slope, idle, adc_start, ramp_end, num_samples, rate)
