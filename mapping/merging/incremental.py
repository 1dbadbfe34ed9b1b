"""Incremental merging of maps that grow.

Only changed maps are described, and verified transforms are not searched for again.

A robot's map keeps its frame while it grows: its origin is where the array's lower left corner lies in
that frame. Two maps that know little can seem alike without being of one place. Who acts on a merge can ask
for a second finding: it is joined only when it is found once more, by a search of its own on maps that have
grown, where it was before.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.agreement import Confirmation
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.joining import Merged, joined_tree, placed
from lidarium.mapping.merging.pair import PairResult, described, merge_pair, verify_pair
from lidarium.mapping.merging.settings import MergeSettings


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
class _DescribedMaps:
    """The maps as they were last taken in, by name.

    Attributes
    ----------
    maps : dict of str to GrowingMap
        The maps themselves.
    features : dict of str to DescribedMap
        Settings of their descriptions.
    known_m2 : dict of str to float
        How much each knows [m2].
    changed_at : dict of str to int
        The number of the update in which each has changed last.
    """

    maps: dict[str, GrowingMap] = field(default_factory=dict)
    features: dict[str, DescribedMap] = field(default_factory=dict)
    known_m2: dict[str, float] = field(default_factory=dict)
    changed_at: dict[str, int] = field(default_factory=dict)

    def update(self, maps: Mapping[str, GrowingMap], resolution: float, settings: MergeSettings, number: int) -> None:
        """Take in all maps, and describe those that are new or have changed.

        Parameters
        ----------
        maps : mapping of str to GrowingMap
            As they are now; one that is missing is forgotten.
        resolution : float
            Side of a cell of all maps [m].
        settings : MergeSettings
            How they are described.
        number : int
            Of the update.
        """
        changed = {name for name, one in maps.items() if not _is_same(self.maps.get(name), one)}
        fresh = {name: described(maps[name].levels, resolution, settings) for name in maps if name in changed}
        self.features = {name: fresh.get(name) or self.features[name] for name in maps}
        for name in changed:
            self.known_m2[name] = float(np.count_nonzero(self.features[name].levels != UNKNOWN)) * resolution**2
            self.changed_at[name] = number
        self.maps = dict(maps)


def _is_same(before: GrowingMap | None, now: GrowingMap) -> bool:
    return before is not None and before.origin == now.origin and np.array_equal(before.levels, now.levels)


@dataclass(slots=True)
class _TriedPair:
    """Knowledge of a pair.

    Attributes
    ----------
    result : PairResult
        Result of the last try.
    frames : Transform or None
        The robots' transform, if it is verified.
    known_m2 : float
        Known areas of the maps when it was searched for [m2].
    is_confirmed : bool
        Whether it has been found as often as is wanted.
    at : int
        The number of the update that tried it last.
    corner : Transform
        Where the lower left corner of the first map was in its frame then.
    """

    result: PairResult
    frames: Transform | None
    known_m2: float
    is_confirmed: bool = False
    at: int = 0
    corner: Transform = field(default_factory=Transform)


CONFIRMED_M, CONFIRMED_ANGLE = 0.1, math.radians(1.0)
"""By how much two findings of one transform may differ [m, rad]."""


@dataclass(slots=True)
class IncrementalMerger:
    """Merges growing maps of one resolution.

    Parameters
    ----------
    resolution : float
        Side of a cell of all maps [m].
    settings : MergeSettings or None
        How; the defaults if None.
    search_growth_m2 : float
        A pair that was refused is searched for again when its maps together know so much more [m2].
    confirmation_growth_m2 : float or None
        A pair that was found joins its maps only when it is found once more, once they know so much more
        [m2]; at once if None.
    confirmation : Confirmation
        What the maps must say of a pair beside that when it joins them; by default what the settings ask of
        every pair.
    searches_per_update : int or None
        Most pairs that an update searches for, those first that wait to be confirmed, then those whose turn
        was longest ago; pairs that others join are only verified then. All if None. Verifying costs
        little: whatever has changed is verified.

    Attributes
    ----------
    searched, verified : int
        Pairs that the last update has searched for, and those whose transform it has verified once more.
    """

    resolution: float
    settings: MergeSettings = field(default_factory=MergeSettings)
    search_growth_m2: float = 2.0
    confirmation_growth_m2: float | None = None
    confirmation: Confirmation = field(default_factory=Confirmation)
    searches_per_update: int | None = None
    searched: int = 0
    verified: int = 0
    _described: _DescribedMaps = field(default_factory=_DescribedMaps)
    _pairs: dict[tuple[str, str], _TriedPair] = field(default_factory=dict)
    _tree: FrameTree[str] | None = None
    _updates: int = 0

    def update(
        self,
        maps: Mapping[str, GrowingMap],
        may_try: frozenset[tuple[str, str]] | None = None,
        *,
        may_search: bool = True,
    ) -> Merged:
        """Take in the maps as they are now.

        Parameters
        ----------
        maps : mapping of str to GrowingMap
            All of them, also those that have not changed; one that is missing is forgotten. Maps are kept,
            not copied.
        may_try : frozenset of (str, str) or None
            Pairs, in the order of the maps, whose robots can talk to each other now: the others keep what
            they had found. All if None.
        may_search : bool
            Whether there is time for searches; otherwise they wait for the next update, and what was found is
            verified alone.
        """
        if not maps:
            raise ValueError("there are no maps to merge; want at least one")
        self._updates += 1
        self._described.update(maps, self.resolution, self.settings, self._updates)
        self.searched = self.verified = 0
        every = list(itertools.combinations(maps, 2))
        most = self.searches_per_update if may_search else 0
        tried_now: dict[tuple[str, str], _TriedPair] = {}
        for pair in self._due([pair for pair in every if may_try is None or pair in may_try]):
            tried = self._tried(pair, self._pairs.get(pair), most is None or self.searched < most)
            if tried is not None:
                tried_now[pair] = tried
        pairs = {pair: tried for pair in every if (tried := tried_now.get(pair) or self._kept(pair)) is not None}
        self._pairs = pairs
        results = {pair: tried.result for pair, tried in pairs.items()}
        believed = {pair: tried.result for pair, tried in pairs.items() if tried.is_confirmed}
        origins = {name: one.origin for name, one in maps.items()}
        self._tree = joined_tree(self._described.features, believed, self.settings, origins, self._tree)
        return Merged(
            {name: one.levels for name, one in self._described.features.items()},
            self.resolution,
            results,
            self._tree,
            origins,
        )

    def _due(self, pairs: list[tuple[str, str]]) -> list[tuple[str, str]]:
        """Return the pairs that are to be verified or searched for next."""
        due = [pair for pair in pairs if self._has_grown(pair)]
        if self.searches_per_update is not None:
            due.sort(key=lambda pair: (not self._waits(pair), self._last_try(pair)))
        return due

    def _waits(self, pair: tuple[str, str]) -> bool:
        """Whether the result of a pair convinces, and is to be confirmed."""
        before = self._pairs.get(pair)
        return (
            before is not None
            and before.frames is not None
            and not before.is_confirmed
            and self._convinces(pair, before.result)
        )

    def _last_try(self, pair: tuple[str, str]) -> int:
        return self._pairs[pair].at if pair in self._pairs else 0

    def _has_grown(self, pair: tuple[str, str]) -> bool:
        """Whether maps have changed enough since a pair was last tried to retry it."""
        before = self._pairs.get(pair)
        if before is not None and max(self._described.changed_at[name] for name in pair) <= before.at:
            return False
        if before is not None and before.frames is not None:
            return True
        if self._implied(pair) is not None:
            return True
        return before is None or self._known_of(pair) >= before.known_m2 + self.search_growth_m2

    def _implied(self, pair: tuple[str, str]) -> Transform | None:
        """Return how the robots' frames lie by what joins them, None if nothing does."""
        tree = self._tree
        return tree.lookup(*pair) if tree is not None and set(pair) <= set(tree.names) else None

    def _known_of(self, pair: tuple[str, str]) -> float:
        return sum(self._described.known_m2[name] for name in pair)

    def _kept(self, pair: tuple[str, str]) -> _TriedPair | None:
        """Return the known result of a pair that is not tried now.

        It refers to the corners that the maps have now.
        """
        before = self._pairs.get(pair)
        if before is None or before.frames is None:
            return before
        first, second = (placed(self._described.maps[name].origin) for name in pair)
        a_from_b = first.inverse() @ before.frames @ second
        if before.result.a_from_b == a_from_b or before.result.a_from_b is None:
            return before
        # The middle of the overlap stays where it is on map a.
        centre = a_from_b.inverse().apply(
            (first.inverse() @ before.corner).apply(before.result.a_from_b.apply(before.result.agreement.centre))
        )
        agreement = replace(before.result.agreement, centre=(float(centre[0]), float(centre[1])))
        return replace(before, result=replace(before.result, a_from_b=a_from_b, agreement=agreement), corner=first)

    def _tried(self, pair: tuple[str, str], before: _TriedPair | None, may_search: bool) -> _TriedPair | None:
        """Verify the transform of a pair.

        Search where there is none, or it is refused by now. None if that has to wait.
        """
        first, second = (placed(self._described.maps[name].origin) for name in pair)
        known_m2 = self._known_of(pair)
        if before is not None and before.frames is not None:
            kept = self._verified(pair, before, before.frames, may_search)
            if kept is not None:
                return kept
        elif (implied := self._implied(pair)) is not None:
            a, b = (self._described.features[name] for name in pair)
            # Others join these maps: where they agree so, they join each other as well, more exactly than a
            # chain of transforms.
            result = verify_pair(a, b, first.inverse() @ implied @ second, self.settings)
            if result.is_accepted and result.a_from_b is not None and self._convinces(pair, result):
                self.verified += 1
                return _TriedPair(
                    result, first @ result.a_from_b @ second.inverse(), known_m2, True, self._updates, first
                )
            if self.searches_per_update is not None:
                return None
            if before is not None and known_m2 < before.known_m2 + self.search_growth_m2:
                return None
        return self._searched(pair, before) if may_search else None

    def _verified(
        self, pair: tuple[str, str], before: _TriedPair, frames: Transform, may_search: bool
    ) -> _TriedPair | None:
        """Verify the last transform; None if it is searched for once more."""
        a, b = (self._described.features[name] for name in pair)
        first, second = (placed(self._described.maps[name].origin) for name in pair)
        known_m2 = self._known_of(pair)
        result = verify_pair(a, b, first.inverse() @ frames @ second, self.settings)
        if not result.is_accepted or result.a_from_b is None:
            return None if may_search else _TriedPair(result, None, -math.inf, False, before.at, first)
        is_due = not before.is_confirmed and self._may_be_better(pair, before, result, known_m2)
        if is_due and may_search:
            return None
        self.verified += 1
        refined = first @ result.a_from_b @ second.inverse()
        # A search that has to wait is due whether maps grow any more or not.
        at = before.at if is_due else self._updates
        return _TriedPair(result, refined, before.known_m2, before.is_confirmed, at, first)

    def _may_be_better(self, pair: tuple[str, str], before: _TriedPair, result: PairResult, known_m2: float) -> bool:
        """Whether a search may confirm the last transform, or find a convincing one otherwise."""
        if self._convinces(pair, result):
            return known_m2 >= before.known_m2 + (self.confirmation_growth_m2 or 0.0)
        return known_m2 >= before.known_m2 + self.search_growth_m2

    def _searched(self, pair: tuple[str, str], before: _TriedPair | None) -> _TriedPair:
        """Search for the transform of a pair."""
        a, b = (self._described.features[name] for name in pair)
        first, second = (placed(self._described.maps[name].origin) for name in pair)
        self.searched += 1
        result = merge_pair(a, b, self.settings)
        is_found = result.is_accepted and result.a_from_b is not None
        frames = first @ result.a_from_b @ second.inverse() if is_found and result.a_from_b is not None else None
        is_confirmed = self._confirms(pair, before, frames, result)
        return _TriedPair(result, frames, self._known_of(pair), is_confirmed, self._updates, first)

    def _confirms(
        self, pair: tuple[str, str], before: _TriedPair | None, frames: Transform | None, result: PairResult
    ) -> bool:
        """Whether the transform found by the search is accepted from now on."""
        if self.confirmation_growth_m2 is None:
            return self._convinces(pair, result)
        if (
            before is None
            or before.frames is None
            or frames is None
            or before.is_confirmed
            or not self._convinces(pair, result)
        ):
            return False
        at = placed(self._described.maps[pair[1]].origin).apply(result.agreement.centre)
        distance, angle = frames.difference(before.frames, at)
        return distance <= CONFIRMED_M and angle <= CONFIRMED_ANGLE

    def _convinces(self, pair: tuple[str, str], result: PairResult) -> bool:
        """Whether a pair may be confirmed."""
        a, b = (self._described.features[name] for name in pair)
        least_known_m2 = min(self._described.known_m2[name] for name in pair)
        return self.confirmation.convinces((a, b), least_known_m2, result.a_from_b, result.agreement)
