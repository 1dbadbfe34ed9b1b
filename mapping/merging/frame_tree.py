"""Common frames of maps that were joined in pairs, by the best forest of transforms.

Maps are nodes, accepted transforms edges. Of each group of joined maps one is the root; the world's frame is
that of the root of the group that was there first, and stays where it is while others join.
"""

import math
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from itertools import combinations
from typing import Generic, TypeVar

from lidarium.mapping.geometry.rigid import Transform

Name = TypeVar("Name", bound=Hashable)

BEND_LENGTH_M = 10.0
"""Over such a length a bend turns a map by its offset [m]."""


@dataclass(frozen=True, slots=True)
class Edge(Generic[Name]):
    """A transform between two maps.

    Attributes
    ----------
    a, b : hashable
        Names of the maps.
    a_from_b : Transform
        Maps points of b into a.
    weight : float
        How much speaks for it; edges of more weight are kept before others.
    centre : (x, y)
        Middle of the overlap, in map b [m]; distances around cycles are taken there.
    slack_m : float
        By how much more than others it may be off, as maps are bent [m].
    """

    a: Name
    b: Name
    a_from_b: Transform
    weight: float
    centre: tuple[float, float] = (0.0, 0.0)
    slack_m: float = 0.0


@dataclass(slots=True)
class FrameTree(Generic[Name]):
    """Maps and the transforms between them.

    Attributes
    ----------
    cycle_distance_m, cycle_angle : float
        By how much the transforms around a cycle may miss identity [m, rad]; else the cycle's weakest edge is
        dropped.
    """

    cycle_distance_m: float = 0.15
    cycle_angle: float = math.radians(3.0)
    _names: list[Name] = field(default_factory=list)
    _edges: dict[frozenset[Name], Edge[Name]] = field(default_factory=dict)
    _roots: list[Name] = field(default_factory=list)
    _seniors: list[Name] = field(default_factory=list)
    _tree: dict[Name, dict[Name, Transform]] = field(default_factory=dict)
    _dropped: list[Edge[Name]] = field(default_factory=list)

    @property
    def names(self) -> list[Name]:
        """Maps in the order in which they came."""
        return list(self._names)

    @property
    def dropped(self) -> list[Edge[Name]]:
        """Edges that contradict stronger ones, and are not used."""
        return list(self._dropped)

    @property
    def edges(self) -> list[Edge[Name]]:
        """Edges that contradict none, whether or not the forest needs them."""
        return [edge for edge in self._edges.values() if edge not in self._dropped]

    def has_edge(self, a: Name, b: Name) -> bool:
        """Return whether an edge that contradicts none joins two maps directly.

        No other maps need lie between them.
        """
        edge = self._edges.get(frozenset((a, b)))
        return edge is not None and edge not in self._dropped

    def add_map(self, name: Name) -> None:
        """Add a map that is not joined with any yet."""
        if name not in self._tree:
            self._names.append(name)
            self._tree[name] = {}

    def add_edge(self, edge: Edge[Name]) -> None:
        """Add a transform between two maps.

        One between the same maps is replaced if the new one has more weight.
        """
        pair = self._admitted(edge)
        if pair not in self._edges or edge.weight > self._edges[pair].weight:
            self._edges[pair] = edge
            self._rebuild()

    def set_edges(
        self, edges: Iterable[Edge[Name]], contradicts: Callable[[Name, Name, Transform], bool] | None = None
    ) -> None:
        """Put transforms in the place of all that there were.

        The world stays where it is for as long as its root is joined with any map.
        """
        self._edges = {self._admitted(edge): edge for edge in edges}
        self._rebuild(contradicts)

    def remove_edge(self, a: Name, b: Name) -> None:
        """Take the transform between two maps away, if there is one."""
        if self._edges.pop(frozenset((a, b)), None) is not None:
            self._rebuild()

    def remove_map(self, name: Name) -> None:
        """Take a map and all of its transforms away, if there is one."""
        if name in self._tree:
            self._names.remove(name)
            del self._tree[name]
            self._edges = {pair: edge for pair, edge in self._edges.items() if name not in pair}
            self._seniors = [senior for senior in self._seniors if senior != name]
            self._rebuild()

    def _admitted(self, edge: Edge[Name]) -> frozenset[Name]:
        """Check an edge, add its maps, and return them."""
        if edge.a == edge.b:
            raise ValueError(f"an edge joins map {edge.a!r} with itself; want two maps")
        pose = edge.a_from_b
        if not all(map(math.isfinite, (pose.x, pose.y, pose.theta, edge.weight))):
            raise ValueError(f"the edge between {edge.a!r} and {edge.b!r} is {edge}; want finite numbers")
        self.add_map(edge.a)
        self.add_map(edge.b)
        return frozenset((edge.a, edge.b))

    def groups(self) -> list[list[Name]]:
        """Return the groups of maps that are joined with one another.

        Each group has its root first; the world's group comes first.
        """
        found, seen = [], set()
        for start in [*self._roots, *self._names]:
            if start not in seen:
                members = self._reached_from(start)
                seen |= set(members)
                found.append([start, *(name for name in self._names if name in members and name != start)])
        return found

    def lookup(self, target: Name, source: Name) -> Transform | None:
        """Return the transform that maps points of one map into another.

        None if they are not joined.
        """
        for name in (target, source):
            if name not in self._tree:
                raise ValueError(f"there is no map {name!r}; want one of {', '.join(map(repr, self._names))}")
        return self._reached_from(target).get(source)

    def pose_in(self, target: Name, source: Name, pose: Transform) -> Transform | None:
        """Return a robot's pose, known in its own map, in another map.

        None if they are not joined.
        """
        transform = self.lookup(target, source)
        return None if transform is None else transform @ pose

    def _reached_from(self, start: Name) -> dict[Name, Transform]:
        """Return the transform from each map of a group into one of its maps."""
        reached = {start: Transform()}
        waiting = [start]
        for name in waiting:
            for other, name_from_other in self._tree[name].items():
                if other not in reached:
                    reached[other] = reached[name] @ name_from_other
                    waiting.append(other)
        return reached

    def _rebuild(self, contradicts: Callable[[Name, Name, Transform], bool] | None = None) -> None:
        """Build the forest of most weight.

        Drop the weakest edge of each contradiction until none is left.
        """
        self._dropped = []
        while True:
            usable = [edge for edge in self._edges.values() if edge not in self._dropped]
            # Equal weights keep the order in which edges came.
            usable.sort(key=lambda edge: -edge.weight)
            left_over = self._grow(usable)
            worst = max(((self._misses(edge), edge) for edge in left_over), key=lambda one: one[0], default=None)
            if worst is not None and worst[0] > 1.0:
                # The forest has the most weight, so the edge outside of it is the weakest of its cycle.
                self._dropped.append(worst[1])
                continue
            culprit = None if contradicts is None else self._culprit(contradicts)
            if culprit is None:
                break
            self._dropped.append(culprit)
        self._settle_roots()

    def _culprit(self, contradicts: Callable[[Name, Name, Transform], bool]) -> Edge[Name] | None:
        """Return the weakest edge on the path between two contradicting maps.

        The forest overlays the two maps, and they contradict each other so.
        """
        for a, b in combinations(self._names, 2):
            way = self._way(a, b)
            if len(way) > 1 and frozenset((a, b)) not in self._edges and contradicts(a, b, self._reached_from(a)[b]):
                return min(way, key=lambda edge: edge.weight)
        return None

    def _way(self, a: Name, b: Name) -> list[Edge[Name]]:
        """Return the edges of the forest between two maps, none if they are not joined."""
        ways: dict[Name, list[Edge[Name]]] = {a: []}
        waiting = [a]
        for name in waiting:
            for other in self._tree[name]:
                if other not in ways:
                    ways[other] = [*ways[name], self._edges[frozenset((name, other))]]
                    waiting.append(other)
        return ways.get(b, [])

    def _grow(self, edges: Iterable[Edge[Name]]) -> list[Edge[Name]]:
        """Join maps by edges in turn.

        Return the edges between maps that were joined already.
        """
        self._tree = {name: {} for name in self._names}
        group = {name: {name} for name in self._names}
        left_over = []
        for edge in edges:
            if edge.b in group[edge.a]:
                left_over.append(edge)
                continue
            self._tree[edge.a][edge.b] = edge.a_from_b
            self._tree[edge.b][edge.a] = edge.a_from_b.inverse()
            joined = group[edge.a] | group[edge.b]
            for name in joined:
                group[name] = joined
        return left_over

    def _misses(self, edge: Edge[Name]) -> float:
        """Return an edge's deviation from the path through the forest.

        As a multiple of the limit.
        """
        through = self._reached_from(edge.a)[edge.b]
        distance, angle = through.difference(edge.a_from_b, edge.centre)
        slack_m = edge.slack_m + sum(one.slack_m for one in self._way(edge.a, edge.b))
        return max(distance / (self.cycle_distance_m + slack_m), angle / (self.cycle_angle + slack_m / BEND_LENGTH_M))

    def _settle_roots(self) -> None:
        """Keep the roots that there were, the oldest one if groups have become one.

        New groups get their first map.
        """
        roots: list[Name] = []
        taken: set[Name] = set()
        for name in [*self._seniors, *(name for name in self._names if self._tree[name])]:
            if name not in taken and self._tree[name]:
                roots.append(name)
                taken |= set(self._reached_from(name))
        self._seniors += [name for name in roots if name not in self._seniors]
        self._roots = roots
