"""Transform that joins two maps, or the reason that none is credible."""

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.rigid import Transform, halfway
from lidarium.mapping.merging.agreement_counts import disc_agreement
from lidarium.mapping.merging.alignment import Candidate, distinct, find_inliers, refine
from lidarium.mapping.merging.correlation import best_translations
from lidarium.mapping.merging.correspondence import Matches, match_corners
from lidarium.mapping.merging.description.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.merging.validation import Agreement, compare, has_contradiction, is_rival, why_refused
from lidarium.mapping.merging.wall_alignment import rank_by_walls, refine_on_walls

NO_POINTS: NDArray[np.float64] = np.zeros((0, 2))
THIN_WALL_M = 0.1
"""How thick the walls are whose two sides may be taken for one [m]."""

_NEARLY = 4
_QUARTERS = np.arange(4) * (math.pi / 2.0)
_NONE = np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class PairResult:
    """What came of two maps.

    Attributes
    ----------
    is_accepted : bool
        Whether they are one place.
    reason : str
        Why they are refused; ``accepted`` where they are not.
    a_from_b : Transform or None
        The best transform that was found, also of a refused pair.
    matches, inliers : int
        Number of matched corners, and of those that agree with the transform.
    score : float
        1 less the share of contradicting cells; the agreement in discs in the thesis's mode.
    agreement : Agreement
        What the score is made of.
    found_by : str
        ``corners``, ``correlation``, or ``verification`` of what was found before.
    time_ms : float
        Processor time, descriptions of the maps not included [ms].
    joined : ((n, 2), (n, 2)) float64
        The corners that agree, in map a and in map b [m].
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


@dataclass(frozen=True, slots=True, eq=False)
class _Judged:
    """A refined candidate and what the maps say of it."""

    candidate: Candidate
    agreement: Agreement
    refusal: str | None


def described(levels: ArrayLike, resolution: float, settings: MergeSettings) -> DescribedMap:
    """Describe a map by the settings of merging; see `describe_map`."""
    return describe_map(levels, resolution, settings.corners, settings.descriptors)


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
        Where the resolutions differ.
    """
    settings = settings or MergeSettings()
    if not math.isclose(a.resolution, b.resolution, rel_tol=1e-6):
        raise ValueError(
            f"maps have resolutions of {a.resolution} and {b.resolution} m; want one, see resampled"
        )
    began = time.process_time()
    matches = match_corners(a.corners, b.corners, a.descriptors, b.descriptors, settings.correspondence)
    merge = _merge_by_discs if settings.validation.test == "discs" else _merge_by_walls
    return replace(
        merge(a, b, matches, settings), matches=len(matches), time_ms=1e3 * (time.process_time() - began)
    )


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
        What was found.
    settings : MergeSettings or None
        How it is judged.

    Returns
    -------
    PairResult
        The refined transform, or the reason why it is believed no more.
    """
    settings = settings or MergeSettings()
    began = time.process_time()
    start = Candidate(a_from_b, _NONE)
    judged = _polished(a, b, _judged(a, b, start, settings), settings)
    return PairResult(
        is_accepted=judged.refusal is None,
        reason=judged.refusal or "accepted",
        a_from_b=judged.candidate.a_from_b,
        score=judged.agreement.score,
        agreement=judged.agreement,
        found_by="verification",
        time_ms=1e3 * (time.process_time() - began),
    )


def is_contradicted(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: MergeSettings) -> bool:
    """Return whether maps contradict each other under an implied transform.

    The transform is implied by other maps; the maps contradict each other also once they have settled.

    What was implied is a little off after some maps; but where walls hold the maps in one direction alone
    they may settle far away.
    """
    validation = settings.validation

    def contradicts(transform: Transform) -> bool:
        agreement = compare(a, b, transform, validation)
        return agreement.overlap_m2 >= validation.least_overlap_m2 and has_contradiction(
            agreement, validation
        )

    return contradicts(a_from_b) and contradicts(
        refine_on_walls(a, b, a_from_b, settings.cycle_distance_m, settings.alignment.wall_samples)
    )


def _merge_by_walls(
    a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings
) -> PairResult:
    if len(a.walls) == 0 or len(b.walls) == 0:
        return PairResult(False, "too few corners: a map has no walls that border on free space")
    candidates, shortage = _corner_candidates(a, b, matches, settings)
    judged = [
        _judged(a, b, refine(a, b, matches, candidate, settings.alignment), settings)
        for candidate in candidates
    ]
    best, found_by = _best(judged), "corners"
    if (best is None or best.refusal is not None) and settings.correlation.rotations > 0:
        angles = np.arange(settings.correlation.rotations) * (2.0 * math.pi / settings.correlation.rotations)
        judged += _by_correlation(a, b, angles, 5 * settings.alignment.candidates, settings)
        fallback = _best(judged)
        if fallback is not None and fallback.refusal is not None:
            judged += _beside(a, b, judged, settings)
            fallback = _best(judged)
        if fallback is not None and fallback is not best:
            best, found_by = fallback, "correlation"
    if best is None:
        return PairResult(False, shortage or "too few inliers: no transform was found")
    best = _polished(a, b, best, settings)
    refusal = best.refusal or _ambiguity(a, b, best, judged, settings)
    if refusal is not None and shortage is not None and best.refusal is not None:
        refusal = f"{shortage}; of all rotations and translations the best is refused, {refusal}"
    inliers, agreement = best.candidate.inliers, best.agreement
    joined = (a.corners.points[matches.first[inliers]], b.corners.points[matches.second[inliers]])
    return PairResult(
        is_accepted=refusal is None,
        reason=refusal or "accepted",
        a_from_b=best.candidate.a_from_b,
        inliers=len(inliers),
        score=agreement.score,
        agreement=agreement,
        found_by=found_by,
        joined=joined,
    )


def _merge_by_discs(
    a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings
) -> PairResult:
    """Merge by the thesis's rules.

    The proposal with most inliers, refined, is accepted where the discs around its inliers agree.
    """
    candidates, shortage = _corner_candidates(a, b, matches, settings)
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
        else f"contradiction: {100.0 * score:.1f} % of the cells in discs agree, want {percent:g} %",
        a_from_b=candidate.a_from_b,
        inliers=len(candidate.inliers),
        score=score,
        agreement=compare(a, b, candidate.a_from_b, settings.validation),
        joined=joined,
    )


def _corner_candidates(
    a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings
) -> tuple[list[Candidate], str | None]:
    """Return the most promising transforms that matches propose, or none and why."""
    alignment = settings.alignment
    if min(len(a.corners), len(b.corners)) < alignment.least_inliers:
        return [], f"too few corners: {len(a.corners)} and {len(b.corners)}, want {alignment.least_inliers}"
    wanted = max(
        alignment.least_inliers, math.ceil(alignment.inlier_share * min(len(a.corners), len(b.corners)))
    )
    proposals, is_inlier = find_inliers(a.corners, b.corners, matches, a.resolution, alignment)
    counts = is_inlier.sum(axis=1)
    most = int(counts.max(initial=0))
    if most < wanted:
        return [], f"too few inliers: at most {most} of {len(matches)} matches agree, want {wanted}"
    if settings.validation.test == "discs":
        order = np.lexsort((_residuals(a, b, matches, proposals, is_inlier), -counts))
    else:
        # Walls tell more than corners which of many proposals is good, and cost little.
        walls = rank_by_walls(a, b, proposals, alignment.wall_samples // 2)
        order = np.lexsort((-counts, -walls))
        order = order[counts[order] >= wanted]
    chosen = distinct(proposals, order, _middle(b), alignment.candidates, (0.3, math.radians(4.0)))
    return [Candidate(Transform(*proposals[k].tolist()), np.flatnonzero(is_inlier[k])) for k in chosen], None


def _residuals(
    a: DescribedMap,
    b: DescribedMap,
    matches: Matches,
    proposals: NDArray[np.float64],
    is_inlier: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the mean distance of the inliers of each proposal [m], shape (n,)."""
    p, q = a.corners.points[matches.first], b.corners.points[matches.second]
    distances = (np.linalg.norm(Transform(*pose).apply(q) - p, axis=1) for pose in proposals.tolist())
    return np.array([distance[row].mean() for distance, row in zip(distances, is_inlier, strict=True)])


