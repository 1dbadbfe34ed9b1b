"""Figures of a policy, and of policies against a baseline, pair by pair."""

import numpy as np
import pytest

from lidarium.evaluation.analysis.figures import (
    compared,
    further_figure,
    further_keys,
    over_bound,
    time_figure,
    value_figure,
    values_of,
)
from lidarium.evaluation.analysis.groups import grouped


def test_a_time_that_none_reached_has_no_mean_but_a_success_rate(row):
    figure = time_figure([row(seed=seed) for seed in range(8)], "t99_s", 100.0, 0)
    assert figure.restricted_mean is None
    assert (figure.success.estimate, figure.median.estimate) == (0.0, np.inf)


def test_numbers_under_other_keys_are_figures_too(row):
    runs = [row(seed=seed, sharing_lag_s=2.0 + seed, t50_s=None, auc=None) for seed in range(3)]
    keys = further_keys(runs, values_of(runs))
    assert "sharing_lag_s" in keys
    assert "t50_s" in keys
    assert not {"auc", "seed", "robots", "interrupted", "t90_s", "version"} & set(keys)
    assert further_figure(runs, "sharing_lag_s").estimate == 3.0
    assert further_figure(runs, "t50_s").estimate == np.inf


def test_a_figure_that_some_runs_lack_is_that_of_the_others(row):
    runs = [row(seed=seed, d99_m=None if seed == 1 else 5.0 + seed, nowhere=None) for seed in range(4)]
    keys = further_keys(runs, values_of(runs))
    assert "d99_m" in keys
    assert not {"nowhere", "t99_over_bound"} & set(keys)
    assert further_figure(runs, "d99_m").estimate == 7.0


def test_a_faster_policy_is_found_pair_by_pair(row):
    slow = [row("slow", seed, t90_s=40.0 + 7.0 * seed % 31, t99_s=60.0 + 7.0 * seed % 31) for seed in range(20)]
    fast = [
        row("fast", seed, t90_s=each["t90_s"] - 5.0 - 0.1 * seed, t99_s=each["t99_s"] - 2.0)
        for seed, each in enumerate(slow)
    ]
    (group,) = grouped([*slow, *fast])
    by_key = {each.key: each for each in compared(group, values_of([*slow, *fast]), "slow", seed=0)}
    assert by_key["t90_s"].difference.estimate == pytest.approx(-5.95)
    assert by_key["t90_s"].difference.high < 0.0
    assert by_key["t90_s"].ratio.high < 1.0
    assert (by_key["t90_s"].wilcoxon.less, by_key["t90_s"].pairs) == (20, 20)
    assert by_key["t90_s"].wilcoxon.p_value < by_key["t90_s"].p_holm < 0.001
    assert by_key["t90_s"].is_beyond_chance
    assert by_key["t90_s"].improvement.estimate == 1.0
    assert by_key["path_m"].difference.estimate == 0.0
    assert not by_key["path_m"].difference.is_known
    assert by_key["path_m"].p_holm == 1.0


def test_of_a_policy_that_never_gets_there_the_horizon_counts(row):
    never = [row("never", seed) for seed in range(10)]
    always = [row("always", seed, t90_s=30.0 + seed, t99_s=None) for seed in range(10)]
    (group,) = grouped([*never, *always])
    by_key = {each.key: each for each in compared(group, values_of([*never, *always]), "never", seed=0)}
    assert by_key["t90_s"].difference.estimate == pytest.approx(34.5 - 100.0)
    assert by_key["t99_s"].difference is None
    assert by_key["t99_s"].wilcoxon.ties == 10


def test_a_policy_without_a_pair_is_not_compared(row):
    rows = [row("a", 0), row("b", 1)]
    (group,) = grouped(rows)
    assert compared(group, values_of(rows), "a", seed=0) == []


def test_the_interquartile_mean_of_a_value_leaves_out_what_lies_far_off():
    figure = value_figure([0.0, 1.0, 2.0, 1000.0], seed=0)
    assert (figure.median.estimate, figure.mean.estimate) == (1.5, 250.75)
    assert figure.interquartile_mean.estimate == 1.5


def test_the_median_is_of_those_that_have_a_bound(row):
    rows = [
        row(t99_s=30.0, bound_s=20.0),
        row(t99_s=80.0, bound_s=20.0),
        row(t99_s=None, bound_s=20.0),
        row(t99_s=1.0),
        row(t99_s=1.0, bound_s=None),
        row(t99_s=0.0, bound_s=0.1),  # seen from the start
    ]
    found = over_bound(rows, 100.0)
    assert found.ratio.estimate == pytest.approx(4.0)
    assert over_bound([rows[2]], 100.0).ratio.estimate == np.inf
    assert found.gap.estimate == pytest.approx((1 / 3 + 3 / 4 + 4 / 5) / 3)


def test_a_run_that_missed_within_a_horizon_below_its_bound_has_no_gap(row):
    found = over_bound([row(t99_s=30.0, bound_s=20.0), row(t99_s=None, bound_s=150.0)], 100.0)
    assert found.gap is None
    assert over_bound([row(t99_s=130.0, bound_s=120.0)], 140.0).gap is not None


def test_the_order_of_runs_that_were_cut_is_not_known(row):
    """A run that was cut after 20 s is later than one of 15 s, and neither sooner nor later than one of 50 s."""
    cut = [row("b", seed, time_s=20.0, ended_because={"robot_0": "stop_rule"}) for seed in range(12)]
    for time_s, losses in ((50.0, 0), (15.0, 12)):
        (group,) = grouped([*(row("a", seed, t99_s=time_s, t90_s=time_s) for seed in range(12)), *cut])
        found = next(each for each in compared(group, (), "b", seed=0) if each.key == "t99_s")
        assert found.wilcoxon.less == losses
        assert (found.improvement is None) == (losses == 0)


def test_without_bounds_there_is_none(row):
    assert over_bound([row(t99_s=30.0)], 100.0) is None
    assert over_bound([], 100.0) is None


def test_runs_on_one_floor_are_no_further_evidence(row):
    """Twelve floors, on each of which three seeds end nearly alike."""
    rows = [
        row(
            policy,
            seed,
            floor=f"office:{floor}",
            t99_s=50.0 + 7.0 * (floor * 5 % 12) + seed - (policy == "b") * (floor % 4 - 1.2),
        )
        for policy in "ab"
        for floor in range(12)
        for seed in range(3)
    ]
    (group,) = grouped(rows)
    figure = time_figure(group.runs["a"], "t99_s", group.horizon_s, 0)
    assert figure.median.size == figure.restricted_mean.size == 12
    (time,) = [each for each in compared(group, (), "a", seed=0) if each.key == "t99_s"]
    assert (time.pairs, time.difference.size, time.wilcoxon.size) == (36, 12, 12)
    few = time_figure(group.runs["a"][:9], "t99_s", group.horizon_s, 0)
    assert few.restricted_mean.size == 9


def test_ranks_that_differ_with_a_mean_that_may_not_are_not_beyond_chance(row):
    slow = [row("slow", seed, t99_s=60.0 + seed) for seed in range(20)]
    fast = [row("fast", seed, t99_s=(59.0 if seed else 99.0) + seed - 0.01 * seed) for seed in range(20)]
    (group,) = grouped([*slow, *fast])
    (time,) = [each for each in compared(group, (), "slow", seed=0) if each.key == "t99_s"]
    assert time.p_holm < 0.05
    assert not time.difference.excludes(0.0)
    assert not time.is_beyond_chance
