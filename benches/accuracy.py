"""Error of whole frames against closed forms and dense integration, and what finer sampling costs.

    python benches/accuracy.py            print the tables
    python benches/accuracy.py --write    also write docs/accuracy.md and docs/accuracy.png
    python benches/accuracy.py --tiny     run everything once on few rays

Real meshes need the extra `robots`: pip install radarcore[robots]. Without it their sections say so.
"""

from __future__ import annotations

import argparse
import io
import os
from pathlib import Path

# Threads of numpy's BLAS that wait for work would slow everything else down.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

from page import machine, table
from proof.bounds import bound_rows, matt_bounds, mesh_bounds, quiet_bounds, single_bounds
from proof.convergence import mesh_points, picture, single_points
from proof.corners import FAR, corner_results, corner_rows, null_db
from proof.measure import FULL, TINY
from proof.oblique import doppler_results, oblique_results, quiet_rows
from proof.real_meshes import INSTALL_HINT, mesh_results, mesh_rows, sphere_checks
from proof.targets import (
    budget_results,
    budget_rows,
    matt_results,
    matt_rows,
    mirror_results,
    mirror_rows,
    section_rows,
)
from radarcore.models import robots

PAGE = Path(__file__).parent.parent / "docs" / "accuracy.md"
PICTURE = PAGE.with_suffix(".png")

