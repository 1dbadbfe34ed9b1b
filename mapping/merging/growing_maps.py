"""Maps of robots that grow, described as far as they have changed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.pair import PairResult, described
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
class DescribedMaps:
    """The maps as they were last taken in, by name.

    Attributes
    ----------
    maps : dict of str to GrowingMap
        The maps themselves.
    features : dict of str to DescribedMap
        What they are described by.
    known_m2 : dict of str to float
        How much each knows [m2].
    changed_at : dict of str to int
        The number of the update in which each has changed last.
    """

    maps: dict[str, GrowingMap] = field(default_factory=dict)
    features: dict[str, DescribedMap] = field(default_factory=dict)
    known_m2: dict[str, float] = field(default_factory=dict)
    changed_at: dict[str, int] = field(default_factory=dict)

    def update(
        self, maps: Mapping[str, GrowingMap], resolution: float, settings: MergeSettings, number: int
    ) -> None:
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

        Raises
        ------
        ValueError
            Where one is no map; what was known is kept then.
        """
        changed = {name for name, one in maps.items() if not _is_same(self.maps.get(name), one)}
        fresh = {name: described(maps[name].levels, resolution, settings) for name in maps if name in changed}
        self.features = {name: fresh.get(name) or self.features[name] for name in maps}
        for name in changed:
            self.known_m2[name] = (
                float(np.count_nonzero(self.features[name].levels != UNKNOWN)) * resolution**2
            )
            self.changed_at[name] = number
        self.maps = dict(maps)


def _is_same(before: GrowingMap | None, now: GrowingMap) -> bool:
    return before is not None and before.origin == now.origin and np.array_equal(before.levels, now.levels)


@dataclass(slots=True)
class TriedPair:
    """What is known of a pair.

    Attributes
    ----------
    result : PairResult
        What came of the last try.
    frames : Transform or None
        The robots' transform, if it is verified.
    known_m2 : float
        What the maps knew when it was searched for [m2].
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
