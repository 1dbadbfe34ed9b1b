"""Supervised teams in the simulator, with unknown starts."""

from functools import lru_cache

import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy
from lidarium.agents.random_walk import RandomWalk
from lidarium.agents.supervisor.factories import supervised
from lidarium.agents.supervisor.policy import Supervised
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.evaluation.episodes.events import decision_lines
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.metrics.merges import transform_error


class FirstFrontier(Policy):
    """Takes the cheapest frontier on offer."""

    level, shares_map = "frontier", True

    def reset(self, team, seed):
        self.team = team

    def act(self, observations):
        return {
            agent: 0 if observation["action_mask"][0] else 16 for agent, observation in observations.items()
        }


@lru_cache
def finished(name, robots=2, horizon_s=400.0, **settings):
    env = lidarium.parallel_env(
        "apartment", robots=robots, known_starts=False, horizon_s=horizon_s, stop_coverage=None, **settings
    )
    return run_episode(lidarium.policy(name), env, seed=0)


def test_two_robots_are_joined_rightly_redirected_and_stopped_when_the_floor_is_explored():
    episode = finished("supervised")
    env, policy = episode.env, episode.policy
    assert env.scorer.coverage >= 0.99
    assert set(env.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}
    assert episode.merges
    for merge in episode.merges:
        distance, angle = transform_error(merge.found, merge.true, merge.at)
        assert distance < 0.1
        assert angle < 0.02
    figures = result_of(episode, "supervised")
    assert figures["merges"]["accepted"] == len(episode.merges)
    assert figures["supervisor"]["decisions"] == len(policy.decisions)
    assert figures["supervisor"]["redirections"] >= 1
    assert figures["supervisor"]["joined"] >= 1
    log = decision_lines(policy.report())
    assert log.count("\n") == len(policy.decisions) + len(policy.events)


def test_a_team_is_faster_than_robots_alone_and_about_as_fast_as_one_that_is_told_its_starts():
    alone, together = finished("independent"), finished("supervised")
    told = finished("oracle_starts", reveals_starts=True)
    times = {
        name: one.env.scorer.times[0.99]
        for name, one in (("alone", alone), ("together", together), ("told", told))
    }
    assert times["together"] < 0.7 * times["alone"]
    assert times["together"] <= 1.3 * times["told"]
    assert float(together.env.world.travelled.sum()) < 0.7 * float(alone.env.world.travelled.sum())


def test_the_same_seed_gives_the_same_decisions():
    first, second = finished("supervised"), finished.__wrapped__("supervised")
    assert first.policy.decisions == second.policy.decisions
    assert np.array_equal(first.env.world.poses, second.env.world.poses)


def test_a_robot_that_dies_is_left_out_and_the_other_goes_on():
    faults = FaultSettings(schedule=(Fault(kind="dead_robot", robot=1, at_s=55.0),))
    env = lidarium.parallel_env(
        "apartment", robots=2, known_starts=False, horizon_s=90.0, stop_coverage=None, faults=faults
    )
    policy = supervised()
    run_episode(policy, env, seed=0)
    assert {
        decision.rule
        for decision in policy.decisions
        if decision.agent == "robot_1" and decision.time_s > 60.0
    } == {1}
    assert {"excluded", "dropped"} <= {event.event for event in policy.events}
    assert {
        decision.group
        for decision in policy.decisions
        if decision.agent == "robot_0" and decision.time_s > 60.0
    } == {("robot_0",)}
    assert env.unwrapped.scorer.coverage > 0.9


def test_a_supervisor_leads_policies_that_choose_among_frontiers_too():
    env = lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=90.0, stop_coverage=None)
    policy = Supervised(FirstFrontier(), period_s=4.0, assignment="utility")
    run_episode(policy, env, seed=0)
    assert env.unwrapped.scorer.coverage > 0.8
    assert {decision.rule for decision in policy.decisions} & {5, 6}


@pytest.mark.parametrize("resumes", [False, True])
def test_robots_that_touch_something_go_on_by_order_alone(resumes):
    """The thesis's experiment with the bumper: a paused robot stays, and resumes off what it met."""
    env = lidarium.parallel_env(
        "apartment",
        robots=2,
        known_starts=False,
        horizon_s=60.0,
        stop_coverage=None,
        pauses_when_blocked=True,
    )
    env.reset(seed=0)
    policy = supervised(resumes_paused=resumes, period_s=4.0)

    class Pressed(type(policy)):
        """Presses the first robot's bumper once, at 10 s."""

        is_pressed = False

        def act(self, observations):
            operating = env.unwrapped.operating
            if not self.is_pressed and self._team.time_s >= 10.0:
                self.is_pressed = True
                operating._pause(0, "contact")
            return super().act(observations)

    policy.__class__ = Pressed
    run_episode(policy, env, seed=0)
    orders = [decision.order for decision in policy.decisions if decision.agent == "robot_0"]
    assert ("resume" in orders) == resumes
    states = [e.what for e in env.unwrapped.operating.events[0] if e.agent == "robot_0" and e.kind == "state"]
    assert states[0] == "paused"
    assert ("operating" in states) == resumes


@pytest.mark.parametrize("assignment", ["pairs", "hungarian"])
def test_robots_without_a_goal_are_paused_and_resume_to_go_to_one(assignment):
    env = lidarium.parallel_env("clinic", robots=3, known_starts=False, horizon_s=300.0, stop_coverage=None)
    policy = supervised(pauses_idle=True, assignment=assignment)
    run_episode(policy, env, seed=0)
    figures = policy.report().supervision.figures
    assert figures["pauses"] > 0
    assert set(env.unwrapped.scorer.ended_because.values()) == {"no_frontier"}
    events = env.unwrapped.operating.events[0]
    assert not [event for event in events if event.kind == "refused"]
    for event in events:
        if (event.kind, event.what) == ("order", "resume"):
            orders = [
                later.what
                for later in events
                if later.agent == event.agent and later.kind == "order" and later.time_s > event.time_s
            ]
            assert orders[0] == "go_to"
    if assignment == "pairs":
        assert figures["resumes"] > 0


def test_with_known_starts_there_is_nothing_to_search_for():
    env = lidarium.parallel_env("apartment", robots=2, horizon_s=20.0)
    policy = supervised()
    run_episode(policy, env, seed=0)
    assert [(join.time_s, join.is_used) for join in policy.joins] == [(0.0, True)]


def test_the_station_knows_only_what_the_radio_brought():
    env = lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=30.0, radio="none")
    policy = supervised()
    run_episode(policy, env, seed=0)
    # The station stands where the first robot started, and hears nobody.
    assert policy.joins == []
    assert {event.event for event in policy.events} == {"silent"}


def test_policies_that_go_to_no_goals_and_settings_given_twice_are_refused():
    with pytest.raises(ValueError, match="velocity"):
        Supervised(RandomWalk())
    with pytest.raises(ValueError, match="period_s"):
        Supervised(FirstFrontier(), SupervisorSettings(), period_s=5.0)


def test_starts_that_are_not_revealed_join_nobody():
    env = lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=20.0)
    with pytest.raises(ValueError, match="reveals_starts"):
        run_episode(lidarium.policy("oracle_starts"), env, seed=0)
