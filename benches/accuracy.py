"""Error of whole frames against closed forms and dense integration, and what finer sampling costs.

    python benches/accuracy.py            print the tables
    python benches/accuracy.py --write    also write benches/results/accuracy.*, docs/accuracy.md and its picture
    python benches/accuracy.py --picture  draw the picture of the results again
    python benches/accuracy.py --tiny     run everything once on few rays

Real meshes need the extra `robots`: pip install radarcore[robots]. Without it their sections say so.
"""

from __future__ import annotations

import argparse
import io

from page import ACCURACY, DOCS, POINTS, machine, table, write_section
from proof import embree
from proof.bounds import (
    DENSE,
    FACES,
    bound_rows,
    default_bounds,
    flat_bounds,
    flat_lines,
    matt_bounds,
    mesh_bounds,
    quiet_bounds,
    single_bounds,
    surface_bounds,
    unheld_lines,
)
from proof.convergence import (
    WITHIN_MS,
    mesh_points,
    picture,
    read_points,
    single_points,
    time_rows,
    write_points,
)
from proof.corners import FAR, corner_results, corner_rows, near_rows, null_db
from proof.flat_surfaces import STRONG, flat_results, flat_rows
from proof.measure import FULL, TINY, Run
from proof.oblique import doppler_results, oblique_results, quiet_rows
from proof.real_meshes import (
    INSTALL_HINT,
    VIEW_COLUMNS,
    mesh_results,
    mesh_rows,
    peak_rows,
    sphere_checks,
    tracer_checks,
    view_rows,
)
from proof.surfaces import surface_results, surface_rows
from proof.targets import (
    matt_results,
    matt_rows,
    mirror_results,
    mirror_rows,
    section_rows,
)
from radarcore.models import robots

PAGE = DOCS / "accuracy.md"
PICTURE = PAGE.with_suffix(".png")

SUMMARY_TEXT = """\
On {machine}:

{bounds}

Other samplings miss some of their bounds:

{unheld}
"""

