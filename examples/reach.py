"""Can a tool find a ball with its radar alone, in many worlds at once? A vector environment of Gymnasium.

python examples/reach.py                  follow the strongest echo in 64 worlds
python examples/reach.py --num-worlds 8

The tool of an arm carries the radar and moves at the chosen velocity; the observation is the range-velocity map of
each channel. The policy below needs no training: it goes towards the strongest echo, by the phases of three receivers.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import radarcore as rc

STEP = 0.1
"""Time between actions [s]."""

REACHED, FASTEST, MOST_STEPS = 0.3, 0.5, 60
"""Distance of the tool from the ball [m] that ends an episode, largest speed [m/s], and steps of an episode."""

RADIUS = 0.1
"""Of the ball [m]."""


class Reach(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """A tool with a radar that looks along x, and a ball, in `num_worlds` worlds.

    Actions are velocities of the tool (world, 3) [m/s], observations the complex range-velocity maps of three channels,
    as real and imaginary parts (world, 2, channel, doppler, range).
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as Gymnasium has it

    def __init__(self, num_worlds: int) -> None:
        self.radar = rc.bgt60tr13c(num_samples=64, num_chirps=16)
        floor = rc.Body(
            rc.shapes.plate(6.0, 6.0), motion=rc.Pose.from_rpy([2.0, 0.0, -1.0], [0.0, -np.pi / 2.0, 0.0]), name="floor"
        )
        scene = rc.Scene([floor, rc.Body(rc.shapes.sphere(RADIUS), name="ball")])
        self.simulator = rc.Simulator(scene, self.radar, sampling="fast")
        self.num_envs = num_worlds
        self.single_action_space = Box(-FASTEST, FASTEST, (3,), np.float32)
        self.single_observation_space = Box(-np.inf, np.inf, (2, 3, 16, 33), np.float32)
        self.action_space = batch_space(self.single_action_space, num_worlds)
        self.observation_space = batch_space(self.single_observation_space, num_worlds)
        self.ball, self.tool = np.zeros((2, num_worlds, 3))
        self.steps, self.has_ended = np.zeros(num_worlds, int), np.ones(num_worlds, bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Begin an episode in every world."""
        super().reset(seed=seed, options=options)
        self._begin(np.ones(self.num_envs, bool))
        return self._observations(np.zeros((self.num_envs, 3))), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Move every tool and observe again."""
        begins = self.has_ended.copy()
        velocities = np.where(begins[:, None], 0.0, np.clip(actions, -FASTEST, FASTEST))
        self.tool += STEP * velocities
        self.steps += 1
        self._begin(begins)
        distance = np.linalg.norm(self.ball - self.tool, axis=1)
        reached, late = distance < REACHED, self.steps >= MOST_STEPS
        self.has_ended = reached | late
        return self._observations(velocities), np.where(begins, 0.0, -distance), reached, late & ~reached, {}

    def _begin(self, worlds: np.ndarray) -> None:
        """New episodes."""
        number = int(worlds.sum())
        self.ball[worlds] = self.np_random.uniform([1.2, -0.6, -0.3], [2.2, 0.6, 0.3], (number, 3))
        self.tool[worlds], self.steps[worlds] = 0.0, 0

    def _observations(self, velocities: np.ndarray) -> np.ndarray:
        """Maps of all worlds: one call for the frames, one for the transforms."""
        poses = np.tile(np.eye(4), (self.num_envs, 2, 1, 1))
        poses[:, 0, :3, 3], poses[:, 1, :3, 3] = self.ball, self.tool
        rates = np.stack([np.zeros_like(velocities), velocities], axis=1)
        maps = rc.range_doppler(self.simulator.worlds(poses, velocities=rates, bodies=["ball"]).cube, self.radar)
        return np.stack([maps.real, maps.imag], axis=1).astype(np.float32)


def follow(observations: np.ndarray, radar: rc.Radar) -> np.ndarray:
    """Velocities towards the strongest echo, by the phases of the receivers."""
    maps = observations[:, 0] + 1j * observations[:, 1]
    power = (np.abs(maps) ** 2).sum(axis=1)
    ranges = radar.waveform.range_axis()[: maps.shape[-1]]
    power[:, :, ranges < REACHED - RADIUS] = 0.0
    cell = power.reshape(len(power), -1).argmax(axis=1)
    echo = maps.reshape(*maps.shape[:2], -1)[np.arange(len(maps)), :, cell]
    # The phase grows with the path, which is shorter to receivers towards the echo.
    baselines = 2.0 * np.pi / radar.waveform.wavelength * (radar.rx[1:] - radar.rx[0])[:, 1:]
    sines = np.clip(np.angle(echo[:, :1] * echo[:, 1:].conj()) @ np.linalg.inv(baselines).T, -0.7, 0.7)
    ahead = np.sqrt(1.0 - np.minimum((sines**2).sum(axis=1, keepdims=True), 0.99))
    return (FASTEST * np.concatenate([ahead, sines], axis=1)).astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--num-worlds", type=int, default=64)
    options = parser.parse_args()
    worlds = Reach(options.num_worlds)
    observations, _ = worlds.reset(seed=1)
    reached, ended = np.zeros((2, options.num_worlds), bool)
    start, steps = time.perf_counter(), 0
    while not ended.all():
        observations, _, terminated, truncated, _ = worlds.step(follow(observations, worlds.radar))
        reached |= terminated & ~ended
        ended |= terminated | truncated
        steps += 1
    rate = steps * options.num_worlds / (time.perf_counter() - start)
    print(
        f"{reached.sum()} of {options.num_worlds} tools reached the ball in {steps} steps; {rate:.0f} steps per second"
    )


if __name__ == "__main__":
    main()
