"""Shares of runs, such as success rates, with Wilson's intervals.

References
----------
Wilson, Journal of the American Statistical Association 22 (1927). Brown, Cai and DasGupta, Interval
estimation for a binomial proportion, Statistical Science 16 (2001): close to nominal in the mean over shares,
also for few runs and shares near 0 or 1.
"""

from scipy import stats

from lidarium.evaluation.statistics.samples import Interval, checked_confidence


def share_interval(successes: int, size: int, confidence: float = 0.95) -> Interval:
    """Return the share ``successes / size`` and its Wilson interval.

    Parameters
    ----------
    successes, size : int
        How many runs succeeded, of how many.
    confidence : float
        How often the interval shall hold the truth, in the mean over shares.

    Raises
    ------
    ValueError
        Where there are no runs, or more successes than runs.
    """
    if size < 1 or not 0 <= successes <= size:
        raise ValueError(
            f"{successes} successes of {size} runs; want 1 run at least and 0 to as many successes"
        )
    ends = stats.binomtest(successes, size).proportion_ci(checked_confidence(confidence), method="wilson")
    return Interval(successes / size, float(ends.low), float(ends.high), confidence, size)
