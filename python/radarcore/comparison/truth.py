"""Truth over time, from motions in the world or from a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import angles
from radarcore.geometry.mesh import nearest_point
from radarcore.geometry.pose import Pose
from radarcore.motion.protocol import AnyMotion, Motion, as_motion, poses_at, with_factors
from radarcore.recording.frame import TRUTH_FIELDS, Truth
from radarcore.scene.body import Body, PointTarget, motion_of

_Floats = NDArray[np.float64]

_LONGEST_STEP = 2.5
"""Longest gap to interpolate, in ordinary frame intervals."""

_FRONT = 1e-3
"""Least distance of a visible target in front of the radar [m]; targets beside or behind it are not visible."""


class MovingTargets:
    """Truth of targets that move in the world, relative to a radar that may move too.

    Parameters
    ----------
    targets : mapping
        Motions, bodies or point targets by name. The true point of a motion is its origin, of a body the point of its
        surface nearest to the radar.
    radar_motion : motion, optional
        Sensor to world; default: the sensor frame is the world frame.
    radii : mapping, optional
        Distance by name from the origin of a motion to the target's surface, towards the radar [m].
    """

    def __init__(
        self,
        targets: Mapping[str, Any],
        radar_motion: AnyMotion | None = None,
        radii: Mapping[str, float] | None = None,
    ) -> None:
        if not isinstance(targets, Mapping):
            raise TypeError(f"truth: expected motions by name, a Recording or a path, got {type(targets).__name__}")
        if not targets:
            raise ValueError("truth: expected at least one motion, got none")
        self.names: tuple[str, ...] = tuple(map(str, targets))
        self._radar = Pose() if radar_motion is None else as_motion("radar_motion", radar_motion)
        self._radii = {name: check.non_negative(f"radii[{name!r}]", r, "m") for name, r in (radii or {}).items()}
        if unknown := [name for name in self._radii if name not in self.names]:
            raise ValueError(
                f"radii: expected names of the truth, got {unknown[0]!r}; {check.near_names(unknown[0], self.names)}"
            )
        self._bodies = {name: target if isinstance(target, Body) else None for name, target in targets.items()}
        if with_radius := [name for name, body in self._bodies.items() if body is not None and name in self._radii]:
            raise ValueError(f"radii: expected none for {with_radius[0]!r}, a body whose surface is known")
        self._motions = {str(name): _motion_of(str(name), target) for name, target in targets.items()}

    @property
    def span(self) -> tuple[float, float] | None:
        """Common time span of the motions with ends [s]; None without such motions."""
        ends = [ends for motion in (*self._motions.values(), self._radar) for ends in _ends(motion)]
        return (max(first for first, _ in ends), min(last for _, last in ends)) if ends else None

    def at(self, times: ArrayLike) -> Truth:
        """Truth at common times [s]; NaN in gaps of the motions, and for targets not in front of the radar."""
        wanted = check.numbers("times", times)
        rows = np.full((len(TRUTH_FIELDS), len(wanted), len(self.names)), np.nan)
        radar_known = known_at(self._radar, wanted)
        for k, name in enumerate(self.names):
            known = radar_known & known_at(self._motions[name], wanted)
            if known.any():
                rows[:, known, k] = self._seen(name, wanted[known])
        return Truth(self.names, *rows)

    def _seen(self, name: str, times: _Floats) -> _Floats:
        """Range, velocity, azimuth and elevation of a target at known times, (4, time)."""
        motion, body = self._motions[name], self._bodies[name]
        radar, target = poses_at(self._radar, times), poses_at(motion, times)
        radar_rate, target_rate = _rates(self._radar, times), _rates(motion, times)

        # The true point of the target, in the target's axes.
        to_radar = radar[:, :, 3] - target[:, :, 3]
        points = np.zeros((len(times), 3))
        if body is not None:
            seen_from = np.einsum("tji,tj->ti", target[:, :, :3], to_radar)
            for k, time in enumerate(times if body.deformation is not None else times[:1]):
                chosen = slice(k, k + 1) if body.deformation is not None else slice(None)
                corners = body.vertices_at(float(time))[body.mesh.triangles]
                points[chosen] = nearest_points(seen_from[chosen], corners)

        # Its place and velocity relative to the radar, and the range rate along the line of sight.
        place = np.einsum("tij,tj->ti", target[:, :, :3], points) - to_radar
        velocity = np.einsum("tij,tj->ti", target_rate[:, :, :3], points) + target_rate[:, :, 3] - radar_rate[:, :, 3]
        seen_from_radar = np.einsum("tji,tj->ti", radar[:, :, :3], place)
        distance = np.linalg.norm(place, axis=1)
        rate = np.einsum("ti,ti->t", place, velocity) / np.maximum(distance, 1e-12)
        nearer = distance - self._radii.get(name, 0.0)
        seen = np.array([nearer, rate, *angles(seen_from_radar)])
        return np.where((seen_from_radar[:, 0] > _FRONT) & (nearer > _FRONT), seen, np.nan)


class RecordedTruth:
    """Truth of frames with interpolation: cubic Hermite for ranges with the velocities as slopes, linear for the rest.

    Parameters
    ----------
    times : (frame,) array_like
        Middle of every frame in common time [s].
    truth : Truth
        Arrays (frame, body).
    """

    def __init__(self, times: ArrayLike, truth: Truth) -> None:
        self.times: NDArray[np.float64] = check.numbers("times", times)
        self.truth: Truth = truth
        self.names: tuple[str, ...] = truth.names

    @property
    def span(self) -> tuple[float, float]:
        """Times of the first and the last frame [s]."""
        return float(self.times[0]), float(self.times[-1])

    def at(self, times: ArrayLike) -> Truth:
        """Truth at common times [s]; NaN outside of the frames, in gaps, and next to frames without truth."""
        wanted = check.numbers("times", times)
        right = np.clip(np.searchsorted(self.times, wanted), 1, max(len(self.times) - 1, 1))
        left, right = right - 1, np.minimum(right, len(self.times) - 1)
        step = self.times[right] - self.times[left]
        part = (wanted - self.times[left]) / np.where(step > 0.0, step, 1.0)
        usual = float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0
        slack = 1e-6 + 4.0 * np.spacing(np.abs(wanted))  # rounding of times, which may count from 1970
        at_left, at_right = (np.abs(wanted - self.times[end]) <= slack for end in (left, right))
        inside = (part >= 0.0) & (part <= 1.0) & (step <= _LONGEST_STEP * usual)

        def between(values: _Floats) -> _Floats:
            return (1.0 - part)[:, None] * values[left] + part[:, None] * values[right]

        rows = []
        for name in TRUTH_FIELDS:
            values = getattr(self.truth, name)
            found = between(values)
            if name == "range":
                found = found + self._bent(left, right, step, part)
            found = np.where(inside[:, None], found, np.nan)
            found = np.where(at_left[:, None], values[left], np.where(at_right[:, None], values[right], found))
            rows.append(found)
        return Truth(self.names, *rows)

    def _bent(self, left: NDArray[np.intp], right: NDArray[np.intp], step: _Floats, part: _Floats) -> _Floats:
        """Deviation of the Hermite cubic between two ranges from the line between them [m]."""
        line = self.truth.range[right] - self.truth.range[left]
        before, after = (step[:, None] * self.truth.velocity[end] - line for end in (left, right))
        t = part[:, None]
        bent: _Floats = t * (1.0 - t) * ((1.0 - t) * before - t * after)
        # Without velocities there are no slopes.
        return np.where(np.isnan(bent), 0.0, bent)


TruthOverTime = MovingTargets | RecordedTruth
"""Truth at any times."""


def with_names(truth: Truth, names: Sequence[str]) -> Truth:
    """Truth of the bodies with these names, (frame, body); NaN for unknown bodies."""
    rows = np.full((len(TRUTH_FIELDS), len(truth.range), len(names)), np.nan)
    for k, name in enumerate(names):
        if name in truth.names:
            column = truth.names.index(name)
            rows[:, :, k] = [getattr(truth, field)[:, column] for field in TRUTH_FIELDS]
    return Truth(tuple(names), *rows)


def known_at(motion: Motion, times: _Floats) -> NDArray[np.bool_]:
    """True for times at which a motion is known: outside of gaps and within its ends."""
    is_known = np.ones(len(times), dtype=bool)
    for part in with_factors([motion]):
        known: Callable[[ArrayLike], NDArray[np.bool_]] | None = getattr(part, "known", None)
        if known is not None:
            is_known &= np.asarray(known(times), dtype=bool)
    return is_known


def _ends(motion: Motion) -> list[tuple[float, float]]:
    """First and last times of a motion and its factors that are time series [s]."""
    series = [getattr(part, "times", None) for part in with_factors([motion])]
    return [(float(times[0]), float(times[-1])) for times in series if times is not None]


def _motion_of(name: str, target: object) -> Motion:
    """Motion of a target."""
    return motion_of(target) if isinstance(target, Body | PointTarget) else as_motion(f"truth[{name!r}]", target)


def _rates(motion: Motion, times: _Floats) -> _Floats:
    """Time derivatives of ``[rotation | position]`` at several times, (time, 3, 4)."""
    return np.array([motion.rate_at(float(time)) for time in times]).reshape(-1, 3, 4)


def nearest_points(places: _Floats, corners: _Floats) -> _Floats:
    """Points of triangles nearest to some places, (place, 3) [m].

    Parameters
    ----------
    places : (place, 3) float64
        In the coordinates of the triangles [m].
    corners : (triangle, 3, 3) float64
        Corners of at least one triangle, none degenerate [m].
    """
    from scipy.spatial import cKDTree  # here: importing radarcore imports numpy and nothing heavier

    if len(corners) == 0:
        raise ValueError("truth: expected a body with triangles, got an empty mesh")
    # A candidate's centre is not farther than the nearest corner plus the largest reach of a triangle.
    centres = corners.mean(axis=1)
    reach = float(np.linalg.norm(corners - centres[:, None], axis=-1).max())
    tree = cKDTree(centres)
    limits = cKDTree(corners.reshape(-1, 3)).query(places)[0] + reach
    candidates = tree.query_ball_point(places, limits * (1.0 + 1e-9))
    return np.array(
        [nearest_point(place, corners[near]) for place, near in zip(places, candidates, strict=True)]
    ).reshape(-1, 3)
