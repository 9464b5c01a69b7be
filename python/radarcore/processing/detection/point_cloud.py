"""Detections of a frame: a point cloud with covariances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.records import made_of, sealed

COORDINATES = ("range", "velocity", "azimuth", "elevation")
"""Coordinates of a detection, in the order of its covariance."""


@sealed
@dataclass(eq=False)
class Detections:
    """Detections of a frame, by increasing range; NaN for unobservable coordinates.

    Parameters
    ----------
    range : (detection,) array_like
        Distance from the centre of the array at the middle of the frame [m].
    velocity : (detection,) array_like
        Range rate, receding positive [m/s].
    azimuth, elevation : (detection,) array_like
        Angles [rad], positive to the left and up.
    snr_db : (detection,) array_like
        Power over the noise [dB], after the transforms.
    covariance : (detection, 4, 4) array_like, optional
        Of range, velocity, azimuth and elevation, in their units; NaN for unobservable coordinates.
    time : float
        Middle of the frame [s].
    is_resolved : (detection,) array_like of bool, optional
        False if a single target does not explain the channels, as for two targets in one cell. Default: all True.
    ambiguous_beyond : float
        Largest unambiguous angle from the front [rad], see `Directions.ambiguous_beyond`.
    alternatives : (detection, alternative, 2) array_like, optional
        Azimuth and elevation [rad] of other directions with the same phases, see `Directions.alternatives`. Default:
        none.

    See Also
    --------
    detect : Detections of a frame.
    cluster : Groups of them.
    Tracker.update : Tracks from them.

    Examples
    --------
    >>> found = rc.Detections([1.0, 2.0], [0.5, 0.0], np.deg2rad([0.0, 30.0]), [0.0, 0.0], [20.0, 12.0])
    >>> found[found.snr_db > 15.0].range.tolist(), found.position.round(2).tolist()
    ([1.0], [[1.0, 0.0, 0.0], [1.73, 1.0, 0.0]])
    """

    range: NDArray[np.float64]
    velocity: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    snr_db: NDArray[np.float64]
    covariance: NDArray[np.float64] = None  # type: ignore[assignment]  # __post_init__ puts the default in
    time: float = 0.0
    is_resolved: NDArray[np.bool_] = None  # type: ignore[assignment]  # likewise
    ambiguous_beyond: float = 0.5 * np.pi
    alternatives: NDArray[np.float64] = None  # type: ignore[assignment]  # likewise

    def __post_init__(self) -> None:
        number = np.size(self.range)
        vars(self).update({name: _numbers(name, getattr(self, name), (number,)) for name in (*COORDINATES, "snr_db")})
        covariance: Any = self.covariance
        resolved: Any = self.is_resolved
        others: Any = self.alternatives
        covariance = np.full((number, 4, 4), np.nan) if covariance is None else covariance
        resolved = np.ones(number, bool) if resolved is None else np.array(resolved, bool, ndmin=1)
        others = np.zeros((number, 0, 2)) if others is None else others
        self.covariance = _numbers("covariance", covariance, (number, 4, 4))
        self.time = check.number("time", self.time, "s")
        self.is_resolved = check.frozen(check.shaped("is_resolved", resolved, (number,)))
        self.ambiguous_beyond = check.positive("ambiguous_beyond", self.ambiguous_beyond, "rad")
        self.alternatives = _numbers("alternatives", others, (number, None, 2))

    def __len__(self) -> int:
        return len(self.range)

    def __getitem__(self, which: Any) -> Detections:
        """Some of the detections: by a slice, indices or a mask."""
        if isinstance(which, int | np.integer):
            which = [which]
        names = (*COORDINATES, "snr_db", "covariance", "is_resolved", "alternatives")
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    @property
    def position(self) -> NDArray[np.float64]:
        """Points in the sensor frame, (detection, 3) [m]; an unobservable elevation counts as 0."""
        return self.range[:, None] * unit_vectors(self.azimuth, np.nan_to_num(self.elevation))


def detections_of(
    columns: NDArray[np.float64],
    covariance: NDArray[np.float64],
    is_resolved: NDArray[np.bool_],
    alternatives: NDArray[np.float64],
    time: float,
    ambiguous_beyond: float,
) -> Detections:
    """Detections from new arrays of the shapes above, not checked; `columns` (5, detection) ends with `snr_db`."""
    fields = dict(zip((*COORDINATES, "snr_db"), check.frozen(columns), strict=True))
    return made_of(
        Detections,
        fields
        | {
            "covariance": check.frozen(covariance),
            "time": time,
            "is_resolved": check.frozen(is_resolved),
            "ambiguous_beyond": ambiguous_beyond,
            "alternatives": check.frozen(alternatives),
        },
    )


def _numbers(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Numbers, NaN allowed, read-only."""
    return check.frozen(check.shaped(name, np.array(check.numbers(name, value), ndmin=1), shape))