PAGE_TEXT = """\
# Accuracy: all tables

Errors of radarcore frames against closed forms, exact surfaces and dense integration. Written by
`python benches/accuracy.py --write`; {machine}. [Accuracy](../../docs/accuracy.md) is the summary.

## Error within a time

{times}

Least error of the range profile [%] of the first frame of a new simulator within a time. "default" is
`Simulator(scene, radar)` with its field of view at 60 x 60 degrees. Times are for a frame of one chirp and 512 samples.

The error of a range profile is the l2 norm of the complex difference relative to the l2 norm of the profile, 57 to 64
GHz, with a Hann window. Above 100 % a profile is unrelated to the scene. The reference for sphere and plate is the
closed form (rms over {single_turns} turns of the radar by fractions of a pixel; 81 920 triangles for the sphere). The
reference for arm and human is a dense integration (rms over {aspects} views).

## Flat surfaces

{flat}

Each row has {placements} random placements, 0.3 to 3 m away, with edges of 1 to 30 cm or radii of 1 to 15 cm. Boxes and
partly hidden plates are tilted by up to 70 degrees. An error is the cross-section of the complex difference from the
reference, at the distance of the target, mean over eight frequencies: median and worst placement. All bodies are
static. "echo" is the median cross-section. Level and phase are the largest errors of echoes above {strong:g} m² at any
frequency. "rays" and "paths" of the first frame and "ms", the CPU time of the second, are medians. The second frame
reuses the rays of the first.

Adaptive sampling integrates plates, and faces of boxes, along their outline, and adds a mirror image. Partly hidden
plates are sampled by cells, as curved surfaces are. Largest errors by default, and in brackets at an `rcs_floor` of
1e-04 m²:

{flat_lines}

## References

{references}

All of them are physical optics, with the [limits of that model](../../docs/accuracy.md#limits-of-the-model). They are
in `benches/proof/`: `closed_forms.py`, `faces.py`, `exact.py`, `corners.py`, `targets.py`, `dense.py`.

## Bounds

{bounds}

Bounds and measured errors: worst and median over the targets of a kind. The error of a single body is an rms over 64
frequencies and six turns of the radar, or the largest of these ("any turn and frequency"). A real mesh has one error
per view. Tests hold the bounds of the default setting: `test_closed_forms.py`, `test_flat_surfaces.py`,
`test_exact_surfaces.py` and `test_accuracy_meshes.py` in `tests/simulate/`.

## Specular targets

{mirror}

Errors of level and phase of the echo of the whole target, rms over 64 frequencies from 57 to 64 GHz and six turns of
the radar by fractions of a pixel. "worst" is the rms of the worst turn, often the one where the target is symmetric on
the pixel grid. "Pixels" is the side of the square image, 60 degrees wide unless stated otherwise, or the `rcs_floor` of
adaptive sampling. "rays" and "paths" belong to the first turn. "cost" is the run time of a frame (one chirp of 64
samples, no reuse of earlier frames) relative to 256 x 256 footprints of the same target in the same run.

Footprint errors shrink with the pixels; the staircase at the edges of plates is the last to vanish. `point` need not
converge at all. Adaptive sampling integrates flat surfaces along their outline and puts rays where the phase of curved
ones is stationary; the remaining error of a sphere at the lowest floor is the error of its mesh. A plane wider than the
image is an infinite mirror for adaptive sampling, since the border of the image is no edge; pixels fine enough to
follow the phase see an edge there.

## Tilted walls and plates

{oblique}

The wall should return nothing. Its level is relative to a mirror at the same distance, λ / (8 π d), rms over 57 to 64
GHz and the turns, with the antenna gain exp(-(az² + el²) / 0.08) straight ahead; -inf means that no path is left. The
edges of the tilted square do return an echo: its entry is the error, relative to the echo of the same square at normal
incidence.

## Doppler

{doppler}

A sphere of 10 cm recedes at a constant 0.5 m/s from a distance of 1 m, over 128 chirps, with Hann windows. Each entry
is the strongest Doppler line more than 16 bins from the peak, relative to the peak [dB], at the range of the peak; the
side lobes of the window are at -76 dB there. One frame samples its points once and moves them. A new cast per chirp
hits other points every time, and sampling errors appear as motion.

## Corner reflectors

{corners}

Paths of two and three reflections at 60 GHz, from at most {corner_side} x {corner_side} rays in an image slightly wider
than the corner; edges and legs are 10 cm. "rays" counts the rays of all reflections and of adaptive cells. At {far:g} m
the references are far-field cross-sections. Near the radar, the reference of the triangular trihedral is its apparent
cross-section with R to its apex: mirror images of the antenna and physical optics on the last plate, summed over points
(`near_db` in `benches/proof/corners.py`), without rays. Rims of the plates before the last one diffract in neither.

{near}

Near the radar these rims matter. A scalar integral over all three plates (`integral_near_db`) gives another
cross-section, relative to the far field, than the mirror images and the frames. Neither is exact: the difference is the
uncertainty of the model there.

The last column of the upper table is the phase relative to the apex, for the dihedral up to its sign. Adaptive sampling
casts its own rays for single reflections, and quarters the pixels of `footprint` for multiple ones. A dihedral turned
by 45 degrees about the boresight returns {null:.0f} dB of its upright echo to vertically polarized antennas; in theory
it returns nothing.

## Real meshes

{meshes}

## Exact surfaces

{surfaces}

Meshes of three resolutions against the exact surface: a capsule (radius 6 cm, length 40 cm) and a tube of the same size
whose rims are rounded with 1 cm, at 1.2 m; a person of six ellipsoids with shadows on each other, at 2.5 m. "error of
reference" is the difference between the profiles with all and with two thirds of the nodes per axis. The rows of dense
integration use the method of the references for real meshes. Their error therefore estimates the error of those
references.

## Diffuse targets

{matt}

Deviation from the mean power over all random phases, for albedo 1: of the sum of the powers of the paths, and of the
power of the samples averaged over seeds, with its standard error. Adaptive sampling distributes diffuse points over the
disc by area, with a density that grows as the floor falls. The first number shows the accuracy. One seed is one draw of
an exponential distribution (speckle), as is a measurement of one diffuse surface, so the standard error of the second
number falls only with the square root of the number of seeds.

## Cross-sections

{sections}

`rc.rcs` at 60 GHz, along the normal, along the axis of the corner, or broadside. Edges, legs and radii are 10 cm; the
cylinder has a length of 10 cm and a radius of 5 cm. Closed forms are geometrical and physical optics for electrically
large targets. The rims of trihedrals are staircases of the rays.
"""

