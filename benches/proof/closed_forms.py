"""Echoes that are known on paper, of conductors and matt surfaces, seen by one isotropic antenna with 1 W."""

from __future__ import annotations

import numpy as np
from scipy.special import exp1

from proof.measure import WAVEFORM, WAVENUMBERS, Phasors, Reals

# Every echo of a conductor is H = (j / 4 pi) Gamma Int with Int = integral of exp(-2jkR) over the solid angle it covers
# and Gamma = -1: physical optics seen from one antenna.


def echo(integral: Phasors) -> Phasors:
    return -1j / (4.0 * np.pi) * integral


def exponential_integral_2(z: Phasors) -> Phasors:
    """E2(z) = exp(-z) - z E1(z)."""
    return np.exp(-z) - z * exp1(z)


def disc_echo(radius: float, distance: float, k: Reals = WAVENUMBERS) -> Phasors:
    rim = np.hypot(distance, radius)
    at_foot, at_rim = (exponential_integral_2(2j * k * r) for r in (distance, rim))
    return echo(2.0 * np.pi * (at_foot - distance / rim * at_rim))


def sphere_echo(radius: float, center: float, k: Reals = WAVENUMBERS) -> Phasors:
    front, limb = center - radius, np.sqrt(center**2 - radius**2)
    z_front, z_limb = 2j * k * front, 2j * k * limb
    ends = exponential_integral_2(z_front) / front - exponential_integral_2(z_limb) / limb
    waves = (np.exp(-z_front) - np.exp(-z_limb)) / (2j * k)
    return echo(np.pi / center * (limb**2 * ends - waves))


def square_echo(edge: float, center: float, tilt: float = 0.0, k: Reals = WAVENUMBERS) -> Phasors:
    """Flat polygon: 2 pi E2(2jkd) inside, less the line integral of (d/R) E2(2jkR) dphi about the foot point."""
    foot_distance, offset = center * np.cos(tilt), center * np.sin(tilt)
    corners = 0.5 * edge * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) + [offset, 0.0]
    nodes, weights = np.polynomial.legendre.leggauss(160)
    total = np.zeros_like(k, dtype=complex)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        points = start + 0.5 * (1.0 + nodes)[:, None] * (end - start)
        square = (points**2).sum(axis=1)
        turning = 0.5 * (start[0] * end[1] - start[1] * end[0]) / square  # dphi per unit of the node
        distance = np.sqrt(square + foot_distance**2)
        values = foot_distance / distance * exponential_integral_2(2j * np.outer(k, distance))
        total += values @ (weights * turning)
    is_inside = abs(offset) < 0.5 * edge
    return echo(2.0 * np.pi * is_inside * exponential_integral_2(2j * k * foot_distance) - total)


def cylinder_echo(radius: float, length: float, center: float) -> Phasors:
    """No closed form: the integral over the lit surface, by Gauss-Legendre in angle and height."""
    nodes, weights = np.polynomial.legendre.leggauss(240)
    limb = np.arccos(radius / center)
    angle, z = limb * nodes[:, None], 0.5 * length * nodes
    x, y = center - radius * np.cos(angle), radius * np.sin(angle)
    distance = np.sqrt(x**2 + y**2 + z**2)
    obliquity = (center * np.cos(angle) - radius) / distance
    area = radius * limb * 0.5 * length * np.outer(weights, weights)
    solid_angle = (obliquity * area / distance**2).ravel()
    return echo(np.array([solid_angle @ np.exp(-2j * k * distance.ravel()) for k in WAVENUMBERS]))


def point_echo(rcs: float, distance: float) -> Phasors:
    amplitude = WAVEFORM.wavelength / (4.0 * np.pi) * np.sqrt(rcs / (4.0 * np.pi)) / distance**2
    return amplitude * np.exp(-2j * WAVENUMBERS * distance)


def lambertian_disc_power(albedo: float, radius: float, distance: float) -> float:
    """Mean power over the random phases."""
    rim = np.hypot(distance, radius)
    return float((WAVEFORM.wavelength / (4 * np.pi)) ** 2 * 0.5 * albedo * distance**2 * (distance**-4 - rim**-4))


def lambertian_sphere_power(albedo: float, radius: float, center: float) -> float:
    """Mean power over the random phases: the integral of cos / R² over the solid angle, by Gauss-Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(240)
    # From the axis to the limb; cosines of incidence fall to zero there as a root does, so the sine is the variable.
    limb = np.arcsin(radius / center)
    sine = 0.5 * (1.0 + nodes)
    angle = np.arcsin(np.sin(limb) * np.sqrt(1.0 - sine**2))
    cosine = np.sqrt(1.0 - (center * np.sin(angle) / radius) ** 2)
    distance = center * np.cos(angle) - radius * cosine
    solid_angle = 2.0 * np.pi * np.sin(limb) ** 2 * sine / np.cos(angle) * 0.5 * weights
    power = (solid_angle * cosine / distance**2).sum()
    return float((WAVEFORM.wavelength / (4.0 * np.pi)) ** 2 * albedo / np.pi * power)


def lambertian_patch_power(albedo: float, area: float, tilt: float, distance: float) -> float:
    """Mean power of a small patch far away, with the cross-section 4 rho A cos²."""
    section = 4.0 * albedo * area * np.cos(tilt) ** 2
    return float(WAVEFORM.wavelength**2 * section / ((4.0 * np.pi) ** 3 * distance**4))


def mirror_level(distance: float, k: Reals = WAVENUMBERS) -> Reals:
    """Size of the echo of an infinite plane: lambda / (8 pi d)."""
    return 1.0 / (4.0 * k * distance)
