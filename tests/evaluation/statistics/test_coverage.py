"""Intervals hold known truths, in few trials; `lidarium reproduce interval_coverage` makes many."""

import numpy as np
import pytest

from lidarium.evaluation.statistics import (
    CensoredTimes,
    interquartile_mean_interval,
    mean_interval,
    median_interval,
    paired_difference,
    paired_ratio,
    restricted_difference,
    restricted_mean,
    share_interval,
)

TRIALS, SIZE, HORIZON = 300, 50, 1.5
DRAWS = {"resamples": 400}


def exponential_times(generator, scale=1.0):
    """Exponential times, a fifth of them cut at random before the event."""
    times, cuts = generator.exponential(scale, SIZE), generator.exponential(4.0 * scale, SIZE)
    return np.minimum(times, cuts), times <= cuts


def difference_of_times(generator, trial):
    a, b = (CensoredTimes(*exponential_times(generator, scale), HORIZON) for scale in (1.0, 1.5))
    return restricted_difference(a, b, **DRAWS, seed=trial)


FIGURES = {
    "median": (lambda g, k: median_interval(g.exponential(size=SIZE)), np.log(2.0)),
    "mean": (lambda g, k: mean_interval(g.exponential(size=SIZE), **DRAWS, seed=k), 1.0),
    "interquartile mean": (
        lambda g, k: interquartile_mean_interval(g.normal(size=SIZE), **DRAWS, seed=k),
        0.0,
    ),
    "difference": (lambda g, k: paired_difference(*g.exponential(size=(2, SIZE)), **DRAWS, seed=k), 0.0),
    "ratio": (lambda g, k: paired_ratio(*g.exponential([[2.0], [1.0]], (2, SIZE)), **DRAWS, seed=k), 2.0),
    "restricted mean": (
        lambda g, k: restricted_mean(*exponential_times(g), HORIZON, **DRAWS, seed=k),
        1 - np.exp(-HORIZON),
    ),
    "restricted difference": (difference_of_times, -0.5 - np.exp(-HORIZON) + 1.5 * np.exp(-HORIZON / 1.5)),
    "share": (lambda g, k: share_interval(int(g.binomial(SIZE, 0.8)), SIZE), 0.8),
}


@pytest.mark.parametrize("name", FIGURES)
def test_intervals_hold_the_truth_about_as_often_as_they_say(name):
    interval, truth = FIGURES[name]
    generator = np.random.default_rng(11)
    found = [interval(generator, trial // 30) for trial in range(TRIALS)]
    held = np.mean([each.low <= truth <= each.high for each in found])
    # Four standard errors of 300 trials around 95 %.
    assert 0.90 <= held <= 0.993
    assert all(each.is_nominal for each in found)
