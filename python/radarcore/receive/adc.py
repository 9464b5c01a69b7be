"""Gain, offsets and ADC: from sqrt(W) at the receiver's input to parts of full scale."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.receiver import Receiver
from radarcore.receive.draws import Draws
from radarcore.units import power_from_db

IMPEDANCE = 50.0
"""Impedance of the receiver's input [ohm]."""


def gain(receiver: Receiver) -> float:
    """Sample per sqrt(W) at the receiver's input.

    A real sample is the real part of an amplitude whose square is the power, so the voltage of a tone peaks at
    ``sqrt(2 R)`` times it.
    """
    field = sqrt(power_from_db(receiver.gain_db or 0.0))
    return field if receiver.full_scale is None else field * sqrt(2.0 * IMPEDANCE) / receiver.full_scale


def lsb(receiver: Receiver) -> float:
    """Step of the ADC in samples."""
    assert receiver.adc_bits is not None
    return 2.0 / ((1 << receiver.adc_bits) - 1)


def offset(receiver: Receiver, numbers: NDArray[Any], num_rx: int) -> None:
    """Add the constant offset, in place, to the real numbers (channel, chirp, number)."""
    values = np.broadcast_to(np.asarray(receiver.dc_offset, numbers.dtype), num_rx)
    numbers += np.tile(values, len(numbers) // num_rx)[:, None, None]


def adc_noise(receiver: Receiver, numbers: NDArray[Any], draws: Draws) -> None:
    """Add the ADC's noise and the offsets of chirps, in place, to the real numbers (channel, chirp, number)."""
    if receiver.chirp_offset_lsb:
        parts = 1 if receiver.output == "real" else 2
        offsets = draws.normal("chirp offset", (*numbers.shape[:2], 1, parts))
        offsets *= np.float32(receiver.chirp_offset_lsb * lsb(receiver))
        numbers.reshape(*numbers.shape[:2], -1, parts)[...] += offsets
    if receiver.adc_noise_lsb:
        noise = draws.normal("ADC noise", numbers.shape)
        noise *= np.float32(receiver.adc_noise_lsb * lsb(receiver))
        numbers += noise


def quantise(receiver: Receiver, numbers: NDArray[Any]) -> None:
    """Clip to full scale and round to codes, in place: sample ``2 code / (2^bits - 1) - 1``."""
    np.clip(numbers, -1.0, 1.0, out=numbers)
    if receiver.adc_bits is not None:
        codes = 2**receiver.adc_bits - 1
        numbers += 1.0
        numbers *= 0.5 * codes
        np.rint(numbers, out=numbers)
        # As `recording.codes.to_samples`, so that both give the same bits.
        numbers *= 2.0
        numbers /= codes
        numbers -= 1.0
