"""Paths whose delays and amplitudes are known exactly at any time, for the benches.

Linear jobs give range and velocity; moving scenes are rigid parts on prescribed motions, seen from the origin. Paths
are in the order of the pixels of an image unless said otherwise, and have complex Gaussian amplitudes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import radarcore as rc

SPEED_OF_LIGHT = 299_792_458.0

Reals = NDArray[np.float64]
Phasors = NDArray[np.complex128]

NODES = {1e-2: 4, 1e-3: 5, 1e-4: 6, 1e-5: 7, 1e-6: 8}
"""Times per frame at which bodies of everyday accelerations need their delays, by tolerance."""


@dataclass(frozen=True)
class Job:
    """Input of a synthesis: (path,) with a rate, or delays and amplitudes at nodes, (node, channel, path)."""

    waveform: rc.Waveform
    delay: Reals
    amplitude: Phasors
    delay_rate: Reals | None = None


@dataclass(frozen=True)
class Case:
    """Two-way delays [s] at any times since the start of the frame [s], (time, path), and amplitudes at mid-frame."""

    name: str
    waveform: rc.Waveform
    delay_at: Callable[[Reals], NDArray[np.floating]]
    amplitude: Phasors
    delay_rate: Reals | None = None  # [s/s], of linear delays
    nodes: dict[float, int] = field(default_factory=lambda: NODES)

    @property
    def is_linear(self) -> bool:
        """True if every delay has a constant rate."""
        return self.delay_rate is not None

    def amplitude_at(self, delay: Reals) -> Phasors:
        """Amplitudes where the delays are `delay`: constant for linear delays, else falling with range squared."""
        if self.is_linear:
            return np.broadcast_to(self.amplitude, delay.shape)
        middle = self.delay_at(np.array([0.5 * self.waveform.duration]))
        return self.amplitude * (middle / delay) ** 2

    def job(self, tolerance: float) -> Job:
        """Delays and amplitudes as a synthesis to this tolerance needs them."""
        if self.is_linear:
            delay = self.delay_at(np.zeros(1))[0].astype(np.float64)
            return Job(self.waveform, delay, self.amplitude, self.delay_rate)
        delay = self.delay_at(self.waveform.delay_times(self.nodes[tolerance]))
        amplitude = self.amplitude_at(delay).astype(np.complex128)
        return Job(self.waveform, np.ascontiguousarray(delay[:, None]), np.ascontiguousarray(amplitude[:, None]))


def waveform(*, bandwidth: float = 1e9, num_chirps: int = 64, num_samples: int = 128) -> rc.Waveform:
    return rc.Waveform.from_sweep(
        start_frequency=58e9,
        stop_frequency=58e9 + bandwidth,
        sample_rate=2e6,
        num_samples=num_samples,
        num_chirps=num_chirps,
        chirp_interval=400e-6,
    )


def image_shape(num_paths: int) -> tuple[int, int]:
    """Rows and columns of an image with this number of pixels, as square as can be."""
    rows = next(n for n in range(math.isqrt(num_paths), 0, -1) if num_paths % n == 0)
    return rows, num_paths // rows


def gaussian(rng: np.random.Generator, num_paths: int) -> Phasors:
    return rng.normal(size=num_paths) + 1j * rng.normal(size=num_paths)


# Linear delays.


def linear_case(name: str, wf: rc.Waveform, distance: Reals, velocity: Reals, rng: np.random.Generator) -> Case:
    delay, rate = 2.0 * distance / SPEED_OF_LIGHT, 2.0 * velocity / SPEED_OF_LIGHT

    def delay_at(times: Reals) -> NDArray[np.longdouble]:
        # Rounding a delay to f64 costs 1e-12, the finest tolerance.
        return delay.astype(np.longdouble) + rate * times.astype(np.longdouble)[:, None]

    return Case(name, wf, delay_at, gaussian(rng, len(delay)), delay_rate=rate)


def random_order(wf: rc.Waveform, num_paths: int) -> Case:
    """Ranges of 0.5 to 8 m, velocities to 3 m/s, without any order."""
    rng = np.random.default_rng(1)
    distance, velocity = rng.uniform(0.5, 8.0, num_paths), rng.uniform(-3.0, 3.0, num_paths)
    return linear_case("random order", wf, distance, velocity, rng)


def image_order(wf: rc.Waveform, num_paths: int) -> Case:
    """A depth image of a wall and three balls, from a radar that drives at the wall at 0.5 m/s."""
    balls = [  # centre [m], radius [m], velocity [m/s]
        ([2.0, -0.6, 0.0], 0.5, [-1.5, 1.0, 0.0]),
        ([3.5, 1.0, 0.3], 0.7, [2.0, -1.0, 0.5]),
        ([1.2, 0.3, -0.4], 0.3, [-2.5, -1.0, 0.5]),
    ]
    rays = image_rays(*image_shape(num_paths))
    distance = 6.0 / rays[:, 0]
    velocity = -0.5 * rays[:, 0]
    for center, radius, v in balls:
        along = rays @ center
        square = along**2 - np.dot(center, center) + radius**2
        depth = along - np.sqrt(np.maximum(square, 0.0))
        is_hit = (square > 0.0) & (depth < distance)
        distance = np.where(is_hit, depth, distance)
        velocity = np.where(is_hit, rays @ v, velocity)
    return linear_case("image order", wf, distance, velocity, np.random.default_rng(2))


def image_rays(rows: int, columns: int) -> Reals:
    """Unit vectors through the pixels of an image of 90 x 60 degrees, row by row, (pixel, 3)."""
    y = -2.0 * np.tan(np.deg2rad(45.0)) * ((np.arange(columns) + 0.5) / columns - 0.5)
    z = -2.0 * np.tan(np.deg2rad(30.0)) * ((np.arange(rows) + 0.5) / rows - 0.5)[:, None]
    rays = np.stack(np.broadcast_arrays(1.0, y, z), axis=-1).reshape(-1, 3)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


# Rigid parts in motion.

Motion = Callable[[Reals], tuple[Reals, Reals]]
"""From times to the origin of a body [m], (time, 3), and its rotation, (time, 3, 3)."""


@dataclass(frozen=True)
class Part:
    """Points of a rigid body in its own frame [m], (path, 3)."""

    points: Reals
    motion: Motion

    def position(self, times: Reals) -> Reals:
        """Positions of the points, (time, path, 3) [m]."""
        origin, rotation = self.motion(times)
        return origin[:, None] + self.points @ rotation.swapaxes(1, 2)


def about_y(angle: Reals) -> Reals:
    """Rotations (time, 3, 3) by angles (time,)."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=-1).reshape(-1, 3, 3)


