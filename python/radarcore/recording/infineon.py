"""Recording folders of Infineon's tools: codes of the ADC with the settings of the chip, read and written.

The folder has a fixed layout (Strata, ifxDAQ recording folder)::

    meta.json                      when and where
    RadarIfxAvian_00/
        format.version             1.0.0
        meta.json                  sensor, firmware, resolution of the ADC
        config.json                what was asked of the chip
        radar.npy                  codes [frame, receiver, chirp, sample], uint16

The values of its texts are kept in ``source["infineon"]`` and written again; settings follow the radar.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from radarcore import _core, check, notice
from radarcore.output import Lock, make_folder, new_file, replaces
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.recording.frame import FULL_SCALE, NUM_CODES, frame_shape, to_codes, to_samples
from radarcore.recording.native import UNITS, Stored, json_text, parsed_json, warn_of_missing
from radarcore.recording.npy import ArrayFile, Converted

_FOLDER = re.compile(r"RadarIfxAvian_\d+")
_FIRST_FOLDER = "RadarIfxAvian_00"
_ADC_DELAY = 3.1125e-6
"""Time from the start of the ramp to the first sample [s]: 249 cycles of 80 MHz, the same in every setting."""
_HEADER_BYTES = 1024
"""Length of the header of radar.npy as the recorder writes it."""
_CHUNK = 64
"""Frames that are written at once."""

# Content of the texts of a recording, unless source["infineon"] says otherwise; the chip's settings are those it wakes
# up with (Strata, factory default).
_SETTINGS: dict[str, Any] = {
    "aaf_cutoff_Hz": 500000,
    "hp_cutoff_Hz": 80000,
    "if_gain_dB": 23,
    "mimo_mode": "off",
    "tx_antennas": [1],
    "tx_power_level": 31,
}
_SENSOR: dict[str, Any] = {
    "adc_resolution": 12,
    "description": "BGT60TR13C FMCW Radar Sensor",
    "firmware_version": "unknown",
    "sdk_version": f"radarcore {_core.__version__}",
    "uuid": "0",
}
_PLACE = {
    "date_captured": "",
    "hostname": "unknown",
    "ifxdaq_version": "1.0.0",
    "machine": platform.machine(),
    "os": platform.system(),
    "os_version": "",
    "username": "",
}

_SEQUENCES = frozenset(("sequence", "loop"))
"""Keys of a sequence."""

_PRESENT_NAMES = {
    "lower_frequency_Hz": "start_frequency_Hz",
    "upper_frequency_Hz": "end_frequency_Hz",
    "num_samples": "num_samples_per_chirp",
    "lp_cutoff_Hz": "aaf_cutoff_Hz",
}
"""Names in a config.json by the names of older SDKs and of sequences."""

_KEYS = {
    "start_frequency": "start_frequency_Hz",
    "stop_frequency": "end_frequency_Hz",
    "sample_rate": "sample_rate_Hz",
    "num_samples": "num_samples_per_chirp",
    "num_chirps": "num_chirps_per_frame",
    "chirp_interval": "chirp_repetition_time_s",
    "frame_interval": "frame_repetition_time_s",
}
"""Names in a config.json by the keywords of `bgt60tr13c`."""


def is_recording(path: Path) -> bool:
    """True for a folder that Infineon's recorder made, or for a sensor's folder in it."""
    if not path.is_dir():
        return False
    is_sensor = _FOLDER.fullmatch(path.absolute().name) is not None
    return is_sensor or _has_arrays(path) or len(sensor_folders(path)) > 0


def opened(path: Path) -> Stored:
    """Samples, radar and texts of a folder; codes become samples, `Converted`, on access.

    Warns of frames that its writer did not finish.
    """
    folder = _sensor_folder(path)
    if not (folder / "config.json").is_file():
        raise ValueError(f"{folder}: expected a recording, got one without config.json")
    file = folder / "format.version"
    if file.is_file() and (version := _text(file).strip()).split(".")[0] != "1":
        raise ValueError(f"{file}: expected version 1, got {version[:20]!r}")  # of what may be no text at all
    sensor = _values(folder / "meta.json")
    description = _check_sensor(sensor, str(folder / "meta.json"))
    where = str(folder / "config.json")
    settings = settings_of(_text(folder / "config.json"), where)
    radar = _radar(settings, where)

    # Whole frames, whatever number of them the header says.
    if not (folder / "radar.npy").is_file():
        raise ValueError(f"{folder}: expected a recording, got one without radar.npy")
    array = ArrayFile(folder / "radar.npy", frame_shape(radar), ("uint16",), "config.json")
    num_frames = array.num_rows or 0
    warn_of_missing(path, num_frames, array.header_rows, closed=array.header_rows == num_frames)
    codes = array.read(num_frames, mmap=True)
    cube: Any = Converted(codes, to_samples, array.path)

    # A sensor's folder by another name: its surroundings are unknown.
    place = _values(folder.parent / "meta.json") if _FOLDER.fullmatch(folder.name) else {}
    kept = {**place, **sensor, **settings, "folder": folder.name}
    source = {"sensor": description, "cube_unit": FULL_SCALE, "infineon": kept}
    time = radar.waveform.frame_interval * np.arange(num_frames, dtype=np.float64)
    return Stored(cube, time, radar, None, source)


def save(path: Path, stored: Stored, overwrite: bool) -> None:
    """Write a folder, whole or not at all; ValueError if the layout cannot hold the recording."""
    if stored.source.get("cube_unit") != FULL_SCALE or stored.cube.dtype.kind != "f":
        got = f"{stored.cube.dtype} in {stored.source.get('cube_unit', UNITS['cube'])}"
        raise ValueError(
            f'cube: expected real samples in full scale (source["cube_unit"] = {FULL_SCALE!r}), got {got}; '
            "a radar whose receiver has an ADC makes such samples"
        )
    kept = stored.source.get("infineon")
    kept = kept if isinstance(kept, dict) else {}
    name = kept.get("folder")
    folder = name if isinstance(name, str) and _FOLDER.fullmatch(name) else _FIRST_FOLDER
    texts = _texts(stored.radar, kept, folder)
    _warn_of_left_out(path, stored)
    replaces(path, lambda place: sensor_folders(place) == [folder], f"recording of {folder}", overwrite)

    # Everything is written beside its place before anything is put there.
    is_new = [place for place in (path / folder, path) if not place.exists()]
    try:
        make_folder(path / folder)
        with Lock(path / folder), ExitStack() as stack:
            # The first file is renamed last.
            with stack.enter_context(new_file(path / folder / "radar.npy", overwrite=overwrite)).open("wb") as out:
                out.writelines(_array_bytes(stored.cube))
            for file, text in texts.items():
                stack.enter_context(new_file(path / file, overwrite=True)).write_bytes(text.encode())
    except BaseException:  # a full disk, Ctrl-C
        for place in is_new:
            with suppress(OSError):  # something is in it, or it was never made
                place.rmdir()
        raise


# Reading.


def radar_of(config: str, where: str) -> Radar:
    """The radar of the text of a config.json."""
    return _radar(settings_of(config, where), where)


def _has_arrays(path: Path) -> bool:
    return (path / "config.json").is_file() and (path / "radar.npy").is_file()


def sensor_folders(path: Path) -> list[str]:
    """Names of the folders of sensors in a recording."""
    return sorted(place.name for place in path.iterdir() if _FOLDER.fullmatch(place.name) and place.is_dir())


def _sensor_folder(path: Path) -> Path:
    """The one folder of a sensor in `path`, or `path` itself."""
    folders = sensor_folders(path)
    if not folders or _has_arrays(path):
        return path.absolute()
    if len(folders) > 1:
        raise ValueError(
            f"{path}: expected a recording of one sensor, got {', '.join(folders)}; give one of these, as "
            f"{path / folders[0]}"
        )
    return path.absolute() / folders[0]


def _text(file: Path) -> str:
    return file.read_bytes().decode("utf-8-sig", "replace")


def _values(file: Path) -> dict[str, Any]:
    """Values of a meta.json; none if there is no such file."""
    values = parsed_json(_text(file), str(file)) if file.is_file() else {}
    if not isinstance(values, dict):
        raise ValueError(f"{file}: expected an object, got {type(values).__name__}")
    return values


def _check_sensor(meta: dict[str, Any], where: str) -> str:
    """The description of the sensor; refuses an ADC of other than 12 bits, warns of another chip."""
    if (resolution := meta.get("adc_resolution", 12)) != 12:
        raise ValueError(f"{where}: expected an adc_resolution of 12 bits, got {resolution!r}")
    description = str(meta.get("description", ""))
    if description and "TR13C" not in description:
        message = f"{where}: the sensor is {description!r}; its antennas are assumed to be the antennas of a BGT60TR13C"
        notice.warn(message)
    return description


def settings_of(config: str, where: str) -> dict[str, Any]:
    """Settings of a chirp in the text of a config.json, by present names, with the numbers of the receivers."""
    values = parsed_json(config, where)
    given = values.get("device_config", values) if isinstance(values, dict) else values
    if isinstance(given, list) or (isinstance(given, dict) and not _SEQUENCES.isdisjoint(given)):
        given = _of_sequence(given, where)
    shape = given.get("fmcw_single_shape", given) if isinstance(given, dict) else None
    if not isinstance(shape, dict) or (shape is given and _renamed(shape).keys().isdisjoint(_KEYS.values())):
        got = ", ".join(map(repr, given)) if isinstance(given, dict) else type(given).__name__
        raise ValueError(f"{where}: expected a device_config of 'fmcw_single_shape', got {got or 'none'}")
    shape = _renamed(shape)
    with check.located(where):
        if "rx_mask" in shape:
            mask = check.count("rx_mask", shape.pop("rx_mask"))
            shape.setdefault("rx_antennas", [number + 1 for number in range(mask.bit_length()) if mask >> number & 1])
    return shape


def _renamed(settings: dict[str, Any]) -> dict[str, Any]:
    return {_PRESENT_NAMES.get(name, name): value for name, value in settings.items()}


def is_config(values: object) -> bool:
    """True for the content of a config.json."""
    keys = {"device_config", "fmcw_single_shape", "start_frequency_Hz", *_PRESENT_NAMES, *_SEQUENCES}
    return isinstance(values, list) or (isinstance(values, dict) and not keys.isdisjoint(values))


def _of_sequence(sequence: Any, where: str) -> dict[str, Any]:
    """Settings of the SDK's tree: a chirp in a loop of chirps in a loop of frames."""
    tree = sequence.get("sequence", sequence) if isinstance(sequence, dict) else sequence
    frames = _only_element(tree, "loop", "loop of frames", where)
    chirps = _only_element(frames.get("sub_sequence"), "loop", "loop of chirps", where)
    chirp = _only_element(chirps.get("sub_sequence"), "chirp", "chirp", where)
    return chirp | {
        "frame_repetition_time_s": frames.get("repetition_time_s"),
        "chirp_repetition_time_s": chirps.get("repetition_time_s"),
        "num_chirps_per_frame": chirps.get("num_repetitions"),
    }


