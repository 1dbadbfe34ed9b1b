"""The study of policies on drawn floors: run by the command, gone on with, and its table."""

import pytest

from lidarium.benchmarks.studies import policies
from lidarium.scripts.main import main


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(policies, "FLOORS", ("apartment",))
    monkeypatch.setattr(policies, "POLICIES", ("nearest_frontier", "random_walk"))
    monkeypatch.setattr(policies, "TEAMS", (1, 2))
    monkeypatch.setattr(policies, "SEEDS", range(2))
    monkeypatch.setattr(policies, "HORIZON_S", 4.0)


def test_one_command_makes_the_page_and_goes_on(tiny, tmp_path, monkeypatch):
    runs, out = tmp_path / "runs", tmp_path / "out"
    command = ["reproduce", "policies", "--runs", str(runs), "--out", str(out), "--workers", "1"]
    assert main([*command, "--every", "2"]) == 0
    page = (out / "policies.md").read_text()
    assert "`lidarium reproduce policies --every 2`" in page
    assert "| floor | policy | 1 robot | 2 robots |" in page
    assert "| apartment | nearest_frontier | " in page
    assert "random_walk" not in page
    entries = (runs / "policies" / policies.ENTRIES_FILE).read_text()
    assert main(command) == 0
    page = (out / "policies.md").read_text()
    assert "| apartment | random_walk | " in page
    whole = (runs / "policies" / policies.ENTRIES_FILE).read_text()
    assert whole.startswith(entries)
    assert len(whole.splitlines()) == 4
    monkeypatch.setattr(policies, "run_episode", None)
    assert main(command) == 0


def test_an_entry_is_the_median_time_or_the_least_coverage_with_contacts():
    line = {"times_s": [30.0, 10.0, 20.0], "coverages": [0.99, 0.99, 0.99], "collisions": 0}
    assert policies.cell(line) == "20 s"
    short = {"times_s": [30.0, None, 20.0], "coverages": [0.99, 0.625, 0.99], "collisions": 3}
    assert policies.cell(short) == "62.5 %, 3 contacts"
