"""Gain, I/Q imbalance, offsets and ADC: from sqrt(W) at the receiver's input to parts of full scale."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.receiver import AdcErrors, Receiver
from radarcore.receive.noise import RandomStreams
from radarcore.units import power_from_db

_SEGMENTS = 16
"""Parts of the ADC's codes with offsets of their own."""

IMPEDANCE = 50.0
"""Impedance of the receiver's input [ohm]."""


class Use(NamedTuple):
    """Use of an ADC's range: clipped and all numbers, and the lowest and highest before clipping."""

    num_clipped: int
    size: int
    lowest: float
    highest: float

    @property
    def clipped_share(self) -> float:
        """Share of the numbers beyond full scale."""
        return self.num_clipped / self.size

    def num_codes(self, bits: int) -> int:
        """Number of codes from the lowest to the highest."""
        low, high = (round(0.5 * (min(max(end, -1.0), 1.0) + 1.0) * (2**bits - 1)) for end in self[2:])
        return int(high - low + 1)

    def stats(self, receiver: Receiver) -> dict[str, Any]:
        """Shares for `Frame.stats`."""
        bits = receiver.adc_bits
        codes = {} if bits is None else {"used_codes_share": self.num_codes(bits) / 2**bits}
        return {"clipped_share": self.clipped_share, **codes}


def use_of_all(uses: list[Use]) -> Use:
    """Use by all sub-sequences of a frame."""
    clipped, sizes, lowest, highest = zip(*uses, strict=True)
    return Use(sum(clipped), sum(sizes), min(lowest), max(highest))


def gain(receiver: Receiver) -> float:
    """Sample per sqrt(W) at the receiver's input.

    A real sample is the real part of an amplitude whose square is the power, so the voltage of a tone peaks at
    ``sqrt(2 R)`` times it.
    """
    field = sqrt(power_from_db(receiver.gain_db or 0.0))
    return field if receiver.full_scale is None else field * sqrt(2.0 * IMPEDANCE) / receiver.full_scale


def offset(receiver: Receiver, numbers: NDArray[Any], num_rx: int) -> None:
    """Add the constant offset, in place, to the real numbers (channel, chirp, number)."""
    values = np.broadcast_to(np.asarray(receiver.dc_offset, numbers.dtype), num_rx)
    numbers += np.tile(values, len(numbers) // num_rx)[:, None, None]


def add_errors(receiver: Receiver, errors: AdcErrors, numbers: NDArray[Any], num_rx: int, draws: RandomStreams) -> None:
    """Add the ADC's offsets and noise, in place, to the real numbers (channel, chirp, number)."""
    assert receiver.adc_bits is not None
    step, parts = 2.0 / (2**receiver.adc_bits - 1), 1 if receiver.output == "real" else 2
    added: Any = 0.0
    by_part = numbers.reshape(*numbers.shape[:2], -1, parts)
    if errors.segment_offset_lsb:
        # Of the code that is met without offsets, so that the order of adding does not matter.
        offsets = draws.normal("segment offset", (*numbers.shape[:2], _SEGMENTS, parts))
        offsets *= np.float32(errors.segment_offset_lsb * step)
        segment = (0.5 * _SEGMENTS * by_part + 0.5 * _SEGMENTS).astype(np.int32)
        added = np.take_along_axis(offsets, np.clip(segment, 0, _SEGMENTS - 1), axis=2)
    if errors.chirp_offset_lsb is not None:
        deviations = np.broadcast_to(np.asarray(errors.chirp_offset_lsb, np.float32), num_rx) * np.float32(step)
        offsets = draws.normal("chirp offset", (*numbers.shape[:2], 1, parts))
        offsets *= np.tile(deviations, len(numbers) // num_rx)[:, None, None, None]
        by_part += offsets
    by_part += added
    if errors.noise_lsb:
        noise = draws.normal("ADC noise", numbers.shape)
        noise *= np.float32(errors.noise_lsb * step)
        numbers += noise


def quantise(receiver: Receiver, errors: AdcErrors, numbers: NDArray[Any]) -> Use:
    """Clip to full scale and round to codes, in place: sample ``2 code / (2^bits - 1) - 1``."""
    lowest, highest, num_clipped = float(numbers.min()), float(numbers.max()), 0
    if lowest < -1.0 or highest > 1.0:
        num_clipped = int(np.count_nonzero(np.abs(numbers) > 1.0))
        np.clip(numbers, -1.0, 1.0, out=numbers)
    if receiver.adc_bits is not None:
        codes = 2**receiver.adc_bits - 1
        numbers += 1.0
        numbers *= 0.5 * codes
        if errors.odd_width is None:
            np.rint(numbers, out=numbers)
        else:
            _round_unevenly(numbers, errors.odd_width, 0.25 * (codes + 1))
            np.clip(numbers, 0.0, codes, out=numbers)
        # As `recording.codes.to_samples`, so that both give the same bits.
        numbers *= 2.0
        numbers /= codes
        numbers -= 1.0
    return Use(num_clipped, numbers.size, lowest, highest)


def _round_unevenly(levels: NDArray[Any], odd_width: float, first: float) -> None:
    """Round to codes whose odd ones have another width than 1 from the code `first` on, and the even ones below."""
    even = 2.0 * np.rint(0.5 * levels)
    half = np.where(levels >= first, 1.0 - 0.5 * odd_width, 0.5 * odd_width).astype(levels.dtype)
    levels -= even
    # The part from one code to the next that rounds to the odd one.
    levels[...] = even + np.where(np.abs(levels) >= half, np.copysign(1.0, levels), 0.0)


def apply_iq_imbalance(samples: NDArray[Any], gain_db: float | None, phase_deg: float | None) -> None:
    """Give Q another gain and phase, in place: Q becomes ``g (Q cos(phi) + I sin(phi))``.

    A tone then has an image at the opposite frequency, of the relative power
    ``(1 + g^2 - 2 g cos(phi)) / (1 + g^2 + 2 g cos(phi))``.
    """
    gain = power_from_db(gain_db or 0.0) ** 0.5
    angle = np.deg2rad(phase_deg or 0.0)
    samples.imag = (gain * np.cos(angle)) * samples.imag + (gain * np.sin(angle)) * samples.real
