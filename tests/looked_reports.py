"""A station's supervisor after one look at reports made by hand."""

from reported_halls import RADIUS, RESOLUTION

from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.agents.supervisor.station import MergeStation
from lidarium.agents.supervisor.supervisor import Supervisor
from lidarium.envs.onboard.driving.path_planner import footprint_of

WEST, EAST, NORTH = (0.0, 2.0), (7.95, 2.0), (4.0, 3.95)
"""Openings of the hall [m]."""


def looked(reports, time_s=10.0, given_up=None, agents=None, **settings):
    """The supervisor after one look at reports of robots whose frames are known, and its commands by
    robot."""
    chosen = SupervisorSettings(trusts_starts=True, **settings)
    station = MergeStation(agents or list(reports), RESOLUTION, RADIUS, chosen)
    for agent, one in reports.items():
        station.receive(agent, one, time_s)
    station.merge(time_s)
    supervisor = Supervisor(station, footprint_of(RADIUS))
    return supervisor, {command.agent: command for command in supervisor.decide(time_s, given_up or {})}


def rules(supervisor):
    return {decision.agent: (decision.rule, decision.order) for decision in supervisor.decisions}
