"""How two maps agree once one of them is bent onto the other."""

import numpy as np

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.counts import WallField, count_walls
from lidarium.mapping.merging.agreement.validation import Agreement, agreement_of
from lidarium.mapping.merging.bend.estimation import Bend
from lidarium.mapping.merging.description.described_map import DescribedMap

SHARP_M, BLUNT_M = 0.075, 0.15
"""Least and greatest distance at which walls agree [m]: half of a thin wall's thickness, and all of it."""

SPREADS = 2.5
"""So many standard deviations of the gaps that a bend leaves, walls agree."""


def tolerance(bend: Bend, resolution: float) -> tuple[float, float]:
    """Return at which distance walls agree, and beyond which they contradict [m].

    Both follow from the spread of the gaps that the bend has left.
    """
    hit = max(min(max(SHARP_M, SPREADS * bend.spread_m), BLUNT_M), 1.5 * resolution)
    return hit, max(2.0 * hit + 0.025, 2.5 * resolution)


def compare_bent(a: DescribedMap, b: DescribedMap, bend: Bend) -> Agreement:
    """Lay map b over map a and bend it.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    bend : Bend
        How b lies and is bent.

    Returns
    -------
    Agreement
        What agrees and what does not, within the tolerance of the bend.
    """
    hit, miss = tolerance(bend, a.resolution)
    walls, facing = np.zeros((2, 3), np.int64), np.zeros((2, 3))
    turn = Transform(0.0, 0.0, bend.a_from_b.theta)
    laid = (
        (a, bend.field.bent(bend.a_from_b, b.walls), turn.apply(b.normals)),
        (b, bend.field.unbent(bend.a_from_b, a.walls), turn.inverse().apply(a.normals)),
    )
    for k, (under, places, normals) in enumerate(laid):
        field = WallField(under.levels, under.distance, under.is_open, 1.0 / under.resolution, hit, miss)
        count_walls(field, places, normals, (0.0, 0.0, 0.0), walls[k], facing[k])
    return agreement_of(a, b, bend.a_from_b, walls, facing)
