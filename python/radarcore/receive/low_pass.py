"""The anti-alias filter of a receiver, and its exact response to chirps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.radar import Radar

_SETTLED = 1e-4
"""Gain below which frequencies, and what is left after the settling time, are nothing beside the passband."""

_HIGHEST_ORDER = 16
"""Largest order: partial fractions of higher ones cancel each other."""

_FAR = 50.0
"""Squared argument of w beyond which five terms of its series are exact to 1e-7."""

Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LowPass:
    """Butterworth low-pass filter in front of the ADC, of either part of the beat signal.

    Parameters
    ----------
    cutoff : float
        Frequency of half the power [Hz].
    order : int
        Number of poles, 1 to 16.
    """

    cutoff: float
    order: int = 4

    def __post_init__(self) -> None:
        object.__setattr__(self, "cutoff", check.positive("cutoff", self.cutoff, "Hz"))
        object.__setattr__(self, "order", check.count("order", self.order))
        if self.order > _HIGHEST_ORDER:
            raise ValueError(f"order: expected at most {_HIGHEST_ORDER}, got {self.order}")

    @cached_property
    def poles(self) -> Complex:
        """Poles in the left half plane [rad/s], (pole,)."""
        angles = np.pi * (2.0 * np.arange(self.order) + self.order + 1.0) / (2.0 * self.order)
        poles: Complex = 2.0 * np.pi * self.cutoff * np.exp(1j * angles)
        return poles

    @cached_property
    def residues(self) -> Complex:
        """Residues of the transfer function at the poles [rad/s], (pole,); its gain at 0 Hz is 1."""
        rate = 2.0 * np.pi * self.cutoff
        apart = (self.poles[:, None] - self.poles) / rate + np.eye(self.order)
        residues: Complex = rate / apart.prod(axis=1)
        return residues

    def band(self, amplitude: Floats) -> Floats:
        """Frequencies [Hz] beyond which less than -80 dB of 1 are left of amplitudes; zero if it was less before."""
        attenuation = np.maximum(amplitude / _SETTLED, 1.0)
        band: Floats = self.cutoff * (attenuation**2 - 1.0) ** (0.5 / self.order)
        return band

    @cached_property
    def settling_time(self) -> float:
        """Time [s] after which -80 dB are left of what was."""
        return -log(_SETTLED) / self._slowest

    @property
    def _slowest(self) -> float:
        """Rate of decay of the slowest pole [1/s]."""
        return float(-self.poles.real.max())

    def gain(self, frequency: Floats) -> Complex:
        """Transfer function at frequencies [Hz], of their shape."""
        rate = 2j * np.pi * np.asarray(frequency, dtype=np.float64)
        gain: Complex = (self.residues / (rate[..., None] - self.poles)).sum(axis=-1)
        return gain

    def modes(self, frequency: Floats, slope: Floats) -> Complex:
        """Response of every pole to a chirp, where its frequency is `frequency` [Hz], relative to the chirp.

        The chirp ``exp j psi(u)`` has a quadratic phase, and has been on for as long as the filter remembers. A pole p
        holds ``y' = p y + exp j psi``. With ``q = -p u + j psi``, whose derivatives are ``q'`` and the constant
        ``b = 2 pi j slope``, ``y = F exp j psi`` solves that if ``F' + q' F = 1``. The solution without anything from
        before the chirp came by has the Faddeeva function w (Abramowitz, Stegun, eqs. 7.1.3 and 7.1.20):
        ``F = -+ sqrt(pi / (2 b)) / j w(-+ q' / sqrt(2 b))``, with the upper sign for rising chirps. The free decay of
        the filter after a fast chirp is part of it.

        Parameters
        ----------
        frequency, slope : (n,) float64
            [Hz], [Hz/s].

        Returns
        -------
        modes : (n, pole) complex128
            Their sum is the response of the filter; the gain, if the slope is zero.
        """
        rate = 2j * np.pi * frequency[:, None] - self.poles  # q'
        inverse = 1.0 / rate
        b = 2j * np.pi * slope[:, None]

        # Far from the pole the asymptotic series of w, a tone's response 1 / q' first. Free decay is beyond it.
        ratio = b * inverse**2
        modes: Complex = inverse * (1.0 + ratio * (1.0 + ratio * (3.0 + ratio * (15.0 + 105.0 * ratio))))
        passed = np.sign(slope[:, None]) * rate.imag
        decay = rate.real * passed / np.maximum(np.abs(b), np.finfo(np.float64).tiny)
        is_near = (np.abs(ratio) * 2.0 * _FAR > 1.0) | ((passed > 0.0) & (decay < -log(_SETTLED)))
        if is_near.any():
            from scipy.special import wofz  # takes longer to load than the rest

            rows, _ = np.nonzero(is_near)
            sign, root = -np.sign(slope)[rows], np.sqrt(4j * np.pi * slope)[rows]
            modes[is_near] = sign * np.sqrt(np.pi) / (1j * root) * wofz(sign * rate[is_near] / root)
        return self.residues * modes


def low_pass_of(radar: Radar) -> LowPass:
    """Low-pass of the radar's receiver; one at half the sample rate for a receiver that has no filter set."""
    receiver = radar.receiver
    if receiver is None or receiver.low_pass is None:
        return LowPass(0.5 * radar.waveform.sample_rate)
    return LowPass(receiver.low_pass, receiver.low_pass_order)
