"""Sub-sequences of a frame: waveforms and transmitters whose ramps must not overlap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.waveform import Waveform

_ROUNDING = 1e-9
"""Overlap of ramps that is rounding, in parts of a ramp."""


def shortest_interval(waveforms: Sequence[Waveform]) -> float:
    """Shortest interval between the chirps of a frame [s]."""
    starts = np.sort(np.concatenate([waveform.chirp_times for waveform in waveforms]))
    return waveforms[0].chirp_interval if len(starts) == 1 else float(np.diff(starts).min())


def check_sequences(waveforms: Sequence[Waveform], tx_offsets: NDArray[np.float64]) -> None:
    """Refuse waveforms of other samples than the first, and ramps that overlap.

    `tx_offsets`: time from the chirps of a waveform to the ramps of every transmitter (tx,) [s]; equal ones are ramps
    that are sent together.
    """
    first = waveforms[0]
    for number, waveform in enumerate(waveforms[1:], 1):
        for name, unit in (("num_samples", ""), ("sample_rate", " Hz")):
            if (got := getattr(waveform, name)) != (expected := getattr(first, name)):
                text = f"expected {name} = {expected:g}{unit} as in waveform[0], got {got:g}{unit}"
                raise ValueError(f"waveform[{number}]: {text}")
    offsets = np.unique(tx_offsets)
    if len(waveforms) == 1 and len(offsets) == 1:
        return

    # Starts of all ramps in their order, with the duration of each up to its last sample.
    starts = np.concatenate([np.add.outer(waveform.chirp_times, offsets).ravel() for waveform in waveforms])
    lengths = np.concatenate(
        [np.full(waveform.num_chirps * len(offsets), waveform.sample_times[-1]) for waveform in waveforms]
    )
    order = np.argsort(starts, kind="stable")
    gaps, lengths = np.diff(starts[order]), lengths[order][:-1]
    short = gaps < lengths * (1.0 - _ROUNDING)
    if short.any() or (gaps == 0.0).any():
        index = int((gaps - lengths).argmin())
        name = "schedule" if len(waveforms) == 1 else "waveform"
        of = "transmitters in turn" if len(waveforms) == 1 else "sub-sequences and transmitters"
        raise ValueError(
            f"{name}: expected at least {lengths[index]:g} s between the ramps of {of} (adc_delay + samples), "
            f"got {gaps[index]:g} s at {starts[order][index]:g} s"
        )
