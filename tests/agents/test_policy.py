"""The contract of policies: registered by name, one object a team or one a robot, and every robot says why
it ended."""

import signal
from contextlib import contextmanager
from functools import lru_cache

import numpy as np
import pytest
from all_observed import ALL

import lidarium
from lidarium.agents import GivenUp, PerRobot, Policy, Stop, policy_names
from lidarium.envs.onboard.radio.messages import Target
from lidarium.evaluation.episodes.runner import run_episode

FRONTIER_POLICIES = (
    "nearest_frontier",
    "nearest_frontier_own_map",
    "utility_frontier",
    "explore_lite",
    "tour_frontier",
)
REASONS = {"covered", "no_frontier", "frontier_unreachable"}


@lru_cache
def finished(name, robots, seed=1, floor="apartment"):
    """A finished episode; a random walk gets a horizon, the others none."""
    horizon = 20.0 if name == "random_walk" else None
    env = lidarium.parallel_env(floor, robots=robots, horizon_s=horizon, map_cells=32, observe=ALL, starts="fixed")
    return run_episode(lidarium.policy(name), env, seed)


@pytest.mark.parametrize("robots", [1, 2, 3, 10])
@pytest.mark.parametrize("name", FRONTIER_POLICIES)
def test_every_explorer_finishes_the_apartment_without_contact_and_says_why_each_robot_ended(name, robots):
    env = finished(name, robots).env
    assert env.agents == []
    assert env.scorer.ended_because.keys() == set(env.possible_agents)
    assert set(env.scorer.ended_because.values()) <= REASONS
    assert env.scorer.coverage >= 0.99
    assert env.world.collisions.sum() == 0


@pytest.mark.parametrize("robots", [1, 3])
def test_the_random_walk_ends_at_the_horizon_and_says_so(robots):
    env = finished("random_walk", robots).env
    assert env.scorer.time == pytest.approx(20.0)
    assert set(env.scorer.ended_because.values()) <= {"horizon", "covered"}
    assert env.scorer.ended_because.keys() == set(env.possible_agents)


@pytest.mark.parametrize("name", sorted({*FRONTIER_POLICIES, "random_walk"}))
def test_the_same_seed_gives_the_same_run(name):
    first = finished(name, 3)
    second = finished.__wrapped__(name, 3)
    assert np.array_equal(first.env.world.poses, second.env.world.poses)
    assert np.array_equal(first.env.world.travelled, second.env.world.travelled)
    assert first.env.scorer.curve == second.env.scorer.curve
    assert first.env.scorer.ended_because == second.env.scorer.ended_because
    assert first.given_up == second.given_up
    assert all(
        np.array_equal(a, b) for a, b in zip(first.env.beliefs.log_odds, second.env.beliefs.log_odds, strict=True)
    )


def test_another_seed_gives_another_random_walk():
    assert not np.array_equal(finished("random_walk", 3).env.world.poses, finished("random_walk", 3, 2).env.world.poses)


def test_a_policy_object_is_used_again_as_if_new():
    policy = lidarium.policy("utility_frontier")
    runs = [
        run_episode(policy, lidarium.parallel_env("apartment", robots=2, map_cells=32, observe=ALL, starts="fixed"), 5)
        for _ in range(2)
    ]
    assert np.array_equal(runs[0].env.world.poses, runs[1].env.world.poses)
    assert runs[0].given_up == runs[1].given_up


def test_more_robots_are_faster():
    assert finished("utility_frontier", 3).env.scorer.time < finished("utility_frontier", 1).env.scorer.time


def test_all_registered_policies_are_tested_here_and_have_a_line_about_them():
    names = policy_names()
    assert set(names) >= {*FRONTIER_POLICIES, "random_walk"}
    assert list(names) == sorted(names)
    assert all(summary and "\n" not in summary for summary in names.values())


class Recorder(Policy):
    """A policy that notes what it is shown and stays where it is."""

    level = "waypoint"
    given_up = ()

    def __init__(self):
        self.calls, self.given_up = [], []

    def reset(self, team, seed):
        self.team, self.seed = team, seed

    def act(self, observations):
        self.calls.append({agent: observation["pose"].copy() for agent, observation in observations.items()})
        if self.team.time_s > 5.0:
            self.given_up = [GivenUp(agent, 1.0, 2.0, 0.1, "unseen") for agent in observations]
            return {agent: Stop("enough") for agent in observations}
        return dict.fromkeys(observations)


def test_a_decentralised_policy_has_one_instance_a_robot_that_sees_its_own_robot_only():
    made = []

    def factory():
        made.append(Recorder())
        return made[-1]

    env = lidarium.parallel_env("scene_room", robots=3, map_cells=32, observe=ALL, starts="fixed")
    episode = run_episode(PerRobot(factory), env, 3)
    instances = made[1:]
    assert [list(instance.calls[0]) for instance in instances] == [["robot_0"], ["robot_1"], ["robot_2"]]
    assert len({instance.seed for instance in instances}) == 3
    with pytest.raises(ValueError, match="sees its own robot only"):
        instances[0].team.belief("robot_1")
    assert env.scorer.ended_because == dict.fromkeys(env.possible_agents, "enough")
    assert [entry.agent for entry in episode.given_up] == env.possible_agents


