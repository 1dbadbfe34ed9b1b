"""The study of floors from cache and store: three phases in processes, gone on with, and the tables."""

import os

import pytest

from lidarium.benchmarks.studies import STUDIES, floor_cache


def test_a_tiny_share_runs_in_processes_and_is_not_run_again(tmp_path, monkeypatch):
    monkeypatch.setattr(floor_cache, "FLOORS", 2)
    monkeypatch.setattr(floor_cache, "PROCESSES", 1)
    monkeypatch.setattr(floor_cache, "EPISODES", (2,))
    study, environment = STUDIES["floor_cache"], dict(os.environ)
    done = list(study.work(tmp_path, None, 1, 1))
    assert list(dict.fromkeys(phase for phase, *_ in done)) == ["cold", "warm", "held 2"]
    assert dict(os.environ) == environment
    rows = floor_cache.rows_of(tmp_path / floor_cache.LOG_FILE)
    made, loaded = ({row["floor"] for row in rows if row["phase"] == phase} for phase in ("cold", "warm"))
    assert made == loaded
    assert len(made) == 2
    assert list(study.work(tmp_path, None, 1, 1)) == []
    page = study.page(tmp_path, "lidarium reproduce floor_cache")
    assert "The store holds 2 floors" in page
    assert "| warm: from the store | 2 | " in page
    assert page.count("2 floors held") == 1
    with pytest.raises(ValueError, match="resets of other floors"):
        next(study.work(tmp_path, None, 2, 1))


def test_a_process_that_fails_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(floor_cache, "SECONDS_BETWEEN_READS", 0.05)
    with pytest.raises(RuntimeError, match="a process of phase cold failed"):
        list(floor_cache.run_phase(os.abort, "cold", [[]], tmp_path / "log", 1))
