"""Decisions by nodes: robots move along the edges of a graph and see at its nodes only.

So do the robots of ARiADNE (Cao et al., ICRA 2023) and DARE (Cao et al., ICRA 2025), beside which policies can be
evaluated thus.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.levels.level import STEPS, Level, Mask, Turn, add_info, check_rows
from lidarium.envs.levels.node_graph import NodeGraph, add_edges, frontiers_of, in_sight, pairs_of, thinned, ways_along
from lidarium.envs.levels.waypoint import Ways, give_ways, is_way, read_ways
from lidarium.envs.onboard.driving.drives import DRIVE_STATES
from lidarium.envs.onboard.driving.path_following import ARRIVED, DRIVING, IDLE, MAX_POINTS
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.settings.exploration import TRUE_POSE, ExplorationSettings
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.grids.grid_lines import line_is_free

FARTHEST = 1e6
"""Bound of what is observed of a node [m]."""

ON_NODE = 1e-6
"""A robot this near to a point of the lattice is there [m]."""


class _Lattice(NamedTuple):
    """The points of a lattice on a map, and their state.

    Attributes
    ----------
    positions : (L, 2) float64
        x, y in the frame of the believed poses [m].
    cells : (L, 2) int64
        Their cells (row, column).
    is_node, is_spent : (L,) bool
        Whether they are known to be free, and whether a robot came there or hardly a frontier was in sight before.
    lacks_edges : (L,) bool
        Nodes from which edges are looked for when a robot is near.
    seen : list of (C,) int64
        Frontier cells that were in sight of each node and are still frontiers, as indices of the flat map.
    edges : (L, side, side) bool
        Edges to neighbours, see `add_edges`.
    columns : int
        Points along x.
    corner : (row, column) float64
        The point where the first robot started, in cells.
    """

    positions: NDArray[np.float64]
    cells: NDArray[np.int64]
    is_node: NDArray[np.bool_]
    is_spent: NDArray[np.bool_]
    lacks_edges: NDArray[np.bool_]
    seen: list[NDArray[np.int64]]
    edges: NDArray[np.bool_]
    columns: int
    corner: NDArray[np.float64]


class GraphLevel(Level):
    """An action is the number of a node, or a ``Target``, a ``Route`` or None as at the level of waypoints.

    Nodes are the points of a lattice around the place where the first robot starts, as far as they are known to be
    free; edges are lines through known free space. A decision moves a robot along the first edge of its way to the
    node, and it takes one scan at the end: it sees nothing on its way. The time of a decision is that of the longest
    of these edges at cruise speed.

    Observations have ``nodes`` float32 (K, 4): position along the axes of the map frame from the believed position of
    the robot [m], length of the way along the graph [m] and utility, the number of frontiers in sight, of each node
    in reach, shortest way first, zeros after the last; and ``action_mask`` int8 (K + 1,). K is
    ``settings.graph.offers``. Action k < K moves towards node k, action K stays, as does one that the mask rules out.

    A ``Target`` stands for the nearest node with utility, of those in sight of it if there are any; the robot has
    arrived when it is there. If no robot of a team has a node with utility in reach, all end with ``no_frontier``.
    Robots know their true poses in the kinematic world: they do not drive, and their wheels measure nothing.
    """

    takes_none = True
    carries = frozenset({"waypoint"})
    driver: TeamDriver
    passed_over: NDArray[np.int64]

    def __init__(
        self,
        perception: Perception,
        settings: ExplorationSettings,
        shares_map: bool = True,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(perception, settings, shares_map, decision_period_s)
        if settings.localization != TRUE_POSE or type(perception.world) is not KinematicWorld:
            raise ValueError(
                f"robots of the level 'graph' do not drive, and localization is {settings.localization!r} in the "
                f"world {settings.backend!r}; want localization={TRUE_POSE!r} and backend='kinematic'"
            )
        self._shares = shares_map and settings.known_starts and settings.radio.is_ideal
        self._stay = settings.graph.offers
        self.action_space = spaces.Discrete(self._stay + 1)
        self.driver = TeamDriver(perception, settings, shares_map)
        self.drives, self.following = self.driver.drives, self.driver.following
        self.boxes["nodes"] = spaces.Box(-FARTHEST, FARTHEST, (self._stay, 4), np.float32)
        self.boxes["action_mask"] = spaces.Box(0, 1, (self._stay + 1,), np.int8)
        self._lattices: dict[int, _Lattice] = {}
        self._graphs: dict[int, NodeGraph] = {}
        self._offered: dict[int, NDArray[np.int64]] = {}
        self.period_s = settings.decision_period_s if decision_period_s is None else decision_period_s
        self._wait = max(round(self.period_s / settings.time_step), 1)
        self.passed_over = np.zeros(perception.world.episodes, np.int64)

    def start(self, episode: int) -> None:
        """Begin an episode: no node is known."""
        self.driver.start(episode)
        for row in self._rows_of(episode):
            for kept in (self._lattices, self._graphs, self._offered):
                kept.pop(row, None)

    def _rows_of(self, episode: int) -> range:
        return range(episode * self.settings.robots, (episode + 1) * self.settings.robots)

    def read(self, actions: Mapping[int, Any], names: list[str]) -> Ways:
        """Return the targets of rows; a node is a target of its own."""
        ways: dict[int, Any] = {}
        for row, action in actions.items():
            ways[row] = action
            if is_way(action):
                continue
            number = np.asarray(action)
            if number.shape not in ((), (1,)) or number.dtype.kind not in "iu" or not 0 <= int(number) <= self._stay:
                raise ValueError(
                    f"action of {names[row % len(names)]} is {shown(action)}; want a node from 0 to "
                    f"{self._stay - 1}, or {self._stay} to stay"
                )
            ways[row] = self._target(row, int(number))
        return read_ways(ways, self.rows)

    def read_rows(self, actions: Any, live: Mask) -> Ways:  # noqa: ANN401
        """Return the targets of all rows; an array of objects may hold ``Target``, ``Route`` and None."""
        rows = np.flatnonzero(live).tolist()
        if isinstance(actions, np.ndarray) and actions.dtype == object and actions.shape[:1] == (self.rows,):
            return self.read({row: actions[row] for row in rows}, [f"row {row}" for row in range(self.rows)])
        wanted = f"a whole number from 0 to {self._stay}"
        numbers = check_rows(actions, (self.rows,), live, wanted)
        is_bad = live & ((numbers < 0) | (numbers > self._stay) | (numbers != np.floor(numbers)))
        if is_bad.any():
            bad = int(np.flatnonzero(is_bad)[0])
            raise ValueError(f"the action of row {bad} is {numbers[bad]}; want {wanted}, {self._stay} to stay")
        return read_ways({row: self._target(row, int(numbers[row])) for row in rows}, self.rows)

    def _target(self, row: int, number: int) -> Target | None:
        """Return the place of a node on offer, None if there is no such node."""
        offered = self._offered.get(row)
        if offered is None or number >= len(offered):
            return None
        x, y = self._graphs[row].positions[offered[number]] - self.perception.offsets[row]
        return Target(float(x), float(y))

    def carry_out(self, decoded: Ways, turn: Turn) -> None:
        """Put robots on the next nodes of their ways; end teams for which no node has utility."""
        give_ways(self.driver, decoded, turn)
        self.passed_over[:] = 0
        for episode in np.flatnonzero(turn.modes == STEPS).tolist():
            rows = self._rows_of(episode)
            turn.commands[rows] = 0.0
            moving = [row for row in rows if turn.acting[row]]
            graphs = {row: self._graphs.get(row) or self._graph(row) for row in moving}
            if not any((graph.utilities[np.isfinite(graph.lengths)] > 0).any() for graph in graphs.values()):
                turn.operating.stopping.update(
                    {row: "no_frontier" for row in moving if row not in turn.operating.stopping}
                )
            if not any(row in turn.operating.stopping for row in moving):
                self._move(episode, {row: graph for row, graph in graphs.items() if not turn.operating.held[row]})

    def _move(self, episode: int, graphs: Mapping[int, NodeGraph]) -> None:
        """Move the robots of a team to neighbouring nodes; two are never on one."""
        ways = {row: self._way(row, graph) for row, graph in graphs.items()}
        places = {row: self.perception.beliefs.believed[row, :2].copy() for row in self._rows_of(episode)}
        ends = {row: graphs[row].positions[way[0]] for row, way in ways.items() if way}
        while clashing := [row for row in ends if _is_taken(row, places, ends)]:
            del ends[clashing[-1]]
        longest = max((math.dist(end, places[row]) for row, end in ends.items()), default=0.0)
        step = self.settings.time_step * self.settings.robot.cruise_speed
        steps = max(math.ceil(longest / step - 1e-9), 1) if ends else self._wait
        taken, horizon = self.perception.world.steps, self.settings.horizon_steps
        # Robots wait for the next scan: their nodes follow from it.
        steps += int(-(taken[episode] + steps) % self.settings.scan_steps)
        if horizon is not None and taken[episode] + steps > horizon:  # nobody arrives before the episode is cut
            ends, steps = {}, horizon - int(taken[episode])
        for row, end in ends.items():
            self._put(row, end)
            self.drives.states[row] = ARRIVED if len(ways[row]) == 1 else DRIVING
        # The step that follows is counted by itself.
        taken[episode] += steps - 1
        self.passed_over[episode] = steps - 1

    def _way(self, row: int, graph: NodeGraph) -> list[int]:
        """Return the nodes on a robot's way to the one that its target stands for, and note it as its path."""
        drives = self.drives
        if not drives.is_ordered[row]:
            return []
        target = drives.targets[row] + self.perception.offsets[row]
        goal = self._goal(row, graph, target)
        way = [] if goal is None else graph.way_to(goal)
        drives.has_path[row] = goal is not None
        points = graph.positions[[graph.here, *way][:MAX_POINTS]]
        count = len(points) if goal is not None else 0
        drives.paths[row, :count], drives.room[row, :count] = points[:count], 0.0
        drives.counts[row], drives.places[row], drives.headings[row] = count, min(1, max(count - 1, 0)), np.nan
        drives.states[row] = IDLE if goal is None else (DRIVING if way else ARRIVED)
        return way

    def _goal(self, row: int, graph: NodeGraph, target: NDArray[np.float64]) -> int | None:
        """Return the node that a target stands for: itself, or the nearest one with utility."""
        gaps = np.hypot(*(graph.positions - target).T)
        is_reached = np.isfinite(graph.lengths)
        gaps[~is_reached] = np.inf
        nearest = int(np.argmin(gaps))
        if gaps[nearest] <= ON_NODE:
            return nearest
        useful = np.flatnonzero(is_reached & (graph.utilities > 0))
        if not len(useful):
            return None
        log_odds = self._map(row).log_odds
        ends = self._cells(row, np.vstack([graph.positions[useful], target]))
        ends = np.clip(ends, 0, np.array(log_odds.shape) - 1)
        end = ends[-1]
        is_hidden = np.array([not line_is_free(log_odds, end[0], end[1], cell[0], cell[1]) for cell in ends[:-1]])
        return int(useful[np.lexsort((graph.lengths[useful], gaps[useful], is_hidden))[0]])

    def _put(self, row: int, end: NDArray[np.float64]) -> None:
        """Put a robot at a position in the frame of its believed pose."""
        world = self.perception.world
        gap = end - self.perception.beliefs.believed[row, :2]
        length = math.hypot(gap[0], gap[1])
        if not self.settings.known_starts:
            turn = float(world.starts[row, 2])
            cosine, sine = math.cos(turn), math.sin(turn)
            gap = np.array([cosine * gap[0] - sine * gap[1], sine * gap[0] + cosine * gap[1]])
        world.poses[row, :2] += gap
        world.poses[row, 2] = math.atan2(gap[1], gap[0])
        world.velocities[row] = 0.0
        world.travelled[row] += length

    def observe(self, acted: Mask, live: Mask, seen: Mask, out: dict[str, NDArray[Any]], infos: dict[str, Any]) -> None:
        """Write the nodes in reach, and report the states of the robots' drives."""
        for row in np.flatnonzero(seen).tolist():
            nodes, mask = out["nodes"][row], out["action_mask"][row]
            nodes[:], mask[:], mask[self._stay] = 0.0, 0, 1
            self._graphs.pop(row, None)
            self._offered.pop(row, None)
            if not live[row]:
                continue
            graph = self._graphs[row] = self._graph(row)
            order = np.argsort(graph.lengths, kind="stable")
            offered = self._offered[row] = order[np.isfinite(graph.lengths[order])][1 : self._stay + 1]
            count = len(offered)
            nodes[:count, :2] = graph.positions[offered] - graph.positions[graph.here]
            nodes[:count, 2], nodes[:count, 3] = graph.lengths[offered], graph.utilities[offered]
            mask[:count] = 1
        if acted.any():
            states = self.driver.states()[acted].tolist()
            add_info(infos, "drive", acted, [DRIVE_STATES[state] for state in states])

    def _map(self, row: int) -> NavigationMap:
        return self.perception.planning_map(row, self.driver.shares_map)

    def _cells(self, row: int, positions: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells (row, column) of positions (N, 2) in the frame of the believed pose."""
        gaps = (positions - self.perception.beliefs.origins[row]) / self.settings.occupancy.resolution
        return np.asarray(np.floor(gaps[:, ::-1] + 1e-9), np.int64)

    def _lattice(self, row: int) -> _Lattice:
        """Return the lattice of a robot, which is that of its team if they share one map."""
        key = row - row % self.settings.robots if self._shares else row
        if key not in self._lattices:
            spacing, resolution = self.settings.graph.spacing, self.settings.occupancy.resolution
            start = self.perception.beliefs.believed[key, :2]
            low = np.asarray(self.perception.beliefs.origins[key])
            size = np.array(self._map(row).log_odds.shape[::-1]) * resolution
            firsts, lasts = np.ceil((low - start) / spacing), np.floor((low + size - 1e-6 - start) / spacing)
            across, up = (np.arange(first, last + 1.0) for first, last in zip(firsts, lasts, strict=True))
            steps = np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2)
            positions = start + steps * spacing
            corner = np.floor((start - low)[::-1] / resolution + 1e-9)
            side = 2 * self.settings.graph.neighbours + 1
            self._lattices[key] = _Lattice(
                positions,
                self._cells(row, positions),
                np.zeros(len(steps), np.bool_),
                np.zeros(len(steps), np.bool_),
                np.zeros(len(steps), np.bool_),
                [np.zeros(0, np.int64)] * len(steps),
                np.zeros((len(steps), side, side), np.bool_),
                len(across),
                corner,
            )
        return self._lattices[key]

    def _graph(self, row: int) -> NodeGraph:
        """Return the graph on a robot's map.

        A node counts a frontier cell from when it was visible, and chosen for its square, until it is no frontier any
        more. Nodes with few frontiers, and nodes that a robot has visited, have no utility from then on. Edges are
        searched from nodes near the robot, until these have no utility; edges are never removed.
        """
        graph = self.settings.graph
        navigation, lattice = self._map(row), self._lattice(row)
        log_odds, place = navigation.log_odds, self.perception.beliefs.believed[row, :2]
        passable = _passable(navigation, self.settings.robot.radius)
        gaps = np.hypot(*(lattice.positions - place).T)
        here = int(np.argmin(gaps))
        is_on_lattice = bool(gaps[here] <= ON_NODE)
        is_free = passable[lattice.cells[:, 0], lattice.cells[:, 1]] < 0
        is_free[here] |= is_on_lattice
        is_new = is_free & ~lattice.is_node
        lattice.is_node[is_new] = lattice.lacks_edges[is_new] = True
        if is_on_lattice and not is_new[here]:
            lattice.is_spent[here], lattice.lacks_edges[here] = True, False
        reach = self.settings.lidar.range_max
        is_counted = is_new | lattice.is_node & ~lattice.is_spent & (gaps <= 2.0 * reach)
        self._count(lattice, np.flatnonzero(is_counted), log_odds)
        utilities = np.array([len(cells) for cells in lattice.seen], np.int64)
        utilities[lattice.is_spent] = 0
        is_searching = lattice.is_node & lattice.lacks_edges & (gaps < reach + graph.spacing)
        add_edges(
            passable, lattice.cells, lattice.columns, lattice.is_node, np.flatnonzero(is_searching), lattice.edges
        )
        lattice.lacks_edges[is_searching & (utilities == 0)] = False
        positions, edges = lattice.positions, pairs_of(lattice.edges, lattice.columns)
        if not is_on_lattice:  # a robot that has started beside the lattice
            here = len(positions)
            positions, utilities = np.vstack([positions, place]), np.append(utilities, 0)
            edges = np.vstack([edges, self._edges_beside(row, place, passable, lattice)])
        return NodeGraph(positions, utilities, here, *ways_along(positions, edges, here))

    def _count(self, lattice: _Lattice, nodes: NDArray[np.int64], log_odds: NDArray[np.int8]) -> None:
        """Bring the frontier cells that some nodes have seen up to date."""
        graph, resolution = self.settings.graph, self.settings.occupancy.resolution
        is_frontier = frontiers_of(log_odds)
        frontiers = thinned(np.argwhere(is_frontier), lattice.corner, graph.frontier_spacing / resolution)
        numbers = frontiers[:, 0] * log_odds.shape[1] + frontiers[:, 1]
        reach = graph.utility_share * self.settings.lidar.range_max / resolution
        for node, sees in zip(nodes, in_sight(log_odds, lattice.cells[nodes], frontiers, reach), strict=True):
            before = lattice.seen[node]
            now = np.union1d(before[is_frontier.ravel()[before]], numbers[sees])
            lattice.seen[node] = now
            lattice.is_spent[node] = len(now) <= graph.least_utility

    def _edges_beside(
        self, row: int, place: NDArray[np.float64], passable: NDArray[np.int8], lattice: _Lattice
    ) -> NDArray[np.int64]:
        """Return the edges (E, 2) from a place beside the lattice, which comes after its points."""
        (start,) = self._cells(row, place[None])
        reach = self.settings.graph.neighbours * self.settings.graph.spacing
        near = np.flatnonzero(lattice.is_node & (np.abs(lattice.positions - place).max(axis=1) <= reach))
        is_free = [line_is_free(passable, start[0], start[1], *lattice.cells[node]) for node in near]
        ends = near[np.array(is_free, np.bool_)]
        return np.stack([ends, np.full(len(ends), len(lattice.positions))], axis=1)


def _passable(navigation: NavigationMap, radius: float) -> NDArray[np.int8]:
    """Return a grid that is negative where a body may be: known to be free, with room around."""
    clearance = navigation.clearance
    is_narrow = clearance.limit - clearance.closeness.astype(np.int64) < (2.0 * radius / navigation.resolution) ** 2
    return np.where((navigation.log_odds < 0) & ~is_narrow, -1, 1).astype(np.int8)


def _is_taken(row: int, places: Mapping[int, NDArray[np.float64]], ends: Mapping[int, NDArray[np.float64]]) -> bool:
    """Whether another robot stays on a robot's next node, or an earlier one moves there."""
    for other, place in places.items():
        end = ends.get(other, place)
        if other != row and math.dist(ends[row], end) <= ON_NODE and (other not in ends or other < row):
            return True
    return False
