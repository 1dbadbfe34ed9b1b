"""Merging of many maps.

Every pair is tried; accepted and consistent pairs form groups with one map each.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.bend.hypotheses import has_unlike_scale, ranked_hypotheses
from lidarium.mapping.merging.candidates import bendable
from lidarium.mapping.merging.described_map import (
    DescribedMap,
    check_resolution,
    describe_map,
    resampled,
    three_levels_of,
)
from lidarium.mapping.merging.frame_tree import FrameTree
from lidarium.mapping.merging.joining import Merged, joined_tree, pair_edge
from lidarium.mapping.merging.pair import (
    PairResult,
    best_bent,
    described,
    explained,
    merge_near,
    merge_pair,
    verify_pair,
)
from lidarium.mapping.merging.settings import TOLERANCES, MergeSettings
from lidarium.registry import unknown

_MIN_GROWTH_M = 0.05
"""Offsets that a scale explains below this are those of cells and noise [m]."""

_MIRRORED_SHARE = 0.9
"""If the mirror image of a map has this share of the evidence, a symmetric place or a mirrored map is likely."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Prior knowledge of two maps, and the questions asked of pairs.

    Attributes
    ----------
    guess : Transform or None
        About how the second map's lower left corner lies in the first map [m, rad].
    is_forced : bool
        Whether two maps are joined by the best transform, whatever speaks against it.
    is_explained : bool, default True
        Whether pairs that join at once have their other hypotheses ranked too, which confidence and doubt are from;
        otherwise these are 0 and none.
    """

    guess: Transform | None = None
    is_forced: bool = False
    is_explained: bool = True


def _question(given: Mapping[str, Any]) -> Question:
    """Return a question of a mapping."""
    known = [each.name for each in fields(Question)]
    for name in given:
        if name not in known:
            raise ValueError(unknown("question", name, known))
    guess = given.get("guess")
    if guess is None or isinstance(guess, Transform):
        return Question(**given)
    numbers = np.asarray(guess, np.float64)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f"guess is {guess!r}; want x, y and theta in metres and radians")
    return Question(**{**given, "guess": Transform(*numbers.tolist())})


def merge_maps(
    maps: Mapping[str, tuple[ArrayLike, float]],
    settings: MergeSettings | None = None,
    question: Question | Mapping[str, Any] | None = None,
) -> Merged:
    """Merge maps of robots that do not know each other's start.

    Pairs with the most explored area are matched first, by corners and then by all rotations and
    translations. Two maps that are joined through others already are overlaid as these imply, and matched
    only if they do not agree so.

    Parameters
    ----------
    maps : mapping of str to ((rows, columns) uint8, float)
        Occupancy (dark is occupied, row 0 at the lowest y) and side of a cell [m] of each map. If the
        sides differ, all maps are resampled to the coarsest.
    settings : MergeSettings, optional
        Settings; defaults if None.
    question : mapping, optional
        Any of: ``guess``, the approximate pose (x, y, theta) of the second map's lower left corner in the first one
        [m, rad]; ``is_forced``, whether two maps are joined by the best transform whatever speaks against it, default
        False; ``is_explained``, whether pairs that join at once have confidence and doubt, too, default True.

    Returns
    -------
    Merged
        Pairs, frames and fused maps.

    Raises
    ------
    ValueError
        If there are no maps, one is not a map, a question is unknown, or a guess is given for other than two maps.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> rng = np.random.default_rng(0)
    >>> room = np.full((120, 160), 255, np.uint8)
    >>> for row, column, rows, columns in rng.integers((0, 0, 4, 4), (110, 150, 30, 30), (12, 4)):
    ...     room[row : row + rows, column : column + columns] = 0
    >>> merged = lidarium.merge_maps({"a": (room, 0.05), "b": (np.rot90(room), 0.05)})
    >>> sorted(merged.pairs)
    [('a', 'b')]
    """
    settings = settings or MergeSettings()
    question = question if isinstance(question, Question) else _question(question or {})
    if not maps:
        raise ValueError("there are no maps to merge; want at least one")
    if len(maps) != 2 and (question.guess is not None or question.is_forced):
        raise ValueError(f"a guess or a forced merge is of two maps; {len(maps)} are given")
    levels, resolution = _alike(maps, settings)
    features = {name: described(grid, resolution, settings) for name, grid in levels.items()}
    if question.guess is None:
        pairs = _all_pairs(features, settings)
    else:
        a, b = features
        _check_guess(features[a], features[b], question.guess)
        pairs = {(a, b): merge_near(features[a], features[b], question.guess, settings)}
    if question.is_explained or question.is_forced:
        for (a, b), result in pairs.items():
            known = explained(features[a], features[b], result, settings)
            pairs[a, b] = doubted(features[a], features[b], known, settings)
    if question.is_forced:
        pairs = {pair: _forced(result) for pair, result in pairs.items()}
    return Merged(levels, resolution, pairs, joined_tree(features, pairs, settings))


def _check_guess(a: DescribedMap, b: DescribedMap, guess: Transform) -> None:
    """Raise ValueError if a guess lays nothing of one map on the other."""
    known = np.argwhere(b.levels != UNKNOWN)[:, ::-1] + 0.5
    cells = guess.apply(known * b.resolution) / a.resolution
    rows, columns = a.levels.shape
    is_on = (cells[:, 0] >= 0) & (cells[:, 0] < columns) & (cells[:, 1] >= 0) & (cells[:, 1] < rows)
    if not is_on.any():
        raise ValueError(
            f"the guess is off the map: by ({guess.x:g} m, {guess.y:g} m, {guess.theta:g} rad) between their "
            "lower left corners nothing of the second map lies on the first; want x, y, theta by which the "
            "second map's frame lies in that of the first"
        )


def _forced(result: PairResult) -> PairResult:
    """Return a refused result as its best hypothesis, which is accepted whatever speaks against it."""
    if result.is_accepted or result.a_from_b is None:
        return result
    return replace(best_bent(result), is_accepted=True, reason=f"forced against: {result.reason}")


def _all_pairs(features: Mapping[str, DescribedMap], settings: MergeSettings) -> dict[tuple[str, str], PairResult]:
    """Return the result of each pair of maps, in their order."""
    every = list(itertools.combinations(features, 2))
    # What corners join spares the search of all rotations and translations, where there is one.
    # Maps are bent only where all are known that speak against it.
    by_corners = replace(
        settings,
        correlation=replace(settings.correlation, rotations=0),
        confidence=TOLERANCES["strict"],
    )
    passes = (by_corners, settings) if len(every) > 1 and settings != by_corners else (settings,)
    tree: FrameTree[str] = FrameTree(settings.cycle_distance_m, settings.cycle_angle)
    for name in features:
        tree.add_map(name)
    found: dict[tuple[str, str], PairResult] = {}
    for how in passes:
        for a, b in sorted(every, key=lambda pair: -min(len(features[name].walls) for name in pair)):
            if (a, b) in found and found[a, b].is_accepted:
                continue
            result = _implied(features[a], features[b], tree.lookup(a, b), settings) or merge_pair(
                features[a], features[b], how
            )
            found[a, b] = result
            if result.is_accepted and result.a_from_b is not None:
                tree.add_edge(pair_edge(a, b, result, result.a_from_b, result.agreement.centre))
    return {pair: found[pair] for pair in every}


def _implied(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform | None, settings: MergeSettings
) -> PairResult | None:
    """Return the result of aligning two maps as other maps imply, or None.

    None if the others imply no transform, or the maps do not agree under it.
    """
    # The thesis's test needs inliers, which only a search finds.
    if a_from_b is None or settings.validation.test == "discs":
        return None
    result = verify_pair(a, b, a_from_b, settings)
    return result if result.is_accepted else None


def _alike(
    maps: Mapping[str, tuple[ArrayLike, float]], settings: MergeSettings
) -> tuple[dict[str, NDArray[np.uint8]], float]:
    """Return the maps in three levels and in cells of one size, and that size."""
    for name, (_, resolution) in maps.items():
        try:
            check_resolution(resolution)
        except ValueError as error:
            raise ValueError(f"map {name!r}: {error}") from error
    coarsest = max(resolution for _, resolution in maps.values())
    levels = {}
    for name, (grid, resolution) in maps.items():
        try:
            levels[name] = resampled(three_levels_of(grid, settings.corners), resolution, coarsest)
        except ValueError as error:
            raise ValueError(f"map {name!r}: {error}") from error
    return levels, float(coarsest)


def doubted(a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings) -> PairResult:
    """Return an accepted pair with the reason why it may be wrong although the maps agree, if there is one."""
    if not result.is_accepted or not result.ranked:
        return result
    best = result.ranked[0]
    if has_unlike_scale(best.bend.scale, best.bend.growth_share) and best.bend.growth_m > _MIN_GROWTH_M:
        doubt = f"the scales are unlike: the second map fits better if it grows {best.bend.scale:.3f} times"
        return replace(result, doubt=doubt)
    mirrored = describe_map(np.ascontiguousarray(b.levels[:, ::-1]), b.resolution)
    ranked = ranked_hypotheses(a, mirrored, (), settings.bend, bendable(a, mirrored, settings))
    if not ranked or ranked[0].evidence_m < _MIRRORED_SHARE * best.evidence_m:
        return result
    share = f"{100.0 * ranked[0].evidence_m / max(best.evidence_m, 1e-9):.0f} %"
    doubt = f"the place is symmetric or a map is mirrored: mirrored, the second map fits {share} as well"
    return replace(result, doubt=doubt)
