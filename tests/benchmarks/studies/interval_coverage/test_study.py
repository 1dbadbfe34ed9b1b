"""The study of intervals: its cases, a tiny share of them, and the table."""

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies import interval_coverage as coverage
from lidarium.benchmarks.studies.interval_coverage import cases


@pytest.fixture
def tiny(monkeypatch):
    """Measure the first case of each figure with few trials."""

    def firsts(resamples):
        seen = set()
        return [case for case in cases(resamples) if not (case.figure in seen or seen.add(case.figure))]

    monkeypatch.setattr(coverage, "cases", firsts)
    monkeypatch.setattr(coverage, "TRIALS", 2)
    monkeypatch.setattr(coverage, "RESAMPLES", 19)


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path):
    study = STUDIES["interval_coverage"]
    figures = len(coverage.cases(19))
    assert list(study.work(tmp_path, None, 1, 1)) == [("cases", done + 1, figures) for done in range(figures)]
    assert list(study.work(tmp_path, None, 1, 1)) == []
    page = study.page(tmp_path)
    assert_published("interval_coverage", page, tmp_path)
    assert "| normal, mean 100, sd 15 | " in page
    assert "Share of 2 trials" in page


def test_every_case_has_a_name_of_its_own():
    keys = [case.key for case in cases(19)]
    assert len(set(keys)) == len(keys)


def test_a_case_is_reached_by_its_larger_sizes_alone():
    few, many = [(0.8, 0)] * 4, [(0.95, 0), (0.94, 0), (0.96, 0)]
    assert coverage.is_reached(few + many)
    assert not coverage.is_reached([*few, (0.92, 0), *many[1:]])
