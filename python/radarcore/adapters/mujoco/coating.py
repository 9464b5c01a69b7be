"""Materials of MuJoCo's geoms, by names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from radarcore import check
from radarcore.adapters.mujoco.names import names_of
from radarcore.adapters.mujoco.tessellation import mesh_of
from radarcore.scene.library import materials as library
from radarcore.scene.material import Material


def geom_materials(
    model: Any, geoms: Sequence[int], materials: Mapping[str, Material | str] | None, default: Material | str
) -> list[Material]:
    """Material of every geom.

    The first that `materials` has of the names of the geom, its material in MuJoCo, its mesh and its body; else the
    one of radarcore's library that is called as its material in MuJoCo; else the default.
    """
    geom_names, body_names, material_names, mesh_names = (
        names_of(model, kind) for kind in ("geom", "body", "mat", "mesh")
    )
    chosen = {name: _material(f"materials[{name!r}]", value) for name, value in (materials or {}).items()}
    known = {*geom_names, *body_names, *material_names, *mesh_names} - {""}
    for name in chosen:
        if name not in known:
            raise ValueError(
                f"materials: nothing in the model is called {name!r}, no geom, material, mesh or body; "
                f"{check.near_names(name, sorted(known))}"
            )
    other = _material("default", default)

    def material(geom: int) -> Material:
        paint, mesh = int(model.geom_matid[geom]), mesh_of(model, geom)
        of_material = material_names[paint] if paint >= 0 else ""
        of_mesh = mesh_names[mesh] if mesh >= 0 else ""
        for name in (geom_names[geom], of_material, of_mesh, body_names[int(model.geom_bodyid[geom])]):
            if name in chosen:
                return chosen[name]
        return library.get(of_material, other)

    return [material(geom) for geom in geoms]


def _material(name: str, value: Material | str) -> Material:
    if isinstance(value, Material):
        return value
    if isinstance(value, str):
        return library[value]
    raise TypeError(f"{name}: expected Material or a name of radarcore.materials, got {type(value).__name__}")
