"""Library of materials: permittivities, with sources and frequencies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from radarcore import check
from radarcore.scene.material import ColeCole, ItuPermittivity, Material, Permittivity

_ITU = "ITU-R P.2040-3, table 3"

# a, b, c, d and the frequencies [GHz] for which the table gives them.
_ITU_PARAMETERS = {
    "concrete": ((5.24, 0.0, 0.0462, 0.7822), (1.0, 100.0)),
    "plasterboard": ((2.73, 0.0, 0.0085, 0.9395), (1.0, 100.0)),
    "wood": ((1.99, 0.0, 0.0047, 1.0718), (0.001, 100.0)),
    "glass": ((6.31, 0.0, 0.0036, 1.3394), (0.1, 100.0)),
    "ceiling_board": ((1.48, 0.0, 0.0011, 1.0750), (1.0, 100.0)),
    "chipboard": ((2.58, 0.0, 0.0217, 0.7800), (1.0, 100.0)),
    "floorboard": ((3.66, 0.0, 0.0044, 1.3515), (50.0, 100.0)),
    "marble": ((7.074, 0.0, 0.0055, 0.9262), (1.0, 60.0)),
    "brick": ((3.91, 0.0, 0.0238, 0.16), (1.0, 40.0)),
    "plywood": ((2.71, 0.0, 0.33, 0.0), (1.0, 40.0)),
    "metal": ((1.0, 0.0, 1e7, 0.0), (1.0, 100.0)),
}

_SKIN = ColeCole(4.0, ((32.0, 7.234e-12, 1.0), (1100.0, 32.481e-9, 0.8)), 0.0002)
_SKIN_SOURCE = "S. Gabriel, R. W. Lau, C. Gabriel, Phys. Med. Biol. 41 (1996) 2271, dry skin"

_RIDDLE = "B. Riddle, J. Baker-Jarvis, J. Krupka, IEEE Trans. Microw. Theory Tech. 51 (2003) 727"
_ABBAS = "Z. Abbas, R. D. Pollard, R. W. Kelsall, IEEE Trans. Instrum. Meas. 50 (2001) 1334"
_ELHAWIL = "A. Elhawil et al., Proc. Symposium IEEE/LEOS Benelux Chapter, Brussels, 2007"

# Real part, loss tangent, the frequencies [GHz] at which they were measured, and the source.
_PLASTICS = {
    "abs": (2.70, 0.008, (11.0, 11.0), _RIDDLE),
    "pmma": (2.61, 0.010, (11.0, 11.0), _RIDDLE),
    "pom": (2.73, 0.006, (11.0, 11.0), _RIDDLE),
    "pvc": (2.71, 0.006, (11.0, 11.0), _RIDDLE),
    "nylon": (3.00, 0.018, (26.0, 40.0), _ABBAS),
    "polystyrene": (2.505, 0.00025, (26.0, 40.0), _ABBAS),
    "ptfe": (2.05, 0.0005, (70.0, 110.0), _ELHAWIL),
    "pla": (2.84, 0.043 / 2.84, (60.0, 60.0), "typical of printed parts"),
}


# Permittivities change little over a tenth of the frequency: that is not worth a warning.
_SLACK = 1.1


def _entry(name: str, permittivity: Permittivity, source: str, band_ghz: tuple[float, float]) -> Material:
    band = (1e9 * band_ghz[0], 1e9 * band_ghz[1])
    return Material.dielectric(permittivity, name=name, source=source, valid_frequency=band)


def _entries() -> Iterator[Material]:
    for name, (parameters, band) in _ITU_PARAMETERS.items():
        yield _entry(name, ItuPermittivity(*parameters), _ITU, band)
    yield _entry("skin", _SKIN, _SKIN_SOURCE, (1e-8, 100.0))
    for name, (real, loss_tangent, band, source) in _PLASTICS.items():
        yield _entry(name, complex(real, -real * loss_tangent), source, band)


def _text(band_ghz: tuple[float, float]) -> str:
    lowest, highest = band_ghz
    return f"{lowest:g} GHz" if lowest == highest else f"{lowest:g} to {highest:g} GHz"


def extrapolation(used: Iterable[Material], frequency: float) -> str | None:
    """Warning about materials used at a frequency [Hz] that their numbers do not cover; None when there are none."""
    known = []
    for material in used:
        if material.valid_frequency is None:
            continue
        lowest, highest = material.valid_frequency
        if not lowest / _SLACK <= frequency <= highest * _SLACK:
            known.append(f"{material.name or 'a dielectric'} (known at {_text((1e-9 * lowest, 1e-9 * highest))})")
    if not known:
        return None
    return f"materials: extrapolated to {1e-9 * frequency:.4g} GHz: {', '.join(dict.fromkeys(known))}"


class _Library(Mapping[str, Material]):
    """Materials by name; an unknown name is a KeyError that names near ones.

    See Also
    --------
    Material : One of them, or another.
    Body : Takes it.

    Examples
    --------
    >>> rc.materials["glass"].permittivity
    ItuPermittivity(a=6.31, b=0.0, c=0.0036, d=1.3394)
    >>> print(f"{rc.materials['glass'].reflectance:.2f} of the power at normal incidence")
    0.19 of the power at normal incidence
    >>> "steel" in rc.materials
    False
    """

    def __init__(self) -> None:
        self._materials = {"perfect_conductor": Material(-1.0)} | {str(m.name): m for m in _entries()}

    def __getitem__(self, name: str) -> Material:
        try:
            return self._materials[name]
        except KeyError:
            raise KeyError(f"no material {name!r}; {check.near_names(name, self._materials)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._materials)

    def __len__(self) -> int:
        return len(self._materials)

    def __repr__(self) -> str:
        return f"<materials: {', '.join(self._materials)}>"


materials: Mapping[str, Material] = _Library()
"""Materials by name: smooth half-spaces of ITU-R P.2040-3, skin, plastics; and perfect_conductor.

See Also
--------
Material : One of them, or another.
Body : Takes it.

Examples
--------
>>> rc.materials["glass"].permittivity
ItuPermittivity(a=6.31, b=0.0, c=0.0036, d=1.3394)
>>> print(f"{rc.materials['glass'].reflectance:.2f} of the power at normal incidence")
0.19 of the power at normal incidence
>>> "steel" in rc.materials
False
"""


def as_material(name: str, value: Material | str) -> Material:
    """A material, as it is or by name, or a TypeError that names the argument."""
    if isinstance(value, Material):
        return value
    if isinstance(value, str):
        return materials[value]
    raise TypeError(f"{name}: expected Material or a name of radarcore.materials, got {type(value).__name__}")
