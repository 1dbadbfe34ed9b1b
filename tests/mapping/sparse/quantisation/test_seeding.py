"""K-means++ draws by squared distance."""

import numpy as np
import pytest
from scattered_points import room, searched
from scipy.stats import chisquare

from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.seeding import drawn_codes
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

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
