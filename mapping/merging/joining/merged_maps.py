"""Maps that were merged: their pairs, frames and fused maps."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.deforming import Deformed, deform
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.description.described_map import describe_map
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.pair_result import PairResult


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
    origins : dict of str to (x, y)
        Lower left corner of cell (0, 0) of each map in its frame [m]; (0, 0) where a map is not named.
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

        Raises
        ------
        ValueError
            Where the maps are not joined with one another, or as `fuse` raises.
        """
        return fuse(
            [self.levels[name] for name in group],
            [self._into(group[0], name) for name in group],
            self.resolution,
        )

    def deformed(self, group: list[str], settings: BendSettings | None = None) -> Deformed:
        """Return the map of a group bent to agree, in the frame of its first map.

        Parameters
        ----------
        group : list of str
            Maps that are joined; the first is not bent.
        settings : BendSettings or None
            How much the others may be.

        Raises
        ------
        ValueError
            As `fused` does.
        """
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
