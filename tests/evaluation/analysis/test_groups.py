import numpy as np
import pytest

from lidarium.evaluation.analysis.figures import compared, further_figure, further_keys, time_figure
from lidarium.evaluation.analysis.groups import floor_set_of, grouped, paired, repeats, times_to
from lidarium.evaluation.drawing.profiles import profiles

ENDED = {"robot_0": "no_frontier"}
CUT = {"robot_0": "horizon"}


@pytest.fixture
def row(rows):
    """Makes an episode of one robot out of a real one."""

    def make(policy="a", seed=0, floor="apartment", **changes):
        base = {
            "policy": policy,
            "seed": seed,
            "floor": floor,
            "robots": 1,
            "horizon_s": 100.0,
            "time_s": 100.0,
            "ended_because": CUT,
        }
        return {**rows[0], **base, "path_m": [10.0 + seed], "t90_s": None, "t99_s": None, **changes}

    return make


def test_floors_belong_to_sets():
    names = ("apartment", "office:3000007", "corridors:1000000", "building:17", "kth/50010.xml")
    assert [floor_set_of(name) for name in names] == [
        "drawn floors",
        "set:test",
        "set:train",
        "generated floors",
        "floors from files",
    ]


def test_groups_share_floors_and_robots(row):
    groups = grouped([row("b"), row("a"), row("a", robots=2), row("a", floor="office:3000000")])
    assert [group.title for group in groups] == [
        "1 robot, drawn floors",
        "2 robots, drawn floors",
        "1 robot, set:test",
    ]
    assert list(groups[0].runs) == ["a", "b"]


def test_without_a_horizon_times_count_up_to_the_longest_run(row):
    (group,) = grouped([row(horizon_s=None, time_s=80.0), row(seed=1, horizon_s=None, time_s=130.0)])
    assert group.horizon_s == 130.0


def test_a_run_that_gave_up_early_counts_as_not_there_at_the_horizon(row):
    found = times_to([row(time_s=20.0, ended_because=ENDED), row(t90_s=35.0)], "t90_s", 100.0)
    assert found.times.tolist() == [100.0, 35.0]
    assert found.is_reached.tolist() == [False, True]
    assert found.cut == 0
    assert found.or_never.tolist() == [np.inf, 35.0]


def test_a_run_that_was_cut_early_is_censored_then(row):
    found = times_to(
        [row(time_s=20.0, interrupted=True, ended_because={"robot_0": None}), row(t90_s=35.0)], "t90_s", 100.0
    )
    assert found.times.tolist() == [20.0, 35.0]
    assert found.cut == 1


def test_pairs_share_floor_starts_and_seed(row):
    ours = [row("a", 0), row("a", 1), row("a", 2, starts=[[0.0, 1.0, 0.0]])]
    theirs = [row("b", 2, starts=[[5.0, 1.0, 0.0]]), row("b", 1), row("b", 0, floor="office:3000000")]
    first, second = paired(ours, theirs)
    assert [(each["seed"], other["policy"]) for each, other in zip(first, second, strict=True)] == [(1, "b")]


def test_runs_that_differ_in_the_seed_alone_are_repeats(row):
    assert repeats([row(path_m=[5.0]), row(seed=1, path_m=[5.0], steps_per_s=3.0), row(seed=2)]) == 1


def test_a_time_that_none_reached_has_no_mean_but_a_success_rate(row):
    figure = time_figure([row(seed=seed) for seed in range(8)], "t99_s", 100.0, 0)
    assert figure.restricted_mean is None
    assert (figure.success.estimate, figure.median.estimate) == (0.0, np.inf)


def test_numbers_under_other_keys_are_figures_too(row):
    runs = [row(seed=seed, sharing_lag_s=2.0 + seed, t50_s=None, auc=None) for seed in range(3)]
    keys = further_keys(runs)
    assert "sharing_lag_s" in keys
    assert "t50_s" in keys
    assert not {"auc", "seed", "robots", "interrupted", "t90_s", "version"} & set(keys)
    assert further_figure(runs, "sharing_lag_s").estimate == 3.0
    assert further_figure(runs, "t50_s").estimate == np.inf


def test_a_faster_policy_is_found_pair_by_pair(row):
    slow = [
        row("slow", seed, t90_s=40.0 + 7.0 * seed % 31, t99_s=60.0 + 7.0 * seed % 31) for seed in range(20)
    ]
    fast = [
        row("fast", seed, t90_s=each["t90_s"] - 5.0 - 0.1 * seed, t99_s=each["t99_s"] - 2.0)
        for seed, each in enumerate(slow)
    ]
    (group,) = grouped([*slow, *fast])
    by_key = {each.key: each for each in compared(group, "slow", seed=0)}
    assert by_key["t90_s"].difference.estimate == pytest.approx(-5.95)
    assert by_key["t90_s"].difference.high < 0.0
    assert by_key["t90_s"].ratio.high < 1.0
    assert (by_key["t90_s"].wilcoxon.less, by_key["t90_s"].pairs) == (20, 20)
    assert by_key["t90_s"].wilcoxon.p_value < by_key["t90_s"].p_holm < 0.001
    assert by_key["path_m"].difference.low == by_key["path_m"].difference.high == 0.0
    assert by_key["path_m"].p_holm == 1.0


def test_of_a_policy_that_never_gets_there_the_horizon_counts(row):
    never = [row("never", seed) for seed in range(10)]
    always = [row("always", seed, t90_s=30.0 + seed, t99_s=None) for seed in range(10)]
    (group,) = grouped([*never, *always])
    by_key = {each.key: each for each in compared(group, "never", seed=0)}
    assert by_key["t90_s"].difference.estimate == pytest.approx(34.5 - 100.0)
    assert by_key["t99_s"].difference is None
    assert by_key["t99_s"].wilcoxon.ties == 10


@pytest.mark.parametrize("lowest", [0.137, 0.42, 0.9, 0.98])
def test_a_profile_of_coverage_turns_where_episodes_end(row, lowest):
    (group,) = grouped(
        [row(coverage_final=0.99), row(seed=1, coverage_final=0.9903), row(seed=2, coverage_final=lowest)]
    )
    found = profiles(group)["coverage_at_least"]
    share = dict(zip(found["thresholds"], found["share_low_high"]["a"][0], strict=True))
    assert found["thresholds"][0] <= lowest
    assert share[0.99] == pytest.approx(2 / 3)
    assert share[0.995] == 0.0
    assert share[1.0] == 0.0
