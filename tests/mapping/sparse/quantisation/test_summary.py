"""Sums over each code's points."""

import numpy as np
import pytest
from scattered_points import room, searched

from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.summary import summary_of
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

POINTS = room(700)
WEIGHTS = np.random.default_rng(2).uniform(0.5, 4.0, len(POINTS))
# Two in the room, one far away that has all points of a corner, and one that has none.
CODES = np.concatenate([POINTS[[3, 99, 500]], [[90.0, 90.0, 90.0]]]).astype(np.float32)


@pytest.fixture(scope="module")
def summary():
    tiles = tiles_of(POINTS, WEIGHTS)
    return summary_of(tiles, CODES, nearest_codes(tiles, CODES))


def test_sums_are_those_of_a_plain_loop_over_codes(summary):
    labels, squares = searched(POINTS, CODES)
    for code in range(3):
        own, mass = POINTS[labels == code].astype(float), WEIGHTS[labels == code]
        away = squares[labels == code].astype(float)
        assert summary.counts[code] == len(own)
        assert summary.masses[code] == pytest.approx(mass.sum(), rel=1e-6)
        assert summary.errors[code] == pytest.approx((mass @ np.sqrt(away), mass @ away), rel=1e-5)
        np.testing.assert_array_equal(summary.boxes[code], np.float32([own.min(axis=0), own.max(axis=0)]))
        assert summary.radii[code] == pytest.approx(np.sqrt(away.max()), rel=1e-6)


def test_means_and_covariances_are_weighted(summary):
    labels, _ = searched(POINTS, CODES)
    for code in range(3):
        own, mass = POINTS[labels == code].astype(float), WEIGHTS[labels == code]
        np.testing.assert_allclose(
            summary.means(CODES)[code], np.average(own, axis=0, weights=mass), atol=1e-5
        )
        expected = np.cov(own.T, aweights=mass, ddof=0)
        np.testing.assert_allclose(summary.covariances()[code], expected, atol=1e-4)


def test_a_code_without_points_has_nothing_and_stays_its_own_mean(summary):
    assert (summary.counts[3], summary.masses[3], summary.radii[3]) == (0, 0.0, 0.0)
    np.testing.assert_array_equal(summary.means(CODES)[3], CODES[3])
    assert not summary.covariances()[3].any()
    assert (summary.boxes[3, 0] == np.inf).all()


def test_tiles_of_one_code_are_summed_as_others_are():
    points = np.random.default_rng(1).normal(0.0, 0.1, (200, 3)).astype(np.float32)
    tiles, codes = tiles_of(points), np.array([[0.1, 0.0, 0.0]], np.float32)
    found = summary_of(tiles, codes, nearest_codes(tiles, codes))
    away = np.linalg.norm(points - codes, axis=1).astype(float)
    assert found.errors[0] == pytest.approx((away.sum(), (away**2).sum()), rel=1e-5)
    np.testing.assert_allclose(found.means(codes)[0], points.mean(axis=0), atol=1e-6)
    np.testing.assert_array_equal(found.boxes[0], [points.min(axis=0), points.max(axis=0)])
