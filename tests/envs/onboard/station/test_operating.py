"""Operating states and orders: what each order does to a robot, and what brings a robot into each state."""

import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy, Stop
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.driving.path_following import BACKING_SPEED
from lidarium.envs.onboard.radio.messages import OperatingState, Order, OrderKind, Target
from lidarium.envs.onboard.station.operating import RETREAT_S
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.radio import RadioSettings
from lidarium.evaluation.episodes.runner import run_episode

HALL = Floor("hall", (0.0, 0.0, 20.0, 12.0))
PAUSE, RESUME, STOP, EXPLORE = (Order(OrderKind(name)) for name in ("pause", "resume", "stop", "explore"))


def go_to(x, y):
    return Order(OrderKind.GO_TO, Target(x, y))


def hall(level="waypoint", starts=((3.0, 3.0, 0.0), (3.0, 9.0, 0.0)), **options):
    """Return a team in an empty hall, whose robots' map frames begin at their starts, all but the turn."""
    options = {"lidar": "lidar_360_6m", "stop_coverage": None, "known_starts": False, **options}
    env = lidarium.parallel_env(HALL, level=level, robots=len(starts), **options)
    env.reset(seed=1, options={"starts": [list(start) for start in starts]})
    return env


def state_of(env, agent="robot_0"):
    return env.unwrapped.operating.states[env.possible_agents.index(agent)]


def told(env, agent="robot_0"):
    """What happened to a robot: kinds, names and reasons of its events."""
    return [
        (event.kind, event.what, event.reason) for event in env.unwrapped.operating.events[0] if event.agent == agent
    ]


def drive(env, decisions=1, **actions):
    for _ in range(decisions):
        outcome = env.step({agent: actions[agent] for agent in env.agents if agent in actions})
    return outcome


class Scripted(Policy):
    """Does at each decision what a table says, else stays; notes what it sees of the first robot."""

    shares_map = False

    def __init__(self, orders, level="waypoint", otherwise=None):
        self.orders, self.level, self.otherwise = orders, level, otherwise

    def reset(self, team, seed):
        self.team, self.decisions, self.seen = team, 0, []

    def act(self, observations):
        report = self.team.report("robot_0")
        self.seen.append(
            (
                self.team.operating_state("robot_0"),
                None if report is None else report.state,
                self.team.belief("robot_0").pose,
            )
        )
        chosen = self.orders.get(self.decisions, {})
        self.decisions += 1
        return {agent: chosen.get(agent, self.otherwise) for agent in observations}


def test_a_robot_that_nobody_told_anything_operates():
    env = hall()
    infos = drive(env, robot_0=None, robot_1=None)[4]
    assert {(info["state"], info["order"]) for info in infos.values()} == {("operating", "")}
    assert env.unwrapped.operating.events[0] == []


def test_an_order_to_go_somewhere_takes_a_robot_there():
    env = hall()
    env.order("robot_0", go_to(2.0, 1.0))
    infos = drive(env, 6, robot_1=None)[4]
    assert np.allclose(env.unwrapped.world.poses[0, :2], [5.0, 4.0], atol=0.1)
    assert infos["robot_0"]["order"] == "go_to"
    assert infos["robot_0"]["drive"].value == "arrived"
    assert np.allclose(env.unwrapped.world.poses[1], [3.0, 9.0, 0.0])


def test_an_order_goes_before_what_the_policy_chose_in_the_same_decision():
    env = hall()
    env.order("robot_0", go_to(0.0, 2.0))
    drive(env, robot_0=Target(2.0, 0.0), robot_1=None)
    assert env.driver.target(0) == Target(0.0, 2.0)
    drive(env, robot_0=Target(2.0, 0.0), robot_1=None)
    assert env.driver.target(0) == Target(2.0, 0.0)


