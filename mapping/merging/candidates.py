"""The candidates for the transform that joins two maps, and the evidence for each."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform, halfway
from lidarium.mapping.merging.agreement import Agreement, compare, is_rival, why_refused
from lidarium.mapping.merging.alignment import Candidate, distinct, find_inliers
from lidarium.mapping.merging.bend.hypotheses import RIVAL_ANGLE, RIVAL_M
from lidarium.mapping.merging.correlation import CorrelationSettings, best_translations
from lidarium.mapping.merging.correspondence import Matches
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.regions.proposals import propose_motions
from lidarium.mapping.merging.settings import MergeSettings
from lidarium.mapping.merging.wall_alignment import rank_by_walls, refine_on_walls

THIN_WALL_M = 0.1
"""How thick the walls are whose two sides may be taken for one [m]."""

NO_INLIERS: NDArray[np.int64] = np.zeros(0, np.int64)
"""The inliers of a candidate that no corners have proposed."""

NEAR_M, NEAR_ANGLE = 2.0, math.radians(20.0)
"""How far a guess may be off [m, rad]."""

_NEAR_ROTATIONS, _NEAR_PEAKS = 17, 12
_NEARLY = 4
_QUARTERS = np.arange(4) * (math.pi / 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A refined candidate and its evidence.

    Attributes
    ----------
    candidate : Candidate
        The transform and its inliers.
    agreement : Agreement
        How the maps agree under it.
    refusal : str or None
        Why they are refused, None if they are not.
    """

    candidate: Candidate
    agreement: Agreement
    refusal: str | None


def corner_candidates(
    a: DescribedMap, b: DescribedMap, matches: Matches, settings: MergeSettings
) -> tuple[list[Candidate], str | None]:
    """Return the most promising transforms that matches propose, or none and why."""
    alignment = settings.alignment
    if min(len(a.corners), len(b.corners)) < alignment.least_inliers:
        return [], f"too few corners: {len(a.corners)} and {len(b.corners)}, want {alignment.least_inliers}"
    wanted = max(alignment.least_inliers, math.ceil(alignment.inlier_share * min(len(a.corners), len(b.corners))))
    proposals, is_inlier = find_inliers(a.corners, b.corners, matches, a.resolution, alignment)
    counts = is_inlier.sum(axis=1)
    most = int(counts.max(initial=0))
    if most < wanted:
        return [], f"too few inliers: at most {most} of {len(matches)} matches agree, want {wanted}"
    if settings.validation.test == "discs":
        order = np.lexsort((_residuals(a, b, matches, proposals, is_inlier), -counts))
    else:
        # Walls show better than corners which of many proposals is good, and cost little.
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


def correlated(
    a: DescribedMap,
    b: DescribedMap,
    angles: NDArray[np.floating],
    count: int,
    settings: MergeSettings,
    guess: Transform | None = None,
) -> list[Judged]:
    """Judge the best of all translations at some rotations, of those within `NEAR_M` of a guess if any."""
    peaks = settings.correlation if guess is None else replace(settings.correlation, peaks=_NEAR_PEAKS)
    transforms, values = best_translations(a, b, angles, peaks, settings.validation.rival_distance_m)
    order = np.argsort(-values, kind="stable")
    if guess is not None:
        middle = _middle(b)
        order = np.array(
            [k for k in order.tolist() if Transform(*transforms[k].tolist()).difference(guess, middle)[0] <= NEAR_M],
            np.int64,
        )
    chosen = distinct(
        transforms,
        order,
        _middle(b),
        count,
        (settings.validation.rival_distance_m, settings.validation.rival_angle),
    )
    reach, samples = settings.alignment.refinement_reach_m, settings.alignment.wall_samples
    refined = (refine_on_walls(a, b, Transform(*transforms[k].tolist()), reach, samples) for k in chosen)
    return [judge(a, b, Candidate(transform, NO_INLIERS), settings) for transform in refined]


BENDABLE = CorrelationSettings(cell_m=0.3, rotations=120, peaks=3)
"""How all transforms of bent maps are tried: in cells as wide as bends are long, at rotations 3 degrees apart."""


