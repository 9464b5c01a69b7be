"""Other radars of a scene at the receivers of ours: their positions, signals and arrivals."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.direction import angles
from radarcore.motion.protocol import Motion, poses_at
from radarcore.radar.pattern import Pattern
from radarcore.radar.radar import Radar
from radarcore.receive.filters import low_pass_of
from radarcore.receive.interference import Arrivals, Chirps, beat_of_chirps
from radarcore.receive.noise import GOLDEN, mixed
from radarcore.scene.interferer import Interferer, chirps_between, sent_after
from radarcore.scene.scene import Scene
from radarcore.simulate.placement import Placement
from radarcore.simulate.side_by_side import Ask
from radarcore.units import SPEED_OF_LIGHT

_CLEARANCE = 1e-3
"""Smallest distance of an antenna of an interferer from ours [m]."""

_LONGEST_DELAY = 1e-4
"""Longest delay of a path [s]: 30 km."""

_SHORTEST = 1e-6
"""Shortest time over which delays are taken as linear [s]."""

Floats = NDArray[np.float64]

Counts = dict[str, Any]
"""Counts of interference, for `Frame.stats`."""


class Interference:
    """Signals of the interferers of a scene at the receivers of a radar.

    Parameters
    ----------
    scene : Scene
    radar : Radar
    motion : Motion
        Sensor to world.
    placement : Placement
        Of the same scene and motion.
    seed : int
        Of the phases of their oscillators.
    """

    def __init__(self, scene: Scene, radar: Radar, motion: Motion, placement: Placement, seed: int) -> None:
        self._scene, self._radar, self._motion, self._placement = scene, radar, motion, placement
        self._seed = seed
        self._low_pass = low_pass_of(radar)
        # Channels of the same receiver whose chirps start together get the same.
        offsets, self._offset = np.unique(radar.channel_offsets, return_inverse=True)
        self._receiver = np.arange(radar.num_channels) % len(radar.rx)
        self._starts = radar.waveform.chirp_times + offsets[:, None]  # (offset, chirp)

    def add_to(self, cube: NDArray[Any], engine: _core.Simulator, start: float, ask: Ask) -> Counts:
        """Add the signals to the samples (channel, chirp, sample) at the receivers, of a frame from a time [s] on.

        `engine`: the simulator of the core, which finds occlusions. `ask` calls motions.
        Returns counts.
        """
        num_offsets, num_chirps = self._starts.shape
        shape = num_offsets, len(self._radar.rx), num_chirps, self._radar.waveform.num_samples
        total, is_hit, strongest = np.zeros(shape, dtype=np.complex128), np.zeros((num_offsets, num_chirps), bool), 0.0
        for number, interferer in enumerate(self._scene.interferers):
            chirps = self._chirps(interferer, number, start)
            arrivals = ask(partial(self._arrivals, interferer, engine, start))
            amplitude = max(float(np.abs(each.amplitude).max(initial=0.0)) for each in arrivals)
            for offset, (starts, each) in enumerate(zip(self._starts, arrivals, strict=True)):
                samples, crosses = beat_of_chirps(chirps, each, self._radar.waveform, starts, self._low_pass, amplitude)
                total[offset] += samples
                is_hit[offset] |= crosses
            strongest = max(strongest, amplitude**2)
        # The first rows are the channels.
        cube[: len(self._receiver)] += total[self._offset, self._receiver].astype(cube.dtype)
        return {
            "interferers": len(self._scene.interferers),
            "chirps_hit": int(is_hit.sum()),
            "interference_power": float(np.mean(np.abs(total) ** 2)),
            "strongest_interferer": strongest,
        }

    def _chirps(self, interferer: Interferer, number: int, start: float) -> Chirps:
        """Chirps of an interferer around a frame that starts at a time [s]."""
        wf, clock = interferer.radar.waveform, interferer.clock
        end = float(self._starts.max() + self._radar.waveform.sample_times[-1])
        begin = -self._low_pass.settling_time - _LONGEST_DELAY
        starts, frame, chirp = chirps_between(interferer, begin, end, start)
        if wf.is_cw:
            phases = wf.start_frequency * clock * starts + _random_turns(
                self._seed, number, np.zeros(1, dtype=np.int64)
            )
        else:
            anew = chirp if interferer.start_phase == "chirp" else np.zeros_like(chirp)
            phases = _random_turns(self._seed, number, frame, anew)
        return Chirps(
            starts=starts,
            phases=phases % 1.0,
            start_frequency=wf.start_frequency * clock,
            slope=wf.slope * clock**2,
            duration=interferer.ramp_duration / clock,
        )

    def _arrivals(self, interferer: Interferer, engine: _core.Simulator, start: float) -> list[Arrivals]:
        """Direct paths from transmitters to receivers by Friis' formula, for chirps at each offset."""
        ours, other = self._radar, interferer.radar
        span = max(float(ours.waveform.sample_times[-1]), _SHORTEST)
        times = start + np.array([[0.0], [span]]) + self._starts.ravel()  # (end, chirp of an offset)
        sensor, sender = (
            poses_at(motion, times.ravel()).reshape(*times.shape, 3, 4) for motion in (self._motion, interferer.motion)
        )
        rx, tx = _in_world(sensor, ours.rx)[..., :, None, :], _in_world(sender, other.tx)[..., None, :, :]
        offsets = tx - rx  # (end, chirp, rx, tx, 3)
        distance = np.linalg.norm(offsets, axis=-1)
        if distance.min() < _CLEARANCE:
            raise ValueError(
                f"interferer: expected antennas at least {1e3 * _CLEARANCE:g} mm from ours, got "
                f"{1e3 * distance.min():.2g} mm at {start:g} s"
            )

        # Amplitudes at the starts of the chirps: gains, polarisation, and transmitters that a body occludes.
        to_tx = offsets[0] / distance[0, ..., None]
        at_rx, at_tx = to_tx @ sensor[0][:, None, :, :3], -to_tx @ sender[0][:, None, :, :3]
        gains = _gains(ours.rx_patterns, at_rx, 1) * _gains(other.tx_patterns, at_tx, 2)
        amplitude: Floats = np.sqrt(other.tx_power * gains) * other.waveform.wavelength / (4.0 * np.pi * distance[0])
        amplitude *= _match(ours, other, sensor[0], sender[0], to_tx)
        amplitude[..., self._is_hidden(interferer, engine, start + 0.5 * ours.waveform.duration)] = 0.0

        delay = distance / SPEED_OF_LIGHT
        # Absolute times are rounded: their difference is not exactly the span.
        rate = (delay[1] - delay[0]) / (times[1] - times[0])[:, None, None]
        delays, rates, amplitudes = (  # (offset, rx, tx, chirp)
            np.moveaxis(values.reshape(*self._starts.shape, *values.shape[1:]), 1, -1)
            for values in (delay[0], rate, amplitude.astype(np.complex128))
        )
        sent = sent_after(interferer) / interferer.clock
        return [Arrivals(*each, sent) for each in zip(delays, rates, amplitudes, strict=True)]

    def _is_hidden(self, interferer: Interferer, engine: _core.Simulator, middle: float) -> NDArray[np.bool_]:
        """True for transmitters that a body occludes from the centre of our array, at the middle of a frame [s]."""
        sensor, sender = (poses_at(motion, [middle])[0] for motion in (self._motion, interferer.motion))
        seen = (_in_world(sender, interferer.radar.tx) - sensor[:, 3]) @ sensor[:, :3] - self._radar.array_center
        return engine.occluded(self._placement.at(middle), np.ascontiguousarray(seen))


