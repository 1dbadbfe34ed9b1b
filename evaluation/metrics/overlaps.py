"""How much of what was seen was seen by several robots.

References
----------
Overlap_EB: Xu et al., Explore-Bench (ICRA 2022). Overlap_MX: Zhu et al., MAexp (ICRA 2024). Overlap_MV:
MARVEL (Chiun et al., ICRA 2025).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def overlap(masks: Sequence[NDArray[np.uint64]] | NDArray[np.uint64]) -> float:
    """Return ``Overlap_MX``, the share of seen cells seen by several (MAexp).

    It is |cells seen by two or more| / |cells seen by one or more|; 0 where none was seen.

    MAexp prints it at T_0.85 and T_0.95.

    Parameters
    ----------
    masks : sequence of (rows, words) uint64
        What each robot saw, a bit per cell.
    """
    once = np.zeros_like(masks[0])
    twice = np.zeros_like(masks[0])
    for mask in masks:
        twice |= once & mask
        once |= mask
    seen = int(np.bitwise_count(once).sum())
    return int(np.bitwise_count(twice).sum()) / seen if seen else 0.0


def overlap_of_maps(known_shares: ArrayLike) -> float:
    """Return ``Overlap_EB`` = sum_i C_known,i - 1 (Explore-Bench, at T_0.99).

    A share below 0 says that the maps together hold less than the floor once: it is a measure of overlap
    where the team's map is nearly whole, and of nothing before.

    Parameters
    ----------
    known_shares : (robots,) float64
        C_known of each robot's own map.
    """
    return float(np.sum(np.asarray(known_shares, np.float64)) - 1.0)


def instant_overlap(seen_once: ArrayLike, seen_twice: ArrayLike) -> float:
    """Return ``Overlap_MV``, the mean footprint overlap over decisions (MARVEL).

    It is the mean of |footprint of two or more| / |footprint of one or more|.

    Decisions at which nobody sees anything count as 0; 0 where there is no decision.

    Parameters
    ----------
    seen_once, seen_twice : (decisions,) int
        Cells that one robot or more, and two or more, see at each decision from where they stand.
    """
    once, twice = np.asarray(seen_once, np.float64), np.asarray(seen_twice, np.float64)
    ratios = np.divide(twice, once, out=np.zeros_like(once), where=once > 0.0)
    return float(ratios.mean()) if ratios.size else 0.0
