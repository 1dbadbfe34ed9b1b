"""What came of two maps, and of the maps once they are bent."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.validation import Agreement
from lidarium.mapping.merging.bend.hypotheses import (
    Hypothesis,
    confidence_of,
    ranked_hypotheses,
    signs_of,
)
from lidarium.mapping.merging.description.described_map import DescribedMap
from lidarium.mapping.merging.settings import MergeSettings

NO_POINTS: NDArray[np.float64] = np.zeros((0, 2))


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
        ``corners``, ``regions``, ``correlation``, or ``verification`` of what was found before; ``bend``
        where the maps agree only once they are bent; ``scale`` where one has grown.
    time_ms : float
        Processor time, descriptions of the maps not included [ms].
    joined : ((n, 2), (n, 2)) float64
        The corners that agree, in map a and in map b [m].
    tried : tuple of Transform
        All transforms that were refined and judged.
    ranked : tuple of Hypothesis
        The most evident of them with the bend under each, the best first; empty where no bend was sought, see
        `explained`.
    confidence : float
        That the best of these is right, by a model of strangers.
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


def explained(a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings) -> PairResult:
    """Return a result with its hypotheses ranked, and the confidence of the best.

    Parameters
    ----------
    a, b : DescribedMap
        The maps.
    result : PairResult
        What came of them.
    settings : MergeSettings
        How much they may be bent.
    """
    if result.ranked or not (len(a.walls) and len(b.walls)):
        return result
    found = () if result.a_from_b is None else (result.a_from_b,)
    ranked = ranked_hypotheses(a, b, [*found, *result.tried], settings.bend)
    return replace(
        result, ranked=tuple(ranked), confidence=confidence_of(signs_of(a, b, ranked)) if ranked else 0.0
    )


def or_bent(a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings) -> PairResult:
    """Return a refused result, or that of the maps bent where they agree then."""
    if result.is_accepted or settings.confidence > 1.0 or settings.bend.candidates == 0:
        return result
    known = explained(a, b, result, settings)
    if not known.ranked or known.confidence < settings.confidence:
        return known
    best = known.ranked[0]
    return replace(
        known,
        is_accepted=True,
        reason="accepted",
        a_from_b=best.bend.a_from_b,
        inliers=0,
        score=best.agreement.score,
        agreement=best.agreement,
        found_by="bend",
        joined=(NO_POINTS, NO_POINTS),
    )
