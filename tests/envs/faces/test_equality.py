"""Rows of a batch are single environments on many floors, on some threads, and however episodes end."""

import pytest
from compared_faces import compare_rows

from lidarium.envs.faces.merged_maps import MergingSettings
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.faults import FaultSettings
from lidarium.envs.settings.radio import RadioSettings

FLOORS = ("apartment", "building:3", "clinic", "building:17", "scene_room")
CLOSET = Floor("closet", (0.0, 0.0, 2.0, 1.6))
LOSSY = RadioSettings(kind="line_of_sight", reach=5.0, loss=0.2, latency_s=0.3)


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_rows_are_the_same_on_floors_of_many_sizes(level):
    compare_rows(level, 2, 15, FLOORS)


def test_rows_are_the_same_if_robots_collide_and_end_one_by_one():
    assert compare_rows("velocity", 2, 100, [CLOSET] * 3, stop_on_contact=True, seed=5) >= 6


def test_rows_are_the_same_if_all_is_covered_or_no_frontier_is_left():
    assert compare_rows("frontier", 2, 30, ["apartment"] * 2, stop_coverage=0.6, seed=1) >= 4
    assert compare_rows("frontier", 1, 20, [CLOSET] * 2, stop_coverage=None, seed=1) >= 10


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
@pytest.mark.parametrize(
    "options",
    [
        {"localization": "odometry", "odometry": "poor", "noise": "datasheet"},
        {"radio": LOSSY, "comm": 2, "robots": 3},
        {"faults": FaultSettings(laser_dropout=400.0, stuck_wheel=400.0, kidnapping=400.0, dead_robot=200.0)},
    ],
    ids=["odometry", "radio", "faults"],
)
def test_rows_are_the_same_in_worlds_that_are_not_ideal(level, options):
    compare_rows(level, 2, 12, FLOORS[:3:2], seed=6, **options)


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_see_the_same_depth(threads):
    options = {"camera": "depth_64x48", "observe": ["pose", "depth"], "noise": "datasheet"}
    compare_rows("velocity", threads, 6, ["apartment"] * 2, seed=3, **options)


def test_rows_merge_the_same_maps():
    merging = MergingSettings(period_s=2.0)
    options = {"known_starts": False, "radio": "line_of_sight", "observe": ["pose"], "horizon_s": 4.0}
    compare_rows("velocity", 1, 45, ["scene_room", "apartment"], seed=5, merging=merging, **options)


@pytest.mark.parametrize("infos", ["full", "flat", "none"])
def test_rows_of_robots_that_have_ended_are_kept_the_same(infos):
    def stop(episode, step, team):
        if (episode, step) == (0, 0):
            team.stop("robot_1", "enough")

    options = {"ended_agents": "zeros", "infos": infos, "horizon_s": 1.0}
    assert compare_rows("velocity", 1, 12, ["scene_room"] * 2, before=stop, **options) >= 4
