"""Amplitude and phase of a target's echo in one recording, relative to another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.comparison.targets import Estimates
from radarcore.processing.spectra.windows import window_weights
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame, unit_of
from radarcore.recording.recording import Recording, usual_interval
from radarcore.units import SPEED_OF_LIGHT

_Floats = NDArray[np.float64]

_SAME_FREQUENCY = 1e-3
"""Largest relative difference of centre frequencies for a comparison of phases: 1 cm of range then adds 1.4 degrees."""


@dataclass(frozen=True)
class EchoDifference:
    """Echo of a target in recording B relative to recording A, over pairs of frames at about the same time.

    Parameters
    ----------
    num_frames : int
        Pairs of frames in which both recordings have the target.
    ratio_db : float
        Median amplitude ratio of B over A [dB]; includes the ratio of the receivers' units if these differ.
    ratio_spread_db : float
        Standard deviation of the ratio [dB].
    phase_deg : float
        Phase of B minus phase of A, circular mean over frames and all channels [degrees]. The phase is corrected for
        target motion between the two frames. NaN if phases are not comparable.
    phase_spread_deg : float
        Circular standard deviation of the phase [degrees]; above about 100 the phases are unrelated.
    channel_phases_deg : tuple of float
        Phase of B minus phase of A in every channel, relative to channel 0 [degrees]; empty if the channels differ.
    note : str
        Incomparable quantities and the reasons; empty if there are none.
    """

    num_frames: int
    ratio_db: float
    ratio_spread_db: float
    phase_deg: float
    phase_spread_deg: float
    channel_phases_deg: tuple[float, ...]
    note: str


def echo(frame: Frame, distance: float, velocity: float) -> NDArray[np.complex128]:
    """Complex amplitude of the echo at a range and velocity in every channel, (channel,).

    Uses Hann windows over fast and slow time and evaluates exactly this place between the cells. The phase refers to
    the middle of the frame and of the sampled band: ``4 pi range / wavelength`` plus a constant. Errors of the place
    hardly change it. The amplitude is the peak value, for real and I/Q tones.

    Parameters
    ----------
    frame : Frame
    distance : float
        Range at the middle of the frame [m].
    velocity : float
        Range rate [m/s].
    """
    fast, slow = _tones(frame.radar, distance, velocity)
    total = np.abs(fast).sum() * np.abs(slow[0]).sum()
    cells: NDArray[np.complex128] = np.einsum("ncs,nc,s->n", frame.cube, slow, fast) / total
    return cells if np.iscomplexobj(frame.cube) else 2.0 * cells


def _tones(radar: Radar, distance: float, velocity: float) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Windowed conjugate tones (sample,) and (channel, chirp), with phase zero in their middles."""
    wf = radar.waveform
    doppler = 2.0 * velocity / wf.wavelength
    beat = 2.0 * wf.slope * distance / SPEED_OF_LIGHT + doppler
    # The Doppler frequency also acts within each chirp.
    middle_of_sweep = wf.adc_delay + 0.5 * wf.num_samples / wf.sample_rate
    middle_of_frame = radar.middle - middle_of_sweep
    fast = np.exp(-2j * np.pi * beat * (wf.sample_times - middle_of_sweep))
    slow = np.exp(-2j * np.pi * doppler * (np.add.outer(radar.channel_offsets, wf.chirp_times) - middle_of_frame))
    return (
        fast * window_weights("window", "hann", wf.num_samples),
        slow * window_weights("doppler_window", "hann", wf.num_chirps),
    )


def pairs(times_a: _Floats, times_b: _Floats, longest: float) -> NDArray[np.intp]:
    """Pairs of frames, (pair, 2): each frame of B with the nearest frame of A, within `longest` [s]."""
    nearest = np.abs(times_b[:, None] - times_a).argmin(axis=1)
    is_near = np.abs(times_a[nearest] - times_b) <= longest
    both: NDArray[np.intp] = np.stack([nearest, np.arange(len(times_b))], axis=1)[is_near]
    return both


def echo_difference(recordings: Sequence[Recording], estimated: Sequence[Estimates]) -> EchoDifference:
    """Amplitudes and phases of a target in two recordings, in frames within half an interval of each other.

    Parameters
    ----------
    recordings : (A, B)
    estimated : (A, B)
        Estimates of the target in every frame.
    """
    a, b = estimated
    paired = pairs(a.time, b.time, 0.5 * max(map(usual_interval, recordings)) + 1e-6)
    both = [(i, j) for i, j in paired.tolist() if np.isfinite(a.range[i] + a.velocity[i] + b.range[j] + b.velocity[j])]
    radars = [recording.radar for recording in recordings]
    waves = [radar.waveform for radar in radars]
    units = {_unit(recording) for recording in recordings}
    notes = [f"units of the samples differ ({' and '.join(sorted(units))})"] if len(units) > 1 else []
    frequencies = [wf.center_frequency for wf in waves]
    has_phases = abs(frequencies[1] - frequencies[0]) <= _SAME_FREQUENCY * frequencies[0]
    if not has_phases:
        notes.append("no phases: centre frequencies differ")
    has_channels = radars[0].num_channels == radars[1].num_channels
    if not has_channels:
        notes.append("no phases: numbers of channels differ")
    if not both:
        return EchoDifference(0, *(np.nan,) * 4, channel_phases_deg=(), note="; ".join(notes))

    levels, products = [], []
    for i, j in both:
        found = [
            echo(recording[k], one.range[k], one.velocity[k])
            for recording, one, k in zip(recordings, estimated, (i, j), strict=True)
        ]
        powers = [float(np.mean(np.abs(one) ** 2)) for one in found]
        levels.append(10.0 * np.log10(powers[1] / powers[0]) if min(powers) > 0.0 else np.nan)
        if has_phases and has_channels:
            moved = 0.5 * (a.velocity[i] + b.velocity[j]) * (b.time[j] - a.time[i])
            turn = 4.0 * np.pi / SPEED_OF_LIGHT * (frequencies[1] * moved + np.diff(frequencies)[0] * a.range[i])
            products.append(found[1] * found[0].conj() * np.exp(-1j * turn))
    known = np.array(levels)[np.isfinite(levels)]
    ratio, spread = (float(np.median(known)), float(known.std())) if len(known) > 0 else (np.nan, np.nan)
    phase, phase_spread, of_channels = _phases(np.array(products)) if products else (np.nan, np.nan, ())
    return EchoDifference(len(both), ratio, spread, phase, phase_spread, of_channels, "; ".join(notes))


def _phases(products: NDArray[np.complex128]) -> tuple[float, float, tuple[float, ...]]:
    """Circular mean and deviation of the phases (pair, channel), and phases of channels relative to the first."""
    together = products.sum(axis=1)
    unit = together / np.maximum(np.abs(together), 1e-300)
    mean = unit.mean()
    length = min(max(abs(mean), 1e-12), 1.0)
    of_channels = (products * unit.conj()[:, None]).sum(axis=0)
    relative = np.angle(of_channels * of_channels[0].conj())
    return (
        float(np.rad2deg(np.angle(mean))),
        float(np.rad2deg(np.sqrt(-2.0 * np.log(length)))),
        tuple(np.rad2deg(relative).tolist()),
    )


def _unit(recording: Recording) -> str:
    """Unit of the samples of a recording."""
    unit: Any = recording.source.get("cube_unit") or (unit_of(recording[0]) if len(recording) > 0 else None)
    return "sqrt(W)" if unit is None else str(unit)
