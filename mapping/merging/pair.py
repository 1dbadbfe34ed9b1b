"""Transform that joins two maps, or the reason that none is credible."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import OCCUPIED, UNKNOWN
from lidarium.mapping.merging.agreement import Agreement, compare, disc_agreement, has_contradiction
from lidarium.mapping.merging.alignment import Candidate, refine
from lidarium.mapping.merging.bend.hypotheses import (
    Hypothesis,
    confidence_of,
    is_other,
    ranked_hypotheses,
    signs_of,
    why_unsure,
)
from lidarium.mapping.merging.candidates import (
    NO_INLIERS,
    Judged,
    ambiguity,
    bendable,
    beside,
    corner_candidates,
    correlated,
    judge,
    most_evident,
    near,
    polished,
    region_candidates,
)
from lidarium.mapping.merging.correspondence import NO_MATCHES, Matches, match_corners
from lidarium.mapping.merging.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.regions.graph import find_regions, likely_rotations
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.merging.wall_alignment import refine_on_walls, wall_sample

NEARLY = math.radians(1.5)
"""By how much a rotation may miss a quarter turn that is exact [rad]."""

REACH_CELLS = 6
"""By how many cells a translation may miss the exact one."""

SAME = 0.9
"""Share of the walls that meet occupied cells of the other map: only copies of cells do so."""

SAMPLES = 2000


def _exact_motion(a: DescribedMap, b: DescribedMap, a_from_b: Transform) -> Transform | None:
    """Return the motion by whole cells and quarter turns near another one, if the maps share cells."""
    quarters = round(a_from_b.theta / (0.5 * math.pi))
    if abs(a_from_b.theta - quarters * 0.5 * math.pi) > NEARLY or len(b.walls) == 0:
        return None
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    turn = np.array([[cosine, -sine], [sine, cosine]], np.int64)
    cells = np.floor(b.walls / b.resolution).astype(np.int64)
    middle = b.walls.mean(axis=0)
    # Corners of cells turn into corners: a cell is named by its centre's.
    turned = (np.floor((cells + 0.5) @ turn.T)).astype(np.int64)
    start = np.rint((a_from_b.apply(middle) - turn @ middle) / a.resolution).astype(np.int64)
    few = turned[wall_sample(len(turned), SAMPLES)]
    reach = np.arange(-REACH_CELLS, REACH_CELLS + 1)
    steps = start + np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    best = steps[int(np.argmax([_same(a.levels, few + step)[0] for step in steps]))]
    hits, share = _same(a.levels, turned + best)
    if share < SAME or hits == 0:
        return None
    x, y = (best * a.resolution).tolist()
    return Transform(x, y, math.remainder(quarters * 0.5 * math.pi, 2.0 * math.pi))


def _same(levels: NDArray[np.uint8], cells: NDArray[np.int64]) -> tuple[int, float]:
    """Return how many cells (n, 2) meet occupied ones, and their share of those that meet known ones."""
    rows, columns = levels.shape
    x, y = cells.T
    is_inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found = levels[y[is_inside], x[is_inside]]
    hits, known = int((found == OCCUPIED).sum()), int((found != UNKNOWN).sum())
    return hits, hits / max(known, 1)


NO_POINTS: NDArray[np.float64] = np.zeros((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class PairResult:
    """Result of two maps.

    Attributes
    ----------
    is_accepted : bool
        Whether they are one place.
    reason : str
        Why they are refused; ``accepted`` if they are not.
    a_from_b : Transform or None
        The best transform that was found, also of a refused pair.
    matches, inliers : int
        Number of matched corners, and of those that agree with the transform.
    score : float
        1 less the share of contradicting cells; the agreement in discs in the thesis's mode.
    agreement : Agreement
        Parts of the score.
    found_by : str
        ``corners``, ``regions``, ``correlation``, or ``verification`` of an earlier transform; ``bend``
        if the maps agree only once they are bent; ``scale`` if one has grown.
    time_ms : float
        Processor time, descriptions of the maps not included [ms].
    joined : ((n, 2), (n, 2)) float64
        The corners that agree, in map a and in map b [m].
    tried : tuple of Transform
        All transforms that were refined and judged.
    ranked : tuple of Hypothesis
        The most evident of them with the bend under each, the best first; empty if no bend was sought, see
        `explained`.
    confidence : float
        That the best of these is right, by a model of strangers.
    doubt : str
        Why an accepted pair may be wrong all the same, empty if nothing is known; only of pairs that are
        `explained`.
    """

    is_accepted: bool
    reason: str
    a_from_b: Transform | None = None
    matches: int = 0
    inliers: int = 0
    score: float = 0.0
    agreement: Agreement = field(default_factory=Agreement)
    found_by: str = "corners"
    time_ms: float = 0.0
    joined: tuple[NDArray[np.float64], NDArray[np.float64]] = (NO_POINTS, NO_POINTS)
    tried: tuple[Transform, ...] = ()
    ranked: tuple[Hypothesis, ...] = ()
    confidence: float = 0.0
    doubt: str = ""


def explained(
    a: DescribedMap,
    b: DescribedMap,
    result: PairResult,
    settings: MergeSettings,
    proposals: Sequence[Transform] = (),
) -> PairResult:
    """Return a result with its hypotheses ranked, and the confidence of the best.

    If the maps are refused and the best hypothesis is of another place, the result becomes that hypothesis.

    Parameters
    ----------
    a, b : DescribedMap
        The maps.
    result : PairResult
        Their results.
    settings : MergeSettings
        How much they may be bent.
    proposals : sequence of Transform
        Further transforms that are tried with a bend.
    """
    if result.ranked or not (len(a.walls) and len(b.walls)):
        return result
    found = () if result.a_from_b is None else (result.a_from_b,)
    ranked = ranked_hypotheses(a, b, [*found, *result.tried], settings.bend, proposals)
    if not ranked:
        return result
    signs = signs_of(a, b, ranked)
    known = replace(result, ranked=tuple(ranked), confidence=confidence_of(signs))
    if result.is_accepted or result.a_from_b is None or not is_other(ranked[0], result.a_from_b):
        return known
    return replace(best_bent(known), reason=why_unsure(signs, settings.confidence))


def best_bent(result: PairResult) -> PairResult:
    """Return a result as its best hypothesis has it, if there is one."""
    if not result.ranked:
        return result
    best = result.ranked[0]
    return replace(
        result,
        a_from_b=best.bend.a_from_b,
        inliers=0,
        score=best.agreement.score,
        agreement=best.agreement,
        found_by="bend",
        joined=(NO_POINTS, NO_POINTS),
    )


def _or_bent(
    a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings, is_search: bool = False
) -> PairResult:
    """Return a refused result, or that of the maps bent if they agree then.

    In a search, the transforms that a coarse one proposes are tried too.
    """
    if result.is_accepted or settings.confidence > 1.0 or settings.bend.candidates == 0:
        return result
    known = explained(a, b, result, settings, bendable(a, b, settings) if is_search else ())
    if not known.ranked or known.confidence < settings.confidence:
        return known
    return replace(best_bent(known), is_accepted=True, reason="accepted")


NO_WALLS = "too few corners: a map has no walls that border on free space"


def described(levels: ArrayLike, resolution: float, settings: MergeSettings) -> DescribedMap:
    """Describe a map by the settings of merging; see `describe_map`."""
    found = describe_map(levels, resolution, settings.corners, settings.descriptors)
    if settings.structure == "corners":
        return found
    return replace(found, regions=find_regions(found.levels, found.resolution, settings.regions))


def merge_pair(a: DescribedMap, b: DescribedMap, settings: MergeSettings | None = None) -> PairResult:
    """Find the transform that joins two maps.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution, described by the same settings.
    settings : MergeSettings or None
        How.

    Returns
    -------
    PairResult
        The transform, or the reason of the refusal.

    Raises
    ------
    ValueError
        If the resolutions differ.
    """
    settings = settings or MergeSettings()
    if not math.isclose(a.resolution, b.resolution, rel_tol=1e-6):
        raise ValueError(f"maps have resolutions of {a.resolution} and {b.resolution} m; want one, see resampled")
    began = time.process_time()
    matches = NO_MATCHES
    if settings.structure != "regions":
        matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, settings.correspondence)
    merge = _merge_by_discs if settings.validation.test == "discs" else _merge_by_walls
    result = _exactly(a, b, merge(a, b, matches, settings), settings)
    return replace(result, matches=len(matches), time_ms=1e3 * (time.process_time() - began))


def merge_near(a: DescribedMap, b: DescribedMap, guess: Transform, settings: MergeSettings | None = None) -> PairResult:
    """Find the transform that joins two maps near a guess.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution, described by the same settings.
    guess : Transform
        About ``a_from_b``, to 2 m and 20 degrees.
    settings : MergeSettings or None
        How.

    Returns
    -------
    PairResult
        The transform, or the reason of the refusal. Only transforms near the guess can be rivals.
    """
    settings = settings or MergeSettings()
    began = time.process_time()
    if len(a.walls) == 0 or len(b.walls) == 0:
        return PairResult(False, NO_WALLS)
    judged = near(a, b, guess, settings)
    best = most_evident(judged)
    assert best is not None
    best = polished(a, b, best, settings)
    refusal = best.refusal
    result = PairResult(
        is_accepted=refusal is None,
        reason=refusal or "accepted",
        a_from_b=best.candidate.a_from_b,
        score=best.agreement.score,
        agreement=best.agreement,
        found_by="guess",
        tried=tuple(one.candidate.a_from_b for one in judged),
    )
    result = _exactly(a, b, _or_bent(a, b, result, settings), settings)
    return replace(result, time_ms=1e3 * (time.process_time() - began))


def _exactly(a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings) -> PairResult:
    """Return an accepted result with the exact motion if the maps share their cells."""
    if not result.is_accepted or result.a_from_b is None:
        return result
    motion = _exact_motion(a, b, result.a_from_b)
    if motion is None:
        return result
    agreement = compare(a, b, motion, settings.validation)
    return replace(result, a_from_b=motion, agreement=agreement, score=agreement.score, ranked=())


def verify_pair(
    a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: MergeSettings | None = None
) -> PairResult:
    """Verify a transform found before, when the maps knew less.

    It is refined and judged; nothing is searched for.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    a_from_b : Transform
        The result.
    settings : MergeSettings or None
        How it is judged.

    Returns
    -------
    PairResult
        The refined transform, or the reason why it is believed no more.
    """
    settings = settings or MergeSettings()
    began = time.process_time()
    start = Candidate(a_from_b, NO_INLIERS)
    judged = polished(a, b, judge(a, b, start, settings), settings)
    result = PairResult(
        is_accepted=judged.refusal is None,
        reason=judged.refusal or "accepted",
        a_from_b=judged.candidate.a_from_b,
        score=judged.agreement.score,
        agreement=judged.agreement,
        found_by="verification",
        tried=(a_from_b,),
    )
    return replace(_or_bent(a, b, result, settings), time_ms=1e3 * (time.process_time() - began))


def is_contradicted(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: MergeSettings) -> bool:
    """Return whether maps contradict each other under an implied transform.

    The transform is implied by other maps; the maps contradict each other also once they have settled.

    The implied transform is a little off after some maps; but if walls hold the maps in one direction alone
    they may settle far away.
    """
    validation = settings.validation

    def contradicts(transform: Transform) -> bool:
        agreement = compare(a, b, transform, validation)
        return agreement.overlap_m2 >= validation.least_overlap_m2 and has_contradiction(agreement, validation)

    return contradicts(a_from_b) and contradicts(
        refine_on_walls(a, b, a_from_b, settings.cycle_distance_m, settings.alignment.wall_samples)
    )


def _merge_by_walls(a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings) -> PairResult:
    if len(a.walls) == 0 or len(b.walls) == 0:
        return PairResult(False, NO_WALLS)
    judged, best, found_by, shortage = _searched(a, b, matches, settings)
    if best is None:
        return PairResult(False, shortage or "too few inliers: no transform was found")
    best = polished(a, b, best, settings)
    refusal = best.refusal or ambiguity(a, b, best, judged, settings)
    if refusal is not None and shortage is not None and best.refusal is not None:
        refusal = f"{shortage}; of all rotations and translations the best is refused, {refusal}"
    inliers, agreement = best.candidate.inliers, best.agreement
    joined = (a.corners.points[matches.first[inliers]], b.corners.points[matches.second[inliers]])
    result = PairResult(
        is_accepted=refusal is None,
        reason=refusal or "accepted",
        a_from_b=best.candidate.a_from_b,
        inliers=len(inliers),
        score=agreement.score,
        agreement=agreement,
        found_by=found_by,
        joined=joined,
        tried=tuple(one.candidate.a_from_b for one in judged),
    )
    return _or_bent(a, b, result, settings, is_search=True)


class _Search(NamedTuple):
    """The judged candidates, the best one and its source, and why corners proposed nothing."""

    judged: list[Judged]
    best: Judged | None
    found_by: str
    shortage: str | None


def _searched(a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings) -> _Search:
    """Judge the proposals of corners, regions and all rotations and translations, until one passes."""
    shortage, judged, best, found_by = None, list[Judged](), None, "corners"
    if settings.structure != "regions":
        candidates, shortage = corner_candidates(a, b, matches, settings)
        judged = [
            judge(a, b, refine(a, b, matches, candidate, settings.alignment), settings) for candidate in candidates
        ]
        best = most_evident(judged)
    if settings.structure != "corners" and (best is None or best.refusal is not None):
        proposed = region_candidates(a, b, settings)
        # What is refused stays out: it would be bent too, and strangers fit by more of their rooms.
        if any(one.refusal is None for one in proposed):
            judged += proposed
            best, found_by = _better(best, judged, (found_by, "regions"))
    if settings.correlation.rotations > 0 and (best is None or best.refusal is not None):
        angles = _rotations(a, b, settings)
        judged += correlated(a, b, angles, 5 * settings.alignment.candidates, settings)
        fallback = most_evident(judged)
        if fallback is not None and fallback.refusal is not None:
            judged += beside(a, b, judged, settings)
        best, found_by = _better(best, judged, (found_by, "correlation"))
    return _Search(judged, best, found_by, shortage)


def _rotations(a: DescribedMap, b: DescribedMap, settings: MergeSettings) -> NDArray[np.float64]:
    """Return the rotations that are tried: all, or those under which walls run alike."""
    count = settings.correlation.rotations
    if not settings.regions.likely_rotations or a.regions is None or b.regions is None:
        return np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)
    return likely_rotations(a.regions.directions, b.regions.directions, count)


def _better(best: Judged | None, judged: list[Judged], by: tuple[str, str]) -> tuple[Judged | None, str]:
    """Return the most evident candidate, and its source: the first if it is still the best."""
    found = most_evident(judged)
    return found, by[0] if found is best else by[1]


def _merge_by_discs(a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings) -> PairResult:
    """Merge by the thesis's rules.

    The proposal with most inliers, refined, is accepted if the discs around its inliers agree.
    """
    candidates, shortage = corner_candidates(a, b, matches, settings)
    if not candidates:
        return PairResult(False, shortage or "too few inliers: no transform was found")
    candidate = refine(a, b, matches, candidates[0], settings.alignment)
    joined = (
        a.corners.points[matches.first[candidate.inliers]],
        b.corners.points[matches.second[candidate.inliers]],
    )
    score = disc_agreement(a, b, candidate.a_from_b, joined[1], settings.validation.disc_radius_cells)
    is_accepted = score > settings.validation.disc_agreement
    percent = 100.0 * settings.validation.disc_agreement
    return PairResult(
        is_accepted=is_accepted,
        reason="accepted"
        if is_accepted
        else f"contradiction: {100.0 * score:.1f} % of the cells in discs agree, want more than {percent:g} %",
        a_from_b=candidate.a_from_b,
        inliers=len(candidate.inliers),
        score=score,
        agreement=compare(a, b, candidate.a_from_b, settings.validation),
        joined=joined,
    )
