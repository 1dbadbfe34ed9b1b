"""Stamps that are wild, repeat or restart."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.mending.clocks import continued


@pytest.mark.parametrize("wild", [2e9, -5.0, math.nan])
@pytest.mark.parametrize("at", [0, 7, 19])
def test_one_wild_stamp_costs_one_scan_at_most(wild, at):
    stamps = 100.0 + 0.5 * np.arange(20.0)
    stamps[at] = wild
    clock = continued(stamps)
    assert clock.restarts == 0
    assert len(clock.kept) >= 19
    assert (np.diff(clock.stamps) >= 0.0).all()
    others = np.delete(np.arange(20), at)
    np.testing.assert_array_equal(clock.stamps[np.isin(clock.kept, others)], stamps[others])


def test_a_clock_that_restarts_is_continued():
    true = 0.5 * np.arange(60.0)
    stamps = true + 1000.0
    stamps[20:] -= 1009.0
    stamps[45:] -= 12.0
    clock = continued(stamps)
    assert clock.restarts == 2
    np.testing.assert_allclose(clock.stamps - clock.stamps[0], true)


def test_order_is_all_that_a_clock_without_faults_is_asked_for():
    stamps = np.array([3.0, 3.0, 3.5, 9.0, 4000.0])
    clock = continued(stamps)
    np.testing.assert_array_equal(clock.stamps, stamps)
    assert clock.restarts == 0
