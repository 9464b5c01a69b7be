"""Relative permittivity over frequency: the laws of building materials and of tissue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from radarcore import check

VACUUM_PERMITTIVITY = 8.8541878128e-12
"""Permittivity of vacuum [F/m]."""


@dataclass(frozen=True)
class ItuPermittivity:
    """``eps' = a f^b`` and a conductivity of ``c f^d`` [S/m], f in GHz: the form of ITU-R P.2040.

    See Also
    --------
    ColeCole : Law of tissue.
    Material.dielectric : Takes it.
    materials : Those with a name.

    Examples
    --------
    >>> concrete = rc.ItuPermittivity(5.24, 0.0, 0.0462, 0.7822)
    >>> print(f"{concrete.at(60e9):.2f}")
    5.24-0.34j
    """

    a: float
    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "a", check.positive("a", self.a))
        put(self, "b", check.number("b", self.b))
        put(self, "c", check.non_negative("c", self.c, "S/m"))
        put(self, "d", check.number("d", self.d))

    def at(self, frequency: float) -> complex:
        """``eps' - j eps''`` at a frequency [Hz]."""
        f = 1e-9 * frequency
        loss = self.c * f**self.d / (2.0 * np.pi * frequency * VACUUM_PERMITTIVITY)
        return complex(self.a * f**self.b, -loss)


@dataclass(frozen=True)
class ColeCole:
    """Sum of relaxations, ``eps = high + sum step / (1 + (j w tau)^exponent) + conductivity / (j w eps0)``.

    Parameters
    ----------
    high : float
        Permittivity far above all relaxations.
    relaxations : tuple of (step, tau, exponent)
        Steps of the permittivity, their times [s], and exponents, 1 for Debye's.
    conductivity : float
        Conductivity for direct current [S/m].

    See Also
    --------
    ItuPermittivity : Law of building materials.
    Material.dielectric : Takes it.
    materials : Those with a name.

    Examples
    --------
    >>> water = rc.ColeCole(high=5.2, relaxations=[(73.2, 8.3e-12, 1.0)])
    >>> print(f"{water.at(60e9):.1f}")
    12.0-21.2j
    """

    high: float
    relaxations: tuple[tuple[float, float, float], ...]
    conductivity: float = 0.0

    def __post_init__(self) -> None:
        rows = check.array("relaxations", np.reshape(self.relaxations, (-1, 3)), (None, 3))
        for step, tau, exponent in rows.tolist():
            if step < 0.0 or tau <= 0.0 or not 0.0 < exponent <= 1.0:
                raise ValueError(
                    "relaxations: expected steps of at least 0, positive times [s] and exponents up to 1, "
                    f"got {(step, tau, exponent)}"
                )
        put = object.__setattr__
        put(self, "high", check.positive("high", self.high))
        put(self, "relaxations", tuple(map(tuple, rows.tolist())))
        put(self, "conductivity", check.non_negative("conductivity", self.conductivity, "S/m"))

    def at(self, frequency: float) -> complex:
        """``eps' - j eps''`` at a frequency [Hz]."""
        w = 2.0 * np.pi * frequency
        eps = self.high + self.conductivity / (1j * w * VACUUM_PERMITTIVITY)
        for step, tau, exponent in self.relaxations:
            eps += step / (1.0 + (1j * w * tau) ** exponent)
        return complex(eps)


Permittivity = complex | ItuPermittivity | ColeCole
"""Argument of `Material.dielectric`: a number ``eps' - j eps''`` or a law."""


def as_permittivity(value: object) -> Permittivity:
    """A law as it is, or a checked number."""
    if isinstance(value, ItuPermittivity | ColeCole):
        return value
    eps = check.complex_number("permittivity", value)
    if eps.imag > 0.0 or eps == 0.0:
        raise ValueError(f"permittivity: expected eps' - j eps'' with eps'' >= 0, got {value!r}")
    if eps.real < 1.0 and -eps.imag <= abs(eps.real):
        raise ValueError(f"permittivity: expected eps' of at least 1 (vacuum), or a conductor, got {value!r}")
    return eps


def permittivity_at(permittivity: Permittivity, frequency: float) -> complex:
    """``eps' - j eps''`` at a frequency [Hz]."""
    return permittivity if isinstance(permittivity, complex) else permittivity.at(frequency)
