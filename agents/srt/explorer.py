"""One robot that grows the tree.

It observes, chooses, drives, comes back if nothing is open, and goes home in the end.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.choice import Choice, WayChooser, home_way
from lidarium.agents.srt.memories import Memory
from lidarium.agents.srt.motion import Blocks, Remedy
from lidarium.agents.srt.safe_region import joined_views, view_of
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.travel import BACKING_SPEED, REST, Command, Travel
from lidarium.agents.srt.tree import Node, RegionRules, Tree, sees_back_and_forth
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot

NEW_NODE = 0.05
"""A robot nearer than this to its last node makes no new one [m]."""


class _TreeGrowth:
    """The nodes that one robot adds to the team's graph, and where it is in it.

    Parameters
    ----------
    agent : str
        The robot's name.
    tree : Tree
        The team's graph.
    settings : SrtSettings
        How the tree grows.
    lidar : Lidar
        The robot's laser.
    body : float
        Radius that the robot needs on its way [m].

    Attributes
    ----------
    known : set of int
        Nodes that the robot knows: its own, and those of teammates that it was in contact with.
    root, number : int
        Its first node and the one where it is, -1 before it has one.
    count : int
        How many nodes it has added.
    rules : RegionRules
        How their regions are found.
    """

    def __init__(self, agent: str, tree: Tree, settings: SrtSettings, lidar: Lidar, body: float) -> None:
        self._agent, self._settings, self._lidar = agent, settings, lidar
        self.tree, self.known = tree, set[int]()
        self.perception = min(settings.perception, lidar.range_max)
        self.rules = RegionRules(
            settings.shape, body, self.perception, settings.turn_room, with_blind=settings.memory == "map"
        )
        self.root = self.number = -1
        self.count = 0

    @property
    def node(self) -> Node:
        """The robot's present node."""
        return self.tree.nodes[self.number]

    def plant(self, senses: Senses, memory: Memory) -> None:
        """Add the robot's first node."""
        self.root = self.add(senses, None, senses.pose, memory)

    def add(self, senses: Senses, parent: int | None, pose: NDArray[np.float64], memory: Memory) -> int:
        """Add a node at the robot's position, and return its number."""
        view = view_of(senses.scan, self._lidar, float(senses.pose[2]))
        node = self.rules.node(len(self.tree.nodes), self._agent, pose, parent, view)
        self._insert(node, memory)
        return node.number

    def add_if_apart(self, senses: Senses, memory: Memory) -> None:
        """Add a node at the robot's position, unless its last one is there."""
        if senses.distance_to(self.node.place) >= NEW_NODE:
            self.add(senses, self.number, senses.pose, memory)

    def widen_view(self, senses: Senses) -> None:
        """Add the present scan to the robot's present node."""
        node = self.node
        view = joined_views(node.view, view_of(senses.scan, self._lidar, float(senses.pose[2])))
        node.view = view
        node.safe, node.seen, node.openings = self.rules.regions(node.pose, view)
        if self._settings.memory == "regions" and self._settings.backtrack == "open":
            # The first scan may be blind towards a node of an earlier run, which nothing else leads to.
            self.tree.bridge(node, sees_back_and_forth, self.known)

    def move_to(self, number: int) -> Node:
        """Return the node to which the robot has come; the two are neighbours from now on."""
        if number not in self.node.neighbours:
            self.tree.connect(self.number, number)
        self.number = number
        return self.node

    def _insert(self, node: Node, memory: Memory) -> None:
        def joins(first: Node, second: Node) -> bool:
            return sees_back_and_forth(first, second) or (
                self._settings.memory == "map"
                and math.dist(first.place, second.place) <= self.perception
                and memory.is_clear(first.place, second.place)
            )

        self.tree.add(node, joins if self._settings.backtrack == "open" else None, self.known)
        self.known.add(node.number)
        self.number = node.number
        self.count += 1


FINAL = ("budget", "goal_missed", "blocked")
"""Endings after which a robot searches for nothing any more."""

REVIEW_S = 0.5
"""Time between checks of whether a target still stands [s]."""

REPLAN_DISTANCE = 0.5
"""Distance after which a robot without a goal plans its tour again [m]."""

NEAR_NODE = 0.5
"""A robot that gets no nearer to a node than this takes itself to be there [m]."""


