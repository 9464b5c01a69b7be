"""Radar frames from depth images of other programs: the route of Stetco et al., ICRA 2020."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.depth import quantisation, surfaces
from radarcore.depth.quantisation import Quantisation
from radarcore.geometry.camera import Camera
from radarcore.geometry.pose import cross_matrix
from radarcore.radar.radar import Radar
from radarcore.receive.chain import receive
from radarcore.recording.frame import Frame, Truth
from radarcore.simulate.doubts import Doubts
from radarcore.simulate.settings import Settings
from radarcore.simulate.simulator import stats_of
from radarcore.units import SPEED_OF_LIGHT

SAMPLINGS = ("footprint", "point")
"""How a pixel stands for the patch it covers."""

# Times of the frame at which motion is placed: more where it is too fast for fewer.
_NUMS_OF_TIMES = (17, 33, 65)
# A depth that is this close to the far plane is the far plane.
_FAR_MARGIN = 1e-6
# Quantisation that turns phases by more than this is worth a warning [degrees].
_PHASE_WARNING_DEG = 5.0


@dataclass(frozen=True, eq=False)
class _Image:
    """What every pixel shows; arrays (rows, columns), no return where the distance is infinite."""

    camera: Camera
    distance: NDArray[np.float64]
    normals: NDArray[np.float64]
    reflection: NDArray[np.complex128]
    albedo: NDArray[np.float64]
    body: NDArray[np.int32]
    range_rate: NDArray[np.float64]

    def thinned(self, max_points: int | None) -> _Image:
        """Evenly spaced rows and columns, such that at most `max_points` pixels remain; each stands for more."""
        rows, columns = self.distance.shape
        if max_points is None or rows * columns <= max_points:
            return self
        step = int(np.sqrt(rows * columns / max_points))
        while max(1, rows // step) * max(1, columns // step) > max_points:
            step += 1
        chosen = [_middle_ones(length, step) for length in (rows, columns)]
        parts = {name: getattr(self, name)[tuple(chosen)] for name in vars(self) if name != "camera"}
        camera = self.camera.every(step, chosen[0].start, chosen[1].start)
        return replace(self, camera=camera, **parts)


def frame_from_depth(
    distance: ArrayLike,
    reflectance: ArrayLike,
    radar: Radar,
    *,
    camera: Camera | tuple[float, float],
    planar: bool = False,
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
    tolerance: float = 1e-4,
    method: str = "auto",
    seed: int = 0,
    threads: int | None = None,
) -> Frame:
    """One radar frame from a depth image of any origin, seen from the centre of the radar's array.

    Without `previous` and `twists` nothing moves. With `previous` every pixel gets the range rate of the difference of
    the two images and keeps it through the frame (Stetco et al., eq. (13)); that is the truth where a surface moves
    along the ray and, for mirror-like surfaces, along itself; the diffuse part of a surface that moves along itself has
    a velocity that no difference of depths shows. Pixels that show another object than before have no range rate: their
    difference is a jump, not a motion, and they are left out. With `body` and `twists` everything moves exactly.

    Parameters
    ----------
    distance : (rows, columns) array_like
        Distance along the ray [m], row 0 on top, column 0 on the left, as in `DepthImage`. Infinite, NaN, zero and
        negative numbers are no return.
    reflectance : (rows, columns) array_like or float
        Power reflectance, 0 to 1, of surfaces like mirrors: the field is reflected by ``-sqrt(reflectance)``. Integers
        of 8 and 16 bits, a grey image, count as fractions of the largest.
    radar : Radar
    camera : Camera or (float, float)
        Or horizontal and vertical field of view [degrees].
    planar : bool
        The distance is the one along the optical axis, as renderers give it.
    previous : (rows, columns) array_like, optional
        The distance `interval` seconds before.
    interval : float, optional
        Time between the images [s].
    max_speed : float
        Differences faster than this are jumps between objects, whatever the surroundings look like [m/s].
    normals : (rows, columns, 3) array_like, optional
        Of the surface, in sensor axes, of any length and sign. Default: from the differences of neighbouring depths,
        exact on planes; pixels without neighbours on the same surface are left out.
    albedo : (rows, columns) array_like or float
        Power scattered after Lambert's law over incident power.
    body : (rows, columns) array_like of int, optional
        Number of the body, -1 for no return, as in `DepthImage`. Default: one body.
    twists : (body, 6) array_like, optional
        Rigid motion of every body relative to the sensor, in sensor axes: velocity [m/s] of the body's (extended)
        material at the place of the camera, and angular velocity [rad/s]. A body that turns with w about a point p that
        moves with v has the velocity ``v + cross(p, w)`` there.
    far : float, optional
        Far plane [m], in the measure of `distance`: what reaches it is no return.
    max_points : int, optional
        At most as many pixels are used, evenly spaced; each stands for a larger solid angle.
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
        When the image is quantised so coarsely that phases, or velocities from differences, are lost.
    """
    if not isinstance(radar, Radar):
        raise TypeError(f"radar: expected Radar, got {type(radar).__name__}")
    check.choice("sampling", sampling, SAMPLINGS)
    settings = Settings(sampling=sampling, tolerance=tolerance, method=method, seed=seed, threads=threads)
    start = check.number("time", time, "s")
    at = start if image_time is None else check.number("image_time", image_time, "s")

    # The images: what returns, from where, how fast.
    given = _depths("distance", distance)
    shape = given.shape
    lens = camera if isinstance(camera, Camera) else Camera.from_field_of_view(camera, *shape)
    to_ray = lens.slant(*shape) if planar else np.ones(shape)
    limit = np.inf if far is None else check.positive("far", far, "m") * (1.0 - _FAR_MARGIN)
    ray = _returns(given, limit) * to_ray
    bodies, num_bodies = _bodies(body, twists, shape)
    ray[bodies < 0] = np.inf
    steps = quantisation.find(np.where(np.isfinite(ray), ray / to_ray, np.nan), lens.slant(*shape) / to_ray)
    noise = quantisation.relative_noise(given, ray / to_ray, steps)
    tilt = _normals(normals, ray, lens, noise)
    missing = np.isfinite(ray) & ~tilt.any(axis=-1)

    motion = _Motion.of(twists, num_bodies, previous, interval)
    range_rate = np.zeros(shape)
    if motion.interval is not None:
        before = _returns(_depths("previous", np.asarray(previous), shape), limit) * to_ray
        range_rate = surfaces.range_rate(ray, before, noise) / motion.interval
        range_rate[np.abs(range_rate) > check.positive("max_speed", max_speed, "m/s")] = np.nan
    silhouette = np.isfinite(ray) & np.isnan(range_rate)
    _warn_of_quantisation(steps, radar, motion.interval)

    image = _Image(
        camera=lens,
        distance=np.where(missing | silhouette, np.inf, ray),
        normals=tilt,
        reflection=-np.sqrt(_fraction("reflectance", reflectance, shape)).astype(np.complex128),
        albedo=_fraction("albedo", albedo, shape),
        body=bodies,
        range_rate=np.where(silhouette, 0.0, range_rate),
    ).thinned(None if max_points is None else check.count("max_points", max_points))

    # From pixels to samples, as `Simulator` does.
    ideal = _simulate(image, motion, radar, settings, start, at)
    Doubts(radar, settings.tolerance).of_frame(ideal)
    cube = receive(ideal.cube, radar, start, seed=settings.seed)

    num_hit = int((np.isfinite(image.distance) & (image.body >= 0)).sum())
    counts = stats_of(ideal)
    num_paths = counts["paths"]
    stats: dict[str, Any] = {
        **counts,
        "rays_cast": image.distance.size,
        "rays_hit": num_hit,
        "paths_skipped": num_hit - num_paths,
        "silhouettes_excluded": int(silhouette.sum()),
        "normals_missing": int(missing.sum()),
        "quantisation_phase_deg": steps.phase_error_deg(radar.waveform.wavelength),
    }
    truth = None if body is None else motion.truth(image, num_bodies)
    return Frame(cube, start, radar, truth, stats)


def _simulate(
    image: _Image, motion: _Motion, radar: Radar, settings: Settings, start: float, at: float
) -> _core.IdealFrame:
    """The ideal frame that starts at `start` [s] of what an image shows at the time `at` [s]."""
    source = _core.DepthScene(
        np.ascontiguousarray(image.distance),
        np.ascontiguousarray(image.normals),
        np.ascontiguousarray(image.reflection),
        np.ascontiguousarray(image.albedo),
        np.ascontiguousarray(image.body),
        num_bodies=len(motion.twists),
        focal_length=(image.camera.fx, image.camera.fy),
        principal_point=(image.camera.cx, image.camera.cy),
        range_rate=np.ascontiguousarray(image.range_rate) if image.range_rate.any() else None,
        age=start - at,
    )
    engine = _core.Simulator(
        source,
        [],
        antennas=radar._core,
        waveform=radar.waveform._core,
        center=(0.0, 0.0, 0.0),
        settings=settings.to_core(),
        threads=settings.threads,
    )
    rates = motion.placement(start - at + 0.5 * np.array([radar.waveform.duration]), is_rate=True)
    for num_times in _NUMS_OF_TIMES:
        places = motion.placement(start - at + radar.waveform.delay_times(num_times))
        if (ideal := engine.frame(places, rates)) is not None:
            return ideal
    raise AssertionError("the core follows any motion through the largest number of times as well as it can")


@dataclass(frozen=True, eq=False)
class _Motion:
    """How the pixels of an image move: by `twists` (body, 6), by range rates over `interval`, or not at all."""

    twists: NDArray[np.float64]
    interval: float | None

    @classmethod
    def of(cls, twists: ArrayLike | None, num_bodies: int, previous: object, interval: float | None) -> _Motion:
        if (previous is None) != (interval is None):
            raise ValueError(
                "interval: expected previous and interval together, got "
                f"{'interval' if previous is None else 'previous'} alone"
            )
        if twists is not None and previous is not None:
            raise ValueError("twists: expected either twists or previous, got both")
        rates = np.zeros((num_bodies, 6)) if twists is None else check.array("twists", twists, (num_bodies, 6))
        return cls(rates, None if interval is None else check.positive("interval", interval, "s"))

    def placement(self, elapsed: NDArray[np.float64], *, is_rate: bool = False) -> _core.Placement:
        """Bodies at times after that of the image [s], or their time derivatives; the sensor's axes are the world's."""
        poses = _screws(self.twists, elapsed)
        sensor = np.broadcast_to(np.eye(3, 4), (len(elapsed), 3, 4)).copy()
        if is_rate:
            # d/dt [R | p] = [w x R | w x p + v].
            turning = cross_matrix(self.twists[:, 3:]) @ poses
            turning[..., 3] += self.twists[:, :3]
            poses, sensor = turning, np.zeros_like(sensor)
        return _core.Placement(sensor, poses, np.zeros((len(elapsed), 0, 3)))

    def truth(self, image: _Image, num_bodies: int) -> Truth:
        """Nearest visible point of every body."""
        values = np.full((4, num_bodies), np.nan)
        rows, columns = image.distance.shape
        u, v = image.camera.plane(rows, columns)
        for number in range(num_bodies):
            pixels = np.flatnonzero((image.body == number) & np.isfinite(image.distance))
            if len(pixels) == 0:
                continue
            nearest = pixels[image.distance.flat[pixels].argmin()]
            row, column = divmod(int(nearest), columns)
            direction = np.array([1.0, u[column], v[row]]) / np.sqrt(1.0 + u[column] ** 2 + v[row] ** 2)
            point = image.distance[row, column] * direction
            linear, angular = self.twists[number, :3], self.twists[number, 3:]
            rate = direction @ (linear + np.cross(angular, point)) + image.range_rate[row, column]
            azimuth, elevation = np.arctan2(u[column], 1.0), np.arctan2(v[row], np.hypot(1.0, u[column]))
            values[:, number] = image.distance[row, column], rate, azimuth, elevation
        return Truth(tuple(f"body {number}" for number in range(num_bodies)), *values)


def _screws(twists: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rigid motions by constant twists, (time, body, 3, 4): rotation exp([w] t), translation its integral times v.

    Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation, eqs. (2.14) and (2.36).
    """
    linear, angular = twists[:, :3], twists[:, 3:]
    x, y, z = angular.T
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], 1)
    speed = np.linalg.norm(angular, axis=1)
    t = times[:, None]
    angle = speed * t
    # sin(a)/w, (1 - cos(a))/w^2 and (a - sin(a))/w^3, each by t^n times an even function of the angle.
    small = np.abs(angle) < 1e-2
    safe, a2 = np.where(small, 1.0, angle), angle**2
    first = t * np.where(small, 1.0 - a2 / 6.0 + a2**2 / 120.0, np.sin(safe) / safe)
    second = t**2 * np.where(small, 0.5 - a2 / 24.0 + a2**2 / 720.0, (1.0 - np.cos(safe)) / safe**2)
    third = t**3 * np.where(small, 1.0 / 6.0 - a2 / 120.0 + a2**2 / 5040.0, (safe - np.sin(safe)) / safe**3)
    first, second, third = (values[..., None, None] for values in (first, second, third))
    square = cross @ cross
    rotation = np.eye(3) + first * cross + second * square
    along = t[..., None, None] * np.eye(3) + second * cross + third * square
    translation = (along @ linear[:, :, None])[..., 0]
    return np.ascontiguousarray(np.concatenate([rotation, translation[..., None]], axis=-1))


