"""Merging of many maps.

Every pair is tried; accepted and consistent pairs form groups with one map each.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.bend.deforming import Deformed, deform
from lidarium.mapping.merging.bend.estimation import BendSettings
from lidarium.mapping.merging.bend.hypotheses import agrees_bent
from lidarium.mapping.merging.description.described_map import (
    DescribedMap,
    check_resolution,
    describe_map,
    resampled,
    three_levels_of,
)
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.pair import (
    described,
    is_contradicted,
    merge_near,
    merge_pair,
    verify_pair,
)
from lidarium.mapping.merging.pair_result import PairResult, explained
from lidarium.mapping.merging.settings import TOLERANCES, MergeSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is known of two maps beforehand, and what is asked of pairs.

    Attributes
    ----------
    guess : Transform or None
        About how the second map's lower left corner lies in the first map [m, rad].
    is_forced : bool
        Whether two maps are joined by the best transform, whatever speaks against it.
    is_explained : bool
        Whether of every pair the hypotheses are ranked, also where it joins at once.
    """

    guess: Transform | None = None
    is_forced: bool = False
    is_explained: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """What came of some maps.

    Attributes
    ----------
    levels : dict of str to (rows, columns) uint8
        The maps as they were compared, in three levels and in cells of one size.
    resolution : float
        That size, the coarsest of the maps' [m].
    pairs : dict of (str, str) to PairResult
        Every pair, in the order in which the maps were given.
    tree : FrameTree
        The maps' frames. What is accepted as a pair and contradicts stronger pairs is among ``tree.dropped``.
    origins : dict of str to (x, y)
        Lower left corner of cell (0, 0) of each map in its frame [m]; (0, 0) where a map is not named.
    """

    levels: dict[str, NDArray[np.uint8]]
    resolution: float
    pairs: dict[tuple[str, str], PairResult]
    tree: FrameTree[str]
    origins: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def groups(self) -> list[list[str]]:
        """Return the names of the maps that are joined, the root of each group first.

        A map that joins none is a group of its own.
        """
        return self.tree.groups()

    def fused(self, group: list[str]) -> FusedMap:
        """Return the map of a group in the frame of its first.

        Bit i of its sources is the group's map i.

        Raises
        ------
        ValueError
            Where the maps are not joined with one another, or as `fuse` raises.
        """
        return fuse(
            [self.levels[name] for name in group],
            [self._into(group[0], name) for name in group],
            self.resolution,
        )

    def deformed(self, group: list[str], settings: BendSettings | None = None) -> Deformed:
        """Return the map of a group bent to agree, in the frame of its first map.

        Parameters
        ----------
        group : list of str
            Maps that are joined; the first is not bent.
        settings : BendSettings or None
            How much the others may be.

        Raises
        ------
        ValueError
            As `fused` does.
        """
        maps = [describe_map(self.levels[name], self.resolution) for name in group]
        transforms = [self._into(group[0], name) for name in group]
        return deform(maps, transforms, settings or BendSettings())

    def _into(self, root: str, name: str) -> Transform:
        """Return the transform from a map's lower left corner into another's frame.

        The other frame is that of a map.
        """
        transform = self.tree.lookup(root, name)
        if transform is None:
            raise ValueError(f"map {name!r} is not joined with {root!r}; want maps of one group")
        return transform @ placed(self.origins.get(name, (0.0, 0.0)))


def merge_maps(
    maps: Mapping[str, tuple[ArrayLike, float]],
    settings: MergeSettings | None = None,
    question: Question | None = None,
) -> Merged:
    """Merge maps of robots that know nothing of each other's start.

    Pairs of maps that know most are searched for first, by corners before all rotations and translations are
    tried. Where two maps are joined through others already, they are overlaid as these imply, and
    searched for only where they do not agree so.

    Parameters
    ----------
    maps : mapping of str to ((rows, columns) uint8, float)
        Occupancy (dark is occupied, row 0 at the lowest y) and side of a cell [m] of each map. Where the
        sides differ, all maps are brought to the coarsest.
    settings : MergeSettings or None
        How.
    question : Question or None
        What is known of two maps, and what is asked of every pair beside whether it joins.

    Returns
    -------
    Merged
        Pairs, frames and fused maps.

    Raises
    ------
    ValueError
        Where there are no maps, or one is no map, or the question has no answer.
    """
    settings, question = settings or MergeSettings(), question or Question()
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
    if question.is_explained:
        pairs = {
            (a, b): explained(features[a], features[b], result, settings) for (a, b), result in pairs.items()
        }
    if question.is_forced:
        pairs = {pair: _forced(result) for pair, result in pairs.items()}
    return Merged(levels, resolution, pairs, joined_tree(features, pairs, settings))


