"""Labels from paths at the middle of a frame: visibility of bodies, and the strongest body in every cell of the map."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radarcore import notice
from radarcore.processing.inputs import require_one_waveform, require_uniform_chirps
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.processing.spectra.windows import window_weights
from radarcore.products import real_inner
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform, require_range
from radarcore.scene.scene import Parts, Scene
from radarcore.simulate.beat import beat_signal
from radarcore.simulate.simulator import Simulator
from radarcore.units import power_from_db

Floats = NDArray[np.float64]
Members = tuple[NDArray[np.intp], ...]
"""Per label the numbers in the scene of the bodies that it stands for; none where it is absent."""

DEPTH_DB = 60.0
"""Lowest level of a labelled cell below the strongest of the map [dB]."""

TIE_DB = 0.01
"""Powers that differ by less are equal: ten times what synthesis is exact to [dB]."""

NOBODY = -1

_PARALLAX = 1e-3
"""Margin of directions, for antennas beside the centre of the array and the corners of cells of rays [tangent]."""


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
        Number in the scene; for several reflections of the last body.
    """

    delay: NDArray[np.float64]
    rate: NDArray[np.float64]
    amplitude: NDArray[np.complex128]
    body: NDArray[np.int32]

    def of(self, numbers: NDArray[np.intp]) -> Echo:
        """Paths of some bodies."""
        return self._select(np.isin(self.body, numbers))

    def of_each(self, owners: NDArray[np.intp]) -> list[tuple[int, Echo]]:
        """Paths of each owner, with owners given per body; owners without paths are left out."""
        owner = owners[self.body]
        return [(k, self._select(owner == k)) for k in np.unique(owner).tolist()]

    def _select(self, chosen: NDArray[np.bool_]) -> Echo:
        paths = np.flatnonzero(chosen)
        return Echo(self.delay[:, paths], self.rate[:, paths], self.amplitude[:, paths], self.body[paths])


