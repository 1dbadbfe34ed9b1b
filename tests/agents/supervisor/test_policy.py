"""Supervised teams in the simulator, with unknown starts."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy
from lidarium.agents.policy import Stop
from lidarium.agents.supervisor.factories import supervised
from lidarium.agents.supervisor.policy import LOST_S, PATIENCE_S, Supervised, _Errands, _LedTeam
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.supervisor import Command
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.radio.messages import DriveState, OrderKind, Target
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
        return {agent: 0 if observation["action_mask"][0] else 16 for agent, observation in observations.items()}


@lru_cache
def finished(name, robots=2, horizon_s=400.0, **settings):
    env = lidarium.parallel_env(
        "apartment",
        robots=robots,
        known_starts=False,
        horizon_s=horizon_s,
        stop_coverage=None,
        **settings,
        starts="fixed",
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


def test_no_join_of_robots_that_know_their_starts_is_wrong_by_the_truth():
    env = lidarium.parallel_env("apartment", robots=2, horizon_s=60.0, stop_coverage=None)
    figures = result_of(run_episode(lidarium.policy("supervised"), env, seed=0), "supervised")["merges"]
    assert (figures["accepted"], figures["wrong"]) == (1, 0)
    assert figures["worst_here_m"] == pytest.approx(0.0, abs=1e-9)


def test_a_team_is_faster_than_robots_alone_and_about_as_fast_as_one_that_is_told_its_starts():
    alone, together = finished("independent"), finished("supervised")
    told = finished("oracle_starts", reveals_starts=True)
    times = {
        name: one.env.scorer.times[0.99] for name, one in (("alone", alone), ("together", together), ("told", told))
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
        "apartment", robots=2, known_starts=False, horizon_s=90.0, stop_coverage=None, faults=faults, starts="fixed"
    )
    policy = supervised()
    run_episode(policy, env, seed=0)
    assert {
        decision.rule for decision in policy.decisions if decision.agent == "robot_1" and decision.time_s > 60.0
    } == {1}
    assert {"excluded", "dropped"} <= {event.event for event in policy.events}
    assert {
        decision.group for decision in policy.decisions if decision.agent == "robot_0" and decision.time_s > 60.0
    } == {("robot_0",)}
    assert env.unwrapped.scorer.coverage > 0.9


def test_a_supervisor_leads_policies_that_choose_among_frontiers_too():
    env = lidarium.parallel_env(
        "apartment", robots=2, known_starts=False, horizon_s=90.0, stop_coverage=None, starts="fixed"
    )
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
        starts="fixed",
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
    env = lidarium.parallel_env(
        "scene_loop_corridor", robots=3, resolution=0.05, horizon_s=300.0, stop_coverage=None, starts="fixed"
    )
    policy = supervised(pauses_idle=True, assignment=assignment, period_s=4.0)
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
    assert figures["resumes"] > 0


def test_with_known_starts_there_is_nothing_to_search_for():
    env = lidarium.parallel_env("apartment", robots=2, horizon_s=20.0, starts="fixed")
    policy = supervised()
    run_episode(policy, env, seed=0)
    assert [(join.time_s, join.is_used) for join in policy.joins] == [(0.0, True)]


def test_the_station_knows_only_what_the_radio_brought():
    env = lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=30.0, radio="none", starts="fixed")
    policy = supervised()
    run_episode(policy, env, seed=0)
    # The station stands where the first robot started, and hears nobody.
    assert policy.joins == []
    assert {event.event for event in policy.events} == {"silent"}


def test_settings_given_twice_are_refused():
    with pytest.raises(ValueError, match="period_s"):
        Supervised(FirstFrontier(), SupervisorSettings(), period_s=5.0)


def test_starts_that_are_not_revealed_join_nobody():
    env = lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=20.0, starts="fixed")
    with pytest.raises(ValueError, match="reveals_starts"):
        run_episode(lidarium.policy("oracle_starts"), env, seed=0)


def known_up_to(column):
    """A map of 4 m by 4 m that is free up to a column and unknown beyond."""
    log_odds = np.zeros((40, 40), np.int8)
    log_odds[:, :column] = -40
    navigation = NavigationMap(log_odds, 0.1)
    navigation.changed((0, 40, 0, 40))
    return navigation


class Robots:
    """A team of one robot, made by hand."""

    def __init__(self):
        self.time_s, self.state, self.taken = 10.0, DriveState.DRIVING, None
        self.place, self.map = (1.0, 2.0), known_up_to(20)

    def belief(self, agent):
        return SimpleNamespace(pose=np.array([*self.place, 0.0]), map=self.map, shared_map=None, map_origin=(0.0, 0.0))

    def drive_state(self, agent):
        return self.state

    def last_order(self, agent):
        return self.taken


def sent(**changes):
    """A robot that has been sent to a frontier, and has taken the order."""
    team = Robots()
    errands = _Errands(team)
    values = {"agent": "a", "kind": OrderKind.GO_TO, "rule": 3, "why": "because"}
    errands.begin(Command(**{**values, "target": Target(1.9, 2.0), "observes": (2.0, 2.0), **changes}))
    order = errands.action("a")
    team.taken = order
    errands.review("a")
    return team, errands, order


def test_a_robot_gets_its_order_once_and_is_away():
    _, errands, order = sent()
    assert (order.kind, order.target, order.reason) == (OrderKind.GO_TO, Target(1.9, 2.0), "rule 3: because")
    assert errands.is_away("a")
    assert errands.action("a") is None
    errands.cancel("a")
    assert not errands.is_away("a")
    assert not errands.has_any(["a"])
    errands.cancel("a")


def test_a_command_without_a_target_is_no_errand():
    errands = _Errands(Robots())
    errands.begin(Command("a", OrderKind.PAUSE, 1, "wait"))
    assert not errands.has_any(["a"])


@pytest.mark.parametrize(("after_s", "is_left"), [(LOST_S, 1), (LOST_S + 0.1, 0)])
def test_an_order_that_was_not_taken_is_lost_after_a_while(after_s, is_left):
    team = Robots()
    errands = _Errands(team)
    errands.begin(Command("a", OrderKind.GO_TO, 3, "because", Target(1.9, 2.0)))
    errands.action("a")
    # Until it has taken the order its policy drives it.
    assert not errands.is_away("a")
    team.time_s += after_s
    errands.review("a")
    assert errands.has_any(["a"]) == is_left


@pytest.mark.parametrize("state", [DriveState.ARRIVED, DriveState.NO_PATH])
def test_an_errand_ends_where_the_robot_is_there_or_cannot_come(state):
    team, errands, _ = sent()
    team.state = state
    errands.review("a")
    assert not errands.is_away("a")


def test_an_errand_ends_where_nothing_is_left_to_see():
    team, errands, _ = sent()
    errands.review("a")
    assert errands.is_away("a")
    team.map = known_up_to(40)
    errands.review("a")
    assert not errands.is_away("a")


def test_a_robot_that_does_not_move_explores_by_itself_again_unless_it_gives_way():
    team, errands, _ = sent()
    for state, place in ((DriveState.GIVING_WAY, (1.0, 2.0)), (DriveState.DRIVING, (1.3, 2.0))):
        team.time_s += PATIENCE_S
        team.state, team.place = state, place
        errands.review("a")
        assert errands.is_away("a")
    team.time_s += PATIENCE_S + 0.1
    errands.review("a")
    assert not errands.is_away("a")


@pytest.mark.parametrize(("state", "reason"), [(DriveState.ARRIVED, "returned"), (DriveState.NO_PATH, "unreachable")])
def test_a_robot_that_is_sent_home_ends_there(state, reason):
    team, errands, _ = sent(is_home=True, observes=None)
    team.time_s += 10.0 * PATIENCE_S
    errands.review("a")
    assert errands.action("a") is None
    errands.begin(Command("a", OrderKind.GO_TO, 9, "again", Target(0.0, 0.0), is_home=True))
    assert errands.action("a") is None
    team.state = state
    errands.review("a")
    assert errands.action("a") == Stop(reason)


def led(exploring):
    asked = []

    def answered(name):
        def answer(*given):
            asked.append((name, *given))
            return f"{name} of {given[0]}"

        return answer

    names = ("belief", "operating_state", "report", "last_order", "send_map", "forget_walls")
    team = SimpleNamespace(
        agents=["a", "b"],
        time_s=4.0,
        drive_state=lambda agent: DriveState.BLOCKED,
        **{name: answered(name) for name in names},
    )
    return _LedTeam(team, exploring), asked


def test_drives_for_the_supervisor_are_hidden():
    exploring = {"a"}
    team, _ = led(exploring)
    assert (team.drive_state("a"), team.drive_state("b")) == (DriveState.BLOCKED, DriveState.IDLE)
    # The supervisor may take a robot, or give it back, at any time.
    exploring.add("b")
    exploring.discard("a")
    assert (team.drive_state("a"), team.drive_state("b")) == (DriveState.IDLE, DriveState.BLOCKED)


@pytest.mark.parametrize("name", ["belief", "operating_state", "report", "last_order"])
def test_all_else_is_what_the_team_says(name):
    team, asked = led(set())
    assert getattr(team, name)("b") == f"{name} of b"
    assert asked == [(name, "b")]
    assert (team.agents, team.time_s) == (["a", "b"], 4.0)


def test_what_is_told_reaches_the_team():
    team, asked = led(set())
    team.send_map("a", None)
    team.forget_walls("b", "trail")
    assert asked == [("send_map", "a", None), ("forget_walls", "b", "trail")]
