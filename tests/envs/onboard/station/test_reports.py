"""Reports: the station knows what has reached it, no more and no less, and its orders go no farther than
its links."""

import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy
from lidarium.agents.policy import PerRobot
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.radio.exchange import BLOCK_BYTES, HEADER_BYTES, STATUS_BYTES
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order, OrderKind, Target
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.radio import RadioSettings
from lidarium.envs.simulation.disturbances.radio import links, links_to
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.mapping.grids.occupancy import UNKNOWN, three_levels

HALL = Floor("hall", (0.0, 0.0, 30.0, 12.0))
WALLED = Floor("walled", (0.0, 0.0, 12.0, 12.0), (Solid(np.array([[6.0, 0.0], [6.2, 0.0], [6.2, 8.0], [6.0, 8.0]])),))
IDLE = np.zeros(2, np.float32)
AHEAD = np.array([0.4, 0.0], np.float32)


def team(starts, floor=HALL, level="velocity", **options):
    options = {"lidar": "lidar_360_6m", "stop_coverage": None, "known_starts": False, **options}
    env = lidarium.parallel_env(floor, level=level, robots=len(starts), **options)
    env.reset(seed=1, options={"starts": [list(start) for start in starts]})
    return env


def drive(env, steps, **actions):
    for _ in range(steps):
        env.step({agent: actions.get(agent, IDLE) for agent in env.agents})


def reach(metres, **options):
    return RadioSettings(kind="range", reach=metres, **options)


def is_as_now(env, row, report):
    """Whether a report has what a robot's own map knows now, and where."""
    perception, resolution = env.unwrapped.perception, env.unwrapped.settings.occupancy.resolution
    known = three_levels(np.asarray(perception.own_map(row).log_odds))
    low_x, low_y = np.rint((np.array(report.map.origin) - perception.poses.origin_in_frame(row)) / resolution).astype(
        int
    )
    reported = np.full_like(known, UNKNOWN)
    rows, columns = report.map.levels.shape
    reported[low_y : low_y + rows, low_x : low_x + columns] = report.map.levels
    return np.array_equal(reported, known)


def test_with_the_ideal_radio_the_station_knows_what_is_now():
    env = team([(3.0, 3.0, 0.0), (9.0, 9.0, 1.0)], level="waypoint", battery="kobuki")
    env.step({"robot_0": Target(3.0, 0.0), "robot_1": None})
    report = env.unwrapped.station.report(0)
    assert report.time_s == env.unwrapped.scorer.time == 2.0
    assert (report.state, report.drive, report.target) == (
        OperatingState.OPERATING,
        DriveState.DRIVING,
        Target(3.0, 0.0),
    )
    assert report.path_left_m == pytest.approx(3.0 - report.pose.x, abs=0.05)
    assert report.travelled_m == pytest.approx(report.pose.x, abs=0.01)
    assert report.energy_left_j == env.unwrapped.belief("robot_0").energy_left_j < 127872.0
    assert is_as_now(env, 0, report)
    assert (report.start.x, report.start.y, report.start.theta) == (0.0, 0.0, 0.0)


def test_a_robot_in_reach_reports_once_a_period():
    env = team([(3.0, 3.0, 0.0), (6.0, 3.0, 0.0)], radio=reach(5.0))
    drive(env, 10, robot_0=AHEAD)
    report = env.station.report(0)
    assert report.time_s == 1.0
    assert is_as_now(env, 0, report)
    drive(env, 7, robot_0=AHEAD)
    assert env.station.report(0) is report
    drive(env, 3, robot_0=AHEAD)
    assert env.station.report(0).time_s == 2.0


def test_the_station_stays_where_the_first_robot_started():
    env = team([(3.0, 3.0, 0.0), (3.0, 6.0, 0.0)], radio=reach(4.0))
    # Out of reach of the station and of the other one.
    env.world.poses[0, 0] = 20.0
    drive(env, 10)
    assert [env.station.report(row).time_s for row in (0, 1)] == [0.0, 1.0]


