"""Visibility of bodies: the share of the energy of their echoes that reaches the radar past other bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.bodies import Floats, Members
from radarcore.dataset.echoes import Caster, Echo
from radarcore.products import real_inner
from radarcore.scene.scene import Parts, Scene

_PARALLAX = 1e-3
"""Margin of directions, for antennas beside the centre of the array and the corners of cells of rays [tangent]."""


def visibilities(
    caster: Caster, echo: Echo, time: float, members: Members, scene: Scene, is_rough: NDArray[np.bool_], boxes: Floats
) -> Floats:
    """Visibility of the bodies of every label, (label,), 0 to 1; NaN where there are none.

    Parameters
    ----------
    caster : Caster
        Casts bodies alone.
    echo : Echo
        Paths of the whole scene.
    time : float
        Time of all paths [s].
    members : tuple of (n,) intp
        Bodies of every label.
    scene : Scene
    is_rough : (body,) bool
        As `are_rough` has them.
    boxes : (body, 2, 3) float64
        Boxes of the bodies, from the centre of the array [m].
    """
    shares = np.full(len(members), np.nan)
    for label, numbers in enumerate(members):
        if len(numbers) == 0:
            continue
        seen = echo.of(numbers)
        in_danger = may_be_hidden(numbers, scene.parts, boxes)
        if not in_danger.any() or not seen.amplitude.any():
            shares[label] = float(seen.amplitude.any())
        else:
            shares[label] = share(seen, caster.alone(numbers, time), in_danger, is_rough, caster)
    return shares


def are_rough(scene: Scene, frequency: float) -> NDArray[np.bool_]:
    """True for bodies that scatter more than they reflect, at normal incidence and a frequency [Hz], (body,)."""
    rough = np.zeros(len(scene.bodies), dtype=np.bool_)
    for number, body in zip(scene.parts.mesh_numbers, scene.parts.meshed, strict=True):
        reflection, albedo = body.material.response(frequency)
        rough[number] = albedo > np.abs(reflection) ** 2
    return rough


def share(seen: Echo, alone: Echo, in_danger: NDArray[np.bool_], is_rough: NDArray[np.bool_], caster: Caster) -> float:
    """Part of the energy of an echo alone that its paths in view have, 0 to 1.

    The energy of the signal s of a body is the sum over its paths of Re <s, s_path>, however finely it is sampled. Of
    that sum the paths in view have their part: half of a mirror that is half hidden. Of a rough surface, whose paths
    have random phases, these products are far from their mean, the energy of each path, which takes their place. The
    energies of several bodies add.

    Parameters
    ----------
    seen, alone : Echo
        Paths in the scene, and those without the rest of it.
    in_danger : (body,) bool
        Bodies that others may hide; of the rest all is in view.
    is_rough : (body,) bool
        Bodies whose paths count one by one, by their numbers in the paths.
    caster : Caster
    """
    whole = part = 0.0
    for number, own in alone.of_each(np.arange(len(is_rough))):
        in_view = seen.of(np.array([number])) if in_danger[number] else own
        energy, left = (_powers if is_rough[number] else _signals)(own, in_view, caster)
        whole, part = whole + energy, part + left
    return float(np.clip(part / whole, 0.0, 1.0)) if whole > 0.0 else 0.0


def _powers(alone: Echo, in_view: Echo, _: Caster) -> tuple[float, float]:
    """Energies of paths one by one [W]."""
    return float(np.square(np.abs(alone.amplitude)).sum()), float(np.square(np.abs(in_view.amplitude)).sum())


def _signals(alone: Echo, in_view: Echo, caster: Caster) -> tuple[float, float]:
    """Energy of the signal of all paths, and the part of it of those in view, per sample [W]."""
    signal = caster.signal(alone)
    energy = real_inner(signal, signal) / signal.shape[1]
    if in_view is alone:
        return energy, energy
    if in_view.amplitude.size == 0:
        return energy, 0.0
    return energy, real_inner(signal, caster.signal(in_view)) / signal.shape[1]


def may_be_hidden(numbers: NDArray[np.intp], parts: Parts, boxes: Floats) -> NDArray[np.bool_]:
    """True for those of some bodies whose box, seen from the radar, that of a body with a mesh beside them overlaps.

    (body,), False for all other bodies of the scene.
    """
    others = np.setdiff1d(parts.mesh_numbers, numbers)
    # Points are seen through everything.
    meshes = np.intersect1d(numbers, parts.mesh_numbers)
    low, high = _directions(boxes)
    nearest, farthest = _distances(boxes)
    in_danger = np.zeros(len(boxes), dtype=np.bool_)
    for number in meshes.tolist():
        overlaps = (low[others] <= high[number]) & (high[others] >= low[number])
        in_danger[number] = (overlaps.all(axis=1) & (nearest[others] <= farthest[number])).any()
    return in_danger


def _directions(boxes: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest y/x and z/x of boxes, (body, 2) each; infinite for what reaches behind the antennas."""
    front = boxes[:, :, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = boxes[:, None, :, 1:] / front[:, :, None]  # body, x of the corner, y or z of it, axis
    low, high = corners.min(axis=(1, 2)) - _PARALLAX, corners.max(axis=(1, 2)) + _PARALLAX
    is_ahead = boxes[:, :1, 0] > 0.0
    # The antennas are a few millimetres beside the centre of the array.
    margin = np.where(is_ahead, _PARALLAX / np.maximum(boxes[:, :1, 0], _PARALLAX), np.inf)
    return np.where(is_ahead, low - margin, -np.inf), np.where(is_ahead, high + margin, np.inf)


def _distances(boxes: Floats) -> tuple[Floats, Floats]:
    """Distances of the nearest and the farthest point of boxes, (body,) each [m]."""
    nearest = np.linalg.norm(np.clip(0.0, boxes[:, 0], boxes[:, 1]), axis=1)
    farthest = np.linalg.norm(np.abs(boxes).max(axis=1), axis=1)
    return nearest, farthest
