"""The experiment on the sensor-based random tree: shortest ways, lines that are kept, and the page."""

import itertools
import math

import numpy as np
import pytest
from published_pages import assert_published, keep

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.srt import goal_runs, tables
from lidarium.benchmarks.studies.srt import study as srt
from lidarium.benchmarks.studies.srt.ablations import VARIANTS
from lidarium.benchmarks.studies.srt.goal_runs import (
    MODES,
    TREES,
    VARIED_ON,
    WORLDS,
    GoalRun,
    drive_to_goal,
    measure_goal_run,
    measure_tree,
)
from lidarium.benchmarks.studies.srt.shortest_path import shortest_path
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.simulation.kernels.floor_cache import floor_tables

WALL = Solid(np.array([[2.0, 0.0], [2.2, 0.0], [2.2, 3.0], [2.0, 3.0]]))


def tables_of(*solids):
    return floor_tables(Floor("box", (0.0, 0.0, 5.0, 4.0), tuple(solids)), 0.025, 0.2, 0.3)


def test_the_shortest_way_is_straight_where_it_is_clear():
    assert shortest_path(tables_of(), (1.0, 1.0), (4.0, 2.0), 0.2) == pytest.approx(math.hypot(3.0, 1.0), abs=0.05)


def test_the_shortest_way_bends_round_a_wall_at_the_radius():
    corners = [(1.0, 1.0), (1.9, 3.2), (2.3, 3.2), (4.0, 1.0)]
    expected = sum(math.dist(a, b) for a, b in itertools.pairwise(corners))
    assert shortest_path(tables_of(WALL), (1.0, 1.0), (4.0, 1.0), 0.2) == pytest.approx(expected, rel=0.05)


def test_no_way_leads_to_where_the_disc_does_not_fit():
    assert shortest_path(tables_of(WALL), (1.0, 1.0), (4.0, 1.0), 0.6) is None


@pytest.fixture(scope="module")
def line():
    return measure_goal_run(GoalRun("default", "srt_lab", 0))


def test_a_run_towards_a_goal_is_measured(line):
    assert line["ending"] == "reached"
    assert line["ate_m"] < 0.05
    assert line["odometry_ate_m"] > 3.0 * line["ate_m"]
    assert line["path_m"] >= 0.97 * line["shortest_m"]
    assert line["coverage_curve"][-1] == pytest.approx(line["coverage"], abs=1e-4)


def test_tables_have_a_line_for_each_world_and_mode(line):
    lines = [{**line, "world": world, "mode": mode} for world in WORLDS for mode in MODES]
    assert tables.goals(lines).count("\n") == 1 + len(lines) + len(tables.PUBLISHED)
    assert tables.maps(lines).count("\n") == 1 + len(lines)
    assert "1.00 (1.00 to 1.00)" in tables.against_thesis_mode(lines)
    assert tables.ablations([{"variants": dict.fromkeys(VARIANTS, line)}]).count("\n") == 1 + len(VARIANTS)


def test_trees_by_variants_of_the_thesis_are_measured_with_and_without_a_goal(monkeypatch):
    monkeypatch.setitem(goal_runs.SETTINGS, "horizon_s", 30.0)
    thesis, ball = (measure_tree(GoalRun(tree, "srt_lab", 0)) for tree in ("thesis", "thesis, ball"))
    assert (thesis["mode"], ball["mode"]) == ("thesis", "thesis, ball")
    assert thesis["nodes"] != ball["nodes"]
    monkeypatch.setattr(goal_runs, "run_episode", lambda *_: None)  # it was run above
    assert drive_to_goal(GoalRun("thesis", "srt_lab", 0))[1].settings.drive == "controls"
    shown = tables.trees([{**thesis, "world": floor} for floor in VARIED_ON] + [ball])
    assert f"| apartment | thesis | 1 | {thesis['ending']} 1 | " in shown


def test_the_page_of_stored_figures_is_that_which_is_published(line, tmp_path):
    runs = [{**line, "world": world, "mode": mode} for world in WORLDS for mode in MODES]
    keep(tmp_path / srt.GOALS_FILE, [{**run, "key": f"{run['mode']} | {run['world']}"} for run in runs])
    keep(tmp_path / srt.TREES_FILE, [{**line, "key": tree, "mode": tree, "world": "apartment"} for tree in TREES])
    keep(tmp_path / srt.ABLATIONS_FILE, [{"variants": dict.fromkeys(VARIANTS, line)}])
    explored = [
        {"floor": "a", "policy": policy, "t99_s": 50.0, "d_sum99_m": 9.0, "key": policy} for policy in srt.POLICIES
    ]
    keep(tmp_path / srt.EXPLORATION / "episodes.jsonl", explored)
    assert_published("srt", srt.page(tmp_path), tmp_path)


def test_a_floor_on_which_a_run_did_not_get_there_is_told():
    episodes = [
        {"floor": "a", "policy": policy, "t99_s": time, "d_sum99_m": time}
        for policy, time in (("srt", None), ("nearest_frontier", 50.0), ("explore_lite", 60.0))
    ]
    assert "never" in tables.exploration(episodes, srt.POLICIES)


def test_a_share_asks_for_fewer_floors_and_starts():
    whole, part = (STUDIES["srt"].suites(None, every)[srt.EXPLORATION] for every in (1, 4))
    assert len(whole.floors) == 16
    assert len(part.floors) == 4
    assert set(part.seeds) < set(whole.seeds)


def test_what_is_measured_had_no_part_in_the_tuning():
    floors = STUDIES["srt"].suites(None, 1)[srt.EXPLORATION].floors
    assert min(srt.SEEDS) > 102
    assert min(srt.STARTS) >= 100
    assert set(floors) - set(srt.SCENES) == set(set_floors("validation:10"))
