"""Hashes of whole episodes: a change that is to keep the behaviour keeps it to the bit.

``golden_episodes.json`` holds the hashes. Where a change of behaviour is wanted, write them anew with
``python tests/test_golden_episodes.py --write [CASE ...]``, all or some of them, and say so in CHANGELOG.md.
Delete ``keys`` or ``form_keys`` first if new keys of infos are to count.
"""

import json
import platform
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
import scipy
from episode_ledger import Ledger
from hashed_episodes import (
    Case,
    command,
    drawn_floor,
    faults,
    formed,
    learner_rows,
    made_rows,
    part,
    policy,
    rows,
    solo,
    team,
    turns,
)

GOLDEN = Path(__file__).with_name("golden_episodes.json")

THREADS = min(2, numba.config.NUMBA_NUM_THREADS)
ALL_SEEN = ("scan", "pose", "velocity", "bumper", "map", "egocentric_map")
WEAK = part("RadioSettings", kind="signal", power=-28.0, shadowing=4.0, loss=0.2, latency_s=0.3)
REAL = {"localization": "slam", "odometry": "typical", "noise": "datasheet", "known_starts": False}

CASES: dict[str, Case] = {
    # Levels of decision, floors, bodies, lasers, sizes of teams.
    "velocity": team("apartment", 300, robots=3),
    "velocity_one_robot": team("building:5", 300, robots=1, noise="thesis", observe=ALL_SEEN),
    "velocity_nine_robots": team("scene_loop", 50, robots=9, noise="datasheet", threads=THREADS, lidar="lidar_360_6m"),
    "velocity_unknown_starts": team(
        "clinic",
        300,
        robots=2,
        known_starts=False,
        noise="datasheet",
        observe=ALL_SEEN,
        egocentric_scales=(1, 4, 16),
    ),
    "velocity_drawn_floor": team(drawn_floor, 300, robots=2, resolution=0.1),
    "velocity_set": team("set:train", 300, robots=2, max_cycles=100, starts="fixed"),
    "velocity_pioneer": team("office:3", 200, robots=2, robot="pioneer", lidar="lidar_360_20m"),
    "velocity_service": team("corridors:2", 200, robots=2, robot="service", raster_resolution=0.05),
    "velocity_point": team("srt_lab", 200, robots=1, robot="point", time_step=0.05),
    "contact_ends": team("apartment:4", 300, robots=3, stop_on_contact=True),
    "goal": team("srt_l_room", 300, robots=1, goal_radius=4.5),
    "covered": team("scene_room", 30, "frontier", robots=3, stop_coverage=0.6),
    "waypoint": team("apartment", 60, "waypoint", robots=3),
    "waypoint_unknown_starts": team("building:5", 40, "waypoint", robots=2, known_starts=False, noise="datasheet"),
    "waypoint_orders": team("clinic", 30, "waypoint", ordered=True, robots=2),
    "frontier": team("apartment", 60, "frontier", robots=3, stop_coverage=0.99),
    "frontier_one_robot": team("building:17", 50, "frontier", robots=1, observe=ALL_SEEN),
    "frontier_ends": team("srt_corridor", 60, "frontier", robots=2),
    "frontier_five_robots": team("office:3", 12, "frontier", robots=5, noise="thesis", resolution=0.025),
    # Who says where a robot is, how well wheels tell.
    "odometry_ideal": team("apartment", 200, robots=2, localization="odometry"),
    "odometry_good": team("apartment", 200, robots=2, localization="odometry", odometry="good"),
    "odometry_typical": team("clinic", 40, "frontier", robots=2, localization="odometry", odometry="typical"),
    "odometry_poor": team("clinic", 200, robots=2, localization="odometry", odometry="poor", known_starts=False),
    "slam_ideal": team("apartment", 200, robots=2, localization="slam"),
    "slam_typical": team("apartment", 14, "frontier", robots=2, **REAL),
    "splines_ideal": team("srt_l_room", 100, robots=1, localization="splines"),
    "splines_typical": team("clinic", 100, robots=2, **{**REAL, "localization": "splines"}),
    "splines_ekf_ideal": team("srt_l_room", 150, robots=1, localization="splines_ekf"),
    "splines_ekf_typical": team("clinic", 80, robots=2, **{**REAL, "localization": "splines_ekf"}),
    # Radios, faults, energy, pauses, all of it.
    "radio_none": team("apartment", 30, "frontier", robots=3, radio="none"),
    "radio_range": team("apartment", 40, "frontier", robots=3, radio=part("RadioSettings", kind="range", reach=4.0)),
    "radio_line_of_sight": team("clinic", 40, "frontier", robots=3, radio="line_of_sight"),
    "radio_signal": team("clinic", 40, "frontier", robots=3, radio="signal"),
    "radio_weak": team("office:3", 40, "frontier", robots=4, radio=WEAK),
    "radio_weak_orders": team("clinic", 30, "waypoint", ordered=True, robots=2, radio=WEAK),
    "faults": team("apartment", 250, robots=3, faults=faults, localization="odometry", odometry="good"),
    "faults_frontier": team("apartment", 40, "frontier", robots=3, faults=faults, radio="line_of_sight"),
    "battery": team("clinic", 40, "frontier", robots=2, battery=part("Battery", capacity_j=250.0)),
    "battery_kobuki": team("clinic", 150, robots=2, battery="kobuki"),
    "pauses": team("scene_corner", 30, "waypoint", ordered=True, robots=3, pauses_when_blocked=True),
    "lab": team("clinic", 150, robots=2, realism="lab"),
    "field": team("apartment", 10, "frontier", robots=3, realism="field"),
    # Merged maps.
    "merged_velocity": team("scene_room", 150, merged=False, robots=2, known_starts=False),
    "merged_frontier": team("apartment", 30, "frontier", merged=False, robots=3, known_starts=False, noise="datasheet"),
    "merged_told": team("clinic", 30, "waypoint", merged=True, robots=3, known_starts=False, radio="line_of_sight"),
    # One robot by Gymnasium, turns by PettingZoo, rows.
    "solo_velocity": solo("Exploration", "velocity", 200, floor="building:3", max_cycles=180),
    "solo_waypoint": solo("WaypointExploration", "waypoint", 30, floor="srt_t_junction"),
    "solo_frontier": solo("FrontierExploration", "frontier", 40, floor="scene_loop_corridor"),
    "turns": turns("clinic", 300, robots=2, max_cycles=100),
    "rows_velocity": rows("set:train", 200, robots=2, max_cycles=90, observe=ALL_SEEN, threads=THREADS, starts="fixed"),
    "rows_waypoint": rows("apartment", 30, "waypoint", robots=2, noise="datasheet", copy=False),
    "rows_frontier": rows("building:5", 30, "frontier", robots=3, threads=THREADS, max_cycles=400, known_starts=False),
    "rows_faults": rows("clinic", 20, "frontier", robots=3, threads=1, faults=faults, radio="range"),
    "rows_field": rows("clinic", 6, "frontier", threads=1, robots=2, realism="field"),
    "rows_registered": rows("clinic", 20, "waypoint", made_rows),
    "rows_learner": learner_rows("building:5", 120, robots=2, max_cycles=50),
    # Policies.
    "random_walk": policy("random_walk", "apartment", 300, robots=3),
    "nearest_frontier": policy("nearest_frontier", "apartment", 1000, robots=3, stop_coverage=0.99),
    "nearest_frontier_each": policy(
        "nearest_frontier", "clinic", 300, each=True, robots=2, radio="range", noise="datasheet"
    ),
    "nearest_frontier_own_map": policy("nearest_frontier_own_map", "clinic", 1200, robots=2),
    "nearest_frontier_merged": policy("nearest_frontier", "apartment", 400, merged=True, robots=2, known_starts=False),
    "utility_frontier": policy("utility_frontier", "building:17", 1000, robots=3),
    "explore_lite": policy("explore_lite", "office:3", 1000, robots=2, noise="thesis"),
    "tour_frontier": policy("tour_frontier", "apartment", 1000, robots=2, stop_coverage=0.99),
    "predicted_tours": policy("predicted_tours", "apartment", 1000, robots=2, stop_coverage=0.99),
    "srt": policy("srt", "srt_l_room", 300, robots=1),
    "srt_explores": policy("srt", "clinic", 300, robots=1, stop_coverage=0.9),
    "srt_team": policy("srt", "apartment", 200, robots=2, radio="line_of_sight"),
    "srt_thesis": policy("srt", "srt_lab", 300, setup={"mode": "thesis"}, robots=1),
    "supervised": policy("supervised", "apartment", 800, robots=3, known_starts=False),
    "supervised_slam": policy("supervised", "clinic", 250, robots=2, faults=partial(faults, 2), **REAL),
    "supervised_extended": policy(
        "supervised",
        "apartment",
        450,
        robots=3,
        known_starts=False,
        radio="signal",
        setup={"assignment": "hungarian", "avoids_rendezvous": True, "returns_home": True},
    ),
    "independent": policy("independent", "clinic", 1500, robots=2, known_starts=False),
    "oracle_starts": policy("oracle_starts", "clinic", 900, robots=3, known_starts=False, reveals_starts=True),
    # Whole runs by the command line.
    "run": command("--robots 2 --horizon-s 11 --map-resolution 0.05"),
    "run_ideal": command("--policy nearest_frontier --floor clinic --horizon-s 60 --map-resolution 0.05"),
    "run_goal": command(
        "--floor srt_t_junction --robots 1 --policy nearest_frontier --horizon-s 40 --map-resolution 0.05"
    ),
}
FORMS: dict[str, dict[str, Any]] = {
    "plain": {},
    "flat": {"observation": "flat", "infos": "flat", "team_reward": 0.5},
    "bare": {"infos": "none", "team_reward": 0.25, "reward": part("RewardSettings", more=(("turning", -0.1),))},
    "talking": {"comm": 2, "radio": "line_of_sight"},
    "kept": {"ended_agents": "zeros", "infos": "flat"},
    "merged": {"merging": part("MergingSettings", period_s=2.0), "known_starts": False},
    "drawn": {"randomize": {"lidar.noise_floor": (0.0, 0.05), "occupancy.resolution": [0.05, 0.1]}},
    "sized": {"randomize": {"robots": (1, 3)}},
    "limited": {"battery": part("Battery", capacity_j=120.0)},
    "slam": {"localization": "slam", "odometry": "typical", "noise": "datasheet"},
    "bullet": {"backend": "bullet"},
}
"""Conventions and options with which every face and level runs."""

