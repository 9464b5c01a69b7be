"""Human walking as a function of phase and speed: joint angles and motion of the trunk.

R. Boulic, N. Magnenat-Thalmann, D. Thalmann, "A global human walking model with real-time kinematic personification",
The Visual Computer 6 (1990) 344-358. The model is periodic and has one parameter: the relative speed RV = speed / hip
height, above 0 and up to 3 per second (measured up to about 2.3).

Phase 0 is the right heel strike and a cycle of two steps has length 1; phases count modulo 1. Angles are in
**degrees**, as in the paper, and translations in hip heights. `posture` takes arrays of phases; ``orders=2`` also gives
the exact derivative by phase.

All curves and their derivatives are Fourier series. The paper's curves through its control points (monotone cubics,
PCHIP; half cosines for the roll of the pelvis) have discontinuous accelerations. They are smoothed by a Gaussian of
0.7 % of a cycle and still pass through the same points. No angle changes by more than 0.2 degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore.products import product

_Floats = NDArray[np.float64]
_Phasors = NDArray[np.complex128]
_Points = list[tuple[float, float]]

MAX_RELATIVE_SPEED = 3.0
"""Largest relative speed of the formulas [1/s]."""

# Standard deviation of the smoothing Gaussian, in cycles: 8 ms of a walk.
_SMOOTHING = 0.007
# Harmonics of the series: the Gaussian attenuates the last, which is below 1e-4 degrees, by 1e-7.
_NUM_HARMONICS = 128
_HARMONICS = np.arange(_NUM_HARMONICS)
# Samples of a cycle to compute the series.
_NUM_SAMPLES = 1024
_SAMPLE_PHASES = np.arange(_NUM_SAMPLES) / _NUM_SAMPLES


def cycle_duration(relative_speed: float) -> float:
    """Duration of two steps [s] for a relative speed above 0 and up to 3 [1/s]."""
    if not 0.0 < relative_speed <= MAX_RELATIVE_SPEED:
        raise ValueError(
            f"relative_speed: expected more than 0 and at most {MAX_RELATIVE_SPEED:g} hip heights per second, "
            f"got {relative_speed!r}"
        )
    return 1.346 / sqrt(relative_speed)


def stance_fraction(relative_speed: float) -> float:
    """Part of the cycle with a given foot on the floor."""
    duration = cycle_duration(relative_speed)
    return (0.752 * duration - 0.143) / duration


class Posture(NamedTuple):
    """Whole body at some phases; the first axis holds the values and, with two orders, the derivatives by phase."""

    angles: _Floats
    """Angles, (order, ..., 14) [degrees]: hip, knee, ankle, shoulder and elbow on the left and the right, with positive
    flexion; roll, torsion, thorax and lean of the trunk. The pelvis rotates by ``Rz(-torsion) Rx(roll)``, the trunk by
    ``Rz(-thorax) Ry(-lean)``, with x forward, y left, z up. Negative lean is forward."""
    root: _Floats
    """Deviation of the pelvis from uniform forward motion: forward, left, up, (order, ..., 3) [hip heights]."""


def posture(phase: ArrayLike, relative_speed: float, orders: int = 1) -> Posture:
    """Posture of the whole body; with ``orders=2`` its derivatives too."""
    curves = _series(relative_speed).at(phase, orders)
    return Posture(curves[..., :14], curves[..., 14:])


def control_points(relative_speed: float) -> dict[str, _Points]:
    """Control points (phase, angle [degrees]) of the curves of hip, knee, ankle, elbow and thorax."""
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


class _FourierSeries:
    """Functions of period 1: real parts of sums of ``coefficients[h] exp(2 pi i h phase)``.

    Parameters
    ----------
    coefficients : (harmonic, column) complex array
    """

    def __init__(self, coefficients: _Phasors) -> None:
        both = np.array([coefficients, 2j * np.pi * _HARMONICS[:, None] * coefficients])
        # Real factors of the real and imaginary parts of the powers, stacked.
        self._factors = np.stack([both.real, -both.imag], axis=2).reshape(2, 2 * _NUM_HARMONICS, -1)

    def at(self, phase: ArrayLike, orders: int) -> _Floats:
        """Values and, with two orders, derivatives by phase, (orders, ..., column)."""
        phases = np.asarray(phase, dtype=np.float64)
        curves = product(_powers(phases.ravel()).view(np.float64), self._factors[:orders])
        return np.asarray(curves).reshape(orders, *phases.shape, -1)


def _powers(phases: _Floats) -> _Phasors:
    """``exp(2 pi i h phase)`` for all harmonics h, (phase, harmonic), as products of 24 powers."""
    turns = 2j * np.pi * (phases % 1.0)
    coarse = np.exp(turns[:, None] * _HARMONICS[::16])
    fine = np.exp(turns[:, None] * _HARMONICS[:16])
    return np.asarray(coarse[:, :, None] * fine[:, None]).reshape(-1, _NUM_HARMONICS)


@lru_cache(maxsize=64)
def _series(relative_speed: float) -> _FourierSeries:
    """Curves at one speed: joints of the left and right limbs, angles of the trunk, and the root."""
    RV = relative_speed
    late = 0.625 - stance_fraction(RV)
    angles = {
        name: _smooth_curve({round(t % 1.0, 12): angle for t, angle in points}, _monotone_cubic)
        for name, points in control_points(RV).items()  # two of the hip coincide at RV = 1.3
    }
    roll = _smooth_curve({0.0: 0.0, 0.15: -3.32 * RV, 0.5: 0.0, 0.65: 3.32 * RV}, _half_cosines)
    lean = _amplitude(8.0, 2.0, RV)
    shoulder = _sine(-9.88 * RV, 1, 0.25, 3.0 - 4.94 * RV)
    right = np.array([angles["hip"], angles["knee"], angles["ankle"], shoulder, angles["elbow"]])
    left = right * np.exp(1j * np.pi * _HARMONICS)
    trunk = [roll, _sine(-4.0 * RV, 1, 0.25), angles["thorax"], _sine(lean, 2, -0.05, -lean)]
    root = [
        _sine(-_amplitude(0.084, 0.021, RV), 2, late),
        _sine(-_amplitude(0.128, 0.032, RV), 1, -0.1),
        _sine(0.015 * RV, 2, -0.175, -0.015 * RV),
    ]
    return _FourierSeries(np.concatenate([left, right, trunk, root]).T)


def _smooth_curve(points: dict[float, float], interpolate: Callable[[_Floats, _Floats], _Floats]) -> _Phasors:
    """Coefficients of a curve through points (phase to angle), smoothed by the Gaussian, (harmonic,).

    Smoothing moves the curve away from its points. Smoothed bumps between the neighbours of each point correct this;
    their heights solve a linear system.
    """
    phases, angles = np.array(sorted(points.items())).T
    smoothed = _smoothed(interpolate(phases, np.column_stack([angles, np.eye(len(phases))])))
    at_points = (_powers(phases) @ smoothed).real
    heights = np.linalg.solve(at_points[:, 1:], angles - at_points[:, 0])
    return np.asarray(smoothed[:, 0] + smoothed[:, 1:] @ heights)


def _smoothed(samples: _Floats) -> _Phasors:
    """Coefficients (harmonic, column) of periodic functions, smoothed by the Gaussian, from samples (time, column)."""
    coefficients = np.fft.rfft(samples, axis=0, norm="forward")[:_NUM_HARMONICS]
    coefficients[1:] *= 2.0
    gaussian = np.exp(-0.5 * (2.0 * np.pi * _SMOOTHING * _HARMONICS) ** 2)
    return np.asarray(gaussian[:, None] * coefficients)


def _monotone_cubic(phases: _Floats, values: _Floats) -> _Floats:
    """Samples of periodic curves through values (point, column), (_NUM_SAMPLES, column), monotone between points."""
    from scipy.interpolate import PchipInterpolator

    turns, points = np.divmod(np.arange(-2, len(phases) + 2), len(phases))
    return np.asarray(PchipInterpolator(phases[points] + turns, values[points])(_SAMPLE_PHASES))


def _half_cosines(phases: _Floats, values: _Floats) -> _Floats:
    """Samples of periodic curves that connect the values by half cosines."""
    piece = np.searchsorted(phases, _SAMPLE_PHASES, side="right") - 1
    following = (piece + 1) % len(phases)
    u = ((_SAMPLE_PHASES - phases[piece]) % 1.0) / ((phases[following] - phases[piece]) % 1.0)
    return np.asarray(values[piece] + (0.5 - 0.5 * np.cos(np.pi * u))[:, None] * (values[following] - values[piece]))


def _sine(amplitude: float, harmonic: int, ahead: float, mean: float = 0.0) -> _Phasors:
    """Coefficients of ``mean + amplitude sin(2 pi harmonic (phase + ahead))``."""
    coefficients = np.zeros(_NUM_HARMONICS, dtype=np.complex128)
    coefficients[0] = mean
    coefficients[harmonic] = -1j * amplitude * np.exp(2j * np.pi * harmonic * ahead)
    return coefficients


def _amplitude(slow: float, fast: float, relative_speed: float) -> float:
    """Amplitude that grows as ``slow RV (1 - RV)`` up to RV = 0.5 and then stays at `fast`."""
    return slow * relative_speed * (1.0 - relative_speed) if relative_speed < 0.5 else fast
