"""Routes that a policy has planned itself: robots follow them as they are."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.onboard.radio.messages import MOST_POINTS, DriveState, Route, Target

HALL = Floor("hall", (0.0, 0.0, 8.0, 4.0), starts=np.array([[1.0, 2.0, 0.0], [7.0, 2.0, math.pi]]))


def made(floor=HALL, **options):
    env = lidarium.parallel_env(
        floor, level="waypoint", **{"starts": "fixed", "robots": 1, "stop_coverage": None, "map_cells": 64, **options}
    )
    env.reset(seed=0)
    return env


def route(*points, heading=None, room=0.1):
    return Route(np.array(points, float), np.full(len(points), room), heading)


def driven(env, actions, decisions=40):
    """Drive until the first robot has arrived; return its places after each decision."""
    places = []
    for _ in range(decisions):
        infos = env.step(actions)[4]
        places.append(env.unwrapped.belief("robot_0").pose)
        if infos["robot_0"]["drive"] is DriveState.ARRIVED:
            break
    return np.array(places)


def test_a_robot_follows_its_route_to_the_end_and_turns_as_it_says():
    env = made()
    way = route((0.0, 0.0), (1.0, 1.2), (2.0, 1.2), (2.0, 0.0), heading=1.0)
    seen = []
    for _ in range(400):
        env.step({"robot_0": way})
        seen.append(env.unwrapped.belief("robot_0").pose)
        if env.drive_state("robot_0") is DriveState.ARRIVED:
            break
    poses = np.array(seen)
    assert poses[-1] == pytest.approx([2.0, 0.0, 1.0], abs=0.11)
    assert np.hypot(*(poses[:, :2] - (2.0, 1.2)).T).min() < 0.35
    assert env.driver.target(0) == Target(2.0, 0.0, 1.0)


def test_a_route_is_followed_where_the_planner_would_go_straight():
    env = made()
    poses = driven(env, {"robot_0": route((0.0, 0.0), (1.5, 1.4), (3.0, 0.0))})
    assert poses[:, 1].max() > 1.0
    straight = driven(made(), {"robot_0": Target(3.0, 0.0)})
    assert straight[:, 1].max() < 0.1


def test_the_same_route_again_goes_on_and_another_begins():
    env = made()
    way = route((0.0, 0.0), (3.0, 0.0))
    env.step({"robot_0": way})
    place = env.driver.drives.places[0]
    left = env.driver.route_left(0)
    assert left[-1] == pytest.approx([3.0, 0.0])
    env.step({"robot_0": route((0.0, 0.0), (3.0, 0.0))})
    assert env.driver.drives.places[0] == place
    assert env.unwrapped.belief("robot_0").pose[0] > 0.8
    env.step({"robot_0": route((1.0, 0.0), (1.0, 1.0))})
    assert env.driver.target(0) == Target(1.0, 1.0)
    env.step({"robot_0": Target(2.0, 0.0)})
    assert env.driver.route_left(0) is None, "a target is planned for as ever"
    env.step({"robot_0": None})
    assert env.drive_state("robot_0") is DriveState.IDLE


def test_a_route_of_one_point_is_a_turn():
    env = made()
    poses = driven(env, {"robot_0": route((0.0, 0.0), heading=2.0)})
    assert poses[-1] == pytest.approx([0.0, 0.0, 2.0], abs=0.11)


def test_robots_stop_before_what_their_lasers_see_on_a_route():
    wall = Solid(np.array([[3.0, 0.0], [3.2, 0.0], [3.2, 4.0], [3.0, 4.0]]))
    env = made(Floor("walled", (0.0, 0.0, 8.0, 4.0), (wall,), starts=np.array([[1.0, 2.0, 0.0]])))
    states = []
    for _ in range(12):
        env.step({"robot_0": route((0.0, 0.0), (4.0, 0.0))})
        states.append(env.drive_state("robot_0"))
    assert DriveState.BLOCKED in states
    assert env.unwrapped.world.collisions.sum() == 0
    assert env.unwrapped.world.poses[0, 0] < 3.0


def test_of_two_robots_on_routes_that_meet_one_gives_way_and_plans_anew():
    corridor = Floor(
        "corridor",
        (0.0, 0.0, 8.0, 3.0),
        (
            Solid(np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 1.0], [0.0, 1.0]])),
            Solid(np.array([[0.0, 1.6], [3.6, 1.6], [3.6, 3.0], [0.0, 3.0]])),
            Solid(np.array([[4.4, 1.6], [8.0, 1.6], [8.0, 3.0], [4.4, 3.0]])),
        ),
        starts=np.array([[2.6, 1.3, 0.0], [5.4, 1.3, math.pi]]),
    )
    env = made(corridor, robots=2)
    offsets = [env.unwrapped.perception.poses.offset(row) for row in range(2)]
    goals = np.array([[6.5, 1.3], [1.5, 1.3]])
    seen, ways = set(), {}
    for _ in range(60):
        for row, agent in enumerate(env.agents):
            state = env.drive_state(agent)
            seen.add(state)
            if state is DriveState.NO_PATH or agent not in ways:
                x, y = env.unwrapped.belief(agent).pose[:2]
                middle = 1.3 - offsets[row][1]
                ways[agent] = route((x, y), (x, middle), goals[row] - offsets[row])
        env.step(ways)
        if all(env.drive_state(agent) is DriveState.ARRIVED for agent in env.agents):
            break
    assert {DriveState.GIVING_WAY, DriveState.NO_PATH} <= seen
    assert np.abs(env.unwrapped.world.poses[:, :2] - goals).max() < 0.1
    assert env.unwrapped.world.collisions.sum() == 0


@pytest.mark.parametrize(
    ("points", "room", "heading", "match"),
    [
        (np.zeros((0, 2)), np.zeros(0), None, r"shape \(0, 2\); want \(P, 2\) with 1 to 512"),
        (np.zeros((3, 3)), np.zeros(3), None, r"shape \(3, 3\)"),
        (np.zeros((MOST_POINTS + 1, 2)), np.zeros(MOST_POINTS + 1), None, r"shape \(513, 2\)"),
        (np.zeros((3, 2)), np.zeros(2), None, r"room of the route has shape \(2,\); want \(3,\)"),
        (np.full((2, 2), np.nan), np.zeros(2), None, "not finite"),
        (np.zeros((2, 2)), np.zeros(2), math.inf, "heading of the route is inf"),
    ],
)
def test_what_is_no_route_is_refused(points, room, heading, match):
    with pytest.raises(ValueError, match=match):
        Route(points, room, heading)
