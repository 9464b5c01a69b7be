"""Human walking as functions of phase and speed: joint angles and the sway of the trunk.

R. Boulic, N. Magnenat-Thalmann, D. Thalmann, "A global human walking model with real-time kinematic personification",
The Visual Computer 6 (1990) 344-358. Periodic, with one parameter: the relative speed RV = speed / hip height, from
just above 0 to 3 per second (measured up to about 2.3).

Phase 0 is the right heel strike and a cycle of two steps is 1; any phase is taken modulo 1. Angles are in **degrees**,
as in the paper, and translations in hip heights. Every function takes arrays of phases; ``derivative=1`` gives the
exact derivative by phase instead of the value. Joint curves pass through the paper's control points by monotone
cubics (PCHIP): angles and their rates are continuous, angular accelerations are not.
"""

from __future__ import annotations

from functools import lru_cache
from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_Floats = NDArray[np.float64]
_Points = list[tuple[float, float]]

MAX_RELATIVE_SPEED = 3.0
"""Largest relative speed of the formulas [1/s]."""


class LimbAngles(NamedTuple):
    """Angles of one leg and one arm [degrees]; flexion is positive."""

    hip: _Floats
    knee: _Floats
    ankle: _Floats
    shoulder: _Floats
    elbow: _Floats


class TrunkAngles(NamedTuple):
    """Angles of pelvis and thorax [degrees].

    ``roll`` and ``torsion`` turn the pelvis, ``Rz(-torsion) Rx(roll)``, ``thorax`` and ``lean`` the trunk above it,
    ``Rz(-thorax) Ry(-lean)``, with x forward, y left, z up. Negative lean is forward.
    """

    roll: _Floats
    torsion: _Floats
    thorax: _Floats
    lean: _Floats


def cycle_duration(relative_speed: float) -> float:
    """Duration of two steps [s], for a relative speed [1/s] above 0 and up to 3."""
    if not 0.0 < relative_speed <= MAX_RELATIVE_SPEED:
        raise ValueError(
            f"relative_speed: expected more than 0 and at most {MAX_RELATIVE_SPEED:g} hip heights per second, "
            f"got {relative_speed!r}"
        )
    return 1.346 / sqrt(relative_speed)


def stance_fraction(relative_speed: float) -> float:
    """Part of the cycle during which a foot is on the floor."""
    duration = cycle_duration(relative_speed)
    return (0.752 * duration - 0.143) / duration


def limb_angles(phase: ArrayLike, relative_speed: float, derivative: int = 0) -> LimbAngles:
    """Angles of the right limbs; the left ones follow half a cycle later, at ``phase + 0.5``."""
    t = np.asarray(phase, dtype=np.float64)
    curves = _curves(relative_speed, derivative)(t)
    hip, knee, ankle, elbow = (curves[..., j] for j in range(4))
    shoulder = -9.88 * relative_speed * _sine(t + 0.25, 1, derivative)
    if derivative == 0:
        shoulder = shoulder + 3.0 - 4.94 * relative_speed
    return LimbAngles(hip, knee, ankle, shoulder, elbow)


def trunk_angles(phase: ArrayLike, relative_speed: float, derivative: int = 0) -> TrunkAngles:
    """Angles of pelvis and thorax."""
    t = np.asarray(phase, dtype=np.float64)
    amplitude = _amplitude(8.0, 2.0, relative_speed)
    lean = amplitude * _sine(t - 0.05, 2, derivative)
    return TrunkAngles(
        roll=_roll(t, relative_speed, derivative),
        torsion=-4.0 * relative_speed * _sine(t + 0.25, 1, derivative),
        thorax=_curves(relative_speed, derivative)(t)[..., 4],
        lean=lean - amplitude if derivative == 0 else lean,
    )


def root_translation(phase: ArrayLike, relative_speed: float, derivative: int = 0) -> _Floats:
    """Deviation of the pelvis from even forward motion at hip height: forward, left, up, (..., 3) [hip heights]."""
    t = np.asarray(phase, dtype=np.float64)
    late = 0.625 - stance_fraction(relative_speed)
    up = 0.015 * relative_speed * _sine(t - 0.175, 2, derivative)
    return np.stack(
        [
            -_amplitude(0.084, 0.021, relative_speed) * _sine(t + late, 2, derivative),
            -_amplitude(0.128, 0.032, relative_speed) * _sine(t - 0.1, 1, derivative),
            up - 0.015 * relative_speed if derivative == 0 else up,
        ],
        axis=-1,
    )