def _check_guess(a: DescribedMap, b: DescribedMap, guess: Transform) -> None:
    """Raise ValueError where a guess lays nothing of one map on the other."""
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
    """Return a result that is accepted whatever speaks against it."""
    if result.is_accepted or result.a_from_b is None:
        return result
    return replace(result, is_accepted=True, reason=f"forced against: {result.reason}")


def _all_pairs(
    features: Mapping[str, DescribedMap], settings: MergeSettings
) -> dict[tuple[str, str], PairResult]:
    """Return what comes of each two maps, in their order."""
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
                tree.add_edge(_edge(a, b, result, result.a_from_b, result.agreement.centre))
    return {pair: found[pair] for pair in every}


def _implied(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform | None, settings: MergeSettings
) -> PairResult | None:
    """Return the result of aligning two maps as other maps imply, or None.

    None where the others imply no transform, or the maps do not agree under it.
    """
    # The thesis's test needs inliers, which only a search finds.
    if a_from_b is None or settings.validation.test == "discs":
        return None
    result = verify_pair(a, b, a_from_b, settings)
    return result if result.is_accepted else None


def joined_tree(
    features: Mapping[str, DescribedMap],
    pairs: Mapping[tuple[str, str], PairResult],
    settings: MergeSettings,
    origins: Mapping[str, tuple[float, float]] | None = None,
    tree: FrameTree[str] | None = None,
) -> FrameTree[str]:
    """Join maps by what was accepted of their pairs.

    Maps that are joined through others alone must not contradict each other either: else the weakest pair
    between them is dropped.

    Parameters
    ----------
    features : mapping of str to DescribedMap
        The maps.
    pairs : mapping of (str, str) to PairResult
        What came of each two, from lower left corner to lower left corner.
    settings : MergeSettings
        What contradicts.
    origins : mapping of str to (x, y) or None
        Lower left corner of each map in its frame [m]; (0, 0) for all where None.
    tree : FrameTree or None
        Of an earlier call, whose world shall stay where it is; it is changed. A new one where None.

    Returns
    -------
    FrameTree
        The maps' frames.
    """
    tree = tree or FrameTree(settings.cycle_distance_m, settings.cycle_angle)
    for name in tree.names:
        if name not in features:
            tree.remove_map(name)
    for name in features:
        tree.add_map(name)
    frames = {name: placed((origins or {}).get(name, (0.0, 0.0))) for name in features}
    edges = []
    for (a, b), result in pairs.items():
        if result.is_accepted and result.a_from_b is not None:
            centre = frames[b].apply(result.agreement.centre)
            a_from_b = frames[a] @ result.a_from_b @ frames[b].inverse()
            edges.append(_edge(a, b, result, a_from_b, (float(centre[0]), float(centre[1]))))
    are_bent = any(edge.slack_m > 0.0 for edge in edges)

    def contradicts(a: str, b: str, a_from_b: Transform) -> bool:
        implied = frames[a].inverse() @ a_from_b @ frames[b]
        if not is_contradicted(features[a], features[b], implied, settings):
            return False
        return not (are_bent and agrees_bent(features[a], features[b], implied, settings.bend))

    tree.set_edges(edges, contradicts)
    return tree


def _edge(a: str, b: str, result: PairResult, a_from_b: Transform, centre: tuple[float, float]) -> Edge[str]:
    """Return the edge of an accepted pair; bent maps may miss each other by their bend around cycles."""
    if result.found_by != "bend" or not result.ranked:
        return Edge(a, b, a_from_b, result.agreement.evidence_m, centre)
    best = result.ranked[0]
    return Edge(a, b, a_from_b, best.evidence_m, centre, 2.0 * best.bend.bend_m)


def placed(origin: tuple[float, float]) -> Transform:
    """Return the transform from a map's lower left corner into its frame."""
    return Transform(float(origin[0]), float(origin[1]), 0.0)


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
