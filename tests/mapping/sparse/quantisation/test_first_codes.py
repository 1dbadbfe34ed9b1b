"""K-means++ draws by squared distance; LBG draws nothing."""

import numpy as np
import pytest
from scattered_points import room, searched
from scipy.stats import chisquare

from lidarium.mapping.sparse.quantisation.lloyd import at_far_points, improved, nearest_codes
from lidarium.mapping.sparse.quantisation.seeding import drawn_codes
from lidarium.mapping.sparse.quantisation.splitting import split_codes
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


def test_splitting_is_deterministic_and_doubles():
    tiles = tiles_of(room())
    codes = split_codes(tiles, 64, 7)
    assert codes.shape == (64, 3)
    assert (codes == split_codes(tiles, 64, 7)).all()
    assert len(split_codes(tiles, 1, 7)) == 1
    for count in (0, 3, 48):
        with pytest.raises(ValueError, match="want a power of two"):
            split_codes(tiles, count, 7)


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