def _only_element(sequence: Any, key: str, what: str, where: str) -> dict[str, Any]:
    """Content of the only element of a sequence."""
    (element,) = sequence if isinstance(sequence, list) and len(sequence) == 1 else (sequence,)
    if isinstance(element, dict) and isinstance(found := element.get(key), dict):
        return found
    names = ", ".join(map(repr, element)) if isinstance(element, dict) else ""
    got = names or (f"{len(element)} elements" if isinstance(element, list) else type(element).__name__)
    raise ValueError(
        f"{where}: expected a sequence of one chirp in a loop of chirps in a loop of frames, got {got} in place of the "
        f"{what}"
    )


def _radar(shape: dict[str, Any], where: str) -> Radar:
    """A BGT60TR13C with the settings that were asked of it."""
    with check.located(where):
        if (mimo_mode := shape.get("mimo_mode", "off")) != "off":
            raise ValueError(f"mimo_mode: expected 'off', got {mimo_mode!r}")
        keywords: dict[str, Any] = {name: _whole(check.positive(key, shape[key])) for name, key in _KEYS.items()}
        radar = bgt60tr13c(**keywords, adc_delay=_ADC_DELAY)
        rows = [number - 1 for number in _receivers(shape)]
        return replace(radar, rx=radar.rx[rows], rx_patterns=radar.rx_patterns[: len(rows)])


