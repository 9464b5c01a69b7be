"""Paths at the middle of a frame, of all bodies and of some alone."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import current_thread, main_thread

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.scene.scene import Scene
from radarcore.simulate.beat import beat_signal
from radarcore.simulate.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Echo:
    """Some paths at one time, per TX-RX pair.

    Attributes
    ----------
    delay : (channel, path) float64
        [s].
    rate : (channel, path) float64
        [s/s].
    amplitude : (channel, path) complex128
        [sqrt(W)].
    body : (path,) int32
        Number in the scene; for several reflections that of the last.
    """

    delay: NDArray[np.float64]
    rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]

    def of(self, numbers: NDArray[np.intp]) -> Echo:
        """Paths of some bodies."""
        return self._select(np.isin(self.body, numbers))

    def of_each(self, owners: NDArray[np.intp]) -> list[tuple[int, Echo]]:
        """Paths of each owner, who are given per body; owners without any are left out."""
        owner = owners[self.body]
        return [(k, self._select(owner == k)) for k in np.unique(owner).tolist()]

    def _select(self, chosen: NDArray[np.bool_]) -> Echo:
        paths = np.flatnonzero(chosen)
        return Echo(self.delay[:, paths], self.rate[:, paths], self.amplitude[:, paths], self.body[paths])


class Caster:
    """Casts of a simulator's scene at single times, with the settings of the simulator.

    For a radar with one chirp the time of the rays and that of the paths are the same.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = replace(simulator, radar=_with_one_chirp(simulator.radar))
        self._alone: dict[bytes, Simulator] = {}

    @property
    def waveform(self) -> Waveform:
        """Waveform of a single chirp."""
        return self._simulator.radar.waveform

    def echo(self, time: float) -> Echo:
        """Paths of the whole scene at a time [s]."""
        return _cast(self._simulator, time)

    def alone(self, numbers: NDArray[np.intp], time: float) -> Echo:
        """Paths of some bodies at a time [s], if nothing else were in the scene."""
        key = numbers.tobytes()
        if key not in self._alone:
            scene = Scene([self._simulator.scene.bodies[number] for number in numbers.tolist()])
            self._alone[key] = replace(self._simulator, scene=scene)
        echo = _cast(self._alone[key], time)
        return replace(echo, body=numbers[echo.body].astype(np.int32))

    def signal(self, echo: Echo) -> NDArray[np.complex128]:
        """Samples of one chirp, (channel, sample) [sqrt(W)]."""
        return beat_signal(echo.delay, echo.amplitude, self.waveform)[:, 0].astype(np.complex128)


def _cast(simulator: Simulator, time: float) -> Echo:
    with _quiet():
        paths = simulator.paths(time)
    return Echo(paths.delay, paths.delay_rate, paths.amplitude, paths.body[0])


@contextmanager
def _quiet() -> Iterator[None]:
    """Without warnings: the frame has had the same casts, and warned.

    In threads beside the main one, where filters belong to all of them, they go the way they always go.
    """
    if current_thread() is not main_thread():
        yield
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _with_one_chirp(radar: Radar) -> Radar:
    return replace(radar, waveform=radar.waveform.replace(num_chirps=1), more_waveforms=(), schedule=None)
