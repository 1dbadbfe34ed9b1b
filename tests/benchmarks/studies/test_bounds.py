"""The study of bounds: run by the command, gone on with, and its page."""

import json

import pytest
from published_pages import assert_published, keep

from lidarium.benchmarks.studies import bounds
from lidarium.scripts.main import main

pytest.importorskip("ortools", reason="OR-Tools is not installed")


def line_of(robots, known_s, time_s):
    return {
        "floor": "a",
        "robots": robots,
        "known_s": known_s,
        "seen": 0.99,
        "times_s": dict.fromkeys(bounds.POLICIES, time_s),
    }


def test_one_command_makes_the_page_and_goes_on(monkeypatch, tmp_path):
    monkeypatch.setenv("LIDARIUM_FLOOR_STORE", "off")
    monkeypatch.setattr(bounds, "SMALL_FLOORS", ("apartment:3",))
    monkeypatch.setattr(bounds, "set_floors", lambda name: ["apartment:3"])
    monkeypatch.setattr(bounds, "POLICIES", ("tour_frontier",))
    monkeypatch.setattr(bounds, "TEAMS", (1,))
    monkeypatch.setattr(bounds, "ROUNDS", 10)
    monkeypatch.setattr(bounds, "PLAN_ROUNDS", 10)
    monkeypatch.setattr(bounds, "SPACING", (2.4, 1.5))
    monkeypatch.setattr(bounds, "EXACT_S", 0.0)
    command = ["reproduce", "bounds", "--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "out")]
    assert main([*command, "--workers", "1"]) == 0
    page = (tmp_path / "out" / "bounds.md").read_text()
    assert "Made by `lidarium reproduce bounds" in page
    (small,) = (tmp_path / "runs" / "bounds" / bounds.TIGHT_FILE).read_text().splitlines()
    found = json.loads(small)
    assert 0.0 < found["lower_m"] <= found["plan_m"] + 1e-6
    assert found["optimum_m"] is None
    (row,) = (tmp_path / "out" / "bounds_how_tight.csv").read_text().splitlines()[1:]
    assert row.startswith(f"apartment:3,{found['places']},{found['plan_m']:.2f},")
    (team,) = (tmp_path / "runs" / "bounds" / bounds.FLOORS_FILE).read_text().splitlines()
    found = json.loads(team)
    assert found["known_s"] <= found["times_s"]["tour_frontier"]
    monkeypatch.setattr(bounds, "known_floor_bound", None)
    monkeypatch.setattr(bounds, "plan_tours", None)
    assert main([*command, "--workers", "1"]) == 0


def test_entries_are_medians_of_multiples_of_the_bound(monkeypatch):
    monkeypatch.setattr(bounds, "TEAMS", (1,))
    lines = [line_of(1, 10.0, 20.0), line_of(1, 20.0, 60.0), line_of(1, 30.0, None)]
    cells = bounds.table(lines).strip("| ").split(" | ")
    assert cells == ["1", "20", *["3.00"] * len(bounds.POLICIES)]


def test_teams_of_which_no_plan_saw_enough_are_left_out(monkeypatch):
    monkeypatch.setattr(bounds, "TEAMS", (1, 2))
    first, second = bounds.table([line_of(1, None, 50.0), line_of(2, 10.0, 20.0)]).splitlines()
    assert first == "| 1 | - |" + " - |" * len(bounds.POLICIES)
    assert second.startswith("| 2 | 10 | 2.00 |")


def test_the_page_of_stored_figures_is_that_which_is_published(tmp_path):
    small = {"floor": "a", "places": 9, "plan_m": 8.0, "lower_m": 7.5}
    keep(tmp_path / bounds.TIGHT_FILE, [{**small, "optimum_m": 7.9}, {**small, "optimum_m": None}])
    keep(tmp_path / bounds.FLOORS_FILE, [line_of(robots, 10.0, 20.0) for robots in bounds.TEAMS])
    assert_published("bounds", bounds.page(tmp_path), tmp_path)
