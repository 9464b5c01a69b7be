"""Materials: permittivities, and reflection at a rough surface."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check
from radarcore.records import sealed
from radarcore.units import SPEED_OF_LIGHT

VACUUM_PERMITTIVITY = 8.8541878128e-12
"""Permittivity of vacuum [F/m]."""


@sealed
@dataclass(unsafe_hash=True)
class ItuPermittivity:
    """``eps' = a f^b`` and a conductivity of ``c f^d`` [S/m], f in GHz: the form of ITU-R P.2040.

    `Material.dielectric` takes it.
    """

    a: float
    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        self.a = check.positive("a", self.a)
        self.b = check.number("b", self.b)
        self.c = check.non_negative("c", self.c, "S/m")
        self.d = check.number("d", self.d)

    def at(self, frequency: float) -> complex:
        """``eps' - j eps''`` at a frequency [Hz]."""
        f = 1e-9 * frequency
        loss = self.c * f**self.d / (2.0 * np.pi * frequency * VACUUM_PERMITTIVITY)
        return complex(self.a * f**self.b, -loss)


@sealed
@dataclass(unsafe_hash=True)
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
        self.high = check.positive("high", self.high)
        self.relaxations = tuple(map(tuple, rows.tolist()))
        self.conductivity = check.non_negative("conductivity", self.conductivity, "S/m")

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


_REFERENCE_FREQUENCY = 60e9
"""Frequency at which the `reflection` and `albedo` of a dielectric are given [Hz]."""

_ROUGHEST = 1.0
"""Largest rms height of a surface [m]; a rougher one has to be a mesh."""

_SEEN = {None: None, "te": (1.0, 0.0), "tm": (0.0, 1.0)}
"""Weights of both polarisations at the antennas; None: without a polarisation."""


