"""Agreement is smoothed by a cubic B-spline, and its slopes are those of the smoothed field."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from lidarium.mapping.localization.matching.smoothed_agreement import agreement, extremes_around, is_unseen
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, FULL_LEVEL, UNSEEN

LEVELS = np.random.default_rng(2).integers(0, 256, (12, 15)).astype(np.uint8)


def plain(levels, x, y):
    """The tensor product of uniform cubic B-splines on the centres of cells."""
    bump = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
    heights = np.maximum(levels.astype(float) - FREE_LEVEL, 0.0) / (FULL_LEVEL - FREE_LEVEL)
    across, along = (
        np.nan_to_num(bump(place - 0.5 - np.arange(count)))
        for place, count in zip((x, y), levels.shape[::-1], strict=True)
    )
    return float(along @ heights @ across)


@pytest.mark.parametrize("place", [(5.0, 6.0), (4.27, 7.81), (8.5, 5.5), (9.99, 3.01)])
def test_the_value_is_that_of_a_plain_spline_and_slopes_are_its_differences(place):
    x, y = place
    value, slope_x, slope_y = agreement(LEVELS, x, y)
    assert value == pytest.approx(plain(LEVELS, x, y), abs=1e-12)
    step = 1e-5
    assert slope_x == pytest.approx(
        (plain(LEVELS, x + step, y) - plain(LEVELS, x - step, y)) / (2 * step), abs=1e-6
    )
    assert slope_y == pytest.approx(
        (plain(LEVELS, x, y + step) - plain(LEVELS, x, y - step)) / (2 * step), abs=1e-6
    )


def test_full_agreement_is_one_and_flat_and_what_is_free_or_unseen_is_nothing():
    for level, expected in ((FULL_LEVEL, 1.0), (FREE_LEVEL, 0.0), (UNSEEN, 0.0)):
        found = agreement(np.full((10, 10), level, np.uint8), 4.3, 5.8)
        assert found == pytest.approx((expected, 0.0, 0.0), abs=1e-12)


def test_agreement_ends_where_the_map_does():
    full = np.full((10, 14), FULL_LEVEL, np.uint8)
    for x, y in ((1.4, 5.0), (5.0, 1.4), (12.5, 5.0), (5.0, 8.5), (-3.0, 5.0)):
        assert agreement(full, x, y) == (0.0, 0.0, 0.0)
    assert agreement(full, 12.4, 8.4)[0] == pytest.approx(1.0)


def test_cells_outside_of_the_map_are_unseen():
    levels = np.full((4, 6), FREE_LEVEL, np.uint8)
    levels[2, 3] = UNSEEN
    assert is_unseen(levels, 3.9, 2.0)
    assert not is_unseen(levels, 4.0, 2.0)
    for x, y in ((-0.1, 1.0), (6.0, 1.0), (1.0, -0.1), (1.0, 4.0)):
        assert is_unseen(levels, x, y)


def test_extremes_are_those_of_the_square_of_seven_cells():
    padded = np.pad(LEVELS, 3, constant_values=UNSEEN)
    for row, column in ((0, 0), (5, 7), (11, 14), (3, 3)):
        window = padded[row : row + 7, column : column + 7]
        assert extremes_around(LEVELS, column, row) == (window.min(), window.max())