def about_z(angle: Reals) -> Reals:
    """Rotations (time, 3, 3) by angles (time,)."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)


def at_rest(times: Reals, origin: Iterable[float] = (0.0, 0.0, 0.0)) -> Reals:
    return np.tile(np.asarray(origin), (len(times), 1))


def moving_case(name: str, wf: rc.Waveform, parts: list[Part], nodes: dict[float, int] = NODES) -> Case:
    def position(times: Reals) -> Reals:
        return np.concatenate([part.position(times) for part in parts], axis=1)

    # Rows from top to bottom, each from left to right, as the radar sees the points at mid-frame.
    x, y, z = position(np.array([0.5 * wf.duration]))[0].T
    rows = np.argsort(-z / np.hypot(x, y)).reshape(image_shape(len(x)))
    columns = np.argsort(-np.arctan2(y, x)[rows], axis=1)
    order = np.take_along_axis(rows, columns, axis=1).ravel()

    def delay_at(times: Reals) -> Reals:
        return 2.0 / SPEED_OF_LIGHT * np.linalg.norm(position(times)[:, order], axis=-1)

    return Case(name, wf, delay_at, gaussian(np.random.default_rng(3), len(order)), nodes=nodes)


def tube(rng: np.random.Generator, num_points: int, radius: float, axis: Iterable[float]) -> Reals:
    """Points around the line from the origin to `axis` [m]."""
    along = np.asarray(axis, dtype=np.float64)
    across = rng.normal(size=(num_points, 3))
    across -= np.outer(across @ along, along) / (along @ along)
    return rng.random((num_points, 1)) * along + radius * across / np.linalg.norm(across, axis=1, keepdims=True)


def shares(num_points: int, weights: list[float]) -> list[int]:
    """Whole numbers in proportion to `weights` that add up to `num_points`."""
    ends = np.round(num_points * np.cumsum(weights) / np.sum(weights)).astype(int)
    return np.diff(ends, prepend=0).tolist()


def walker(position: list[float], num_points: int) -> list[Part]:
    """A person walking obliquely past the radar at 1.5 m/s: limbs are pendulums of two links, feet reach 5 m/s.

    `position` [m] is the hip at the start of the frame.
    """
    rng = np.random.default_rng(4)
    heading = about_z(np.deg2rad([160.0]))
    stride = 2.0 * np.pi * 1.0  # [rad/s]

    def body(times: Reals) -> tuple[Reals, Reals]:
        return position + 1.5 * np.outer(times, heading[0, :, 0]), np.tile(heading, (len(times), 1, 1))

    def link(parent: Motion, joint: list[float], swing: float, frequency: float, phase: float) -> Motion:
        """A pendulum about the side axis of its parent, hung at `joint` of it [m]."""

        def motion(times: Reals) -> tuple[Reals, Reals]:
            origin, rotation = parent(times)
            return origin + rotation @ joint, rotation @ about_y(swing * np.sin(frequency * times + phase))

        return motion

    # The torso; on each side thigh, shin, arm and forearm: axis [m], radius [m], share of the paths, motion.
    limbs = [([0.0, 0.0, 0.7], 0.16, 4.0, body)]
    for y, phase in ((0.1, 0.3), (-0.1, 0.3 + np.pi)):
        thigh = link(body, [0.0, y, 0.0], 0.5, stride, phase)
        shin = link(thigh, [0.0, 0.0, -0.45], 0.35, 2.0 * stride, 2.0 * phase + np.pi)
        arm = link(body, [0.0, 2.0 * y, 0.5], 0.4, stride, phase + np.pi)
        forearm = link(arm, [0.0, 0.0, -0.3], 0.2, 2.0 * stride, 2.0 * phase + np.pi)
        limbs += [
            ([0.0, 0.0, -0.45], 0.08, 1.2, thigh),
            ([0.0, 0.0, -0.45], 0.05, 0.9, shin),
            ([0.0, 0.0, -0.3], 0.05, 0.5, arm),
            ([0.0, 0.0, -0.3], 0.04, 0.4, forearm),
        ]
    counts = shares(num_points, [share for _, _, share, _ in limbs])
    return [
        Part(tube(rng, count, radius, axis), motion)
        for count, (axis, radius, _, motion) in zip(counts, limbs, strict=True)
    ]


def walker_case(wf: rc.Waveform, num_paths: int, nodes: dict[float, int] = NODES) -> Case:
    return moving_case("walker at 1 m", wf, walker([1.1, -0.15, 0.1], num_paths), nodes)


def room_case(wf: rc.Waveform, num_paths: int) -> Case:
    """A walker at 3 m, and four paths out of five from the walls, the floor and the ceiling, which do not move."""
    num_static = round(0.8 * num_paths)
    rows, columns = image_shape(num_paths)
    rays = np.random.default_rng(5).choice(image_rays(4 * rows, 4 * columns), num_static, replace=False)
    with np.errstate(divide="ignore"):
        planes = np.where(rays > 0.0, [6.0, 2.5, 1.5], [np.inf, 2.5, 1.0]) / np.abs(rays)
    walls = planes.min(axis=1, keepdims=True) * rays
    static = Part(walls, lambda times: (at_rest(times), about_z(0.0 * times)))
    name = "room, 80 % static, walker at 3 m"
    return moving_case(name, wf, [static, *walker([3.0, -0.3, 0.1], num_paths - num_static)])


def arm_case(wf: rc.Waveform, num_paths: int) -> Case:
    """A robot arm of two links whose elbow is 0.5 m away; both joints turn at 2 rad/s."""
    rng = np.random.default_rng(6)
    base, rate = [0.6, 0.35, 0.0], 2.0

    def upper(times: Reals) -> tuple[Reals, Reals]:
        return at_rest(times, base), about_z(rate * times - np.deg2rad(110.0))

    def fore(times: Reals) -> tuple[Reals, Reals]:
        origin, rotation = upper(times)
        return origin + 0.35 * rotation[:, :, 0], rotation @ about_z(rate * times + np.deg2rad(30.0))

    half = num_paths // 2
    parts = [
        Part(tube(rng, half, 0.05, [0.35, 0.0, 0.0]), upper),
        Part(tube(rng, num_paths - half, 0.04, [0.3, 0.0, 0.0]), fore),
    ]
    return moving_case("robot arm at 0.5 m", wf, parts)


def fan_case(wf: rc.Waveform, num_paths: int) -> Case:
    """Three blades of 0.15 m at 20 turns per second about an upright axis 1 m away."""
    rng = np.random.default_rng(7)
    angles = np.deg2rad([10.0, 130.0, 250.0])
    blades = [
        tube(rng, count, 0.02, [0.15 * np.cos(angle), 0.15 * np.sin(angle), 0.0])
        for count, angle in zip(shares(num_paths, [1.0, 1.0, 1.0]), angles, strict=True)
    ]

    def motion(times: Reals) -> tuple[Reals, Reals]:
        return at_rest(times, [1.0, 0.0, 0.0]), about_z(2.0 * np.pi * 20.0 * times)

    # Half a turn in 26 ms.
    return moving_case("fan at 1 m", wf, [Part(np.concatenate(blades), motion)], nodes=dict.fromkeys(NODES, 16))
