"""A person near an arm, from samples to the distance to keep: detection, tracks, distances, false tracks, time.

python benches/separation.py         print the tables
python benches/separation.py --write also write the section of docs/separation.md
python benches/separation.py --tiny  a few frames

A UR10 swings a radar on its flange by +-15 degrees in a room with a table, while a person walks or stands in front of
it. The truth is the distance between the surfaces of person and arm, by all vertices of their meshes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import binomtest

import radarcore as rc
from page import DOCS, machine, table, write_section

RATE, NUM_SEEDS, NUM_FRAMES, NUM_EMPTY = 40.0, 10, 200, 7200

TEXT = """\
## Errors and time

A UR10 swings the radar on its flange by +-15 degrees in a room with a table. Somebody walks towards it at 0.6 to
1.2 m/s, turns 1 to 1.4 m before it and leaves, or stands 1 to 4 m from it and at least 0.5 m from table and walls:
{num_seeds} persons each, {num_frames} frames at 40 Hz, with the settings above and
`static_map=StaticMap.of([room, table])`. Written by `python benches/separation.py --write`.

Detected, tracked: a detection, a confirmed track within 0.5 m of the trunk, seen from above. SNR: of the strongest cell
of the person, mean of the channels. In brackets: 95 % intervals.

{by_range}

{by_snr}

`rc.processing.breathing` at the place of the track, after 6 s, by a still and by a moving radar:

{breathing}

A false track is farther than 0.5 m from the person. Distances are between the surfaces, seen from above.

{tracks}

{empty}

Standing 0.1 to 0.5 m before another wall, or 0.9 m beside a metal plate at the same range, from the start. Unobserved:
`are_observable` is False for the place.

{near}

Processor time of one frame on one thread ({machine}, shared with others):

