"""Texts about parts of a radar: sampled band, antenna patterns."""

from __future__ import annotations

from collections.abc import Sequence

from radarcore.radar.pattern import Pattern
from radarcore.radar.waveform import Waveform
from radarcore.units import quantity


def band_text(waveform: Waveform) -> str:
    """Sampled band, such as "60 to 61.5 GHz"."""
    start = waveform.start_frequency + waveform.slope * waveform.adc_delay
    stop = start + waveform.slope * waveform.num_samples / waveform.sample_rate
    return quantity(start, "Hz", 4) if waveform.is_cw else f"{start / 1e9:.4g} to {quantity(stop, 'Hz', 4)}"


def pattern_facts(tx: Sequence[Pattern], rx: Sequence[Pattern]) -> dict[str, str]:
    """The pattern of all antennas, or those of one after the other."""
    every = (("transmitter", tx), ("receiver", rx))
    facts = {f"pattern of {kind} {i}": str(p) for kind, patterns in every for i, p in enumerate(patterns)}
    return facts if len(set(facts.values())) > 1 else {"antenna pattern": str(tx[0])}
