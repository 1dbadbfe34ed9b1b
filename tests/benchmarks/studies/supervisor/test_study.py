"""The experiment of supervised teams: what is run, and a tiny part of it from end to end."""

import shutil

import numpy as np
import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.supervisor import study as supervisor
from lidarium.benchmarks.studies.supervisor import suites as plan
from lidarium.benchmarks.studies.supervisor.goals import Goal
from lidarium.benchmarks.studies.supervisor.study import failing_suite, typical_runs
from lidarium.benchmarks.studies.supervisor.tables import (
    alone_table,
    bumper_table,
    failing_table,
    left_table,
    team_table,
)
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.free_space import reachable_free_space
from lidarium.envs.floors.starts import draw_starts
from lidarium.evaluation.statistics import Interval
from lidarium.evaluation.suites.campaign import Campaign

SMALL = {**plan.SETTINGS, "localization": "truth", "odometry": "ideal", "horizon_s": 1.0}


def test_the_whole_plan_has_ten_generated_and_five_other_floors_ten_seeds_and_three_policies():
    suites = plan.suites(None)
    assert len(suites["teams"].floors) == 15
    assert len(suites["five"].floors) == 5
    assert suites["teams"].seeds == tuple(range(10))
    assert suites["teams"].robots == (2, 3)
    for name in ("pairs", "three", "teams", "five"):
        assert suites[name].policies == ("supervised", "independent", "oracle_starts")
    assert sum(1 for _ in suites["alone"].trials()) == 2 * 3 * 3
    assert sum(1 for _ in suites["pairs"].trials()) == 2 * 2 * 10 * 3


def test_a_share_takes_seeds_first_and_then_floors():
    tenth, hundredth = plan.suites(None, 10)["teams"], plan.suites(None, 100)["teams"]
    assert (len(tenth.floors), len(tenth.seeds)) == (15, 1)
    assert (len(hundredth.floors), len(hundredth.seeds)) == (2, 1)


@pytest.mark.parametrize("name", ["building:3000003", "building:3000018", "building:3000009"])
def test_floors_are_as_large_as_is_said(name):
    raster = load_floor(name).raster(0.05, 0.05, 0.52)
    starts = draw_starts(raster, 0.18, 1, np.random.default_rng(0))
    assert reachable_free_space(raster, 0.18, starts).sum() * 0.05**2 == pytest.approx(plan.GENERATED[name], abs=1.0)


def test_a_folder_without_the_real_floors_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no floor .*lifull"):
        plan.suites(tmp_path)


def make_tiny(monkeypatch):
    monkeypatch.setattr(plan, "SETTINGS", SMALL)
    monkeypatch.setattr(supervisor, "SETTINGS", SMALL)
    monkeypatch.setattr(plan, "TO_THE_END", {"stop_coverage": None})
    monkeypatch.setattr(plan, "GENERATED", {"apartment": 65.0})
    monkeypatch.setattr(plan, "STAND_INS", {})
    monkeypatch.setattr(plan, "EXTENDED", ("apartment",))
    monkeypatch.setattr(plan, "EXTENSIONS", {"returns home": {"returns_home": True}})
    monkeypatch.setattr(plan, "RADIOS", {"radio in line of sight": {"kind": "line_of_sight"}})
    monkeypatch.setattr(plan, "POLICIES", ("supervised", "oracle_starts"))


@pytest.fixture
def tiny(monkeypatch):
    make_tiny(monkeypatch)


@pytest.fixture(scope="module")
def tenth(tmp_path_factory):
    """All runs of a tenth of the tiny study."""
    folder = tmp_path_factory.mktemp("tenth")
    with pytest.MonkeyPatch.context() as monkeypatch:
        make_tiny(monkeypatch)
        for name, suite in STUDIES["supervisor"].suites(None, 10).items():
            campaign = Campaign(suite, folder / name, records=False)
            assert len(list(campaign.run())) == campaign.total > 0
            assert not campaign.failures
    return folder


def test_a_tiny_share_runs_from_end_to_end_and_is_not_run_again(tiny, tenth, tmp_path):
    study = STUDIES["supervisor"]
    shutil.copytree(tenth, tmp_path, dirs_exist_ok=True)
    steps = list(study.work(tmp_path, None, 10, 1))
    assert steps == [step for step in steps if step[0] in ("runs in which a robot fails", "logs")]
    assert list(study.work(tmp_path, None, 10, 1)) == steps
    page = study.page(tmp_path)
    absent = ("Wrong merges", "Typical", "Runs that left", "Generated", "Real floors")
    assert_published("supervisor", page, tmp_path, absent)
    for heading in (
        "What was to be reached",
        "Test 1",
        "Test 2: pairs, clinic",
        "Test 3",
        "All floors",
        "Five robots",
        "Bumpers",
        "Extensions",
    ):
        assert f"## {heading}" in page
    assert "`oracle_starts`" in page
    assert "nan" not in page
    assert page.count("energy of all [kJ]") == 3


def row(policy, robots, seed, t99, floor="f", start=(0.0, 0.0, 0.0), **more):
    return {
        "key": f"default | {floor} | {robots} | seed {seed} | {policy}",
        "policy": policy,
        "robots": robots,
        "seed": seed,
        "variant": "default",
        "t99_s": t99,
        "horizon_s": 100.0,
        "starts": [list(start)] * robots,
        "path_m": [t99 or 100.0] * robots,
        "overlap": 0.5,
        **more,
    }


