"""Figures of teams: runs beside their partners."""

import math

import pytest

from lidarium.benchmarks.studies.supervisor.figures import (
    chosen,
    overlap_points,
    path_shares,
    time_ratios,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.goals import goals_of

A, B = [1.0, 2.0, 0.0], [3.0, 4.0, 0.0]


def row(policy, starts, seed=0, t99=None, path=(10.0,), overlap=0.0):
    return {
        "key": f"default | floor | {len(starts)} | seed {seed} | {policy}",
        "policy": policy,
        "robots": len(starts),
        "seed": seed,
        "variant": "default",
        "starts": starts,
        "t99_s": t99,
        "horizon_s": 200.0,
        "path_m": list(path),
        "overlap": overlap,
    }


def test_a_team_is_divided_by_the_mean_of_the_robots_that_began_where_its_robots_do():
    alone = [
        row("independent", [A], t99=100.0, path=(20.0,)),
        row("independent", [B], t99=60.0, path=(10.0,)),
    ]
    team = [row("supervised", [A, B], t99=40.0, path=(9.0, 9.0))]
    assert time_shares(team, alone) == [pytest.approx(0.5)]
    assert path_shares(team, alone) == [pytest.approx(18.0 / 15.0)]
    assert time_shares(team, alone[:1]) == [pytest.approx(0.4)]
    assert time_shares([row("supervised", [[9.0, 9.0, 0.0], A[::-1]], t99=40.0)], alone) == []


def test_what_was_not_done_counts_as_never_and_as_the_horizon_where_others_are_divided_by_it():
    alone = [row("independent", [A])]
    assert time_shares([row("supervised", [A, B], t99=50.0), row("supervised", [A, B])], alone) == [
        0.25,
        math.inf,
    ]
    assert time_ratios([row("supervised", [A, B], t99=50.0)], [row("oracle_starts", [A, B])]) == [0.25]


def test_partners_have_the_same_floor_starts_and_seed():
    runs = [row("supervised", [A, B], seed, t99=50.0, overlap=0.3) for seed in (0, 1)]
    told = [row("oracle_starts", [A, B], 1, t99=40.0, overlap=0.2)]
    assert time_ratios(runs, told) == [1.25]
    assert overlap_points(runs, told) == [pytest.approx(10.0)]


def test_runs_are_chosen_by_policy_size_and_floor():
    rows = [row("supervised", [A]), row("supervised", [A, B]), row("independent", [A, B])]
    assert chosen(rows, "supervised", 2) == rows[1:2]
    assert chosen(rows, "supervised", is_floor=lambda floor: floor != "floor") == []


def test_a_wrong_merge_counts_in_whichever_suite_it_was_used():
    def led(policy, has_wrong):
        merges = {"wrong": int(has_wrong), "off": 0, "false": 0}
        more = {
            "supervisor": {},
            "merges": merges,
            "tick_ms": {"p50": None, "p95": None},
            "c_others_final": 1.0,
            "coverage_final": 1.0,
        }
        return row(policy, [A, B]) | more

    suites = dict.fromkeys(("teams", "one", "pairs", "three", "alone", "five"), ())

    def wrong_runs(rows, failing):
        (goal,) = [each for each in goals_of(rows, failing) if each.title.startswith("runs in which a wrong merge")]
        return goal

    right, wrong = led("supervised", False), led("supervised", True)
    assert wrong_runs(suites | {"teams": [right]}, [right]).is_reached
    for found in (
        wrong_runs(suites | {"teams": [wrong]}, [right]),
        wrong_runs(suites | {"teams": [right]}, [wrong]),
    ):
        assert (found.found.estimate, found.found.size, found.is_reached) == (50.0, 2, False)
    assert wrong_runs(suites | {"teams": [right, led("oracle_starts", True)]}, ()).is_reached
