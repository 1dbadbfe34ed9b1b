"""The frame tree of some maps, made of the pairs that were accepted."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.deforming import Deformed, deform
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.bend.hypotheses import agrees_bent
from lidarium.mapping.merging.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.pair import PairResult, is_contradicted
from lidarium.mapping.merging.settings import MergeSettings


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Result of merging maps.

    Attributes
    ----------
    levels : dict of str to (rows, columns) uint8
        The maps as they were compared, in three levels and in cells of one size.
    resolution : float
        That size, the coarsest of the maps' [m].
    pairs : dict of (str, str) to PairResult
        Every pair, in the order in which the maps were given.
    tree : FrameTree
        The maps' frames. What is accepted as a pair and contradicts stronger pairs is among ``tree.dropped``.
    origins : dict of str to (x, y)
        Lower left corner of cell (0, 0) of each map in its frame [m]; (0, 0) if a map is not named.
    """

    levels: dict[str, NDArray[np.uint8]]
    resolution: float
    pairs: dict[tuple[str, str], PairResult]
    tree: FrameTree[str]
    origins: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def groups(self) -> list[list[str]]:
        """Return the names of the maps that are joined, the root of each group first.

        A map that joins none is a group of its own.
        """
        return self.tree.groups()

    def fused(self, group: list[str]) -> FusedMap:
        """Return the map of a group in the frame of its first.

        Bit i of its sources is the group's map i.
        """
        return fuse(
            [self.levels[name] for name in group],
            [self._into(group[0], name) for name in group],
            self.resolution,
        )

    def deformed(self, group: list[str], settings: BendSettings | None = None) -> Deformed:
        """Return the map of a group bent to agree, in the frame of its first map."""
        maps = [describe_map(self.levels[name], self.resolution) for name in group]
        transforms = [self._into(group[0], name) for name in group]
        return deform(maps, transforms, settings or BendSettings())

    def _into(self, root: str, name: str) -> Transform:
        """Return the transform from a map's lower left corner into another's frame.

        The other frame is that of a map.
        """
        transform = self.tree.lookup(root, name)
        if transform is None:
            raise ValueError(f"map {name!r} is not joined with {root!r}; want maps of one group")
        return transform @ placed(self.origins.get(name, (0.0, 0.0)))


def placed(origin: tuple[float, float]) -> Transform:
    """Return the transform from a map's lower left corner into its frame."""
    return Transform(float(origin[0]), float(origin[1]), 0.0)


def joined_tree(
    features: Mapping[str, DescribedMap],
    pairs: Mapping[tuple[str, str], PairResult],
    settings: MergeSettings,
    origins: Mapping[str, tuple[float, float]] | None = None,
    tree: FrameTree[str] | None = None,
) -> FrameTree[str]:
    """Join maps by their accepted pairs.

    Maps that are joined through others alone must not contradict each other either: else the weakest pair
    between them is dropped.

    Parameters
    ----------
    features : mapping of str to DescribedMap
        The maps.
    pairs : mapping of (str, str) to PairResult
        Result of each pair, from lower left corner to lower left corner.
    settings : MergeSettings
        Contradictions.
    origins : mapping of str to (x, y) or None
        Lower left corner of each map in its frame [m]; (0, 0) for all if None.
    tree : FrameTree or None
        Of an earlier call, whose world shall stay where it is; it is changed. A new one if None.
    """
    tree = tree or FrameTree(settings.cycle_distance_m, settings.cycle_angle)
    for name in tree.names:
        if name not in features:
            tree.remove_map(name)
    for name in features:
        tree.add_map(name)
    frames = {name: placed((origins or {}).get(name, (0.0, 0.0))) for name in features}
    edges = []
    for (a, b), result in pairs.items():
        if result.is_accepted and result.a_from_b is not None:
            centre = frames[b].apply(result.agreement.centre)
            a_from_b = frames[a] @ result.a_from_b @ frames[b].inverse()
            edges.append(pair_edge(a, b, result, a_from_b, (float(centre[0]), float(centre[1]))))
    are_bent = any(edge.slack_m > 0.0 for edge in edges)

    def contradicts(a: str, b: str, a_from_b: Transform) -> bool:
        implied = frames[a].inverse() @ a_from_b @ frames[b]
        if not is_contradicted(features[a], features[b], implied, settings):
            return False
        return not (are_bent and agrees_bent(features[a], features[b], implied, settings.bend))

    tree.set_edges(edges, contradicts)
    return tree


def pair_edge(a: str, b: str, result: PairResult, a_from_b: Transform, centre: tuple[float, float]) -> Edge[str]:
    """Return the edge of an accepted pair; bent maps may miss each other by their bend around cycles."""
    if result.found_by != "bend" or not result.ranked:
        return Edge(a, b, a_from_b, result.agreement.evidence_m, centre)
    best = result.ranked[0]
    return Edge(a, b, a_from_b, best.evidence_m, centre, 2.0 * best.bend.bend_m)
