"""The study of evaluations: costs of a trial, workers and kills on a tiny suite, and the page."""

import pytest

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.evaluation import costs, programs
from lidarium.benchmarks.studies.evaluation import study as evaluation


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(costs, "SETTINGS", {**costs.SETTINGS, "horizon_s": 3.0})
    monkeypatch.setattr(costs, "FLOORS", ("apartment",))
    monkeypatch.setattr(evaluation, "ROUNDS", 1)
    monkeypatch.setattr(evaluation, "gain_of_workers", lambda seeds: (1.95, 6 * seeds))


def test_a_tiny_share_runs_and_is_not_run_again(tiny, tmp_path):
    study = STUDIES["evaluation"]
    done = list(study.work(tmp_path, None, 50, 1))
    assert done == [("costs of trials", 1, 1), ("comparisons of workers", 1, 1), ("killed evaluations", 1, 1)]
    assert list(study.work(tmp_path, None, 50, 1)) == []
    page = study.page(tmp_path, "lidarium reproduce evaluation --every 50")
    assert "Measured with `lidarium reproduce evaluation --every 50` on " in page
    assert "| apartment, nearest_frontier | " in page
    assert "Two workers are 1.95 x as fast as one" in page
    assert "on 6 episodes" in page
    assert "was killed (SIGKILL) 1 times" in page


def test_workers_are_compared_on_the_same_suite(monkeypatch):
    codes = []

    def run_here(command, check):
        codes.append(command[-1])
        exec(command[-1].replace(", 2)", ", 1)"))

    monkeypatch.setattr(programs.subprocess, "run", run_here)
    monkeypatch.setattr(programs, "SETTINGS", {**costs.SETTINGS, "horizon_s": 3.0})
    gain, episodes = programs.gain_of_workers(1, ("scene_corner",))
    assert gain > 0.0
    assert episodes == len(programs.POLICIES)
    assert [code[-4:] for code in codes] == [", 1)", ", 2)"]


def test_a_share_has_fewer_seeds_and_kills(monkeypatch):
    assert evaluation.Comparison(20, 0).key != evaluation.Comparison(2, 0).key
    assert evaluation.Kills(50).key != evaluation.Kills(5).key
