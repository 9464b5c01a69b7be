"""Range profiles of real meshes, an arm, a human and both in a room, against a dense integration of the same meshes."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from proof.closed_forms import sphere_echo
from proof.dense import Dense, Tracer, dense, facets, smooth_surfaces
from proof.embree import embree_facets
from proof.measure import (
    FULL,
    SPEED_OF_LIGHT,
    Phasors,
    Reals,
    Run,
    conductor,
    decibels,
    floor_text,
    frame,
    frequencies,
    rms,
    sweep,
)
from radarcore.models import robots
from radarcore.models.people.human import Human
from radarcore.models.robots.arm import RobotArm

INSTALL_HINT = "the extra `robots` is not installed, real meshes are left out: pip install radarcore[robots]"

WAVEFORM = sweep(512)
"""13.7 MHz between samples: unambiguous up to 11 m."""

RADAR = rc.Radar(WAVEFORM)
INDOOR_RADAR = rc.Radar(WAVEFORM, pattern=rc.GaussianPattern(0.0, 30.0, 30.0))
"""Whose beam fades towards the border of the image, where walls end that do not end in truth."""

OVERSAMPLING = 4
"""Points of a range profile per range bin."""

PEAKS_DB = 30.0
"""Peaks within this of the strongest are compared."""

EMPTY_DB = 40.0
"""Ranges where the profile is this far below its strongest peak are empty: the error there is the floor."""

POSTURES_DEG = (
    (0.0, -100.0, 80.0, -70.0, -90.0, 0.0),
    (40.0, -60.0, 70.0, -100.0, -60.0, 30.0),
    (150.0, -120.0, -80.0, 20.0, 70.0, 0.0),
    (-80.0, -80.0, 110.0, -120.0, -90.0, 45.0),
)
"""Joint angles of the arm."""

HEADINGS_DEG = (0.0, 40.0, 90.0, 180.0)
"""Of the human; at 0 he faces the radar."""


@dataclass(frozen=True)
class View:
    """A scene before the radar."""

    group: str
    name: str
    """Within its group."""
    scene: rc.Scene
    radar: rc.Radar
    radar_motion: rc.Pose
    background: tuple[int, ...] = ()


def views(run: Run) -> Iterator[View]:
    if not robots.is_available():
        return
    for number, posture in enumerate(POSTURES_DEG[: run.aspects], 1):
        yield View("arm at 1.2 m", f"posture {number}", rc.Scene(arm(posture, [1.25, 0.0, -0.55])), RADAR, rc.Pose())
    for heading in HEADINGS_DEG[: run.aspects]:
        scene, motion = rc.Scene(human(heading, [2.5, 0.0])), rc.Pose([0.0, 0.0, 0.9])
        yield View("human at 2.5 m", f"heading {heading:g}°", scene, RADAR, motion)
    for number, yaw in list(enumerate(np.deg2rad([8.0, -5.0])))[: run.rooms]:
        walls = rc.Body(
            rc.shapes.box([5.2, 4.4, 2.6]), material=rc.Material(-0.25), motion=rc.Pose([1.6, 0.1, 1.3]), name="walls"
        )
        bodies = [
            walls,
            *arm(POSTURES_DEG[3 * number], [1.25, 0.25, 0.4]),
            *human(HEADINGS_DEG[number], [2.5, -0.5]),
        ]
        motion = rc.Pose.from_rpy([0.0, 0.0, 1.0], [0.0, 0.0, yaw])
        yield View("room with both", f"view {number + 1}", rc.Scene(bodies), INDOOR_RADAR, motion, background=(0,))


@cache
def arm_of_meshes() -> RobotArm:
    return RobotArm.named("ur10")


def arm(posture_deg: Iterable[float], base: list[float]) -> list[rc.Body]:
    joint_angles = np.deg2rad(list(posture_deg))
    return arm_of_meshes().moving(joint_angles, rc.Pose(base)).bodies(material=rc.materials["perfect_conductor"])


@cache
def human_of_meshes() -> list[rc.Body]:
    """At the origin, facing +x."""
    human = Human(speed=0.0, path=[[0.0, 0.0], [1.0, 0.0]], breathing=None)
    return human.mesh_bodies(material=rc.materials["perfect_conductor"])


def human(heading_deg: float, place: list[float]) -> list[rc.Body]:
    floor = rc.Pose.from_rpy([*place, 0.0], [0.0, 0.0, np.pi + np.deg2rad(heading_deg)])
    return [
        rc.Body(body.mesh, material=body.material, motion=floor @ body.motion, name=body.name)
        for body in human_of_meshes()
    ]


# Errors of profiles.


def profile(transfer_function: Phasors) -> Phasors:
    """Range profile with a Hann window, (range,); see `ranges`."""
    windowed = transfer_function * np.hanning(len(transfer_function))
    transformed: Phasors = np.fft.ifft(windowed, OVERSAMPLING * len(transfer_function))
    return transformed


def ranges() -> Reals:
    step = WAVEFORM.slope / WAVEFORM.sample_rate
    num_bins = OVERSAMPLING * WAVEFORM.num_samples
    bins: Reals = SPEED_OF_LIGHT / (2.0 * step * num_bins) * np.arange(num_bins)
    return bins


def below(decibels_down: float) -> float:
    return float(10.0 ** (-0.05 * decibels_down))


@dataclass(frozen=True)
class ProfileErrors:
    """Of a range profile against a reference."""

    strongest: float
    """Of the level of the strongest peak [dB]."""
    peaks: float
    """Of the levels of all peaks within `PEAKS_DB` of it, rms [dB]."""
    relative: float
    """L2 norm of the complex difference relative to the reference."""
    floor: float
    """Rms difference where the reference is more than `EMPTY_DB` below the strongest peak, over that peak [dB]."""


def profile_errors(got: Phasors, expected: Phasors, nearest: float, farthest: float) -> ProfileErrors:
    """From transfer functions; floors between the nearest and the farthest surface [m]."""
    mine, theirs = profile(got), profile(expected)
    size = np.abs(theirs)
    is_empty = size < below(EMPTY_DB) * size.max()
    is_empty &= (ranges() > nearest) & (ranges() < farthest)
    levels = decibels(np.abs(mine) / size)
    difference = np.abs(mine - theirs)
    return ProfileErrors(
        strongest=float(levels[size.argmax()]),
        peaks=rms(levels[is_peak(size)]),
        relative=float(np.linalg.norm(difference) / np.linalg.norm(size)),
        floor=float(decibels(rms(difference[is_empty]) / size.max())) if is_empty.any() else -np.inf,
    )


def is_peak(size: Reals) -> Any:
    """True at the local maxima of a profile within `PEAKS_DB` of its largest."""
    is_high = size > below(PEAKS_DB) * size.max()
    return is_high & (size > np.roll(size, 1)) & (size >= np.roll(size, -1))


# Ways to sample a scene.


@dataclass(frozen=True)
class Way:
    """A sampling and its setting: `number` is pixels along a side, or a floor [m²].

    The knob "default" has the default settings of the simulator.
    """

    sampling: str
    knob: str
    number: float

    @property
    def options(self) -> dict[str, Any]:
        """Of a simulator."""
        if self.knob == "default":
            return {}
        if self.knob == "pixels":
            return {"sampling": self.sampling, "resolution": int(self.number)}
        return {"sampling": self.sampling, "rcs_floor": self.number, "ray_budget": math.inf}

    @property
    def title(self) -> str:
        """Sampling and setting."""
        return f"{self.sampling}, {self.text}"

    @property
    def text(self) -> str:
        """Of the setting, in tables."""
        if self.knob == "default":
            return "default"
        return floor_text(self.number) if self.knob == "floor" else f"{int(self.number)} {self.knob}"


DEFAULT = Way("adaptive", "default", 0.0)


def ways(run: Run) -> list[Way]:
    return [
        *(Way("point", "pixels", side) for side in run.mesh_resolutions),
        *(Way("footprint", "pixels", side) for side in run.mesh_resolutions),
        DEFAULT,
        *(Way("adaptive", "floor", rcs_floor) for rcs_floor in run.mesh_floors),
    ]


@dataclass(frozen=True)
class Sampled:
    """Result and run time of a sampling."""

    way: Way
    rays: int
    seconds: float
    errors: ProfileErrors
    transfer_function: Phasors | None = None


def sampled(view: View, way: Way, reference: Dense) -> Sampled:
    """One frame with nothing known from frames before."""
    # Single reflections, as references have them.
    settings: dict[str, Any] = {"field_of_view_deg": (60.0, 60.0), "tolerance": 1e-6, "max_bounces": 1}
    sim = rc.Simulator(view.scene, view.radar, radar_motion=view.radar_motion, **settings, **way.options)
    start = time.perf_counter()
    got = frame(sim)
    seconds = time.perf_counter() - start
    transfer_function = np.conj(got.cube[0, 0])
    errors = profile_errors(transfer_function, reference.transfer_function, reference.nearest, reference.farthest)
    return Sampled(way, got.stats["rays_cast"], seconds, errors, transfer_function)


# References: kept, as they take minutes.

STORED = Path(__file__).with_suffix(".npz")
"""Dense integrations of all views, written by `python benches/references.py --write`."""


def integrated(view: View, pitch: float, shifts: int, tracer: Tracer = smooth_surfaces) -> Dense:
    """Dense integration of a view."""
    return dense(
        view.scene,
        view.radar,
        view.radar_motion,
        pitch=pitch,
        shifts=shifts,
        background=view.background,
        tracer=tracer,
    )


def reference_of(view: View, run: Run) -> Dense:
    """Dense integration of a view, from the file if the run asks for that."""
    if run is not FULL:
        return integrated(view, run.pitch, run.shifts)
    reference = stored_reference(view)
    if reference is None:
        raise ValueError(f"{STORED.name}: {view.group}, {view.name}, has changed: python benches/references.py --write")
    return reference


def stored_reference(view: View) -> Dense | None:
    """Dense integration of a view, as it is kept; None where that is of other meshes or poses."""
    with np.load(STORED) as file:
        key = f"{view.group}, {view.name}"
        if f"{key}: bodies" not in file or not np.allclose(file[f"{key}: bodies"], bodies_of(view), 1e-6, 1e-6):
            return None
        first, second = file[f"{key}: halves"].astype(complex)
        num_rays, nearest, farthest = file[f"{key}: rays and span"].tolist()
        return Dense((first, second), int(num_rays), nearest, farthest)


def stored_arrays(view: View, reference: Dense) -> dict[str, NDArray[Any]]:
    """Stored data of a view."""
    key = f"{view.group}, {view.name}"
    return {
        f"{key}: bodies": bodies_of(view),
        f"{key}: halves": np.array(reference.halves, dtype=np.complex64),
        f"{key}: rays and span": np.array([reference.num_rays, reference.nearest, reference.farthest]),
    }


def bodies_of(view: View) -> Reals:
    """Numbers that tell the bodies and their poses: triangles, mean vertex and mean square, as the radar has them."""
    rows = []
    for body in view.scene.bodies:
        vertices = view.radar_motion.inverse().apply(body.motion.apply(body.mesh.vertices))
        rows.append([len(body.mesh.triangles), *vertices.mean(axis=0), (vertices**2).mean()])
    return np.array(rows)


@dataclass(frozen=True)
class Peak:
    """A peak of the range profile of a reference."""

    range: float
    """[m]."""
    level: float
    """Relative to the strongest peak [dB]."""
    error: float
    """Of the level by the default sampling [dB]."""
    own_error: float
    """Of the level by the reference itself: half the difference of its two halves [dB]."""


@dataclass(frozen=True)
class ViewResult:
    """All ways for one view."""

    group: str
    name: str
    sampled: list[Sampled]
    peaks: list[Peak]
    own_error: float
    """Half the relative difference of the profiles from two halves of the images of the dense integration."""
    num_rays: int

    @property
    def default(self) -> ProfileErrors:
        """Errors of the default sampling."""
        return next(row.errors for row in self.sampled if row.way == DEFAULT)


def mesh_results(run: Run) -> Iterator[ViewResult]:
    for view in views(run):
        reference = reference_of(view, run)
        results = [
            sampled(view, way, reference)
            for way in ways(run)
            # A room is large: down to the lowest floors it takes millions of rays.
            if way.knob != "floor" or not view.background or way.number >= 1e-3
        ]
        profiles = [profile(half) for half in reference.halves]
        own_error = 0.5 * float(np.linalg.norm(profiles[0] - profiles[1]) / np.linalg.norm(0.5 * sum(profiles)))
        peaks = peaks_of(next(row.transfer_function for row in results if row.way == DEFAULT), reference)
        yield ViewResult(view.group, view.name, results, peaks, own_error, reference.num_rays)


def peaks_of(got: Phasors, reference: Dense) -> list[Peak]:
    """Peaks within `PEAKS_DB` of the strongest, with the errors of a frame and of the reference."""
    mine, theirs = np.abs(profile(got)), np.abs(profile(reference.transfer_function))
    levels = decibels(theirs / theirs.max())
    # Half the difference of the halves is what both are off: their phases count, as they are summed.
    spread = 0.5 * np.abs(np.subtract(*(profile(half) for half in reference.halves)))
    return [
        Peak(
            float(ranges()[index]),
            float(levels[index]),
            float(decibels(mine[index] / theirs[index])),
            float(decibels(1.0 + spread[index] / theirs[index])),
        )
        for index in np.flatnonzero(is_peak(theirs))
    ]


@dataclass(frozen=True)
class SphereCheck:
    """The dense integration of spheres against their closed form."""

    num_triangles: int
    error: float
    """Relative l2 error of the range profile."""
    own_error: float
    """As in `ViewResult`."""


def sphere_checks(run: Run) -> Iterator[SphereCheck]:
    """The default, 20 480 triangles, and four times the number."""
    wavenumbers = 2.0 * np.pi * frequencies(WAVEFORM) / SPEED_OF_LIGHT
    expected = sphere_echo(0.1, 1.0, wavenumbers)
    for mesh in (rc.shapes.sphere(0.1), rc.shapes.sphere(0.1, subdivisions=6)):
        got = integrated(View("", "", rc.Scene([conductor(mesh, 1.0)]), RADAR, rc.Pose()), run.pitch, run.shifts)
        span = got.nearest, got.farthest
        yield SphereCheck(
            len(mesh.triangles),
            profile_errors(got.transfer_function, expected, *span).relative,
            0.5 * profile_errors(*got.halves, *span).relative,
        )


@dataclass(frozen=True)
class TracerCheck:
    """Relative differences of range profiles of a mesh by dense integration."""

    tracer: float
    """Of distances by Embree and by radarcore, to the facets as they are."""
    surface: float
    """Of the facets as they are and the smooth surfaces."""


def tracer_checks(run: Run) -> Iterator[TracerCheck]:
    """The first posture of the arm and the first heading of the human."""
    for group in ("arm", "human"):
        view = next(view for view in views(run) if view.group.startswith(group))
        # The same rays: few are enough.
        embree, ours, smooth = (
            integrated(view, 3.0 * run.pitch, 4, tracer) for tracer in (embree_facets, facets, smooth_surfaces)
        )
        span = ours.nearest, ours.farthest
        yield TracerCheck(
            profile_errors(embree.transfer_function, ours.transfer_function, *span).relative,
            profile_errors(ours.transfer_function, smooth.transfer_function, *span).relative,
        )


# Tables.


def mesh_rows(results: list[ViewResult]) -> Iterator[list[str]]:
    """Worst and median over the views of a group."""
    for group in dict.fromkeys(result.group for result in results):
        of_group = [result for result in results if result.group == group]
        for rows in zip(*(result.sampled for result in of_group), strict=True):
            errors = [row.errors for row in rows]
            yield [
                group,
                rows[0].way.sampling,
                rows[0].way.text,
                str(round(np.mean([row.rays for row in rows]))),
                f"{1e3 * np.median([row.seconds for row in rows]):.0f}",
                worst_and_median([abs(e.strongest) for e in errors], 2),
                worst_and_median([e.peaks for e in errors], 2),
                worst_and_median([100.0 * e.relative for e in errors], 1),
                worst_and_median([e.floor for e in errors], 0),
            ]


PEAK_COLUMNS = ["scene", "view", "range [m]", "level [dB]", "error [dB]", "error of reference [dB]"]
VIEW_COLUMNS = ["scene", "view", "strongest [dB]", "peaks [dB]", "profile [%]", "floor [dB]", "error of reference [%]"]


def view_rows(results: list[ViewResult]) -> Iterator[list[str]]:
    """Every view at the default setting."""
    for result in results:
        e = result.default
        numbers = [f"{e.strongest:+.2f}", f"{e.peaks:.2f}", f"{100.0 * e.relative:.1f}", f"{e.floor:.1f}"]
        yield [result.group, result.name, *numbers, f"{100.0 * result.own_error:.1f}"]


def view_errors(page: str) -> dict[str, ProfileErrors]:
    """Errors of the default setting by group and view, from the table of `view_rows` in a page."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line[:1] == "|"]
    found = {}
    for row in cells[cells.index(VIEW_COLUMNS) + 2 :]:
        if len(row) != len(VIEW_COLUMNS):
            break
        strongest, peaks, relative, floor = map(float, row[2:6])
        found[f"{row[0]}, {row[1]}"] = ProfileErrors(strongest, peaks, 0.01 * relative, floor)
    return found


def peak_rows(results: list[ViewResult]) -> Iterator[list[str]]:
    """Every peak at the default setting."""
    for result in results:
        for p in result.peaks:
            numbers = [f"{p.range:.3f}", f"{p.level:.1f}", f"{p.error:+.2f}", f"{p.own_error:.2f}"]
            yield [result.group, result.name, *numbers]


def worst_and_median(values: list[float], digits: int) -> str:
    return f"{max(values):.{digits}f} ({np.median(values):.{digits}f})"
