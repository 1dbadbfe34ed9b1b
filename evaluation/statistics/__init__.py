"""Value of the figures of many episodes: intervals, comparisons, profiles.

Estimates have intervals, and comparisons are paired.

Pure functions on arrays. Which interval belongs to which figure, and how often each holds the truth, is in
docs/reference/statistics.md and docs/results/interval_coverage.md.
"""

from lidarium.evaluation.statistics.bands import FEWEST_FOR_BANDS, mean_bands
from lidarium.evaluation.statistics.estimates import (
    interquartile_mean,
    interquartile_mean_interval,
    mean_interval,
    mean_share_interval,
    median_bands,
    median_interval,
    optimality_gap,
    paired_difference,
    paired_ratio,
    probability_of_improvement,
    share_interval,
)
from lidarium.evaluation.statistics.paired_tests import PairedTest, holm, sign_test, wilcoxon_test
from lidarium.evaluation.statistics.profiles import ratio_profile, score_profile
from lidarium.evaluation.statistics.restricted import (
    CensoredTimes,
    kaplan_meier,
    restricted_difference,
    restricted_mean,
    restricted_ratio,
)
from lidarium.evaluation.statistics.samples import FEWEST_FOR_INTERVAL, FEWEST_FOR_NOMINAL, Interval

__all__ = [
    "FEWEST_FOR_BANDS",
    "FEWEST_FOR_INTERVAL",
    "FEWEST_FOR_NOMINAL",
    "CensoredTimes",
    "Interval",
    "PairedTest",
    "holm",
    "interquartile_mean",
    "interquartile_mean_interval",
    "kaplan_meier",
    "mean_bands",
    "mean_interval",
    "mean_share_interval",
    "median_bands",
    "median_interval",
    "optimality_gap",
    "paired_difference",
    "paired_ratio",
    "probability_of_improvement",
    "ratio_profile",
    "restricted_difference",
    "restricted_mean",
    "restricted_ratio",
    "score_profile",
    "share_interval",
    "sign_test",
    "wilcoxon_test",
]
