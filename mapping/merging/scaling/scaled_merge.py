"""Two maps joined at the scale at which they agree best, or the reason that none is credible.

Evidence and contradiction are counted as for maps of one scale, once the grown map is bent. A rival is
another place, or another scale of one place.
"""

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform, wrapped
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.bend.bent_agreement import compare_bent
from lidarium.mapping.merging.bend.estimation import estimate_bend
from lidarium.mapping.merging.bend.hypotheses import (
    RIVAL_ANGLE,
    RIVAL_M,
    Hypothesis,
    confidence_of,
    signs_of,
)
from lidarium.mapping.merging.description.described_map import (
    DescribedMap,
    check_resolution,
    describe_map,
    three_levels_of,
)
from lidarium.mapping.merging.joining.joined_tree import joined_tree
from lidarium.mapping.merging.joining.merged_maps import Merged
from lidarium.mapping.merging.pair import NO_WALLS
from lidarium.mapping.merging.pair_result import PairResult
from lidarium.mapping.merging.scaling.region_placements import region_placements
from lidarium.mapping.merging.scaling.scale_search import (
    Placement,
    ScaleSettings,
    grown_levels,
    placements,
)
from lidarium.mapping.merging.settings import MergeSettings

SAME_SCALE = 0.1
"""Scales whose logarithms differ by more are different ones."""

MOST_GROWTH = 1.05
"""By so much a scale changes in a round at most."""

SETTLED = 0.003
"""A scale that would change by less is refined no more."""


class Grown(NamedTuple):
    """A hypothesis at a scale.

    Attributes
    ----------
    scale : float
        By how much the second map grows about its lower left corner.
    described : DescribedMap
        The grown map.
    hypothesis : Hypothesis
        How it lies and is bent, and what agrees.
    """

    scale: float
    described: DescribedMap
    hypothesis: Hypothesis

    @property
    def own_evidence_m(self) -> float:
        """Evidence in metres of the second map as it is drawn [m]."""
        return self.hypothesis.evidence_m / self.scale


@dataclass(frozen=True, slots=True, eq=False)
class ScaledMerge:
    """What came of two maps of unlike scales.

    Attributes
    ----------
    merged : Merged
        As of maps of one scale, the second map grown.
    scale : float
        By how much it has grown about its lower left corner; of a refused pair that for which most speaks.
    """

    merged: Merged
    scale: float


def merge_scaled(
    maps: Mapping[str, tuple[ArrayLike, float]],
    settings: MergeSettings | None = None,
    scaling: ScaleSettings | None = None,
) -> ScaledMerge:
    """Join two maps of which the second may have to grow or shrink.

    Parameters
    ----------
    maps : mapping of str to ((rows, columns) uint8, float)
        Occupancy (dark is occupied, row 0 at the lowest y) and side of a cell [m] of each of two maps.
    settings : MergeSettings or None
        How maps may be bent, and whether regions propose scales.
    scaling : ScaleSettings or None
        How the scale is sought.

    Raises
    ------
    ValueError
        Where there are not two maps, or one is no map.
    """
    settings, scaling = settings or MergeSettings(), scaling or ScaleSettings()
    if len(maps) != 2:
        raise ValueError(f"a scale is sought between two maps; {len(maps)} are given")
    drawn = {name: (_checked(name, *grid, settings), grid[1]) for name, grid in maps.items()}
    side = max(scaling.cell_m, *(resolution for _, resolution in drawn.values()))
    (first, a_grid), (second, b_grid) = drawn.items()
    began = time.process_time()
    a, b = (describe_map(grown_levels(*grid, side), side) for grid in (a_grid, b_grid))
    if structure(a) < structure(b):
        ranked = _ranked(b, a_grid, settings, scaling)
        confidence = _confidence(b, ranked)
        best = _turned_round(a, ranked[0], b_grid, settings) if ranked else None
    else:
        ranked = _ranked(a, b_grid, settings, scaling)
        confidence, best = _confidence(a, ranked), next(iter(ranked), None)
    result = _result(best, confidence, scaling)
    pairs = {(first, second): replace(result, time_ms=1e3 * (time.process_time() - began))}
    grown = b if best is None else best.described
    tree = joined_tree({first: a, second: grown}, pairs, settings)
    merged = Merged({first: a.levels, second: grown.levels}, side, pairs, tree)
    return ScaledMerge(merged, 1.0 if best is None else best.scale)


def structure(described: DescribedMap) -> float:
    """Return how much structure a map has, whatever its scale.

    It is the squared length of its walls over its area. The map with less is laid on that with more: a
    plan of many rooms holds a place for each part of it.
    """
    known = int((described.levels != UNKNOWN).sum())
    return len(described.walls) ** 2 / max(known, 1)


