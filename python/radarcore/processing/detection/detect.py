"""Detections of a frame as a point cloud: cells above the surrounding noise, measured with sub-cell accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check
from radarcore.processing.angles.directions import require_two_directions, waves_of
from radarcore.processing.angles.plane_wave import array_of
from radarcore.processing.clutter.static import remove_mean
from radarcore.processing.detection.bands import Bands, bands_of
from radarcore.processing.detection.map import (
    LEAST_GAIN,
    MAIN_LOBE,
    DetectionSettings,
    Layout,
    prepared,
    settings_of,
)
from radarcore.processing.detection.point_cloud import Detections, detections_of
from radarcore.processing.detection.tone import fit
from radarcore.processing.inputs import checked_samples, cube_and_radar, require_one_frame
from radarcore.processing.spectra.noise import LEAST_NOISE, filtered_rows, median_of_unit_mean
from radarcore.processing.spectra.spectra import fast_spectrum, transformed
from radarcore.processing.spectra.windows import Window
from radarcore.products import real_inner
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame

_LARGEST_NOISE = 20.0
"""Powers above this many medians are echoes rather than noise."""


def detect(
    frame: Frame | ArrayLike,
    radar: Radar | None = None,
    *,
    false_alarm_rate: float = 1e-6,
    guard: int | Sequence[int] = MAIN_LOBE,
    training: int | Sequence[int] | None = None,
    subtract_mean: bool = False,
    window: Window = "hann",
    doppler_window: Window = "hann",
    min_range: float | None = None,
    max_range: float | None = None,
    dynamic_range_db: float = 60.0,
    max_directions: int = 1,
) -> Detections:
    """Detect the targets in a frame and estimate range, velocity and direction of each, with covariance.

    The range-Doppler map sums the power of all channels, without zero padding. A detection is a local maximum above the
    mean of its training cells by the factor of `cfar`. Training cells are clipped at five times the level of their
    range, so that a wall does not mask a person nearby. The maximum must also exceed the threshold after subtraction of
    the largest amplitude that sidelobes of stronger echoes can contribute at any phase. The window determines the
    sidelobes; the distance that a fast target crosses in a frame widens them. The same rule removes maxima on the main
    lobe of a stronger echo.

    Noise in neighbouring cells of a windowed transform is correlated, so the effective number of training cells is
    smaller. The threshold is at most 0.3 dB higher than necessary for `false_alarm_rate`. Noise causes detections at
    this rate or a slightly lower one, because neighbours of a local maximum are not detected.

    Targets in the same cell of range and velocity form one detection, whose direction may lie outside both. If the
    channels show this, `Detections.is_resolved` is False and the covariance of the angles is larger. An array with four
    channels at different places along an axis can separate two targets (`max_directions`). Velocities whose noise
    was removed by `remove_static` or `cancel_pulses` are excluded from training.

    Transmitters in Doppler-division multiplex are separated if a band is empty (`Schedule.ddm`). Among echoes at one
    range whose velocities differ by whole bands, only the strongest is detected.

    Each detection is refined by a maximum-likelihood fit of a tone to the cells within 4 of it, in all channels, after
    subtraction of stronger echoes nearby. The covariance is the Cramer-Rao bound at the estimated SNR. Range and
    velocity refer to the middle of the frame, `Detections.time`. The range is corrected for the Doppler shift, so the
    errors of range and velocity are correlated. A single chirp, or chirps at unequal intervals, give no velocity, and
    their ranges keep the Doppler shift. A CW radar gives no range.

    Parameters
    ----------
    frame : Frame, or (channel, chirp, sample) float32, float64, complex64 or complex128
        Beat signal, finite.
    radar : Radar, optional
        Required for a cube; a frame has its own.
    false_alarm_rate : float
        Detections per cell of noise, above 0, up to 0.01. Cells are ``num_chirps`` times the range bins
        (``num_samples // 2 + 1`` from real samples) beyond `min_range`.
    guard, training : int or (int, int), optional
        Cells on each side, for velocity and range. The guard cells must cover the main lobe. Default of `training`: 8,
        or 16 in a profile without velocities.
    subtract_mean : bool
        Subtract the mean of the chirps, for a radar at rest (`remove_static` is for a moving radar). The threshold
        takes the missing noise at low velocities into account. Targets slower than about one velocity bin are lost.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic). Default: Hann, as in all
        maps, because the sidelobes of a strong echo would hide weak ones. Estimators and bounds of a single echo
        (`doppler_velocity`) default to none, which is the most accurate.
    min_range, max_range : float, optional
        Limits of the range [m]. Default: all except the two range bins next to the radar (and, for real samples, the
        last), which contain leakage. These bins are excluded from training too.
    dynamic_range_db : float
        Detections more than this below the strongest are discarded [dB]; receivers and simulations are no more exact.
    max_directions : 1 or 2
        2: a cell gives two detections of equal range and velocity if two plane waves fit its channels significantly
        better than one. Each has its direction and `snr_db`. Most pairs are separated from 1.5 beam widths on. 1:
        the direction of the stronger wave.

    Returns
    -------
    detections : Detections
        Sorted by range. `snr_db` is the echo's power over the noise if it were in the middle of a cell, averaged
        over the channels. The noise is the median of the training cells.

    Raises
    ------
    ValueError, TypeError
        For shapes that do not fit the radar, several frames or waveforms, Doppler-division multiplex without an empty
        band, NaN or infinite samples, numbers out of range, and two directions with an array of fewer than four
        channels at different places along each axis.

    Warns
    -----
    UserWarning
        If there are detections and directions are ambiguous within the field of view of the antennas.

    See Also
    --------
    Detections : The result.
    strongest_peak : The strongest echo alone.
    cluster : Groups detections by object.
    track : Targets over time.

    Examples
    --------
    >>> radar = rc.bgt60tr13c(num_chirps=32)
    >>> scene = rc.Scene([rc.PointTarget([1.5, 0.2, 0.0], velocity=[-0.5, 0.0, 0.0])])
    >>> found = rc.detect(rc.Simulator(scene, radar).frame())
    >>> found.range.round(1).tolist(), found.velocity.round(1).tolist()
    ([1.5], [-0.5])
    """
    # Check all arguments before any work.
    settings = settings_of(
        false_alarm_rate=false_alarm_rate,
        guard=guard,
        training=training,
        subtract_mean=subtract_mean,
        window=window,
        doppler_window=doppler_window,
        min_range=min_range,
        max_range=max_range,
        dynamic_range_db=dynamic_range_db,
    )
    require_one_frame("frame", frame)
    cube, radar = cube_and_radar(frame, radar)
    bands = bands_of(radar)
    wf = radar.waveform
    samples = checked_samples(
        cube,
        "(channel, chirp, sample)",
        num_dimensions=3,
        num_channels=radar.num_channels,
        num_chirps=wf.num_chirps,
        num_samples=wf.num_samples,
    )
    if bands is not None:
        radar = bands.radar
        if settings.subtract_mean:
            raise ValueError("subtract_mean: expected False with Doppler-division multiplex")
    if check.count("max_directions", max_directions) > 1:
        require_two_directions(radar, max_directions)
    if not isfinite(energy := real_inner(samples, samples)):
        check.finite("frame", samples)
    search = prepared(radar, samples.dtype.kind == "c", settings)
    layout = search.layout

    # Local maxima of the power over velocity and range above their thresholds.
    cells, power = _map(samples, wf, layout, settings, bands)
    trained = _with_noise(power[:, search.first : search.last]).astype(np.float64)
    power = power.astype(np.float64)
    cells_around = {"guards": search.guards, "trainings": search.trainings}
    peaks, thresholds = _core.maxima_above(
        power, trained, search.scale, first=search.first, is_cyclic=layout.is_iq, **cells_around
    )
    if bands is not None:
        is_true = bands.are_true(power, peaks)
        peaks, thresholds = peaks[is_true], thresholds[is_true]
    time = (frame.time if isinstance(frame, Frame) else 0.0) + radar.middle
    if len(peaks) == 0:
        return detections_of(*_nothing(radar), time, array_of(radar).ambiguous_beyond)

    # Discard rounding errors of the samples and sidelobes.
    noise_floor = max(layout.rounding * energy, layout.num_looks * LEAST_NOISE)
    least = np.maximum(thresholds, search.factor[peaks[:, 0], peaks[:, 1] - search.first] * noise_floor)
    peaks, offset = _core.above_sidelobes(
        power,
        peaks,
        least,
        layout.envelopes,
        layout.mean_envelope,
        layout.mean_gain,
        searched=(search.first, search.last),
        smallest=10.0 ** (-0.1 * dynamic_range_db),
        smear=layout.smear,
        num_samples=len(layout.fast),
        is_cyclic=layout.is_iq,
    )

    # Fit the tones, and estimate their SNR.
    noise = _core.training_medians(trained, peaks - np.array([0, search.first]), **cells_around)
    noise /= median_of_unit_mean(layout.num_looks)
    noise = np.maximum(noise, noise_floor) / layout.num_looks
    has_images = layout.has_range and not (layout.is_iq or subtract_mean or bands)
    tones = fit(cells, peaks, offset, layout.axes, is_cyclic=layout.is_iq, has_images=has_images)
    matched = np.vecdot(tones.amplitude, tones.amplitude).real * tones.energy_gain / noise
    snr = np.maximum(matched - len(cells), 0.1 * matched)  # of all channels, without the noise in the fit
    in_cell = snr / tones.energy_gain * (layout.gain / len(cells))

    # Range and velocity, and their covariance.
    rows, columns = (peaks + tones.offset).T
    beat = layout.beat_step * layout.wrapped_column(columns)
    doppler = layout.doppler_step * layout.wrapped_row(rows)
    range_, velocity = layout.coordinates.at(beat, doppler)
    variance = 0.5 / (snr[:, None] * np.where(tones.information > 0.0, tones.information, np.inf))  # in cells^2
    covariance = np.zeros((len(peaks), 4, 4))  # one tone's amplitudes and frequencies err independently
    covariance[:, :2, :2] = (variance @ layout.covariances).reshape(-1, 2, 2)

    # Directions from the channels' amplitudes, up to two per tone.
    snapshots = _snapshots(tones.amplitude, radar.num_channels)
    distance = range_ if layout.has_range else None
    waves = waves_of(snapshots, radar, velocity, snr / radar.num_channels, distance, max_directions=max_directions)
    seen = waves.directions
    if waves.snapshot is not None:
        tone, in_cell = waves.snapshot, in_cell[waves.snapshot] * waves.share
        range_, velocity, covariance = range_[tone], velocity[tone], covariance[tone]
    covariance[:, 2:, 2:] = seen.covariance
    if np.isnan(covariance).any():
        is_unknown = np.isnan(covariance.diagonal(axis1=1, axis2=2))
        covariance[is_unknown[:, :, None] | is_unknown[:, None, :]] = np.nan

    # By range, within the limits.
    distance = range_ if layout.has_range else np.full(len(seen), np.nan)
    order = np.lexsort((velocity, distance))
    if min_range is not None:
        order = order[distance[order] >= min_range]
    if max_range is not None:
        order = order[distance[order] <= max_range]
    columns = np.array([distance, velocity, seen.azimuth, seen.elevation, 10.0 * np.log10(in_cell)])[:, order]
    others = covariance[order], seen.is_resolved[order], seen.alternatives[order]
    return detections_of(columns, *others, time, seen.ambiguous_beyond)


@lru_cache(maxsize=16)
def _nothing(radar: Radar) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_], NDArray[Any]]:
    """Columns, covariance, flags and alternatives of no detections."""
    alternatives = np.empty((0, len(array_of(radar).ambiguities) - 1, 2))
    return np.empty((5, 0)), np.empty((0, 4, 4)), np.empty(0, bool), alternatives


def _map(
    samples: NDArray[Any], wf: Waveform, layout: Layout, settings: DetectionSettings, bands: Bands | None
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Cells (look, row, column), and their power (row, column), scaled to equal noise in all cells."""
    moving = remove_mean(samples) if settings.subtract_mean else samples
    if layout.has_velocity:
        windowed = moving * layout.weights[moving.real.dtype]
        cells = transformed(windowed, wf, wf.num_samples, wf.num_chirps)
    else:
        profiles = fast_spectrum(moving, wf, window=settings.window, num_bins=None)
        cells = profiles.reshape(-1, 1, profiles.shape[-1])
    cells = cells[..., : layout.num_columns]
    if bands is not None:
        cells = bands.separated(cells)
    squares = np.square(cells.view(cells.real.dtype)).sum(axis=0)  # real and imaginary parts in turn
    power = squares[:, ::2] + squares[:, 1::2]
    if settings.subtract_mean and layout.has_velocity:
        power /= np.maximum(layout.row_gain, LEAST_GAIN)[:, None].astype(power.dtype)
        for row in np.flatnonzero(layout.row_gain <= LEAST_GAIN):  # rows without noise: neighbours replace it
            power[row] = 0.5 * (power[row - 1] + power[(row + 1) % len(power)])
    return cells, power


def _with_noise(power: NDArray[Any]) -> NDArray[Any]:
    """The map with substituted noise in rows emptied by a filter such as `remove_static`.

    An emptied row gets the power of a row far away, limited to exclude echoes, where this is larger.
    """
    is_empty = filtered_rows(power)
    if np.count_nonzero(is_empty) == 0:
        return power
    (empty,), (full,) = np.nonzero(is_empty), np.nonzero(~is_empty)
    far = full[(np.searchsorted(full, empty) + len(full) // 2) % len(full)]
    filled = power.copy()
    filled[empty] = np.maximum(power[empty], np.minimum(power[far], _LARGEST_NOISE * np.median(power[full])))
    return filled


def _snapshots(amplitude: NDArray[np.complex128], num_channels: int) -> NDArray[np.complex128]:
    """Amplitudes of the channels; chirps with individual phases are combined by their first singular vector."""
    chirps = amplitude.reshape(len(amplitude), num_channels, amplitude.shape[1] // num_channels)
    if chirps.shape[2] == 1:
        return chirps[:, :, 0]
    vectors, sizes, _ = np.linalg.svd(chirps, full_matrices=False)
    return np.asarray(vectors[:, :, 0] * sizes[:, :1])