class Caster:
    """Casts of a simulator's scene at single times, with the settings of the simulator.

    For a radar with one chirp rays and paths have the same time.
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
    with notice.gathered():  # the frame has had the same casts, and warned
        paths = simulator.paths(time)
    return Echo(paths.delay, paths.delay_rate, paths.amplitude, paths.body[0])


def _with_one_chirp(radar: Radar) -> Radar:
    return replace(radar, waveform=radar.waveform.replace(num_chirps=1), more_waveforms=(), schedule=None)


def visibilities(
    caster: Caster, echo: Echo, time: float, members: Members, scene: Scene, is_rough: NDArray[np.bool_], boxes: Floats
) -> Floats:
    """Visibility of the bodies of every label, (label,), 0 to 1; NaN where there are none.

    Parameters
    ----------
    caster : Caster
        Casts bodies alone.
    echo : Echo
        Paths of the whole scene.
    time : float
        Time of all paths [s].
    members : tuple of (n,) intp
        Bodies of every label.
    scene : Scene
    is_rough : (body,) bool
        As `are_rough` has them.
    boxes : (body, 2, 3) float64
        Boxes of the bodies, from the centre of the array [m].
    """
    shares = np.full(len(members), np.nan)
    for label, numbers in enumerate(members):
        if len(numbers) == 0:
            continue
        seen = echo.of(numbers)
        in_danger = may_be_hidden(numbers, scene.parts, boxes)
        if not in_danger.any() or not seen.amplitude.any():
            shares[label] = float(seen.amplitude.any())
        else:
            shares[label] = share(seen, caster.alone(numbers, time), in_danger, is_rough, caster)
    return shares


def are_rough(scene: Scene, frequency: float) -> NDArray[np.bool_]:
    """True for bodies that scatter more than they reflect, at normal incidence and a frequency [Hz], (body,)."""
    rough = np.zeros(len(scene.bodies), dtype=np.bool_)
    for number, body in zip(scene.parts.mesh_numbers, scene.parts.meshed, strict=True):
        reflection, albedo = body.material.response(frequency)
        rough[number] = albedo > np.abs(reflection) ** 2
    return rough


def share(seen: Echo, alone: Echo, in_danger: NDArray[np.bool_], is_rough: NDArray[np.bool_], caster: Caster) -> float:
    """Part of the energy of an echo alone that its paths in view have, 0 to 1.

    The energy of the signal s of a body is the sum over its paths of Re <s, s_path>, however finely it is sampled. Of
    that sum the paths in view have their part: half of a mirror that is half hidden. Of a rough surface, whose paths
    have random phases, these products are far from their mean, the energy of each path, which takes their place. The
    energies of several bodies add.

    Parameters
    ----------
    seen, alone : Echo
        Paths in the scene, and those without the rest of it.
    in_danger : (body,) bool
        Bodies that others may hide; of the rest all is in view.
    is_rough : (body,) bool
        Bodies whose paths count one by one, by their numbers in the paths.
    caster : Caster
    """
    whole = part = 0.0
    for number, own in alone.of_each(np.arange(len(is_rough))):
        in_view = seen.of(np.array([number])) if in_danger[number] else own
        if is_rough[number]:
            energies = [float(np.square(np.abs(each.amplitude)).sum()) for each in (own, in_view)]
        else:
            signal = caster.signal(own)
            signals = signal, signal if in_view is own else caster.signal(in_view)
            energies = [real_inner(signal, each) / signal.shape[1] for each in signals]
        whole, part = whole + energies[0], part + energies[1]
    return float(np.clip(part / whole, 0.0, 1.0)) if whole > 0.0 else 0.0


def may_be_hidden(numbers: NDArray[np.intp], parts: Parts, boxes: Floats) -> NDArray[np.bool_]:
    """True for bodies whose box, seen from the radar, overlaps the box of another body with a mesh.

    (body,), False for all other bodies of the scene.
    """
    others = np.setdiff1d(parts.mesh_numbers, numbers)
    # Points are seen through everything.
    meshes = np.intersect1d(numbers, parts.mesh_numbers)
    low, high = _directions(boxes)
    nearest, farthest = _distances(boxes)
    in_danger = np.zeros(len(boxes), dtype=np.bool_)
    for number in meshes.tolist():
        overlaps = (low[others] <= high[number]) & (high[others] >= low[number])
        in_danger[number] = (overlaps.all(axis=1) & (nearest[others] <= farthest[number])).any()
    return in_danger


def _directions(boxes: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest y/x and z/x of boxes, (body, 2) each; infinite for what reaches behind the antennas."""
    front = boxes[:, :, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = boxes[:, None, :, 1:] / front[:, :, None]  # body, x of the corner, y or z of it, axis
    low, high = corners.min(axis=(1, 2)) - _PARALLAX, corners.max(axis=(1, 2)) + _PARALLAX
    is_ahead = boxes[:, :1, 0] > 0.0
    # The antennas are a few millimetres beside the centre of the array.
    margin = np.where(is_ahead, _PARALLAX / np.maximum(boxes[:, :1, 0], _PARALLAX), np.inf)
    return np.where(is_ahead, low - margin, -np.inf), np.where(is_ahead, high + margin, np.inf)


def _distances(boxes: Floats) -> tuple[Floats, Floats]:
    """Distances of the nearest and the farthest point of boxes, (body,) each [m]."""
    nearest = np.linalg.norm(np.clip(0.0, boxes[:, 0], boxes[:, 1]), axis=1)
    farthest = np.linalg.norm(np.abs(boxes).max(axis=1), axis=1)
    return nearest, farthest


def require_map(radar: Radar) -> None:
    """Refuse radars whose frames have no range-velocity map, or one in which an echo is at several velocities."""
    require_one_waveform(radar)
    require_range(radar.waveform)
    require_uniform_chirps(radar.waveform)
    if radar.num_channels < len(radar.tx) * len(radar.rx):
        raise ValueError("cells: expected transmitters that send in turn, got a schedule of all at once")


def map_shape(radar: Radar) -> tuple[int, int]:
    """Rows and columns of `range_doppler` of a frame."""
    num_samples = radar.waveform.num_samples
    return radar.waveform.num_chirps, num_samples // 2 + 1 if radar.is_real else num_samples


def noise_power(radar: Radar) -> float:
    """Mean power of the receiver's thermal noise in a cell of the map, summed over the channels [W]."""
    if radar.receiver is None:
        return 0.0
    wf = radar.waveform
    fast, slow = window_weights("window", "hann", wf.num_samples), window_weights("window", "hann", wf.num_chirps)
    return float(radar.num_channels * radar.receiver.noise_variance(wf.sample_rate) * np.sum(fast**2) * np.sum(slow**2))


def strongest_bodies(echo: Echo, owners: NDArray[np.intp], radar: Radar) -> NDArray[np.int16]:
    """Label of the strongest echo in every cell of the range-velocity map, (doppler, range); -1 for none.

    Parameters
    ----------
    echo : Echo
        Paths at the middle of the frame, per TX-RX pair.
    owners : (body,) intp
        Label of every body of the scene.
    radar : Radar
        Of the frame.
    """
    first, second = np.zeros(map_shape(radar)), np.zeros(map_shape(radar))
    labels = np.full(map_shape(radar), NOBODY, dtype=np.int16)
    for label, own in echo.of_each(owners):
        power = map_power(own, radar)
        is_first = power > first
        np.maximum(second, np.where(is_first, first, power), out=second)
        first[is_first], labels[is_first] = power[is_first], label
    level = max(noise_power(radar), float(first.max(initial=0.0)) / power_from_db(DEPTH_DB))
    labels[(first < level) | (second * power_from_db(TIE_DB) > first)] = NOBODY
    return labels


def map_power(echo: Echo, radar: Radar) -> NDArray[np.float64]:
    """Power of paths in the cells of the map, summed over the channels, (doppler, range) [W]."""
    wf = radar.waveform
    # Velocities hold for the middle of the frame.
    begin = radar.channel_offsets[:, None] - radar.middle
    samples = beat_signal(echo.delay + begin * echo.rate, echo.amplitude, wf, delay_rate=echo.rate)
    cells = range_doppler(np.ascontiguousarray(samples.real) if radar.is_real else samples, wf)
    power: NDArray[np.float64] = (cells.real**2 + cells.imag**2).sum(axis=0, dtype=np.float64)
    return power
