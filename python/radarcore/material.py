"""Materials: how much a surface reflects like a mirror and how much it scatters."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from radarcore import check


@dataclass(frozen=True)
class Material:
    """Reflection of a surface, the same at every angle and frequency.

    Parameters
    ----------
    reflection : complex
        Field reflection coefficient of the mirror-like part; -1 for a perfect conductor.
    albedo : float
        Diffuse albedo: power scattered after Lambert's law over incident power.

    Raises
    ------
    ValueError
        When the two together return more power than comes in.
    """

    reflection: complex = -1.0 + 0.0j
    albedo: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "reflection", check.complex_number("reflection", self.reflection))
        object.__setattr__(self, "albedo", check.non_negative("albedo", self.albedo))
        if self.reflectance > 1.0 + 1e-12:
            raise ValueError(
                f"reflection, albedo: expected abs(reflection)**2 + albedo of at most 1, got {self.reflectance:g}"
            )

    @property
    def reflectance(self) -> float:
        """Power that comes back in either way, over incident power."""
        return abs(self.reflection) ** 2 + self.albedo

    @classmethod
    def lambertian(cls, albedo: float) -> Material:
        """A matt surface: no mirror-like part."""
        return cls(0.0, albedo)

    @classmethod
    def dielectric(cls, permittivity: complex) -> Material:
        """A smooth half-space of relative permittivity ``eps' - j eps''``.

        The reflection coefficient is that of normal incidence, ``(1 - sqrt(eps)) / (1 + sqrt(eps))``.
        """
        eps = check.complex_number("permittivity", permittivity)
        if eps.imag > 0.0 or eps == 0.0:
            raise ValueError(f"permittivity: expected eps' - j eps'' with eps'' >= 0, got {permittivity!r}")
        root = np.sqrt(eps)
        return cls(complex((1.0 - root) / (1.0 + root)))


_ITU_FREQUENCY_GHZ = 60.0

# ITU-R P.2040-3, table 3: eps' = a f^b, sigma = c f^d [S/m], f in GHz.
_ITU_PARAMETERS = {
    "concrete": (5.24, 0.0, 0.0462, 0.7822),
    "plasterboard": (2.73, 0.0, 0.0085, 0.9395),
    "wood": (1.99, 0.0, 0.0047, 1.0718),
    "glass": (6.31, 0.0, 0.0036, 1.3394),
    "ceiling_board": (1.48, 0.0, 0.0011, 1.0750),
    "chipboard": (2.58, 0.0, 0.0217, 0.7800),
    "floorboard": (3.66, 0.0, 0.0044, 1.3515),
    "marble": (7.074, 0.0, 0.0055, 0.9262),
    "metal": (1.0, 0.0, 1e7, 0.0),
}

# Gabriel, Lau, Gabriel, Phys. Med. Biol. 41 (1996) 2271, dry skin at 60 GHz.
_SKIN_PERMITTIVITY = 7.975 - 10.904j


def _itu(a: float, b: float, c: float, d: float) -> Material:
    f = _ITU_FREQUENCY_GHZ
    vacuum_permittivity = 8.8541878128e-12  # [F/m]
    return Material.dielectric(a * f**b - 1j * c * f**d / (2.0 * np.pi * f * 1e9 * vacuum_permittivity))


class _Library(Mapping[str, Material]):
    """Materials by name; an unknown name is a KeyError that names near ones."""

    def __init__(self) -> None:
        self._materials = {
            "perfect_conductor": Material(-1.0),
            "skin": Material.dielectric(_SKIN_PERMITTIVITY),
        } | {name: _itu(*parameters) for name, parameters in _ITU_PARAMETERS.items()}

    def __getitem__(self, name: str) -> Material:
        try:
            return self._materials[name]
        except KeyError:
            near = difflib.get_close_matches(str(name), self._materials, n=3)
            hint = f"did you mean {' or '.join(map(repr, near))}?" if near else f"known: {', '.join(self._materials)}"
            raise KeyError(f"no material {name!r}; {hint}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._materials)

    def __len__(self) -> int:
        return len(self._materials)

    def __repr__(self) -> str:
        return f"<materials: {', '.join(self._materials)}>"


materials: Mapping[str, Material] = _Library()
"""Materials by name: ITU-R P.2040-3 and skin, half-spaces at normal incidence and 60 GHz; perfect_conductor."""