def _turned_round(
    a: DescribedMap, found: Grown, grid: tuple[NDArray[np.uint8], float], settings: MergeSettings
) -> Grown | None:
    """Return the hypothesis of the second map on the first, from its inverse."""
    back = found.hypothesis.bend.a_from_b.inverse()
    start = Transform(back.x / found.scale, back.y / found.scale, back.theta)
    return _refined(a, grid, Placement(1.0 / found.scale, start, 0.0), settings, 1)


def _checked(name: str, grid: ArrayLike, resolution: float, settings: MergeSettings) -> NDArray[np.uint8]:
    """Return a map in three levels."""
    try:
        check_resolution(resolution)
        return three_levels_of(grid, settings.corners)
    except ValueError as error:
        raise ValueError(f"map {name!r}: {error}") from error


def _ranked(
    a: DescribedMap, grid: tuple[NDArray[np.uint8], float], settings: MergeSettings, scaling: ScaleSettings
) -> list[Grown]:
    """Return hypotheses of how a map lies at some scale, the best first.

    All scales are tried where regions are not asked, or propose nothing that is believed.
    """
    b = describe_map(grown_levels(*grid, a.resolution), a.resolution)
    if len(a.walls) == 0 or len(b.walls) == 0:
        return []
    found: list[Grown] = []
    if settings.structure != "corners":
        starts = region_placements(a, b, settings.regions, scaling)
        found = _by_evidence([_refined(a, grid, one, settings, scaling.rounds) for one in starts])
        is_enough = _confidence(a, found) >= scaling.confidence
        if found and (is_enough or settings.structure == "regions"):
            return found
    starts = placements(a, b, scaling)
    return _by_evidence([*found, *(_refined(a, grid, one, settings, scaling.rounds) for one in starts)])


def _by_evidence(found: Iterable[Grown | None]) -> list[Grown]:
    """Return the hypotheses that there are, the best first."""
    return sorted((one for one in found if one is not None), key=lambda one: (-one.own_evidence_m, one.scale))


def _refined(
    a: DescribedMap,
    grid: tuple[NDArray[np.uint8], float],
    start: Placement,
    settings: MergeSettings,
    rounds: int,
) -> Grown | None:
    """Return the hypothesis near a placement, scale refined; None without walls."""
    scale, a_from_b = start.scale, start.a_from_b
    while True:
        rounds -= 1
        levels = grown_levels(grid[0], grid[1] * scale, a.resolution)
        b = describe_map(levels, a.resolution)
        if len(b.walls) == 0:
            return None
        bend = estimate_bend(a, b, a_from_b, settings.bend)
        growth = min(max(bend.scale, 1.0 / MOST_GROWTH), MOST_GROWTH)
        if rounds == 0 or abs(growth - 1.0) < SETTLED or not bend.is_held:
            return Grown(scale, b, Hypothesis(bend, compare_bent(a, b, bend)))
        # The map grows about the middle of its walls.
        middle = b.walls.mean(axis=0)
        x, y = bend.a_from_b.apply(middle) - Transform(0.0, 0.0, bend.a_from_b.theta).apply(middle * growth)
        scale, a_from_b = scale * growth, Transform(float(x), float(y), bend.a_from_b.theta)


def _is_rival(best: Grown, other: Grown) -> bool:
    """Whether a hypothesis is of another place, or of another scale."""
    if abs(math.log(best.scale / other.scale)) > SAME_SCALE:
        return True
    first, second = (one.hypothesis.bend.a_from_b for one in (best, other))
    # A point of the map as it is drawn is elsewhere in the grown maps.
    centre = np.array(best.hypothesis.agreement.centre)
    distance = float(np.linalg.norm(first.apply(centre) - second.apply(centre * other.scale / best.scale)))
    return distance > RIVAL_M or abs(wrapped(first.theta - second.theta)) > RIVAL_ANGLE


def _confidence(a: DescribedMap, ranked: list[Grown]) -> float:
    """Return how sure it is that the best hypothesis is right, 0 where there is none."""
    if not ranked:
        return 0.0
    best = ranked[0]
    rival = next((one.own_evidence_m for one in ranked[1:] if _is_rival(best, one)), 0.0)
    rival_share = min(max(rival, 0.0) / max(best.own_evidence_m, 1e-9), 1.0)
    return confidence_of(signs_of(a, best.described, [best.hypothesis])._replace(rival_share=rival_share))


def _result(best: Grown | None, confidence: float, scaling: ScaleSettings) -> PairResult:
    """Return what comes of the best hypothesis."""
    if best is None:
        return PairResult(False, NO_WALLS)
    reason = (
        f"no sure scale: at {best.scale:.3f} the confidence is {confidence:.2f}, below {scaling.confidence:g}"
    )
    agreement, is_accepted = best.hypothesis.agreement, confidence >= scaling.confidence
    return PairResult(
        is_accepted=is_accepted,
        reason="accepted" if is_accepted else reason,
        a_from_b=best.hypothesis.bend.a_from_b,
        score=agreement.score,
        agreement=agreement,
        found_by="scale",
        ranked=(best.hypothesis,),
        confidence=confidence,
    )