def counted(parts: list[Counts]) -> Counts:
    """Counts of a frame from the counts of its sub-sequences: all chirps, the mean of the powers, and the strongest."""
    return parts[0] | {
        "chirps_hit": sum(part["chirps_hit"] for part in parts),
        "interference_power": float(np.mean([part["interference_power"] for part in parts])),
        "strongest_interferer": max(part["strongest_interferer"] for part in parts),
    }


def _in_world(poses: Floats, points: Floats) -> Floats:
    """Points (n, 3) of a sensor frame in the world at poses (..., 3, 4), (..., n, 3)."""
    world: Floats = points @ np.swapaxes(poses[..., :3], -1, -2) + poses[..., None, :, 3]
    return world


def _gains(patterns: tuple[Pattern, ...], directions: Floats, axis: int) -> Floats:
    """Gains of antennas, one per entry of an axis, in directions (time, rx, tx, 3) of their frame."""
    of_each = zip(patterns, np.moveaxis(directions, axis, 0), strict=True)
    return np.stack([pattern.gain(*angles(seen)) for pattern, seen in of_each], axis=axis)


def _match(ours: Radar, other: Radar, sensor: Floats, sender: Floats, to_tx: Floats) -> Floats | float:
    """Part of the field that our antennas take: product of the polarisations, as far as they are across the path."""
    if ours.polarization_vector is None or other.polarization_vector is None:
        return 1.0
    fields = [
        (pose[:, :, :3] @ np.array(radar.polarization_vector))[:, None, None, :]
        for pose, radar in ((sensor, ours), (sender, other))
    ]
    across = [field - (field * to_tx).sum(axis=-1, keepdims=True) * to_tx for field in fields]
    match: Floats = (across[0] * across[1]).sum(axis=-1)
    return match


def _random_turns(seed: int, *counters: Any) -> Floats:
    """Random phases [turns] that belong to a seed and to counters."""
    state, step = np.array([seed], dtype=np.uint64), np.uint64(GOLDEN)
    for counter in counters:
        state = mixed((state + np.asarray(counter).astype(np.uint64)) * step + step)
    return (state >> np.uint64(11)).astype(np.float64) * 2.0**-53
