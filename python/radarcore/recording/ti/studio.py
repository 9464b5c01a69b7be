"""Files of TI's mmWave Studio: ``.mmwave.json`` with the settings of a chip, ``.setup.json`` with what it sent."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from pathlib import Path, PureWindowsPath
from typing import Any

from radarcore import check
from radarcore.recording.native import parsed_json
from radarcore.recording.ti.configuration import Profile, Settings, chirps_of_frame

SETUP_SUFFIX = ".setup.json"
_MMWAVE_SUFFIX = ".mmwave.json"

_FRAMES = ("legacyFrameChirp", "singleFrameChirp")
"""Waveforms of frames without sub-frames."""

_CHANGES = ("startFreqVar_MHz", "freqSlopeVar_KHz_usec", "idleTimeVar_usec", "adcStartTimeVar_usec")
"""Deviations of a chirp from its profile."""

_CHIRP = ("chirpStartIdx", "chirpEndIdx", "profileId", "txEnable")
"""Keys of a chirp: first and last index, profile, mask."""

_PROFILE = (
    "startFreqConst_GHz",
    "freqSlopeConst_MHz_usec",
    "idleTimeConst_usec",
    "adcStartTimeConst_usec",
    "rampEndTime_usec",
    "numAdcSamples",
    "digOutSampleRate",
)
"""Keys of a profile in the order of `Profile`."""


class _Table:
    """Object of a JSON file, whose faults name file and key."""

    def __init__(self, values: object, where: str) -> None:
        if not isinstance(values, dict):
            raise ValueError(f"{where}: expected an object, got {type(values).__name__}")
        self._values, self.where = values, where

    def has(self, key: str) -> bool:
        return key in self._values

    def value(self, key: str) -> Any:
        if key not in self._values:
            raise ValueError(f"{self.where}: expected the key {key!r}, got none")
        return self._values[key]

    def table(self, key: str) -> _Table:
        return _Table(self.value(key), f"{self.where}, {key}")

    def text(self, key: str) -> str:
        return str(self._values.get(key, ""))

    def number(self, key: str) -> float:
        value = self.value(key)
        with check.located(self.where):
            return check.number(key, value)

    def whole(self, key: str) -> int:
        """An integer, or a text of one as mmWave Studio writes masks: ``"0xF"``."""
        value = self.value(key)
        with check.located(f"{self.where}, {key}"):
            return int(value, 0) if isinstance(value, str) else operator.index(value)

    def entries(self, key: str, kind: str) -> Iterator[_Table]:
        """Objects of a list, each under the name of its kind; none where there is no list."""
        listed = self._values.get(key, [])
        for index, entry in enumerate(listed if isinstance(listed, list) else [listed]):
            yield _Table(entry, f"{self.where}, {key}[{index}]").table(kind)


def _table(path: Path) -> _Table:
    """The object of a JSON file."""
    return _Table(parsed_json(path.read_bytes(), str(path)), str(path))


def setup_files(path: Path) -> tuple[Path, tuple[Path, ...], str]:
    """Settings file and captured files that a setup names, those beside it, and the chip."""
    setup = _table(path)
    settings_file = _beside(path, setup.text("configUsed"))
    if not settings_file.is_file():
        raise ValueError(f"{path}: expected {settings_file.name} beside it, the configUsed, got no such file")
    names = []
    if setup.has("capturedFiles"):
        listed = setup.table("capturedFiles").value("files")
        for index, entry in enumerate(listed if isinstance(listed, list) else [listed]):
            file = _Table(entry, f"{path}, capturedFiles.files[{index}]")
            choices = [_beside(path, file.text(key)) for key in ("processedFileName", "rawFileName") if file.text(key)]
            there = [choice for choice in choices if choice.is_file()]
            if not there:
                got = " or ".join(choice.name for choice in choices) or "no name"
                raise ValueError(f"{path}: expected captured files beside it, got no {got}")
            names.append(there[0])
    return settings_file, tuple(names), setup.text("mmWaveDevice")


def device_beside(path: Path) -> str:
    """Chip that the setup of the same name beside a settings file names; nothing without one."""
    setup = path.with_name(path.name.removesuffix(_MMWAVE_SUFFIX) + SETUP_SUFFIX)
    if not path.name.endswith(_MMWAVE_SUFFIX) or not setup.is_file():
        return ""
    return _table(setup).text("mmWaveDevice")


def settings(path: Path, device: str) -> Settings:
    """Settings of a chip from a ``.mmwave.json``."""
    where = str(path)
    devices = _table(path).value("mmWaveDevices")
    listed = devices if isinstance(devices, list) else [devices]
    if len(listed) != 1:
        raise ValueError(f"{where}: expected one device, got {len(listed)} (cascaded chips)")
    one = _Table(listed[0], f"{where}, mmWaveDevices[0]")
    rf, data = one.table("rfConfig"), one.table("rawDataCaptureConfig")
    if (kind := rf.text("waveformType") or _FRAMES[0]) not in _FRAMES:
        raise ValueError(f"{where}: expected frames without sub-frames ({_FRAMES[0]}), got {kind!r}")
    frame = rf.table("rlFrameCfg_t")
    masks, number = _chirps(rf, frame, where)
    form = rf.table("rlAdcOutCfg_t").table("fmt")
    order = data.table("rlDevDataFmtCfg_t")
    content = data.table("rlDevDataPathCfg_t").whole("transferFmtPkt0") if data.has("rlDevDataPathCfg_t") else 1
    if content != 1:
        raise ValueError(f"{where}: expected samples alone (transferFmtPkt0 0x1), got {content:#x}")
    lanes = data.table("rlDevLaneEnable_t").whole("laneEn")
    return Settings(
        profile=_profile(rf, number, where),
        tx_masks=masks,
        num_loops=frame.whole("numLoops"),
        frame_interval=1e-3 * frame.number("framePeriodicity_msec"),
        rx_mask=rf.table("rlChanCfg_t").whole("rxChannelEn"),
        output=form.whole("b2AdcOutFmt"),
        bits=form.whole("b2AdcBits"),
        num_lanes=abs(lanes).bit_count(),
        has_q_first=bool(order.whole("iqSwapSel")),
        is_interleaved=not order.whole("chInterleave"),
        device=device,
    )


def _chirps(rf: _Table, frame: _Table, where: str) -> tuple[tuple[int, ...], int]:
    """Masks of the transmitters of the chirps of a loop, and the number of their profile."""
    first, last = frame.whole("chirpStartIdx"), frame.whole("chirpEndIdx")
    entries = []
    for entry in rf.entries("rlChirps", "rlChirpCfg_t"):
        changed = [name for name in _CHANGES if entry.has(name) and entry.number(name) != 0.0]
        start, stop, profile, mask = map(entry.whole, _CHIRP)
        entries.append((changed[0] if changed else "", start, stop, profile, mask))
    for entry in rf.entries("rlBpmChirps", "rlBpmChirpCfg_t"):
        is_used = entry.whole("chirpStartIdx") <= last and entry.whole("chirpEndIdx") >= first
        if is_used and entry.whole("constBpmVal") != 0:
            raise ValueError(f"{where}: expected transmitters that take turns, got binary phases (rlBpmChirps)")
    return chirps_of_frame(entries, first, last, "rlChirps", where)


def _profile(rf: _Table, number: int, where: str) -> Profile:
    profiles = {entry.whole("profileId"): entry for entry in rf.entries("rlProfiles", "rlProfileCfg_t")}
    if number not in profiles:
        raise ValueError(f"{where}: expected profile {number}, which chirps have, got {sorted(profiles) or 'none'}")
    return Profile(*map(profiles[number].number, _PROFILE))


def _beside(path: Path, name: str) -> Path:
    """File beside another; of a Windows path the last part."""
    return path.with_name(PureWindowsPath(name).name or "?")