FORMED: list[str] = []
"""Names of the cases of ``FORMS``."""

REFUSED_IN_ROWS = ("kept", "sized", "limited")
"""What only a single environment does."""

for _n, (_form, _options) in enumerate(FORMS.items()):
    for _level, _steps in (("velocity", 60), ("waypoint", 8), ("frontier", 8)):
        for _face in ("parallel", "rows", "learner"):
            if (_face != "parallel" and _form in REFUSED_IN_ROWS) or (_face == "parallel" and _form == "merged"):
                continue
            if _face == "learner" and _form in ("drawn", "bullet", "slam"):
                continue
            FORMED.append(f"{_face}_{_level}_{_form}")
            CASES[FORMED[-1]] = formed(
                _face,
                _level,
                100 + _n,
                _steps,
                **{
                    "floor": "building:5" if _n % 2 else "apartment",
                    "robots": 2,
                    "max_cycles": 45 if _level == "velocity" else 200,
                    "stop_on_contact": True,
                    **_options,
                    **({"robots": 3} if _form == "talking" else {}),
                },
            )


def made_with() -> dict[str, str]:
    """Return what hashes of floats depend on."""
    versions = {module.__name__: ".".join(module.__version__.split(".")[:2]) for module in (np, numba, scipy)}
    return {**versions, "machine": platform.machine()}


