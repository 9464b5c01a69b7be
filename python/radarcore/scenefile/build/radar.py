"""Radars of scene files."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from radarcore import check
from radarcore.radar.bgt60_presets import bgt60tr13c, bgt60tr24
from radarcore.radar.pattern import GaussianPattern, IsotropicPattern, Pattern, TabulatedPattern
from radarcore.radar.radar import Radar
from radarcore.radar.schedule import Schedule
from radarcore.radar.waveform import Waveform
from radarcore.scenefile.build.cache import BuildCache
from radarcore.scenefile.read import located
from radarcore.scenefile.tables import DdmTable, PatternTable, RadarTable, SteeredTable, TdmTable

_WAVEFORM_KEYS = (
    "start_frequency",
    "stop_frequency",
    "slope",
    "sample_rate",
    "num_samples",
    "num_chirps",
    "chirp_interval",
    "chirp_times",
    "frame_interval",
    "adc_delay",
)
_WISHES = ("max_range", "max_velocity", "range_resolution", "velocity_resolution", "rate")


def radar_of(table: RadarTable, directory: Path, kept: BuildCache) -> Radar:
    """The radar of a table, made once; files of patterns are relative to the directory."""
    return kept.of(("radar", table.model_dump_json()), lambda: _radar(table, directory))


def _radar(table: RadarTable, directory: Path) -> Radar:
    given = {name: value for name in type(table).model_fields if (value := getattr(table, name)) is not None}
    waveform = {name: given[name] for name in (*_WAVEFORM_KEYS, *_WISHES) if name in given}
    others: dict[str, Any] = {
        name: given[name] for name in ("tx", "rx", "tx_power_dbm", "polarization") if name in given
    }
    if table.pattern is not None:
        with located("pattern."):
            others["pattern"] = _pattern(table.pattern, directory)
    for name in ("tx_patterns", "rx_patterns"):
        if name in given:
            others[name] = []
            for k, entry in enumerate(given[name]):
                with located(f"{name}[{k}]."):
                    others[name].append(_pattern(entry, directory))
    if table.receiver is not None:
        others["receiver"] = table.receiver
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
    phases, azimuth, elevation = table.phases_deg, table.azimuth_deg, table.elevation_deg
    if phases is None:
        angles = {"azimuth": azimuth, "elevation": elevation}
        told = {name: check.degrees(f"{name}_deg", angle) for name, angle in angles.items() if angle is not None}
        given: dict[str, Any] = {name: np.deg2rad(angle) for name, angle in told.items()}
        return Schedule.steered(**(given or {"azimuth": 0.0}))
    if azimuth is not None or elevation is not None:
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
    if any(name in values for name in _WISHES):
        taken = set(signature(Waveform.design).parameters)
        if other := [name for name in values if name not in taken]:
            raise ValueError(f"{other[0]}: expected none beside wishes, which decide it, got {values[other[0]]}")
        return Waveform.design(**values)
    for name in ("start_frequency", "sample_rate", "num_samples"):
        if name not in values:
            raise ValueError(f"{name}: expected a value, or a preset, got none")
    if ("slope" in values) == ("stop_frequency" in values):
        got = "both" if "slope" in values else "none"
        raise ValueError(f"slope: expected either slope or stop_frequency, got {got}")
    return Waveform(**values) if "slope" in values else Waveform.from_sweep(**values)


def _pattern(table: PatternTable, directory: Path) -> Pattern:
    given = table.model_fields_set
    if "path" in given:
        if other := given - {"path"}:
            raise ValueError(f"path: expected it alone, got {' and '.join(sorted(other))} as well")
        with located("path: "):
            return TabulatedPattern.load(directory / str(table.path))
    azimuth, elevation = table.azimuth_deg, table.elevation_deg
    widths = table.beamwidth_azimuth_deg, table.beamwidth_elevation_deg
    if azimuth is not None or elevation is not None or isinstance(table.gain_db, list):
        if azimuth is None or elevation is None or not isinstance(table.gain_db, list):
            missing = "azimuth_deg" if azimuth is None else "elevation_deg" if elevation is None else "gain_db"
            got = "none" if getattr(table, missing) is None else getattr(table, missing)
            raise ValueError(f"{missing}: expected a list, as all three keys of a table are, got {got}")
        if widths != (None, None):
            raise ValueError("azimuth_deg: expected either a table or beam widths, got both")
        return TabulatedPattern.from_degrees(azimuth, elevation, table.gain_db)
    gain_db = 0.0 if table.gain_db is None else table.gain_db
    if widths == (None, None):
        return IsotropicPattern(gain_db)
    if widths[0] is None or widths[1] is None:
        missing = "beamwidth_azimuth_deg" if widths[0] is None else "beamwidth_elevation_deg"
        raise ValueError(f"{missing}: expected both beam widths or none [degrees], got one")
    return GaussianPattern(gain_db, widths[0], widths[1])
