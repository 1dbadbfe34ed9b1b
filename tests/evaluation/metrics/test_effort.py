"""What a run costs: memory and time of decisions."""

from lidarium.evaluation import metrics


def test_memory_is_told_in_megabytes():
    assert 20.0 < metrics.peak_megabytes() < 1e6


def test_decision_times_are_told_in_milliseconds():
    assert metrics.decision_percentiles([0.001, 0.002, 0.003]) == {"p50": 2.0, "p95": 2.9}
    assert metrics.decision_percentiles([]) == {"p50": None, "p95": None}
