"""Power over range and angle, and over azimuth and elevation at one range."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.processing.angles import beamforming
from radarcore.processing.angles.beamforming import Beamformer, range_covariances, smoothed
from radarcore.processing.angles.steering import checked_angles, steering_vectors, uniform_row
from radarcore.processing.inputs import Samples, checked_samples, cube_and_radar, transform_length
from radarcore.processing.spectra.windows import Window
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import require_range

METHODS = ("bartlett", "capon", "music", "fft")

_FRONT = np.deg2rad(np.arange(-90.0, 90.5))
"""Angles of the front half in steps of one degree [rad]."""

_BLOCK = 2**20
"""Elements of the largest intermediate array, 16 MB."""


def range_angle(
    cube: Samples,
    radar: Radar | None = None,
    *,
    method: str = "bartlett",
    azimuth: ArrayLike | None = None,
    elevation: ArrayLike = 0.0,
    num_sources: int | None = None,
    loading: float = 1e-2,
    window: Window = "hann",
    doppler_window: Window = "hann",
    num_range_bins: int | None = None,
    channel_phase: ArrayLike | None = None,
) -> NDArray[Any]:
    """Power over range and angle, from the covariance of the channels over the chirps of a frame.

    Uses the true positions of the channels (`Radar.virtual_array`). In time-division multiplex
    (`Radar.channel_offsets`) the covariance is taken over Doppler cells. The phase of each cell is corrected for motion
    between transmitters, assuming velocities within ``waveform.max_velocity``.

    "bartlett" adds the channels in phase. "capon" weights them to reject other directions, and "music" finds directions
    orthogonal to the noise subspace; both separate targets within a beam width. Targets at rest in one range bin are
    coherent. "capon" and "music" separate them with a uniform row of channels, by spatial smoothing over subarrays of
    three quarters of its length. Other arrays separate only targets of different velocity or range bin. "fft" is
    "bartlett" of a uniform row by a Fourier transform.

    Parameters
    ----------
    cube : (..., channel, chirp, sample) float32, float64, complex64 or complex128, or Frame or Recording
        Beat signal, real or I/Q.
    radar : Radar, optional
        Of a cube; a frame or recording has its own.
    method : "bartlett", "capon", "music" or "fft"
    azimuth, elevation : (angle,) array_like or float
        Angles [rad], positive to the left and up, broadcast together; default: azimuth from -90 to 90 degrees in steps
        of one degree.
    num_sources : int, optional
        Echoes per range bin, for "music"; default: estimated at each range from the eigenvalues of the covariance
        (minimum description length), none in bins of noise.
    loading : float
        For "capon": diagonal loading, relative to the mean power of the channels.
    window, doppler_window : str, tuple or None
        Windows over fast and slow time, as `scipy.signal.get_window` names them (periodic). The window over slow time
        applies only in time-division multiplex.
    num_range_bins : int, optional
        Length n of the range transform, zero-padded; default: `num_samples`.
    channel_phase : (channel,) array_like, optional
        Phase errors of the channels to subtract [rad], such as line lengths, measured on a target in front. Default:
        multiply the channels by `Radar.channel_corrections`.

    Returns
    -------
    power : (..., range, angle) float32 or float64
        At the first of ``waveform.range_axis(n)``: ``n // 2 + 1`` from real samples, n from I/Q. Power per channel of
        an echo from each angle, ``abs(range_profile(...))**2``, mean over chirps. "music" gives a dimensionless
        spectrum of at least 1, whose sharp peaks do not measure power.

    Raises
    ------
    ValueError, TypeError
        As `range_doppler`; for angles that do not broadcast to one axis, for "fft" with channels that do not form a
        uniform row, and for `num_sources` not below the number of channels of a subarray.

    See Also
    --------
    processing.azimuth_elevation : Both angles in one range bin.
    detect : Angles of single targets.
    plot.range_angle_map : Plots it.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([1.7, 1.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> azimuth = np.deg2rad(np.arange(-60, 61))
    >>> power = rc.range_angle(frame, azimuth=azimuth)[4:].max(axis=0)
    >>> print(f"{np.rad2deg(azimuth[power.argmax()]):.0f} degrees")
    31 degrees
    """
    samples, radar = _checked(cube, radar)
    az, el = checked_angles(_FRONT if azimuth is None else azimuth, elevation)
    if len(shape := np.broadcast_shapes(az.shape, el.shape)) > 1:
        raise ValueError(f"azimuth, elevation: expected angles that broadcast to one axis, got shape {shape}")
    require_range(radar.waveform)
    n = transform_length("num_range_bins", num_range_bins, "num_samples", radar.waveform.num_samples)
    num_ranges = n if np.iscomplexobj(samples) else n // 2 + 1
    to_power = _beamformer(method, radar, np.atleast_2d(unit_vectors(az, el)), num_sources, loading)
    settings = {"window": window, "doppler_window": doppler_window, "num_range_bins": n, "channel_phase": channel_phase}
    return _maps(samples, radar, to_power, (num_ranges, int(np.prod(shape))), slice(None), settings)


def azimuth_elevation(
    cube: Samples,
    radar: Radar | None = None,
    *,
    at_range: float,
    method: str = "bartlett",
    azimuth: ArrayLike | None = None,
    elevation: ArrayLike | None = None,
    num_sources: int | None = None,
    loading: float = 1e-2,
    window: Window = "hann",
    doppler_window: Window = "hann",
    num_range_bins: int | None = None,
    channel_phase: ArrayLike | None = None,
) -> NDArray[Any]:
    """Power over azimuth and elevation in the range bin nearest to `at_range`; other parameters as in `range_angle`.

    Parameters
    ----------
    at_range : float
        Range [m].
    azimuth, elevation : (azimuth,) and (elevation,) array_like, optional
        Angles [rad], positive to the left and up; default: from -90 to 90 degrees in steps of one degree.

    Returns
    -------
    power : (..., azimuth, elevation) float32 or float64

    Raises
    ------
    ValueError, TypeError
        As `range_angle`, and for a range without a bin.

    See Also
    --------
    range_angle : One angle at all ranges.
    directions : Directions of detections.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([1.7, 1.0, 0.0])])
    >>> frame = rc.Simulator(scene, rc.bgt60tr13c(num_chirps=16)).frame()
    >>> angles = np.deg2rad(np.arange(-60, 61))
    >>> power = rc.processing.azimuth_elevation(frame, at_range=1.97, azimuth=angles, elevation=angles)
    >>> power.shape
    (121, 121)
    """
    samples, radar = _checked(cube, radar)
    az = np.atleast_1d(checked_angles(_FRONT if azimuth is None else azimuth, 0.0)[0])
    el = np.atleast_1d(checked_angles(0.0, _FRONT if elevation is None else elevation)[1])
    for name, angles in (("azimuth", az), ("elevation", el)):
        if angles.ndim != 1:
            raise ValueError(f"{name}: expected shape (n,), got {angles.shape}")
    directions = unit_vectors(az[:, None], el).reshape(-1, 3)
    to_power = _beamformer(method, radar, directions, num_sources, loading)
    n = transform_length("num_range_bins", num_range_bins, "num_samples", radar.waveform.num_samples)
    ranges = radar.waveform.range_axis(n)[: n if np.iscomplexobj(samples) else n // 2 + 1]
    nearest = check.non_negative("at_range", at_range, "m") / (ranges[1] if len(ranges) > 1 else np.inf)
    if round(nearest) >= len(ranges):
        raise ValueError(f"at_range: expected at most {ranges[-1]:g} m, the last range bin, got {at_range:g}")
    settings = {"window": window, "doppler_window": doppler_window, "num_range_bins": n, "channel_phase": channel_phase}
    bins = slice(round(nearest), round(nearest) + 1)
    power = _maps(samples, radar, to_power, (1, len(directions)), bins, settings)
    return power.reshape(*samples.shape[:-3], len(az), len(el))


def _maps(
    samples: NDArray[Any],
    radar: Radar,
    to_power: Beamformer,
    shape: tuple[int, int],
    bins: slice,
    settings: dict[str, Any],
) -> NDArray[Any]:
    """Power (..., range, angle) of some range bins; `settings` of `range_covariances`.

    Works frame by frame and in blocks of ranges, so that only the result holds all frames.
    """
    num_ranges, num_angles = shape
    block = max(1, _BLOCK // (radar.num_channels * max(1, num_angles)))
    power = np.empty((*samples.shape[:-3], *shape), samples.real.dtype)
    for which in np.ndindex(samples.shape[:-3]):
        covariances = range_covariances(samples[which], radar, bins=bins, **settings)
        for k in range(0, num_ranges, block):
            power[(*which, slice(k, k + block))] = to_power(covariances[k : k + block])
    return power


def _checked(cube: Samples, radar: Radar | None) -> tuple[NDArray[Any], Radar]:
    given, radar = cube_and_radar(cube, radar)
    lengths = {
        "num_channels": radar.num_channels,
        "num_chirps": radar.waveform.num_chirps,
        "num_samples": radar.waveform.num_samples,
    }
    return checked_samples(given, "(..., channel, chirp, sample)", **lengths), radar


def _beamformer(
    method: str, radar: Radar, directions: NDArray[np.float64], num_sources: int | None, loading: float
) -> Beamformer:
    """The method as a function of covariances, with its other arguments checked and bound."""
    check.choice("method", method, METHODS)
    positions, wavelength = radar.virtual_array, radar.waveform.wavelength
    part = check.positive("loading", loading)
    row = uniform_row(positions)

    # Capon and MUSIC use subarrays of a uniform row.
    chosen, length = np.arange(len(positions)), len(positions)
    if row is not None and method in ("capon", "music"):
        chosen, length = row[0], length - length // 4
    steering = steering_vectors(positions[chosen[:length]], wavelength, directions)
    if num_sources is not None:
        known = check.count("num_sources", num_sources)
        if method == "music" and known >= length:
            raise ValueError(f"num_sources: expected fewer than the {length} channels of a subarray, got {known}")

    def matrices(covariances: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return covariances if row is None else smoothed(covariances, chosen, length)

    if method == "bartlett":
        return lambda covariances: beamforming.bartlett(covariances, steering)
    if method == "capon":
        return lambda covariances: beamforming.capon(matrices(covariances), steering, part)
    if method == "music":
        num_chirps = radar.waveform.num_chirps
        return lambda covariances: beamforming.music(matrices(covariances), steering, num_sources, num_chirps)
    if row is None:
        raise ValueError(
            "method: expected channels at equal steps along a line for 'fft', got others (see Radar.virtual_array); "
            "'bartlett' takes any"
        )
    order, step = row
    return lambda covariances: beamforming.fft_beams(covariances, order, step / wavelength, directions)
