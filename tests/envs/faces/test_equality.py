"""Every row of a batch is the robot of a ``ParallelEnv`` with the same seed, to the bit, whatever the
level and the threads."""

import pytest

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.faults import FaultSettings
from lidarium.envs.settings.radio import RadioSettings

FLOORS = ("apartment", "building:3", "clinic", "building:17", "scene_room")
CLOSET = Floor("closet", (0.0, 0.0, 2.0, 1.6))


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_rows_of_a_batch_are_the_robots_of_parallel_environments(compare, level, threads):
    compare(level, threads, 25, FLOORS)


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_rows_are_the_same_with_noise_and_unknown_starts(compare, level):
    compare(level, 2, 12, FLOORS[:4], noise="datasheet", known_starts=False, seed=3)


def test_rows_are_the_same_where_robots_collide_and_end_one_by_one(compare):
    assert compare("velocity", 2, 150, [CLOSET] * 5, stop_on_contact=True, seed=5) >= 10


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_rows_are_the_same_at_the_horizon_and_in_the_episodes_after_it(compare, level):
    assert compare(level, 2, 40, ["apartment"] * 4, horizon_s=3.0, decision_period_s=0.5, seed=9) >= 8


def test_rows_are_the_same_when_all_is_covered_or_no_frontier_is_left(compare):
    assert compare("frontier", 2, 60, ["apartment"] * 4, stop_coverage=0.6, seed=1) >= 16
    assert compare("frontier", 1, 40, [CLOSET] * 2, stop_coverage=None, seed=1) >= 20


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
@pytest.mark.parametrize(
    "options",
    [
        {"localization": "odometry", "odometry": "poor", "noise": "datasheet"},
        {"radio": RadioSettings(kind="line_of_sight", reach=5.0, loss=0.2, latency_s=0.3)},
        {"faults": FaultSettings(laser_dropout=400.0, stuck_wheel=400.0, kidnapping=400.0, dead_robot=200.0)},
    ],
    ids=["odometry", "radio", "faults"],
)
def test_rows_are_the_same_in_worlds_that_are_not_ideal(compare, level, options):
    compare(level, 2, 12, FLOORS[:3], seed=6, **options)
