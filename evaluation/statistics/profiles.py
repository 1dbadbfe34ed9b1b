"""Performance profiles: share of runs in which a policy is within a factor of the best.

References
----------
Dolan and More, Benchmarking optimization software with performance profiles, Mathematical Programming 91
(2002). Agarwal et al., Deep reinforcement learning at the edge of the statistical precipice (NeurIPS 2021).
"""

import numpy as np
from numpy.typing import ArrayLike

from lidarium.evaluation.statistics.estimates import mean_share_interval
from lidarium.evaluation.statistics.samples import Values, checked_values


def ratio_profile(costs: ArrayLike, factors: ArrayLike) -> Values:
    """Return the share of runs in which each policy is within a factor of the best.

    The best is the best policy of that run.

    Parameters
    ----------
    costs : (runs, policies) array_like
        Cost of each policy, 0 or more; inf if it did not succeed. Runs in which none succeeded count
        do not count for any policy.
    factors : (k,) array_like
        Factors, 1 or more.

    Returns
    -------
    (policies, k) float64
        Shares of all runs.
    """
    needed, within = np.asarray(costs, np.float64), checked_values(factors, "factors")
    if needed.ndim != 2 or not needed.size:
        raise ValueError(f"costs have shape {needed.shape}; want (runs, policies), one of each at least")
    if np.isnan(needed).any() or (needed < 0.0).any():
        raise ValueError("costs hold nan or negative values; want 0 or more, and inf where a policy did not succeed")
    if (within < 1.0).any():
        raise ValueError(f"factors reach down to {within.min():g}; want 1 or more")
    best = needed.min(axis=1)
    is_good = (needed[:, :, np.newaxis] <= best[:, np.newaxis, np.newaxis] * within) & np.isfinite(needed)[
        :, :, np.newaxis
    ]
    return np.asarray(is_good.mean(axis=0))


def score_profile(
    scores: ArrayLike, thresholds: ArrayLike, confidence: float = 0.95, clusters: ArrayLike | None = None
) -> Values:
    """Return the share of runs with a score of at least each threshold.

    The ends of Wilson's intervals are returned with it.

    Parameters
    ----------
    scores : (n,) array_like
        Score of each run.
    thresholds : (k,) array_like
        Thresholds.
    clusters : (n,) array_like or None, default None
        As in `mean_interval`.

    Returns
    -------
    (3, k) float64
        Share, low and high end.
    """
    found, asked = checked_values(scores, "scores"), checked_values(thresholds, "thresholds")
    counts = len(found) - np.searchsorted(np.sort(found), asked, side="left")
    # As many runs that reach a threshold are the same runs.
    first = {int(count): threshold for count, threshold in zip(counts[::-1], asked[::-1], strict=True)}
    intervals = {
        count: mean_share_interval(found >= threshold, confidence, clusters) for count, threshold in first.items()
    }
    return np.array([[each.estimate, each.low, each.high] for each in (intervals[int(count)] for count in counts)]).T
