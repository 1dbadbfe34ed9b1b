"""What makes an accepted pair doubtful though nothing in the maps contradicts it."""

from dataclasses import replace

import numpy as np

from lidarium.mapping.merging.bend.hypotheses import has_unlike_scale, ranked_hypotheses
from lidarium.mapping.merging.candidates import bendable
from lidarium.mapping.merging.described_map import DescribedMap, describe_map
from lidarium.mapping.merging.pair import PairResult
from lidarium.mapping.merging.settings import MergeSettings

LEAST_GROWTH_M = 0.05
"""Offsets that a scale explains below this are those of cells and noise [m]."""

MIRRORED_SHARE = 0.9
"""If the mirror image of a map has this share of the evidence, a symmetric place or a mirrored map is likely."""


def doubted(a: DescribedMap, b: DescribedMap, result: PairResult, settings: MergeSettings) -> PairResult:
    """Return an accepted pair, its hypotheses ranked, with the doubt that there is."""
    if not result.is_accepted or not result.ranked:
        return result
    best = result.ranked[0]
    if has_unlike_scale(best.bend.scale, best.bend.growth_share) and best.bend.growth_m > LEAST_GROWTH_M:
        doubt = f"the scales are unlike: the second map fits better if it grows {best.bend.scale:.3f} times"
        return replace(result, doubt=doubt)
    mirrored = describe_map(np.ascontiguousarray(b.levels[:, ::-1]), b.resolution)
    ranked = ranked_hypotheses(a, mirrored, (), settings.bend, bendable(a, mirrored, settings))
    if not ranked or ranked[0].evidence_m < MIRRORED_SHARE * best.evidence_m:
        return result
    share = f"{100.0 * ranked[0].evidence_m / max(best.evidence_m, 1e-9):.0f} %"
    doubt = f"the place is symmetric or a map is mirrored: mirrored, the second map fits {share} as well"
    return replace(result, doubt=doubt)
