"""Detections of one object brought together: a person or a robot gives many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.processing.detection.point_cloud import COORDINATES, Detections
from radarcore.processing.tracking.kalman import Array, directions_of, normalized_squares

Indices = NDArray[np.int64]

_CROSSED = ~np.eye(4, dtype=bool)
"""Elements of a covariance off its diagonal."""

NO_PERIOD = 1e100
"""Period of a coordinate without one: no value is large enough to be wrapped."""

_NO_WEIGHT = 1e-300
"""Instead of a sum of weights that is 0."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """Detections in groups, one for each object, by increasing range of the centroid.

    Parameters
    ----------
    labels : (detection,) int
        Index of the cluster of each detection; -1 for one that is alone among fewer than `min_detections`.
    centroids : Detections
        Means of the clusters, weighted by power. Their covariance is that of the mean: of the errors of the detections,
        and of the spread of the cluster as far as it does not average out. Their `snr_db` is that of the powers,
        added; a cluster is resolved if all its detections are.
    extent : (cluster, 4) float64
        Standard deviation of the detections about the centroid, weighted by power: range [m], velocity [m/s], azimuth,
        elevation [rad]. NaN for coordinates that are not told.
    num_detections : (cluster,) int

    See Also
    --------
    cluster : Makes them.

    Examples
    --------
    >>> found = rc.Detections([1.0, 1.1, 3.0], [0.5, 0.5, 0.0], [0.0, 0.0, 0.2], np.zeros(3), [20.0, 20.0, 12.0])
    >>> clusters = rc.cluster(found, distance=0.3)
    >>> clusters.num_detections.tolist(), clusters.centroids.range.round(2).tolist()
    ([2, 1], [1.05, 3.0])
    """

    labels: Indices
    centroids: Detections
    extent: Array
    num_detections: Indices

    def __len__(self) -> int:
        return len(self.centroids)


def cluster(
    detections: Detections,
    *,
    distance: float | None = 0.3,
    velocity: float | None = None,
    num_deviations: float | None = None,
    min_detections: int = 1,
    velocity_ambiguity: float | None = None,
) -> Clusters:
    """Group the detections of each object: a chain of near neighbours connects them.

    Two detections are neighbours if both their distance and their difference of velocities are within the limits; or,
    if `num_deviations` is given, if their Mahalanobis distance is. The distance is between points in space if all
    detections have an azimuth, and between ranges otherwise. With `min_detections` above 1 this is DBSCAN (Ester et
    al., 1996): chains pass through detections that have this number of neighbours, counting themselves.

    Parameters
    ----------
    detections : Detections
    distance : float or None
        Largest distance of two near detections [m]; None: any.
    velocity : float or None
        Largest difference of their velocities [m/s]; None: any.
    num_deviations : float, optional
        Largest Mahalanobis distance of two near detections, instead of `distance` and `velocity`. All detections need a
        covariance.
    min_detections : int
        Detections that make an object; fewer are labelled -1.
    velocity_ambiguity : float, optional
        Period of the measured velocities [m/s], ``2 * Waveform.max_velocity``: velocities are compared and averaged
        modulo this. Default: none.

    Returns
    -------
    clusters : Clusters

    Raises
    ------
    TypeError
        For anything but `Detections`.
    ValueError
        For limits that are not positive, and without covariances where they are asked for.

    See Also
    --------
    processing.Clusters : What comes back.
    detect : Detections of a frame.
    track : Tracks of clusters over time.

    Examples
    --------
    >>> found = rc.Detections([1.0, 1.1, 3.0], [0.5, 0.5, 0.0], [0.0, 0.0, 0.2], np.zeros(3), [20.0, 20.0, 12.0])
    >>> rc.cluster(found, distance=0.3).labels.tolist()
    [0, 0, 1]
    """
    check.instance("detections", detections, Detections)
    limits = (
        None if distance is None else check.positive("distance", distance, "m"),
        None if velocity is None else check.positive("velocity", velocity, "m/s"),
    )
    fewest = check.count("min_detections", min_detections)
    if velocity_ambiguity is not None:
        check.positive("velocity_ambiguity", velocity_ambiguity, "m/s")
    periods = periods_of(velocity_ambiguity)
    values, covariance = coordinates(detections), covariances(detections)
    if num_deviations is None:
        near = pairs_within(values, *limits, periods)
    else:
        near = _pairs_within_deviations(values, covariance, check.positive("num_deviations", num_deviations), periods)
    labels, found = groups(values, levels(detections), covariance, connected(len(values), near, fewest), periods)
    is_resolved = np.ones(len(found.counts), dtype=bool)
    is_resolved[labels[(labels >= 0) & ~detections.is_resolved]] = False
    means: dict[str, Any] = dict(zip(COORDINATES, found.values.T, strict=True))
    means |= {"snr_db": found.snr_db, "covariance": found.covariance, "is_resolved": is_resolved, "alternatives": None}
    centroids = replace(detections, **means)
    extent = np.sqrt(np.diagonal(found.spread, axis1=1, axis2=2))
    return Clusters(labels, centroids, np.where(np.isnan(found.values), np.nan, extent), found.counts)


class Groups(NamedTuple):
    """Groups of detections, by increasing range of their means."""

    values: Array
    """Means (group, n)."""
    covariance: Array
    """Of the means (group, n, n)."""
    spread: Array
    """Covariance of the detections about the means (group, n, n)."""
    snr_db: Array
    """Level of the added powers (group,) [dB]."""
    counts: Indices
    """Detections (group,)."""


def periods_of(velocity_ambiguity: float | None) -> Array:
    """Periods of range, velocity, azimuth and elevation."""
    return np.array([NO_PERIOD, velocity_ambiguity or NO_PERIOD, 2.0 * np.pi, 2.0 * np.pi])


def coordinates(detections: Detections) -> Array:
    """Range, velocity, azimuth and elevation (detection, 4); NaN for what is not told."""
    values = np.array([detections.range, detections.velocity, detections.azimuth, detections.elevation]).T
    return np.where(np.isfinite(values), values, np.nan)


def covariances(detections: Detections) -> Array:
    """Of range, velocity, azimuth and elevation (detection, 4, 4); errors whose correlation is NaN have none."""
    return np.where(np.isnan(detections.covariance) & _CROSSED, 0.0, detections.covariance)


def levels(detections: Detections) -> Array:
    """Power over the noise (detection,) [dB]; 0 where it is not told."""
    return np.where(np.isfinite(detections.snr_db), detections.snr_db, 0.0)


def wrapped(difference: Array, period: Array | float) -> Array:
    """Differences of what is known modulo a period, the nearest to 0."""
    return difference - period * np.rint(difference / period)


def pairs_within(values: Array, distance: float | None, velocity: float | None, periods: Array) -> Indices:
    """Pairs of detections within a distance and a difference of velocities, each pair once, (2, pair).

    `values` are range, velocity and perhaps azimuth and elevation, (detection, 2 to 4). An unknown velocity is within
    any difference.
    """
    if distance is None:
        one, other = np.triu_indices(len(values), 1)
    else:
        from scipy.spatial import cKDTree  # here: importing radarcore imports numpy and nothing heavier

        points, towards = values[:, :1], directions_of(values)
        if not np.isnan(towards).any():
            points = points * towards
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        one, other = known[cKDTree(points[known]).query_pairs(distance, output_type="ndarray")].T
    if velocity is not None:
        is_near = ~(np.abs(wrapped(values[one, 1] - values[other, 1], periods[1])) > velocity)
        one, other = one[is_near], other[is_near]
    return np.array([one, other])


def _pairs_within_deviations(values: Array, covariance: Array, num_deviations: float, periods: Array) -> Indices:
    """Pairs of detections within a Mahalanobis distance, likewise."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    lacks = np.isfinite(values) & ~(variance > 0.0)
    if lacks.any():
        row, column = np.argwhere(lacks)[0]
        raise ValueError(
            f"num_deviations: expected detections with positive variances, got {variance[row, column]} for the "
            f"{COORDINATES[column]} of detection {row}"
        )
    # Near pairs are also near in range.
    farthest = num_deviations * float(np.sqrt(2.0 * variance[:, 0].max(initial=0.0))) * (1.0 + 1e-9)
    pairs = pairs_within(values[:, :2], None if np.isnan(values[:, 0]).any() else farthest, None, periods)
    one, other = pairs
    squares, _ = normalized_squares(wrapped(values[one] - values[other], periods), covariance[one] + covariance[other])
    return pairs[:, squares <= num_deviations**2]