def test_who_never_reaches_the_station_has_no_report():
    env = team([(3.0, 3.0, 0.0), (25.0, 9.0, 0.0)], radio=reach(5.0))
    drive(env, 20)
    assert env.station.report(0) is not None
    assert env.station.report(1) is None
    without = team([(3.0, 3.0, 0.0)], radio="none")
    drive(without, 20)
    assert without.station.report(0) is None


def test_reports_are_passed_on_by_robots_that_hold_copies_one_hop_in_a_period():
    # A chain: the third reaches the second, the second the first and the station.
    env = team([(3.0, 3.0, 0.0), (7.0, 3.0, 0.0), (11.0, 3.0, 0.0)], radio=reach(4.5))
    assert env.station.report(2) is None
    drive(env, 10)
    assert env.station.report(1).time_s == 1.0
    assert env.station.report(2).time_s == 0.0
    drive(env, 10)
    assert env.station.report(2).time_s == 1.0


def test_who_meets_a_robot_far_off_brings_its_report_along():
    env = team([(3.0, 3.0, 0.0), (20.0, 3.0, 0.0), (23.0, 3.0, 0.0)], radio=reach(4.0))
    drive(env, 10)
    assert env.station.report(2) is None
    env.world.poses[1, 0] = 5.0
    drive(env, 10)
    report = env.station.report(2)
    assert report.time_s == 1.0
    assert (report.pose.x, report.state) == (0.0, OperatingState.OPERATING)


def test_walls_stop_reports_where_the_radio_needs_a_line_of_sight():
    radio = RadioSettings(kind="line_of_sight", reach=20.0)
    env = team([(3.0, 3.0, 0.0), (9.0, 3.0, 0.0), (3.0, 6.0, 0.0)], floor=WALLED, radio=radio)
    drive(env, 10)
    assert [env.station.report(row) is None for row in range(3)] == [False, True, False]
    assert env.station.report(2).time_s == 1.0


def test_late_reports_come_late_and_older_ones_are_dropped():
    env = team([(3.0, 3.0, 0.0)], radio=reach(5.0, latency_s=0.4))
    assert env.station.report(0) is None
    drive(env, 4, robot_0=AHEAD)
    assert env.station.report(0).time_s == 0.0
    drive(env, 10, robot_0=AHEAD)
    newest = env.station.report(0)
    assert newest.time_s == 1.0
    exchange = env.perception.exchanges[0]
    late = exchange._part_to_send(0, 1, 0, 0)
    exchange.copied_at[-1, 0] = 10
    for step in (3, 10):
        exchange._receive(type(late)(14, 1, 0, step, None, False, late.blocks, late.cells, None))
    assert env.station.report(0) is newest


def test_lost_reports_are_sent_again_until_one_arrives():
    env = team([(3.0, 3.0, 0.0)], radio=reach(5.0, loss=0.7))
    times = []
    for _ in range(30):
        drive(env, 10)
        report = env.station.report(0)
        times.append(None if report is None else report.time_s)
    arrived = len({time for time in times if time is not None})
    assert 3 <= arrived <= 18


def test_what_is_sent_to_the_station_is_counted_apart():
    env = team([(3.0, 3.0, 0.0)], radio=reach(5.0))
    exchange = env.perception.exchanges[0]
    blocks = (env.beliefs.log_odds[0].reshape(-1, 64) != 0).any(axis=1).sum()
    assert exchange.bytes_reported.tolist() == [HEADER_BYTES + BLOCK_BYTES * blocks + STATUS_BYTES]
    assert exchange.bytes_sent.tolist() == [0]


def test_a_station_changes_nothing_of_what_robots_tell_each_other(monkeypatch):
    def traffic():
        radio = RadioSettings(kind="signal", shadowing=6.0, loss=0.2, latency_s=0.3)
        env = team([(3.0, 3.0, 0.0), (9.0, 3.0, 0.0), (15.0, 6.0, 0.0)], radio=radio)
        drive(env, 40, robot_1=AHEAD)
        exchange = env.perception.exchanges[0]
        return exchange.bytes_sent.tolist(), exchange.heard_at.tolist(), exchange.copied_at[:3].tolist()

    with_station = traffic()
    nobody = property(lambda _exchange: None, lambda _exchange, _tells: None)
    monkeypatch.setattr("lidarium.envs.onboard.radio.exchange.Exchange.report_of", nobody, raising=False)
    assert traffic() == with_station