PAGE_TEXT = """\
# Accuracy

Frames of `radarcore` against closed forms, and of real meshes against dense integration; written by
`python benches/accuracy.py --write`.

Three ways to sample a scene are compared. `point` is that of Stetco et al. (ICRA 2020): one phasor per pixel.
`footprint` lets the phase vary over the patch behind a pixel. `adaptive` splits cells of the image plane where it
matters, down to an `rcs_floor` or within a `ray_budget`. Every number is the error of the sampling, of meshes as they
are; what the model itself leaves out is told of at the end. {machine}.

![Error against rays, time and settings]({picture})

The error of the range profile is the l2 norm of the complex difference over that of the profile, 57 to 64 GHz, with a
Hann window, against the closed form for sphere and plate (rms over {single_turns} turns of the radar by parts of a
pixel; 81 920 triangles for the sphere) and against dense integration for arm and human (rms over {aspects} views).
Rays are those cast, tiles of the image without a body being left out; times are those of a frame of one chirp and 512
samples, with nothing known from frames before. Above 100 % a profile has nothing to do with the scene. Read a column
from left to right: what the same rays or the same time buy. `point` converges only once a pixel is less than a
wavelength deep, which on curved bodies takes millions of rays, and on a plate seen broadside is so from the start; the
others follow the phase and need tens of thousands. Below, the same errors over what is set: `footprint` over pixels
and `adaptive` over `rcs_floor`, both down to where the facets of a mesh, or the dense integration, are no better.

## Bounds

{bounds}

What the samplings are meant to hold, and what was measured: worst and median over the targets of the kind, each rms
over six turns of the radar for single bodies, and over the views of real meshes. "no" says where to take more rays, or
another sampling. "centres" is adaptive sampling with `end_points=False`; a budget counts the cells of the base grid
over empty directions too, which cast no rays.

## Mirror-like targets

{mirror}

Errors are rms over 64 frequencies from 57 to 64 GHz and six turns of the radar by parts of a pixel, of the level and
of the phase of the echo of the whole target; "worst" is the rms of the worst turn, often the one where the target
lies symmetrically on the pixels. "Pixels" is the side of the square image, 60 degrees wide where nothing else is
said, or the `rcs_floor` of adaptive sampling; "rays" and "paths" are of the first turn, and "cost" is the run time of
a frame (one chirp of 64 samples, nothing known from frames before) relative to 256 x 256 footprints of the same
target in the same run.

Read down a target: footprint errors shrink as pixels do, with the staircase at the edges of plates the last to go;
`point`, one phasor per pixel and kept for comparison, need not converge at all; adaptive sampling takes rays to the
edges and to where the phase turns slowly, and what is left of a sphere's error at the lowest floor is that of its
mesh. A plane wider than the image is a mirror without end, as the border of the image is no edge; pixels fine enough
to follow the phase there see one all the same.

The same bodies within a `ray_budget`:

{budgets}

## Tilted walls and plates

{oblique}

Nothing should come back from the wall: a level is relative to the mirror λ / (8 π d) at the same distance, rms over
57 to 64 GHz and the turns, with the gain exp(-(az² + el²) / 0.08) of antennas that look straight ahead; -inf says
that no path is left. Of the tilted square its edges return something: what is given is the error, over the echo of
the same square seen broadside.

## Doppler

{doppler}

A sphere of 10 cm that recedes evenly at 0.5 m/s from a metre away, over 128 chirps, with Hann windows: the strongest
line more than 16 bins from its peak, over the peak [dB], at its range; the window's own side lobes are at -76 dB there.
A frame follows the points it has sampled once. If every chirp were a frame of its own, cast where the sphere is then,
rays would fall elsewhere every time, and what a sampling gets wrong could look like motion.

## Corner reflectors

{corners}

Paths of two and three reflections at 60 GHz that start from at most {corner_side} x {corner_side} rays, in an image a
little wider than the corner, edges and legs of 10 cm; "rays" counts those of all reflections and those of adaptive
cells. {far:g} m away, cross-sections on paper are those of the far field; near the radar the apparent one of the
triangular trihedral, R to its apex, is by numerical integration. The last column is the phase against that of the
apex, that of the dihedral but for its sign. Adaptive sampling casts its own rays for single reflections and starts
those of several from the same pixels as `footprint`. A dihedral turned by 45 degrees about the boresight returns
{null:.0f} dB of what it returns upright to antennas of vertical polarisation; on paper it returns nothing.

## Real meshes

{meshes}

## Matt targets

{matt}

Deviation from the mean power over all random phases, albedo 1: of the sum of the powers of the paths, and of the
power in the samples averaged over seeds, with its standard error. Diffuse points of adaptive sampling are spread over
the disc by area, the more the lower the floor. Read the first for accuracy: one seed gives one draw of an exponential
distribution (speckle), as a real measurement of one matt surface does, so the second only narrows as one over the
root of the number of seeds.

## Cross-sections

{sections}

`rc.rcs` at 60 GHz, along the normal, the axis of the corner, or broadside; lengths of edges, legs and radii are 10
cm, the cylinder's is its length, with a radius of 5 cm. Closed forms are those of geometrical and physical optics for
large targets; the rims of trihedrals are staircases of the rays.

## What the model leaves out

Physical optics knows neither the diffraction of edges beyond that of their aperture nor waves that creep round bodies:
exact spheres differ by about 1 / (2 k a), 1 % at a radius of 4 cm. At 60 GHz a sphere of 10 cm, centre at 1 m, returns
2.2079e-5 by physical optics and 2.2088e-5 by exact electromagnetics, with 0.002 rad between them. A thin wire, a sharp
edge seen along its face, a body of less than a few wavelengths, the shadow side of anything: there the numbers above
say how well the model is computed, not how well it holds.

Nothing goes through surfaces: no wall is seen through, and clothes, covers and radomes hide what is behind them, even
where their material is a thin slab. Of several reflections on a path all are mirror-like: what a matt surface scatters
onto the next one is neglected.

Meshes are taken for what they are: facets whose sagitta is more than 0.1 mm have a phase of their own
(`rc.mesh_report`), and phases of real things are meaningful as changes in time, not as absolute numbers. A collision
mesh, or one decimated for the screen, can be several decibels off peak by peak, which no sampling mends. At grazing
incidence facets show even on fine meshes: their rims are polygons that return something, where the limb of a smooth
body returns nothing. All samplings but `point` and dense integration taper that away.
"""

MESH_TEXT = """\
{table}

A UR10 (collision meshes, 5 862 triangles) in {aspects} postures, a human (109 000 triangles) at {aspects} headings,
both as conductors, and both of them in a room of 5.2 x 4.4 x 2.6 m whose walls return 12 dB less, seen through a beam
of 30 degrees in {rooms} views. Given is the worst of the views, and their median in brackets: of the error of the
strongest peak's level, of the rms error of the levels of all peaks within 30 dB of it, of the relative error of the
whole complex range profile, and of the error floor, the rms error in ranges between the nearest and the farthest
surface where the profile is more than 40 dB below its strongest peak, over that peak. "rays" is the mean number cast,
"ms" the median time of a frame of one chirp and 512 samples. From 100 000 rays on the base grid is 128 x 128. "centres"
is adaptive sampling with `end_points=False`.

The reference is a dense integration of the same meshes that owes radarcore nothing but the distances of depth
images: (j / 4π) Σ Γ √(G_t G_r) exp(-2jkR) dΩ over {million_rays:.0f} million rays per view, {pitch:g} mrad apart in
each of {shifts} images between which the radar is turned by parts of a pixel, those to the walls {wall_pitch:g} mrad.
By the difference of two halves of the images, their mean is about {own_alone:.1f} % off for arm and human and
{own_room:.1f} % for the room in the worst view. A sphere of 10 cm at 1 m integrated alike is {sphere_fine:.1f} % off
its closed form with {triangles_fine} triangles. With the {triangles_usual} that it usually has it is
{sphere_usual:.1f} % off, most of it at its limb: that much is the mesh's.
"""


