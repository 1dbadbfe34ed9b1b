"""Results of reports made by hand: goals, rivals, robots that know little, failed and silent ones,
and batteries."""

import numpy as np
import pytest
from looked_reports import EAST, NORTH, WEST, looked, rules
from reported_halls import RADIUS, RESOLUTION, hall, report

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.station import MergeStation
from lidarium.agents.supervisor.supervisor import Supervisor
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.radio.messages import OperatingState, OrderKind
from lidarium.mapping.merging.incremental import GrowingMap


def test_of_two_robots_with_one_goal_the_farther_one_is_sent_to_the_other_opening():
    levels = hall(openings=(WEST, EAST))
    supervisor, commands = looked(
        {"a": report(levels, 6.5, 2.0, (7.7, 2.0)), "b": report(levels, 5.0, 2.0, (7.7, 2.1))}
    )
    assert rules(supervisor) == {"a": (3, None), "b": (3, "go_to")}
    target = commands["b"].target
    assert np.hypot(target.x, target.y - 2.0) < 0.7
    assert commands["b"].observes[0] < 0.1


def test_where_there_is_no_other_goal_the_farther_one_stands_by_and_goes_on_when_there_is_one():
    levels = hall(openings=(EAST,))
    near, far = report(levels, 6.5, 2.0, (7.7, 2.0)), report(levels, 5.0, 2.0, (7.7, 2.1))
    supervisor, commands = looked({"a": near, "b": far})
    assert commands["b"].kind is OrderKind.STOP
    assert supervisor.standing_by == {"b"}
    more = hall(openings=(EAST, WEST))
    for agent, x, target in (("a", 7.0, (7.7, 2.0)), ("b", 5.0, None)):
        supervisor.station.receive(agent, report(more, x, 2.0, target, time_s=20.0), 20.0)
    supervisor.station.merge(20.0)
    (command,) = supervisor.decide(20.0, {})
    assert (command.agent, command.kind, command.rule) == ("b", OrderKind.GO_TO, 3)
    assert supervisor.standing_by == set()


def test_robots_with_goals_of_their_own_go_on():
    levels = hall(openings=(WEST, EAST))
    supervisor, commands = looked(
        {"a": report(levels, 6.5, 2.0, (7.7, 2.0)), "b": report(levels, 2.0, 2.0, (0.3, 2.0))}
    )
    assert commands == {}
    assert rules(supervisor) == {"a": (0, None), "b": (0, None)}


def test_where_no_frontier_is_left_all_stop_and_what_was_given_up_is_none():
    whole = hall()
    supervisor, commands = looked({"a": report(whole, 6.5, 2.0), "b": report(whole, 2.0, 2.0)})
    assert {command.kind for command in commands.values()} == {OrderKind.STOP}
    assert rules(supervisor) == {"a": (5, "stop"), "b": (5, "stop")}
    open_hall = hall(openings=(EAST,))
    frontier = np.array([[7.98, 1.55 + 0.05 * k] for k in range(19)])
    supervisor, _ = looked({"a": report(open_hall, 6.5, 2.0)}, given_up={"a": frontier})
    assert rules(supervisor) == {"a": (5, "stop")}


def test_failed_robots_are_left_out_with_their_maps_and_paused_ones_keep_theirs_in_without_orders():
    west, east = hall(3.0, openings=(WEST,)), hall(openings=(EAST,))
    failed = report(west, 2.0, 2.0, state=OperatingState.FAILED)
    supervisor, commands = looked({"a": report(east, 6.0, 2.0, (7.7, 2.0)), "b": failed})
    assert rules(supervisor) == {"b": (1, None), "a": (0, None)}
    assert supervisor.station.groups() == [["a"]]
    assert [event.event for event in supervisor.station.events] == ["excluded"]
    paused = report(west, 2.0, 2.0, state=OperatingState.PAUSED)
    supervisor, commands = looked({"a": report(east, 6.0, 2.0, (7.7, 2.0)), "b": paused})
    assert rules(supervisor)["b"] == (2, None)
    assert supervisor.station.groups() == [["a", "b"]]
    assert commands == {}


def test_when_all_have_failed_nothing_is_left_to_order():
    levels = hall(openings=(EAST,))
    supervisor, commands = looked({name: report(levels, 2.0, 2.0, state=OperatingState.FAILED) for name in "ab"})
    assert commands == {}
    assert rules(supervisor) == {"a": (1, None), "b": (1, None)}
    assert supervisor.station.fused(["a", "b"], "a") is None


def test_a_robot_that_never_reports_is_noted_once_and_gets_no_orders():
    supervisor, commands = looked({"a": report(hall(openings=(EAST,)), 6.0, 2.0, (7.7, 2.0))}, agents=["a", "b"])
    supervisor.decide(20.0, {})
    assert commands == {}
    assert [(event.event, event.agents) for event in supervisor.station.events] == [("silent", ("b",))]


def test_reports_out_of_order_are_dropped_and_noted():
    station = MergeStation(["a"], RESOLUTION, RADIUS, SupervisorSettings())
    newer, older = report(hall(), 2.0, 2.0, time_s=20.0), report(hall(), 1.0, 2.0, time_s=10.0)
    station.receive("a", newer, 20.0)
    station.receive("a", older, 21.0)
    station.receive("a", None, 22.0)
    assert station.reports["a"] is newer
    assert [event.event for event in station.events] == ["late"]


