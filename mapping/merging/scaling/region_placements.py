"""Placements of a map that may have to grow, proposed by regions of like shapes."""

import numpy as np

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.alignment import distinct
from lidarium.mapping.merging.bend.hypotheses import LOOSE
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.regions.graph import find_regions, turned
from lidarium.mapping.merging.regions.proposals import by_growing_regions
from lidarium.mapping.merging.regions.settings import RegionSettings
from lidarium.mapping.merging.scaling.scale_search import Placement, ScaleSettings
from lidarium.mapping.merging.wall_alignment import rank_by_walls

_SAMPLES = 400
"""Number of wall cells by which placements are ranked."""


def region_placements(
    a: DescribedMap, b: DescribedMap, settings: RegionSettings, scaling: ScaleSettings
) -> list[Placement]:
    """Return the placements of map b under which regions meet, those for which most speaks first.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution with walls, as drawn.
    settings : RegionSettings
        Which regions may be the same.
    scaling : ScaleSettings
        By how much map b may grow.
    """
    graphs = [find_regions(one.levels, one.resolution, settings) for one in (a, b)]
    found = by_growing_regions(graphs[0], graphs[1], settings, (scaling.least, scaling.most))
    # Between what walls measure in the one map and in the other, as of all scales.
    values = rank_by_walls(a, b, found, _SAMPLES, LOOSE.hit_distance_m) * np.sqrt(found[:, 3])
    # Where the middle of the grown map's walls comes to lie.
    middle = found[:, 3:] * b.walls.mean(axis=0)
    places = found[:, :2] + turned(middle, found[:, 2])
    order = np.argsort(-values, kind="stable")
    apart = (scaling.apart_m, scaling.slant)
    kept: list[Placement] = []
    for k in distinct(np.column_stack([places, found[:, 2]]), order, np.zeros(2), settings.candidates, apart):
        x, y, theta, scale = found[k].tolist()
        kept.append(Placement(scale, Transform(x, y, theta), float(values[k]) * a.resolution))
    return kept
