"""Intervals of shares."""

import numpy as np
import pytest
from scipy import stats

from lidarium.evaluation.statistics import share_interval


def test_wilsons_interval_by_its_formula():
    z = stats.norm.ppf(0.975)
    centre, reach = (
        (0.3 + z**2 / 40) / (1 + z**2 / 20),
        z / (1 + z**2 / 20) * np.sqrt(0.3 * 0.7 / 20 + z**2 / 1600),
    )
    found = share_interval(6, 20)
    assert (found.estimate, found.low, found.high) == pytest.approx((0.3, centre - reach, centre + reach))


def test_no_success_does_not_mean_never():
    found = share_interval(0, 20)
    assert (found.estimate, found.low) == (0.0, 0.0)
    assert found.high > 0.1