def connected(number: int, pairs: Indices, fewest: int = 1) -> Indices:
    """Label of the group of each detection, -1 outside of groups; `pairs` (2, pair) are neighbours, each pair once."""
    is_core = 1 + np.bincount(pairs.ravel(), minlength=number) >= fewest
    inner = pairs[:, is_core[pairs].all(axis=0)]
    labels, (first, second) = np.arange(number), inner
    while (labels[first] != labels[second]).any():  # each takes its neighbours' lowest label, and that one's label
        lowest = np.minimum(labels[first], labels[second])
        np.minimum.at(labels, first, lowest)
        np.minimum.at(labels, second, lowest)
        labels = labels[labels]
    labels = np.asarray((labels == np.arange(number)).cumsum()[labels]) - 1  # in the order of the first members
    if is_core.all():
        return labels

    # Other detections belong to the first group with a core near them, or to none.
    found = np.where(is_core, labels, number)
    for one, other in (pairs, pairs[::-1]):
        border = ~is_core[one] & is_core[other]
        np.minimum.at(found, one[border], labels[other[border]])
    return np.where(found == number, -1, found)


def groups(values: Array, level: Array, covariance: Array, labels: Indices, periods: Array) -> tuple[Indices, Groups]:
    """Groups of the detections with equal labels from 0 on, and the index of the group of each (-1: none).

    `values` (detection, n), their `covariance` and `periods` are of as many coordinates as wanted.
    """
    order = labels.argsort(kind="stable")[np.count_nonzero(labels < 0) :]
    if len(order) == 0:
        none = np.zeros(0)
        return labels, Groups(values[:0], covariance[:0], covariance[:0], none, none.astype(np.int64))
    counts = np.bincount(labels[order])
    (names,) = counts.nonzero()
    counts = counts[names]
    starts, group = counts.cumsum() - counts, np.arange(len(names)).repeat(counts)

    # Weights of each coordinate, adding up to 1 over the detections that tell it.
    values, level = values[order], level[order]
    strongest = np.maximum.reduceat(level, starts)
    power = 10.0 ** (0.1 * (level - strongest[group]))
    is_known = ~np.isnan(values)
    weight = power[:, None] * is_known
    total = np.add.reduceat(weight, starts)
    weight /= np.maximum(total, _NO_WEIGHT)[group]

    # Means about a value that the group has, so that angles and velocities may go around.
    reference = np.fmax.reduceat(values, starts)
    apart = np.where(is_known, wrapped(values - reference[group], periods), 0.0)
    offset = np.add.reduceat(weight * apart, starts)
    mean = wrapped(reference + offset, periods)
    apart -= offset[group]

    # Spread, and the covariance of the mean: of the errors, and of the spread over the effective number of detections.
    # A coordinate that a detection does not tell has no weight.
    scaled = np.sqrt(weight) * apart
    spread = np.add.reduceat(scaled[:, :, None] * scaled[:, None, :], starts)
    root = np.sqrt(np.add.reduceat(np.square(weight), starts))
    shares = weight[:, :, None] * weight[:, None, :]
    errors = np.where(shares == 0.0, 0.0, shares * covariance[order])
    of_mean = np.add.reduceat(errors, starts) + spread * (root[:, :, None] * root[:, None, :])
    is_unknown = total == 0.0
    of_mean[is_unknown[:, :, None] | is_unknown[:, None, :]] = np.nan

    by_range = mean[:, 0].argsort(kind="stable")
    place = np.full(int(names.max()) + 2, -1)  # the last of a detection without a group
    place[names[by_range]] = np.arange(len(names))
    snr_db = strongest + 10.0 * np.log10(np.add.reduceat(power, starts))
    means = mean[by_range], of_mean[by_range], spread[by_range]
    return place[labels], Groups(*means, snr_db[by_range], counts[by_range])