@pytest.mark.parametrize("name", ["nearest_frontier", "random_walk"])
def test_decentralised_explorers_finish_as_well(name):
    env = lidarium.parallel_env(
        "apartment",
        robots=2,
        horizon_s=None if name != "random_walk" else 10.0,
        map_cells=32,
        observe=ALL,
        starts="fixed",
    )
    run_episode(PerRobot(lambda: lidarium.policy(name)), env, 1)
    assert env.scorer.ended_because.keys() == set(env.possible_agents)
    if name != "random_walk":
        assert env.scorer.coverage >= 0.99
        assert env.world.collisions.sum() == 0


class StopsOne(Recorder):
    """Stops the first robot and drives the other."""

    def act(self, observations):
        self.calls.append(sorted(observations))
        answers = {agent: Target(0.3, 0.0) for agent in observations}
        if "robot_0" in observations:
            answers["robot_0"] = Stop("unreachable")
        return answers


def test_a_robot_that_stops_is_terminated_at_that_step_and_shown_no_more():
    policy, env = (
        StopsOne(),
        lidarium.parallel_env(
            "scene_room", robots=2, horizon_s=10.0, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed"
        ),
    )
    run_episode(policy, env, 3)
    assert policy.calls[0] == ["robot_0", "robot_1"]
    assert all(call == ["robot_1"] for call in policy.calls[1:])
    assert len(policy.calls) > 2
    assert env.scorer.ended_because == {"robot_0": "unreachable", "robot_1": "horizon"}


def test_the_runner_tells_of_every_decision_and_refuses_an_unknown_level():
    times = []
    env = lidarium.parallel_env(
        "scene_room", robots=1, horizon_s=10.0, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed"
    )
    episode = run_episode(Recorder(), env, 3, on_decision=lambda each: times.append(each.scorer.time))
    assert times[0] == 0.0
    assert times == sorted(times)
    assert len(episode.decision_seconds) == len(times) - 1
    wrong = Recorder()
    wrong.level = "thought"
    with pytest.raises(ValueError, match="thought"):
        run_episode(wrong, env, 3)


class Interrupts(Recorder):
    def act(self, observations):
        if self.team.time_s > 2.0:
            raise KeyboardInterrupt
        return super().act(observations)


class PressesControlC(Recorder):
    """Sends its own process the signal of Ctrl-C, some times within one decision."""

    def __init__(self, times):
        super().__init__()
        self.times = times
        self.went_on = False

    def act(self, observations):
        if self.team.time_s > 2.0:
            for _ in range(self.times):
                signal.raise_signal(signal.SIGINT)
            self.went_on = True
        return super().act(observations)


@contextmanager
def interrupts_handled_by(handler):
    """A process that was begun in the background may ignore SIGINT from its first moment on; these tests
    do not depend on it."""
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_first_interrupt_waits_for_the_end_of_the_step_and_a_second_does_not():
    env = lidarium.parallel_env("scene_room", robots=1, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed")
    policy = PressesControlC(1)
    with interrupts_handled_by(signal.default_int_handler):
        episode = run_episode(policy, env, 1, raise_interrupt=False)
        assert episode.is_interrupted
        assert policy.went_on
        with pytest.raises(KeyboardInterrupt):
            run_episode(PressesControlC(2), env, 1, raise_interrupt=False)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("is_ignored", [False, True])
def test_an_application_that_handles_or_ignores_interrupts_keeps_doing_so(is_ignored):
    noted = []
    env = lidarium.parallel_env(
        "scene_room", robots=1, horizon_s=10.0, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed"
    )
    with interrupts_handled_by(signal.SIG_IGN if is_ignored else lambda number, _: noted.append(number)):
        episode = run_episode(PressesControlC(1), env, 1, raise_interrupt=False)
    assert bool(noted) != is_ignored
    assert not episode.is_interrupted


def test_an_interrupted_episode_is_passed_on_or_kept_as_far_as_it_came():
    env = lidarium.parallel_env("scene_room", robots=1, stop_coverage=None, map_cells=32, observe=ALL, starts="fixed")
    with pytest.raises(KeyboardInterrupt):
        run_episode(Interrupts(), env, 1)
    episode = run_episode(Interrupts(), env, 1, raise_interrupt=False)
    assert episode.is_interrupted
    assert episode.env.scorer.time > 2.0


def test_a_policy_of_frontiers_may_say_that_it_reads_them():
    class Reads(lidarium.Policy):
        level, observes = "frontier", ("frontiers", "time_left")

        def reset(self, team, seed=0):
            pass

        def act(self, observations):
            assert all({"frontiers", "time_left"} <= set(seen) for seen in observations.values())
            return dict.fromkeys(observations, 0)

    lidarium.register_policy("reads_frontiers", Reads, "takes the first one")
    try:
        (row,) = lidarium.evaluate("reads_frontiers", seeds=1, settings={"horizon_s": 4.0})
    finally:
        lidarium.registry("policy").unregister("reads_frontiers")
    assert row["time_s"] == 4.0
