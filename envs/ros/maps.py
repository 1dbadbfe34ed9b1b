"""Publishes the maps of driven robots, own and merged ones, and the transforms between their frames."""

import time
from collections.abc import Callable

import numpy as np

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.station.reports import known_map
from lidarium.envs.ros.graph import Graph
from lidarium.envs.ros.world import RosWorld
from lidarium.mapping.files.bags.messages import GRID
from lidarium.mapping.geometry.rigid import Transform, composed, relative
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.joining import placed

MERGED_MAP = "/merged_map"

MAP_PERIOD_S = 2.0
"""Wall time between maps [s]."""

Merged = tuple[dict[str, Transform], FusedMap]
"""Frames of the maps of robots in that of the first, by name, and the map of all."""


class MapPublisher:
    """Publishes maps while robots are driven.

    Parameters
    ----------
    env : ExplorationEnv
        The environment of the robots.
    world : RosWorld
        Its world.
    graph : Graph
        The node.
    merged : callable
        Returns the largest merged map of a station, None if there is none.
    """

    def __init__(self, env: ExplorationEnv, world: RosWorld, graph: Graph, merged: Callable[[], Merged | None]) -> None:
        self._env, self._world, self._graph, self._merged = env, world, graph, merged
        self._next_s = 0.0

    def publish(self, *, is_last: bool = False) -> None:
        """Publish the poses of robots with their own maps and, if they are due, all maps."""
        env, world, graph = self._env, self._world, self._graph
        own = not env.settings.known_starts
        for row, link in enumerate(world.links if own else []):
            origin = composed(env.beliefs.believed[row], relative(world.odometry_of(row), np.zeros(3)))
            names = link.names
            graph.transform(names.own_map_frame, link.odom_frame, link.stamp_s, origin, topic=names.transforms)
        if not is_last and time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + MAP_PERIOD_S
        resolution, stamp = env.settings.occupancy.resolution, max(link.stamp_s for link in world.links)
        maps = [known_map(env.perception, row) for row in range(env.settings.robots)]
        if not own:
            corners = env.perception.poses.offsets.tolist()
            places = [placed((x + one.origin[0], y + one.origin[1])) for (x, y), one in zip(corners, maps, strict=True)]
            self._draw(MERGED_MAP, world.map_frame(0), stamp, fuse([one.levels for one in maps], places, resolution))
            return
        for link, one in zip(world.links, maps, strict=True):
            if one.levels.size:
                graph.grid(link.names.map, link.names.own_map_frame, stamp, one.levels, one.origin, resolution)
        merged = self._merged()
        if merged is not None:
            frames, fused = merged
            first, *others = frames
            for name in others:
                lies = frames[name]
                graph.transform(self._frame(first), self._frame(name), stamp, (lies.x, lies.y, lies.theta))
            self._draw(MERGED_MAP, self._frame(first), stamp, fused)

    def _frame(self, agent: str) -> str:
        return self._world.map_frame(self._env.possible_agents.index(agent))

    def _draw(self, topic: str, frame: str, stamp: float, fused: FusedMap) -> None:
        self._graph.advertise(topic, GRID)
        self._graph.grid(topic, frame, stamp, fused.levels, fused.origin, fused.resolution)