def _receivers(shape: dict[str, Any]) -> list[int]:
    """Numbers of the receivers in the order of the data: from 1, increasing."""
    numbers = shape["rx_antennas"]
    if not isinstance(numbers, list) or not numbers or any(number not in (1, 2, 3) for number in numbers):
        raise ValueError(f"rx_antennas: expected some of the receivers 1, 2, 3 of a BGT60TR13C, got {numbers!r}")
    return sorted({int(number) for number in numbers})


# Writing.


def _texts(radar: Radar, kept: dict[str, Any], folder: str) -> dict[str, str]:
    """Texts by path: values of the source, settings of the radar."""
    now = datetime.now().astimezone().strftime("%Y-%m-%dT%H:%M:%S%z")
    place, sensor = ({name: kept.get(name, default) for name, default in part.items()} for part in (_PLACE, _SENSOR))
    others = {name: value for name, value in kept.items() if name not in {*_PLACE, *_SENSOR, "folder"}}
    settings = _SETTINGS | others | _settings(radar, kept.get("rx_antennas"))
    return {
        "meta.json": _json(place | {"date_captured": kept.get("date_captured", now)}),
        f"{folder}/format.version": "1.0.0\n",
        f"{folder}/meta.json": _json(sensor),
        f"{folder}/config.json": _json({"device_config": {"fmcw_single_shape": settings}}),
    }


