"""What is known of a robot becomes a case, which the tree decides."""

import pytest
from looked_reports import EAST, WEST, looked, rules
from reported_halls import RADIUS, RESOLUTION, hall, report

from lidarium.agents.supervisor.knowledge.station import MergeStation
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.supervisor import Supervisor
from lidarium.envs.onboard.driving.path_planner import footprint_of
from lidarium.envs.onboard.radio.messages import OrderKind
from lidarium.mapping.merging.growing_maps import GrowingMap


def test_a_robot_that_knows_much_less_is_sent_where_there_is_more_to_map():
    levels, small = hall(openings=(WEST, EAST)), hall(1.5, 4.0, openings=(WEST,))
    supervisor, commands = looked({"a": report(levels, 6.5, 2.0, (7.7, 2.0)), "b": report(small, 0.8, 1.0)})
    assert rules(supervisor)["b"] == (4, "go_to")
    assert commands["b"].target.x < 1.0
    shares = {decision.agent: decision.inputs.map_known for decision in supervisor.decisions}
    assert shares["b"] < 0.5 * shares["a"]


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


@pytest.mark.parametrize(("left", "rule"), [(900.0, 0), (105.0, 9)])
def test_a_robot_turns_back_before_its_battery_is_too_low_to_bring_it_home(left, rule):
    levels = hall(openings=(EAST,))
    settings = SupervisorSettings(trusts_starts=True, battery_margin=1.5)
    station = MergeStation(["a"], RESOLUTION, RADIUS, settings)
    supervisor = Supervisor(station, footprint_of(RADIUS))
    for time_s, way, energy in ((10.0, 0.5, 1000.0), (20.0, 50.0, left)):
        station.receive(
            "a",
            report(levels, 6.5, 2.0, (7.7, 2.0), travelled_m=way, energy_left_j=energy, time_s=time_s),
            time_s,
        )
        station.merge(time_s)
        supervisor.decide(time_s, {})
    assert supervisor.decisions[-1].rule == rule
