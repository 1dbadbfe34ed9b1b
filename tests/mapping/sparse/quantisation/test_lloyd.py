"""Lloyd's steps: errors do not grow, and codes without points are treated."""

import numpy as np
import pytest
from scattered_points import room

from lidarium.mapping.sparse.quantisation.lloyd import at_far_points, improved, nearest_codes
from lidarium.mapping.sparse.quantisation.seeding import drawn_codes
from lidarium.mapping.sparse.quantisation.tiles import tiles_of

FIVE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [4, 4, 0]], np.float32)


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