def test_a_dead_robot_reports_no_more_and_one_that_stopped_says_so():
    fault = Fault(kind="dead_robot", robot=0, at_s=1.5)
    env = team(
        [(3.0, 3.0, 0.0), (5.0, 3.0, 0.0), (5.0, 6.0, 0.0)],
        radio=reach(9.0),
        faults=FaultSettings(schedule=(fault,)),
    )
    drive(env, 20)
    env.stop("robot_1", "tired")
    drive(env, 10)
    assert (env.station.report(0).time_s, env.station.report(0).state) == (1.0, OperatingState.OPERATING)
    assert env.operating.states[0] is OperatingState.FAILED
    assert (env.station.report(1).time_s, env.station.report(1).state) == (3.0, OperatingState.STOPPED)


def test_a_map_that_is_rendered_anew_is_reported_as_it_is_then():
    env = team([(3.0, 3.0, 0.0)], radio=reach(9.0))
    drive(env, 10)
    before = env.station.report(0).map.levels
    env.beliefs.log_odds[0][:] = 0
    env.beliefs.log_odds[0][100:110, 100:110] = 5
    drive(env, 10)
    after = env.station.report(0).map.levels
    assert env.station.report(0).time_s == 2.0
    assert not np.array_equal(after, before)
    assert np.array_equal(env.perception.exchanges[0].copies[-1][0], env.beliefs.log_odds[0])


@pytest.mark.parametrize(("metres", "arrives"), [(9.0, True), (4.5, True), (3.0, False)])
def test_orders_reach_a_robot_while_links_stand_directly_or_from_robot_to_robot(metres, arrives):
    env = team([(3.0, 3.0, 0.0), (7.0, 3.0, 0.0), (11.0, 3.0, 0.0)], radio=reach(metres))
    env.order("robot_2", Order(OrderKind.PAUSE))
    assert (env.operating.states[2] is OperatingState.PAUSED) is arrives
    kinds = [event.kind for event in env.operating.events[0]]
    assert kinds == (["order", "state"] if arrives else ["lost"])


def test_a_lost_order_leaves_a_robot_at_what_it_did():
    env = team([(3.0, 3.0, 0.0), (20.0, 3.0, 0.0)], level="waypoint", radio=reach(3.0))
    env.step({"robot_0": None, "robot_1": Target(3.0, 0.0)})
    env.order("robot_1", Order(OrderKind.GO_TO, Target(-3.0, 0.0)))
    for _ in range(5):
        env.step({"robot_0": None})
    assert np.allclose(env.unwrapped.world.poses[1, :2], [23.0, 3.0], atol=0.1)


def test_a_link_to_a_place_is_as_one_to_a_robot_there():
    generator = np.random.default_rng(4)
    solid = team([(3.0, 3.0, 0.0)], floor=WALLED).world.floors[0].laser
    places = generator.uniform(0.5, 11.5, (12, 2))
    for kind in ("all", "none", "range", "line_of_sight", "signal"):
        radio = RadioSettings(kind=kind, reach=5.0)
        assert np.array_equal(links_to(radio, places[1:], places[0], solid), links(radio, places, solid)[0, 1:])


def test_a_decentralised_policy_has_no_station():
    class Asks(Policy):
        level, shares_map = "velocity", False

        def reset(self, team, seed):
            self.team = team

        def act(self, observations):
            assert self.team.operating_state(self.team.agents[0]) is OperatingState.OPERATING
            return {agent: self.team.report(agent) for agent in observations}

    with pytest.raises(ValueError, match="asked for the report of robot_0; a decentralised policy has no station"):
        run_episode(PerRobot(Asks), team([(3.0, 3.0, 0.0)]), seed=0)
