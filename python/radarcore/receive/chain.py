"""The receiver's chain: from the ideal beat signal to the samples that it delivers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import AdcErrors, Receiver, is_plain
from radarcore.receive import adc
from radarcore.receive.adc import apply_iq_imbalance
from radarcore.receive.filters import phase_noise_delays, phase_noise_shares
from radarcore.receive.leakage import leakage_step, leakage_tones
from radarcore.receive.noise import GOLDEN, RandomStreams, thermal_noise, turn_on_noise
from radarcore.receive.phase_noise import phase_differences


def receive(
    ideal: NDArray[Any], radar: Radar, start: float, *, seed: int, uses: list[adc.Use] | None = None
) -> NDArray[Any]:
    """Cube as the radar's receiver delivers it, see `receive_all`."""
    return receive_all(ideal, radar, start, seeds=[seed], uses=uses)


def receive_all(
    ideal: NDArray[Any], radar: Radar, start: float, *, seeds: list[int], uses: list[adc.Use] | None = None
) -> NDArray[Any]:
    """Cubes as the radar's receiver delivers them, in the precision of the ideal ones, whose memory they take over.

    The noise belongs to the seed and to the start of the frame [s]: any frame can be made again by itself.

    Parameters
    ----------
    ideal : (channel, chirp, sample) complex64 or complex128
        Beat signals of the core: after the filters, with phase noise appended as its parts by delay, see
        `radarcore.receive.filters.responses`. One after the other, one per seed.
    radar : Radar
    start : float
        Start of the frames [s].
    seeds : list of int
    uses : list, optional
        The use of the ADC's range is appended if the receiver has a full scale.
    """
    receiver = radar.receiver or Receiver()
    if is_plain(receiver):
        # White noise of an I/Q receiver has half of its power in either part.
        variance = receiver.noise_variance(radar.waveform.sample_rate) * (0.5 if receiver.output == "iq" else 1.0)
        samples = ideal.real.copy() if receiver.output == "real" else ideal
        _core.add_noise(samples.view(ideal.real.dtype), seeds, variance**0.5, start)
        return samples
    if len(seeds) > 1:
        parts = zip(np.split(ideal, len(seeds)), seeds, strict=True)
        return np.concatenate([receive(part, radar, start, seed=seed, uses=uses) for part, seed in parts])
    (seed,) = seeds
    draws = RandomStreams(seed, start)
    signal = _mixed(ideal, receiver, radar, draws)
    if receiver.output == "real":
        signal = np.ascontiguousarray(signal.real)
    elif signal.size < ideal.size:
        signal = signal.copy()  # without the memory of the parts
    return _digitised(signal, receiver, radar, draws, [] if uses is None else uses)


def received(
    samples: Sequence[NDArray[Any]], sequences: Sequence[Radar], start: float, *, seeds: list[int]
) -> tuple[NDArray[Any], adc.Use | None]:
    """Cubes of frames as the receivers deliver them, (channel, chirp, sample), and their use of the ADC's range.

    Parameters
    ----------
    samples : sequence of arrays
        Samples at the receivers, of every sub-sequence; of several frames one after the other along the first axis.
    sequences : sequence of Radar
        Of the same sub-sequences.
    start : float
        Start of the frames [s].
    seeds : list of int
        One per frame.
    """
    parts: list[NDArray[Any]] = []
    uses: list[adc.Use] = []
    for number, (arriving, part) in enumerate(zip(samples, sequences, strict=True)):
        own = [(seed + number * GOLDEN) % 2**64 for seed in seeds]
        parts.append(receive_all(arriving, part, start, seeds=own, uses=uses))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1), adc.use_of_all(uses) if uses else None


