"""How soon a team that has the floor plan could have seen the floor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from linked_places import STAR, graph_of
from linked_rooms import ROOM, TWO_ROOMS, settings_of

import lidarium
from lidarium.envs.floors.catalogue.store import FOLDER_VARIABLE
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import MOST_POINTS
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.bounds.bound import Walk, _pieces, drive, known_floor_bound, walks_of
from lidarium.evaluation.bounds.tours import TourPlan
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
    env = lidarium.parallel_env("building:4", settings=settings, starts="fixed")
    env.reset(seed=0)
    starts = env.world.starts.tolist()
    bound = known_floor_bound("building:4", settings, starts)
    assert math.isfinite(bound.time_s)
    run_episode(lidarium.policy("tour_frontier"), env, 0, {"starts": starts})
    assert bound.time_s <= env.scorer.time


def test_robots_drive_on_past_a_goal():
    with_goal = replace(TWO_ROOMS, goal=(1.4, 2.0))
    bounds = [
        known_floor_bound(floor, settings_of(), TWO_ROOMS.starts[:1], rounds=20) for floor in (TWO_ROOMS, with_goal)
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
    for name, value in (("doors", 0.5), ("people", 2)):
        with pytest.raises(ValueError, match=f"{name} is {value}; bounds are for floors without doors that move"):
            known_floor_bound(ROOM, replace(settings_of(), **{name: value}), ROOM.starts)
    with pytest.raises(ValueError, match="stop_coverage is None"):
        known_floor_bound(ROOM, make_settings(robots=1, stop_coverage=None), ROOM.starts)
    with pytest.raises(ValueError, match="one for each of 2 robots"):
        known_floor_bound(ROOM, settings_of(2), ROOM.starts)


def walk_along(points, headings=None):
    points = np.asarray(points, np.float64)
    nothing = np.full(len(points), math.nan)
    return Walk(points, np.full(len(points), 0.1), nothing if headings is None else np.asarray(headings))


def test_a_piece_has_no_more_room_than_its_ends():
    graph = graph_of(STAR, [[2], [4], [6]])
    graph.room[:] = [0.5, 0.2, 0.4, 0.5, -0.1, 0.5, 0.5]
    plan = TourPlan([[2]], [[0, 1, 2, 1, 0, 3, 4]], np.array([7.0]), 1.0)
    (walk,) = walks_of(graph, plan, {(0, 2): 1.5})
    assert walk.room.tolist() == pytest.approx([0.5, 0.2, 0.2, 0.2, 0.2, 0.5, 0.0])
    assert walk.headings[2] == 1.5
    assert np.isnan(np.delete(walk.headings, 2)).all()


def test_routes_end_where_the_robot_turns_and_join_up():
    walk = walk_along([(k, 0.0) for k in range(6)], [math.nan, math.nan, 0.5, math.nan, math.nan, math.nan])
    first, second = _pieces(walk, np.array([1.0, 2.0]))
    assert first.points.tolist() == [[-1.0, -2.0], [0.0, -2.0], [1.0, -2.0]]
    assert first.heading == 0.5
    assert second.points[0].tolist() == first.points[-1].tolist()
    assert second.heading is None


def test_a_long_walk_is_parted_without_a_gap():
    points = np.stack([np.arange(2.5 * MOST_POINTS), np.zeros(int(2.5 * MOST_POINTS))], axis=1)
    pieces = _pieces(walk_along(points), np.zeros(2))
    assert max(len(piece.points) for piece in pieces) <= MOST_POINTS
    joined = np.concatenate([pieces[0].points, *(piece.points[1:] for piece in pieces[1:])])
    assert np.array_equal(joined, points)


def test_robots_that_block_each_other_come_to_an_end():
    starts = [[3.0, 0.3, 0.0], [1.0, 0.3, 0.0]]
    corridor = Floor("corridor", (0.0, 0.0, 20.0, 0.6), (), starts=np.array(starts))
    stands, passes = walk_along([(3.0, 0.3)]), walk_along([(1.0, 0.3), (17.0, 0.3)])
    late, share, poses = drive(corridor, settings_of(robots=2), starts, [stands, passes])
    assert late == math.inf
    assert share < 0.7
    assert poses[:, 0].max() < 3.5


def test_a_robot_that_drives_on_sees_the_second_room_and_one_that_stays_does_not():
    starts = TWO_ROOMS.starts[:1].tolist()
    stays = walk_along([(1.0, 2.0)])
    goes = walk_along([(1.0, 2.0), (4.0, 2.0), (6.0, 2.0)], [math.pi, math.nan, math.pi])
    late, share, _ = drive(TWO_ROOMS, settings_of(), starts, [stays])
    assert late == math.inf
    assert share < 0.9
    soon, share, poses = drive(TWO_ROOMS, settings_of(), starts, [goes])
    assert math.isfinite(soon)
    assert share >= 0.99
    assert poses.shape[1] == 3
    assert poses[0] == pytest.approx(starts[0])


def test_a_room_that_is_seen_at_once_takes_no_time():
    time, share, _ = drive(ROOM, settings_of(), ROOM.starts.tolist(), [walk_along([(2.0, 1.5)], [math.pi])])
    assert time < 10.0
    assert share >= 0.99
