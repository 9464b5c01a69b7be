"""Does an arm stop in time for people who come near, by the radar on its hand alone? (extra `mujoco`)

A loop at 40 Hz: MuJoCo moves the arm, the frame of the moment is simulated and tracked in the world, and the arm brakes
when `rc.separation` says that a person is nearer than the protective separation distance. Vary SWING and PERIOD, how
long it takes to stop, and where people come from.

    python examples/stop_for_people.py                    20 approaches
    python examples/stop_for_people.py --num-approaches 100 --num-minutes 3
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

import radarcore as rc
from radarcore.adapters.mujoco import LiveModel, frames

RATE, SWING, PERIOD = 40.0, 0.35, 5.2  # frames per second; the hand swings by +-0.35 rad [rad], in so many seconds
REACTION, STOPPING = 0.1, 0.3  # [s]
FIELD_OF_VIEW = np.deg2rad(50.0)  # to each side of the line of sight

WORLD = """
<mujoco>
  <option timestep="0.0025"/>
  <asset><material name="plasterboard"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="8 8 1" material="plasterboard"/>
    <geom name="back" type="box" pos="5.5 0 1.4" size="0.05 3 1.4" material="plasterboard"/>
    <geom name="left" type="box" pos="2.5 3 1.4" size="3 0.05 1.4" material="plasterboard"/>
    <geom name="right" type="box" pos="2.5 -3 1.4" size="3 0.05 1.4" material="plasterboard"/>
    <geom name="post" type="cylinder" pos="3.2 1.6 0.6" size="0.06 0.6"/>
    <body name="arm" pos="0 0 1">
      <joint name="shoulder" axis="0 0 1" damping="20"/>
      <geom name="upper" type="capsule" fromto="0 0 0 0.5 0 0" size="0.06" mass="6"/>
      <camera name="radar" pos="0.6 0 0" xyaxes="0 -1 0 0 0 1"/>
    </body>
  </worldbody>
  <actuator><velocity joint="shoulder" kv="200"/></actuator>
</mujoco>
"""


class Moment(NamedTuple):
    """The arm and its radar after a frame."""

    time: float
    angle: float  # of the arm [rad]
    speed: float  # of its hand [m/s]
    is_stopping: bool
    separations: list[rc.processing.Separation]


def run(people: list[rc.models.Human], duration: float) -> Iterator[Moment]:
    """The loop: the arm obeys a frame one frame later, and stays stopped for at least 1 s."""
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    live = LiveModel(model)
    radar = rc.bgt60tr13c(max_velocity=6.0)  # feet are faster than 5 m/s
    motion = live.motion(camera="radar")
    scene = rc.Scene([*live.bodies, *(body for person in people for body in person.bodies())])
    simulator = rc.Simulator(scene, radar, radar_motion=motion)
    arm = [body for body in live.bodies if body.name == "upper"]
    known = rc.processing.StaticMap.of(body for body in live.bodies if body not in arm)
    tracker = rc.Tracker(motion, known, targets="people", velocity_ambiguity=2.0 * radar.max_velocity)
    stop_at, separations = -np.inf, []

    def control(data: Any) -> None:
        """Swing, but brake evenly after a command to stop."""
        wanted = 2.0 * np.pi / PERIOD * SWING * np.cos(2.0 * np.pi / PERIOD * data.time)
        since = data.time - stop_at
        data.ctrl[0] = wanted * max(1.0 - since / STOPPING, 0.0) if since < 1.0 else wanted

    for frame in frames(simulator, live, data, rate=RATE, duration=duration, control=control):
        if any(not one.is_safe for one in separations):  # of the frame before
            stop_at = frame.time if frame.time - stop_at >= 1.0 else stop_at
        states = tracker.update(rc.detect(frame))
        separations = rc.separation(
            states, arm, time=frame.time + 1.0 / RATE, reaction_time=REACTION, stopping_time=STOPPING
        )
        speed = 0.5 * abs(float(data.qvel[0]))
        yield Moment(frame.time, float(data.qpos[0]), speed, frame.time - stop_at < 1.0, separations)


def approach(seed: int) -> rc.models.Human:
    """Somebody who walks towards the arm from in front or aside; every fourth stands where the arm must not swing."""
    rng = np.random.default_rng(seed)
    speed, side = rng.uniform(0.5, 1.6), rng.uniform(-1.0, 1.0)
    start = np.array([rng.uniform(3.5, 4.5) - abs(side), 2.0 * side])
    if seed % 4 == 3:
        speed, start = 0.0, np.array([rng.uniform(1.2, 1.5), 0.4 * side])
    return rc.models.Human(height=rng.uniform(1.6, 1.9), speed=speed, path=[start, [0.3, 0.0]], phase=rng.uniform())


def true_distance(person: rc.models.Human, moment: Moment) -> float:
    """Smallest distance of the person from the arm, a stick with round ends, seen from above [m]."""
    axis = 0.5 * np.array([np.cos(moment.angle), np.sin(moment.angle)])
    points = np.concatenate([body.motion.at(moment.time).apply(body.mesh.vertices)[:, :2] for body in person.bodies()])
    along = np.clip(points @ axis / (axis @ axis), 0.0, 1.0)
    return float(np.linalg.norm(points - along[:, None] * axis, axis=1).min()) - 0.06


def is_in_view(person: rc.models.Human, moment: Moment) -> bool:
    x, y, _ = person.segment_motion("trunk").at(moment.time).position
    bearing = np.arctan2(y - 0.6 * np.sin(moment.angle), x - 0.6 * np.cos(moment.angle)) - moment.angle
    return abs(np.angle(np.exp(1j * bearing))) < FIELD_OF_VIEW


def main(num_approaches: int, num_minutes: float) -> None:
    counts: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(num_approaches):
        person = approach(seed)
        in_view, distance = True, np.nan
        for moment in run([person], 12.0):
            distance = true_distance(person, moment)
            if not moment.is_stopping:
                in_view = is_in_view(person, moment)
            if (moment.is_stopping and moment.speed < 0.01) or distance < 0.0:
                break
        else:
            distance = np.nan  # the arm never stopped
        counts[in_view].append(distance)
        side = "in view" if in_view else "outside"
        print(f"{seed}: {person.speed:.2f} m/s, {side}, {distance:.2f} m at standstill", file=sys.stderr)
    required = 0.1 + 0.01  # C and Zr: people and robot stand still
    for in_view, name in ((True, "within the field of view"), (False, "outside of it")):
        far = sum(distance >= required for distance in counts[in_view])
        print(f"{name}: at least {required:.2f} m at standstill in {far} of {len(counts[in_view])} approaches")
    stops = [moment.is_stopping for moment in run([], 60.0 * num_minutes)] if num_minutes > 0.0 else []
    needless = int(np.diff([0, *stops]).clip(0).sum())
    print(f"nobody there: {needless} stops in {num_minutes:g} minutes")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--num-approaches", type=int, default=20)
    options.add_argument("--num-minutes", type=float, default=1.0)
    main(**vars(options.parse_args()))
