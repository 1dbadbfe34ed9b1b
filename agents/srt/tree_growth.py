"""One robot's part in the growth of the tree: its nodes, and which it knows."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.frontier_arcs import Opening, openings_of
from lidarium.agents.srt.memories.memory import Memory
from lidarium.agents.srt.safe_region import SafeRegion, joined_views, safe_region, seen_region, view_of
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node, Tree, sees_back_and_forth
from lidarium.envs.settings.lidar import Lidar

NEW_NODE = 0.05
"""A robot nearer than this to its last node makes no new one [m]."""


class TreeGrowth:
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
    """

    def __init__(self, agent: str, tree: Tree, settings: SrtSettings, lidar: Lidar, body: float) -> None:
        self._agent, self._settings, self._lidar, self._body = agent, settings, lidar, body
        self.tree, self.known = tree, set[int]()
        self.perception = min(settings.perception, lidar.range_max)
        self.root = self.number = -1
        self.count = 0

    @property
    def node(self) -> Node:
        """The node where the robot is."""
        return self.tree.nodes[self.number]

    def plant(self, senses: Senses, memory: Memory) -> None:
        """Add the robot's first node."""
        self.root = self.add(senses, None, senses.pose, memory)

    def add(self, senses: Senses, parent: int | None, pose: NDArray[np.float64], memory: Memory) -> int:
        """Add a node where the robot is, and return its number."""
        view = view_of(senses.scan, self._lidar, float(senses.pose[2]))
        node = Node(
            len(self.tree.nodes), self._agent, np.array(pose), *self._regions(pose, view), parent, view
        )
        self._insert(node, memory)
        return node.number

    def add_if_apart(self, senses: Senses, memory: Memory) -> None:
        """Add a node where the robot is, unless that is where its last one lies."""
        if senses.distance_to(self.node.place) >= NEW_NODE:
            self.add(senses, self.number, senses.pose, memory)

    def widen_view(self, senses: Senses) -> None:
        """Let the node where the robot is know what its scan shows, too."""
        node = self.node
        view = joined_views(node.view, view_of(senses.scan, self._lidar, float(senses.pose[2])))
        node.view = view
        node.safe, node.seen, node.openings = self._regions(node.pose, view)

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

    def _regions(
        self, pose: NDArray[np.float64], view: NDArray[np.float64]
    ) -> tuple[SafeRegion, SafeRegion, list[Opening]]:
        """Return where the robot is safe, what it has seen, and the openings, of a view."""
        settings, place = self._settings, np.array(pose[:2])
        safe = safe_region(
            place, view, float(pose[2]), settings.shape, self._body, self.perception, settings.turn_room
        )
        openings = openings_of(place, view, self.perception, self._body, with_blind=settings.memory == "map")
        return safe, seen_region(place, view, self.perception), openings
