"""The content of ``transforms.json``: transforms between maps, and the result of each pair."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.mapping.geometry.rigid import Transform
    from lidarium.mapping.merging.pair import PairResult

MOST_ALTERNATIVES = 5
"""Maximum number of hypotheses of a pair that are written."""

CONTRADICTS, WAITS = "contradicts stronger pairs of the group", "accepted once, and waits to be confirmed"
"""Why a pair that was accepted is not used."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedMaps:
    """Maps by name, and how they lie.

    Attributes
    ----------
    groups : sequence of (mapping of str to Transform)
        Of each group of joined maps the frame of each map in that of the first; frames are those of ROS.
    pairs : mapping of (str, str) to PairResult
        Result of each pair, between lower left corners.
    corners : mapping of str to Transform
        Transform of the lower left corner of each map of a pair in its frame.
    used, dropped : collection of (str, str)
        Pairs that join the maps, and those that contradict stronger ones.
    """

    groups: "Sequence[Mapping[str, Transform]]"
    pairs: "Mapping[tuple[str, str], PairResult]" = field(default_factory=dict)
    corners: "Mapping[str, Transform]" = field(default_factory=dict)
    used: Collection[tuple[str, str]] = ()
    dropped: Collection[tuple[str, str]] = ()


def transforms(placed: PlacedMaps) -> dict[str, Any]:
    """Return the content of ``transforms.json``."""
    maps: dict[str, dict[str, Any] | None] = {}
    for number, group in enumerate(placed.groups):
        for name, frame in group.items():
            maps[name] = {**_numbers(frame), "group": number} if len(group) > 1 else None
    return {
        "world": next(iter(placed.groups[0])),
        "maps": maps,
        "pairs": [_pair(names, placed) for names in placed.pairs],
    }


def _pair(names: tuple[str, str], placed: PlacedMaps) -> dict[str, Any]:
    """Return the entry of a pair."""
    first, second = (placed.corners[name] for name in names)
    found = placed.pairs[names]

    def between(a_from_b: "Transform | None") -> dict[str, float | None]:
        return _numbers(None if a_from_b is None else first @ a_from_b @ second.inverse())

    from lidarium.mapping.geometry.rigid import turned

    agreement, is_used = found.agreement, names in placed.used
    bend = found.ranked[0].bend if found.ranked and found.ranked[0].bend.is_held else None
    reason = found.reason
    if found.is_accepted and not is_used:
        reason = CONTRADICTS if names in placed.dropped else WAITS
    return {
        "a": names[0],
        "b": names[1],
        "accepted": is_used,
        "reason": reason,
        **between(found.a_from_b),
        "found_by": found.found_by,
        "matches": found.matches,
        "inliers": found.inliers,
        "score": round(found.score, 6),
        "overlap_m2": round(agreement.overlap_m2, 3),
        "agreeing_m": round(agreement.agreeing_m, 3),
        "contradiction_m": round(agreement.contradicting_m, 3),
        "hit_rate": round(agreement.hit_rate, 4),
        "confidence": round(found.confidence, 4),
        "bend_m": None if bend is None else round(bend.bend_m, 4),
        "strain": None if bend is None else round(bend.strain, 5),
        "scale": None if bend is None else round(bend.scale, 5),
        "covariance": None if bend is None else _shortened(turned(bend.covariance, first.theta)),
        "covariance_at": None if bend is None else [round(float(v), 3) for v in first.apply(bend.middle)],
        "alternatives": [
            {
                **between(one.bend.a_from_b),
                "evidence_m": round(one.evidence_m, 3),
                "agreeing_m": round(one.agreement.agreeing_m, 3),
                "contradiction_m": round(one.agreement.contradicting_m, 3),
            }
            for one in found.ranked[:MOST_ALTERNATIVES]
        ],
        "time_ms": round(found.time_ms, 3),
    }


def _shortened(matrix: "NDArray[np.float64]") -> list[list[float]]:
    return [[float(f"{value:.3g}") for value in row] for row in matrix]


def _numbers(transform: "Transform | None") -> dict[str, float | None]:
    if transform is None:
        return {"x": None, "y": None, "theta": None}
    return {"x": round(transform.x, 6), "y": round(transform.y, 6), "theta": round(transform.theta, 8)}
