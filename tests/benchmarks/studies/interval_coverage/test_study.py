"""The study of intervals: its cases, a tiny share of them, and the table."""

from itertools import islice

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies import interval_coverage as coverage
from lidarium.benchmarks.studies.interval_coverage import cases

FEW = 6


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(coverage, "cases", lambda resamples: islice(cases(resamples), FEW))
    monkeypatch.setattr(coverage, "TRIALS", 20)
    monkeypatch.setattr(coverage, "RESAMPLES", 19)


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path):
    study = STUDIES["interval_coverage"]
    done = list(study.work(tmp_path, None, 4, 1))
    assert done == [("cases", 1, 2), ("cases", 2, 2)]
    assert list(study.work(tmp_path, None, 4, 1)) == []
    page = study.page(tmp_path)
    absent = ("Mean", "Inter", "Paired", "Restricted", "Success", "Median between")
    assert_published("interval_coverage", page, tmp_path, absent)
    assert "## Median" in page
    assert "| normal, mean 100, sd 15 | " in page
    assert "Share of 20 trials" in page


def test_every_case_has_a_name_of_its_own():
    keys = [case.key for case in islice(cases(19), FEW)]
    assert len(set(keys)) == FEW


def test_a_case_is_reached_by_its_larger_sizes_alone():
    few, many = [(0.8, 0)] * 4, [(0.95, 0), (0.94, 0), (0.96, 0)]
    assert coverage.is_reached(few + many)
    assert not coverage.is_reached([*few, (0.92, 0), *many[1:]])
