"""The choice of a robot's next path from a node.

It leads to a goal in sight of a node, to the first frontier of a tour, through the cheapest opening, or home.

Robots without a goal drive to the first frontier of the shortest tour of all frontiers that are left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.intent import KEPT_NEAR, Intent
from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.memories import Legs, Memory, Place
from lidarium.agents.srt.motion import Limits
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node, Tree, way_to
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.planning.touring.tours import shortest_tour

MOST = 14
"""Maximum number of frontiers on a tour, the nearest ones."""

WAY_OF_SIZE = 1.0
"""Extra distance that a metre of frontier length is worth [m].

A robot drives so much farther to begin with a long frontier, as more is to be seen behind it.
"""

TEAMMATE_SPREAD = 5.0
"""Distance from a teammate's target within which frontiers cost more [m].

The added cost is by how much nearer they are.
"""

TEAMMATE_SAME = 1.0
"""Frontiers this near to a teammate's goal are the teammate's [m]."""


def _first_on_tour(
    memory: Memory,
    senses: Senses,
    limits: Limits,
    least: float,
    intent: Intent,
    of_teammates: Sequence[Place],
) -> tuple[Legs, Place] | None:
    """Return the path to the tour's first frontier, and the point to observe there.

    The tour is the shortest one.

    A robot turns on the spot before it sets out, so the turn counts, too, as the way that it could have
    driven in the time.

    Parameters
    ----------
    memory : Memory
        Memory of the robot.
    senses, limits : Senses, Limits
        Its pose, and its speeds.
    least : float
        Frontiers shorter than this are left out [m].
    intent : Intent
        Its last goal.
    of_mates : sequence of (2,) float64
        Goals of teammates [m].
    """
    frontiers = memory.frontiers(senses.pose[:2], least, MOST)
    if frontiers is None:
        return None
    to_teammates = np.array(
        [[math.dist(focus, teammate) for teammate in of_teammates] for focus in frontiers.focuses]
    ).min(axis=1, initial=math.inf)
    is_left = to_teammates >= TEAMMATE_SAME
    if not is_left.any():
        return None
    gap = frontiers.ahead - senses.pose[:2]
    turns = np.abs([wrapped(float(angle)) for angle in np.arctan2(gap[:, 1], gap[:, 0]) - float(senses.pose[2])])
    first = frontiers.costs + turns * limits.speed / limits.turn_rate + np.maximum(TEAMMATE_SPREAD - to_teammates, 0.0)
    first -= WAY_OF_SIZE * frontiers.sizes
    if intent.latest is not None:
        first -= intent.kept * _are_near(frontiers.cells, intent.latest)
    left = np.flatnonzero(is_left)
    tour = shortest_tour(first[left], frontiers.between(left))
    begin = int(left[tour[0]])
    return frontiers.legs(begin), frontiers.focuses[begin]


def _are_near(cells: Sequence[NDArray[np.float64]], latest: Place) -> NDArray[np.bool_]:
    return np.array([float(np.hypot(*(each - latest).T).min()) < KEPT_NEAR for each in cells])


LAST_FRONTIER = 0.3
"""Least length of map frontiers visited when nothing else is left [m]."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A leg of a way.

    Attributes
    ----------
    place : (2,) float64
        Its end [m].
    node : int or None
        The node there; None if there is none yet.
    candidate : Candidate or None
        The robot's goal there.
    is_goal : bool
        Whether it is the goal.
    """

    place: NDArray[np.float64]
    node: int | None
    candidate: Candidate | None = None
    is_goal: bool = False


class WayChooser:
    """Chooses the ways of one robot."""

    def __init__(
        self,
        source: CandidateSource,
        settings: SrtSettings,
        limits: Limits,
        generator: np.random.Generator,
    ) -> None:
        self._source, self._settings, self._limits, self._generator = source, settings, limits, generator

    def choose(
        self,
        node: Node,
        tree: Tree,
        known: set[int],
        memory: Memory,
        senses: Senses,
        targets: Sequence[Candidate],
    ) -> list[Choice]:
        """Return the legs of the path to take from a node.

        There are none if nothing is left to visit.

        Nodes are examined along the tree's paths, nearest first; with ``backtrack`` ``parent`` only the node
        itself is.
        """
        settings = self._settings
        lengths, before = tree.ways(node.number, known) if settings.backtrack == "open" else ({node.number: 0.0}, {})
        reached = [tree.nodes[number] for number in lengths]
        if straight := self._to_goal(tree, reached, lengths, before, memory, senses):
            return straight
        is_drawn = settings.candidates != "goal" or self._generator.random() < settings.random_share
        tour = [] if is_drawn else self.tour(node, memory, senses, targets)
        if tour:
            return tour
        others = [tree.nodes[number] for number in sorted(known)]
        if is_drawn:
            best = self._drawn(reached, lengths, memory, others, targets)
        else:
            found = [candidate for each in reached for candidate in self._source.of_node(each, memory, others)]
            best = self._cheapest(_left_by(targets, found), tree, lengths, before, senses)
        if best is not None:
            return [*_legs(tree, way_to(best.node, before)), Choice(best.place, None, best)]
        if settings.candidates != "goal":
            return []
        # Towards a goal frontiers are the last resort: what lies beside the way need not be seen.
        return (
            self._to_frontier(node, memory, settings.least_frontier, senses, targets)
            or self._across(others, memory, senses, targets)
            or self._to_frontier(node, memory, LAST_FRONTIER, senses, targets)
        )

    def _cheapest(
        self,
        found: list[Candidate],
        tree: Tree,
        lengths: dict[int, float],
        before: dict[int, int],
        senses: Senses,
    ) -> Candidate | None:
        """Return the candidate to which the path costs least, None if there is none."""

        def cost_of(candidate: Candidate) -> float:
            legs = [tree.nodes[number].place for number in way_to(candidate.node, before)]
            length = lengths[candidate.node] + math.dist(tree.nodes[candidate.node].place, candidate.place)
            return self._weighed(length, legs[0] if legs else candidate.place, candidate.place, senses)

        return min(found, key=cost_of, default=None)

    def _drawn(
        self,
        reached: list[Node],
        lengths: dict[int, float],
        memory: Memory,
        others: list[Node],
        targets: Sequence[Candidate],
    ) -> Candidate | None:
        """Return a drawn candidate of the nearest node that has any, None if none has."""
        for each in sorted(reached, key=lambda each: lengths[each.number]):
            found = _left_by(targets, self._source.of_node(each, memory, others))
            if found:
                return found[int(self._generator.integers(len(found)))]
        return None

    def _to_goal(
        self,
        tree: Tree,
        reached: list[Node],
        lengths: dict[int, float],
        before: dict[int, int],
        memory: Memory,
        senses: Senses,
    ) -> list[Choice]:
        """Return the path to a goal that is known to be in reach; empty if it is not, or there is no goal.

        ``lengths`` and ``before`` are those of the tree's paths to the nodes that are reached.
        """
        goal = senses.goal
        if goal is None:
            return []
        across = memory.way(senses.pose[:2], goal)
        if across is not None:
            return [*(Choice(position, None) for position in across[:-1]), Choice(goal, None, is_goal=True)]
        in_sight = [each for each in reached if each.safe.contains(goal)]
        if not in_sight:
            return []
        nearest = min(in_sight, key=lambda each: lengths[each.number] + math.dist(each.place, goal))
        return [*_legs(tree, way_to(nearest.number, before)), Choice(goal, None, is_goal=True)]

    def tour(self, node: Node, memory: Memory, senses: Senses, targets: Sequence[Candidate]) -> list[Choice]:
        """Return the path to the first frontier of the shortest tour.

        The tour visits the frontiers of the map; there is no path if there is no tour.

        Only explorers plan tours: robots without a goal that go where what was seen is open, at the least
        cost.
        """
        settings = self._settings
        if senses.goal is not None or settings.candidates != "goal" or settings.algorithm != "integrated":
            return []
        of_teammates = [target.focus for target in targets]
        for least in (settings.least_frontier, LAST_FRONTIER):
            begun = _first_on_tour(memory, senses, self._limits, least, self._source.intent, of_teammates)
            if begun is not None:
                return _to_focus(node, *begun)
        return []

    def _across(self, nodes: list[Node], memory: Memory, senses: Senses, targets: Sequence[Candidate]) -> list[Choice]:
        """Return the path across the map to the nearest indirect opening.

        No straight path from the opening's node leads to it.
        """
        found = [candidate for each in nodes for candidate in self._source.beside(each, memory)]
        for candidate in sorted(_left_by(targets, found), key=lambda each: senses.distance_to(each.place)):
            across = memory.way(senses.pose[:2], candidate.place)
            if across is not None:
                return [
                    *(Choice(position, None) for position in across[:-1]),
                    Choice(candidate.place, None, candidate),
                ]
        return []

    def _weighed(self, length: float, first: NDArray[np.float64], last: NDArray[np.float64], senses: Senses) -> float:
        """Return the cost of a path [m].

        It counts its length, the turn towards its first place, and how far from the goal it ends.
        """
        gap = first - senses.pose[:2]
        turn = abs(wrapped(math.atan2(gap[1], gap[0]) - float(senses.pose[2])))
        length += turn * self._limits.speed / self._limits.turn_rate
        return self._settings.way_weight * length + (0.0 if senses.goal is None else math.dist(last, senses.goal))

    def _to_frontier(
        self, node: Node, memory: Memory, least: float, senses: Senses, targets: Sequence[Candidate]
    ) -> list[Choice]:
        """Return the cheapest path to a map frontier of at least a length [m].

        Frontiers of teammates are left out.
        """
        found = memory.frontiers(senses.pose[:2], least, MOST)
        if found is None:
            return []

        def cost_of(k: int) -> float:
            return self._weighed(float(found.costs[k]), found.legs(k)[0], found.focuses[k], senses)

        left = [
            k
            for k, focus in enumerate(found.focuses)
            if all(math.dist(focus, target.focus) >= TEAMMATE_SAME for target in targets)
        ]
        best = min(left, key=cost_of, default=None)
        return [] if best is None else _to_focus(node, found.legs(best), found.focuses[best])


def home_way(tree: Tree, start: int, root: int, known: set[int], senses: Senses, memory: Memory) -> list[Choice]:
    """Return the legs of the shortest path to the first node.

    The path follows the tree or else crosses the map; there are no legs if there is no path.
    """
    legs = _legs(tree, way_to(root, tree.ways(start, known)[1]))
    if not legs and start != root:
        across = memory.way(senses.pose[:2], tree.nodes[root].place)
        legs = [*(Choice(position, None) for position in across[:-1]), *_legs(tree, [root])] if across else []
    return legs


def _legs(tree: Tree, way: list[int]) -> list[Choice]:
    return [Choice(tree.nodes[number].place, number) for number in way]


def _left_by(targets: Sequence[Candidate], found: list[Candidate]) -> list[Candidate]:
    """Return the candidates that no teammate goes for."""
    return [
        each
        for each in found
        if not any(
            (each.opening is not None and each.opening is target.opening)
            or math.dist(each.focus, target.focus) < TEAMMATE_SAME
            for target in targets
        )
    ]


def _to_focus(node: Node, legs: list[NDArray[np.float64]], focus: NDArray[np.float64]) -> list[Choice]:
    """Return a path across the map to a view of a frontier."""
    candidate = Candidate(node.number, legs[-1], None, focus, is_frontier=True)
    return [*(Choice(position, None) for position in legs[:-1]), Choice(legs[-1], None, candidate)]
