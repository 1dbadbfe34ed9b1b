"""Floors that are too large are refused."""

import numpy as np
import pytest

from lidarium.envs.floors.extent import (
    MOST_BEYOND_M,
    MOST_EXTENT_M,
    MOST_OUTLINE_M,
    check_extent,
    check_pairs,
)

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def test_a_floor_up_to_the_limits_passes():
    check_extent("hall", (0.0, 0.0, MOST_EXTENT_M, 1.0), [SQUARE, SQUARE[:0]])
    check_extent("hall", (0.0, 0.0, 1.0, 1.0), [SQUARE - MOST_BEYOND_M])
    check_pairs("hall", 500, 500)


@pytest.mark.parametrize(
    ("bounds", "rings", "message"),
    [
        ((0.0, 0.0, MOST_EXTENT_M + 1.0, 1.0), (), "hall has a side of 10001 m"),
        ((2e8, 0.0, 2e8 + 1.0, 1.0), (), "up to 2e"),
        ((0.0, 0.0, np.nan, 1.0), (), "hall has a side of nan"),
        ((0.0, 0.0, 1.0, 1.0), [SQUARE, SQUARE + MOST_BEYOND_M + 1.0], "beyond its bounds"),
        ((0.0, 0.0, 1.0, 1.0), [SQUARE * np.nan], "beyond its bounds"),
    ],
)
def test_what_is_too_large_is_named(bounds, rings, message):
    with pytest.raises(ValueError, match=message):
        check_extent("hall", bounds, rings)


def test_outlines_are_measured_around_each_ring_and_not_between_them():
    far = (0.0, 0.0, 9000.0, 9000.0)
    side = MOST_OUTLINE_M / 4 / 20
    rings = [SQUARE * side] * 20
    check_extent("hall", far, [ring * (1.0 - 1e-6) for ring in rings])
    with pytest.raises(ValueError, match="m of walls"):
        check_extent("hall", far, [*rings, SQUARE])
    check_extent("hall", far, [SQUARE, SQUARE + 8000.0] * 100)


def test_too_many_pairs_are_refused():
    with pytest.raises(ValueError, match="501 walls and 500 doors"):
        check_pairs("hall", 501, 500)
