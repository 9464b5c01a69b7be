"""Recording folders as Infineon's tools make them, byte by byte."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = "RadarIfxAvian_00"
SHAPE: dict[str, Any] = {
    "aaf_cutoff_Hz": 500000,
    "chirp_repetition_time_s": 0.0005911249900236726,
    "end_frequency_Hz": 63500000000,
    "frame_repetition_time_s": 0.07726884633302689,
    "hp_cutoff_Hz": 80000,
    "if_gain_dB": 33,
    "mimo_mode": "off",
    "num_chirps_per_frame": 4,
    "num_samples_per_chirp": 16,
    "rx_antennas": [1, 2, 3],
    "sample_rate_Hz": 2000000,
    "start_frequency_Hz": 58000000000,
    "tx_antennas": [1],
    "tx_power_level": 31,
}
SENSOR = {
    "adc_resolution": 12,
    "description": "BGT60TR13C FMCW Radar Sensor",
    "firmware_version": "2.6.0",
    "sdk_version": "3.6.4",
    "uuid": "2810588487792",
}
PLACE = dict.fromkeys(("hostname", "machine", "os", "os_version", "username"), "")
OLD_NAMES = {"rx_mask": 5, "tx_mask": 1} | {k: v for k, v in SHAPE.items() if not k.endswith("_antennas")}


def text(values: Any) -> bytes:
    return (json.dumps(values, indent=4, sort_keys=True) + "\n").encode()


def config(**changes: Any) -> bytes:
    return text({"device_config": {"fmcw_single_shape": SHAPE | changes}})


def array(codes: np.ndarray[Any, Any]) -> bytes:
    """An NPY file as the recorder writes it: the header fills 1024 bytes."""
    words = f"{{'descr': '<u2', 'fortran_order': False, 'shape': {codes.shape}, }}"
    return b"\x93NUMPY\x01\x00" + (1014).to_bytes(2, "little") + words.encode().ljust(1013) + b"\n" + codes.tobytes()


def saved(codes: np.ndarray[Any, Any], version: tuple[int, int] = (1, 0)) -> bytes:
    file = BytesIO()
    np.lib.format.write_array(file, codes, version)
    return file.getvalue()


def some_codes(num_frames: int = 5, shape: tuple[int, int, int] = (3, 4, 16)) -> np.ndarray[Any, Any]:
    return np.random.default_rng(0).integers(0, 4096, (num_frames, *shape), dtype=np.uint16)


def folder(path: Path, **files: bytes | None) -> Path:
    """A recording; `files` replaces some by name (dots as underscores), None leaves one out."""
    names = {"top": "meta.json"} | {
        name.replace(".", "_"): f"{FOLDER}/{name}"
        for name in ("format.version", "meta.json", "config.json", "radar.npy")
    }
    contents: dict[str, bytes | None] = {
        "top": text(PLACE | {"date_captured": "2026-01-06T15:16:15+0800", "ifxdaq_version": "1.0.0"}),
        "format_version": b"1.0.0\n",
        "meta_json": text(SENSOR),
        "config_json": config(),
        "radar_npy": array(some_codes()),
    }
    for key, data in (contents | files).items():
        if data is not None:
            (path / names[key]).parent.mkdir(parents=True, exist_ok=True)
            (path / names[key]).write_bytes(data)
    return path