def test_a_paused_robot_stands_until_it_is_told_to_resume_and_then_goes_on():
    env = hall()
    drive(env, robot_0=Target(5.0, 0.0), robot_1=None)
    env.order("robot_0", PAUSE)
    assert state_of(env) is OperatingState.PAUSED
    infos = drive(env, 3, robot_0=Target(0.0, 0.0), robot_1=None)[4]
    stood = env.unwrapped.world.poses[0].copy()
    drive(env, robot_0=Target(0.0, 0.0), robot_1=None)
    assert np.array_equal(env.unwrapped.world.poses[0], stood)
    assert infos["robot_0"]["state"] == "paused"
    env.order("robot_0", RESUME)
    drive(env, 2, robot_1=None)
    assert env.unwrapped.world.poses[0, 0] > stood[0] + 0.8
    assert state_of(env) is OperatingState.OPERATING
    assert told(env) == [
        ("order", "pause", ""),
        ("state", "paused", "order"),
        ("order", "resume", ""),
        ("state", "operating", "order"),
    ]


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_a_pause_holds_at_every_level_of_decision(level):
    env = hall(level)
    action = np.array([0.5, 0.2], np.float32) if level == "velocity" else 0
    drive(env, 5, robot_0=action, robot_1=action)
    env.order("robot_0", PAUSE)
    drive(env, 5, robot_0=action, robot_1=action)
    stood = env.unwrapped.world.poses.copy()
    drive(env, 5, robot_0=action, robot_1=action)
    assert np.array_equal(env.unwrapped.world.poses[0], stood[0])
    assert not np.array_equal(env.unwrapped.world.poses[1], stood[1])
    env.order("robot_0", RESUME)
    drive(env, 5, robot_0=action, robot_1=action)
    assert not np.array_equal(env.unwrapped.world.poses[0], stood[0])


def test_at_the_level_of_frontiers_an_order_to_go_somewhere_is_driven_too():
    env = hall("frontier")
    env.order("robot_0", go_to(3.0, 0.0))
    for _ in range(6):
        drive(env, robot_1=16)
    assert np.allclose(env.unwrapped.world.poses[0, :2], [6.0, 3.0], atol=0.1)
    env.order("robot_0", EXPLORE)
    drive(env, robot_0=0, robot_1=16)
    assert env.driver.target(0) != Target(3.0, 0.0)


def test_an_order_to_stop_ends_a_robot_with_its_reason():
    env = hall()
    env.order("robot_0", Order(OrderKind.STOP, reason="enough"))
    _, _, terminated, _, infos = drive(env, robot_1=None)
    assert terminated == {"robot_0": True, "robot_1": False}
    assert infos["robot_0"]["ended_because"] == "enough"
    assert infos["robot_0"]["state"] == "stopped"
    env.order("robot_1", STOP)
    assert drive(env)[4]["robot_1"]["ended_because"] == "stopped"


def test_an_order_to_explore_leaves_the_choice_to_the_policy():
    env = hall()
    env.order("robot_0", go_to(2.0, 0.0))
    drive(env, robot_1=None)
    env.order("robot_0", EXPLORE)
    infos = drive(env, robot_0=Target(0.0, 2.0), robot_1=None)[4]
    assert infos["robot_0"]["order"] == "explore"
    assert env.driver.target(0) == Target(0.0, 2.0)


@pytest.mark.parametrize(("kind", "why"), [("explore", "paused"), ("go_to", "paused")])
def test_a_paused_robot_takes_no_new_work(kind, why):
    env = hall()
    env.order("robot_0", PAUSE)
    env.order("robot_0", go_to(1.0, 0.0) if kind == "go_to" else EXPLORE)
    assert told(env)[-1] == ("refused", kind, why)
    assert env.unwrapped.operating.orders[0] is PAUSE
    env.order("robot_0", STOP)
    assert drive(env, robot_1=None)[2]["robot_0"]


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ((500.0, 0.0), "outside"),
        ((0.0, -500.0), "outside"),
        ((-3.025, 0.0), "occupied"),
        ((0.0, -3.025), "occupied"),
    ],
)
def test_a_goal_outside_the_map_or_in_a_wall_is_refused_and_told_and_the_robot_goes_on(target, why):
    env = hall()
    drive(env, robot_0=Target(2.0, 0.0), robot_1=None)
    env.order("robot_0", go_to(*target))
    assert told(env) == [("refused", "go_to", why)]
    drive(env, 3, robot_1=None)
    assert np.allclose(env.unwrapped.world.poses[0, :2], [5.0, 3.0], atol=0.1)


