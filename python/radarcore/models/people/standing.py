"""Breathing and sway of a standing person.

The body rotates about the ankles as an inverted pendulum: rigidly forward and back, and sideways on parallel legs under
a level pelvis (D. A. Winter, "Human balance and posture control during standing and walking", Gait & Posture 3, 1995).
With open eyes the centre of pressure below the feet moves by 5.0 mm rms forward and back and by 3.3 mm rms sideways
(M. Wuehr et al., "Balance control and anti-gravity muscle activity during the experience of fear at heights",
Physiological Reports 2, 2014, table 3, 16 adults in the laboratory). Its motion exceeds the motion of the centre of
mass by the factor ``1 + (f / f0)**2``, where ``f0`` is the natural frequency of the pendulum.

The chest moves forward by 4 mm with every breath; the ribs of seated persons move by 3 to 5 mm, up and forward
(A. De Groote et al., "Chest wall motion during tidal breathing", Journal of Applied Physiology 83, 1997).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BREATH = 4e-3
"""Movement of the chest in a breath, peak to peak [m]."""

_PRESSURE_RMS = np.array([[5.0e-3], [3.3e-3]])
"""Root mean square of the centre of pressure, forward and to the sides [m]."""

_LEVERS = 1.75 * np.array([[0.511], [0.417]])
"""Displacement of the centre of mass per angle at the ankles, forward and sideways, at a height of 1.75 m [m].

Sideways, trunk and hips move by the same distance.
"""

_NATURAL_FREQUENCY = 0.49
"""Natural frequency [Hz], ``sqrt(mass * g * lever / inertia) / (2 pi)``: 0.48 forward, 0.50 to the sides."""

_NUM_TONES = 12
"""Sinusoids of the sway in each direction."""

# From 0.1 to 0.9 Hz with equal ratios, alternating between sideways and forward: no two are commensurable.
_FREQUENCIES = 0.1 * 10.0 ** ((2.0 * np.arange(_NUM_TONES) + [[1.0], [0.0]]) / (2.0 * _NUM_TONES))


def _angles() -> Floats:
    """Amplitudes of the sway (direction, tone) [rad]."""
    # The centre of pressure is a random walk: its spectral density falls as 1/f^2; the spacing of tones grows as f.
    relative = _FREQUENCIES**-0.5
    pressure = np.sqrt(2.0) * _PRESSURE_RMS * relative / np.linalg.norm(relative, axis=1, keepdims=True)
    return np.asarray(pressure / (1.0 + (_FREQUENCIES / _NATURAL_FREQUENCY) ** 2) / _LEVERS)


_AMPLITUDES = np.append(_angles(), 0.5 * _BREATH)


def random_phases(*numbers: float) -> Floats:
    """Random phases of all sinusoids (25,) [rad], seeded by the numbers."""
    seed = (np.array(numbers) + 0.0).view(np.uint32)  # -0.0 + 0.0 is 0.0
    return 2.0 * np.pi * np.random.default_rng(seed).random(len(_AMPLITUDES))


def posture(times: Floats, breathing: float, phases: Floats, orders: int) -> Floats:
    """Forward lean, roll of the legs [rad] and displacement of the chest [m], (3, orders, n).

    `breathing` is in breaths per second and `phases` come from `random_phases`. The second order is the time
    derivative.
    """
    angular = 2.0 * np.pi * np.append(_FREQUENCIES, breathing)
    phase = np.multiply.outer(times, angular) + phases
    waves = _AMPLITUDES * np.stack([np.sin(phase), angular * np.cos(phase)][:orders])
    return np.moveaxis(np.add.reduceat(waves, [0, _NUM_TONES, 2 * _NUM_TONES], axis=-1), -1, 0)
