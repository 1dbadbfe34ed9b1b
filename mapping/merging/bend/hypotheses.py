"""Evidence for and against each transform of bent maps, and the confidence of the best one.

The confidence is that of a logistic model of maps of one place against strangers. It was fitted to maps of
real buildings; see the reference on merging for which, and for those kept for the figures.
"""

import math
from collections.abc import Sequence
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

MAX_STRAIN, MAX_STRAIN_OF_ROOMS = 0.06, 0.035
"""Most that a map is stretched against another of the same place, and if both know a few rooms alone: maps drift
on their way, and rooms of strangers bend until they fit."""

MAX_GROWTH, UNLIKE_SHARE = 0.015, 0.8
"""Growth that drift explains, and share of the bend from which on a larger one is of the scales."""

MAX_GROWTH_M = 0.25
"""Most that a growth may move walls in the root mean square [m]: those at the far end move about twice as much."""

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
    a: DescribedMap,
    b: DescribedMap,
    transforms: Sequence[Transform],
    settings: BendSettings,
    proposals: Sequence[Transform] = (),
) -> list[Hypothesis]:
    """Return the most promising transforms and all proposals with the bend under each, one of each place.

    That with most evidence is first.
    """
    loose = [compare(a, b, transform, LOOSE).evidence_m for transform in transforms]
    order = np.argsort(-np.array(loose), kind="stable")[: settings.candidates].tolist()
    found = [_bent(a, b, transform, settings) for transform in [*(transforms[k] for k in order), *proposals]]
    kept: list[Hypothesis] = []
    for one in sorted(found, key=lambda one: -one.evidence_m):
        if all(is_other(other, one) for other in kept):
            kept.append(one)
    if not kept:
        return []
    # Springs hold a map near the motion that it was bent from, so that an error of this one is bent into it:
    # of one place, what is stretched too far may be so by a bad start alone.
    again = _bent(a, b, kept[0].bend.a_from_b, settings)
    place = [one for one in [*found, again] if not is_other(kept[0], one)]
    return [max(place, key=lambda one: (one.bend.strain <= MAX_STRAIN, one.evidence_m)), *kept[1:]]


def _bent(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: BendSettings) -> Hypothesis:
    bend = estimate_bend(a, b, a_from_b, settings)
    return Hypothesis(bend, compare_bent(a, b, bend))


def is_other(one: Hypothesis, other: Hypothesis | Transform) -> bool:
    """Whether two hypotheses, or one and a rigid motion, are of different places."""
    transform = other if isinstance(other, Transform) else other.bend.a_from_b
    distance, angle = one.bend.a_from_b.difference(transform, one.agreement.centre)
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
    scale, growth_share, growth_m : float
        By how much the second map would have to grow, share of the bend that this explains, and how much
        that is [m].
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
    scale: float = 1.0
    growth_share: float = 0.0
    growth_m: float = 0.0


def signs_of(a: DescribedMap, b: DescribedMap, ranked: list[Hypothesis]) -> _Signs:
    """Return the features that distinguish the best of ranked hypotheses from chance."""
    best = ranked[0]
    evidence = max(best.evidence_m, 0.0)
    rival = next((one.evidence_m for one in ranked[1:] if is_other(best, one)), 0.0)
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
        best.bend.scale,
        best.bend.growth_share,
        best.bend.growth_m,
    )


def has_unlike_scale(scale: float, growth_share: float) -> bool:
    """Return whether maps differ by their scale, not by drift: this bends a map in more ways than one."""
    return abs(scale - 1.0) > MAX_GROWTH and growth_share > UNLIKE_SHARE


def confidence_of(signs: _Signs) -> float:
    """Return how sure it is that two maps are of one place, from 0 to 1.

    It is 0 if an overlap is no larger than rooms that are alike, if another place explains the maps
    nearly as well, if one map would have to be stretched more than robots' maps are, and if much
    differs between sharp maps of a few rooms: in these, only furniture may.
    """
    if _objection(signs) is not None:
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


def why_unsure(signs: _Signs, wanted: float) -> str:
    """Return why bent maps are refused; ``wanted`` is the confidence from which they are joined."""
    objection = _objection(signs)
    if objection is not None:
        return objection
    confidence = confidence_of(signs)
    if confidence < wanted <= 1.0:
        return f"contradiction: the confidence is {confidence:.2f}, want {wanted:g}"
    return "contradiction: the maps agree only once they are bent"


def _objection(signs: _Signs) -> str | None:
    """Return what excludes a hypothesis whatever else speaks for it, None if nothing does."""
    if signs.rival_share > MAX_RIVAL_SHARE:
        percent, most = 100.0 * signs.rival_share, 100.0 * MAX_RIVAL_SHARE
        return f"ambiguous: another place explains {percent:.0f} % as much, at most {most:.0f} % may"
    if signs.overlap_m2 < MIN_OVERLAP_M2:
        return f"small overlap: {signs.overlap_m2:.1f} m2 known in both once they are bent, want {MIN_OVERLAP_M2:g}"
    if signs.evidence_m < MIN_EVIDENCE_M:
        return f"small overlap: {signs.evidence_m:.1f} m of walls speak for it, want {MIN_EVIDENCE_M:g}"
    if has_unlike_scale(signs.scale, signs.growth_share) and signs.growth_m > MAX_GROWTH_M:
        return f"unlike scales: the second map would have to grow about {signs.scale:.3f} times"
    most_strain = MAX_STRAIN if signs.overlap_m2 >= FEW_ROOMS_M2 else MAX_STRAIN_OF_ROOMS
    if signs.strain > most_strain:
        percent, most = 100.0 * signs.strain, 100.0 * most_strain
        return f"contradiction: one map would be stretched by {percent:.1f} %, want at most {most:g} %"
    is_sharp = signs.spread_m < SHARP_SPREAD_M and signs.overlap_m2 < FEW_ROOMS_M2
    if is_sharp and signs.quality < SHARP_QUALITY:
        percent, least = 100.0 * signs.quality, 100.0 * SHARP_QUALITY
        return f"contradiction: {percent:.0f} % of the walls of sharp maps speak for it, want {least:.0f} %"
    return None