{times}
"""

Array = NDArray[np.float64]

FOUND = 0.5
"""Largest distance of detections and tracks from a trunk, seen from above [m]."""

RADAR = rc.bgt60tr13c(max_velocity=6.0)
ARM = rc.models.RobotArm.ur10().moving(
    lambda t: np.deg2rad([15.0 * np.sin(1.5 * t), -112.0, 134.6, -22.6, 90.0, 0.0]), base=rc.Pose([0.0, 0.0, 0.7])
)
MOTION = rc.Attached(ARM.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0)
LINKS = ARM.bodies()
ROOM = rc.Body(
    rc.shapes.box([7.0, 6.0, 2.8]), material=rc.materials["plasterboard"], motion=rc.Pose([2.5, 0.0, 1.4]), name="room"
)
TABLE = rc.Body(
    rc.shapes.box([0.8, 1.4, 0.04]), material=rc.materials["wood"], motion=rc.Pose([2.2, -1.9, 0.75]), name="table"
)
KNOWN = rc.processing.StaticMap.of([ROOM, TABLE])


class Row(NamedTuple):
    """A frame with a person."""

    range: float
    """Of the trunk [m]."""
    snr_db: float
    is_detected: bool
    is_tracked: bool
    is_observable: bool
    """The place, by the map."""
    num_false: int
    """False tracks."""
    error: float
    """Of the distance [m]; NaN without one."""


def walking(rng: np.random.Generator) -> rc.models.Human:
    speed, nearest, y, side = rng.uniform(0.6, 1.2), rng.uniform(1.4, 1.8), rng.uniform(-0.3, 0.3), rng.choice([-1, 1])
    path = [[rng.uniform(3.2, 4.4), y - 0.6 * side], [nearest, y - 0.45 * side], [nearest, y + 0.45 * side], [5.0, y]]
    return rc.models.Human(height=rng.uniform(1.6, 1.9), speed=speed, path=path, turn_radius=0.2, phase=rng.uniform())


def standing(rng: np.random.Generator) -> rc.models.Human:
    while True:
        distance, azimuth = rng.uniform(1.0, 4.0), np.deg2rad(rng.uniform(-35.0, 35.0))
        place = np.array([0.4, 0.0]) + distance * np.array([np.cos(azimuth), np.sin(azimuth)])
        around = [[*place + 0.75 * np.array([np.cos(b), np.sin(b)]), 0.75] for b in np.linspace(0.0, 6.0, 16)]
        if KNOWN.distances(around).min() > 0.1 and abs(place[1]) < 2.25:
            bearing = rng.uniform(0.0, 2.0 * np.pi)
            path = [place, place + np.array([np.cos(bearing), np.sin(bearing)])]
            return rc.models.Human(height=rng.uniform(1.6, 1.9), speed=0.0, path=path, phase=rng.uniform())


PEOPLE: dict[str, Callable[[np.random.Generator], rc.models.Human]] = {"walking": walking, "standing": standing}


def above(bodies: list[rc.Body], when: float) -> Array:
    """All vertices of bodies, seen from above (n, 2) [m]."""
    return np.concatenate([body.motion.at(when).apply(body.mesh.vertices)[:, :2] for body in bodies])


def peak_db(frame: rc.Frame) -> float:
    """SNR of the strongest cell, mean of the channels [dB]."""
    power = np.sum(np.square(np.abs(rc.processing.range_doppler(frame))), axis=0)
    return float(10.0 * np.log10(power.max() / rc.processing.noise_level(power, num_looks=len(frame.cube))))


def simulator(bodies: list[rc.Body]) -> rc.Simulator:
    return rc.Simulator(rc.Scene(bodies), RADAR, radar_motion=MOTION)


def tracker() -> rc.Tracker:
    return rc.Tracker(MOTION, KNOWN, targets="people", velocity_ambiguity=2.0 * RADAR.max_velocity)


def followed(kind: str, seed: int, num_frames: int, times: dict[str, list[float]]) -> tuple[list[Row], int]:
    """Frames with a person, and the number of tracks at the person; adds the times of the stages [ms]."""
    person = PEOPLE[kind](np.random.default_rng(seed))
    body, trunk, following = person.bodies(), person.segment_motion("trunk"), tracker()
    everything, alone = simulator([ROOM, TABLE, *body]), simulator(body)
    rows: list[Row] = []
    ids: set[int] = set()
    for k in range(num_frames):
        frame = everything.frame(k / RATE)
        marks = [time.thread_time()]
        found = rc.detect(frame)
        marks.append(time.thread_time())
        states = [state for state in following.update(found) if state.is_confirmed]
        marks.append(time.thread_time())
        separations = rc.separation(states, LINKS)
        marks.append(time.thread_time())
        for stage, spent in zip(times, [*np.diff(marks), marks[-1] - marks[0]], strict=True):
            times[stage].append(1e3 * spent)

        sensor, place = MOTION.at(found.time), trunk.at(found.time).position
        off = np.linalg.norm(sensor.apply(found.position)[:, :2] - place[:2], axis=1)
        near = [bool(np.linalg.norm(state.position[:2] - place[:2]) < FOUND) for state in states]
        ids |= {state.id for state, is_near in zip(states, near, strict=True) if is_near}
        distances, _ = cKDTree(above(LINKS, found.time)).query(above(body, found.time))
        own = [one for one in separations if any(n and s.id == one.track for n, s in zip(near, states, strict=True))]
        error = own[0].distance - float(np.min(distances)) if own else np.nan
        distance = float(np.linalg.norm(place - sensor.position))
        is_detected = bool((off < FOUND).any())
        is_observable = is_seen(KNOWN, place, found)
        level_db = peak_db(alone.frame(k / RATE))
        rows.append(Row(distance, level_db, is_detected, any(near), is_observable, near.count(False), error))
    return rows, len(ids)


def is_seen(known: rc.processing.StaticMap, place: Array, found: rc.Detections) -> bool:
    """True if, by the map, a person who stands at a place (x, y) would be seen."""
    height = MOTION.at(found.time).position[2]
    return bool(known.are_observable([[*place[:2], height]], found, MOTION)[0])


def surfaces(person: rc.models.Human, rng: np.random.Generator) -> dict[str, rc.Body]:
    """A wall behind a person, and a metal plate at the same range."""
    place, sensor = np.array(person.path.waypoints[0]), MOTION.at(0.0).position
    behind = above(person.bodies(), 0.0)[:, 0].max() + rng.uniform(0.1, 0.5)
    radius, bearing = np.linalg.norm(place - sensor[:2]), np.arctan2(*(place - sensor[:2])[::-1])
    bearing -= np.sign(bearing) * 0.9 / radius
    c, s = np.cos(bearing), np.sin(bearing)
    turned, where = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], [*(sensor[:2] + radius * np.array([c, s])), sensor[2]]
    return {
        "before a wall": rc.Body(
            rc.shapes.box([0.1, 5.0, 2.8]), material=ROOM.material, motion=rc.Pose([behind + 0.05, 0.0, 1.4])
        ),
        "beside a plate": rc.Body(
            rc.shapes.box([0.05, 0.4, 0.8]), material=rc.materials["metal"], motion=rc.Pose(where, turned)
        ),
    }


def near_surfaces(num_seeds: int, num_frames: int) -> dict[str, list[tuple[bool, bool]]]:
    """Flags of every frame: the person has a track, the place is observable."""
    seen: dict[str, list[tuple[bool, bool]]] = {}
    for seed in range(num_seeds):
        rng = np.random.default_rng(200 + seed)
        person = standing(rng)
        place = np.array(person.path.waypoints[0])
        for kind, body in surfaces(person, rng).items():
            everything = simulator([ROOM, TABLE, body, *person.bodies()])
            known = rc.processing.StaticMap.of([ROOM, TABLE, body])
            following = rc.Tracker(MOTION, known, targets="people", velocity_ambiguity=2.0 * RADAR.max_velocity)
            for k in range(num_frames):
                found = rc.detect(everything.frame(k / RATE))
                states = [state for state in following.update(found) if state.is_confirmed]
                is_tracked = any(np.linalg.norm(state.position[:2] - place) < FOUND for state in states)
                seen.setdefault(kind, []).append((is_tracked, is_seen(known, place, found)))
    return seen


def false_tracks(num_frames: int) -> int:
    """Confirmed tracks in a room without people."""
    empty, following = simulator([ROOM, TABLE]), tracker()
    ids: set[int] = set()
    for k in range(num_frames):
        ids |= {state.id for state in following.update(rc.detect(empty.frame(k / RATE))) if state.is_confirmed}
    return len(ids)


def objects(rng: np.random.Generator) -> dict[str, list[rc.Body]]:
    """Somebody who stands and breathes, a statue of the same shape, a metal post and a metal cabinet."""
    person = standing(rng)
    place, bearing = person.path.waypoints[0], rng.uniform(0.0, 2.0 * np.pi)
    statue = rc.models.Human(height=person.height, speed=0.0, path=person.path.waypoints, breathing=None)
    c, s = np.cos(bearing), np.sin(bearing)
    turned, metal = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), rc.materials["metal"]
    return {
        "person": person.bodies(),
        "statue": statue.bodies(),
        "post": [rc.Body(rc.shapes.cylinder(0.05, 1.6), material=metal, motion=rc.Pose([*place, 0.8]))],
        "cabinet": [rc.Body(rc.shapes.box([0.5, 0.6, 1.3]), material=metal, motion=rc.Pose([*place, 0.65], turned))],
    }


def breathing_table(num_seeds: int, rate: float) -> str:
    """Answers of `breathing` at the place of the first track, by a radar that rests and by the swinging one."""
    counts: dict[tuple[str, str], list[str]] = {}
    for seed in range(num_seeds):
        for kind, bodies in objects(np.random.default_rng(100 + seed)).items():
            for name, motion in (("still", MOTION.at(0.0)), ("moving", MOTION)):
                seen = rc.Simulator(rc.Scene([ROOM, TABLE, *bodies]), RADAR, radar_motion=motion)
                frames = [seen.frame(k / rate) for k in range(int(6.0 * rate) + 1)]
                following = rc.Tracker(motion, KNOWN, targets="people", velocity_ambiguity=2.0 * RADAR.max_velocity)
                last = [state for frame in frames for state in following.update(rc.detect(frame)) if state.is_confirmed]
                answer = "None"
                if last:
                    answer = str(rc.processing.breathing(frames, last[-1].position, motion).is_breathing)
                counts.setdefault((kind, name), []).append(answer)
    answers = {"True": "breathes", "False": "static", "None": "not certain"}
    rows = []
    for kind in objects(np.random.default_rng(100)):
        both = [counts[kind, name] for name in ("still", "moving")]
        rows.append([kind, *(", ".join(str(each.count(answer)) for each in both) for answer in answers)])
    return table(["object", *answers.values()], rows)


def share(hits: list[bool]) -> str:
    """Percentage of hits with its interval."""
    low, high = binomtest(sum(hits), len(hits)).proportion_ci(method="wilson")
    return f"{100.0 * np.mean(hits):.1f} ({100.0 * low:.0f}-{100.0 * high:.0f})"


def rates(rows: dict[str, list[Row]], name: str, edges: list[float], unit: str) -> str:
    """Table of detection rates in bins of a field."""
    lines = []
    for kind, frames in rows.items():
        for low, high in pairwise(edges):
            inside = [row for row in frames if low <= getattr(row, name) < high]
            if len(inside) >= 20:
                rate = [share([row.is_detected for row in inside]), share([row.is_tracked for row in inside])]
                lines.append([kind, f"{low:g}-{high:g}", str(len(inside)), *rate])
    header = [
        "person",
        f"{name.removesuffix('_db')} [{unit}]",
        "frames",
        "detected [%]",
        "tracked [%]",
    ]
    return table(header, lines or [["-"] * len(header)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/separation.md")
    options = parser.parse_args()
    num_seeds, num_frames, num_empty = (1, 6, 6) if options.tiny else (NUM_SEEDS, NUM_FRAMES, NUM_EMPTY)
    times: dict[str, list[float]] = {"detect": [], "track": [], "separation": [], "all": []}
    runs = {kind: [followed(kind, seed, num_frames, times) for seed in range(num_seeds)] for kind in PEOPLE}
    rows = {kind: [row for each, _ in of_kind for row in each] for kind, of_kind in runs.items()}
    columns = []
    for kind, frames in rows.items():
        errors = np.array([row.error for row in frames if np.isfinite(row.error)] or [np.nan])
        low, middle, high = np.percentile(errors, [5, 50, 95])
        columns.append(
            [
                share([row.is_tracked for row in frames]),
                f"{np.mean([number for _, number in runs[kind]]):.1f}",
                share([row.num_false > 0 for row in frames]),
                f"{middle:+.3f}",
                f"{low:+.3f} to {high:+.3f}",
            ]
        )
    quantities = ["frames with a track at the person [%]", "tracks per person", "frames with false tracks [%]"]
    quantities += ["error of the distance, median [m]", "5 to 95 % [m]"]
    lines = [[name, *values] for name, *values in zip(quantities, *columns, strict=True)]
    tables: dict[str, Any] = {
        "breathing": breathing_table(num_seeds, 10.0 if options.tiny else RATE),
        "by_range": rates(rows, "range", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "m"),
        "by_snr": rates(rows, "snr_db", [0.0, 18.0, 24.0, 30.0, 36.0, 60.0], "dB"),
        "tracks": table(["quantity", *rows], lines),
        "empty": f"Without people: {false_tracks(num_empty)} tracks in {num_empty / RATE / 60.0:.1f} min.",
        "times": table(
            ["stage", "median [ms]", "95 % [ms]"],
            [[name, f"{np.median(each):.2f}", f"{np.percentile(each, 95):.2f}"] for name, each in times.items()],
        ),
    }
    near = {"far from surfaces": [(row.is_tracked, row.is_observable) for row in rows["standing"]]}
    lines = []
    for kind, frames_near in (near | near_surfaces(num_seeds, num_frames)).items():
        tracked, observable = np.array(frames_near).T
        lines.append([kind, *(share(each.tolist()) for each in (tracked, ~observable, tracked | ~observable))])
    tables["near"] = table(["standing", "tracked [%]", "unobserved [%]", "either [%]"], lines)
    print("\n\n".join(tables.values()))
    if options.write:
        text = TEXT.format(num_seeds=num_seeds, num_frames=num_frames, machine=machine(), **tables)
        write_section(DOCS / "separation.md", "separation", text)


if __name__ == "__main__":
    main()
