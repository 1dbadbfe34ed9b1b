"""Motions under which a region or a door of one map meets one of another.

Two regions of like extents lie on each other at four quarter turns, by their middles. If they are alike
along one axis alone, as a room that one robot saw in part, the ends of the other axis are brought together.
Two doors of like widths lie on each other in both directions.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.merging.regions.graph import Doors, RegionGraph, turned
from lidarium.mapping.merging.regions.segmentation import RegionSettings

QUARTER = math.pi / 2.0

SCALE_STEP = 0.03
"""Between the logarithms of scales that are proposed beside each other."""


class _BoxPairs(NamedTuple):
    """Boxes of every region of map a and of every one of map b, the latter by a quarter turn or more.

    Attributes
    ----------
    low, high : (2, n, 2) float64
        Their ends: of the region of a, and of that of b, each along its own axis [m].
    axes : (2, n) float64
        Directions of these axes in their maps [rad], that of b turned back by the quarters.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    axes: NDArray[np.float64]

    @property
    def extents(self) -> NDArray[np.float64]:
        """Lengths of both boxes along each axis, (2, n, 2) [m]."""
        return self.high - self.low

    @property
    def rotations(self) -> NDArray[np.float64]:
        """The rotation of b under which the boxes have one axis, (n,) [rad]."""
        return np.asarray(self.axes[0] - self.axes[1])


def propose_motions(a: RegionGraph, b: RegionGraph, settings: RegionSettings) -> NDArray[np.float64]:
    """Return the motions under which regions or doors of two maps meet.

    Parameters
    ----------
    a, b : RegionGraph
        Of both maps.
    settings : RegionSettings
        Which may be the same.

    Returns
    -------
    (n, 3) float64
        x, y [m] and theta [rad] of ``a_from_b``.
    """
    return np.concatenate([_by_regions(a, b, settings), _by_doors(a.doors, b.doors, settings)])


def _by_regions(a: RegionGraph, b: RegionGraph, settings: RegionSettings) -> NDArray[np.float64]:
    """Return the motions (n, 3) under which regions of like extents meet, as `propose_motions`."""
    pairs = _box_pairs(a, b, settings.most_regions)
    extents = pairs.extents
    bound = np.maximum(settings.extent_m, settings.extent_share * extents.max(axis=0))
    alike = np.abs(extents[0] - extents[1]) <= bound
    at_low, at_high = pairs.low[0] - pairs.low[1], pairs.high[0] - pairs.high[1]
    options = ((alike, 0.5 * (at_low + at_high)), (~alike, at_low), (~alike, at_high))
    found = [np.zeros((0, 3))]
    for (along, x), (across, y) in itertools.product(options, options):
        chosen = along[:, 0] & across[:, 1] & alike.any(axis=1)
        shifts = turned(np.column_stack([x[:, 0], y[:, 1]])[chosen], pairs.axes[0][chosen])
        found.append(np.column_stack([shifts, pairs.rotations[chosen]]))
    return np.concatenate(found)


def by_growing_regions(
    a: RegionGraph, b: RegionGraph, settings: RegionSettings, scales: tuple[float, float]
) -> NDArray[np.float64]:
    """Return the similarities under which regions of like shapes meet.

    Parameters
    ----------
    a, b : RegionGraph
        Of both maps.
    settings : RegionSettings
        Which shapes are alike.
    scales : (least, most)
        By how much map b may grow.

    Returns
    -------
    (n, 4) float64
        x, y [m] and theta [rad] of ``a_from_b`` of the grown map, and by how much it grows.
    """
    pairs = _box_pairs(a, b, settings.most_regions)
    ratios = np.log(np.maximum(pairs.extents[0], 1e-9) / np.maximum(pairs.extents[1], 1e-9))
    alike = np.flatnonzero(np.abs(ratios[:, 0] - ratios[:, 1]) <= settings.scale_share)
    # What was seen of a room in part has other extents: scales beside are proposed about the same middle.
    steps = SCALE_STEP * np.arange(-settings.scale_steps, settings.scale_steps + 1)
    growth = np.exp(ratios[alike].mean(axis=1)[:, None] + steps).ravel()
    pair = np.repeat(alike, len(steps))
    is_allowed = (growth >= scales[0]) & (growth <= scales[1])
    pair, growth = pair[is_allowed], growth[is_allowed]
    middles = 0.5 * (pairs.low + pairs.high)[:, pair]
    shifts = turned(middles[0] - growth[:, None] * middles[1], pairs.axes[0][pair])
    return np.column_stack([shifts, pairs.rotations[pair], growth])


def _by_doors(a: Doors, b: Doors, settings: RegionSettings) -> NDArray[np.float64]:
    """Return the motions (n, 3) under which doors of like widths meet, as `propose_motions`."""
    first, second = (np.argsort(-one.widths, kind="stable")[: settings.most_doors] for one in (a, b))
    i, j = (pairs.ravel() for pairs in np.meshgrid(first, second, indexing="ij"))
    alike = np.abs(a.widths[i] - b.widths[j]) <= settings.door_width_m
    i, j = np.tile(i[alike], 2), np.tile(j[alike], 2)
    rotations = a.normals[i] - b.normals[j]
    rotations[len(rotations) // 2 :] += math.pi
    return np.column_stack([a.places[i] - turned(b.places[j], rotations), rotations])


def _box_pairs(a: RegionGraph, b: RegionGraph, most: int) -> _BoxPairs:
    """Return each of the largest regions of map a with each of map b, at four quarter turns."""
    first, second = (np.argsort(-one.areas, kind="stable")[:most] for one in (a, b))
    low, high, axes = [], [], []
    for quarter in range(4):
        turn = np.full(len(second), quarter * QUARTER)
        ends = np.stack([turned(box[second], turn) for box in (b.low, b.high)])
        i, j = (pairs.ravel() for pairs in np.meshgrid(first, np.arange(len(second)), indexing="ij"))
        low.append(np.stack([a.low[i], ends.min(axis=0)[j]]))
        high.append(np.stack([a.high[i], ends.max(axis=0)[j]]))
        axes.append(np.stack([a.axes[i], (b.axes[second] - turn)[j]]))
    return _BoxPairs(*(np.concatenate(parts, axis=1) for parts in (low, high, axes)))
