"""The tree of a team: nodes, parents, bridges and paths.

Nodes hold the regions seen from them; bridges join nodes, and paths lead along parents and bridges.

Robots that share a map share the graph; its places are in the frame of the map's first cell, which is common
to all of them. A robot that hears of others only now and then knows the nodes that reached it.
"""

import heapq
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.safe_region import Opening, SafeRegion, openings_of, safe_region, seen_region


@dataclass(eq=False, slots=True)
class Node:
    """A former position of a robot, and the region seen from it.

    Attributes
    ----------
    number : int
        Place in the list of all nodes.
    agent : str
        Who made it.
    pose : (3,) float64
        x, y, theta [m, rad].
    safe : SafeRegion
        Safe region of a robot.
    seen : SafeRegion
        Seen region.
    openings : list of Opening
        Openings beyond which more may be seen.
    parent : int or None
        The node from which the robot came; None for a robot's first one.
    neighbours : dict of int to float
        Nodes to which a straight way leads, with its length [m]: parent, children and bridges.
    has_turned : bool
        Whether a robot turned there to see the space behind it.
    view : (directions,) float64
        Seen ranges, as from ``view_of``.
    """

    number: int
    agent: str
    pose: NDArray[np.float64]
    safe: SafeRegion
    seen: SafeRegion
    openings: list[Opening]
    parent: int | None
    view: NDArray[np.float64]
    neighbours: dict[int, float] = field(default_factory=dict)
    has_turned: bool = False

    @property
    def place(self) -> NDArray[np.float64]:
        """x, y [m]."""
        return self.pose[:2]


@dataclass(frozen=True, slots=True)
class RegionRules:
    """How the regions of a robot's nodes are found from its views.

    Attributes
    ----------
    shape : str
        Shape of safe regions.
    body : float
        Radius that the robot needs on its way [m].
    perception : float
        Rays count as far as this [m].
    turn_room : float
        As in `safe_region` [m].
    with_blind : bool
        As in `openings_of`.
    """

    shape: str
    body: float
    perception: float
    turn_room: float
    with_blind: bool

    def regions(
        self, pose: NDArray[np.float64], view: NDArray[np.float64]
    ) -> tuple[SafeRegion, SafeRegion, list[Opening]]:
        """Return the safe region, the seen region and the openings of a view (directions,) from a pose (3,)."""
        place = np.array(pose[:2])
        safe = safe_region(place, view, float(pose[2]), self.shape, self.body, self.perception, self.turn_room)
        openings = openings_of(place, view, self.perception, self.body, with_blind=self.with_blind)
        return safe, seen_region(place, view, self.perception), openings

    def node(
        self, number: int, agent: str, pose: NDArray[np.float64], parent: int | None, view: NDArray[np.float64]
    ) -> Node:
        """Return a node with its regions."""
        return Node(number, agent, np.array(pose), *self.regions(pose, view), parent, view)


def sees_back_and_forth(first: Node, second: Node) -> bool:
    """Whether two nodes lie in each other's safe regions."""
    return bool(first.safe.contains(second.place) and second.safe.contains(first.place))


class Tree:
    """All nodes of a team.

    Attributes
    ----------
    nodes : list of Node
        By number.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = []

    def add(self, node: Node, joins: Callable[[Node, Node], bool] | None, known: Iterable[int]) -> None:
        """Add a node below its parent, with its bridges."""
        if node.number != len(self.nodes):
            raise ValueError(f"number of the node is {node.number}; want the next one, {len(self.nodes)}")
        if node.parent is not None and not 0 <= node.parent < node.number:
            raise ValueError(f"parent of node {node.number} is {node.parent}; want an earlier node, or None")
        self.nodes.append(node)
        if node.parent is not None:
            self.connect(node.number, node.parent)
        self.bridge(node, joins, known)

    def bridge(self, node: Node, joins: Callable[[Node, Node], bool] | None, known: Iterable[int]) -> None:
        """Add bridges from a node to those of the ``known`` nodes that it ``joins``; none if that is None."""
        if joins is not None:
            for other in sorted(known):
                if other not in (node.number, node.parent) and joins(node, self.nodes[other]):
                    self.connect(node.number, other)

    def connect(self, first: int, second: int) -> None:
        """Add a straight way between two nodes."""
        length = math.dist(self.nodes[first].place, self.nodes[second].place)
        self.nodes[first].neighbours[second] = self.nodes[second].neighbours[first] = length

    def disconnect(self, first: int, second: int) -> None:
        """Take away the way between two nodes, on which a robot did not get through."""
        self.nodes[first].neighbours.pop(second, None)
        self.nodes[second].neighbours.pop(first, None)

    def chain(self, number: int) -> list[int]:
        """Return a node, its parent and so on to the first node."""
        chain = [number]
        while (parent := self.nodes[chain[-1]].parent) is not None:
            chain.append(parent)
        return chain

    def ways(self, start: int, known: set[int]) -> tuple[dict[int, float], dict[int, int]]:
        """Return the shortest path length to each node in reach [m].

        Paths lead along known nodes; the node before each one is returned, too.
        """
        lengths, before = {start: 0.0}, dict[int, int]()
        heap = [(0.0, start)]
        while heap:
            length, number = heapq.heappop(heap)
            if length > lengths[number]:
                continue
            for other, step in self.nodes[number].neighbours.items():
                if other in known and length + step < lengths.get(other, math.inf):
                    lengths[other], before[other] = length + step, number
                    heapq.heappush(heap, (length + step, other))
        return lengths, before


def way_to(number: int, before: dict[int, int]) -> list[int]:
    """Return the nodes of a path that ``Tree.ways`` found.

    The first node is left out, the last one included.
    """
    way = []
    while number in before:
        way.append(number)
        number = before[number]
    return way[::-1]