def _mixed(ideal: NDArray[Any], receiver: Receiver, radar: Radar, draws: RandomStreams) -> NDArray[Any]:
    """Signal (channel, chirp, sample) behind mixer and filters [sqrt(W)]: phase noise, receiver phases, leakage."""
    blocks = ideal.reshape(-1, radar.num_channels, *ideal.shape[1:])
    signal: NDArray[Any] = blocks[0]
    factors = _phase_noise_factors(receiver, radar, draws)
    for part, factor in zip(blocks[1:], factors, strict=True):
        part *= factor
        signal += part
    if receiver.rx_phase_deg is not None:
        signal *= np.exp(1j * radar.channel_phases).astype(signal.dtype)[:, None, None]
    if (leakage := receiver.leakage) is not None:
        by_receiver = signal.reshape(-1, len(radar.rx), *signal.shape[1:])
        for delay, leaked in leakage_tones(leakage, receiver, radar):
            tone = leaked[:, None] * _leaking(radar)
            by_receiver += tone
            # The phase noise of an echo of its delay.
            for share, factor in zip(phase_noise_shares(receiver, radar.waveform, delay), factors, strict=True):
                added = np.float32(share) * factor
                by_receiver += tone * (added if len(added) == 1 else added.reshape(by_receiver.shape))
        if leakage.step_db is not None:
            by_receiver += leakage_step(leakage, radar)[:, None]
    return signal


def _leaking(radar: Radar) -> NDArray[np.complex64]:
    """Field that leaks into the receivers relative to one transmitter, (chirp, 1): several at once add up."""
    schedule, waveform = radar.schedule, radar.waveform
    if schedule is None or not schedule.is_sum:
        return np.ones((waveform.num_chirps, 1), np.complex64)
    weights = schedule.tx_weights(radar.tx, waveform.wavelength, waveform.num_chirps)
    total: NDArray[np.complex64] = weights.conj().sum(axis=1, keepdims=True).astype(np.complex64)
    return total


def _phase_noise_factors(receiver: Receiver, radar: Radar, draws: RandomStreams) -> NDArray[np.complex64]:
    """Change that phase noise makes to an echo of 1 at the delays of the parts of the signal: ``exp(j phase) - 1``.

    Shape (delay, 1 or channel, chirp, sample): transmitters that take turns send at times of their own.
    """
    if receiver.phase_noise is None:
        return np.zeros((0, 1, 1, 1), np.complex64)
    waveform = radar.waveform
    delays = tuple(phase_noise_delays(receiver, waveform).tolist())
    offsets, of_channel = np.unique(radar.channel_offsets, return_inverse=True)
    starts = np.add.outer(offsets, waveform.chirp_times).ravel()
    phase = phase_differences(receiver.phase_noise, delays, starts, waveform.sample_times, draws)
    factors: NDArray[np.complex64] = np.empty(phase.shape, np.complex64)
    np.sin(phase, out=factors.imag)
    # With all digits of small ones.
    half = np.sin(0.5 * phase)
    factors.real = -2.0 * half * half
    by_offset = factors.reshape(len(delays), len(offsets), waveform.num_chirps, waveform.num_samples)
    return by_offset if len(offsets) == 1 else by_offset[:, of_channel]


def _digitised(
    samples: NDArray[Any], receiver: Receiver, radar: Radar, draws: RandomStreams, uses: list[adc.Use]
) -> NDArray[Any]:
    """Samples behind I/Q imbalance, noise, gain, offsets and ADC; in place."""
    waveform, num_channels, errors = radar.waveform, radar.num_channels, receiver.adc_errors or AdcErrors()
    if receiver.iq_gain_db is not None or receiver.iq_phase_deg is not None:
        apply_iq_imbalance(samples, receiver.iq_gain_db, receiver.iq_phase_deg)
    if receiver.noise_figure_db is not None:
        samples += thermal_noise(receiver, waveform, num_channels, draws)
        if errors.turn_on_db is not None:
            samples += turn_on_noise(receiver, errors, waveform, num_channels, draws)
    # I and Q go through the rest by themselves.
    numbers = samples.view(samples.real.dtype)
    if (gain := adc.gain(receiver)) != 1.0:
        numbers *= gain
    if receiver.dc_offset is not None:
        adc.offset(receiver, numbers, len(radar.rx))
    if receiver.adc_bits is not None:
        adc.add_errors(receiver, errors, numbers, len(radar.rx), draws)
    if receiver.full_scale is not None:
        uses.append(adc.quantise(receiver, errors, numbers))
    return samples
