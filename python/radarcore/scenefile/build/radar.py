"""Radars of scene files."""

from __future__ import annotations

from dataclasses import fields
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from radarcore import check
from radarcore.radar.bgt60_presets import bgt60tr13c, bgt60tr24
from radarcore.radar.design import REQUIREMENTS
from radarcore.radar.pattern import GaussianPattern, IsotropicPattern, Pattern, TabulatedPattern
from radarcore.radar.radar import Radar, complex_of_pairs
from radarcore.radar.schedule import Schedule
from radarcore.radar.waveform import Waveform
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.read import located
from radarcore.scenefile.tables import DdmTable, PatternTable, RadarTable, SteeredTable, TdmTable

_WAVEFORM_KEYS = {"stop_frequency", *REQUIREMENTS, *(field.name for field in fields(Waveform))}


def radar_of(table: RadarTable, directory: Path, kept: BuildCache) -> Radar:
    """The radar of a table, made once; files of patterns are relative to the directory."""
    return kept.of(("radar", table.model_dump_json()), lambda: _radar(table, directory))


def _radar(table: RadarTable, directory: Path) -> Radar:
    given = {name: value for name in type(table).model_fields if (value := getattr(table, name)) is not None}
    waveform = {name: value for name, value in given.items() if name in _WAVEFORM_KEYS}
    names = ("tx", "rx", "tx_power_dbm", "polarization", "receiver")
    others: dict[str, Any] = {name: given[name] for name in names if name in given}
    if table.pattern is not None:
        with located("pattern."):
            others["pattern"] = _pattern(table.pattern, directory)
    for name in ("tx_patterns", "rx_patterns"):
        if name in given:
            others[name] = []
            for k, entry in enumerate(given[name]):
                with located(f"{name}[{k}]."):
                    others[name].append(_pattern(entry, directory))
    if table.channel_weights is not None:
        others["channel_weights"] = complex_of_pairs(table.channel_weights)
    measured = _measured(table)
    if table.schedule is not None:
        with located("schedule."):
            others["schedule"] = _schedule(table.schedule)
    if table.preset is not None:
        preset = (bgt60tr24 if table.preset == "bgt60tr24" else bgt60tr13c)(**waveform, **measured)
        own = {
            name: getattr(preset, name) for name in ("tx", "rx", "tx_power_dbm", "pattern", "receiver", "polarization")
        }
        return Radar(_sequences(preset.waveform, table), **(own | others))
    return Radar(_sequences(_waveform(waveform), table), **others)


def _sequences(waveform: Waveform, table: RadarTable) -> tuple[Waveform, ...]:
    """Waveforms of the sub-sequences, from the first."""
    waveforms = waveform.alternating() if table.alternating else (waveform,)
    for k, entry in enumerate(table.sequences or ()):
        with located(f"sequences[{k}]."):
            changes = entry.model_dump(exclude={"delay"}, exclude_none=True)
            waveforms = *waveforms, waveform.replace(**changes).delayed(entry.delay)
    return waveforms


def _schedule(table: TdmTable | DdmTable | SteeredTable) -> Schedule:
    if isinstance(table, TdmTable):
        return Schedule.tdm(table.interval, table.order)
    if isinstance(table, DdmTable):
        return Schedule.ddm(table.turns)
    angles = table.model_dump(include={"azimuth_deg", "elevation_deg"}, exclude_none=True)
    if (phases := table.phases_deg) is None:
        directions: dict[str, Any] = {
            name.removesuffix("_deg"): np.deg2rad(check.degrees(name, value)) for name, value in angles.items()
        }
        return Schedule.steered(**(directions or {"azimuth": 0.0}))
    if angles:
        raise ValueError("phases_deg: expected either phases or angles of the beam, got both")
    if len({np.size(row) for row in phases}) > 1:
        raise ValueError(f"phases_deg: expected equally many per chirp, got {phases}")
    return Schedule.steered(np.exp(1j * np.deg2rad(check.degrees("phases_deg", phases))))


def _measured(table: RadarTable) -> dict[str, Any]:
    """Keywords of the preset for its measured receiver."""
    if not table.measured_receiver:
        if table.if_gain_db is not None:
            raise ValueError(f"if_gain_db: expected none unless measured_receiver is true, got {table.if_gain_db}")
        return {}
    if table.preset is None:
        raise ValueError("measured_receiver: expected false without a preset, got true")
    if table.receiver is not None:
        raise ValueError("measured_receiver: expected false where there is a table of the receiver, got true")
    return {"receiver": "measured", "if_gain_db": table.if_gain_db}


def _waveform(values: dict[str, Any]) -> Waveform:
    if not values.keys().isdisjoint(REQUIREMENTS):
        taken = set(signature(Waveform.design).parameters)
        if other := [name for name in values if name not in taken]:
            raise ValueError(f"{other[0]}: expected none beside requirements, which decide it, got {values[other[0]]}")
        return Waveform.design(**values)
    for name in ("start_frequency", "sample_rate", "num_samples"):
        if name not in values:
            raise ValueError(f"{name}: expected a value, or a preset, got none")
    if ("slope" in values) == ("stop_frequency" in values):
        got = "both" if "slope" in values else "none"
        raise ValueError(f"slope: expected either slope or stop_frequency, got {got}")
    return Waveform(**values) if "slope" in values else Waveform.from_sweep(**values)


def _pattern(table: PatternTable, directory: Path) -> Pattern:
    given = table.model_dump(exclude_none=True)
    if "path" in given:
        if other := given.keys() - {"path"}:
            raise ValueError(f"path: expected it alone, got {' and '.join(sorted(other))} as well")
        with located("path: "):
            return TabulatedPattern.load(directory / str(table.path))
    widths = [given.get(name) for name in ("beamwidth_azimuth_deg", "beamwidth_elevation_deg")]
    if isinstance(table.gain_db, list) or "azimuth_deg" in given or "elevation_deg" in given:
        for name in ("azimuth_deg", "elevation_deg", "gain_db"):
            if not isinstance(value := given.get(name, "none"), list):
                raise ValueError(f"{name}: expected a list, as all three keys of a table are, got {value}")
        if widths != [None, None]:
            raise ValueError("azimuth_deg: expected either a table or beam widths, got both")
        return TabulatedPattern.from_degrees(**given)
    if widths == [None, None]:
        return IsotropicPattern(**given)
    if None in widths:
        missing = "beamwidth_azimuth_deg" if widths[0] is None else "beamwidth_elevation_deg"
        raise ValueError(f"{missing}: expected both beam widths or none [degrees], got one")
    return GaussianPattern(**{"gain_db": 0.0} | given)