def _settings(radar: Radar, receivers: object) -> dict[str, Any]:
    """Settings of a radar for config.json; ValueError for one that it cannot describe.

    `receivers` are the numbers of its antennas if their positions differ from the chip.
    """
    wf = radar.waveform
    if radar.more_waveforms or radar.schedule is not None:
        raise ValueError("radar: expected one waveform and no schedule, as the layout has, got others")
    if wf.is_cw:
        raise ValueError("radar: expected chirps with a sweep, as the layout has, got CW")
    if len(radar.tx) != 1:
        raise ValueError(f"radar: expected one transmitter, as the layout has, got {len(radar.tx)}")
    if not wf.has_uniform_chirps or wf.chirp_times[0] != 0.0:
        raise ValueError("radar: expected chirps at equal intervals from the start of the frame on, got others")
    if abs(wf.adc_delay - _ADC_DELAY) > 1e-9:
        raise ValueError(
            f"radar: expected an adc_delay of {_ADC_DELAY:g} s, as the chip has in every setting, got {wf.adc_delay:g}"
        )
    stop = wf.start_frequency + wf.slope * (_ADC_DELAY + wf.num_samples / wf.sample_rate)
    values = wf.to_dict() | {"stop_frequency": round(stop, 3)}
    settings = {key: _whole(float(values[name])) for name, key in _KEYS.items()}
    return settings | {"rx_antennas": _numbers_of(radar.rx, receivers)}


def _numbers_of(positions: NDArray[np.float64], otherwise: object) -> list[int]:
    """Numbers of the chip's receivers at some positions [m]; in increasing order, as the data have to be."""
    distance = np.linalg.norm(positions[:, None] - bgt60tr13c().rx, axis=-1)
    numbers = [int(number) for number in distance.argmin(axis=1) + 1]
    if distance.min(axis=1).max() > 1e-6 and isinstance(otherwise, list) and len(otherwise) == len(positions):
        return otherwise
    if distance.min(axis=1).max() > 1e-6 or sorted(set(numbers)) != numbers:
        raise ValueError(
            "radar: expected receivers of a BGT60TR13C in their order, because the layout has no positions, got "
            f"{positions.tolist()}"
        )
    return numbers


def _whole(value: float) -> float | int:
    return int(value) if value.is_integer() else value


def _json(values: dict[str, Any]) -> str:
    return json_text(values, 'source["infineon"]', indent=4, sort_keys=True)


def _array_bytes(cube: NDArray[Any]) -> Iterator[bytes]:
    """Content of radar.npy: version 1.0, whose header blanks fill up to a fixed length."""
    words = f"{{'descr': '<u2', 'fortran_order': False, 'shape': {cube.shape}, }}"
    magic, length = npy.magic(1, 0), _HEADER_BYTES - 10
    yield magic + length.to_bytes(2, "little") + words.ljust(length - 1).encode() + b"\n"
    for first in range(0, len(cube), _CHUNK):
        samples = cube[first : first + _CHUNK]
        if np.abs(samples).max(initial=0.0) > 1.0 + 0.5 / (NUM_CODES - 1):
            raise ValueError(
                f"cube: expected samples from -1 to 1, got {np.abs(samples).max():g} from frame {first} on"
            )
        yield to_codes(samples).astype("<u2").tobytes()


def _warn_of_left_out(path: Path, stored: Stored) -> None:
    """Warn of content that the layout cannot hold."""
    interval = stored.radar.waveform.frame_interval
    is_lost = stored.lost is not None and stored.lost.any()
    left_out = {
        "truth": stored.truth is not None,
        "lost frames": is_lost,
        "times of frames": bool((np.abs(np.diff(stored.time) - interval) > 0.5 * interval).any()),
    }
    if names := [name for name, is_there in left_out.items() if is_there]:
        notice.warn(f"{path}: the layout of Infineon's tools has no {', no '.join(names)}")
