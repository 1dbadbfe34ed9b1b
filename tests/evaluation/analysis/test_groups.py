import numpy as np
import pytest

from lidarium.evaluation.analysis.groups import floor_set_of, grouped, paired, repeats, times_to

ENDED = {"robot_0": "no_frontier"}


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


@pytest.mark.parametrize("reason", ["stop_rule", "covered"])
def test_a_run_that_a_rule_or_a_smaller_share_ended_is_censored_then(row, reason):
    ended = row(time_s=20.0, ended_because={"robot_0": reason})
    assert times_to([ended], "t99_s", 100.0).cut == 1
    assert times_to([{**ended, "t99_s": 18.0}], "t99_s", 100.0).cut == 0


def test_a_run_up_to_a_horizon_of_no_whole_number_of_steps_was_not_cut_before_it(row):
    found = times_to([row(time_s=200.0, horizon_s=200.04)], "t99_s", 200.04)
    assert (found.times.tolist(), found.cut) == ([200.04], 0)


def test_pairs_share_floor_starts_and_seed(row):
    ours = [row("a", 0), row("a", 1), row("a", 2, starts=[[0.0, 1.0, 0.0]])]
    theirs = [row("b", 2, starts=[[5.0, 1.0, 0.0]]), row("b", 1), row("b", 0, floor="office:3000000")]
    first, second = paired(ours, theirs)
    assert [(each["seed"], other["policy"]) for each, other in zip(first, second, strict=True)] == [(1, "b")]


def test_runs_that_differ_in_the_seed_alone_are_repeats(row):
    assert repeats([row(path_m=[5.0]), row(seed=1, path_m=[5.0], steps_per_s=3.0), row(seed=2)]) == 1