REFERENCES = [
    ["closed form", "sphere, disc, plates, walls", "exponential integrals; cylinder: Gauss-Legendre", "nothing"],
    ["exact surface", "capsule, tube, person", "Gauss-Legendre over the surface, shadows by roots", "nothing"],
    ["mirror images", "near trihedral", "physical optics on the last plate, by points", "nothing"],
    ["far field", "corners far away, cross-sections", "geometrical and physical optics", "nothing"],
    [FACES, "plates, boxes", "Gauss-Legendre over visible faces", "nothing"],
    [DENSE, "arm, human, room", "sum over tens of millions of rays", "distances to its smooth surfaces"],
    ["Lambert's law", "matt targets", "integrals over the solid angle", "nothing"],
]
"""Rows of the table of references."""

MESH_TEXT = """\
{table}

Targets: a UR10 (collision meshes, 5 862 triangles) in {aspects} postures, a human (109 000 triangles) at {aspects}
headings, both as conductors, and both in a room of 5.2 x 4.4 x 2.6 m with walls that return 12 dB less, through a beam
of 30 degrees, in {rooms} views. Each entry is the worst view, with the median of the views in brackets:

- strongest: error of the level of the strongest peak;
- peaks: rms error of the levels of all peaks within 30 dB of the strongest;
- profile: relative error of the whole complex range profile;
- floor: rms error in ranges between the nearest and the farthest surface where the profile is more than 40 dB below its
  strongest peak, relative to that peak.

"rays" is the mean number cast, "ms" the median time of a frame of one chirp and 512 samples. The floor of the default
follows the echo, and is 0.01 m² for strong ones; fast sampling has 0.1 m².

Every view at the default setting. `tests/simulate/test_accuracy_meshes.py` holds these numbers within a factor of 1.3:

{view_table}

Every peak within 30 dB of the strongest, with the errors of the default setting and of the reference:

{peak_table}

The reference is our own dense integration of the same meshes. Its distances are radarcore depth images of the smooth
surfaces behind the meshes. It tests the sampling and the sum. {embree}

The integration is (j / 4π) Σ Γ √(G_t G_r) exp(-2jkR) dΩ over {million_rays:.0f} million rays per view, with a spacing
of {pitch:g} mrad in each of {shifts} images, between which the radar turns by fractions of a pixel; the spacing of rays
to the walls is {wall_pitch:g} mrad. From the difference between two halves of the images, the error of the reference is
about {own_alone:.1f} % for arm and human and {own_room:.1f} % for the room, in the worst view. The same integration of
a sphere of 10 cm at 1 m is {sphere_fine:.1f} % off its closed form with {triangles_fine} triangles, and
{sphere_usual:.1f} % off with the {triangles_usual} triangles of the default mesh. Most of that difference is the limb
of the mesh. The integrations are kept in `benches/proof/real_meshes.npz`; `python benches/references.py` makes them
again and compares.
"""

EMBREE_TEXT = """\
The tracer hardly matters: with distances by Embree (embreex) to the same facets, range profiles of the first posture
and the first heading change by at most {tracer:.2f} %. The choice of the surface matters: profiles of plain facets
differ by {arm:.0f} % (arm) and {human:.0f} % (human) from profiles of the smooth surfaces. [Exact
surfaces](#exact-surfaces) shows which is right.
"""