class Explorer:
    """One robot of the tree.

    Attributes
    ----------
    ending : str or None
        Why it goes home, or is there.
    is_home : bool
        Whether it has ended its work and is back at its start, or as near as it gets.
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
        self.agent = agent
        self.ending: str | None = None
        self.is_home = False
        self._settings, self._lidar, self._generator = settings, lidar, generator
        self._travel = Travel(settings, robot, lidar)
        body = robot.radius + settings.margin
        self._growth = _TreeGrowth(agent, tree, settings, lidar, body)
        self._tree, self._source = tree, CandidateSource(settings, body, generator)
        self._chooser = WayChooser(self._source, settings, self._travel.limits, generator)
        self._turns, self._progress = self._travel.turns, self._travel.progress
        self._blocks = Blocks()
        self._reviewed_at = -math.inf

    @property
    def target(self) -> Candidate | None:
        """The candidate that it is on its way to."""
        return self._travel.target

    @property
    def known(self) -> set[int]:
        """Nodes that it knows: its own, and those of teammates that it was in contact with."""
        return self._growth.known

    @property
    def rules(self) -> RegionRules:
        """How the regions of its nodes are found."""
        return self._growth.rules

    @property
    def root(self) -> int:
        """Number of its first node, -1 before it has one."""
        return self._growth.root

    def step(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> Command:
        """Return speed [m/s] and turn rate [rad/s] for one step.

        ``targets`` are those of teammates in contact.
        """
        if self._progress.waits_for_sight(senses, self._lidar):
            if self._progress.is_blind(senses):
                self.ending, self.is_home = "blind", True
            return REST
        if self.root < 0:
            self._growth.plant(senses, memory)
            self._progress.stand(senses)
            self._travel.look_around(senses)
        if self._travel.is_backing(senses):
            return -BACKING_SPEED, 0.0
        if not self._turns.is_over:
            turn = self._turn_on(senses)
            if turn is not None:
                return turn
        if self._travel.legs and senses.time_s - self._reviewed_at >= REVIEW_S:
            self._review(senses, memory, targets)
        if not self._travel.legs and not (self.is_home and senses.time_s - self._reviewed_at < REVIEW_S):
            self._decide(senses, memory, targets)
        if not self._turns.is_over:
            return REST
        return self._follow(senses, memory) if self._travel.legs else REST

    def _turn_on(self, senses: Senses) -> Command | None:
        """Turn to the next heading of the plan.

        None when all were seen, which the node then knows.
        """
        command = self._travel.turn(senses)
        if command is not None:
            return command
        self._growth.widen_view(senses)
        self._turns.end_turn()
        self._progress.stand(senses)
        return None if self._turns.is_over else REST

    def _review(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> None:
        """Review the target, the need for a new node, and the goal.

        A target seen through on the path is dropped, a node is made after a while, and a visible goal
        becomes the target.
        """
        self._reviewed_at = senses.time_s
        candidate, last = self._travel.legs[-1].candidate, self._travel.legs[-1]
        if candidate is None or last.is_goal or self._settings.memory != "map":
            return
        is_direct = len(self._travel.legs) == 1
        departed = senses.distance_to(self._growth.node.place)
        in_sight = senses.goal is not None and memory.way(senses.pose[:2], senses.goal) is not None
        has_passed = departed >= self._settings.passing_distance
        node = self._tree.nodes[candidate.node]
        is_dropped = self._source.may_drop(candidate, departed, senses) and not self._source.is_open(
            candidate, node, memory
        )
        if in_sight or is_dropped:
            self._source.intent.settle()
            self._pause(senses, memory)
            return
        if has_passed and (is_direct or candidate.is_frontier):
            self._growth.add(senses, self._growth.number, senses.pose, memory)
        # Without a goal what was seen since may make another way the better one; towards a goal it seldom
        # does.
        was_drawn = self._settings.random_share > 0.0 and not candidate.is_frontier
        if not was_drawn and senses.distance_to(self._travel.began_at) >= REPLAN_DISTANCE:
            way = self._chooser.tour(self._growth.node, memory, senses, targets)
            if way:
                self._set_out(way, senses)

    def _pause(self, senses: Senses, memory: Memory) -> None:
        """Drop the way, with a node at the robot's position, so that all ways begin at nodes."""
        self._travel.drop()
        self._growth.add_if_apart(senses, memory)

    def _decide(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> None:
        """Choose the next goal, or to go home."""
        if self._turns.focus is not None:
            memory.give_up(self._turns.focus)
            self._turns.focus = None
        self._reviewed_at = senses.time_s
        if self.ending in FINAL or self._is_spent(senses):
            self._go_home(self.ending if self.ending in FINAL else "budget", senses, memory)
            return
        node = self._growth.node
        way = self._chooser.choose(node, self._tree, self.known, memory, senses, targets)
        if way:
            self.ending, self.is_home, self._blocks.asides = None, False, 0
            self._set_out(way, senses)
        elif self._may_turn(node):
            node.has_turned = True
            self._travel.look_around(senses)
        elif self._settings.backtrack == "parent" and node.parent is not None:
            self._set_out([Choice(self._tree.nodes[node.parent].place, node.parent)], senses)
        else:
            self._go_home("explored" if senses.goal is None else "unreachable", senses, memory)

    def _may_turn(self, node: Node) -> bool:
        return (
            self._settings.memory == "regions"
            and self._settings.looks_around
            and not node.has_turned
            and node.number != self.root
        )

    def _is_spent(self, senses: Senses) -> bool:
        return self._growth.count >= self._settings.nodes or senses.time_s >= self._settings.time_s

    def _go_home(self, ending: str, senses: Senses, memory: Memory) -> None:
        """Set out for the first node; there, or without a way, the robot is at its end."""
        self.ending = ending
        way = home_way(self._tree, self._growth.number, self.root, self.known, senses, memory)
        self._travel.follow(way, senses)
        self.is_home = not way

    def _set_out(self, way: list[Choice], senses: Senses, *, is_aside: bool = False) -> None:
        self._travel.set_out(way, senses, is_aside=is_aside)
        self._source.intent.go_for(None if self.target is None else self.target.focus)

    def _follow(self, senses: Senses, memory: Memory) -> Command:
        """Drive along the way."""
        self._travel.begin_leg(senses, memory)
        if self._progress.is_stuck(senses):
            self._settle_block(senses, memory)
            return REST
        command = self._travel.drive(senses)
        if command is None:
            self._arrive(self._travel.legs[0], senses, memory)
            return REST
        return command

    def _arrive(self, leg: Choice, senses: Senses, memory: Memory) -> None:
        """Note the robot's progress."""
        self._travel.end_leg()
        if not self._travel.is_aside:
            self._blocks.failures = 0
        if leg.node is not None:
            self._return_to(leg.node, senses, memory)
        elif leg.is_goal:
            # The environment ends a robot that truly is there; this one only takes itself to be.
            self._growth.add_if_apart(senses, memory)
            self._go_home("goal_missed", senses, memory)
        else:
            position = leg.place if self._settings.places_nodes_at_targets else senses.pose[:2]
            self._growth.add(senses, self._growth.number, np.array([*position, senses.pose[2]]), memory)
            if leg.candidate is not None:
                self._source.note_tried(leg.candidate)
                self._source.intent.settle()
                if leg.candidate.is_frontier and memory.is_frontier(leg.candidate.focus):
                    # What stays unseen then is given up.
                    self._turns.plan_frontier(leg.candidate.focus, senses)

    def _return_to(self, number: int, senses: Senses, memory: Memory) -> None:
        """Be at a node again.

        In the printed form of the thesis the node is seen and added again, below the parent that it
        had.
        """
        node = self._growth.move_to(number)
        if self._settings.repeats_nodes and not self._travel.legs and self.ending is None:
            self._growth.add(senses, node.parent, np.array([*node.place, senses.pose[2]]), memory)

    def _settle_block(self, senses: Senses, memory: Memory) -> None:
        """Back out, step aside, or give up the target.

        Obstacles far from the target seldom have to do with the target.
        """
        leg, target, is_there = self._travel.legs[0], self.target, len(self._travel.legs) == 1
        blocks = 1 if self._travel.is_aside else self._progress.note_block(senses)
        self._progress.stand(senses)
        if leg.node is not None and senses.distance_to(leg.place) < NEAR_NODE:
            self._arrive(leg, senses, memory)
            return
        remedy = self._blocks.remedy(senses, blocks, is_goal=leg.is_goal)
        departed = self._growth.number
        self._pause(senses, memory)
        if remedy is Remedy.GIVE_GOAL_UP:
            self._go_home("blocked", senses, memory)
            return
        if remedy is Remedy.STEP_ASIDE:
            self._step_aside(senses)
            return
        if leg.node is not None:
            self._tree.disconnect(departed, leg.node)
            self._tree.disconnect(self._growth.number, leg.node)
        elif target is not None and (is_there or blocks % 3 == 0):
            self._source.note_tried(target)
            if target.is_frontier:
                memory.give_up(target.focus)
        if self.ending is not None and self._blocks.are_hopeless:
            self.is_home = True
        self._travel.back_out(senses)

    def _step_aside(self, senses: Senses) -> None:
        """Go to a drawn position in sight, if there is one, to step aside."""
        position = self._travel.place_aside(senses, self._growth.perception, self._generator)
        if position is not None:
            candidate = Candidate(self._growth.number, position, None, position)
            self._set_out([Choice(position, None, candidate)], senses, is_aside=True)