def bendable(a: DescribedMap, b: DescribedMap, settings: MergeSettings) -> list[Transform]:
    """Return the best transforms of maps that are bent, the best first.

    In fine cells, a bend keeps most walls from meeting.
    """
    angles = np.arange(BENDABLE.rotations) * (2.0 * math.pi / BENDABLE.rotations)
    transforms, values = best_translations(a, b, angles, BENDABLE, RIVAL_M)
    order = np.argsort(-values, kind="stable")
    chosen = distinct(transforms, order, _middle(b), settings.bend.proposals, (RIVAL_M, RIVAL_ANGLE))
    reach, samples = settings.bend.reach_m, settings.alignment.wall_samples
    return [refine_on_walls(a, b, Transform(*transforms[k].tolist()), reach, samples) for k in chosen]


def region_candidates(a: DescribedMap, b: DescribedMap, settings: MergeSettings) -> list[Judged]:
    """Judge the motions of regions and doors for which most walls speak."""
    if a.regions is None or b.regions is None:
        raise ValueError("a map is described without its regions; want both described by these settings")
    chosen, alignment = settings.regions, settings.alignment
    motions = propose_motions(a.regions, b.regions, chosen)
    walls = rank_by_walls(a, b, motions, alignment.wall_samples // 2)
    kept = distinct(
        motions,
        np.argsort(-walls, kind="stable"),
        _middle(b),
        chosen.candidates,
        (chosen.apart_m, chosen.apart_angle),
    )
    reach, samples = alignment.refinement_reach_m, alignment.wall_samples
    refined = (refine_on_walls(a, b, Transform(*motions[k].tolist()), reach, samples) for k in kept)
    return [judge(a, b, Candidate(transform, NO_INLIERS), settings) for transform in refined]


def near(a: DescribedMap, b: DescribedMap, guess: Transform, settings: MergeSettings) -> list[Judged]:
    """Judge the guess and the best translations near it, at rotations near it."""
    angles = guess.theta + np.linspace(-NEAR_ANGLE, NEAR_ANGLE, _NEAR_ROTATIONS)
    reach = settings.bend.reach_m
    start = refine_on_walls(a, b, guess, reach, settings.alignment.wall_samples)
    found = correlated(a, b, angles, 5 * settings.alignment.candidates, settings, guess)
    return [judge(a, b, Candidate(start, NO_INLIERS), settings), *found]


def beside(a: DescribedMap, b: DescribedMap, judged: list[Judged], settings: MergeSettings) -> list[Judged]:
    """Judge transforms near the best refused ones, a thin wall's thickness away.

    The refused ones may have aligned the two sides of a thin wall with each other.
    """
    found = []
    for one in sorted(judged, key=lambda one: -one.agreement.evidence_m)[:_NEARLY]:
        x, y, theta = one.candidate.a_from_b.x, one.candidate.a_from_b.y, one.candidate.a_from_b.theta
        for quarter in _QUARTERS.tolist():
            start = Transform(x + THIN_WALL_M * math.cos(quarter), y + THIN_WALL_M * math.sin(quarter), theta)
            moved = refine_on_walls(a, b, start, THIN_WALL_M, settings.alignment.wall_samples)
            found.append(judge(a, b, Candidate(moved, one.candidate.inliers), settings))
    return found


def judge(a: DescribedMap, b: DescribedMap, candidate: Candidate, settings: MergeSettings) -> Judged:
    """Return a candidate with its evidence."""
    agreement = compare(a, b, candidate.a_from_b, settings.validation)
    return Judged(candidate, agreement, why_refused(agreement, settings.validation))


def polished(a: DescribedMap, b: DescribedMap, judged: Judged, settings: MergeSettings) -> Judged:
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
    return judge(a, b, Candidate(halfway(forth, back, judged.agreement.centre), judged.candidate.inliers), settings)


def most_evident(judged: list[Judged]) -> Judged | None:
    """Return the candidate with most evidence.

    One against which there is no objection comes before all others.
    """
    return max(judged, key=lambda one: (one.refusal is None, one.agreement.evidence_m), default=None)


def ambiguity(
    a: DescribedMap, b: DescribedMap, best: Judged, judged: list[Judged], settings: MergeSettings
) -> str | None:
    """Return which other transform explains the maps nearly as well, or None.

    Rooms are alike most of all after quarter turns and shifts, so the best translations at these rotations
    are tried too.
    """
    validation, transform = settings.validation, best.candidate.a_from_b
    others = judged + correlated(
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
