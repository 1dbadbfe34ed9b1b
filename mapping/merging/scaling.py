"""Two maps joined at the scale at which they agree best, or the reason that none is credible.

Evidence and contradiction are counted as for maps of one scale, once the grown map is bent. A rival is
another place, or another scale of one place.

Walls of most buildings run in two directions, so four rotations are left, and some near them if maps are
bent. For each of these, and for each scale on a fine ladder, walls and regions of free space are correlated
at all translations.
"""

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.bounds import Angle, Count, Counted, above, check_settings, share, within
from lidarium.mapping.geometry.rigid import Transform, wrapped
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.alignment import distinct
from lidarium.mapping.merging.bend.estimation import estimate_bend
from lidarium.mapping.merging.bend.hypotheses import (
    LOOSE,
    RIVAL_ANGLE,
    RIVAL_M,
    Hypothesis,
    compare_bent,
    confidence_of,
    signs_of,
)
from lidarium.mapping.merging.correlation import CorrelationSettings, best_translations
from lidarium.mapping.merging.described_map import (
    DescribedMap,
    check_resolution,
    describe_map,
    resampled,
    three_levels_of,
)
from lidarium.mapping.merging.joining import Merged, joined_tree
from lidarium.mapping.merging.pair import NO_WALLS, PairResult
from lidarium.mapping.merging.regions.graph import find_regions, turned
from lidarium.mapping.merging.regions.proposals import by_growing_regions
from lidarium.mapping.merging.regions.segmentation import RegionSettings
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.merging.wall_alignment import rank_by_walls

AXIS_STEP = math.radians(0.5)
"""Between the directions of walls that are tried [rad]."""

