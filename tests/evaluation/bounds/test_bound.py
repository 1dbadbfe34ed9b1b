"""What a team that knows the floor needs, on floors where that is known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from linked_rooms import ROOM, TWO_ROOMS, settings_of

import lidarium
from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.bounds.bound import known_floor_bound
from lidarium.evaluation.episodes.runner import run_episode

pytest.importorskip("ortools", reason="OR-Tools is not installed")


@pytest.fixture(autouse=True)
def no_store(monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, "off")


def test_a_room_is_seen_from_where_the_robot_stands():
    bound = known_floor_bound(ROOM, settings_of(), ROOM.starts)
    assert bound.share >= 0.99
    assert bound.length_m < 0.5
    assert bound.time_s < 6.0


def test_the_second_room_is_seen_once_its_corners_are():
    bound = known_floor_bound(TWO_ROOMS, settings_of(), TWO_ROOMS.starts[:1])
    assert bound.share >= 0.99
    assert 2.0 < bound.length_m < 4.5
    assert bound.time_s >= bound.length_m / 0.33 - 1.0


@pytest.mark.parametrize("robots", [1, 2])
def test_no_explorer_is_faster(robots):
    settings = settings_of(robots, horizon_s=600.0)
    env = lidarium.parallel_env("building:4", settings=settings)
    env.reset(seed=0)
    starts = env.world.starts.tolist()
    bound = known_floor_bound("building:4", settings, starts)
    assert math.isfinite(bound.time_s)
    run_episode(lidarium.policy("tour_frontier"), env, 0, {"starts": starts})
    assert bound.time_s <= env.scorer.time


def test_robots_drive_on_past_a_goal():
    with_goal = replace(TWO_ROOMS, goal=(1.4, 2.0))
    bounds = [
        known_floor_bound(floor, settings_of(), TWO_ROOMS.starts[:1], rounds=20)
        for floor in (TWO_ROOMS, with_goal)
    ]
    assert bounds[1].share >= 0.99
    assert bounds[0].time_s == bounds[1].time_s


def test_where_no_plan_sees_enough_the_drive_that_saw_most_is_returned(monkeypatch):
    shares = iter([0.3, 0.8, 0.5] * 3)

    def drive(floor, team, starts, walks):
        return math.inf, next(shares), np.asarray(starts)

    monkeypatch.setattr("lidarium.evaluation.bounds.bound.drive", drive)
    bound = known_floor_bound(TWO_ROOMS, settings_of(), TWO_ROOMS.starts[:1], rounds=0)
    assert (bound.time_s, bound.share) == (math.inf, 0.8)


def test_a_bound_is_kept_and_the_same_again(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "store"))
    first = known_floor_bound(TWO_ROOMS, settings_of(), TWO_ROOMS.starts[:1])
    monkeypatch.setattr("lidarium.evaluation.bounds.bound.plan_tours", None)
    again = known_floor_bound(TWO_ROOMS, settings_of(), TWO_ROOMS.starts[:1])
    assert (again.time_s, again.length_m, again.share) == (first.time_s, first.length_m, first.share)
    assert np.array_equal(again.walks[0].points, first.walks[0].points)


def test_settings_without_a_share_and_wrong_starts_are_refused():
    with pytest.raises(ValueError, match="stop_coverage is None"):
        known_floor_bound(ROOM, make_settings(robots=1, stop_coverage=None), ROOM.starts)
    with pytest.raises(ValueError, match="one for each of 2 robots"):
        known_floor_bound(ROOM, settings_of(2), ROOM.starts)
