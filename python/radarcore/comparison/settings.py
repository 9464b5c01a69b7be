"""Settings in which two radars differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from radarcore.radar.radar import Radar

_ROUNDING = 1e-9
"""Relative difference of numbers that are the same."""

_UNITS = {
    "start_frequency": "Hz",
    "slope": "Hz/s",
    "sample_rate": "Hz",
    "chirp_interval": "s",
    "frame_interval": "s",
    "adc_delay": "s",
    "tx_power": "dBm",
    "range_resolution": "m",
    "velocity_resolution": "m/s",
}


class Difference(NamedTuple):
    """A setting that differs: its name, and the values of A and of B as texts with units."""

    name: str
    a: str
    b: str


def differences(a: Radar, b: Radar) -> tuple[Difference, ...]:
    """Settings in which two radars differ, those of the waveform first."""
    pairs = zip(_settings(a), _settings(b), strict=True)
    return tuple(
        Difference(name, _text(name, first), _text(name, second))
        for (name, first), (_, second) in pairs
        if not _same(first, second)
    )


def _settings(radar: Radar) -> Iterator[tuple[str, Any]]:
    """Settings by name."""
    wf = radar.waveform
    for name in ("start_frequency", "slope", "sample_rate", "num_samples", "adc_delay"):
        yield name, getattr(wf, name)
    for name in ("num_chirps", "chirp_interval", "frame_interval", "range_resolution", "velocity_resolution"):
        yield name, getattr(wf, name)
    yield "samples", "real" if radar.is_real else "I/Q"
    yield "transmitters [m]", _places(radar.tx)
    yield "receivers [m]", _places(radar.rx)
    yield "tx_power", radar.tx_power_dbm
    yield "antenna pattern", "; ".join(dict.fromkeys(map(str, (*radar.tx_patterns, *radar.rx_patterns))))
    yield "receiver", _receiver(radar)


def _places(antennas: Any) -> str:
    return ", ".join("({:.6g} {:.6g} {:.6g})".format(*place) for place in antennas + 0.0)


def _receiver(radar: Radar) -> str:
    """The receiver in a few words: its noise, and whether it has codes."""
    receiver = radar.receiver
    if receiver is None:
        return "ideal"
    codes = f", codes of an ADC at {receiver.gain_db:g} dB" if receiver.has_codes else ""
    noise = "no noise" if receiver.noise_figure_db is None else f"noise figure {receiver.noise_figure_db:.3g} dB"
    return f"{noise}{codes}"


def _same(first: Any, second: Any) -> bool:
    if isinstance(first, float) and isinstance(second, float):
        return abs(first - second) <= _ROUNDING * max(abs(first), abs(second))
    return bool(first == second)


def _text(name: str, value: Any) -> str:
    number = f"{value:.9g}" if isinstance(value, float) else str(value)
    return f"{number} {_UNITS[name]}" if name in _UNITS else number
