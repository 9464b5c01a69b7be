"""Radar frames from depth images of other programs: the route of Stetco et al., ICRA 2020."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radarcore import _core, check, notice
from radarcore.depth import surfaces
from radarcore.depth.image import Image, bodies_of, depths, fractions, normals_of, returns
from radarcore.depth.motion import ImageMotion
from radarcore.geometry.camera import Camera
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.receive.chain import received
from radarcore.recording.frame import Frame, adc_codes, frame_of
from radarcore.scene.scene import Scene
from radarcore.simulate.engine import NUM_TIMES, at_receivers, counts_of, ideal_frame, new_engine, ramps_of
from radarcore.simulate.settings import Settings
from radarcore.simulate.warnings import Warnings

SAMPLINGS = ("footprint", "point")
"""Ways to let a pixel stand for the patch it covers."""

# A depth that is this close to the far plane is the far plane.
_FAR_MARGIN = 1e-6
# Quantisation that turns phases by more than this is worth a warning [degrees].
_PHASE_WARNING_DEG = 5.0


def frame_from_depth(
    distance: ArrayLike,
    reflectance: ArrayLike,
    radar: Radar,
    *,
    camera: Camera | tuple[float, float],
    planar: bool = False,
    scale: float | None = None,
    previous: ArrayLike | None = None,
    interval: float | None = None,
    max_speed: float = 10.0,
    normals: ArrayLike | None = None,
    albedo: ArrayLike = 0.0,
    body: ArrayLike | None = None,
    twists: ArrayLike | None = None,
    far: float | None = None,
    max_points: int | None = None,
    sampling: str = "footprint",
    time: float = 0.0,
    image_time: float | None = None,
    tolerance: float = 1e-3,
    method: str = "auto",
    seed: int = 0,
    threads: int | None = None,
) -> Frame:
    """Radar frame from a depth image of any origin, seen from the centre of the radar's array.

    Without `previous` and `twists` nothing moves. With `previous` every pixel gets the range rate of the difference of
    the two images and keeps it through the frame (Stetco et al., eq. (13)). That is the truth where a surface moves
    along the ray and, for specular surfaces, along itself; diffuse echoes of a surface that moves along itself have a
    velocity that no difference of depths shows. A pixel that shows another object than before has no range rate, as its
    difference is a jump and not a motion, and is left out. With `body` and `twists` motion is exact.

    Parameters
    ----------
    distance : (rows, columns) array_like
        Distance along the ray [m], row 0 on top, column 0 on the left, as in `DepthImage`. Infinite, NaN, zero and
        negative numbers are no return. Integers, such as millimetres of 16 bits, need `scale`.
    reflectance : (rows, columns) array_like or float
        Power reflectance, 0 to 1, of the specular part: the field is reflected by ``-sqrt(reflectance)``. Integers
        of 8 and 16 bits, a grey image, count as fractions of the largest.
    radar : Radar
    camera : Camera or (float, float)
        Camera of the image, or its horizontal and vertical field of view [degrees].
    planar : bool
        The distance is the one along the optical axis, as renderers give it.
    scale : float, optional
        Metres per unit of `distance` and `previous`: 1e-3 for millimetres.
    previous : (rows, columns) array_like, optional
        The distance `interval` seconds before.
    interval : float, optional
        Time between the images [s].
    max_speed : float
        Differences faster than this are jumps between objects, whatever the surroundings look like [m/s].
    normals : (rows, columns, 3) array_like, optional
        Normals of the surface, in sensor axes, of any length and sign. Default: from differences of neighbouring
        depths, exact on planes; pixels without neighbours on the same surface are left out.
    albedo : (rows, columns) array_like or float
        Power scattered after Lambert's law over incident power.
    body : (rows, columns) array_like of int, optional
        Number of the body, -1 for no return, as in `DepthImage`. Default: one body.
    twists : (body, 6) array_like, optional
        Rigid motion of every body relative to the sensor, in sensor axes: velocity [m/s] of the body's (extended)
        material at the place of the camera, and angular velocity [rad/s]. A body that turns with w about a point p that
        moves with v has the velocity ``v + cross(p, w)`` there.
    far : float, optional
        Far plane [m], whatever the scale, measured as `distance`: depths that reach it are no return.
    max_points : int, optional
        Largest number of pixels used, evenly spaced; each then covers a larger solid angle.
    sampling : "footprint" or "point"
        As in `Simulator`.
    time : float
        Start of the frame [s].
    image_time : float, optional
        Time of the image [s]; default: the start of the frame. The truth holds for it.
    tolerance, method, seed, threads
        As in `Simulator`.

    Returns
    -------
    frame : Frame
        With the nearest point of every body as truth, if there are bodies; velocities are known from `twists` or from
        `previous`, and zero without them. Stats as of `Simulator`; also ``silhouettes_excluded`` (pixels without a
        range rate), ``normals_missing`` and ``quantisation_phase_deg``.

    Warns
    -----
    UserWarning
        When whole millimetres or other decimal steps of the image destroy phases, or velocities from differences; when
        its distances are far beyond the radar's range, for example in millimetres.

    See Also
    --------
    Camera : Pinhole camera of an image.
    adapters.images : Decoders of the images of simulators and robots.
    Simulator : Frames from meshes, exact in phase.

    Examples
    --------
    >>> radar = rc.bgt60tr13c(num_chirps=16)
    >>> wall = np.full((48, 64), 2.0)  # 2 m along the optical axis
    >>> before = {"previous": wall + 0.01, "interval": 0.02}
    >>> frame = rc.frame_from_depth(wall, 0.5, radar, camera=(40.0, 30.0), planar=True, **before)
    >>> peak = rc.strongest_peak(frame)
    >>> print(f"{peak.range:.1f} m, {peak.velocity:+.1f} m/s")
    2.0 m, -0.5 m/s
    """
    check.instance("radar", radar, Radar)
    check.choice("sampling", sampling, SAMPLINGS)
    settings = Settings(sampling=sampling, tolerance=tolerance, method=method, seed=seed, threads=threads)
    start = check.number("time", time, "s")
    at = start if image_time is None else check.number("image_time", image_time, "s")

    # Distances along the rays, infinite without a return; quantisation and noise.
    unit = None if scale is None else check.positive("scale", scale, "m per unit")
    given = depths("distance", distance, unit)
    shape = given.shape
    lens = camera if isinstance(camera, Camera) else Camera.from_field_of_view(camera, *shape)
    to_ray = lens.slant(*shape) if planar else np.ones(shape)
    limit = np.inf if far is None else check.positive("far", far, "m") * (1.0 - _FAR_MARGIN)
    ray = returns(given, limit) * to_ray
    bodies, num_bodies = bodies_of(body, twists, shape)
    ray[bodies < 0] = np.inf
    warnings = Warnings(Scene(), radar, settings.tolerance)
    warnings.distances_not_in_metres(ray)
    step = surfaces.decimal_step(ray / to_ray)
    noise = surfaces.relative_noise(given, ray / to_ray, step)

    # Normals; pixels without one are left out.
    tilt = normals_of(normals, ray, lens, noise)
    missing = np.isfinite(ray) & ~tilt.any(axis=-1)

    # Motion; pixels of silhouettes have no range rate and are left out.
    motion = ImageMotion.of(twists, num_bodies, previous, interval)
    range_rate = np.zeros(shape)
    if motion.interval is not None:
        before = returns(depths("previous", np.asarray(previous), unit, shape), limit) * to_ray
        range_rate = surfaces.range_rate(ray, before, noise) / motion.interval
        range_rate[np.abs(range_rate) > check.positive("max_speed", max_speed, "m/s")] = np.nan
    silhouette = np.isfinite(ray) & np.isnan(range_rate)
    phase_error_deg = _phase_error_deg(step, radar.waveform, motion.interval)

    # Pixels, at most `max_points`.
    image = Image(
        camera=lens,
        distance=np.where(missing | silhouette, np.inf, ray),
        normals=tilt,
        reflection=-np.sqrt(fractions("reflectance", reflectance, shape)).astype(np.complex128),
        albedo=fractions("albedo", albedo, shape),
        body=bodies,
        range_rate=np.where(silhouette, 0.0, range_rate),
    ).thinned(None if max_points is None else check.count("max_points", max_points))

    # Ideal samples, then received samples.
    sequences = radar.sequences()
    ideals = [_simulate(image, motion, part, settings, start, at) for part in sequences]
    for ideal in ideals:
        warnings.unresolved(ideal)
    arriving = [at_receivers(ideal.cube, part) for ideal, part in zip(ideals, sequences, strict=True)]
    cube, use = received(arriving, sequences, start, seeds=[settings.seed])

    # Statistics and truth.
    num_hit = int((np.isfinite(image.distance) & (image.body >= 0)).sum())
    num_paths = ideals[0].counts["paths"]
    stats: dict[str, Any] = {
        **counts_of(ideals),
        "rays_cast": image.distance.size,
        "rays_hit": num_hit,
        "paths_skipped": num_hit - num_paths,
        "silhouettes_excluded": int(silhouette.sum()),
        "normals_missing": int(missing.sum()),
        "quantisation_phase_deg": phase_error_deg,
    }
    if use is not None and radar.receiver is not None:
        stats |= use.stats(radar.receiver)
        warnings.unsuitable_gain(use)
    truth = None if body is None else motion.truth(image, num_bodies)
    return frame_of(cube, start, radar, truth, stats, adc_codes(cube, radar))


def _phase_error_deg(step: float, waveform: Waveform, interval: float | None) -> float:
    """Error of the two-way phase of depths in steps [m], rms [degrees], with warnings where it is large.

    `interval`: time between two images whose difference gives velocities [s].
    """
    phase = float(720.0 * step / np.sqrt(12.0) / waveform.wavelength)
    if phase > _PHASE_WARNING_DEG:
        notice.warn(
            f"distance: quantised in steps of {1e6 * step:.3g} um, {phase:.0f} degrees of phase (rms) at "
            f"{1e-9 * waveform.center_frequency:.1f} GHz: expect false echoes and useless Doppler"
        )
    if interval is not None and (drift := np.sqrt(2.0) * phase * waveform.duration / interval) > _PHASE_WARNING_DEG:
        notice.warn(
            f"previous: velocities from quantised depths have errors of {np.sqrt(2.0 / 12.0) * step / interval:.2g} "
            f"m/s (rms), {drift:.0f} degrees of phase within the frame"
        )
    return phase


def _simulate(
    image: Image, motion: ImageMotion, radar: Radar, settings: Settings, start: float, at: float
) -> _core.IdealFrame:
    """Ideal frame of one sub-sequence that starts at `start` [s], of an image taken at `at` [s]."""
    waveform = ramps_of(radar)
    camera = image.camera
    source = _core.DepthScene(
        (*image.distance.shape, 1.0 / camera.fx, 1.0 / camera.fy, camera.cx, camera.cy),
        np.ascontiguousarray(image.distance),
        np.ascontiguousarray(image.normals),
        np.ascontiguousarray(image.reflection),
        np.ascontiguousarray(image.albedo),
        np.ascontiguousarray(image.body),
        num_bodies=len(motion.twists),
        range_rate=np.ascontiguousarray(image.range_rate) if image.range_rate.any() else None,
        age=start - at,
    )
    engine = new_engine(source, [], radar, settings, center=[0.0, 0.0, 0.0])

    def place(num_times: int) -> _core.Placement:
        return motion.placement(start - at + waveform.delay_times(num_times))

    return ideal_frame(engine, place(NUM_TIMES), place)