def thousands(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def main() -> None:
    parser = argparse.ArgumentParser(description="Error of frames against closed forms and dense integration.")
    parser.add_argument("--tiny", action="store_true", help="once, on few rays")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.parent.name}/{PAGE.name} and the picture")
    arguments = parser.parse_args()
    run = TINY if arguments.tiny else FULL
    texts: dict[str, str] = {}

    def show(name: str, text: str) -> None:
        """Keep a part of the page, and print it."""
        texts[name] = text
        print(text, end="\n\n", flush=True)

    columns = ["target", "sampling", "pixels", "error [dB]", "worst [dB]", "error [rad]", "rays", "paths", "cost"]
    mirror = list(mirror_results(run))
    show("mirror", table(columns, mirror_rows(mirror, run)))
    budgets = budget_results(run)
    show("budgets", table([columns[0], "budget", *columns[3:8]], budget_rows(budgets)))
    oblique = list(oblique_results(run))
    columns = ["target", "sampling", "pixels", "rays", "paths", "dB"]
    show("oblique", table(columns, quiet_rows(oblique)))
    doppler = list(doppler_results(run))
    show("doppler", table(["rays of", *columns[1:5], "floor [dB]"], quiet_rows(doppler)))
    columns = ["corner", "at [m]", "polarisation", "sampling", "rays", "dBsm", "on paper", "error [dB]", "error [rad]"]
    show("corners", table(columns, corner_rows(list(corner_results(run)))))
    matt = list(matt_results(run))
    columns = ["target", "pixels", "paths", "power of the paths", f"mean of {run.seeds} seeds"]
    show("matt", table(columns, matt_rows(matt)))
    columns = ["target", "polarisation", "reflections", "dBsm", "on paper", "error [dB]"]
    show("sections", table(columns, section_rows()))

    meshes = list(mesh_results(run))
    if robots.is_available():
        columns = [
            "scene",
            "sampling",
            "setting",
            "rays",
            "ms",
            "strongest [dB]",
            "peaks [dB]",
            "profile [%]",
            "floor [dB]",
        ]
        usual, fine = sphere_checks(run)
        own = {room: [r.own_error for r in meshes if r.group.startswith("room") == room] for room in (False, True)}
        show(
            "meshes",
            MESH_TEXT.format(
                table=table(columns, mesh_rows(meshes)),
                aspects=run.aspects,
                rooms=run.rooms,
                million_rays=1e-6 * sum(r.num_rays for r in meshes) / len(meshes),
                pitch=1e3 * run.pitch,
                wall_pitch=2e3 * run.pitch,
                shifts=run.shifts,
                own_alone=100.0 * max(own[False]),
                own_room=100.0 * max(own[True]),
                sphere_fine=100.0 * fine.error,
                triangles_fine=thousands(fine.num_triangles),
                sphere_usual=100.0 * usual.error,
                triangles_usual=thousands(usual.num_triangles),
            ).strip(),
        )
    else:
        show("meshes", INSTALL_HINT[0].upper() + INSTALL_HINT[1:])

    bounds = [
        *single_bounds([row for rows in mirror for row in rows], budgets),
        *quiet_bounds(oblique, doppler),
        *mesh_bounds(meshes),
        *matt_bounds(matt),
    ]
    show("bounds", table(["what", "quantity", "bound", "worst", "median", "held"], bound_rows(bounds)))

    image = io.BytesIO()
    picture([*single_points(run), *mesh_points(meshes)]).savefig(image, dpi=100)
    if arguments.write:
        PAGE.parent.mkdir(exist_ok=True)
        PICTURE.write_bytes(image.getvalue())
        page = PAGE_TEXT.format(
            machine=machine(),
            picture=PICTURE.name,
            single_turns=len(range(0, run.turns, 2)),
            aspects=run.aspects,
            corner_side=run.corner_side,
            far=FAR,
            null=null_db(run),
            **texts,
        )
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
