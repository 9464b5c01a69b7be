"""Tracks of people in a room: one track for a walker, identities of people who meet.

python benches/people.py         print the tables
python benches/people.py --write also write the section of docs/tracking.md
python benches/people.py --tiny  a few frames

The room has three walls and a metal cylinder. Everybody walks on a random path. A frame goes through ``rc.detect`` and
``Tracker.update`` with ``targets="people"``.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from page import DOCS, table, write_section
from processing import CYLINDER, RATE, recording

TEXT = """\
## One person, one track

Random walks in a room of 4 x 4 m with three walls and a metal cylinder, `rc.bgt60tr13c()` at {rate:.0f} frames per
second, `rc.detect(frame)` and `Tracker.update` with `targets="people"`. Written by `python benches/people.py --write`.

{tables}
"""

Array = NDArray[np.float64]

ROOM = np.array([[1.0, -1.9], [4.9, 1.9]])
"""Nearest and farthest x and y of waypoints [m]."""

NUM_ALONE, NUM_TOGETHER = 10, 24
"""Walks of one person, and of four."""

NEAR, MEETING = 0.45, 1.0
"""People keep the first distance [m], from the cylinder too; pairs within the second one meet."""

SENSOR = np.array([0.0, 0.0, 1.0])
"""Place of the radar [m]."""

SETTLED = 20
"""Frames before and after a meeting in which the tracks of both are looked for."""

FOUND = 0.5
"""A track within this distance of a person follows this person [m]."""


@dataclass
class Walk:
    """Detections of every frame, and where the trunks of the people are."""

    radar: rc.Radar
    found: list[rc.Detections]
    position: Array
    """(frame, person, 2) in the plane [m]."""
    range: Array
    """(frame, person) [m]."""
    velocity: Array
    """(frame, person) [m/s]."""


def random_person(rng: np.random.Generator, duration: float) -> rc.models.Human:
    """Somebody on a random path through the room for a time [s]."""
    while True:
        speed, path = rng.uniform(0.6, 1.2), [rng.uniform(*ROOM)]
        while len(path) < 2.0 + speed * duration / 1.2:  # corners are cut: legs of 1.5 m get shorter
            point = rng.uniform(*ROOM)
            if np.linalg.norm(point - path[-1]) > 1.5:
                path.append(point)
        try:
            return rc.models.Human(height=rng.uniform(1.6, 1.9), speed=speed, path=path, phase=rng.uniform())
        except ValueError:  # a leg too short for its turns
            continue


def random_people(rng: np.random.Generator, number: int, duration: float) -> list[rc.models.Human]:
    """People who keep their distance from each other and from the cylinder."""
    times = np.arange(0.0, duration, 0.1)
    people: list[rc.models.Human] = []
    ways = [np.broadcast_to(CYLINDER[:2], (len(times), 2))]
    while len(people) < number:
        person = random_person(rng, duration)
        motion = person.segment_motion("trunk")
        way = np.array([motion.at(t).position[:2] for t in times])
        is_inside = bool(((way > ROOM[0] - 0.1) & (way < ROOM[1] + 0.1)).all())
        if is_inside and all(np.linalg.norm(way - other, axis=1).min() > NEAR for other in ways):
            people.append(person)
            ways.append(way)
    return people


def simulated(seed: int, number: int, num_frames: int) -> Walk:
    """Detections of people on random paths."""
    duration = num_frames / RATE
    people = random_people(np.random.default_rng(seed), number, duration)
    rec = recording(people, duration)
    found = [rc.detect(frame) for frame in rec.frames()]
    motions = [person.segment_motion("trunk") for person in people]
    times = np.array([one.time for one in found])
    position = np.array([[motion.at(time).position for motion in motions] for time in times]) - SENSOR
    ranges = np.linalg.norm(position, axis=2)
    return Walk(rec.radar, found, position[..., :2], ranges, np.gradient(ranges, times, axis=0))


def followed(walk: Walk) -> tuple[list[list[rc.processing.TrackState]], list[float]]:
    """Confirmed tracks of every frame, and the processor time of each update [s]."""
    tracker = rc.Tracker(targets="people", velocity_ambiguity=2.0 * walk.radar.max_velocity)
    frames, seconds = [], []
    for found in walk.found:
        start = time.thread_time()
        states = tracker.update(found)
        seconds.append(time.thread_time() - start)
        frames.append([state for state in states if state.is_confirmed])
    return frames, seconds


def identities(walk: Walk, frames: list[list[rc.processing.TrackState]]) -> NDArray[np.int64]:
    """Id of the track nearest to each person (frame, person); -1 without one."""
    ids = np.full(walk.range.shape, -1)
    for row, states, position in zip(ids, frames, walk.position, strict=True):
        for k, place in enumerate(position):
            distances = [float(np.linalg.norm(state.position[:2] - place)) for state in states]
            if distances and min(distances) < FOUND:
                row[k] = states[int(np.argmin(distances))].id
    return ids


def meetings(walk: Walk) -> list[tuple[int, int, int, int, bool]]:
    """Two people who meet and part, frames before and after, and whether the radar separates them at the nearest."""
    waveform = walk.radar.waveform
    bins = waveform.range_resolution, 2.0 * walk.radar.max_velocity / waveform.num_chirps
    found = []
    for a, b in zip(*np.triu_indices(walk.range.shape[1], 1), strict=True):
        distance = np.linalg.norm(walk.position[:, a] - walk.position[:, b], axis=1)
        edges = np.flatnonzero(np.diff((distance < MEETING).astype(int)))
        for start, end in pairwise(edges):
            if distance[start] >= MEETING and start >= SETTLED:
                nearest = start + int(np.argmin(distance[start:end]))
                gaps = [abs(values[nearest, a] - values[nearest, b]) for values in (walk.range, walk.velocity)]
                is_separable = gaps[0] >= 2.0 * bins[0] or gaps[1] >= 2.0 * bins[1]
                found.append((int(a), int(b), int(start), int(end) + 1, is_separable))
    return found


def fate(ids: NDArray[np.int64], meeting: tuple[int, int, int, int, bool]) -> str:
    """Identities of two people after they met."""
    a, b, start, end, _ = meeting
    before = [_first(ids[start - SETTLED : start + 1, k][::-1]) for k in (a, b)]
    after = [_first(ids[end : end + SETTLED, k]) for k in (a, b)]
    if min(before) < 0 or before[0] == before[1]:
        return "not two tracks before"
    if before == after:
        return "kept"
    if before == after[::-1]:
        return "swapped"
    return "one lost" if min(after) < 0 else "one new"


def _first(ids: NDArray[np.int64]) -> int:
    """First id of a track; -1 without one."""
    return next((int(one) for one in ids if one >= 0), -1)


def walkers(walks: list[Walk]) -> str:
    """One walker: frames with one track, and the other tracks."""
    single, found, others = [], [], []
    for walk in walks:
        frames, _ = followed(walk)
        lengths = Counter(state.id for states in frames for state in states).most_common()
        single.append(100.0 * np.mean([len(states) == 1 for states in frames]))
        found.append(100.0 * np.mean(identities(walk, frames) >= 0))
        others += [str(length) for _, length in lengths[1:]]
    each = [f"{np.mean(one):.1f} % (least {min(one):.1f} %)" for one in (single, found)]
    return (
        f"One walker, {len(walks)} walks: one track in {each[0]} of the frames, a track at the person in {each[1]}. "
        f"Frames of other tracks: {', '.join(others) or 'none'}."
    )


def meeting_table(walks: list[Walk]) -> str:
    """Several people: identities of pairs that meet."""
    counts = {True: Counter[str](), False: Counter[str]()}
    seconds, covered, coasted = [], [], []
    for walk in walks:
        frames, each = followed(walk)
        ids = identities(walk, frames)
        seconds += each
        covered.append(np.mean(ids >= 0))
        coasted += [not state.is_detected for states in frames for state in states]
        for meeting in meetings(walk):
            counts[meeting[-1]][fate(ids, meeting)] += 1
    names = sorted(set(counts[True]) | set(counts[False]))
    rows = []
    for is_separable, label in ((True, "two bins or more"), (False, "less")):
        total = counts[is_separable].total()
        share = 100.0 * counts[is_separable]["kept"] / total if total else np.nan
        rows.append([label, str(total), *(str(counts[is_separable][name]) for name in names), f"{share:.0f}"])
    text = table(["difference at the nearest", "pairs", *names, "kept [%]"], rows)
    milliseconds = 1e3 * np.array(seconds)  # on a machine that others share: not for the page
    print(f"Tracker, four people: {milliseconds.mean():.2f} ms a frame (median {np.median(milliseconds):.2f} ms)\n")
    return (
        f"{text}\n\nA track is at a person in {100 * np.mean(covered):.1f} % of the frames; "
        f"{100 * np.mean(coasted):.1f} % of the states of tracks are coasted."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/tracking.md")
    options = parser.parse_args()
    num_alone, num_together = (4, 4) if options.tiny else (200, 300)
    alone = [simulated(seed, 1, num_alone) for seed in range(1 if options.tiny else NUM_ALONE)]
    together = [simulated(100 + seed, 4, num_together) for seed in range(1 if options.tiny else NUM_TOGETHER)]
    pairs = f"{len(together)} walks of {num_together} frames; pairs that come within {MEETING:g} m and part"
    tables = f"{walkers(alone)}\n\nFour people, {pairs}:\n\n{meeting_table(together)}"
    print(tables)
    if options.write:
        write_section(DOCS / "tracking.md", "people", TEXT.format(rate=RATE, tables=tables))


if __name__ == "__main__":
    main()
