"""The study of worlds that are not ideal: short episodes, gone on with, and the table."""

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES, realism


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(realism, "FLOORS", ("apartment",))
    monkeypatch.setattr(realism, "SEEDS", range(1))
    monkeypatch.setattr(realism, "REPEATED", 1)
    monkeypatch.setattr(realism, "REPEATS", 1)
    monkeypatch.setattr(realism, "HORIZON_S", 8.0)
    monkeypatch.setattr(realism, "TEAM_HORIZON_S", 1.0)


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path, monkeypatch):
    study = STUDIES["realism"]
    done = list(study.work(tmp_path, None, 1, 1))
    assert done == [
        ("speed of a team", 1, 1),
        ("episodes", 1, 2),
        ("episodes", 2, 2),
        ("longest corrections", 1, 1),
    ]
    monkeypatch.setattr(realism, "run_episode", None)
    assert list(study.work(tmp_path, None, 1, 1)) == []
    page = study.page(tmp_path)
    assert_published("realism", page, tmp_path)
    assert "| apartment | 1 | " in page
    assert "| apartment | 3 | " in page
    assert "A scan that is matched takes " in page
    assert "nan" not in page


def told(seed, *seconds):
    return {"spec": "apartment", "robots": 1, "seed": seed, "seconds": seconds}


def test_the_runs_with_the_longest_corrections_are_repeated():
    found = [
        told(0, (0.1, True)),
        told(1, (0.9, False)),
        told(2, (0.3, True)),
        told(3, (0.2, True), (0.4, True)),
    ]
    assert [run.seed for run in realism.longest_runs(found)] == [3, 2, 0]


def test_lines_on_corrections_hold_the_longest_and_say_where_there_is_none():
    found = [told(0, (0.001, False), (0.02, True)), told(1, (0.002, False))]
    assert "the longest 15.0 ms" in list(realism.times_of(found, [0.015]))[1]
    assert list(realism.times_of(found[1:], []))[1] == "The past was corrected at none."


def test_the_large_office_belongs_to_the_data(tmp_path):
    with pytest.raises(FileNotFoundError, match="want the folder floorplans"):
        next(STUDIES["realism"].work(tmp_path / "runs", tmp_path, 1, 1))
