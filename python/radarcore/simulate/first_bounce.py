"""Paths from another radar over one body or point to our receivers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from radarcore import _core
from radarcore.motion.protocol import Motion, poses_at
from radarcore.radar.pattern import IsotropicPattern, Pattern
from radarcore.radar.radar import Radar
from radarcore.scene.interferer import Interferer
from radarcore.scene.scene import Scene
from radarcore.simulate.directions import angles
from radarcore.simulate.placement import Placement
from radarcore.simulate.sectors import Angles
from radarcore.simulate.settings import Settings, core_settings
from radarcore.units import SPEED_OF_LIGHT

_NUM_TIMES = 17
"""Times of a frame at which motion is placed."""

_NUM_RAYS = 2**18
"""Rays across the field of view."""

_STEP = 1e-2
"""Distance of antennas by which scattering points are located [m]."""

_BEFORE = 1e-3
"""Distance before a surface of the points that must be seen from a transmitter [m]."""

_SHARE = 1.0 / 16.0
"""Differences of phase within merged paths, at the edges of the band and of the frame [turns]."""

_DROPPED, _MOST = 1e-2, 32
"""Part of the power that may be left out, and number of merged paths per transmitter at most."""

_GRID = np.deg2rad(1.0)
"""Step of a table of a pattern that is turned [rad]."""

_LOWEST = 1e-30
"""Gain of directions without a gain."""

_PARALLEL = 1e-6
"""Difference of polarisations that are the same."""

_SHORTEST = 1e-6
"""Shortest duration of a frame over which velocities are taken [s]."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BouncePaths:
    """Paths over one body or point, at the middle of a frame.

    Attributes
    ----------
    delay : (receiver, path) float64
        From transmitter to receiver [s].
    delay_rate : (receiver, path) float64
        [s/s].
    amplitude : (receiver, path) complex128
        Without the phase of propagation [sqrt(W)].
    transmitter : (path,) int64
        Index of the interferer's transmitter.
    """

    delay: Floats
    delay_rate: Floats
    amplitude: NDArray[np.complex128]
    transmitter: NDArray[np.int64]