def _depths(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> NDArray[Any]:
    """An image of real numbers of any kind; what is not finite stays."""
    try:
        image = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise TypeError(f"{name}: expected numbers of shape (rows, columns): {error}") from None
    if image.dtype.kind not in "iuf":
        raise TypeError(f"{name}: expected real numbers [m], got {image.dtype}")
    if image.ndim != 2 or image.size == 0 or (shape is not None and image.shape != shape):
        raise ValueError(f"{name}: expected shape {'(rows, columns)' if shape is None else shape}, got {image.shape}")
    return image


def _returns(depth: NDArray[Any], limit: float) -> NDArray[np.float64]:
    """Depths as f64, infinite where nothing returns."""
    values = depth.astype(np.float64)
    return np.where(np.isfinite(values) & (values > 0.0) & (values < limit), values, np.inf)


def _bodies(body: ArrayLike | None, twists: ArrayLike | None, shape: tuple[int, ...]) -> tuple[NDArray[np.int32], int]:
    """Body of every pixel and number of bodies."""
    if body is None:
        if twists is not None and len(np.atleast_1d(np.asarray(twists))) != 1:
            raise ValueError("body: expected the body of every pixel with the twists of several bodies, got none")
        return np.zeros(shape, np.int32), 1
    numbers = np.asarray(body)
    if numbers.dtype.kind not in "iu":
        raise TypeError(f"body: expected integers, got {numbers.dtype}")
    if numbers.shape != shape:
        raise ValueError(f"body: expected shape {shape}, got {numbers.shape}")
    num_bodies = int(numbers.max(initial=-1)) + 1
    if twists is not None:
        num_moved = len(np.atleast_1d(np.asarray(twists)))
        if num_bodies > num_moved:
            raise ValueError(f"body: expected numbers below {num_moved}, one per twist, got {num_bodies - 1}")
        num_bodies = num_moved
    if num_bodies > 2**20:
        raise ValueError(f"body: expected numbers below {2**20}, got {num_bodies - 1}")
    return np.maximum(numbers, -1).astype(np.int32), num_bodies


def _fraction(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """An image of numbers from 0 to 1; grey levels count as fractions of the largest."""
    given = np.asarray(value)
    largest = float(np.iinfo(given.dtype).max) if given.dtype in (np.uint8, np.uint16) else 1.0
    try:
        fraction = given.astype(np.float64) / largest
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected numbers from 0 to 1, got {given.dtype}") from None
    if fraction.shape not in ((), shape):
        raise ValueError(f"{name}: expected one number or shape {shape}, got {fraction.shape}")
    if not ((fraction >= 0.0) & (fraction <= 1.0 + 1e-9)).all():
        bad = fraction[~((fraction >= 0.0) & (fraction <= 1.0 + 1e-9))].flat[0]
        raise ValueError(f"{name}: expected numbers from 0 to 1, got {bad:g}")
    return np.broadcast_to(fraction, shape)


def _normals(
    normals: ArrayLike | None, ray: NDArray[np.float64], camera: Camera, noise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit normals towards the sensor, zero where there is none."""
    if normals is None:
        if min(ray.shape) < 2:
            raise ValueError(f"normals: expected normals with an image of {ray.shape[0]} x {ray.shape[1]} pixels")
        return surfaces.normals(ray, camera, noise)
    given = np.asarray(normals, dtype=np.float64)
    if given.shape != (*ray.shape, 3):
        raise ValueError(f"normals: expected shape {(*ray.shape, 3)}, got {given.shape}")
    length = np.linalg.norm(given, axis=-1, keepdims=True)
    is_usable = np.isfinite(length) & (length > 0.0)
    unit = np.divide(given, length, out=np.zeros_like(given), where=is_usable)
    u, v = camera.plane(*ray.shape)
    faces_away = unit[..., 0] + unit[..., 1] * u + unit[..., 2] * v[:, None] > 0.0
    facing: NDArray[np.float64] = np.where(faces_away[..., None], -unit, unit)
    return facing


def _middle_ones(length: int, step: int) -> slice:
    """Every `step`-th of `length`, as many left out at both ends."""
    count = max(1, length // step)
    first = (length - ((count - 1) * step + 1)) // 2
    return slice(first, first + (count - 1) * step + 1, step)


def _warn_of_quantisation(steps: Quantisation, radar: Radar, interval: float | None) -> None:
    """Warn when steps of the depths turn phases, or make velocities that do."""
    wavelength = radar.waveform.wavelength
    phase = steps.phase_error_deg(wavelength)
    if phase > _PHASE_WARNING_DEG:
        notice.warn(
            f"distance: quantised in steps of up to {1e6 * steps.largest:.3g} um, {phase:.0f} degrees of phase (rms) "
            f"at {1e-9 * SPEED_OF_LIGHT / wavelength:.1f} GHz: expect false echoes and no use for Doppler",
        )
    if interval is None:
        return
    drift = np.sqrt(2.0) * phase * radar.waveform.duration / interval
    if drift > _PHASE_WARNING_DEG:
        speed = np.sqrt(2.0 / 12.0) * steps.largest / interval
        notice.warn(
            f"previous: differences of quantised depths are velocities with errors of {speed:.2g} m/s (rms), "
            f"{drift:.0f} degrees of phase within the frame",
        )
