"""Evidence for and against each transform of bent maps, and the confidence of the best one.

The confidence is that of a logistic model of maps of one place against strangers. It was fitted to maps of
real buildings; see the reference on merging for which, and for those kept for the figures.
"""

import math
from typing import NamedTuple

import numpy as np

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement import (
    Agreement,
    ValidationSettings,
    WallField,
    agreement_of,
    compare,
    count_walls,
)
from lidarium.mapping.merging.bend.estimation import Bend, BendSettings, estimate_bend
from lidarium.mapping.merging.described_map import DescribedMap

SHARP_M, BLUNT_M = 0.075, 0.15
"""Least and greatest distance at which walls agree [m]: half of a thin wall's thickness, and all of it."""

SPREADS = 2.5
"""Walls agree within this number of standard deviations of the gaps that a bend leaves."""


def _tolerance(bend: Bend, resolution: float) -> tuple[float, float]:
    """Return at which distance walls agree, and beyond which they contradict [m].

    Both follow from the spread of the gaps that the bend has left.
    """
    hit = max(min(max(SHARP_M, SPREADS * bend.spread_m), BLUNT_M), 1.5 * resolution)
    return hit, max(2.0 * hit + 0.025, 2.5 * resolution)


def compare_bent(a: DescribedMap, b: DescribedMap, bend: Bend) -> Agreement:
    """Lay map b over map a and bend it."""
    hit, miss = _tolerance(bend, a.resolution)
    walls, facing = np.zeros((2, 3), np.int64), np.zeros((2, 3))
    turn = Transform(0.0, 0.0, bend.a_from_b.theta)
    laid = (
        (a, bend.field.bent(bend.a_from_b, b.walls), turn.apply(b.normals)),
        (b, bend.field.unbent(bend.a_from_b, a.walls), turn.inverse().apply(a.normals)),
    )
    for k, (under, positions, normals) in enumerate(laid):
        field = WallField(under.levels, under.distance, under.is_open, 1.0 / under.resolution, hit, miss)
        count_walls(field, positions, normals, (0.0, 0.0, 0.0), walls[k], facing[k])
    return agreement_of(a, b, bend.a_from_b, walls, facing)


LOOSE = ValidationSettings(hit_distance_m=0.3, miss_distance_m=0.6)
"""Tolerance with which transforms are chosen that are worth bending: bends of halls are not longer."""

MIN_OVERLAP_M2, MIN_EVIDENCE_M, MAX_RIVAL_SHARE = 15.0, 4.0, 0.6
"""Overlap of a room, which is like others [m2], least evidence [m], and most that a rival may have."""

MAX_STRAIN = 0.05
"""Most that a map is stretched against another of the same place."""

SHARP_SPREAD_M, FEW_ROOMS_M2, SHARP_QUALITY = 0.035, 60.0, 0.9
"""Spread of gaps of sharp maps [m], overlap of a few rooms [m2], and their least quality."""

WEIGHTS = (-11.308, 1.034, -1.06, -2.6, 3.195, 2.35, 1.4, -1.655)
"""Weights of the logistic model: of 1, of the logarithms of evidence and of one less the quality, of the
rival's share, and of the logarithms of overlap, evidence over extent, `Signs.across_m` and contradiction."""

RIVAL_M, RIVAL_ANGLE = 1.0, math.radians(8.0)
"""Hypotheses that differ by more are of different places [m, rad]; by less, bends make them one."""


class Hypothesis(NamedTuple):
    """A transform, the bend of the map under it, and the evidence of the maps.

    Attributes
    ----------
    bend : Bend
        Rigid motion and bend.
    agreement : Agreement
        Agreement once the map is bent.
    """

    bend: Bend
    agreement: Agreement

    @property
    def evidence_m(self) -> float:
        """Length of walls that agree, less half of those that do not and of those that contradict [m].

        A wall that contradicts is among both.
        """
        found = self.agreement
        return found.agreeing_m - 0.5 * (found.wall_m - found.agreeing_m) - 0.5 * found.contradicting_m


