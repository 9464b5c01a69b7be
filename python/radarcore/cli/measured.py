"""Facts of a measurement from a recording's source: board, settings, date."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from radarcore.recording.infineon import settings_of


def measured_facts(source: Mapping[str, Any]) -> dict[str, Any]:
    """Board, date, receivers and gains, by name with unit; of others than sensors nothing.

    Of `Sensor.record` and of folders of Infineon's tools alike: the one keeps the settings of the chip, the other the
    texts of the folder, under the same names.
    """
    known: dict[str, Any] = {}
    for part in _parts(source):
        known |= part
    facts = {
        "sensor": _sensor(source, known),
        "date": source.get("date", known.get("date_captured")),
        "RX antennas": known.get("rx_antennas"),
        "IF gain [dB]": known.get("if_gain_dB"),
        "high-pass [Hz]": _number(known.get("hp_cutoff_Hz")),
        "low-pass [Hz]": _number(known.get("aaf_cutoff_Hz")),
        "transmit power level": known.get("tx_power_level"),
    }
    return {name: value for name, value in facts.items() if value is not None}


def _parts(source: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Settings: those kept beside the frames, those of the texts of a folder."""
    kept = source.get("infineon")
    if not isinstance(kept, dict):
        return
    yield kept
    texts = kept.get("texts")
    for name, text in texts.items() if isinstance(texts, dict) else ():
        if not name.endswith(".json") or not isinstance(text, str):
            continue
        try:
            values = settings_of(text, name) if name.endswith("config.json") else json.loads(text)
        except ValueError:  # somebody's own file: info is about the rest
            continue
        if isinstance(values, dict):
            yield values


def _sensor(source: Mapping[str, Any], known: dict[str, Any]) -> str | None:
    """Name of the sensor and its firmware."""
    sensor = source.get("sensor")
    if isinstance(sensor, dict):
        name, firmware = sensor.get("name"), sensor.get("firmware")
    else:
        name, firmware = sensor, known.get("firmware_version")
    if name is None:
        return None
    return f"{name}, firmware {firmware}" if firmware is not None else str(name)


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) else None
