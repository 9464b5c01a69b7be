"""One echo of frames: what estimators of its range and velocity take, how strong it is, and what they return."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.beat_search import noise_power
from radarcore.processing.bounds import CramerRaoBound
from radarcore.processing.inputs import Samples, checked_samples, cube_and_radar, cube_and_waveform
from radarcore.processing.phase_fit import PhaseFit
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range
from radarcore.recording.frame import Frame

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VelocityEstimate:
    """Range and velocity of the strongest echo; NaN where there is none.

    Attributes
    ----------
    range : float or (frame,) float64
        Range at the middle of the frame [m].
    velocity : float or (frame,) float64
        Range rate, receding positive [m/s].
    range_std, velocity_std : float or (frame,) float64
        Predicted standard deviations [m], [m/s]: the Cramér-Rao bound at the measured `snr_db`, with the loss of the
        windows. They hold for one echo in white noise and above the threshold of the estimate, below which peaks of
        noise are taken for the echo.
    snr_db : float or (frame,) float64
        Power of the echo over that of the noise, per sample [dB]; -inf where the noise hides it.

    See Also
    --------
    doppler_velocity : By the phase over the chirps.
    up_down_velocity : By chirps of both slopes.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32)).frame()
    >>> estimate = rc.doppler_velocity(frame)
    >>> round(estimate.velocity, 2), estimate.velocity_std < 1e-3
    (-0.5, True)
    """

    range: Array | float
    velocity: Array | float
    range_std: Array | float
    velocity_std: Array | float
    snr_db: Array | float


class Echo(NamedTuple):
    """Estimate of one frame."""

    range: float = np.nan
    velocity: float = np.nan
    range_std: float = np.nan
    velocity_std: float = np.nan
    snr_db: float = np.nan


class EchoInput(NamedTuple):
    """Samples (frame, channel, chirp, sample) of a waveform, checked."""

    samples: NDArray[Any]
    waveform: Waveform
    offsets: Array
    """Time from the mean chirp of all channels to the mean chirp of each, (channel,) [s]."""
    is_one: bool
    """One frame, not several."""


def checked_input(cube: Samples, waveform: Waveform | Radar | None, name: str = "cube") -> EchoInput:
    """Samples of one frame or several, with the radar or waveform that they have; `name`: of the argument."""
    samples, wf = cube_and_waveform(cube, waveform)
    offsets = np.zeros(1)
    if not isinstance(waveform, Waveform):
        of_channels = cube_and_radar(cube, waveform)[1].channel_offsets
        if of_channels.any():
            offsets = of_channels - of_channels.mean()
    require_range(wf)
    checked = checked_samples(
        samples, "([frame,] channel, chirp, sample)", num_chirps=wf.num_chirps, num_samples=wf.num_samples
    )
    if checked.ndim not in (3, 4):
        raise ValueError(f"{name}: expected shape ([frame,] channel, chirp, sample), got {checked.shape}")
    if checked.shape[-3] == 0:
        raise ValueError(f"{name}: expected at least one channel, got none")
    if not np.isfinite(checked).all():
        bad = np.argwhere(~np.isfinite(checked))
        raise ValueError(
            f"{name}: expected finite samples, got {len(bad)} that are not, the first at {tuple(map(int, bad[0]))}"
        )
    is_one = checked.ndim == 3
    return EchoInput(checked[None] if is_one else checked, wf, offsets, is_one)


def delay_between(up: Samples, down: Samples) -> float | None:
    """Difference of the times of two frames [s]; None for cubes."""
    if isinstance(up, Frame) and isinstance(down, Frame):
        return down.time - up.time
    times = getattr(up, "time", None), getattr(down, "time", None)
    if times[0] is None or times[1] is None or len(times[0]) == 0:
        return None
    between = np.asarray(times[1]) - np.asarray(times[0])
    if np.ptp(between) > 1e-9:
        raise ValueError(
            f"down: expected frames at one delay after those of up, got {between.min():g} to {between.max():g} s"
        )
    return float(between[0])


def checked_noise(noise: float | None) -> float | None:
    """Power of the noise per sample, None if it is to be measured."""
    return None if noise is None else check.non_negative("noise", noise)


def measured_echo(
    frame: NDArray[Any],
    waveform: Waveform,
    fit: PhaseFit,
    distance: float,
    velocity: float,
    level: float | None,
    bound_of: Callable[[float, bool, int], CramerRaoBound],
    weights: Array,
) -> Echo:
    """A fitted echo with what it is worth: the bound of (snr_db, is_real, num_channels); `level`: of known noise."""
    snr_db = decibels(snr(frame, waveform, fit, level, weights))
    bound = bound_of(snr_db, not np.iscomplexobj(frame), len(frame))
    return Echo(float(distance), float(velocity), float(bound.range), float(bound.velocity), snr_db)


def snr(frame: NDArray[Any], waveform: Waveform, fit: PhaseFit, level: float | None, weights: Array) -> float:
    """Power of the echo over that of the noise, per sample."""
    noise = noise_power(frame - fit.echo, waveform) if level is None else level
    if noise == 0.0:
        return np.inf
    # Power of a real tone is half of its squared amplitude, which has twice the noise in it.
    is_iq = np.iscomplexobj(frame)
    per_amplitude = float((weights**2).sum() / weights.sum() ** 2) * fit.num_free / len(frame)
    power = fit.power * (1.0 if is_iq else 0.5) - noise * per_amplitude * (1.0 if is_iq else 2.0)
    return max(0.0, power / noise)


def decibels(ratio: float) -> float:
    """A ratio of powers in dB, -inf for 0."""
    with np.errstate(divide="ignore"):
        return float(10.0 * np.log10(ratio))


def measured(given: EchoInput, measure: Callable[[NDArray[Any]], Echo]) -> VelocityEstimate:
    """Estimates of a function, frame by frame."""
    return stacked([measure(frame) for frame in given.samples], given.is_one)


def stacked(rows: list[Echo], is_one: bool) -> VelocityEstimate:
    """Numbers of one frame, arrays of several."""
    if is_one:
        return VelocityEstimate(*rows[0])
    return VelocityEstimate(*np.array(rows, dtype=np.float64).reshape(len(rows), len(Echo._fields)).T)