def test_a_goal_behind_a_wall_that_is_not_known_yet_ends_in_a_drive_without_a_path():
    env = hall()
    env.order("robot_0", go_to(0.0, -4.0))
    infos = drive(env, robot_1=None)[4]
    assert told(env) == [("order", "go_to", "")]
    assert infos["robot_0"]["drive"].value == "no_path"


def test_at_the_level_of_velocities_the_onboard_driver_takes_a_robot_to_the_goal_of_an_order():
    env = hall("velocity")
    env.order("robot_0", go_to(1.0, 0.0))
    stands = np.zeros(2, np.float32)
    for _ in range(60):
        drive(env, robot_1=stands)
    assert told(env) == [("order", "go_to", "")]
    assert np.allclose(env.belief("robot_0").pose[:2], [1.0, 0.0], atol=0.15)
    assert np.array_equal(env.world.poses[1], env.engine.starts[0].starts[1])


def test_who_has_ended_takes_no_order_and_nothing_happens():
    env = hall()
    env.stop("robot_0", "tired")
    drive(env, robot_0=None, robot_1=None)
    env.order("robot_0", RESUME)
    env.order("robot_0", RESUME)
    drive(env, robot_1=None)
    assert told(env) == [("state", "stopped", "tired"), ("refused", "resume", "stopped")]
    with pytest.raises(ValueError, match="'robot_7' is not among the agents"):
        env.order("robot_7", RESUME)


def test_an_order_that_is_given_again_and_again_is_told_once():
    env = hall()
    for _ in range(3):
        env.order("robot_0", go_to(2.0, 0.0))
        drive(env, robot_1=None)
    assert told(env) == [("order", "go_to", "")]


def test_who_was_never_given_an_order_needs_an_action():
    env = hall()
    with pytest.raises(ValueError, match="no action for robot_0"):
        drive(env, robot_1=None)


def test_a_dead_robot_has_failed_and_an_episode_of_failed_robots_is_over():
    faults = FaultSettings(schedule=tuple(Fault(kind="dead_robot", robot=robot, at_s=1.0) for robot in (0, 1)))
    env = hall(faults=faults)
    infos = drive(env, robot_0=Target(3.0, 0.0), robot_1=None)[4]
    assert env.agents == []
    assert {info["state"] for info in infos.values()} == {"failed"}
    env.order("robot_0", RESUME)
    assert told(env) == [("state", "failed", "failed"), ("refused", "resume", "failed")]


def ramming(**options):
    """A robot whose laser is blind drives at a wall that it cannot see."""
    blind = FaultSettings(schedule=(Fault(kind="laser_dropout", lasts_s=600.0),))
    return hall("velocity", starts=((18.5, 3.0, 0.0),), faults=blind, **options)


def test_a_contact_pauses_no_robot_by_default():
    env = ramming()
    drive(env, 60, robot_0=np.array([0.5, 0.0], np.float32))
    assert env.unwrapped.world.contacts[0]
    assert state_of(env) is OperatingState.OPERATING


def test_a_contact_pauses_a_robot_that_backs_out_when_it_resumes():
    env = ramming(pauses_when_blocked=True)
    forward = np.array([0.5, 0.0], np.float32)
    drive(env, 60, robot_0=forward)
    assert told(env) == [("state", "paused", "contact")]
    stood = env.unwrapped.world.poses[0].copy()
    drive(env, 5, robot_0=forward)
    assert np.array_equal(env.unwrapped.world.poses[0], stood)
    env.order("robot_0", RESUME)
    drive(env, round(RETREAT_S / 0.1) + 1, robot_0=np.zeros(2, np.float32))
    assert stood[0] - env.unwrapped.world.poses[0, 0] == pytest.approx(BACKING_SPEED * RETREAT_S, rel=0.15)
    assert state_of(env) is OperatingState.OPERATING
    # Told to drive on, it meets the wall again.
    drive(env, 10, robot_0=forward)
    assert state_of(env) is OperatingState.PAUSED
    assert env.unwrapped.world.collisions[0] == 2


