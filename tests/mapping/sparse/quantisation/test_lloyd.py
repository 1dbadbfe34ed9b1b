"""Tiles hold their points; bounds on their boxes leave the labels of an exhaustive search."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scattered_points import in_order, room, searched
from scipy.stats import chisquare

from lidarium.mapping.sparse.quantisation.lloyd import (
    NO_SQUARES,
    _label_points,
    at_far_points,
    drawn_codes,
    improved,
    nearest_codes,
    summary_of,
)
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

COORDINATES = st.one_of(
    st.integers(-4, 4).map(float),
    st.floats(-1024.0, 1024.0, width=32),
    st.floats(-(2.0**-10), 2.0**-10, width=32),
)


def labelled(points, codes):
    """Return labels in the caller's order, with and without distances, and the distances."""
    tiles = tiles_of(points)
    nearest = nearest_codes(tiles, codes)
    labels, sums = np.empty_like(nearest.labels), np.empty((len(codes), 4))
    _label_points(tiles, codes, labels, NO_SQUARES, sums)
    assert sums[:, 3].sum() == len(points)
    found = in_order(labels, tiles)
    for code in range(len(codes)):
        own = points[found == code].astype(np.float64)
        assert sums[code, :3] == pytest.approx(own.sum(axis=0), rel=1e-9, abs=1e-6)
    return found, in_order(nearest.labels, tiles), in_order(nearest.squares, tiles)


@given(
    arrays.arrays(np.float32, st.tuples(st.integers(1, 200), st.just(3)), elements=COORDINATES),
    arrays.arrays(np.float32, st.tuples(st.integers(1, 20), st.just(3)), elements=COORDINATES),
)
def test_labels_are_those_of_exhaustive_search_ties_included(points, codes):
    silent, told, squares = labelled(points, codes)
    wanted, wanted_squares = searched(points, codes)
    assert (silent == wanted).all()
    assert (told == wanted).all()
    assert (squares == wanted_squares).all()


@pytest.mark.parametrize("count", [1, 2, 40, 300])
def test_labels_on_a_room_are_those_of_exhaustive_search(count):
    points = room(20_000)
    codes = points[np.random.default_rng(1).choice(len(points), count, replace=False)]
    codes[-1] = codes[0]
    silent, told, _ = labelled(points, codes)
    wanted, _ = searched(points, codes)
    assert (silent == wanted).all()
    assert (told == wanted).all()


FIVE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [4, 4, 0]], np.float32)


def draws(weights=None, turns=6000):
    """Return how often each pair of the five points is drawn, as (first, second)."""
    tiles, generator = tiles_of(FIVE, weights), np.random.default_rng(5)
    counts = np.zeros((5, 5))
    for _ in range(turns):
        codes, _ = drawn_codes(tiles, 2, generator)
        first, second = searched(codes, FIVE)[0]
        counts[first, second] += 1
    return counts


@pytest.mark.parametrize("weights", [None, np.array([1, 2, 3, 4, 5], np.float32)])
def test_draws_follow_the_weighted_squared_distance(weights):
    counts = draws(weights)
    masses = np.ones(5) if weights is None else weights.astype(float)
    squares = ((FIVE[:, None] - FIVE[None]) ** 2).sum(axis=2) * masses
    chances = masses[:, None] / masses.sum() * squares / squares.sum(axis=1, keepdims=True)
    drawn = chances > 0
    assert counts[~drawn].sum() == 0
    assert chisquare(counts[drawn], counts.sum() * chances[drawn]).pvalue > 0.001


def test_drawn_codes_are_different_points_whose_nearest_are_known():
    points = np.repeat(room(400), 3, axis=0)
    tiles = tiles_of(points)
    codes, nearest = drawn_codes(tiles, 400, np.random.default_rng(0))
    assert len(np.unique(codes, axis=0)) == 400
    assert nearest.group_errors.sum() == 0.0
    codes, nearest = drawn_codes(tiles, 50, np.random.default_rng(0))
    again = nearest_codes(tiles, codes)
    assert (nearest.labels == again.labels).all()
    assert (nearest.squares == again.squares).all()
    assert nearest.group_errors == pytest.approx(again.group_errors)
    with pytest.raises(ValueError, match="at 400 different places; want at least 401"):
        drawn_codes(tiles, 401, np.random.default_rng(0))


def test_errors_do_not_grow_over_steps():
    tiles = tiles_of(room())
    codes, nearest = drawn_codes(tiles, 40, np.random.default_rng(2))
    errors = [nearest.group_errors.sum()]
    for _ in range(12):
        codes = improved(tiles, codes, 1)
        errors.append(nearest_codes(tiles, codes).group_errors.sum())
    assert (np.diff(errors) <= 1e-6).all()
    assert errors[-1] < 0.9 * errors[0]


def test_codes_without_points_stay_or_go_to_the_farthest_point():
    points = np.concatenate([room(500), np.array([[50, 0, 0], [0, 40, 0]], np.float32)])
    tiles = tiles_of(points)
    codes = np.array([[2, 2, 1], [900, 0, 0], [0, 900, 0]], np.float32)
    kept = improved(tiles, codes, 1, keeps_empty=True)
    assert (kept[1:] == codes[1:]).all()
    moved = at_far_points(tiles, codes, np.array([False, True, True]))
    assert moved.tolist() == [[2, 2, 1], [50, 0, 0], [0, 40, 0]]
    assert (improved(tiles, codes, 1)[1:] == moved[1:]).all()


def test_codes_without_points_need_different_points():
    tiles = tiles_of(np.repeat(FIVE, 20, axis=0))
    codes = np.concatenate([FIVE, [[9, 9, 9]]]).astype(np.float32)
    with pytest.raises(ValueError, match="fewer than 6 different places"):
        improved(tiles, codes, 1)


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
        np.testing.assert_allclose(summary.means(CODES)[code], np.average(own, axis=0, weights=mass), atol=1e-5)
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
