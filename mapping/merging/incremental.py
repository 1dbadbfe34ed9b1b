"""Maps that grow, merged again and again: only what has changed is described, and transforms that were verified are not searched for.

A robot's map keeps its frame while it grows: its origin tells where the array's lower left corner lies in that frame.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.merger import Merged, joined_tree, placed
from lidarium.mapping.merging.pair import PairResult, described, merge_pair, verify_pair
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.occupancy import UNKNOWN
from lidarium.mapping.rigid import Transform


class GrowingMap(NamedTuple):
    """A robot's map as it is now.

    Attributes
    ----------
    levels : (rows, columns) uint8
        Occupancy, dark is occupied; row 0 at the lowest y.
    origin : (x, y)
        Lower left corner of cell (0, 0) in the robot's map frame [m].
    """

    levels: NDArray[np.uint8]
    origin: tuple[float, float] = (0.0, 0.0)


@dataclass(slots=True)
class _Tried:
    """What is known of a pair: its result, the robots' transform if it is verified, and what the maps knew when it was searched for."""

    result: PairResult
    frames: Transform | None
    known_m2: float


@dataclass(slots=True)
class IncrementalMerger:
    """Merges growing maps of one resolution.

    Parameters
    ----------
    resolution : float
        Side of a cell of all maps [m].
    settings : MergeSettings or None
        How; the defaults where None.
    search_growth_m2 : float
        A pair that was refused is searched for again when its maps together know so much more [m2].

    Attributes
    ----------
    searched, verified : int
        Pairs that the last update has searched for, and those whose transform it has verified once more.
    """

    resolution: float
    settings: MergeSettings = field(default_factory=MergeSettings)
    search_growth_m2: float = 2.0
    searched: int = 0
    verified: int = 0
    _maps: dict[str, GrowingMap] = field(default_factory=dict)
    _features: dict[str, DescribedMap] = field(default_factory=dict)
    _known_m2: dict[str, float] = field(default_factory=dict)
    _pairs: dict[tuple[str, str], _Tried] = field(default_factory=dict)
    _tree: FrameTree[str] | None = None

    def update(self, maps: Mapping[str, GrowingMap], may_try: frozenset[tuple[str, str]] | None = None) -> Merged:
        """Take in the maps as they are now.

        Parameters
        ----------
        maps : mapping of str to GrowingMap
            All of them, also those that have not changed; one that is missing is forgotten. Maps are kept, not copied.
        may_try : frozenset of (str, str) or None
            Pairs, in the order of the maps, whose robots can talk to each other now: the others keep what they had found. All where None.

        Returns
        -------
        Merged
            Pairs, frames and fused maps; frames stay where they are while maps grow.

        Raises
        ------
        ValueError
            Where there are no maps, or one is no map; what was known is kept then.
        """
        if not maps:
            raise ValueError("there are no maps to merge; want at least one")
        changed = self._describe(maps)
        self.searched = self.verified = 0
        pairs: dict[tuple[str, str], _Tried] = {}
        for pair in itertools.combinations(maps, 2):
            tried = self._pairs.get(pair)
            if tried is None or (changed & set(pair) and (may_try is None or pair in may_try)):
                tried = self._tried(pair, tried) if may_try is None or pair in may_try else tried
            if tried is not None:
                pairs[pair] = tried
        self._pairs = pairs
        results = {pair: tried.result for pair, tried in pairs.items()}
        origins = {name: one.origin for name, one in maps.items()}
        self._tree = joined_tree(self._features, results, self.settings, origins, self._tree)
        return Merged({name: one.levels for name, one in self._features.items()}, self.resolution, results, self._tree, origins)

    def _describe(self, maps: Mapping[str, GrowingMap]) -> set[str]:
        """Describe the maps that are new or have changed, and return their names."""
        changed = {name for name, one in maps.items() if not _is_same(self._maps.get(name), one)}
        fresh = {name: described(maps[name].levels, self.resolution, self.settings) for name in maps if name in changed}
        self._features = {name: fresh.get(name) or self._features[name] for name in maps}
        for name in changed:
            self._known_m2[name] = float(np.count_nonzero(self._features[name].levels != UNKNOWN)) * self.resolution**2
        self._maps = dict(maps)
        return changed

    def _tried(self, pair: tuple[str, str], before: _Tried | None) -> _Tried:
        """Verify the transform of a pair; search where there is none, or it is refused by now."""
        a, b = (self._features[name] for name in pair)
        first, second = (placed(self._maps[name].origin) for name in pair)
        known_m2 = sum(self._known_m2[name] for name in pair)
        if before is not None and before.frames is not None:
            result = verify_pair(a, b, first.inverse() @ before.frames @ second, self.settings)
            if result.is_accepted and result.a_from_b is not None:
                self.verified += 1
                return _Tried(result, first @ result.a_from_b @ second.inverse(), before.known_m2)
        elif before is not None and known_m2 < before.known_m2 + self.search_growth_m2:
            return before
        self.searched += 1
        result = merge_pair(a, b, self.settings)
        is_found = result.is_accepted and result.a_from_b is not None
        frames = first @ result.a_from_b @ second.inverse() if is_found and result.a_from_b is not None else None
        return _Tried(result, frames, known_m2)


def _is_same(before: GrowingMap | None, now: GrowingMap) -> bool:
    return before is not None and before.origin == now.origin and np.array_equal(before.levels, now.levels)
