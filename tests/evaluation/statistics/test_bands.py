"""Simultaneous bands hold the whole true curve about as often as they say."""

import numpy as np
import pytest
from scipy import stats

from lidarium.evaluation.statistics import mean_bands


def smooth(generator, count, points):
    """Return random smooth curves of mean zero."""
    x, waves = np.linspace(0.0, 1.0, points), np.arange(1, 9)
    cosines, sines = generator.standard_normal((2, count, len(waves))) / waves
    return cosines @ np.cos(np.outer(waves, np.pi * x)) + sines @ np.sin(np.outer(waves, np.pi * x))


@pytest.mark.parametrize(("count", "points"), [(5, 20), (10, 20)])
def test_bands_hold_whole_curves_where_pointwise_intervals_do_not(count, points):
    generator, trials = np.random.default_rng(0), 120
    pointwise = stats.t.ppf(0.975, count - 1) / np.sqrt(count)
    held = missed = 0
    for _ in range(trials):
        curves = smooth(generator, count, points)
        mean, low, high = mean_bands(curves)
        held += bool(((low <= 0.0) & (high >= 0.0)).all())
        missed += bool((np.abs(mean) > pointwise * curves.std(axis=0, ddof=1)).any())
    assert held / trials >= 0.88
    assert missed / trials > 0.15


def test_one_point_has_students_interval():
    values = np.array([[1.0], [2.0], [4.0], [7.0], [8.0]])
    mean, low, high = mean_bands(values)[:, 0]
    width = stats.t.ppf(0.975, 4) * values.std(ddof=1) / np.sqrt(5.0)
    assert (low, high) == pytest.approx((mean - width, mean + width), abs=0.1 * width)


def test_curves_that_agree_have_no_width_there_and_few_have_no_band():
    curves = np.array([[1.0, 2.0], [1.0, 3.0], [1.0, 5.0], [1.0, 4.0], [1.0, 2.0]])
    mean, low, high = mean_bands(curves)
    assert low[0] == mean[0] == high[0] == 1.0
    assert high[1] > mean[1] > low[1]
    assert np.isinf(mean_bands(curves[:4])[1:]).all()


def test_curves_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="want n curves of k points"):
        mean_bands([[1.0, np.nan]])
