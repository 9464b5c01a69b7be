"""Files of TI's mmWave Studio: ``.mmwave.json`` with the settings of a chip, ``.setup.json`` with what it sent."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PureWindowsPath
from typing import Any

from radarcore import check
from radarcore.recording.native import parsed_json
from radarcore.recording.ti.configuration import BITS, OUTPUTS, Profile, Settings, indices, of_one_profile

SETUP_SUFFIX = ".setup.json"
_MMWAVE_SUFFIX = ".mmwave.json"

_FRAMES = ("legacyFrameChirp", "singleFrameChirp")
"""Waveforms of frames without sub-frames."""

_CHANGES = ("startFreqVar_MHz", "freqSlopeVar_KHz_usec", "idleTimeVar_usec", "adcStartTimeVar_usec")
"""Deviations of a chirp from its profile."""


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
        try:
            return check.number(key, self.value(key))
        except (TypeError, ValueError, OverflowError) as error:  # JSON has integers of any length
            raise ValueError(f"{self.where}: {error}") from error

    def whole(self, key: str, default: int | None = None) -> int:
        """An integer, or a text of one as mmWave Studio writes masks: ``"0xF"``."""
        value = self.value(key) if default is None else self._values.get(key, default)
        try:
            whole = int(value, 0) if isinstance(value, str) else int(check.number(key, value))
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"{self.where}, {key}: expected an integer, got {value!r}") from error
        if not isinstance(value, str) and whole != value:
            raise ValueError(f"{self.where}, {key}: expected an integer, got {value!r}")
        return whole

    def entries(self, key: str, kind: str) -> Iterator[_Table]:
        """Objects of a list, each under the name of its kind; none where there is no list."""
        listed = self._values.get(key, [])
        for index, entry in enumerate(listed if isinstance(listed, list) else [listed]):
            yield _Table(entry, f"{self.where}, {key}[{index}]").table(kind)


def setup_files(path: Path) -> tuple[Path, tuple[Path, ...], str]:
    """Settings file and captured files that a setup names, those beside it, and the chip."""
    setup = _Table(parsed_json(path.read_bytes(), str(path)), str(path))
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
    return _Table(parsed_json(setup.read_bytes(), str(setup)), str(setup)).text("mmWaveDevice")


def settings(values: dict[str, Any], where: str, device: str) -> Settings:
    """Settings of a chip from the content of a ``.mmwave.json``."""
    devices = _Table(values, where).value("mmWaveDevices")
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
    bits, output = form.whole("b2AdcBits"), form.whole("b2AdcOutFmt")
    if not 0 <= bits < len(BITS) or not 0 <= output < len(OUTPUTS):
        raise ValueError(f"{where}: expected b2AdcBits and b2AdcOutFmt of 0 to 2, got {bits} and {output}")
    order = data.table("rlDevDataFmtCfg_t")
    content = data.table("rlDevDataPathCfg_t").whole("transferFmtPkt0", 1) if data.has("rlDevDataPathCfg_t") else 1
    if content != 1:
        raise ValueError(f"{where}: expected samples alone (transferFmtPkt0 0x1), got {content:#x}")
    lanes = data.table("rlDevLaneEnable_t").whole("laneEn")
    return Settings(
        profile=_profile(rf, number, where),
        tx_masks=masks,
        num_loops=frame.whole("numLoops"),
        frame_interval=1e-3 * frame.number("framePeriodicity_msec"),
        rx_mask=rf.table("rlChanCfg_t").whole("rxChannelEn"),
        output=OUTPUTS[output],
        bits=BITS[bits],
        num_lanes=abs(lanes).bit_count(),
        has_q_first=bool(order.whole("iqSwapSel")),
        is_interleaved=not order.whole("chInterleave"),
        device=device,
    )


def _chirps(rf: _Table, frame: _Table, where: str) -> tuple[tuple[int, ...], int]:
    """Masks of the transmitters of the chirps of a loop, and the number of their profile."""
    first, last = frame.whole("chirpStartIdx"), frame.whole("chirpEndIdx")
    chirps: dict[int, tuple[int, int]] = {}
    for entry in rf.entries("rlChirps", "rlChirpCfg_t"):
        for index in indices(entry.whole("chirpStartIdx"), entry.whole("chirpEndIdx"), where):
            changed = [name for name in _CHANGES if entry.has(name) and entry.number(name) != 0.0]
            if changed and first <= index <= last:
                raise ValueError(
                    f"{where}: expected chirps as their profile has them, got {changed[0]} of chirp {index}"
                )
            chirps[index] = entry.whole("profileId"), entry.whole("txEnable")
    for entry in rf.entries("rlBpmChirps", "rlBpmChirpCfg_t"):
        is_used = entry.whole("chirpStartIdx") <= last and entry.whole("chirpEndIdx") >= first
        if is_used and entry.whole("constBpmVal") != 0:
            raise ValueError(f"{where}: expected transmitters that take turns, got binary phases (rlBpmChirps)")
    return of_one_profile(chirps, indices(first, last, where), "rlChirps", where)


def _profile(rf: _Table, number: int, where: str) -> Profile:
    profiles = {entry.whole("profileId"): entry for entry in rf.entries("rlProfiles", "rlProfileCfg_t")}
    if number not in profiles:
        raise ValueError(f"{where}: expected profile {number}, which chirps have, got {sorted(profiles) or 'none'}")
    profile = profiles[number]
    return Profile(
        start_frequency=1e9 * profile.number("startFreqConst_GHz"),
        slope=1e12 * profile.number("freqSlopeConst_MHz_usec"),
        idle_time=1e-6 * profile.number("idleTimeConst_usec"),
        adc_start_time=1e-6 * profile.number("adcStartTimeConst_usec"),
        ramp_end_time=1e-6 * profile.number("rampEndTime_usec"),
        num_samples=profile.whole("numAdcSamples"),
        sample_rate=1e3 * profile.number("digOutSampleRate"),
    )


def _beside(path: Path, name: str) -> Path:
    """File beside another; of what is the path on somebody's Windows, the last part."""
    return path.with_name(PureWindowsPath(name).name or "?")
