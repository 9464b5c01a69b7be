"""Things in a MuJoCo model by name."""

from __future__ import annotations

from typing import Any

from radarcore import check


def names_of(model: Any, kind: str) -> list[str]:
    """Names of all things of a kind, "geom", "body", "camera", "site", "mat" or "mesh"; empty ones have none."""
    addresses, text = getattr(model, f"name_{_KINDS.get(kind, kind)}adr"), bytes(model.names)
    return [text[start : text.index(b"\0", start)].decode() for start in addresses.tolist()]


def number_of(model: Any, kind: str, name: str) -> int:
    """Number of the thing of a kind with a name, or a ValueError that names near ones."""
    known = names_of(model, kind)
    if name not in known:
        raise ValueError(f"{kind}: no {kind} {name!r} in the model; {check.near_names(name, filter(None, known))}")
    return known.index(name)


_KINDS = {"camera": "cam"}
"""Kinds that MuJoCo's arrays shorten."""
