"""Times are set beside bounds where episodes have one."""

import pytest

from lidarium.evaluation.analysis.multiples import over_bound


def test_the_median_is_of_those_that_have_a_bound(row):
    rows = [
        row(t99_s=30.0, bound_s=20.0),
        row(t99_s=80.0, bound_s=20.0),
        row(t99_s=None, bound_s=20.0),
        row(t99_s=1.0),
        row(t99_s=1.0, bound_s=None),
    ]
    assert over_bound(rows, 100.0) == pytest.approx(4.0)


def test_without_bounds_there_is_none(row):
    assert over_bound([row(t99_s=30.0)], 100.0) is None
    assert over_bound([], 100.0) is None
