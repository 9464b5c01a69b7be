"""Quality of a mesh: topology, and the distance of its facets from the curved surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.geometry.mesh import Mesh, position_hashes
from radarcore.units import SPEED_OF_LIGHT

_WANTED_SAGITTA = 1e-4
"""Facets that are within it of the curved surface are fine enough at 60 GHz [m]."""

_THIN = 100.0
"""Ratio of longest edge to height from which on a triangle is thin."""

_UNEVEN = 0.8
"""Fraction of the heights of two triangles over their edge from which on the higher one is straight up to the edge."""

_LEAST_DISTANCE = 0.3
"""Smallest distance of a circumcentre from an edge that counts [half lengths of the edge]: obtuse angles have none."""

_PLANE_ANGLE = 1e-3
"""Largest angle between two triangles in one plane [rad]: rounding of files."""


@dataclass(frozen=True)
class MeshReport:
    """Quality of a mesh; `str` has it line by line, with `verdict` at the end.

    Vertices at equal positions count as one. Smooth facets approximate a curved surface: they meet others at an angle
    below the mesh's crease angle. A mesh with `shading="flat"` is examined as if it were smooth.

    Attributes
    ----------
    num_triangles, num_dropped : int
        Triangles, and degenerate ones that were left out.
    num_parts : int
        Groups of triangles that share edges.
    num_open_edges, num_nonmanifold_edges : int
        Edges of one triangle, and of more than two.
    num_inconsistent_edges : int
        Edges of two triangles that are wound in opposite senses.
    num_merged : int
        Triangles left out because they were listed in both windings.
    num_duplicates, num_thin : int
        Triangles still in the place of another, and triangles over 100 times longer than high.
    area : float
        Area of all triangles [m^2].
    smooth_share : float
        Part of the area that is smooth, 0 to 1.
    largest_sagitta, mean_sagitta : float
        Height of the curved surface over the middle of smooth facets, the largest and the mean over their area [m].
    frequency : float
        Frequency of the phases [Hz].
    """

    num_triangles: int
    num_dropped: int
    num_parts: int
    num_open_edges: int
    num_nonmanifold_edges: int
    num_inconsistent_edges: int
    num_merged: int
    num_duplicates: int
    num_thin: int
    area: float
    smooth_share: float
    largest_sagitta: float
    mean_sagitta: float
    frequency: float

    @property
    def largest_phase(self) -> float:
        """Two-way phase error of the largest sagitta [rad]."""
        return self._phase(self.largest_sagitta)

    @property
    def mean_phase(self) -> float:
        """Two-way phase error of the mean sagitta [rad]."""
        return self._phase(self.mean_sagitta)

    def _phase(self, sagitta: float) -> float:
        """On spheres and limbs the echo of flat facets differs from the curved surface's by 0.8 per radian (rms)."""
        return 4.0 * np.pi * self.frequency / SPEED_OF_LIGHT * sagitta

    @property
    def verdict(self) -> str:
        """Consequence of the sagitta for a simulation, in a sentence."""
        if self.num_triangles == 0:
            return "No triangle has an area: the radar sees nothing."
        if self.smooth_share == 0.0:
            return "All facets are flat: the radar sees them as they are."
        largest, mean = (f"{1e3 * sagitta:.2g} mm" for sagitta in (self.largest_sagitta, self.mean_sagitta))
        off = f"facets are up to {largest} off the curved surface, {mean} in the mean (wanted: below 0.1 mm)"
        if self.largest_sagitta <= _WANTED_SAGITTA:
            return f"Fine enough: {off}."
        error_db = 20.0 * np.log10(1.0 + self.mean_phase)
        return f"Coarse: {off}. Use a finer mesh; expect peak errors of about {error_db:.1f} dB."

    def facts(self) -> dict[str, Any]:
        """Numbers of the report, by name with unit."""
        return {
            "triangles": self.num_triangles,
            "dropped triangles": self.num_dropped,
            "parts": self.num_parts,
            "open edges": self.num_open_edges,
            "edges of more than two triangles": self.num_nonmanifold_edges,
            "inconsistently wound edges": self.num_inconsistent_edges,
            "merged triangles": self.num_merged,
            "doubled triangles": self.num_duplicates,
            "thin triangles": self.num_thin,
            "area [m^2]": self.area,
            "smooth part of the area": self.smooth_share,
            "largest sagitta [m]": self.largest_sagitta,
            "mean sagitta [m]": self.mean_sagitta,
            "frequency [Hz]": self.frequency,
            "phase of the largest sagitta [rad]": self.largest_phase,
            "phase of the mean sagitta [rad]": self.mean_phase,
        }

    def __str__(self) -> str:
        facts = self.facts()
        width = max(map(len, facts))
        texts = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in facts.items()}
        return "\n".join([*(f"{name:<{width}}  {text}" for name, text in texts.items()), self.verdict])


