"""One robot that grows the tree.

It observes, chooses, drives, comes back where nothing is open, and goes home in the end.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.choice import Choice, choose, home_way, tour_way
from lidarium.agents.srt.drive import Drive, Phase, driven, free_way, limits_of
from lidarium.agents.srt.frontier_arcs import Opening, openings_of
from lidarium.agents.srt.memory import Memory
from lidarium.agents.srt.progress import Progress
from lidarium.agents.srt.safe_region import SafeRegion, joined_views, safe_region, seen_region, view_of
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node, Tree, sees_back_and_forth
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.mapping.geometry.rigid import wrapped

BLIND_S = 10.0
"""A robot whose laser tells nothing for this long gives up [s]."""

BACKING_S, BACKING_SPEED = 1.5, 0.12
"""How long and how fast a blocked robot backs out [s, m/s]."""

TEAMMATE_NEAR = 1.5
"""A teammate within this distance may be what blocks a robot [m]."""

ASIDES = 6
"""How often in a row a robot steps aside on its way before it gives its target up."""

FINAL = ("budget", "goal_missed", "blocked")
"""Endings after which a robot looks for nothing any more."""

REVIEW_S = 0.5
"""Time between looks at whether a target still stands [s]."""

GOT_ON = 0.8
"""Distance driven along free rays before checking their target [m].

