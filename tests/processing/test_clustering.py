"""Clusters of detections: groups, centroids and covariances worked out on paper."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.tracking.cluster import Clusters, cluster

NAN = np.nan


def detections(
    distance: Any, velocity: Any = None, azimuth: Any = None, elevation: Any = None, snr_db: Any = 0.0, **others: Any
) -> Detections:
    """Detections with what is given; NaN otherwise."""
    number = len(distance)
    columns = [np.full(number, NAN) if values is None else values for values in (velocity, azimuth, elevation)]
    return Detections(distance, *columns, np.broadcast_to(snr_db, number), **others)


def labels(*args: Any, **options: Any) -> list[int]:
    return cluster(*args, **options).labels.tolist()


def test_chain_of_near_detections_is_one_cluster_and_a_gap_divides_it() -> None:
    chain = detections(1.0 + 0.25 * np.arange(30))
    assert labels(chain, distance=0.2501) == [0] * 30
    assert labels(chain, distance=0.2499) == list(range(30))
    assert labels(detections([3.0, 1.0, 3.2, 1.2]), distance=0.3) == [1, 0, 1, 0]


@pytest.mark.parametrize("fewest", [1, 8])
def test_dense_detections_are_grouped_as_all_pairs_are(fewest: int) -> None:
    """DBSCAN by a matrix of all pairs."""
    rng = np.random.default_rng(fewest)
    deviation = rng.uniform(0.005, 0.015, 200)
    covariance = np.eye(4) * np.square(deviation)[:, None, None]
    dense = detections(rng.normal(5.0, 0.2, 200), np.zeros(200), covariance=covariance)
    found = cluster(dense, num_deviations=2.0, min_detections=fewest)

    is_near = np.abs(dense.range[:, None] - dense.range) <= 2.0 * np.hypot(deviation[:, None], deviation)
    is_core = is_near.sum(axis=1) >= fewest
    groups = connected_components(is_near & is_core & is_core[:, None])[1]
    same = found.labels[:, None] == found.labels
    both = is_core & is_core[:, None]
    np.testing.assert_array_equal(same[both], (groups[:, None] == groups)[both])
    has_core = (is_near & is_core).any(axis=1)
    np.testing.assert_array_equal(found.labels >= 0, has_core)
    assert ((is_near & is_core & same).any(axis=1) == has_core).all(), "each is with a core near it"


def test_a_cluster_is_resolved_where_all_of_its_detections_are() -> None:
    found = cluster(detections([1.0, 1.1, 3.0], is_resolved=[True, False, True], ambiguous_beyond=0.5), distance=0.3)
    assert found.centroids.is_resolved.tolist() == [False, True]
    assert found.centroids.ambiguous_beyond == 0.5
    with pytest.raises(ValueError, match=r"is_resolved: expected shape \(2,\), got \(1,\)"):
        detections([1.0, 2.0], is_resolved=[True])


def test_velocity_keeps_apart_what_has_one_range() -> None:
    crossing = detections([2.0, 2.0, 2.1, 2.1], [-1.0, 1.0, -0.8, 1.2])
    assert labels(crossing, distance=0.3, velocity=0.5) == [0, 1, 0, 1]
    assert labels(crossing, distance=0.3) == [0, 0, 0, 0]
    assert labels(crossing, distance=None, velocity=0.5) == [0, 1, 0, 1]


def test_distance_is_that_in_space_where_there_are_angles() -> None:
    # 60 degrees at 2 m: a distance of 2 m at any ranges; the same in elevation.
    sides = detections([2.0, 2.0, 2.0], None, np.deg2rad([-30.0, 30.0, 30.0]), np.deg2rad([0.0, 0.0, 60.0]))
    assert labels(sides, distance=1.9) == [0, 1, 2]
    assert labels(sides, distance=2.0 + 1e-9) == [0, 0, 0]
    assert labels(detections([2.0, 2.0], None, np.deg2rad([-30.0, 30.0])), distance=1.9) == [0, 1]
    # One without an azimuth: ranges are compared.
    assert labels(detections([2.0, 2.0], None, [-0.5, NAN]), distance=0.1) == [0, 0]


def test_groups_within_deviations_of_their_errors() -> None:
    covariance = np.full((3, 4, 4), NAN)
    covariance[:, :2, :2] = np.diag([0.1**2, 0.5**2])
    # 0.3 m and 1 m/s over sqrt(2) times the deviations: Mahalanobis distance sqrt(4.5 + 2).
    three = detections([1.0, 1.3, 9.0], [0.0, 1.0, 0.0], covariance=covariance)
    assert labels(three, num_deviations=np.sqrt(6.5) + 1e-9) == [0, 0, 1]
    assert labels(three, num_deviations=np.sqrt(6.5) - 1e-9) == [0, 1, 2]


def test_velocities_and_angles_go_around() -> None:
    covariance = np.broadcast_to(np.eye(4) * 1e-2, (2, 4, 4))
    around = detections([2.0, 2.0], [1.9, -1.9], [np.pi - 0.01, 0.01 - np.pi], [0.0, 0.0], covariance=covariance)
    assert labels(around, velocity=0.3) == [0, 1]
    found = cluster(around, velocity=0.3, velocity_ambiguity=4.0)
    assert found.labels.tolist() == [0, 0]
    assert abs(found.centroids.velocity[0]) == pytest.approx(2.0)
    assert abs(found.centroids.azimuth[0]) == pytest.approx(np.pi)
    np.testing.assert_allclose(found.extent[0], [0.0, 0.1, 0.01, 0.0], atol=1e-12)
    assert labels(around, num_deviations=1.5, velocity_ambiguity=4.0) == [0, 0]


def test_centroid_is_the_mean_weighted_by_power() -> None:
    """Powers 1 and 3: weights 1/4 and 3/4, so 2.3, spread 0.4 sqrt(3) / 4, level 10 log10 4."""
    found = cluster(detections([2.0, 2.4], [1.0, 0.0], snr_db=[0.0, 10.0 * np.log10(3.0)]), distance=0.5, velocity=1.5)
    assert found.centroids.range[0] == pytest.approx(2.3)
    assert found.centroids.velocity[0] == pytest.approx(0.25)
    assert found.centroids.snr_db[0] == pytest.approx(10.0 * np.log10(4.0))
    np.testing.assert_allclose(found.extent[0, :2], np.sqrt(3.0) / 4.0 * np.array([0.4, 1.0]))
    assert np.isnan(found.centroids.azimuth[0])
    assert np.isnan(found.extent[0, 2:]).all()


def test_covariance_of_a_centroid_has_errors_and_spread() -> None:
    """Weights 1/4 and 3/4: errors add up to (1/16 + 9/16) of one, and of the spread stays as much."""
    covariance = np.full((2, 4, 4), NAN)
    covariance[:, :2, :2] = [[0.04, 0.01], [0.01, 0.09]]
    pair = detections([2.0, 2.4], [1.0, 0.0], snr_db=[0.0, 10.0 * np.log10(3.0)], covariance=covariance)
    found = cluster(pair, distance=0.5)
    spread = 3.0 / 16.0 * np.outer([0.4, -1.0], [0.4, -1.0])
    np.testing.assert_allclose(found.centroids.covariance[0, :2, :2], 0.625 * (covariance[0, :2, :2] + spread))
    assert np.isnan(found.centroids.covariance[0, 2:]).all()
    alone = cluster(pair, distance=0.1)
    np.testing.assert_allclose(alone.centroids.covariance, covariance)


def test_a_coordinate_that_some_do_not_tell_is_the_mean_of_the_others() -> None:
    found = cluster(detections([2.0, 2.1, 2.2], [NAN, 0.4, 0.6], snr_db=[30.0, 0.0, 0.0]), velocity=1.0)
    assert found.labels.tolist() == [0, 0, 0]
    assert found.centroids.velocity[0] == pytest.approx(0.5)


def test_clusters_of_fewer_than_so_many_detections_are_noise() -> None:
    """Three of a chain have three near ones, themselves included, or belong to one that has; the pair has not."""
    some = detections([1.0, 1.1, 1.2, 3.0, 3.1, 5.0])
    assert labels(some, distance=0.11, min_detections=3) == [0, 0, 0, -1, -1, -1]
    assert labels(some, distance=0.11, min_detections=2) == [0, 0, 0, 1, 1, -1]
    found = cluster(some, distance=0.11, min_detections=4)
    assert found.labels.tolist() == [-1] * 6
    assert len(found) == len(found.centroids) == 0


def test_clusters_are_numbered_by_range_and_do_not_depend_on_order() -> None:
    rng = np.random.default_rng(2)
    distance, snr_db = rng.uniform(1.0, 4.0, 40), rng.uniform(0.0, 30.0, 40)
    order = rng.permutation(40)
    one = cluster(detections(distance, snr_db=snr_db), distance=0.1)
    other = cluster(detections(distance[order], snr_db=snr_db[order]), distance=0.1)
    np.testing.assert_array_equal(one.labels[order], other.labels)
    np.testing.assert_allclose(one.centroids.range, other.centroids.range, rtol=1e-14)
    assert (np.diff(one.centroids.range) > 0.0).all()


def test_no_detections_are_no_clusters() -> None:
    found = cluster(detections([]))
    assert isinstance(found, Clusters)
    assert len(found) == 0
    assert found.labels.shape == (0,)
    assert found.extent.shape == (0, 4)
    assert len(cluster(detections([NAN, 1.0, NAN]))) == 3


def test_memory_does_not_grow_with_the_number_of_all_pairs() -> None:
    far_apart = detections(np.arange(5000.0))
    tracemalloc.start()
    cluster(far_apart, distance=0.3)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6, "the indices of all pairs alone have 200 MB"
