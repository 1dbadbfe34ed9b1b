"""Corners are alike by what lies around them, however maps are turned."""

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.description.corner_neighbours import (
    common_distances,
    like_clusters,
    like_triangles,
)

MOTION = Transform(3.0, -7.0, 2.1)
COMPARED = (
    lambda a, b: common_distances(a, b, 0.01),
    lambda a, b: like_triangles(a, b, 0.01),
    lambda a, b: like_clusters(a, b, 0.01, 4.0),
)


def scattered(count=20, seed=0):
    return np.random.default_rng(seed).uniform(0.0, 8.0, (count, 2))


@pytest.mark.parametrize("compared", COMPARED)
def test_a_corner_is_most_like_itself_in_a_moved_map(compared):
    points = scattered()
    similarity = compared(points, MOTION.apply(points))
    assert np.allclose(np.diag(similarity), similarity.max(axis=1))
    assert np.count_nonzero(similarity.argmax(axis=1) == np.arange(len(points))) >= 19


@pytest.mark.parametrize("compared", COMPARED)
def test_few_corners_are_alike_to_none(compared):
    assert not compared(np.zeros((1, 2)), scattered(5)).any()


def plain_clusters(first, second, tolerance, radius):
    """As `like_clusters`, in loops over all pairs of corners."""
    similarity = np.zeros((len(first), len(second)))
    for i, p in enumerate(first):
        for j, q in enumerate(second):
            one, other = (
                [d for d in np.linalg.norm(points - at, axis=1).tolist() if 0.0 < d <= radius]
                for points, at in ((first, p), (second, q))
            )
            if min(len(one), len(other)) < 2:
                continue
            counts = [
                sum(any(abs(a - b) <= tolerance * max(a, b) for b in right) for a in left)
                for left, right in ((one, other), (other, one))
            ]
            similarity[i, j] = min(counts) / max(len(one), len(other))
    return similarity


@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_compared_by_the_distances_within_a_radius(seed):
    first, second = scattered(12, seed), scattered(15, seed + 10)
    second[:6] = MOTION.apply(first[:6])
    found = like_clusters(first, second, 0.08, 3.0)
    np.testing.assert_allclose(found, plain_clusters(first, second, 0.08, 3.0))


def test_corners_beyond_the_radius_do_not_count():
    points = scattered(10)
    far = points + np.array([100.0, 0.0])
    similarity = like_clusters(points, np.concatenate([points, far]), 0.01, 4.0)
    assert np.allclose(similarity[:, :10], similarity[:, 10:])