The robot then checks whether the rays were seen through.
"""

GOT_ON_ANEW = 0.5
"""Distance after which a robot without a goal plans its tour anew [m]."""

NEAR_NODE = 0.5
"""A robot that gets no nearer to a node than this takes itself to be there [m]."""

NEW_NODE = 0.05
"""A robot nearer than this to its last node makes no new one [m]."""

EXACTLY = 0.03
"""Distance at which a robot is at its goal [m]."""

Command = tuple[float, float]
REST: Command = (0.0, 0.0)


class Explorer:
    """One robot of the tree.

    Parameters
    ----------
    agent : str
        Its name.
    tree : Tree
        The team's graph.
    settings : SrtSettings
        How the tree grows.
    robot : Robot
        Its body and drive.
    lidar : Lidar
        Its laser.
    generator : numpy.random.Generator
        Where its draws come from.

    Attributes
    ----------
    known : set of int
        Nodes that it knows: its own, and those of teammates that it was in contact with.
    ending : str or None
        Why it goes home, or is there.
    is_home : bool
        Whether it has ended its work and is back where it began, or as near as it gets.
    """

    def __init__(
        self,
        agent: str,
        tree: Tree,
        settings: SrtSettings,
        robot: Robot,
        lidar: Lidar,
        generator: np.random.Generator,
    ) -> None:
        self.agent, self.known = agent, set[int]()
        self.ending: str | None = None
        self.is_home = False
        self._tree, self._settings, self._lidar, self._generator = tree, settings, lidar, generator
        self._limits = limits_of(robot, settings)
        self._body = robot.radius + settings.margin
        self._perception = min(settings.perception, lidar.range_max)
        self._source = CandidateSource(settings, self._body, generator)
        self._root = self._node = -1
        self._own_nodes = 0
        self._route: list[Choice] = []
        self._drive: Drive | None = None
        self._chose_at = np.zeros(2)
        self._looks: list[float] = []
        self._looked_at: NDArray[np.float64] | None = None
        self._backs_until = self._blind_since = -math.inf
        self._progress = Progress()
        self._reviewed_at, self._asides, self._failures = -math.inf, 0, 0
        self._is_aside = False

    @property
    def target(self) -> Candidate | None:
        """The candidate that it is on its way to."""
        return self._route[-1].candidate if self._route else None

    @property
    def root(self) -> int:
        """Number of its first node, -1 before it has one."""
        return self._root

    def step(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> Command:
        """Return speed [m/s] and turn rate [rad/s] for one step.

        ``targets`` are those of teammates in contact.
        """
        if senses.is_blind(self._lidar):
            return self._wait_for_sight(senses)
        self._blind_since = -math.inf
        if self._root < 0:
            self._root = self._add_node(senses, None, senses.pose, memory)
            self._progress.stand(senses)
            self._begin_looks(senses)
        if senses.time_s < self._backs_until:
            return -BACKING_SPEED, 0.0
        if self._looks:
            turn = self._look(senses, memory)
            if turn is not None:
                return turn
        if self._route and senses.time_s - self._reviewed_at >= REVIEW_S:
            self._review(senses, memory, targets)
        if not self._route and not (self.is_home and senses.time_s - self._reviewed_at < REVIEW_S):
            self._decide(senses, memory, targets)
        if self._looks:
            return REST
        return self._follow(senses, memory) if self._route else REST

    def _wait_for_sight(self, senses: Senses) -> Command:
        if self._blind_since < 0.0:
            self._blind_since = senses.time_s
        if senses.time_s - self._blind_since >= BLIND_S:
            self.ending, self.is_home = "blind", True
        self._progress.stand(senses)
        return REST

    def _add_node(self, senses: Senses, parent: int | None, pose: NDArray[np.float64], memory: Memory) -> int:
        """Add a node where the robot is, and return its number."""
        view = view_of(senses.scan, self._lidar, float(senses.pose[2]))
        node = Node(
            len(self._tree.nodes), self.agent, np.array(pose), *self._regions(pose, view), parent, view
        )
        self._insert(node, memory)
        return node.number

    def _insert(self, node: Node, memory: Memory) -> None:
        def joins(first: Node, second: Node) -> bool:
            return sees_back_and_forth(first, second) or (
                self._settings.memory == "map"
                and math.dist(first.place, second.place) <= self._perception
                and memory.is_clear(first.place, second.place)
            )

        self._tree.add(node, joins if self._settings.backtrack == "open" else None, self.known)
        self.known.add(node.number)
        self._node = node.number
        self._own_nodes += 1

    def _regions(
        self, pose: NDArray[np.float64], view: NDArray[np.float64]
    ) -> tuple[SafeRegion, SafeRegion, list[Opening]]:
        """Return where the robot is safe, what it has seen, and the openings, of a view."""
        settings, place = self._settings, np.array(pose[:2])
        safe = safe_region(
            place, view, float(pose[2]), settings.shape, self._body, self._perception, settings.turn_room
        )
        openings = openings_of(place, view, self._perception, self._body, with_blind=settings.memory == "map")
        return safe, seen_region(place, view, self._perception), openings

    def _begin_looks(self, senses: Senses) -> None:
        """Plan the turns after which the robot has seen the whole circle."""
        field = self._lidar.field_of_view
        turns = math.ceil(2.0 * math.pi / field - 1e-9) - 1
        if not self._settings.looks_around or self._lidar.beams == 1 or turns > 8:
            return
        heading = float(senses.pose[2])
        self._looks = [
            wrapped(heading + (2.0 * math.pi - field) * (turn + 1) / turns) for turn in range(turns)
        ]

    def _look(self, senses: Senses, memory: Memory) -> Command | None:
        """Turn to the next heading to look at.

        None when all were seen, which the node then knows.
        """
        error = wrapped(self._looks[0] - float(senses.pose[2]))
        if abs(error) > self._settings.turning_ends and not self._progress.is_stuck(senses):
            return 0.0, max(-self._limits.turn_rate, min(self._limits.turn_rate, 2.0 * error))
        node = self._tree.nodes[self._node]
        view = joined_views(node.view, view_of(senses.scan, self._lidar, float(senses.pose[2])))
        node.view = view
        node.safe, node.seen, node.openings = self._regions(node.pose, view)
        self._looks.pop(0)
        self._progress.stand(senses)
        return REST if self._looks else None

    def _review(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> None:
        """Review the target, the need for a new node, and the goal.

        A target seen through on the path is dropped, a node is made after a while, and a visible goal
        becomes the target.
        """
        self._reviewed_at = senses.time_s
        candidate, last = self._route[-1].candidate, self._route[-1]
        if candidate is None or last.is_goal or self._settings.memory != "map":
            return
        is_direct = len(self._route) == 1
        departed = senses.distance_to(self._tree.nodes[self._node].place)
        in_sight = senses.goal is not None and memory.way(senses.pose[:2], senses.goal) is not None
        # Every step sees a little more beyond free rays: a target there stands until the robot has got on; so
        # does one towards a goal.
        is_along_rays = candidate.opening is not None and not candidate.opening.is_gap
        may_drop = departed >= (
            GOT_ON if is_along_rays or senses.goal is not None else self._settings.least_step
        )
        has_passed = departed >= self._settings.passing_distance
        is_dropped = may_drop and not self._source.is_open(
            candidate, self._tree.nodes[candidate.node], memory
        )
        if in_sight or is_dropped:
            self._source.intent.settle()
            self._pause(senses, memory)
            return
        if has_passed and (is_direct or candidate.is_frontier):
            self._add_node(senses, self._node, senses.pose, memory)
        # Without a goal what was seen since may make another way the better one; towards a goal it seldom
        # does.
        was_drawn = self._settings.random_share > 0.0 and not candidate.is_frontier
        if not was_drawn and senses.distance_to(self._chose_at) >= GOT_ON_ANEW:
            way = tour_way(
                self._tree.nodes[self._node],
                self._source,
                memory,
                self._settings,
                senses,
                targets,
                self._limits,
            )
            if way:
                self._set_out(way, senses)

    def _pause(self, senses: Senses, memory: Memory) -> None:
        """Drop the way, with a node where the robot is, so that all ways begin at nodes."""
        self._route, self._drive = [], None
        if senses.distance_to(self._tree.nodes[self._node].place) >= NEW_NODE:
            self._add_node(senses, self._node, senses.pose, memory)

    def _decide(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> None:
        """Choose where to go next, or to go home."""
        if self._looked_at is not None:
            memory.give_up(self._looked_at)
            self._looked_at = None
        self._reviewed_at = senses.time_s
        if self.ending in FINAL or self._is_spent(senses):
            self._go_home(self.ending if self.ending in FINAL else "budget", senses, memory)
            return
        node = self._tree.nodes[self._node]
        way = choose(
            node,
            self._tree,
            self.known,
            self._source,
            memory,
            self._settings,
            self._generator,
            senses,
            targets,
            self._limits,
        )
        if way:
            self.ending, self.is_home, self._asides = None, False, 0
            self._set_out(way, senses)
        elif self._may_look(node):
            node.has_looked = True
            self._begin_looks(senses)
        elif self._settings.backtrack == "parent" and node.parent is not None:
            self._set_out([Choice(self._tree.nodes[node.parent].place, node.parent)], senses)
        else:
            self._go_home("explored" if senses.goal is None else "unreachable", senses, memory)

    def _may_look(self, node: Node) -> bool:
        return (
            self._settings.memory == "regions"
            and self._settings.looks_around
            and not node.has_looked
            and node.number != self._root
        )

    def _is_spent(self, senses: Senses) -> bool:
        return self._own_nodes >= self._settings.nodes or senses.time_s >= self._settings.time_s

    def _go_home(self, ending: str, senses: Senses, memory: Memory) -> None:
        """Set out for the first node; there, or without a way, the robot is at its end."""
        self.ending = ending
        self._route = home_way(self._tree, self._node, self._root, self.known, senses, memory)
        self._drive, self._is_aside = None, False
        self._progress.stand(senses)
        self.is_home = not self._route

    def _set_out(self, way: list[Choice], senses: Senses) -> None:
        self._route, self._drive, self._is_aside = way, None, False
        self._source.intent.go_for(None if self.target is None else self.target.focus)
        self._chose_at = senses.pose[:2]
        self._progress.stand(senses)

    def _follow(self, senses: Senses, memory: Memory) -> Command:
        """Drive along the way, cutting corners where the map says that there is room."""
        if self._drive is None:
            self._cut_corner(senses, memory)
            self._drive = Drive(self._route[0].place)
        if self._progress.is_stuck(senses):
            self._settle_block(senses, memory)
            return REST
        leg = self._route[0]
        free = free_way(senses.scan, self._lidar, self._limits.radius)
        arrived = EXACTLY if leg.is_goal else self._settings.arrived
        self._drive, speed, turn_rate = driven(
            self._drive, senses.pose, free, self._limits, self._settings, arrived
        )
        if self._drive.phase is Phase.DONE:
            self._arrive(leg, senses, memory)
            return REST
        return speed, turn_rate

    def _cut_corner(self, senses: Senses, memory: Memory) -> None:
        if self._settings.memory != "map":
            return
        for skipped in range(len(self._route) - 1, 0, -1):
            if memory.is_clear(senses.pose[:2], self._route[skipped].place):
                del self._route[:skipped]
                return

    def _arrive(self, leg: Choice, senses: Senses, memory: Memory) -> None:
        """Take note of where the robot has come."""
        self._route, self._drive = self._route[1:], None
        self._failures = self._failures if self._is_aside else 0
        if leg.node is not None:
            self._return_to(leg.node, senses, memory)
        elif leg.is_goal:
            # The environment ends a robot that truly is there; this one only takes itself to be.
            self._go_home("goal_missed", senses, memory)
        else:
            place = leg.place if self._settings.places_nodes_at_targets else senses.pose[:2]
            self._add_node(senses, self._node, np.array([*place, senses.pose[2]]), memory)
            if leg.candidate is not None:
                self._source.note_tried(leg.candidate)
                self._source.intent.settle()
                if leg.candidate.is_frontier and memory.is_frontier(leg.candidate.focus):
                    self._look_at(leg.candidate.focus, senses)

    def _look_at(self, focus: NDArray[np.float64], senses: Senses) -> None:
        """Turn to a frontier that is not seen through from where the robot came for it.

        What stays unseen then is given up.
        """
        gap = focus - senses.pose[:2]
        self._looks, self._looked_at = [math.atan2(gap[1], gap[0])], focus

    def _return_to(self, number: int, senses: Senses, memory: Memory) -> None:
        """Be at a node again.

        In the printed form of the thesis the node is seen and added anew, below the parent that it
        had.
        """
        if number not in self._tree.nodes[self._node].neighbours:
            self._tree.connect(self._node, number)
        self._node = number
        node = self._tree.nodes[number]
        if self._settings.repeats_nodes and not self._route and self.ending is None:
            self._add_node(senses, node.parent, np.array([*node.place, senses.pose[2]]), memory)

    def _settle_block(self, senses: Senses, memory: Memory) -> None:
        """Back out, step aside, or give up the target.

        What stops a robot far from its target seldom has to do with the target.
        """
        leg, target, is_there = self._route[0], self.target, len(self._route) == 1
        blocks = 1 if self._is_aside else self._progress.note_block(senses)
        self._progress.stand(senses)
        if leg.node is not None and senses.distance_to(leg.place) < NEAR_NODE:
            self._arrive(leg, senses, memory)
            return
        self._failures += 1
        steps_aside = blocks % 3 == 2 or any(
            senses.distance_to(teammate) < TEAMMATE_NEAR for teammate in senses.teammates
        )
        departed = self._node
        self._pause(senses, memory)
        if leg.is_goal and self._failures > ASIDES:
            # What stands there, such as teammates who have come to the same goal, does not go away.
            self._failures = 0
            self._go_home("blocked", senses, memory)
            return
        if steps_aside and self._asides < ASIDES:
            self._asides += 1
            self._step_aside(senses)
            return
        self._asides = 0
        if leg.node is not None:
            self._tree.disconnect(departed, leg.node)
            self._tree.disconnect(self._node, leg.node)
        elif target is not None and (is_there or blocks % 3 == 0):
            self._source.note_tried(target)
            if target.is_frontier:
                memory.give_up(target.focus)
        if self.ending is not None and self._failures > ASIDES:
            self.is_home = True
        self._backs_until = senses.time_s + BACKING_S

    def _step_aside(self, senses: Senses) -> None:
        """Go to a drawn place in sight, to step aside.

        Of two robots that block each other, one thus lets the other pass.
        """
        node = self._tree.nodes[self._node]
        region = safe_region(
            senses.pose[:2],
            view_of(senses.scan, self._lidar, float(senses.pose[2])),
            float(senses.pose[2]),
            "radial",
            self._limits.radius,
            self._perception,
        )
        for _ in range(self._settings.tries):
            angle, distance = (
                float(self._generator.uniform(-math.pi, math.pi)),
                float(self._generator.uniform(0.3, 1.2)),
            )
            if region.radius_at(angle) >= distance:
                place = region.place + distance * np.array([math.cos(angle), math.sin(angle)])
                self._set_out([Choice(place, None, Candidate(node.number, place, None, place))], senses)
                self._is_aside = True
                return