class FirstBounce:
    """Paths from an interferer over what our radar sees, to its receivers.

    Rays from the centre of our array find the surfaces; physical optics (docs/theory.md, eqs. (2) and (3)) gives what
    each reflects from a transmitter at the interferer's place, by footprint sampling, which holds for transmitters
    anywhere; curved bodies of whose Fresnel zone a pixel is a large part are off by some dB, or lost. What the
    interferer does not see is left out. Points follow the bistatic radar equation.

    Parameters
    ----------
    scene : Scene
    radar : Radar
    interferer : Interferer
    motion : Motion
        Our sensor to the world.
    placement : Placement
        Of the same scene and motion.
    settings : Settings
        Of the simulator.
    view_deg : (float, float)
        Field of view of the simulator [degrees].
    """

    def __init__(
        self,
        scene: Scene,
        radar: Radar,
        interferer: Interferer,
        motion: Motion,
        placement: Placement,
        settings: Settings,
        view_deg: Angles,
    ) -> None:
        self._scene, self._radar, self._interferer = scene, radar, interferer
        self._motion, self._placement = motion, placement
        self._frequency = interferer.radar.waveform.center_frequency * interferer.clock
        # The times of our frame at the frequency of the interferer.
        self._waveform = radar.waveform.replace(start_frequency=self._frequency, slope=0.0)
        self._settings = Settings(
            sampling="footprint",
            resolution=_pixels(view_deg) if scene.parts.meshed else 1,
            field_of_view_deg=view_deg,
            gain_floor_db=np.inf,
            max_bounces=1,
            retrace_deg=np.inf,
            seed=settings.seed,
            threads=settings.threads,
        )

    def paths(self, start: float) -> BouncePaths:
        """Paths in the frame that starts at a time [s], at its middle."""
        middle = start + 0.5 * self._radar.waveform.duration
        sensor, sender, tx, velocities = self._places(middle)
        rx = self._radar.rx - self._radar.array_center

        # Four more transmitters at the first receiver tell where the scattering points are.
        probes = rx[0] + _STEP * np.vstack([np.zeros(3), np.eye(3)])
        engine = self._engine(sensor, sender, np.vstack([tx, probes]), rx)
        motion = next(self._placement.frames([start], _NUM_TIMES))
        at, rates_at = self._placement.at(middle), self._placement.rates_at(middle)
        delay, rate, amplitude, body, _ = engine.paths(motion, at, rates_at)
        points = rx[0] + _located(SPEED_OF_LIGHT * delay[len(tx) * len(rx) :: len(rx)])

        found = []
        for number, (place, velocity) in enumerate(zip(tx, velocities, strict=True)):
            # The core takes transmitters as fixed to our sensor; this one moves on its own.
            away = points - place
            own_rate = -(away @ velocity) / (np.linalg.norm(away, axis=1) * SPEED_OF_LIGHT)
            is_lit = ~self._is_hidden(engine, middle, sensor, place, away)
            of_tx = np.ix_(np.arange(number * len(rx), (number + 1) * len(rx)), np.flatnonzero(is_lit))
            rates = rate[of_tx] + own_rate[is_lit]
            merged = self._merged(delay[of_tx], rates, amplitude[of_tx], body[is_lit].astype(np.int64))
            found.append(BouncePaths(*merged, np.full(merged[0].shape[1], number)))
        return BouncePaths(
            delay=np.concatenate([part.delay for part in found], axis=1),
            delay_rate=np.concatenate([part.delay_rate for part in found], axis=1),
            amplitude=np.concatenate([part.amplitude for part in found], axis=1),
            transmitter=np.concatenate([part.transmitter for part in found]),
        )

    def _places(self, middle: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Poses of our sensor and of the interferer, (3, 4), its transmitters in our axes, and their velocities.

        (tx, 3), about the centre of our array [m], and relative to our axes, which may turn [m/s].
        """
        half = max(0.5 * self._radar.waveform.duration, _SHORTEST)
        times = middle + half * np.array([0.0, -1.0, 1.0])
        sensor, sender = poses_at(self._motion, times), poses_at(self._interferer.motion, times)
        world = self._interferer.radar.tx @ np.swapaxes(sender[..., :3], 1, 2) + sender[:, None, :, 3]
        seen = (world - sensor[:, None, :, 3]) @ sensor[..., :3] - self._radar.array_center
        return sensor[0], sender[0], seen[0], (seen[2] - seen[1]) / (2.0 * half)

    def _engine(self, sensor: Floats, sender: Floats, tx: Floats, rx: Floats) -> _core.Simulator:
        """Counterpart in the core of a radar with the interferer's transmitters and our receivers."""
        # Directions of our axes in those of the interferer.
        to_sender = sender[:, :3].T @ sensor[:, :3]
        patterns = [_turned(pattern, to_sender.tobytes()) for pattern in self._interferer.radar.tx_patterns]
        probes = [IsotropicPattern()._core] * (len(tx) - len(patterns))
        return _core.Simulator(
            self._scene._core,
            [body.material._core_at(self._frequency) for body in self._scene.parts.meshed],
            antennas=_core.Antennas(
                tx=np.ascontiguousarray(tx),
                rx=rx,
                tx_patterns=patterns + probes,
                rx_patterns=[pattern._core for pattern in self._radar.rx_patterns],
                power=self._interferer.radar.tx_power,
                frequency=self._frequency,
                polarization=self._polarization(to_sender),
            ),
            waveform=self._waveform._core,
            center=self._radar.array_center.tolist(),
            settings=core_settings(self._settings, reuse_tiles=False),
            threads=self._settings.threads,
        )

    def _polarization(self, to_sender: Floats) -> tuple[float, float, float] | None:
        """Ours if the interferer has the same; otherwise none: the mean over polarisations."""
        ours, other = self._radar.polarization_vector, self._interferer.radar.polarization_vector
        if ours is None or other is None or abs(np.dot(to_sender @ ours, other)) < 1.0 - _PARALLEL:
            return None
        return ours

    def _is_hidden(
        self, engine: _core.Simulator, middle: float, sensor: Floats, place: Floats, away: Floats
    ) -> NDArray[np.bool_]:
        """True for points that a body occludes from a transmitter at a place about the centre of our array.

        `away`: from the transmitter to the points (n, 3) in our axes [m].
        """
        if not self._scene.parts.meshed or len(away) == 0:
            return np.zeros(len(away), dtype=np.bool_)
        moved = sensor.copy()
        moved[:, 3] += sensor[:, :3] @ place
        # In front of the side that we see: a thin plate is between it and a transmitter behind.
        to_center = -(place + away)
        before = away + _BEFORE * to_center / np.linalg.norm(to_center, axis=1, keepdims=True)
        return engine.occluded(self._placement.seen_from(moved, middle), np.ascontiguousarray(before))

    def _merged(
        self, delay: Floats, rate: Floats, amplitude: NDArray[np.complex128], body: NDArray[np.int64]
    ) -> tuple[Floats, Floats, NDArray[np.complex128]]:
        """The strongest sums of paths that are alike: of one body, within steps of delay and of rate.

        At the edges of the interferer's band and of our frame the phases within a sum differ by up to `_SHARE` of a
        turn from those at the middle.
        """
        sent, ours = self._interferer.radar.waveform, self._radar.waveform
        band = abs(sent.slope) * self._interferer.ramp_duration
        turns = band * delay[0] / _SHARE, self._frequency * max(ours.duration, _SHORTEST) * rate[0] / _SHARE
        keys = np.stack([body, *(np.floor(turn).astype(np.int64) for turn in turns)])
        _, group = np.unique(keys, axis=1, return_inverse=True)
        group, size = group.ravel(), int(group.max(initial=-1)) + 1

        def sums(values: Floats) -> Floats:
            return np.array([np.bincount(group, weights=row, minlength=size) for row in values])

        # Means by power, then the sum as it is at the centre of the band.
        power = np.abs(amplitude) ** 2
        whole = np.maximum(sums(power), np.finfo(np.float64).tiny)
        mean_delay, mean_rate = (sums(power * values) / whole for values in (delay, rate))
        turned = amplitude * np.exp(-2j * np.pi * self._frequency * (delay - mean_delay[:, group]))
        total = sums(turned.real) + 1j * sums(turned.imag)

        # As many of the strongest as have nearly all of the power.
        strength = (np.abs(total) ** 2).sum(axis=0)
        order = np.argsort(-strength, kind="stable")
        reached = np.cumsum(strength[order]) <= (1.0 - _DROPPED) * strength.sum()
        kept = order[: min(int(reached.sum()) + 1, _MOST)]
        return mean_delay[:, kept], mean_rate[:, kept], total[:, kept]


def _pixels(view_deg: Angles) -> tuple[int, int]:
    """Rows and columns of `_NUM_RAYS` pixels across a field of view, about as wide as high."""
    horizontal, vertical = view_deg
    rows, columns = (
        max(1, round((_NUM_RAYS * ratio) ** 0.5)) for ratio in (vertical / horizontal, horizontal / vertical)
    )
    return rows, columns


def _located(lengths: Floats) -> Floats:
    """Points (path, 3) about the receiver, from the lengths (4, path) from four transmitters over them to it.

    The first transmitter is at the receiver, the others are `_STEP` away along the axes.
    """
    distance = 0.5 * lengths[0]
    others = lengths[1:] - distance
    located: Floats = ((distance - others) * (distance + others) + _STEP**2).T / (2.0 * _STEP)
    return located


@lru_cache(maxsize=16)
def _turned(pattern: Pattern, rotation: bytes) -> _core.Pattern:
    """Pattern of an interferer over the directions of our axes; `rotation`: from these to its own, (3, 3) float64."""
    if isinstance(pattern, IsotropicPattern):
        return pattern._core
    to_sender = np.frombuffer(rotation).reshape(3, 3)
    azimuth = np.linspace(-np.pi, np.pi, round(2.0 * np.pi / _GRID) + 1)
    elevation = np.linspace(-0.5 * np.pi, 0.5 * np.pi, round(np.pi / _GRID) + 1)
    across = np.cos(elevation)
    directions = np.stack(
        np.broadcast_arrays(
            np.cos(azimuth)[:, None] * across, np.sin(azimuth)[:, None] * across, np.sin(elevation)[None]
        ),
        axis=-1,
    )
    gain = pattern.gain(*angles(directions @ to_sender.T))
    return _core.Pattern.table(azimuth, elevation, 10.0 * np.log10(np.maximum(gain, _LOWEST)))