def test_the_typical_run_is_the_middle_one_of_a_team_that_missed_something():
    rows = {
        "teams": [row("supervised", 2, seed, t99) for seed, t99 in enumerate((50.0, 40.0, 90.0))],
        "five": [],
        "one": [],
    }
    rows["one"] = [row("independent", 1, 0, 100.0)]
    missed, reached = (
        Goal("time", "<= 0.62", Interval(0.7, 0.6, 0.8, 0.95, 3), is_reached, robots=2) for is_reached in (False, True)
    )
    assert typical_runs(rows, [missed])["2 robots"]["seed"] == 0
    assert typical_runs(rows, [reached]) == {}


def test_where_runs_are_counted_the_typical_one_is_one_of_those_that_missed():
    missing = [row("supervised", 3, seed, 50.0) for seed in (4, 5, 6)]
    goal = Goal(
        "runs in which a wrong merge was used [%]",
        "0",
        Interval(1.0, 0.1, 2.0, 0.95, 300),
        False,
        missed_by=tuple(missing),
    )
    assert typical_runs({"teams": [], "five": [], "one": []}, [goal]) == {
        "runs in which a wrong merge was used": missing[1]
    }


def test_runs_that_left_something_are_listed_beside_those_of_the_other_policies():
    def death(policy, seed, covered):
        return row(
            policy,
            2,
            seed,
            50.0,
            c_others_final=covered,
            coverage_final=1.0,
            time_s=80.0,
            ended_because={"robot_0": "failed", "robot_1": "no_frontier"},
        )

    runs = [
        death("supervised", 0, 0.976),
        death("independent", 0, 0.995),
        death("supervised", 1, 0.999),
        death("independent", 1, 0.5),
    ]
    assert left_table(runs).splitlines()[2:] == ["| `f` | 2 | 0 | 97.60 | 99.50 | - | no_frontier | 80 |"]


def test_pauses_are_counted_by_cause_and_robots_that_were_left_paused():
    def events(*states):
        return [
            {"time_s": 1.0, "kind": "state", "agent": agent, "state": state, "reason": reason}
            for agent, state, reason in states
        ]

    met = ("robot_0", "paused", "contact")
    runs = [
        row(
            "supervised",
            2,
            0,
            None,
            iou_occupied=0.5,
            operating=events(met, ("robot_1", "paused", "blocked"), ("robot_0", "stopped", "horizon")),
        ),
        row(
            "resumes",
            2,
            0,
            60.0,
            iou_occupied=0.7,
            operating=events(met, ("robot_0", "operating", "order"), ("robot_0", "stopped", "covered")),
        ),
    ]
    cells = [line.strip("| ").split(" | ") for line in bumper_table(runs).splitlines()[2:]]
    assert [line[1:5] + line[6:] for line in cells] == [
        ["`supervised`", "2", "1", "0 %", "1", "1", "0", "100", "0.50"],
        ["`resumes`", "2", "1", "100 %", "1", "0", "1", "0", "0.70"],
    ]


def test_energy_stands_in_tables_of_runs_that_count_it():
    alone = [row("independent", 1, 0, 100.0, energy_j=[900.0])]
    runs = [row("supervised", 2, 0, 50.0, energy_j=[400.0, 500.0], merges={"wrong": 0, "false": 0})]
    assert team_table(runs, alone).splitlines()[2].endswith("| 0.90 | 1.00 |")
    assert "0.90" in alone_table(alone)
    assert "energy" not in team_table([{**runs[0], "energy_j": None}], alone)


def test_the_page_is_of_what_was_asked_for_though_the_folder_holds_more(tiny, tenth, tmp_path):
    study = STUDIES["supervisor"]
    shutil.copytree(tenth, tmp_path, dirs_exist_ok=True)
    assert list(Campaign(study.suites(None, 5)["pairs"], tmp_path / "pairs", records=False).run())
    asked = sum(1 for suite in study.suites(None, 10).values() for _ in suite.trials())
    assert not any(step[0] != "logs" for step in study.work(tmp_path, None, 10, 1))
    assert f"{asked} runs," in study.page(tmp_path)


def test_a_robot_dies_at_half_of_what_its_own_team_took():
    teams = plan.suites(None, 100)["teams"]
    floor = teams.floors[0]
    suite, trials = failing_suite([row("supervised", 3, 0, 80.0, floor)], teams)
    assert [trial.policy for trial in trials] == list(plan.POLICIES)
    fault = suite.settings(trials[0].variant, 3).faults.schedule[0]
    assert (fault.kind, fault.robot, fault.at_s) == ("dead_robot", 0, 40.0)
    assert failing_suite([row("supervised", 3, 0, None, floor)], teams) == (None, [])


def test_what_the_others_cover_of_what_a_dead_robot_leaves_is_told(tiny, tmp_path):
    teams = plan.suites(None, 10)["teams"]
    suite, trials = failing_suite([row("supervised", 2, 0, 1.0, "apartment")], teams)
    lines = list(Campaign(suite, tmp_path, records=False, trials=trials[:1]).run())
    assert [line["policy"] for line in lines] == ["supervised"]
    assert lines[0]["ended_because"]["robot_0"] == "failed"
    assert 0.0 < lines[0]["c_others_final"] < lines[0]["coverage_final"]
    assert f"| 2 | `supervised` | 0 of 1 | {100.0 * lines[0]['c_others_final']:.1f} |" in failing_table(lines)