def run(name: str, kept: dict[str, Any] | None) -> Ledger:
    """Run a case; of infos, results and decisions those keys count that were there when hashes were made."""
    ledger = Ledger(CASES[name].block, None if kept is None else kept[keys_of(name)])
    CASES[name].run(ledger)
    return ledger


def keys_of(name: str) -> str:
    """Return which list of keys holds for a case."""
    return "form_keys" if name in FORMED else "keys"


def difference(kept: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """Return in words how an episode differs from the one that was kept."""
    said = [f"{found['steps']} steps in place of {kept['steps']}"] if found["steps"] != kept["steps"] else []
    for part_name, row in kept["parts"].items():
        whole, *marks = row.split()
        new_whole, *new_marks = found["parts"].get(part_name, "none").split()
        if whole != new_whole:
            block = next(
                (n for n, pair in enumerate(zip(marks, new_marks, strict=False)) if pair[0] != pair[1]),
                len(marks),
            )
            first = block * kept["block"]
            where = (
                f"steps {first} to {first + kept['block']}" if block < len(marks) else f"what comes after step {first}"
            )
            said.append(f"{part_name} differ, first in {where}")
    return said


@pytest.fixture(scope="module")
def golden() -> dict[str, Any]:
    """What is kept; skipped where libraries are others than those it was made with."""
    kept: dict[str, Any] = json.loads(GOLDEN.read_text())
    ours = made_with()
    for name in ("numpy", "numba", "scipy", "machine"):
        if kept["made_with"][name] != ours[name]:
            pytest.skip(f"hashes were made with {name} {kept['made_with'][name]}, this is {ours[name]}")
    return kept


@pytest.mark.filterwarnings("ignore:.*is out of date:DeprecationWarning")  # version 0 of the ids
@pytest.mark.parametrize("name", CASES)
def test_an_episode_is_the_same_to_the_bit(name, golden):
    kept = golden["cases"]
    said = difference(kept[name], run(name, golden).summary())
    assert not said, f"{name}: {'; '.join(said)}"


def write(names: list[str]) -> None:
    """Write hashes of all cases, or of some, and tell how long each took."""
    kept: dict[str, Any] = {**json.loads(GOLDEN.read_text()), "found": {}}
    for name in names or CASES:
        began = time.perf_counter()
        ledger = run(name, kept if kept.get(keys_of(name)) else None)
        keys = kept["found"].setdefault(keys_of(name), {}) if not kept.get(keys_of(name)) else {}
        for part_name, met in ledger.met.items():
            keys[part_name] = sorted({*keys.get(part_name, ()), *met})
        kept["cases"][name] = ledger.summary()
        print(f"{name:28} {ledger.steps:5} steps {time.perf_counter() - began:6.2f} s", flush=True)
        save(kept)


def save(kept: dict[str, Any]) -> None:
    """Write the file, its cases in the order of ``CASES``."""
    whole = {
        "made_with": made_with(),
        **{name: kept["found"].get(name, kept.get(name)) for name in ("keys", "form_keys")},
        "cases": {name: kept["cases"][name] for name in CASES if name in kept["cases"]},
    }
    GOLDEN.write_text(json.dumps(whole, indent=1) + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] != ["--write"]:
        sys.exit("usage: python tests/test_golden_episodes.py --write [CASE ...]")
    write(sys.argv[2:])