def control_points(relative_speed: float) -> dict[str, _Points]:
    """Points (phase, angle [degrees]) that the curves of hip, knee, ankle, elbow and thorax pass through."""
    RV, s = relative_speed, stance_fraction(relative_speed)
    k, q = (RV - 1.3) / 1.7, (RV - 0.5) / 0.8
    if RV < 0.5:
        hip = [(0.5, -30.0 * RV), (0.9, 50.0 * RV)]
        knee = [(0.17, 3.0), (0.4, 3.0), (0.75, 140.0 * RV), (1.0, 3.0)]
        ankle = [(0.0, -3.0), (0.08, -30.0 * RV - 3.0), (0.5, 22.0 * RV - 3.0), (s, -34.0 * RV - 3.0), (0.85, -3.0)]
        elbow = [(0.05, 6.0 * RV + 3.0), (0.5, 34.0 * RV + 3.0), (0.9, 10.0 * RV + 3.0)]
    elif RV < 1.3:
        hip = [(0.5, -15.0), (0.9, 25.0)]
        knee = [(0.17, 3.0), (0.4, 3.0), (0.75, 70.0), (1.0, 3.0)]
        ankle = [(0.0, -3.0), (0.08, -18.0), (0.5, 8.0), (s, -20.0), (0.85, -3.0)]
        elbow = [(0.05, 6.0 + 8.0 * q), (0.5 + 0.01 * q, 20.0 + 24.0 * q), (0.9, 8.0 + 9.0 * q)]
    else:
        hip = [(0.2 * k - 0.1, 25.0 + 5.0 * k), (0.5, -15.0), (0.9, 25.0 + 6.0 * k)]
        knee = [
            (0.17 - 0.05 * k, 3.0 + 22.0 * k),
            (0.4, 3.0),
            (0.75 - 0.05 * k, 70.0 - 5.0 * k),
            (1.0 - 0.03 * k, 3.0 + 3.0 * k),
        ]
        ankle = [
            (0.0, 5.0 * k - 3.0),
            (0.08, 4.0 * k - 18.0),
            (0.5 - 0.1 * k, 8.0 - 3.0 * k),
            (s, -20.0 - 8.0 * k),
            (0.85, 5.0 * k - 3.0),
        ]
        elbow = [(0.05, 14.0 - 6.0 * k), (0.51 + 0.04 * k, 44.0 + 26.0 * k), (0.9 - 0.1 * k, 17.0 - 6.0 * k)]
    thorax = [(0.1, 4.0 / 3.0 * RV), (0.4, -1.5 * RV), (0.6, -4.0 / 3.0 * RV), (0.9, 1.5 * RV)]
    return {"hip": hip, "knee": knee, "ankle": ankle, "elbow": elbow, "thorax": thorax}


@lru_cache(maxsize=64)
def _curves(relative_speed: float, derivative: int) -> PPoly[np.float64]:
    """All joint curves as one periodic piecewise cubic, (phase,) -> (phase, 5), or its derivative."""
    from scipy.interpolate import PchipInterpolator, PPoly

    # Every curve through its points in the periods before, of and after the cycle.
    curves = []
    for points in control_points(relative_speed).values():
        once = {round(t % 1.0, 12): angle for t, angle in points}  # two of the hip coincide at RV = 1.3
        phases, angles = np.array(sorted(once.items())).T
        curves.append(PchipInterpolator(np.concatenate([phases - 1.0, phases, phases + 1.0]), np.tile(angles, 3)))

    # The same polynomials on the pieces between all points, as Taylor coefficients at the start of every piece.
    knots = np.unique(np.concatenate([[0.0, 1.0]] + [c.x[(c.x > 0.0) & (c.x < 1.0)] for c in curves]))
    factorial = (1.0, 1.0, 2.0, 6.0)
    taylor = [[curve(knots[:-1], order) / factorial[order] for curve in curves] for order in (3, 2, 1, 0)]
    together = PPoly(np.moveaxis(np.array(taylor), 1, 2), knots, extrapolate="periodic")
    return together.derivative(derivative) if derivative else together


def _roll(t: _Floats, relative_speed: float, derivative: int) -> _Floats:
    """Roll of the pelvis [degrees]: falls for 0.15, rises for 0.35 of the cycle, then the same mirrored."""
    u = t % 0.5
    mirrored = np.where(t % 1.0 < 0.5, 1.0, -1.0)
    falling = u < 0.15
    # From 0.15 to 0.5 the paper's -a (1 + cos(2 pi (u - 0.15) 10/7)) is a (cos(2 pi (u - 0.5) 10/7) - 1).
    omega = np.where(falling, 2.0 * np.pi * 10.0 / 3.0, 2.0 * np.pi * 10.0 / 7.0)
    argument = omega * np.where(falling, u, u - 0.5)
    amplitude = 1.66 * relative_speed * mirrored
    return np.asarray(-amplitude * omega * np.sin(argument) if derivative else amplitude * (np.cos(argument) - 1.0))


def _sine(t: _Floats, harmonic: int, derivative: int) -> _Floats:
    """``sin(2 pi harmonic t)`` or its derivative."""
    omega = 2.0 * np.pi * harmonic
    return np.asarray(omega * np.cos(omega * t) if derivative else np.sin(omega * t))


def _amplitude(slow: float, fast: float, relative_speed: float) -> float:
    """Amplitude that grows as ``slow RV (1 - RV)`` up to RV = 0.5 and stays at `fast` from there."""
    return slow * relative_speed * (1.0 - relative_speed) if relative_speed < 0.5 else fast
