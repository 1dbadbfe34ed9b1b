"""Rules of other projects end an episode in time."""

from types import SimpleNamespace

import numpy as np
import pytest

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.stop_rules import STOP_REASON, Stopper, StopRule, stop_rule_of
from lidarium.evaluation.episodes.watching import WatchedExploration


def met(rule, coverage, decisions=1):
    env = SimpleNamespace(scorer=SimpleNamespace(coverage=coverage))
    return rule.is_met(env, None, decisions)


def test_a_bound_is_met_at_above_or_below_its_value():
    assert met(StopRule(figure="c_free", at_least=0.5), 0.5)
    assert not met(StopRule(figure="c_free", above=0.5), 0.5)
    assert met(StopRule(figure="c_free", above=0.5), 0.51)
    assert met(StopRule(figure="c_free", at_most=0.5), 0.5)
    assert not met(StopRule(figure="c_free", at_most=0.0), 0.1)


def test_decisions_end_an_episode_whatever_the_figure():
    rule = StopRule(figure="c_free", at_least=0.9, decisions=3)
    assert [met(rule, 0.1, decisions) for decisions in (2, 3, 4)] == [False, True, True]
    assert not met(StopRule(decisions=3), 1.0, 2)


def test_own_coverage_is_that_of_the_robot_that_knows_least():
    history = SimpleNamespace(curves=SimpleNamespace(c_own=np.array([[0.9, 0.9], [0.8, 0.3]])))
    assert StopRule(figure="c_own_min", at_most=0.3).is_met(None, history, 1)
    assert not StopRule(figure="c_own_min", at_least=0.31).is_met(None, history, 1)


@pytest.mark.parametrize(
    ("rule", "holds"),
    [
        (StopRule(decisions=2), lambda env, history: 4.0 <= env.scorer.time < 4.2),
        (StopRule(figure="c_known", at_least=0.2), lambda env, history: history.curves.c_known[-1] >= 0.2),
        (StopRule(figure="remaining_cells", at_most=9000), lambda env, history: True),
    ],
)
def test_all_robots_end_by_the_rule_before_the_horizon(rule, holds):
    history = History()
    settings = make_settings(robots=2, resolution=0.05, horizon_s=300.0)
    env = WatchedExploration("apartment", settings, watchers=[history])
    run_episode(lidarium.policy("nearest_frontier"), env, 0, on_decision=Stopper(rule, history))
    assert set(env.scorer.ended_because.values()) == {STOP_REASON}
    assert env.scorer.time < 300.0
    assert holds(env, history)


@pytest.mark.parametrize("policy", ["random_walk", "tour_frontier"])
def test_policies_that_decide_often_get_as_much_time(policy):
    history = History()
    env = WatchedExploration("apartment", make_settings(resolution=0.05, horizon_s=300.0), watchers=[history])
    run_episode(lidarium.policy(policy), env, 0, on_decision=Stopper(StopRule(decisions=3), history))
    assert set(env.scorer.ended_because.values()) == {STOP_REASON}
    assert 6.0 <= env.scorer.time < 6.6


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (3, "the stop rule is 3; want a table"),
        ({"figur": "c_free"}, "has no 'figur'; it has figure"),
        ({"figure": "coverage", "above": 0.5}, "is 'coverage'; want one of c_free"),
        ({"figure": "c_free"}, "with 0 bounds"),
        ({"figure": "c_free", "above": 0.5, "at_most": 0.1}, "with 2 bounds"),
        ({"above": 0.5, "decisions": 3}, "asks for None with 1 bounds"),
        ({}, "ends nothing"),
        ({"decisions": -1}, "decisions"),
    ],
)
def test_rules_that_are_not_clear_are_refused(content, message):
    with pytest.raises(ValueError, match=message):
        stop_rule_of(content)


def test_no_rule_is_none():
    assert stop_rule_of(None) is None
    assert stop_rule_of({"decisions": 4}) == StopRule(decisions=4)