@sealed
@dataclass(unsafe_hash=True)
class Material:
    """Reflection of a wave by a surface: constant in angle and frequency, or a dielectric.

    Parameters
    ----------
    reflection : complex
        Field reflection coefficient of the specular part; -1 for a perfect conductor.
    albedo : float
        Diffuse albedo: power scattered after Lambert's law over incident power.

    Attributes
    ----------
    reflection, albedo
        As given; for a dielectric the values at normal incidence and 60 GHz. `response` has other angles and
        frequencies.
    permittivity, roughness, thickness, scattering
        Parameters of `dielectric`; without permittivity the material is constant.
    name, source : str or None
        Name in the library, and source of the numbers.
    valid_frequency : (float, float) or None
        Frequencies for which the numbers were published [Hz].

    Raises
    ------
    ValueError
        When the reflected and scattered power exceeds the incident power.

    See Also
    --------
    materials : Named materials.
    Material.dielectric : From a permittivity.
    Material.lambertian : Diffuse scattering alone.

    Examples
    --------
    >>> rc.Material(reflection=-0.5, albedo=0.1).reflectance
    0.35
    """

    reflection: complex = -1.0 + 0.0j
    albedo: float = 0.0
    permittivity: Permittivity | None = field(default=None, init=False)
    roughness: float = field(default=0.0, init=False)
    thickness: float | None = field(default=None, init=False)
    scattering: float | None = field(default=None, init=False)
    name: str | None = field(default=None, init=False, compare=False)
    source: str | None = field(default=None, init=False, compare=False)
    valid_frequency: tuple[float, float] | None = field(default=None, init=False, compare=False)

    def __post_init__(self) -> None:
        self.reflection = check.complex_number("reflection", self.reflection)
        self.albedo = check.non_negative("albedo", self.albedo)
        if self.reflectance > 1.0 + 1e-12:
            raise ValueError(
                f"reflection, albedo: expected abs(reflection)**2 + albedo of at most 1, got {self.reflectance:g}"
            )

    @classmethod
    def lambertian(cls, albedo: float) -> Material:
        """Diffuse surface without a specular part.

        See Also
        --------
        Material.dielectric : From a permittivity.

        Examples
        --------
        >>> rc.Material.lambertian(0.3).reflectance
        0.3
        """
        return cls(0.0, albedo)

    @classmethod
    def dielectric(
        cls,
        permittivity: Permittivity,
        *,
        roughness: float = 0.0,
        thickness: float | None = None,
        scattering: float | None = None,
        name: str | None = None,
        source: str | None = None,
        valid_frequency: tuple[float, float] | None = None,
    ) -> Material:
        """Dielectric by Fresnel's equations, at the angle of every hit and the centre of the radar's band.

        Parameters
        ----------
        permittivity : complex, ItuPermittivity or ColeCole
            Relative permittivity ``eps' - j eps''``, or its law over frequency. ``eps'`` is at least 1, except
            for conductors, whose ``eps''`` is larger than its magnitude.
        roughness : float
            Rms height of the surface, up to 1 m; it scatters a part of the specular power by Lambert's law.
        thickness : float, optional
            Thickness of a slab with air behind it [m]; default: a half-space.
        scattering : float, optional
            In place of roughness: the part S, 0 to 1, of the reflected field that is scattered, ``S**2`` of its power,
            at every angle.
        name, source, valid_frequency
            See the attributes; simulating outside the frequencies (lowest, highest) [Hz] warns.

        See Also
        --------
        materials : Named materials.
        Material.with_surface : A known material, rough or as a slab.

        Examples
        --------
        >>> plastic = rc.Material.dielectric(2.7 - 0.02j)
        >>> print(f"{plastic.reflectance:.3f} of the power at normal incidence")
        0.059 of the power at normal incidence
        """
        height = check.non_negative("roughness", roughness, "m")
        if height > _ROUGHEST:
            raise ValueError(
                f"roughness: expected at most {_ROUGHEST:g} m, got {height:g}; micrometres? 50e-6 is 50 um"
            )
        part = None if scattering is None else check.within("scattering", scattering, 0.0, 1.0)
        if part is not None and height > 0.0:
            raise ValueError(f"scattering: expected either scattering or roughness, got both ({part:g}, {height:g} m)")
        material = cls()
        vars(material).update(
            permittivity=as_permittivity(permittivity),
            roughness=height,
            thickness=None if thickness is None else check.positive("thickness", thickness, "m"),
            scattering=part,
            name=name,
            source=source,
            valid_frequency=None if valid_frequency is None else _band(valid_frequency),
        )
        reflection, albedo = material.response(_REFERENCE_FREQUENCY)
        vars(material).update(reflection=complex(reflection), albedo=float(albedo))
        return material

    def with_surface(
        self, *, roughness: float = 0.0, thickness: float | None = None, scattering: float | None = None
    ) -> Material:
        """Copy of this dielectric with another surface, or as a slab; parameters as for `dielectric`.

        See Also
        --------
        Material.dielectric : Of any permittivity.

        Examples
        --------
        >>> pane = rc.materials["glass"].with_surface(thickness=4e-3)
        >>> print(f"{pane.reflectance:.2f} of the power at 60 GHz")
        0.04 of the power at 60 GHz
        """
        if self.permittivity is None:
            raise ValueError(f"permittivity: expected a dielectric, got {self!r}")
        return Material.dielectric(
            self.permittivity,
            roughness=roughness,
            thickness=thickness,
            scattering=scattering,
            name=self.name,
            source=self.source,
            valid_frequency=self.valid_frequency,
        )

    @property
    def reflectance(self) -> float:
        """Reflected and scattered power over incident power; of a dielectric as `reflection`."""
        magnitude = hypot(self.reflection.real, self.reflection.imag)
        return magnitude * magnitude + self.albedo  # infinite, not an OverflowError, of what is refused

    def response(
        self, frequency: float, cos_incidence: ArrayLike = 1.0, *, polarization: str | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Reflection coefficient of the specular part and albedo at a frequency [Hz] and angles of incidence.

        Parameters
        ----------
        frequency : float
            Frequency [Hz].
        cos_incidence : array_like
            Cosines of the angle of incidence, any shape.
        polarization : None, "te" or "tm"
            None: a radar without a polarisation, which gets the mean power of both, with the phase of ``r_TE``; "te",
            the field across the plane of incidence: ``r_TE``; "tm", the field in it: ``-r_TM``, so that all are -1 for
            a perfect conductor.

        Returns
        -------
        reflection : complex128, albedo : float64
            As the cosines.

        See Also
        --------
        rcs : Cross-section of a body.

        Examples
        --------
        >>> reflection, albedo = rc.materials["glass"].response(60e9, cos_incidence=[1.0, 0.5], polarization="te")
        >>> np.abs(reflection).round(2)
        array([0.43, 0.65])
        """
        if polarization not in _SEEN:
            raise ValueError(f"polarization: expected None, 'te' or 'tm', got {polarization!r}")
        cosines = check.numbers("cos_incidence", cos_incidence)
        if not ((cosines >= 0.0) & (cosines <= 1.0)).all():
            bad = cosines[~((cosines >= 0.0) & (cosines <= 1.0))].flat[0]
            raise ValueError(f"cos_incidence: expected cosines from 0 to 1, got {bad:g}")
        at = check.frequency("frequency", frequency)
        flat = np.ascontiguousarray(cosines.ravel())
        reflection, albedo = self._core_at(at).response(flat, wavelength=SPEED_OF_LIGHT / at, seen=_SEEN[polarization])
        return reflection.reshape(cosines.shape), albedo.reshape(cosines.shape)

    def is_valid_at(self, frequency: float) -> bool:
        """True when the numbers were published for a frequency [Hz], or for an unknown range."""
        lowest, highest = self.valid_frequency or (-np.inf, np.inf)
        return lowest <= frequency <= highest

    def _core_at(self, frequency: float) -> _core.Material:
        """Counterpart in the core, at a frequency [Hz]."""
        if self.permittivity is None:
            return _core.Material.constant((self.reflection.real, self.reflection.imag), self.albedo)
        eps = permittivity_at(self.permittivity, frequency)
        return _core.Material.dielectric(
            (eps.real, eps.imag),
            roughness=self.roughness or None,
            scattering=self.scattering,
            thickness=self.thickness,
        )


def _band(value: tuple[float, float]) -> tuple[float, float]:
    lowest, highest = check.array("valid_frequency", value, (2,)).tolist()
    if not 0.0 < lowest <= highest:
        raise ValueError(f"valid_frequency: expected lowest and highest frequency [Hz], got {value!r}")
    return lowest, highest