MAX_WALLS = 4000
"""About so many wall cells show the direction of walls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSettings:
    """How a scale is sought.

    Attributes
    ----------
    least, most : float, default 0.5, 2.0
        By how much the second map may have to grow.
    step : float, default 0.03
        Between the logarithms of neighbouring scales.
    slants : int, default 1
        How many rotations to each side of those that bring walls onto the directions of walls are tried.
    slant : float
        Between these [rad].
    correlation : CorrelationSettings
        How coarsely all translations are tried at each.
    apart_m : float, default 1.0
        Translations of one scale and rotation are at least so far apart [m].
    candidates : int, default 32
        How many of the best placements are examined.
    rounds : int, default 3
        How often the scale of each is refined by the bend that is left.
    cell_m : float, default 0.05
        Side of the cells in which they are, or that of the coarser map if it is larger [m].
    confidence : float, default 0.98
        Confidence from which maps are joined: with another freedom, strangers agree by chance more often.
    """

    least: Annotated[float, within(0.05, 1.0)] = 0.5
    most: Annotated[float, within(1.0, 20.0)] = 2.0
    step: Annotated[float, above(0.001, 0.5)] = 0.03
    slants: Counted = 1
    slant: Angle = math.radians(3.0)
    correlation: CorrelationSettings = field(default_factory=lambda: CorrelationSettings(cell_m=0.2))
    apart_m: Annotated[float, above(0.0, 100.0)] = 1.0
    candidates: Count = 32
    rounds: Count = 3
    cell_m: Annotated[float, within(1e-3, 1.0)] = 0.05
    confidence: Annotated[float, share()] = 0.98

    def __post_init__(self) -> None:
        check_settings(self, "the scale")

    @property
    def scales(self) -> NDArray[np.float64]:
        """All scales that are tried, (n,)."""
        count = math.floor((math.log(self.most) - math.log(self.least)) / self.step + 1e-9) + 1
        return np.asarray(self.least * np.exp(self.step * np.arange(count)))


class _Placement(NamedTuple):
    """How the second map may lie on the first.

    Attributes
    ----------
    scale : float
        By how much it grows about its lower left corner.
    a_from_b : Transform
        From the grown map into the first.
    value_m : float
        Walls that agree less those that do not, as far as the map has grown [m].
    """

    scale: float
    a_from_b: Transform
    value_m: float


def _wall_axis(described: DescribedMap) -> float:
    """Return the direction of a map's walls, from 0 to a quarter turn [rad].

    It is that across which walls fall into the fewest bins of a histogram: the sum of the squared counts,
    over both axes, is greatest.
    """
    walls = described.walls[:: max(len(described.walls) // MAX_WALLS, 1)]
    if len(walls) == 0:
        return 0.0
    angles = np.arange(0.0, math.pi / 2.0, AXIS_STEP)
    sharpness = [_sharpness(walls, angle, 2.0 * described.resolution) for angle in angles.tolist()]
    return float(angles[int(np.argmax(sharpness))])


def _sharpness(walls: NDArray[np.float64], angle: float, bin_m: float) -> float:
    """Return the sum of squared counts of walls (n, 2) in bins along two axes."""
    turned = Transform(0.0, 0.0, -angle).apply(walls) / bin_m
    bins = np.floor(turned - turned.min(axis=0)).astype(np.int64)
    return float(sum((np.bincount(bins[:, axis]).astype(np.float64) ** 2).sum() for axis in (0, 1)))


def _placements(a: DescribedMap, b: DescribedMap, settings: ScaleSettings) -> list[_Placement]:
    """Return the placements of map b for which most speaks, the best first.

    They are ranked by the walls that agree, between what these measure in the one map and in the other: in
    metres of the first, small maps would never win, in metres of the second they would fit anywhere.
    """
    slants = np.arange(-settings.slants, settings.slants + 1) * settings.slant
    quarters = np.arange(4) * (math.pi / 2.0)
    rotations = (_wall_axis(a) - _wall_axis(b) + quarters[:, None] + slants).ravel()
    found = []
    for scale in settings.scales.tolist():
        grown = replace(b, resolution=b.resolution * scale, walls=b.walls * scale)
        transforms, values = best_translations(a, grown, rotations, settings.correlation, settings.apart_m)
        found += [
            _Placement(scale, Transform(*transform), value)
            for transform, value in zip(transforms.tolist(), values.tolist(), strict=True)
        ]
    return sorted(found, key=lambda one: -one.value_m / math.sqrt(one.scale))[: settings.candidates]


def _grown_levels(levels: NDArray[np.uint8], resolution: float, wanted: float) -> NDArray[np.uint8]:
    """Return a three-level map in cells of another side, from the same corner.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The map.
    resolution, wanted : float
        Side of its cells, and of those that are returned [m].
    """
    if resolution <= wanted:
        return resampled(levels, resolution, wanted)
    rows, columns = (max(round(side * resolution / wanted), 1) for side in levels.shape)
    return np.asarray(cv2.resize(levels, (columns, rows), interpolation=cv2.INTER_NEAREST), np.uint8)


_SAMPLES = 400
"""Number of wall cells by which placements are ranked."""


def _region_placements(
    a: DescribedMap, b: DescribedMap, settings: RegionSettings, scaling: ScaleSettings
) -> list[_Placement]:
    """Return the placements of map b under which regions meet, those for which most speaks first."""
    graphs = [find_regions(one.levels, one.resolution, settings) for one in (a, b)]
    found = by_growing_regions(graphs[0], graphs[1], settings, (scaling.least, scaling.most))
    # Between what walls measure in the one map and in the other, as of all scales.
    values = rank_by_walls(a, b, found, _SAMPLES, LOOSE.hit_distance_m) * np.sqrt(found[:, 3])
    # Where the middle of the grown map's walls comes to lie.
    middle = found[:, 3:] * b.walls.mean(axis=0)
    positions = found[:, :2] + turned(middle, found[:, 2])
    order = np.argsort(-values, kind="stable")
    apart = (scaling.apart_m, scaling.slant)
    kept: list[_Placement] = []
    for k in distinct(np.column_stack([positions, found[:, 2]]), order, np.zeros(2), settings.candidates, apart):
        x, y, theta, scale = found[k].tolist()
        kept.append(_Placement(scale, Transform(x, y, theta), float(values[k]) * a.resolution))
    return kept


SAME_SCALE = 0.1
"""Scales whose logarithms differ by more are different ones."""

MAX_GROWTH = 1.05
"""By so much a scale changes in a round at most."""

SETTLED = 0.003
"""A scale that would change by less is refined no more."""


class _Grown(NamedTuple):
    """A hypothesis at a scale.

    Attributes
    ----------
    scale : float
        By how much the second map grows about its lower left corner.
    described : DescribedMap
        The grown map.
    hypothesis : Hypothesis
        Its transform and bend, and the agreement.
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
    """Result of two maps of different scales.

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
        If there are not two maps, or one is no map.
    """
    settings, scaling = settings or MergeSettings(), scaling or ScaleSettings()
    if len(maps) != 2:
        raise ValueError(f"a scale is sought between two maps; {len(maps)} are given")
    drawn = {name: (_checked(name, *grid, settings), grid[1]) for name, grid in maps.items()}
    side = max(scaling.cell_m, *(resolution for _, resolution in drawn.values()))
    (first, a_grid), (second, b_grid) = drawn.items()
    began = time.process_time()
    a, b = (describe_map(_grown_levels(*grid, side), side) for grid in (a_grid, b_grid))
    if _structure(a) < _structure(b):
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


def _structure(described: DescribedMap) -> float:
    """Return how much structure a map has, whatever its scale.

    It is the squared length of its walls over its area. The map with less is laid on that with more: a
    plan of many rooms holds a place for each part of it.
    """
    known = int((described.levels != UNKNOWN).sum())
    return len(described.walls) ** 2 / max(known, 1)


