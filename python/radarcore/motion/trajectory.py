"""Splines through poses at given times, in segments where times are missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.geometry.pose import Pose, as_pose, not_a_pose, transforms
from radarcore.geometry.rotation import Matrix, cross_matrix, rotations_about
from radarcore.motion.series import Ends, Segments, check_steps, steps_between
from radarcore.records import sealed

WITHIN_GAPS = ("error", "interpolate")
"""Ways to treat times within a gap."""


@sealed
class Trajectory:
    """A smooth motion through poses at given times: C2 splines of position and rotation.

    Positions follow a natural-ended cubic spline, rotations a `scipy.spatial.transform.RotationSpline`, so velocity and
    angular velocity are continuous and known in closed form.

    Parameters
    ----------
    times : (n,) array_like
        Increasing [s], at least two.
    poses : sequence of Pose
        One per time.
    extrapolate : "hold", "continue" or "error", optional
        Before the first and after the last time the body rests, continues at its velocity and angular velocity there,
        or a ValueError is raised. Default: it continues, with one warning.
    max_gap : float, optional
        Neighbouring times with a larger distance [s] bound a gap, for example where motion capture lost the body. Every
        segment between gaps has its own splines; a pose with gaps on both sides has no velocity and is left out.
        Default: there are no gaps.
    within_gaps : "error" or "interpolate", optional
        A time within a gap raises a ValueError (default), or the splines go on through all gaps.

    See Also
    --------
    Linear : Constant velocity.
    Live : Motion of a program that has a pose now.

    Examples
    --------
    >>> path = rc.Trajectory([0.0, 1.0, 2.0], [rc.Pose([x, 0.0, 0.0]) for x in (1.0, 2.0, 3.0)])
    >>> path.at(0.5).position
    array([1.5, 0. , 0. ])
    >>> path.rate_at(0.5)[:, 3].round(3)
    array([1., 0., 0.])
    """

    def __init__(
        self,
        times: ArrayLike,
        poses: Sequence[Pose],
        *,
        extrapolate: str | None = None,
        max_gap: float | None = None,
        within_gaps: str = "error",
    ) -> None:
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation, RotationSpline

        self.times: NDArray[np.float64] = check.increasing("times", times)
        self.poses: tuple[Pose, ...] = tuple(poses)
        if len(self.poses) != len(self.times):
            raise ValueError(f"poses: expected {len(self.times)}, one per time, got {len(self.poses)}")
        for k, pose in enumerate(self.poses):
            if not isinstance(pose, Pose):
                raise not_a_pose("poses", "Pose", pose, f" at index {k}")
        self.max_gap: float | None = None if max_gap is None else check.positive("max_gap", max_gap, "s")
        self.within_gaps: str = check.choice("within_gaps", within_gaps, WITHIN_GAPS)
        if self.max_gap is not None:
            kept = Segments.neighbours(self.times, self.max_gap)
            self.times = check.frozen(self.times[kept])
            self.poses = tuple(self.poses[k] for k in kept)
        self._segments = Segments("Trajectory", self.times, self.max_gap)

        positions = np.array([pose.position for pose in self.poses])
        rotations = np.array([pose.rotation for pose in self.poses])
        parts = [slice(0, len(self.times))] if self.within_gaps == "interpolate" else self._segments.parts
        self._positions = [CubicSpline(self.times[part], positions[part], bc_type="natural") for part in parts]
        self._rotations = [RotationSpline(self.times[part], Rotation.from_matrix(rotations[part])) for part in parts]
        speeds = [
            float(max(np.abs(self._positions[k](end, 1)).max(), np.abs(self._rotations[k](end, 1)).max()))
            for k, end in ((0, self.times[0]), (-1, self.times[-1]))
        ]
        check_steps("times, poses", self.times, steps_between(transforms(rotations, positions)))
        self._ends = Ends("Trajectory", self.times, extrapolate, (speeds[0], speeds[1]))

    @property
    def extrapolate(self) -> str | None:
        """As given."""
        return self._ends.choice

    @property
    def gaps(self) -> Matrix:
        """Times between which the poses are not known, (gap, 2) [s]."""
        return self._segments.gaps

    def known(self, times: ArrayLike) -> NDArray[np.bool_]:
        """True at times (n,) [s] within the series and outside of its gaps."""
        return self._segments.known(times)

    def at(self, time: float) -> Pose:
        """The pose at a time [s]."""
        return as_pose(self.poses_at([time])[0])

    def poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` at several times [s], (n, 3, 4)."""
        inside, elapsed = self._ends.split(times)
        if len(self._positions) == 1:
            return self._segment_poses(0, inside, elapsed)
        inside, segment = self._segments.split(inside)
        poses = np.empty((len(inside), 3, 4))
        for k in np.unique(segment).tolist():
            here = segment == k
            poses[here] = self._segment_poses(k, inside[here], elapsed[here])
        return poses

    def rate_at(self, time: float) -> Matrix:
        """Time derivative of ``[rotation | position]`` at a time [s], (3, 4)."""
        inside, _ = self._ends.split(time)
        if not self._ends.moves(time):
            return np.zeros((3, 4))
        k = 0
        if len(self._positions) > 1:
            clipped, segment = self._segments.split(inside[None])
            inside, k = clipped[0], int(segment[0])
        # The spline's angular velocity is in body axes: d/dt R = R (omega x).
        turning = self.at(time).rotation @ cross_matrix(self._rotations[k](inside, 1))
        return transforms(turning, self._positions[k](inside, 1))

    def _segment_poses(self, k: int, inside: Matrix, elapsed: Matrix) -> Matrix:
        """Poses (n, 3, 4) on a segment at times (n,), and the elapsed times (n,) after or before them."""
        spline, turning = self._positions[k], self._rotations[k]
        rotation, position = turning(inside).as_matrix(), spline(inside)
        beyond = elapsed[:, None]
        if beyond.any():
            # The spline's angular velocity is in body axes.
            rotation = rotation @ rotations_about(turning(inside, 1) * beyond)
            position = position + spline(inside, 1) * beyond
        return transforms(rotation, position)
