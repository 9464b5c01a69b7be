"""Detections of one object brought together: a person or a robot gives many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.processing.detection.point_cloud import COORDINATES, Detections
from radarcore.processing.tracking.kalman import Array, normalized_squares

Indices = NDArray[np.int64]

_MOST_AT_ONCE = 2**15
"""Pairs per block: some 20 MB."""

_CROSSED = ~np.eye(4, dtype=bool)
"""Elements of a covariance off its diagonal."""

_NO_PERIOD = 1e100
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
        labels = connected(len(values), lambda: [near], fewest)
    else:
        number = check.positive("num_deviations", num_deviations)
        labels = connected(len(values), lambda: _near_pairs(values, covariance, number, periods), fewest)
    level = levels(detections)
    labels, found = groups(values, level, covariance, labels, periods)
    distances, velocities, azimuths, elevations = found.values.T
    centroids = Detections(
        distances,
        velocities,
        azimuths,
        elevations,
        found.strongest + 10.0 * np.log10(found.power),
        found.covariance,
        detections.time,
        np.bincount(labels[labels >= 0], ~detections.is_resolved[labels >= 0], len(found.counts)) == 0,
        detections.ambiguous_beyond,
    )
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
    strongest: Array
    """Largest level (group,) [dB]."""
    power: Array
    """Sum of the powers (group,), over that of the strongest."""
    counts: Indices
    """Detections (group,)."""


def periods_of(velocity_ambiguity: float | None) -> Array:
    """Periods of range, velocity, azimuth and elevation."""
    return np.array([_NO_PERIOD, velocity_ambiguity or _NO_PERIOD, 2.0 * np.pi, 2.0 * np.pi])


def coordinates(detections: Detections) -> Array:
    """Range, velocity, azimuth and elevation (detection, 4); NaN for what is not told."""
    values = np.array([detections.range, detections.velocity, detections.azimuth, detections.elevation]).T
    is_told = np.isfinite(values)
    return values if is_told.all() else np.where(is_told, values, np.nan)


def covariances(detections: Detections) -> Array:
    """Of range, velocity, azimuth and elevation (detection, 4, 4); errors whose correlation is NaN have none."""
    covariance = detections.covariance
    is_unknown = np.isnan(covariance)
    return np.where(is_unknown & _CROSSED, 0.0, covariance) if is_unknown.any() else covariance


def levels(detections: Detections) -> Array:
    """Power over the noise (detection,) [dB]; 0 where it is not told."""
    is_told = np.isfinite(detections.snr_db)
    return detections.snr_db if is_told.all() else np.where(is_told, detections.snr_db, 0.0)


def wrapped(difference: Array, period: Array) -> Array:
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

        points = values[:, :1]
        if values.shape[1] > 2 and not np.isnan(values[:, 2]).any():
            elevation = np.nan_to_num(values[:, 3]) if values.shape[1] > 3 else 0.0
            points = points * unit_vectors(values[:, 2], elevation)
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        one, other = known[cKDTree(points[known]).query_pairs(distance, output_type="ndarray")].T
    pairs = np.array([one, other])
    if velocity is None:
        return pairs
    difference = wrapped(values[one, 1] - values[other, 1], periods[1])
    return pairs[:, ~(np.abs(difference) > velocity)]


def connected(number: int, blocks: Callable[[], Iterable[Indices]], fewest: int = 1) -> Indices:
    """Label of the group of each detection, -1 outside of groups.

    `blocks` gives the pairs of neighbours, each pair once, as arrays (2, pair): memory does not grow with their number.
    """
    from scipy.sparse import coo_array  # here: as above
    from scipy.sparse.csgraph import connected_components

    is_core = np.ones(number, dtype=bool)
    if fewest > 1:
        counts = np.ones(number, dtype=np.int64)
        for pairs in blocks():
            counts += np.bincount(pairs.ravel(), minlength=number)
        is_core = counts >= fewest

    # Each detection is connected with a node for its group so far, and with its neighbours in the next block.
    labels = np.arange(number)
    for pairs in blocks():
        inner = pairs[:, is_core[pairs].all(axis=0)]
        if inner.shape[1] == 0:
            continue
        edges = np.concatenate([[np.arange(number), number + labels], inner], axis=1)
        graph = coo_array((np.ones(edges.shape[1]), edges), shape=(2 * number, 2 * number))
        labels = connected_components(graph, directed=False)[1][:number].astype(np.int64)
    if fewest == 1:
        return labels

    # Other detections belong to the first group with a core near them, or to none.
    found = np.where(is_core, labels, number)
    for pairs in blocks():
        for one, other in (pairs, pairs[::-1]):
            border = ~is_core[one] & is_core[other]
            np.minimum.at(found, one[border], labels[other[border]])
    return np.where(found == number, -1, found)


def groups(values: Array, level: Array, covariance: Array, labels: Indices, periods: Array) -> tuple[Indices, Groups]:
    """Groups of the detections with equal labels from 0 on, and the index of the group of each (-1: none).

    `values` (detection, n), their `covariance` and `periods` are of as many coordinates as wanted.
    """
    order = np.argsort(labels, kind="stable")
    order = order[labels[order] >= 0]
    if len(order) == 0:
        none = np.zeros(0)
        return labels, Groups(values[:0], covariance[:0], covariance[:0], none, none, none.astype(np.int64))
    sorted_labels = labels[order]
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = sorted_labels[1:] != sorted_labels[:-1]
    starts = is_first.nonzero()[0]
    group = is_first.cumsum() - 1
    counts = np.bincount(group)

    # Weights of each coordinate, adding up to 1 over the detections that tell it.
    values, level = values[order], level[order]
    strongest = np.maximum.reduceat(level, starts)
    power = 10.0 ** (0.1 * (level - strongest[group]))
    told = ~np.isnan(values)
    weight = power[:, None] * told
    total = np.add.reduceat(weight, starts)
    weight /= np.maximum(total, _NO_WEIGHT)[group]

    # Means about a value that the group has, so that angles and velocities may go around.
    reference = np.fmax.reduceat(values, starts)
    apart = wrapped(values - reference[group], periods)
    apart[~told] = 0.0
    offset = np.add.reduceat(weight * apart, starts)
    mean = wrapped(reference + offset, periods)
    apart -= offset[group]

    # Spread, and the covariance of the mean: of the errors, and of the spread over the effective number of detections.
    # A coordinate that a detection does not tell has no weight.
    scaled = np.sqrt(weight) * apart
    spread = np.add.reduceat(scaled[:, :, None] * scaled[:, None, :], starts)
    root = np.sqrt(np.add.reduceat(np.square(weight), starts))
    shares = weight[:, :, None] * weight[:, None, :]
    errors = shares * covariance[order]
    errors[shares == 0.0] = 0.0
    of_mean = np.add.reduceat(errors, starts) + spread * (root[:, :, None] * root[:, None, :])
    untold = total == 0.0
    of_mean[untold[:, :, None] | untold[:, None, :]] = np.nan

    by_range = np.argsort(mean[:, 0], kind="stable")
    place = np.full(len(labels) + 1, -1)
    place[sorted_labels[starts[by_range]]] = np.arange(len(starts))
    power = np.add.reduceat(power, starts)
    found = Groups(
        mean[by_range], of_mean[by_range], spread[by_range], strongest[by_range], power[by_range], counts[by_range]
    )
    return place[labels], found


def _near_pairs(values: Array, covariance: Array, num_deviations: float, periods: Array) -> Iterator[Indices]:
    """Pairs within a Mahalanobis distance, (2, n) at a time."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    lacks = np.isfinite(values) & ~(variance > 0.0)
    if lacks.any():
        row, column = np.argwhere(lacks)[0]
        raise ValueError(
            f"num_deviations: expected detections with positive variances, got {variance[row, column]} for the "
            f"{COORDINATES[column]} of detection {row}"
        )
    # Near pairs are also near in range: pair each detection with the next ones in range, up to the last near one.
    number, ranges = len(values), values[:, 0]
    order = np.argsort(ranges, kind="stable")
    farthest = ranges + num_deviations * np.sqrt(variance[:, 0] + variance[:, 0].max(initial=0.0)) * (1.0 + 1e-9)
    last = np.full(number, number)
    if not np.isnan(ranges).any():
        last = np.searchsorted(ranges[order], farthest[order], side="right")
    begins = np.concatenate([[0], np.cumsum(last - np.arange(number) - 1)])  # first pair of each detection
    for begin in range(0, int(begins[-1]), _MOST_AT_ONCE):
        pair = np.arange(begin, min(begin + _MOST_AT_ONCE, begins[-1]))
        row = np.searchsorted(begins, pair, side="right") - 1
        one, other = order[row], order[row + 1 + pair - begins[row]]
        differences = wrapped(values[one] - values[other], periods)
        squares, _ = normalized_squares(differences, covariance[one] + covariance[other])
        yield np.stack([one, other])[:, squares <= num_deviations**2]