def test_maps_that_know_nothing_are_no_maps():
    blank = GrowingMap(np.full((20, 20), 127, np.uint8))
    empty = GrowingMap(np.zeros((0, 0), np.uint8))
    for nothing in (blank, empty):
        supervisor, commands = looked({"a": report(nothing, 0.5, 0.5), "b": report(hall(openings=(EAST,)), 6.0, 2.0)})
        assert supervisor.station.groups() == [["b"]]
        assert "a" not in commands


@pytest.mark.parametrize("assignment", ["hungarian", "utility"])
def test_all_robots_get_goals_of_their_own_at_once_where_that_is_asked_for(assignment):
    levels = hall(openings=(WEST, EAST, NORTH))
    places = {"a": (6.0, 1.0), "b": (4.0, 2.0), "c": (2.0, 1.0)}
    supervisor, commands = looked(
        {name: report(levels, *place) for name, place in places.items()}, assignment=assignment
    )
    targets = [(command.target.x, command.target.y) for command in commands.values()]
    assert {decision.rule for decision in supervisor.decisions} == {6}
    assert len(targets) == 3
    assert min(np.hypot(a[0] - b[0], a[1] - b[1]) for k, a in enumerate(targets) for b in targets[:k]) > 1.0


def test_when_the_work_is_done_robots_drive_home_where_that_is_asked_for():
    supervisor, commands = looked({"a": report(hall(), 6.5, 2.0)}, returns_home=True)
    assert rules(supervisor) == {"a": (8, "go_to")}
    assert commands["a"].is_home
    assert (commands["a"].target.x, commands["a"].target.y) == (1.0, 2.0)


def test_a_robot_that_knows_much_less_is_sent_where_there_is_more_to_map():
    levels, small = hall(openings=(WEST, EAST)), hall(1.5, 4.0, openings=(WEST,))
    supervisor, commands = looked({"a": report(levels, 6.5, 2.0, (7.7, 2.0)), "b": report(small, 0.8, 1.0)})
    assert rules(supervisor)["b"] == (4, "go_to")
    assert commands["b"].target.x < 1.0
    shares = {decision.agent: decision.inputs.map_known for decision in supervisor.decisions}
    assert shares["b"] < 0.5 * shares["a"]


def test_of_a_complete_map_all_is_known_and_less_while_frontiers_are_left():
    def shares(levels, other):
        supervisor, _ = looked({"a": report(levels, 6.5, 2.0), "b": report(other, 2.0, 2.0)})
        return {decision.agent: decision.inputs.map_known for decision in supervisor.decisions}

    whole, half = hall(), hall(4.0)
    assert shares(whole, whole) == {"a": 1.0, "b": 1.0}
    assert shares(whole, half)["b"] == pytest.approx(0.5)
    # 1 m of frontier in the wall: a square of 5.6 m around it, of which the half outside and slivers are unknown.
    assert 0.5 < shares(hall(openings=(EAST,)), half)["a"] < 0.9


def test_a_robot_that_drives_far_and_maps_little_within_walls_is_stopped():
    cell = hall(1.5, 1.5)
    settings = SupervisorSettings(trusts_starts=True)
    station = MergeStation(["a", "b"], RESOLUTION, RADIUS, settings)
    big = GrowingMap(hall(openings=(EAST,)).levels, (3.0, 0.0))
    for step in range(13):
        station.receive("b", report(cell, 0.7, 0.7, travelled_m=float(step), time_s=float(step)), float(step))
    station.receive("a", report(big, 8.0, 2.0, (10.7, 2.0), time_s=12.0), 12.0)
    station.merge(12.0)
    supervisor = Supervisor(station, footprint_of(RADIUS))
    (command,) = supervisor.decide(12.0, {})
    assert (command.agent, command.kind, command.rule) == ("b", OrderKind.STOP, 4)


def test_robots_that_are_about_to_meet_are_separated_where_that_is_asked_for():
    levels = hall(openings=((7.95, 1.0), (7.95, 3.0), WEST))
    team = {"a": report(levels, 6.5, 1.0, (7.6, 1.0)), "b": report(levels, 4.0, 3.9 - 0.9, (7.6, 3.0))}
    assert looked(team)[1] == {}
    supervisor, commands = looked(team, avoids_rendezvous=True)
    assert rules(supervisor) == {"a": (0, None), "b": (7, "go_to")}
    assert commands["b"].target.x < 1.0


@pytest.mark.parametrize(("first_way", "left", "rule"), [(0.5, 900.0, 0), (0.5, 105.0, 9), (30.0, 240.0, 9)])
def test_a_robot_turns_back_before_its_battery_is_too_low_to_bring_it_home(first_way, left, rule):
    """Its first report may come late: the cost of a metre is that since then."""
    levels = hall(openings=(EAST,))
    settings = SupervisorSettings(trusts_starts=True, battery_margin=1.5)
    station = MergeStation(["a"], RESOLUTION, RADIUS, settings)
    supervisor = Supervisor(station, footprint_of(RADIUS))
    for time_s, way, energy in ((10.0, first_way, 1000.0), (20.0, 50.0, left)):
        station.receive(
            "a",
            report(levels, 6.5, 2.0, (7.7, 2.0), travelled_m=way, energy_left_j=energy, time_s=time_s),
            time_s,
        )
        station.merge(time_s)
        supervisor.decide(time_s, {})
    assert supervisor.decisions[-1].rule == rule