def _by_correlation(
    a: DescribedMap, b: DescribedMap, angles: NDArray[np.floating], count: int, settings: MergeSettings
) -> list[_Judged]:
    """Judge the best of all translations at some rotations."""
    transforms, values = best_translations(
        a, b, angles, settings.correlation, settings.validation.rival_distance_m
    )
    order = np.argsort(-values, kind="stable")
    chosen = distinct(
        transforms,
        order,
        _middle(b),
        count,
        (settings.validation.rival_distance_m, settings.validation.rival_angle),
    )
    reach, samples = settings.alignment.refinement_reach_m, settings.alignment.wall_samples
    refined = (refine_on_walls(a, b, Transform(*transforms[k].tolist()), reach, samples) for k in chosen)
    return [_judged(a, b, Candidate(transform, _NONE), settings) for transform in refined]


def _beside(
    a: DescribedMap, b: DescribedMap, judged: list[_Judged], settings: MergeSettings
) -> list[_Judged]:
    """Judge transforms beside the best refused ones, by a thin wall's thickness.

    The refused ones may have aligned the two sides of a thin wall with each other.
    """
    found = []
    for one in sorted(judged, key=lambda one: -one.agreement.evidence_m)[:_NEARLY]:
        x, y, theta = one.candidate.a_from_b.x, one.candidate.a_from_b.y, one.candidate.a_from_b.theta
        for quarter in _QUARTERS.tolist():
            start = Transform(x + THIN_WALL_M * math.cos(quarter), y + THIN_WALL_M * math.sin(quarter), theta)
            moved = refine_on_walls(a, b, start, THIN_WALL_M, settings.alignment.wall_samples)
            found.append(_judged(a, b, Candidate(moved, one.candidate.inliers), settings))
    return found


