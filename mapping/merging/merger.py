"""Many maps: every pair is tried, and what is accepted and consistent becomes groups with one map each."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.merging.described_map import check_resolution, resampled, three_levels_of
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.pair import PairResult, described, merge_pair
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.rigid import Transform


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """What came of some maps.

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
    """

    levels: dict[str, NDArray[np.uint8]]
    resolution: float
    pairs: dict[tuple[str, str], PairResult]
    tree: FrameTree[str]

    def groups(self) -> list[list[str]]:
        """Return the names of the maps that are joined, the root of each group first; a map that joins none is a group of its own."""
        return self.tree.groups()

    def fused(self, group: list[str]) -> FusedMap:
        """Return the map of a group in the frame of its first; bit i of its sources is the group's map i.

        Raises
        ------
        ValueError
            Where the maps are not joined with one another, or as `fuse` raises.
        """
        return fuse([self.levels[name] for name in group], [self._into(group[0], name) for name in group], self.resolution)

    def _into(self, root: str, name: str) -> Transform:
        transform = self.tree.lookup(root, name)
        if transform is None:
            raise ValueError(f"map {name!r} is not joined with {root!r}; want maps of one group")
        return transform


def merge_maps(maps: Mapping[str, tuple[ArrayLike, float]], settings: MergeSettings | None = None) -> Merged:
    """Merge maps of robots that know nothing of each other's start.

    Parameters
    ----------
    maps : mapping of str to ((rows, columns) uint8, float)
        Occupancy (dark is occupied, row 0 at the lowest y) and side of a cell [m] of each map. Where the sides differ, all maps are
        brought to the coarsest.
    settings : MergeSettings or None
        How.

    Returns
    -------
    Merged
        Pairs, frames and fused maps.

    Raises
    ------
    ValueError
        Where there are no maps, or one is no map.
    """
    settings = settings or MergeSettings()
    if not maps:
        raise ValueError("there are no maps to merge; want at least one")
    levels, resolution = _alike(maps, settings)
    features = {name: described(grid, resolution, settings) for name, grid in levels.items()}
    tree: FrameTree[str] = FrameTree(settings.cycle_distance_m, settings.cycle_angle)
    for name in maps:
        tree.add_map(name)
    pairs = {(a, b): merge_pair(features[a], features[b], settings) for a, b in itertools.combinations(maps, 2)}
    for (a, b), result in pairs.items():
        if result.is_accepted and result.a_from_b is not None:
            tree.add_edge(Edge(a, b, result.a_from_b, _weight(result), result.agreement.centre))
    return Merged(levels, resolution, pairs, tree)


def _weight(result: PairResult) -> float:
    return result.agreement.evidence_m


def _alike(maps: Mapping[str, tuple[ArrayLike, float]], settings: MergeSettings) -> tuple[dict[str, NDArray[np.uint8]], float]:
    """Return the maps in three levels and in cells of one size, and that size."""
    for name, (_, resolution) in maps.items():
        try:
            check_resolution(resolution)
        except ValueError as error:
            raise ValueError(f"map {name!r}: {error}") from error
    coarsest = max(resolution for _, resolution in maps.values())
    levels = {}
    for name, (grid, resolution) in maps.items():
        try:
            levels[name] = resampled(three_levels_of(grid, settings.corners), resolution, coarsest)
        except ValueError as error:
            raise ValueError(f"map {name!r}: {error}") from error
    return levels, float(coarsest)
