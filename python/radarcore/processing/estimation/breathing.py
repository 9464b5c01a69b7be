"""Detection of breathing at a place: the phase over seconds distinguishes standing people from furniture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.motion.group import Motions, sensor_state
from radarcore.motion.protocol import AT_REST, AnyMotion, as_motion
from radarcore.processing.inputs import require_one_waveform, require_transmitters_apart
from radarcore.processing.spectra.spectra import fast_spectrum
from radarcore.radar.waveform import require_range
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.units import SPEED_OF_LIGHT

_SHORTEST, _FEWEST = 5.0, 50
"""Shortest time [s], and least number of frames."""

_LEAST_SHARE = 0.5
"""Least moving share of a person's echo; static objects are below."""

_LARGEST_ROUGHNESS = 0.75
"""Mean square of the residual's steps over twice its mean square: 1 for noise, small for smooth movements."""

_NEAR = 0.3
"""Search range before and behind the place [m]."""

_DEGREE = 8
"""Degree of the polynomial of the sensor's position."""

_TILTS = np.arange(-32.0, 33.0, 4.0)
"""Phases at the ends of the sensor's line [rad]: directions may err by up to 0.07 rad on 0.4 m."""

_AT_REST, _OFF_THE_LINE = 1e-4, 2e-3
"""Largest root mean square of positions for a sensor at rest, and perpendicular to its line [m]."""

_NUM_PASSES = 2.0
"""Least number of passes of the sensor along its line."""

