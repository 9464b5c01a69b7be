"""Scenes with corners and walls, and their paths of several reflections."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import radarcore as rc

C = 299_792_458.0
FREQUENCY = 60e9
WAVELENGTH = C / FREQUENCY
CONDUCTOR, METAL = rc.materials["perfect_conductor"], rc.materials["metal"]
POLARIZATIONS = (None, "vertical", "horizontal")


def tone(frequency: float = FREQUENCY) -> rc.Waveform:
    """A ramp without slope to speak of: one sample is the transfer function at one frequency."""
    return rc.Waveform(start_frequency=frequency, slope=1.0, sample_rate=1e6, num_samples=1)


def body(mesh: rc.Mesh, position: Any, *, rpy: Any = (0.0, 0.0, 0.0), material: rc.Material = CONDUCTOR) -> rc.Body:
    return rc.Body(mesh, material=material, motion=rc.Pose.from_rpy(position, rpy))


def simulator(bodies: list[rc.Body], radar: rc.Radar | None = None, **options: Any) -> rc.Simulator:
    view = {"field_of_view_deg": (60.0, 60.0)}
    settings: dict[str, Any] = {"resolution": 256, "max_bounces": 3, "tolerance": 1e-9} | view | options
    return rc.Simulator(rc.Scene(bodies), radar or rc.Radar(tone()), **{"sampling": "footprint", **settings})


def transfer_function(sim: rc.Simulator) -> complex:
    """H, the conjugate of the one sample of a tone."""
    return complex(np.conj(sim.frame().cube[0, 0, 0]))


def cross_section_db(h: complex, distance: float) -> float:
    """Apparent cross-section [dBsm] of what is at a distance, for 1 W and isotropic antennas."""
    sigma = 4.0 * np.pi * (abs(h) * distance**2 * 4.0 * np.pi / WAVELENGTH) ** 2
    return float(10.0 * np.log10(sigma))


def reflector_db(
    mesh: rc.Mesh, distance: float, *, size: float, roll: float = 0.0, polarization: str | None = None, **options: Any
) -> float:
    """Apparent cross-section of a reflector at a distance, in an image not much wider than its `size` [m]."""
    angle = 2.2 * np.rad2deg(np.arctan2(0.5 * size, distance - 0.1))
    radar = rc.Radar(tone(), polarization=polarization)
    target = body(mesh, [distance, 0.0, 0.0], rpy=[roll, 0.0, 0.0])
    sim = simulator([target], radar, field_of_view_deg=(angle, angle), **options)
    return cross_section_db(transfer_function(sim), distance)


def bounce_paths(sim: rc.Simulator, time: float = 0.0) -> rc.Paths:
    """Paths of several reflections alone."""
    single = rc.Simulator(
        sim.scene,
        sim.radar,
        sampling=sim.sampling,
        resolution=sim.resolution,
        field_of_view_deg=sim.field_of_view_deg,
    ).paths(time)
    paths, first = sim.paths(time), single.delay.shape[1]
    np.testing.assert_array_equal(paths.delay[:, :first], single.delay)
    return rc.Paths(*(values[:, first:] for values in vars(paths).values()))


def phasors(paths: rc.Paths, frequency: float = FREQUENCY) -> NDArray[np.complex128]:
    """Contribution of every path to the transfer function, (channel, path)."""
    return paths.amplitude * np.exp(-2j * np.pi * frequency * paths.delay)


RADIUS, BALL = 0.1, np.array([2.0, 0.0, 0.0])
WALL_Y = -0.7
SENSOR = np.zeros(3)
IN_THE_WALL = np.array([1.0, -1.0, 1.0])
"""A direction times this is the direction of its image."""
VIEW: dict[str, Any] = {"resolution": (96, 1280), "field_of_view_deg": (94.0, 12.0), "max_bounces": 2}
"""Wide enough for where the wall mirrors the ball."""
CLOSE: dict[str, Any] = VIEW | {"resolution": 512, "field_of_view_deg": (6.2, 6.2)}
"""The ball alone: its echo on the wall spreads so much that it takes narrow rays."""
VIEWS = {"wide": VIEW, "close": CLOSE}
CHANNELS = rc.Radar(tone(), rx=[[0.0, 0.0, 0.0], [0.0, 0.00125, 0.0]])


def wall(material: rc.Material = CONDUCTOR) -> rc.Body:
    """To the right of the boresight, along it."""
    return body(rc.shapes.plate(4.0, 2.0), [1.6, WALL_Y, 0.0], rpy=[0.0, 0.0, -0.5 * np.pi], material=material)


@cache
def sphere(radius: float) -> rc.Mesh:
    """A sphere, made once."""
    return rc.shapes.sphere(radius)


def ball(motion: Any = None, **options: Any) -> rc.Body:
    motion = rc.Pose(BALL) if motion is None else motion
    return rc.Body(sphere(RADIUS), material=CONDUCTOR, motion=motion, **options)


def image_of(position: Any) -> NDArray[np.float64]:
    """Its image in the wall."""
    return np.asarray(position) * IN_THE_WALL + np.array([0.0, 2.0 * WALL_Y, 0.0])


def touched(start: Any, end: Any, center: NDArray[np.float64] = BALL) -> NDArray[np.float64]:
    """Point of the ball on the shortest path from one place over the ball to another."""

    def place(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        azimuth, elevation = angles
        up, across = np.sin(elevation), np.cos(elevation)
        return center - RADIUS * np.array([across * np.cos(azimuth), across * np.sin(azimuth), up])

    def length(angles: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(place(angles) - start) + np.linalg.norm(place(angles) - end))

    return place(minimize(length, [0.4, 0.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-15}).x)


def reflected_by_ball(start: Any, end: Any) -> complex:
    """Wave from an antenna at one place that the ball reflects to another, by geometrical optics."""
    point = touched(start, end)
    there, back = np.linalg.norm(point - start), np.linalg.norm(point - end)
    cosine = (BALL - point) @ (point - start) / (RADIUS * there)
    # Principal radii of the reflected front, in and across the plane of incidence.
    radii = [1.0 / (1.0 / there + 2.0 / (RADIUS * cosine)), 1.0 / (1.0 / there + 2.0 * cosine / RADIUS)]
    level = WAVELENGTH / (4.0 * np.pi) / there * np.sqrt(np.prod([r / (r + back) for r in radii]))
    return complex(level * np.exp(-2j * np.pi * (there + back) / WAVELENGTH))


def room() -> list[rc.Body]:
    concrete = rc.materials["concrete"]
    return [
        body(rc.shapes.dihedral(0.4), [1.5, 0.2, 0.1], rpy=[0.3, 0.1, 0.2]),
        body(sphere(0.12), [1.1, -0.2, 0.0], material=concrete),
        body(rc.shapes.plate(2.0, 2.0), [1.5, -0.6, 0.0], rpy=[0.0, 0.0, -1.4], material=concrete),
    ]
