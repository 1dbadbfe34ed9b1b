"""The study of every floor: a tiny share runs, is gone on with, and has its tables."""

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES, floors


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(floors, "GENERATED", range(4_000_000, 4_000_002))
    monkeypatch.setattr(floors, "TEAMS", (1, 2))


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path):
    study = STUDIES["floors"]
    assert list(study.work(tmp_path, None, 3, 1)) == [("runs", 1, 2), ("runs", 2, 2)]
    assert list(study.work(tmp_path, None, 3, 1)) == []
    page = study.page(tmp_path)
    assert_published("floors", page, tmp_path)
    assert "| generated floors (building:SEED) | 2 | 0 | 0 | " in page
    assert "0 of 2 runs below 0.99" in page
    assert "| building:4000001 | " in page
    assert next(study.work(tmp_path, None, 1, 1)) == ("runs", 3, 4)


def test_floors_that_robots_do_not_fit_in_are_listed(tmp_path, monkeypatch):
    def refuse(*_):
        raise ValueError("no room for 2 robots")

    monkeypatch.setattr(floors, "ExplorationEnv", refuse)
    monkeypatch.setattr(floors, "GENERATED", range(4_000_000, 4_000_001))
    monkeypatch.setattr(floors, "TEAMS", (2,))
    list(STUDIES["floors"].work(tmp_path, None, 1, 1))
    page = STUDIES["floors"].page(tmp_path)
    assert "- building:4000000, 2 robots: no room for 2 robots" in page


def test_generated_floors_are_there_without_data_and_real_ones_with_it(shared_data):
    assert len(floors.floors(None)) == 200
    assert len(floors.floors(shared_data)) > 400


def test_names_are_without_folder_and_ending():
    assert floors.name_of("data/floorplans/kth/xml/A_1.xml.gz") == "A_1"
    assert floors.name_of("building:4000000") == "building:4000000"