def _turned_round(
    a: DescribedMap, found: _Grown, grid: tuple[NDArray[np.uint8], float], settings: MergeSettings
) -> _Grown | None:
    """Return the hypothesis of the second map on the first, from its inverse."""
    back = found.hypothesis.bend.a_from_b.inverse()
    start = Transform(back.x / found.scale, back.y / found.scale, back.theta)
    return _refined(a, grid, _Placement(1.0 / found.scale, start, 0.0), settings, 1)


def _checked(name: str, grid: ArrayLike, resolution: float, settings: MergeSettings) -> NDArray[np.uint8]:
    """Return a map in three levels."""
    try:
        check_resolution(resolution)
        return three_levels_of(grid, settings.corners)
    except ValueError as error:
        raise ValueError(f"map {name!r}: {error}") from error


def _ranked(
    a: DescribedMap, grid: tuple[NDArray[np.uint8], float], settings: MergeSettings, scaling: ScaleSettings
) -> list[_Grown]:
    """Return hypotheses of how a map lies at some scale, the best first.

    All scales are tried if regions are not asked, or propose nothing that is believed.
    """
    b = describe_map(_grown_levels(*grid, a.resolution), a.resolution)
    if len(a.walls) == 0 or len(b.walls) == 0:
        return []
    found: list[_Grown] = []
    if settings.structure != "corners":
        starts = _region_placements(a, b, settings.regions, scaling)
        found = _by_evidence([_refined(a, grid, one, settings, scaling.rounds) for one in starts])
        is_enough = _confidence(a, found) >= scaling.confidence
        if found and (is_enough or settings.structure == "regions"):
            return found
    starts = _placements(a, b, scaling)
    return _by_evidence([*found, *(_refined(a, grid, one, settings, scaling.rounds) for one in starts)])


def _by_evidence(found: Iterable[_Grown | None]) -> list[_Grown]:
    """Return the hypotheses that there are, the best first."""
    return sorted((one for one in found if one is not None), key=lambda one: (-one.own_evidence_m, one.scale))


def _refined(
    a: DescribedMap,
    grid: tuple[NDArray[np.uint8], float],
    start: _Placement,
    settings: MergeSettings,
    rounds: int,
) -> _Grown | None:
    """Return the hypothesis near a placement, scale refined; None without walls."""
    scale, a_from_b = start.scale, start.a_from_b
    while True:
        rounds -= 1
        levels = _grown_levels(grid[0], grid[1] * scale, a.resolution)
        b = describe_map(levels, a.resolution)
        if len(b.walls) == 0:
            return None
        bend = estimate_bend(a, b, a_from_b, settings.bend)
        growth = min(max(bend.scale, 1.0 / MAX_GROWTH), MAX_GROWTH)
        if rounds == 0 or abs(growth - 1.0) < SETTLED or not bend.is_held:
            return _Grown(scale, b, Hypothesis(bend, compare_bent(a, b, bend)))
        # The map grows about the middle of its walls.
        middle = b.walls.mean(axis=0)
        x, y = bend.a_from_b.apply(middle) - Transform(0.0, 0.0, bend.a_from_b.theta).apply(middle * growth)
        scale, a_from_b = scale * growth, Transform(float(x), float(y), bend.a_from_b.theta)


def _is_rival(best: _Grown, other: _Grown) -> bool:
    """Whether a hypothesis is of another place, or of another scale."""
    if abs(math.log(best.scale / other.scale)) > SAME_SCALE:
        return True
    first, second = (one.hypothesis.bend.a_from_b for one in (best, other))
    # A point of the map as it is drawn is elsewhere in the grown maps.
    centre = np.array(best.hypothesis.agreement.centre)
    distance = float(np.linalg.norm(first.apply(centre) - second.apply(centre * other.scale / best.scale)))
    return distance > RIVAL_M or abs(wrapped(first.theta - second.theta)) > RIVAL_ANGLE


def _confidence(a: DescribedMap, ranked: list[_Grown]) -> float:
    """Return how sure it is that the best hypothesis is right, 0 if there is none."""
    if not ranked:
        return 0.0
    best = ranked[0]
    rival = next((one.own_evidence_m for one in ranked[1:] if _is_rival(best, one)), 0.0)
    rival_share = min(max(rival, 0.0) / max(best.own_evidence_m, 1e-9), 1.0)
    return confidence_of(signs_of(a, best.described, [best.hypothesis])._replace(rival_share=rival_share))


def _result(best: _Grown | None, confidence: float, scaling: ScaleSettings) -> PairResult:
    """Return the result of the best hypothesis."""
    if best is None:
        return PairResult(False, NO_WALLS)
    reason = f"no sure scale: at {best.scale:.3f} the confidence is {confidence:.2f}, below {scaling.confidence:g}"
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
