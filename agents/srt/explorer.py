"""One robot that grows the tree.

It observes, chooses, drives, comes back where nothing is open, and goes home in the end.
"""

import math
from collections.abc import Sequence

import numpy as np

from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.choice import Choice, WayChooser, home_way
from lidarium.agents.srt.memories.memory import Memory
from lidarium.agents.srt.motion.blocks import Blocks, Remedy, place_aside
from lidarium.agents.srt.motion.drive import Drive, Phase, driven, free_way, limits_of
from lidarium.agents.srt.motion.progress import Progress
from lidarium.agents.srt.motion.turn_plan import TURN_GAIN, TurnPlan
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node, Tree
from lidarium.agents.srt.tree_growth import TreeGrowth
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot

BLIND_S = 10.0
"""A robot whose laser measures nothing for this long gives up [s]."""

BACKING_S, BACKING_SPEED = 1.5, 0.12
"""How long and how fast a blocked robot backs out [s, m/s]."""

FINAL = ("budget", "goal_missed", "blocked")
"""Endings after which a robot searches for nothing any more."""

REVIEW_S = 0.5
"""Time between checks of whether a target still stands [s]."""

GOT_ON = 0.8
"""Distance driven along free rays before checking their target [m].

The robot then checks whether the rays were seen through.
"""

REPLAN_DISTANCE = 0.5
"""Distance after which a robot without a goal plans its tour again [m]."""

NEAR_NODE = 0.5
"""A robot that gets no nearer to a node than this takes itself to be there [m]."""

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
        self.agent = agent
        self.ending: str | None = None
        self.is_home = False
        self._settings, self._lidar, self._generator = settings, lidar, generator
        self._limits = limits_of(robot, settings)
        body = robot.radius + settings.margin
        self._growth = TreeGrowth(agent, tree, settings, lidar, body)
        self._tree, self._source = tree, CandidateSource(settings, body, generator)
        self._chooser = WayChooser(self._source, settings, self._limits, generator)
        self._route: list[Choice] = []
        self._drive: Drive | None = None
        self._chose_at = np.zeros(2)
        self._turns = TurnPlan()
        self._backs_until = self._blind_since = -math.inf
        self._progress = Progress()
        self._blocks = Blocks()
        self._reviewed_at, self._is_aside = -math.inf, False

    @property
    def target(self) -> Candidate | None:
        """The candidate that it is on its way to."""
        return self._route[-1].candidate if self._route else None

    @property
    def known(self) -> set[int]:
        """Nodes that it knows: its own, and those of teammates that it was in contact with."""
        return self._growth.known

    @property
    def root(self) -> int:
        """Number of its first node, -1 before it has one."""
        return self._growth.root

    def step(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> Command:
        """Return speed [m/s] and turn rate [rad/s] for one step.

        ``targets`` are those of teammates in contact.
        """
        if senses.is_blind(self._lidar):
            return self._wait_for_sight(senses)
        self._blind_since = -math.inf
        if self.root < 0:
            self._growth.plant(senses, memory)
            self._progress.stand(senses)
            self._turn_around(senses)
        if senses.time_s < self._backs_until:
            return -BACKING_SPEED, 0.0
        if not self._turns.is_over:
            turn = self._turn_on(senses)
            if turn is not None:
                return turn
        if self._route and senses.time_s - self._reviewed_at >= REVIEW_S:
            self._review(senses, memory, targets)
        if not self._route and not (self.is_home and senses.time_s - self._reviewed_at < REVIEW_S):
            self._decide(senses, memory, targets)
        if not self._turns.is_over:
            return REST
        return self._follow(senses, memory) if self._route else REST

    def _wait_for_sight(self, senses: Senses) -> Command:
        if self._blind_since < 0.0:
            self._blind_since = senses.time_s
        if senses.time_s - self._blind_since >= BLIND_S:
            self.ending, self.is_home = "blind", True
        self._progress.stand(senses)
        return REST

    def _turn_around(self, senses: Senses) -> None:
        if self._settings.looks_around:
            self._turns.plan_circle(senses, self._lidar)

    def _turn_on(self, senses: Senses) -> Command | None:
        """Turn to the next heading of the plan.

        None when all were seen, which the node then knows.
        """
        error = self._turns.error(senses)
        if abs(error) > self._settings.turning_ends and not self._progress.is_stuck(senses):
            turn_rate = self._limits.turn_rate
            return 0.0, max(-turn_rate, min(turn_rate, TURN_GAIN * error))
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
        candidate, last = self._route[-1].candidate, self._route[-1]
        if candidate is None or last.is_goal or self._settings.memory != "map":
            return
        is_direct = len(self._route) == 1
        departed = senses.distance_to(self._growth.node.place)
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
            self._growth.add(senses, self._growth.number, senses.pose, memory)
        # Without a goal what was seen since may make another way the better one; towards a goal it seldom
        # does.
        was_drawn = self._settings.random_share > 0.0 and not candidate.is_frontier
        if not was_drawn and senses.distance_to(self._chose_at) >= REPLAN_DISTANCE:
            way = self._chooser.tour(self._growth.node, memory, senses, targets)
            if way:
                self._set_out(way, senses)

    def _pause(self, senses: Senses, memory: Memory) -> None:
        """Drop the way, with a node where the robot is, so that all ways begin at nodes."""
        self._route, self._drive = [], None
        self._growth.add_if_apart(senses, memory)

    def _decide(self, senses: Senses, memory: Memory, targets: Sequence[Candidate]) -> None:
        """Choose where to go next, or to go home."""
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
            self._turn_around(senses)
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
        self._route = home_way(self._tree, self._growth.number, self.root, self.known, senses, memory)
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
        if not self._is_aside:
            self._blocks.failures = 0
        if leg.node is not None:
            self._return_to(leg.node, senses, memory)
        elif leg.is_goal:
            # The environment ends a robot that truly is there; this one only takes itself to be.
            self._go_home("goal_missed", senses, memory)
        else:
            place = leg.place if self._settings.places_nodes_at_targets else senses.pose[:2]
            self._growth.add(senses, self._growth.number, np.array([*place, senses.pose[2]]), memory)
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
        if self._settings.repeats_nodes and not self._route and self.ending is None:
            self._growth.add(senses, node.parent, np.array([*node.place, senses.pose[2]]), memory)

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
        self._backs_until = senses.time_s + BACKING_S

    def _step_aside(self, senses: Senses) -> None:
        """Go to a drawn place in sight, where there is one, to step aside."""
        place = place_aside(
            senses, self._lidar, self._settings, self._limits, self._growth.perception, self._generator
        )
        if place is not None:
            candidate = Candidate(self._growth.number, place, None, place)
            self._set_out([Choice(place, None, candidate)], senses)
            self._is_aside = True