def mesh_report(mesh: Mesh, *, frequency: float = 60e9) -> MeshReport:
    """Quality of a mesh for simulation at a frequency [Hz].

    Facets should deviate from the surface that they approximate by less than 0.1 mm. The numbers are estimates from the
    mesh alone: a curved surface through the corners of the facets, whose slope is continuous at smooth edges.

    Parameters
    ----------
    mesh : Mesh
    frequency : float
        Frequency of the phases [Hz].

    See Also
    --------
    load_mesh : Mesh of a file.
    Mesh : The examined class.

    Examples
    --------
    >>> report = rc.mesh_report(rc.shapes.box(0.1))
    >>> report.num_triangles, report.num_open_edges
    (12, 0)
    >>> report.verdict
    'All facets are flat: the radar sees them as they are.'
    >>> print(f"{1e3 * rc.mesh_report(rc.shapes.sphere(0.02, subdivisions=1)).largest_sagitta:.1f} mm")
    1.3 mm
    """
    check.instance("mesh", mesh, Mesh)
    at = check.frequency("frequency", frequency)
    parts, open_edges, nonmanifold, inconsistent = mesh._core.topology()
    corners = np.unique(position_hashes(mesh.vertices), return_inverse=True)[1][mesh.triangles].astype(np.int64)
    points = mesh.vertices[mesh.triangles]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    double_areas = np.linalg.norm(normals, axis=1)
    sides = np.roll(points, -1, axis=1) - points
    lengths = np.linalg.norm(sides, axis=2)
    area = 0.5 * float(double_areas.sum())
    sagitta, smooth = _sagittas(corners, normals, sides, np.deg2rad(mesh.crease_angle_deg))
    smooth_area = 0.5 * float(double_areas[smooth].sum())
    return MeshReport(
        num_triangles=len(mesh.triangles),
        num_dropped=mesh.num_dropped,
        num_parts=parts,
        num_open_edges=open_edges,
        num_nonmanifold_edges=nonmanifold,
        num_inconsistent_edges=inconsistent,
        num_merged=mesh.num_merged,
        num_duplicates=len(corners) - len(np.unique(np.sort(corners, axis=1), axis=0)),
        num_thin=int((lengths.max(axis=1, initial=0.0) ** 2 > _THIN * double_areas).sum()),
        area=area,
        smooth_share=smooth_area / area if area > 0.0 else 0.0,
        largest_sagitta=float(sagitta.max(initial=0.0)),
        mean_sagitta=float(0.5 * (sagitta * double_areas).sum() / smooth_area) if smooth_area > 0.0 else 0.0,
        frequency=at,
    )


def _sagittas(
    corners: NDArray[np.int64], normals: NDArray[np.float64], sides: NDArray[np.float64], crease_angle: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Heights of the curved surface over the middles of triangles [m], and which of them are smooth.

    The surface is the quadratic one that is zero at the corners and has a given slope at the middle of every edge (the
    Morley element). Its height over the middle is two ninths of the sum over the edges of the slope times the height of
    the triangle over the edge. The slopes of two triangles at their edge add up to the angle between them, and are
    proportional to the distances of their circumcentres from the edge, as on a sphere. A triangle much higher than its
    neighbour is straight up to the edge, such as the side of a tube up to a chamfer.
    """
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * (corners.max(initial=0) + 1) + np.maximum(starts, ends)
    _, edge, num_sides = np.unique(keys, return_inverse=True, return_counts=True)
    order = np.argsort(edge, kind="stable")
    pairs = order[num_sides[edge[order]] == 2].reshape(-1, 2).T
    triangle, side = np.divmod(pairs, 3)
    is_consistent = corners[triangle[0], side[0]] != corners[triangle[1], side[1]]
    normal, along = normals[triangle], sides[triangle[0], side[0]]
    length = np.linalg.norm(along, axis=1)
    sine = np.vecdot(np.cross(*normal), along) / length
    angle = np.arctan2(sine, np.vecdot(*normal))
    angle[~is_consistent | (np.abs(angle) >= crease_angle)] = 0.0

    double_areas = np.linalg.norm(normal, axis=2)
    heights = double_areas / length
    # The cotangent of the angle opposite to the edge: twice the distance of the circumcentre over the length.
    before, after = sides[triangle, side - 1], sides[triangle, (side + 1) % 3]
    distances = np.maximum(-np.vecdot(before, after) / double_areas, _LEAST_DISTANCE)
    higher = heights / heights.sum(axis=0) > _UNEVEN
    parts = np.where(higher, 0.0, np.where(higher[::-1], 1.0, distances / distances.sum(axis=0)))
    sums, is_smooth = np.zeros(len(corners)), np.zeros(len(corners), dtype=bool)
    np.add.at(sums, triangle, heights * parts * angle)
    is_smooth[triangle[:, np.abs(angle) > _PLANE_ANGLE]] = True
    return np.where(is_smooth, np.abs(sums) / 4.5, 0.0), is_smooth
