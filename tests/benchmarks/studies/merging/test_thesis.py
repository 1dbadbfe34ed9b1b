import pytest

from lidarium.benchmarks.studies.merging.thesis import OVERLAPPING, PAIRS, claimed_ms, pair_ms


def test_the_statements_of_the_thesis_follow_from_its_tables():
    assert len(PAIRS) == 12
    accepted = [pair for pair in PAIRS if pair.is_accepted]
    assert len(accepted) == 4
    assert all(pair.is_accepted == (pair.agreement > 90.0) for pair in PAIRS)
    assert len(accepted) / OVERLAPPING == 0.4


def test_its_longest_pair_takes_longer_than_it_claims():
    assert claimed_ms() == pytest.approx(278.07, abs=0.01)
    times = [pair_ms(pair) for pair in PAIRS]
    assert max(times) == pytest.approx(302.0, abs=0.1)
    assert sum(times) / len(times) == pytest.approx(156.5, abs=0.1)
