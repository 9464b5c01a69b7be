"""Materials of scene files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from radarcore import check
from radarcore.scene.library import materials
from radarcore.scene.material import Material
from radarcore.scenefile.build.errors import located
from radarcore.scenefile.read import place
from radarcore.scenefile.tables import MaterialTable, NamedMaterialTable


def materials_of(tables: list[NamedMaterialTable]) -> dict[str, Material]:
    """Materials of the file and of the library by name."""
    own: dict[str, Material] = {}
    for i, table in enumerate(tables):
        with located(f"{place('material', i, table.name)}: "):
            if table.name in own or table.name in materials:
                other = "another" if table.name in own else "one of the library"
                raise ValueError(f"name: expected a name of its own, got that of {other}")
            own[table.name] = material_of(table)
    return own | dict(materials)


def named_material(name: str, known: Mapping[str, Material]) -> Material:
    """A known material; a ValueError that names near ones for any other."""
    if name not in known:
        raise ValueError(f"no material {name!r}; {check.near_names(name, known)}")
    return known[name]


def material_of(table: MaterialTable) -> Material:
    """The material of a table: a dielectric, or a reflection coefficient and an albedo."""
    surface: dict[str, Any] = table.model_dump(include={"roughness", "thickness", "scattering"})
    if table.permittivity is None:
        if given := table.model_fields_set & set(surface):
            raise ValueError(f"{min(given)}: expected permittivity with it, got none")
        return Material(table.reflection or 0.0, table.albedo)
    if table.reflection is not None:
        raise ValueError("reflection: expected either reflection or permittivity, got both")
    if table.albedo != 0.0:
        raise ValueError(
            "albedo: expected none with permittivity (roughness or scattering say what is scattered), "
            f"got {table.albedo:g}"
        )
    if isinstance(table.permittivity, str):
        with located("permittivity: "):
            found = named_material(table.permittivity, materials)
        return found.with_surface(**surface)
    real, loss = table.permittivity
    return Material.dielectric(complex(real, -loss), **surface)