def ranked_hypotheses(
    a: DescribedMap, b: DescribedMap, transforms: list[Transform], settings: BendSettings
) -> list[Hypothesis]:
    """Return the most promising transforms with the bend under each, that with most evidence first."""
    loose = [compare(a, b, transform, LOOSE).evidence_m for transform in transforms]
    order = np.argsort(-np.array(loose), kind="stable")[: settings.candidates].tolist()
    found = [_bent(a, b, transforms[k], settings) for k in order]
    return sorted(found, key=lambda one: -one.evidence_m)


def _bent(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: BendSettings) -> Hypothesis:
    bend = estimate_bend(a, b, a_from_b, settings)
    return Hypothesis(bend, compare_bent(a, b, bend))


def _is_other(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether two hypotheses are of different places."""
    distance, angle = one.bend.a_from_b.difference(other.bend.a_from_b, one.agreement.centre)
    return distance > RIVAL_M or angle > RIVAL_ANGLE


def agrees_bent(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: BendSettings) -> bool:
    """Return whether maps that others join agree once they are bent, as most cells known to both do."""
    bent = _bent(a, b, a_from_b, settings)
    return bent.agreement.wall_m == 0.0 or bent.evidence_m > 0.0


class _Signs(NamedTuple):
    """Features that distinguish maps of one place from strangers.

    Attributes
    ----------
    evidence_m : float
        Evidence of the best hypothesis [m].
    quality : float
        The same as a share of the walls that agree.
    overlap_m2 : float
        Area that both know [m2].
    across_m : float
        Length of walls that hold the maps in the direction in which they are held least [m].
    rival_share : float
        Evidence of the best hypothesis of another place, as a share.
    extent_m : float
        Geometric mean of the lengths of wall of both maps: longer ones offer more places that are alike [m].
    contradicting_m : float
        Length of walls in the free space of the other map, the sum of both maps [m].
    strain : float
        By how much of the distance one map is stretched or sheared against the other.
    spread_m : float
        Spread of the gaps between walls that the bend leaves [m].
    """

    evidence_m: float
    quality: float
    overlap_m2: float
    across_m: float
    rival_share: float
    extent_m: float
    contradicting_m: float
    strain: float
    spread_m: float


def signs_of(a: DescribedMap, b: DescribedMap, ranked: list[Hypothesis]) -> _Signs:
    """Return the features that distinguish the best of ranked hypotheses from chance."""
    best = ranked[0]
    evidence = max(best.evidence_m, 0.0)
    rival = next((one.evidence_m for one in ranked[1:] if _is_other(best, one)), 0.0)
    return _Signs(
        evidence,
        evidence / max(best.agreement.agreeing_m, 1e-9),
        best.agreement.overlap_m2,
        best.agreement.across_m,
        min(max(rival, 0.0) / max(evidence, 1e-9), 1.0),
        a.resolution * math.sqrt(len(a.walls) * len(b.walls)),
        best.agreement.contradicting_m,
        best.bend.strain,
        best.bend.spread_m,
    )


def confidence_of(signs: _Signs) -> float:
    """Return how sure it is that two maps are of one place, from 0 to 1.

    It is 0 if an overlap is no larger than rooms that are alike, if another place explains the maps
    nearly as well, if one map would have to be stretched more than robots' maps are, and if much
    differs between sharp maps of a few rooms: in these, only furniture may.
    """
    is_sharp = signs.spread_m < SHARP_SPREAD_M and signs.overlap_m2 < FEW_ROOMS_M2
    if (
        signs.overlap_m2 < MIN_OVERLAP_M2
        or signs.evidence_m < MIN_EVIDENCE_M
        or signs.rival_share > MAX_RIVAL_SHARE
        or signs.strain > MAX_STRAIN
        or (is_sharp and signs.quality < SHARP_QUALITY)
    ):
        return 0.0
    known = (
        1.0,
        math.log(signs.evidence_m),
        math.log(max(1.0 - signs.quality, 0.01)),
        signs.rival_share,
        math.log(signs.overlap_m2),
        math.log(signs.evidence_m / signs.extent_m),
        math.log(max(signs.across_m, 0.1)),
        math.log(0.3 + signs.contradicting_m),
    )
    total = sum(weight * value for weight, value in zip(WEIGHTS, known, strict=True))
    return 1.0 / (1.0 + math.exp(-min(max(total, -50.0), 50.0)))
