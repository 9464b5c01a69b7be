"""Quality of a mesh: topology, and the distance of its facets from the surface they approximate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.units import SPEED_OF_LIGHT

_WANTED_SAGITTA = 1e-4
"""Facets that are within it of the curved surface are fine enough at 60 GHz [m]."""

_SMALL_DIFFERENCE, _LARGE_DIFFERENCE = 0.05, 0.3
"""Differences of the echo that hardly matter, and that leave no peak at its level."""


@dataclass(frozen=True)
class MeshReport:
    """Quality of a mesh; `str` has it line by line, with `verdicts` at the end.

    Vertices at equal positions count as one. Smooth facets approximate a curved surface: they meet others below the
    mesh's crease angle and their corner normals fit a smooth surface. A mesh with `shading="flat"` is examined as if it
    were smooth.

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
        Frequency of the phases and echoes below [Hz].
    largest_difference, rms_difference : float
        Difference between the far fields of facets taken as flat and of the curved surfaces, relative to the rms far
        field of the curved ones: those of metal in 64 directions after one reflection, by the sums of `rcs` with at
        most 96 x 96 rays per direction. It estimates the error of the mesh; single peaks of the echo may be off by as
        much. Of bodies over a few decimetres it is uncertain by up to 0.06.

    See Also
    --------
    mesh_report : Makes it.
    load_mesh : Mesh of a file.

    Examples
    --------
    >>> report = rc.mesh_report(rc.shapes.sphere(0.02, subdivisions=1))
    >>> print(f"{1e3 * report.largest_sagitta:.1f} mm")
    1.3 mm
    >>> report.verdicts[0].partition(":")[0]
    'Coarse'
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
    largest_difference: float
    rms_difference: float

    @property
    def flat_share(self) -> float:
        """Part of the area that is flat, 0 to 1."""
        return 1.0 - self.smooth_share

    @property
    def largest_phase(self) -> float:
        """Two-way phase error of the largest sagitta [rad]."""
        return self._phase(self.largest_sagitta)

    @property
    def mean_phase(self) -> float:
        """Two-way phase error of the mean sagitta [rad]."""
        return self._phase(self.mean_sagitta)

    def _phase(self, sagitta: float) -> float:
        return 4.0 * np.pi * self.frequency / SPEED_OF_LIGHT * sagitta

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Consequences for a simulation, one or two sentences each."""
        if self.num_triangles == 0:
            return ("There is no triangle with an area: the radar sees nothing.", *self._dropped())
        return (*self._about_shape(), *self._about_edges(), *self._dropped())

    def _about_shape(self) -> Iterator[str]:
        if self.smooth_share == 0.0:
            yield "All facets are flat: the radar sees them as they are."
            return
        largest, mean, wanted = (
            f"{1e3 * s:.2g} mm" for s in (self.largest_sagitta, self.mean_sagitta, _WANTED_SAGITTA)
        )
        if self.largest_sagitta <= _WANTED_SAGITTA:
            yield f"Fine enough: facets are within {largest} of the curved surface (wanted: below {wanted})."
        else:
            where = "Coarse" if self.mean_sagitta > _WANTED_SAGITTA else "Coarse in places"
            yield (
                f"{where}: facets stand off the curved surface by up to {largest}, {mean} in the mean (wanted: below "
                f"{wanted}). Use a finer mesh; do not decimate for radar."
            )
        if self.rms_difference <= _SMALL_DIFFERENCE:
            meaning = "shading hardly matters"
        elif self.rms_difference <= _LARGE_DIFFERENCE:
            meaning = f"expect peaks to be off by about {20.0 * np.log10(1.0 + self.rms_difference):.1f} dB"
        else:
            meaning = "take no peak at its level"
        yield f"Facets taken as flat change the echo by {self.rms_difference:.1%} (rms): {meaning}."
        yield "Phase is meaningful as change in time, not as absolute value."

    def _about_edges(self) -> Iterator[str]:
        if self.num_open_edges:
            yield f"{_number(self.num_open_edges, 'open edge')}: a sheet, or a body that rays can get into."
        if self.num_nonmanifold_edges:
            edges = _number(self.num_nonmanifold_edges, "edge")
            yield f"{edges} of more than two triangles: sharp there, whatever the crease angle."
        if self.num_inconsistent_edges:
            edges = _number(self.num_inconsistent_edges, "edge")
            yield f"{edges} between triangles of opposite winding: sharp there, whatever the crease angle."
        if self.num_duplicates:
            yield f"{_number(self.num_duplicates, 'triangle')} in the place of another: merge them."
        if self.num_thin:
            yield f"{_number(self.num_thin, 'triangle')} over 100 times longer than high: their normals are uncertain."

    def _dropped(self) -> Iterator[str]:
        if self.num_merged:
            yield f"{_number(self.num_merged, 'triangle')} listed again in the other winding: left out."
        if self.num_dropped:
            yield f"{_number(self.num_dropped, 'triangle')} without area: left out."

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
            "flat part of the area": self.flat_share,
            "largest sagitta [m]": self.largest_sagitta,
            "mean sagitta [m]": self.mean_sagitta,
            "frequency [Hz]": self.frequency,
            "phase of the largest sagitta [rad]": self.largest_phase,
            "phase of the mean sagitta [rad]": self.mean_phase,
            "echo, flat against smooth, rms": self.rms_difference,
            "echo, flat against smooth, largest": self.largest_difference,
        }

    def __str__(self) -> str:
        facts = self.facts()
        width = max(map(len, facts))
        texts = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in facts.items()}
        return "\n".join([*(f"{name:<{width}}  {text}" for name, text in texts.items()), *self.verdicts])


@check.knows_keywords
def mesh_report(mesh: Mesh, *, frequency: float = 60e9) -> MeshReport:
    """Quality of a mesh for simulation at a frequency [Hz].

    Facets should deviate from the surface that they approximate by less than 0.1 mm. The numbers are estimates from the
    mesh alone: a smooth facet is taken for a piece of the surface through its corners with the corner normals, which
    are themselves estimates from the adjacent facets.

    Parameters
    ----------
    mesh : Mesh
    frequency : float
        Frequency of phases and echoes [Hz].

    See Also
    --------
    MeshReport : What it says.
    load_mesh : Mesh of a file.

    Examples
    --------
    >>> report = rc.mesh_report(rc.shapes.box(0.1))
    >>> report.num_triangles, report.num_open_edges
    (12, 0)
    >>> report.verdicts[0]
    'All facets are flat: the radar sees them as they are.'
    """
    if not isinstance(mesh, Mesh):
        raise TypeError(f"mesh: expected Mesh, got {type(mesh).__name__}")
    at = check.frequency("frequency", frequency)
    counts, measures = mesh._core.quality(
        crease_angle=float(np.deg2rad(mesh.crease_angle_deg)), wavelength=SPEED_OF_LIGHT / at
    )
    parts, open_edges, nonmanifold, inconsistent, duplicates, thin = counts
    area, smooth_area, largest, mean, largest_difference, rms_difference = measures
    return MeshReport(
        num_triangles=len(mesh.triangles),
        num_dropped=mesh.num_dropped,
        num_parts=parts,
        num_open_edges=open_edges,
        num_nonmanifold_edges=nonmanifold,
        num_inconsistent_edges=inconsistent,
        num_merged=mesh.num_merged,
        num_duplicates=duplicates,
        num_thin=thin,
        area=area,
        smooth_share=smooth_area / area if area > 0.0 else 0.0,
        largest_sagitta=largest,
        mean_sagitta=mean,
        frequency=at,
        largest_difference=largest_difference,
        rms_difference=rms_difference,
    )


def _number(count: int, thing: str) -> str:
    return f"{count} {thing}{'' if count == 1 else 's'}"