_PADDING = 4
"""Cells per range bin."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Breathing:
    """Result of a test whether the object at a place moves by itself, as a breathing person does.

    Parameters
    ----------
    share : float
        Share of the echo's power that the sensor's position does not explain: 0 for static objects, near 1 for
        movements of a quarter wavelength or more.
    is_breathing : bool or None
        None if uncertain.
    reason : str
        Reason for None, else empty.

    See Also
    --------
    processing.breathing : Makes one.

    Examples
    --------
    >>> rc.processing.Breathing(share=0.9, is_breathing=True, reason="").is_breathing
    True
    """

    share: float
    is_breathing: bool | None
    reason: str


def breathing(source: Recording | Iterable[Frame], place: ArrayLike, motion: AnyMotion | None = None) -> Breathing:
    """Test whether a person breathes at a place, from the phase over at least 5 s.

    A matched filter for a point at the place gives the echo of every frame. The echo of a static object depends only on
    the position of the sensor: the same position gives the same echo. A polynomial along the sensor's line is fitted to
    the echoes of each channel, and `Breathing.share` is the relative power of the residual. Breathing and sway move a
    person by a considerable part of a wavelength, so most of the echo is residual.

    Parameters
    ----------
    source : Recording or iterable of Frame
        At least 5 s and 50 frames in the order of time, at 20 frames per second or more. An iterable may wait for
        frames: each one is used as it comes, while `rc.Live` still has its poses.
    place : (3,) array_like
        In the world [m], such as ``TrackState.position``. The strongest echo within 0.3 m in range is used.
    motion : Motion, optional
        Of the sensor: at rest, or back and forth on one line or arc. Default: at rest at the world frame.

    Returns
    -------
    breathing : Breathing

    Raises
    ------
    ValueError, TypeError
        For shorter recordings, several waveforms, a CW radar and Doppler-division multiplex.

    See Also
    --------
    processing.vital_signs : Rates of a person at rest.
    Tracker : Tracks of standing people.

    Examples
    --------
    >>> chest = lambda time: rc.Pose([2.0 + 2e-3 * np.sin(2.0 * np.pi * 0.25 * time), 0.0, 0.0])
    >>> bodies = [rc.Body(rc.shapes.sphere(0.2), motion=chest)]
    >>> frames = rc.Simulator(rc.Scene(bodies), rc.bgt60tr13c(num_chirps=4)).record(0.0, 6.0, rate=10.0, progress=False)
    >>> found = rc.processing.breathing(frames, [1.8, 0.0, 0.0])
    >>> print(f"{found.share:.1f} of the echo moves: {found.is_breathing}")
    1.0 of the echo moves: True
    """
    where = check.array("place", place, (3,))
    motions = None if motion is None else Motions([as_motion("motion", motion)])
    times, positions, profiles = [], [], []
    for frame in source.frames() if isinstance(source, Recording) else source:
        check.instance("source", frame, Frame)
        profile, position = _profile(frame, where, motions)
        times.append(frame.time)
        positions.append(position)
        profiles.append(profile)
    if len(times) < _FEWEST or times[-1] - times[0] < _SHORTEST * (1.0 - 1.0 / _FEWEST):
        span = times[-1] - times[0] if times else 0.0
        raise ValueError(
            f"source: expected at least {_SHORTEST:g} s and {_FEWEST} frames, got {span:.2f} s and {len(times)} frames"
        )
    echoes = np.array(profiles)  # (frame, channel, cell)
    strongest = int(np.square(np.abs(echoes)).sum(axis=(0, 1)).argmax())
    echo = echoes[..., strongest]
    basis, tilts, reason = _basis(np.array(positions))
    if strongest in (0, echoes.shape[-1] - 1):
        reason = f"the strongest echo is more than {_NEAR:g} m from the place"
    tilted = tilts * echo  # (tilt, frame, channel)
    residuals = tilted - basis @ (basis.T @ tilted)
    residual = residuals[np.square(np.abs(residuals)).sum(axis=(1, 2)).argmin()]
    power = float(np.square(np.abs(residual)).sum())
    share = power / max(float(np.square(np.abs(echo)).sum()), 1e-300)
    roughness = float(np.square(np.abs(np.diff(residual, axis=0))).sum()) / max(2.0 * power, 1e-300)
    if not reason and share >= _LEAST_SHARE and roughness > _LARGEST_ROUGHNESS:
        reason = "there is no echo over the noise, or it changes too fast for the frames"
    return Breathing(share, None if reason else share >= _LEAST_SHARE, reason)


def _profile(frame: Frame, place: Array, motions: Motions | None) -> tuple[NDArray[np.complex128], Array]:
    """Matched-filter output at ranges around a place (channel, cell), and the position of the sensor (3,) [m]."""
    radar = frame.radar
    require_one_waveform(radar)
    require_transmitters_apart(frame, radar)
    waveform = radar.waveform
    require_range(waveform)
    center = radar.array_center
    sensor = AT_REST if motions is None else sensor_state(motions, frame.time + radar.middle, center)
    position = sensor.pose[:, :3] @ center + sensor.pose[:, 3]
    away = place - position
    distance = float(np.linalg.norm(away))
    if distance == 0.0:
        raise ValueError("place: expected a place in front of the sensor, got the sensor's position")

    # Ranges of the place at every sample, (channel, chirp, sample); channels are not added, so their phases may differ.
    starts = waveform.chirp_times + radar.channel_offsets[:, None]
    times = starts[..., None] + waveform.sample_times - radar.middle
    rate = -float(away @ sensor.velocity) / distance
    ranges = distance + rate * times
    frequency = waveform.start_frequency + waveform.slope * waveform.sample_times
    phases = 4.0 * np.pi / SPEED_OF_LIGHT * ranges * frequency
    weights = np.hanning(waveform.num_chirps + 2)[1:-1]
    matched = np.einsum("kcs,kcs,c->ks", frame.cube, np.exp(-1j * phases), weights)
    num_cells = _PADDING * waveform.num_samples
    spectrum = fast_spectrum(matched, waveform, window="hann", num_bins=num_cells)
    offsets = np.rint(np.linspace(-1.0, 1.0, 9) * _NEAR / waveform.range_resolution * _PADDING).astype(int)
    return spectrum[:, offsets], position


def _basis(positions: Array) -> tuple[Array, NDArray[np.complex128], str]:
    """Orthonormal functions of the sensor's position (frame, function), phases (tilt, frame, 1) and a reason.

    The phases tilt the echo along the line, because the direction of the place is uncertain. The reason says why the
    positions do not suffice; it is empty if they do.
    """
    about = positions - positions.mean(axis=0)
    along = about @ np.linalg.svd(about, full_matrices=False)[2][0]
    number = len(positions)
    if np.sqrt(np.mean(np.square(about).sum(axis=1))) < _AT_REST:
        return np.full((number, 1), number**-0.5), np.ones((1, 1, 1), complex), ""
    extent = float(np.ptp(along))
    place = 2.0 * (along - along.min()) / extent - 1.0
    tilts = np.exp(1j * np.multiply.outer(_TILTS, place))[..., None]
    basis = np.linalg.qr(np.polynomial.chebyshev.chebvander(place, _DEGREE))[0]
    off = float(np.sqrt(np.mean(np.square(about - basis @ (basis.T @ about)).sum(axis=1))))
    if off > _OFF_THE_LINE:
        return basis, tilts, f"the sensor leaves its line by {1e3 * off:.0f} mm"
    passes = float(np.abs(np.diff(along)).sum()) / extent
    if passes < _NUM_PASSES:
        return basis, tilts, f"the sensor passes its line {passes:.1f} times, fewer than {_NUM_PASSES:g}"
    return basis, tilts, ""
