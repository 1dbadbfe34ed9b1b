"""Levels of decision: the actions of robots, and their conversion to motion."""

from collections.abc import Callable
from typing import TypeVar

from lidarium.envs.levels.level import Level
from lidarium.registry import Registry

LEVELS: Registry[type[Level]] = Registry("level")
"""The action levels by name."""

LEVELS.register("velocity", "lidarium.envs.levels.velocity:VelocityLevel", "speed and turn rate, for a step")
LEVELS.register("waypoint", "lidarium.envs.levels.waypoint:WaypointLevel", "a point to drive to")
LEVELS.register("frontier", "lidarium.envs.levels.frontier:FrontierLevel", "one of the frontiers in reach")
LEVELS.register("graph", "lidarium.envs.levels.graph:GraphLevel", "one of the nodes of a graph, seeing at nodes only")
LEVELS.register("tour", "lidarium.agents.tours.level:TourLevel", "one of the stops of tours past all frontiers")

L = TypeVar("L", bound=type[Level])


def level(name: str, summary: str = "") -> Callable[[L], L]:
    """Register an action level, a subclass of `Level`; environments then take its name.

    Parameters
    ----------
    name : str
        The name of the level.
    summary : str, optional
        One line that describes an action; the first line of the docstring by default.

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium
    >>> @lidarium.level("half_speed", "at most half of the maximum speed")
    ... class HalfSpeed(lidarium.VelocityLevel):
    ...     def read_rows(self, actions, live):
    ...         return super().read_rows(0.5 * actions, live)
    """

    def register(kind: L) -> L:
        LEVELS.register(name, kind, summary or (kind.__doc__ or name).strip().splitlines()[0])
        return kind

    return register