def _judged(a: DescribedMap, b: DescribedMap, candidate: Candidate, settings: MergeSettings) -> _Judged:
    agreement = compare(a, b, candidate.a_from_b, settings.validation)
    return _Judged(candidate, agreement, why_refused(agreement, settings.validation))


def _polished(a: DescribedMap, b: DescribedMap, judged: _Judged, settings: MergeSettings) -> _Judged:
    """Refine a transform on more walls, in both directions.

    The result is midway between b on the walls of a and a on the walls of b.
    """
    if "walls" not in settings.alignment.refinements:
        return judged
    start, reach, samples = (
        judged.candidate.a_from_b,
        0.5 * settings.alignment.refinement_reach_m,
        4 * settings.alignment.wall_samples,
    )
    forth = refine_on_walls(a, b, start, reach, samples)
    back = refine_on_walls(b, a, start.inverse(), reach, samples).inverse()
    return _judged(
        a, b, Candidate(halfway(forth, back, judged.agreement.centre), judged.candidate.inliers), settings
    )


def _best(judged: list[_Judged]) -> _Judged | None:
    """Return the candidate with most evidence.

    One against which there is no objection comes before all others.
    """
    return max(judged, key=lambda one: (one.refusal is None, one.agreement.evidence_m), default=None)


def _ambiguity(
    a: DescribedMap, b: DescribedMap, best: _Judged, judged: list[_Judged], settings: MergeSettings
) -> str | None:
    """Return which other transform explains the maps nearly as well, or None.

    Rooms look alike most of all after quarter turns and shifts, so the best translations at these rotations
    are tried too.
    """
    validation, transform = settings.validation, best.candidate.a_from_b
    others = judged + _by_correlation(
        a, b, transform.theta + _QUARTERS, len(_QUARTERS) * settings.correlation.peaks, settings
    )
    for other in others:
        distance, angle = transform.difference(other.candidate.a_from_b, best.agreement.centre)
        if distance <= validation.rival_distance_m and angle <= validation.rival_angle:
            continue
        if other.agreement.evidence_m > validation.rival_lead * best.agreement.evidence_m:
            return (
                f"contradiction: moved by {distance:.1f} m and turned by {math.degrees(angle):.0f} deg, "
                f"{other.agreement.evidence_m:.1f} m of walls speak for it instead of "
                f"{best.agreement.evidence_m:.1f} m, "
                f"but {other.refusal}"
            )
        if is_rival(other.agreement, best.agreement, validation):
            return (
                f"ambiguous: moved by {distance:.1f} m and turned by {math.degrees(angle):.0f} deg, "
                f"{other.agreement.agreeing_m:.1f} m of walls agree instead of "
                f"{best.agreement.agreeing_m:.1f} m"
            )
    return None


def _middle(described: DescribedMap) -> NDArray[np.float64]:
    return np.asarray(described.walls.mean(axis=0) if len(described.walls) else np.zeros(2))
