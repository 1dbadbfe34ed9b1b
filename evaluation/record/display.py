"""What can be shown of an episode, whatever version recorded it.

It is paths, coverage, the team's map and events.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.map_deltas import levels_of_planes


@dataclass(frozen=True, slots=True, eq=False)
class MapChanges:
    """Changes of the team's three-level map from sample to sample.

    They begin with a map of which nothing is known.

    Two planes of bits hold the map, one of known and one of occupied cells; a word has 64 cells of a row, bit
    0 the first one.

    Attributes
    ----------
    rows, words : int
        Shape of the planes.
    times : (samples,) float64
        When the samples were taken, ascending [s].
    counts : (samples,) int64
        Number of words that each sample changed.
    places : (changes,) int64
        Which words, word of the row * rows + row, ascending within a sample; the samples one after the other.
    known, occupied : (changes,) uint64
        Which bits of the words flipped.
    """

    rows: int
    words: int
    times: NDArray[np.float64]
    counts: NDArray[np.int64]
    places: NDArray[np.int64]
    known: NDArray[np.uint64]
    occupied: NDArray[np.uint64]

    def levels_at(self, time_s: float) -> NDArray[np.uint8]:
        """Return the map of the last sample up to a time, shape (rows, words * 64).

        Values are 0 occupied, 127 unknown, 255 free.
        """
        samples = int(np.searchsorted(self.times, time_s + 1e-9, side="right"))
        changes = int(self.counts[:samples].sum())
        planes = np.zeros((2, self.rows * self.words), np.uint64)
        for plane, flipped in zip(planes, (self.known, self.occupied), strict=True):
            np.bitwise_xor.at(plane, self.places[:changes], flipped[:changes])
        known, occupied = planes.reshape(2, self.words, self.rows)
        return levels_of_planes(known.T, occupied.T)


@dataclass(frozen=True, slots=True, eq=False)
class DisplayTrack:
    """What of an episode can be shown whatever the version that recorded it.

    Attributes
    ----------
    times : (n,) float64
        When poses were sampled: five times a second, and at the end [s].
    poses : (n, robots, 3) float64
        True x, y, theta of each robot in the floor's frame, rounded to 1 mm and 1 mrad [m, rad].
    coverage : (m, 2) float64
        Time [s] and ``C_free`` from then on, at every change.
    origin : (x, y)
        Lower left corner of cell (0, 0) of the team's map in the floor's frame [m].
    resolution : float
        Side of a cell of the team's map [m].
    changes : MapChanges
        The team's map over time, every two seconds and at the end.
    events : list of dict
        Each with ``time_s``, ``kind``, ``agent`` and keys of its own, in order of time;
        docs/reference/files.md lists the kinds.
    """

    times: NDArray[np.float64]
    poses: NDArray[np.float64]
    coverage: NDArray[np.float64]
    origin: tuple[float, float]
    resolution: float
    changes: MapChanges
    events: list[dict[str, Any]]

    def map_at(self, time_s: float) -> NDArray[np.uint8]:
        """Return the team's map of the last sample up to a time.

        Values are 0 occupied, 127 unknown, 255 free; the shape is (rows, columns).
        """
        return self.changes.levels_at(time_s)

    def poses_at(self, time_s: float) -> NDArray[np.float64]:
        """Return the last sampled poses up to a time, shape (robots, 3).

        Before the first sample they are the poses of the start.
        """
        return np.asarray(
            self.poses[max(int(np.searchsorted(self.times, time_s + 1e-9, side="right")) - 1, 0)]
        )

    def coverage_at(self, time_s: float) -> float:
        """Return ``C_free`` at a time."""
        changes = int(np.searchsorted(self.coverage[:, 0], time_s + 1e-9, side="right"))
        return float(self.coverage[changes - 1, 1]) if changes else 0.0