def test_a_blocked_way_pauses_a_robot_and_ends_the_decision_and_it_finds_another_when_it_resumes():
    appears = Fault(kind="kidnapping", robot=1, at_s=2.1, place=(4.2, 3.0, 0.0))
    env = hall(faults=FaultSettings(schedule=(appears,)), pauses_when_blocked=True, decision_period_s=6.0)
    drive(env, robot_0=Target(5.0, 0.0), robot_1=None)
    assert told(env) == [("state", "paused", "blocked")]
    assert env.unwrapped.scorer.time < 6.0
    stood = env.unwrapped.world.poses[0, 0]
    drive(env, robot_0=Target(0.0, 0.0), robot_1=None)
    assert env.unwrapped.world.poses[0, 0] == stood
    env.order("robot_0", RESUME)
    drive(env, 5, robot_1=None)
    assert np.allclose(env.unwrapped.world.poses[0, :2], [8.0, 3.0], atol=0.1)
    assert env.unwrapped.world.collisions[0] == 0


def test_teammates_drive_round_a_paused_robot_which_never_gives_way():
    env = hall(starts=((3.0, 3.0, 0.0), (5.0, 3.0, 0.0)), known_starts=True)
    env.order("robot_1", PAUSE)
    stood = env.unwrapped.world.poses[1].copy()
    drive(env, 9, robot_0=Target(5.0, 0.0))
    assert np.allclose(env.unwrapped.world.poses[0, :2], [8.0, 3.0], atol=0.1)
    assert np.array_equal(env.unwrapped.world.poses[1], stood)
    assert env.unwrapped.world.collisions.sum() == 0


def test_a_policy_pauses_resumes_sends_and_stops_its_robots():
    orders = {
        0: {"robot_0": go_to(2.0, 0.0)},
        1: {"robot_0": PAUSE},
        3: {"robot_0": RESUME},
        7: {"robot_0": STOP, "robot_1": Stop("done")},
    }
    env = hall("velocity")
    policy = Scripted(orders, otherwise=Target(2.0, 0.0))
    run_episode(policy, env, seed=0, options={"starts": [[3.0, 3.0, 0.0], [3.0, 9.0, 0.0]]})
    states = [state.value for state, _, _ in policy.seen]
    assert states == [
        "operating",
        "operating",
        "paused",
        "paused",
        "operating",
        "operating",
        "operating",
        "operating",
    ]
    assert [report.value for _, report, _ in policy.seen] == states
    assert np.array_equal(policy.seen[2][2], policy.seen[3][2])
    assert np.allclose(policy.seen[-1][2][:2], [2.0, 0.0], atol=0.1)
    assert env.scorer.ended_because == {"robot_0": "stopped", "robot_1": "done"}


def test_a_late_order_acts_when_it_arrives_and_ends_the_decision():
    env = hall(radio=RadioSettings(kind="range", latency_s=0.5))
    drive(env, robot_0=Target(5.0, 0.0), robot_1=None)
    began = env.unwrapped.scorer.time
    env.order("robot_0", PAUSE)
    assert state_of(env) is OperatingState.OPERATING
    drive(env, robot_0=Target(5.0, 0.0), robot_1=None)
    assert state_of(env) is OperatingState.PAUSED
    assert env.unwrapped.scorer.time == pytest.approx(began + 0.6)
    assert env.unwrapped.operating.events[0][0].time_s == pytest.approx(began + 0.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Order("dance"), "kind of the order is 'dance'; want one of pause, resume"),
        (lambda: Order(OrderKind.GO_TO), "target of the order 'go_to' is None; want a Target"),
        (lambda: Order(OrderKind.PAUSE, Target(0.0, 0.0)), "want None, only 'go_to' has a target"),
        (lambda: OperatingState("asleep"), "operating state is 'asleep'; want one of operating, paused"),
    ],
)
def test_states_and_orders_that_cannot_be_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_an_order_is_made_by_name_too():
    assert Order("pause") == PAUSE


def test_orders_leave_no_trace_in_the_next_episode():
    env = hall()
    env.order("robot_0", PAUSE)
    env.order("robot_1", go_to(2.0, 0.0))
    env.reset(seed=1)
    assert env.unwrapped.operating.events[0] == []
    with pytest.raises(ValueError, match="no action for robot_0"):
        drive(env, robot_1=None)


def test_nothing_is_done_in_a_step_where_nobody_gives_orders():
    env = hall()
    assert not env.unwrapped.operating.is_active
    env.order("robot_0", PAUSE)
    assert env.unwrapped.operating.is_active
    env.order("robot_0", RESUME)
    assert not env.unwrapped.operating.is_active