def thousands(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def embree_text(run: Run) -> str:
    """Comparison with distances by Embree, or how to install it."""
    if not embree.is_available():
        return embree.INSTALL_HINT[0].upper() + embree.INSTALL_HINT[1:]
    arm, human = tracer_checks(run)
    tracer = 100.0 * max(arm.tracer, human.tracer)
    return EMBREE_TEXT.format(tracer=tracer, arm=100.0 * arm.surface, human=100.0 * human.surface).strip()


def write_picture() -> None:
    """Draw the picture of the stored points."""
    picture(read_points(POINTS)).savefig(PICTURE, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description="Error of frames against closed forms and dense integration.")
    parser.add_argument("--tiny", action="store_true", help="once, on few rays")
    parser.add_argument("--write", action="store_true", help="write both pages and the picture")
    parser.add_argument("--picture", action="store_true", help="draw the picture of the results as they are")
    arguments = parser.parse_args()
    if arguments.picture:
        write_picture()
        return
    run = TINY if arguments.tiny else FULL
    texts: dict[str, str] = {}

    def show(name: str, text: str) -> None:
        """Keep a part of the page, and print it."""
        texts[name] = text
        print(text, end="\n\n", flush=True)

    columns = ["target", "sampling", "pixels", "error [dB]", "worst [dB]", "error [rad]", "rays", "paths", "cost"]
    mirror = list(mirror_results(run))
    show("mirror", table(columns, mirror_rows(mirror, run)))
    flat = list(flat_results(run))
    columns = ["target", "setting", "echo [m²]", "error [m²]", "worst [m²]", "level [dB]", "phase [rad]"]
    show("flat", table([*columns, "rays", "paths", "ms"], flat_rows(flat)))
    oblique = list(oblique_results(run))
    columns = ["target", "sampling", "pixels", "rays", "paths", "dB"]
    show("oblique", table(columns, quiet_rows(oblique)))
    doppler = list(doppler_results(run))
    show("doppler", table(["rays of", *columns[1:5], "floor [dB]"], quiet_rows(doppler)))
    columns = ["corner", "at [m]", "polarisation", "sampling", "rays", "dBsm", "on paper", "error [dB]", "error [rad]"]
    show("corners", table(columns, corner_rows(list(corner_results(run)))))
    show("near", table(["at [m]", "mirror images [dB]", "all plates [dB]", "difference [dB]"], near_rows(run)))
    matt = list(matt_results(run))
    columns = ["target", "pixels", "paths", "power of the paths", f"mean of {run.seeds} seeds"]
    show("matt", table(columns, matt_rows(matt)))
    columns = ["target", "polarisation", "reflections", "dBsm", "on paper", "error [dB]"]
    show("sections", table(columns, section_rows(run)))

    surfaces = list(surface_results(run))
    columns = [
        "target",
        "triangles",
        "summed by",
        "strongest [dB]",
        "peaks [dB]",
        "profile [%]",
        "error of reference [%]",
    ]
    show("surfaces", table(columns, surface_rows(surfaces)))
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
                view_table=table(VIEW_COLUMNS, view_rows(meshes)),
                peak_table=table(
                    ["scene", "view", "range [m]", "level [dB]", "error [dB]", "error of reference [dB]"],
                    peak_rows(meshes),
                ),
                embree=embree_text(run),
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
        *single_bounds([row for rows in mirror for row in rows]),
        *flat_bounds(flat),
        *quiet_bounds(oblique, doppler),
        *surface_bounds(surfaces),
        *mesh_bounds(meshes),
        *matt_bounds(matt),
    ]
    columns = ["what", "quantity", "reference", "bound", "worst", "median", "held"]
    show("bounds", table(columns, bound_rows(bounds)))
    default = table(columns[:-1], [row[:-1] for row in bound_rows(default_bounds(bounds))])

    points = [*single_points(run), *mesh_points(meshes)]
    show(
        "times", table(["target", "sampling", "reference", *(f"{most:g} ms" for most in WITHIN_MS)], time_rows(points))
    )
    # In a tiny run the columns of one target stand for all.
    drawn = points if run is FULL else [p for p in points if p.target == points[0].target]
    picture(drawn).savefig(io.BytesIO(), dpi=100)
    if arguments.write:
        unheld = "\n".join(unheld_lines(bounds))
        summary = SUMMARY_TEXT.format(machine=machine(), bounds=default, unheld=unheld)
        write_points(POINTS, points)
        write_picture()
        page = PAGE_TEXT.format(
            machine=machine(),
            single_turns=len(range(0, run.turns, 2)),
            aspects=run.aspects,
            placements=run.placements,
            strong=STRONG,
            flat_lines="\n".join(flat_lines()),
            corner_side=run.corner_side,
            far=FAR,
            references=table(["reference", "of", "is", "code shared with radarcore"], REFERENCES),
            null=null_db(run),
            **texts,
        )
        ACCURACY.write_text(page, encoding="utf-8")
        write_section(PAGE, "accuracy", summary)


if __name__ == "__main__":
    main()
