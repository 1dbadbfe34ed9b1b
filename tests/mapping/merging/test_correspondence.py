"""Variants of matching: by difference, and without what is as similar turned by 180 degrees."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, moved

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.correspondence import (
    CorrespondenceSettings,
    _common_distances,
    _compare_descriptors,
    _like_clusters,
    _like_triangles,
    match_corners,
)
from lidarium.mapping.merging.described_map import describe_map
from lidarium.mapping.merging.descriptors import Descriptors

TRUTH = about_middle(0.5 * math.pi, apartment())


@pytest.fixture(scope="module")
def maps():
    return describe_map(apartment(), RESOLUTION), describe_map(moved(apartment(), TRUTH), RESOLUTION)


def plain(first, second, shift):
    """1 less half the mean square of the difference over the mean square, by its definition."""
    turned = np.roll(second, shift, axis=1)
    return 1.0 - 0.5 * float(((first - turned) ** 2).sum()) / (0.5 * float((first**2 + second**2).sum()))


@pytest.mark.parametrize("measure", ["correlation", "difference"])
def test_equal_descriptors_are_alike_by_every_measure(maps, measure):
    one = maps[0].descriptors
    settings = CorrespondenceSettings(measure=measure, is_known_only=False)
    similarity, shift = _compare_descriptors(one, one, settings)
    np.testing.assert_allclose(np.diag(similarity), 1.0, atol=1e-4)
    np.testing.assert_allclose(np.diag(shift), 0.0, atol=1e-6)


def test_the_difference_is_that_of_its_definition():
    generator = np.random.default_rng(1)
    values = generator.normal(size=(2, 3, 16)).astype(np.float32)
    one = Descriptors(values, np.ones_like(values))
    settings = CorrespondenceSettings(measure="difference", is_known_only=False, shift_window=math.pi)
    similarity, shift = _compare_descriptors(one, one, settings)
    columns = round(float(shift[0, 1]) / (2.0 * math.pi / 16))
    assert similarity[0, 1] == pytest.approx(plain(values[0], values[1], columns), abs=1e-4)
    assert similarity[0, 1] <= 1.0


def test_a_louder_copy_correlates_and_differs():
    values = np.random.default_rng(2).normal(size=(1, 3, 16)).astype(np.float32)
    one, loud = (Descriptors(factor * values, np.ones_like(values)) for factor in (1.0, 3.0))
    alike, _ = _compare_descriptors(one, loud, CorrespondenceSettings())
    differs, _ = _compare_descriptors(one, loud, CorrespondenceSettings(measure="difference"))
    assert alike[0, 0] == pytest.approx(1.0, abs=1e-4)
    assert differs[0, 0] == pytest.approx(0.6, abs=1e-4)


@pytest.mark.parametrize("options", [{"measure": "difference"}, {"excludes_opposite": True}])
def test_variants_find_corners_of_one_place(maps, options):
    a, b = maps
    settings = CorrespondenceSettings(**options)
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, settings)
    apart = np.linalg.norm(TRUTH.apply(a.corners.points[matches.first]) - b.corners.points[matches.second], axis=1)
    assert np.count_nonzero(apart < 0.15) >= 10


def test_what_is_as_similar_from_behind_is_no_match():
    column = np.cos(4.0 * math.pi * np.arange(16) / 16)
    values = np.tile(column, (1, 3, 1)).astype(np.float32)
    one = Descriptors(values, np.ones_like(values))
    for excludes, expected in ((False, 1.0), (True, -1.0)):
        similarity, _ = _compare_descriptors(one, one, CorrespondenceSettings(excludes_opposite=excludes))
        assert similarity[0, 0] == pytest.approx(expected, abs=1e-4)


def test_an_unknown_measure_is_refused():
    with pytest.raises(ValueError, match="measure of correspondence is 'sum'"):
        CorrespondenceSettings(measure="sum")


MOTION = Transform(3.0, -7.0, 2.1)
COMPARED = (
    lambda a, b: _common_distances(a, b, 0.01),
    lambda a, b: _like_triangles(a, b, 0.01),
    lambda a, b: _like_clusters(a, b, 0.01, 4.0),
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
    found = _like_clusters(first, second, 0.08, 3.0)
    np.testing.assert_allclose(found, plain_clusters(first, second, 0.08, 3.0))


def test_corners_beyond_the_radius_do_not_count():
    points = scattered(10)
    far = points + np.array([100.0, 0.0])
    similarity = _like_clusters(points, np.concatenate([points, far]), 0.01, 4.0)
    assert np.allclose(similarity[:, :10], similarity[:, 10:])
