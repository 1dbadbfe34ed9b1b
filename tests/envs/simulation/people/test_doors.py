"""Doors hang in openings, open when somebody comes, and robots pass them."""

from dataclasses import replace

import numpy as np
import pytest
from doored_rooms import ROOMS, robot_at_door

from lidarium.envs.engine.beginnings import begin
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.envs.floors.starts import check_starts
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.reset_options import ResetOptions
from lidarium.envs.simulation.kernels.arrays import (
    DOOR_KIND,
    DOOR_OPEN,
    OPENS,
    STAYS_SHUT,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
)
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.envs.simulation.people.doors import draw_doors, middles_of, openings_of, with_shut_doors
from lidarium.evaluation.suites.starts import drawn_starts

HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0))


def test_an_opening_between_walls_is_found_with_its_ends():
    openings = openings_of(ROOMS.raster(0.025, 1.8, 1.9))
    assert openings.shape == (1, 4)
    assert openings[0, [0, 2]] == pytest.approx([4.0, 4.0], abs=0.06)
    assert sorted(openings[0, [1, 3]]) == pytest.approx([1.5, 2.4], abs=0.08)


def test_a_door_where_no_opening_is_is_refused():
    ExplorationEnv(replace(HALL, name="another of the same walls"), make_settings(robots=1)).reset(seed=0)
    env = ExplorationEnv(HALL, make_settings(robots=1, doors=0.5))
    with pytest.raises(ValueError, match=r"doors is 0\.5, but floor 'hall' has no opening of 0\.65 to 1\.6 m"):
        env.reset(seed=0)


def test_a_drawn_floor_without_openings_has_no_doors():
    env = ExplorationEnv([HALL, ROOMS], make_settings(robots=1, doors=1.0))
    doors = {}
    for seed in range(8):
        env.reset(seed=seed)
        doors[env.floor.name] = int((env.simulation.population.doors_of(0)[:, DOOR_KIND] > 0).sum())
    assert doors == {"hall": 0, "rooms": 1}


def test_a_door_opens_when_a_robot_comes_and_shuts_behind_it():
    env, door = robot_at_door()
    opened, places = [], []
    for _ in range(170):
        env.step({"robot_0": np.array([0.5, 0.0], np.float32)})
        opened.append(door[DOOR_OPEN])
        places.append(env.world.poses[0, 0])
    opened, places = np.array(opened), np.array(places)
    assert opened[places < 2.5].max() == 0.0
    assert opened[np.abs(places - 4.0) < 0.3].min() == pytest.approx(1.0)
    assert places[-1] > 7.0
    assert opened[-1] == pytest.approx(0.0)
    assert env.world.collisions[0] == 0


def test_a_shut_door_stops_a_robot_and_hides_what_is_behind():
    env, _ = robot_at_door(STAYS_SHUT)
    for _ in range(120):
        env.step({"robot_0": np.array([0.5, 0.0], np.float32)})
    assert env.world.poses[0, 0] == pytest.approx(4.0 - 0.02 - 0.18, abs=0.06)
    assert env.world.collisions[0] == 1
    assert env.scorer.coverage < 0.6


def test_a_door_that_opens_by_itself_is_no_part_of_the_map_and_a_shut_one_is():
    for kind, is_mapped in ((OPENS, False), (STAYS_SHUT, True)):
        env, door = robot_at_door(kind)
        for _ in range(10):
            env.step({"robot_0": np.array([0.1, 0.0], np.float32)})
        x, y = middles_of(door[None])[0]
        origin, side = env.beliefs.origins[0], env.settings.occupancy.resolution
        row, column = int((y - origin[1]) / side), int((x - origin[0]) / side)
        around = env.beliefs.log_odds[0][row - 3 : row + 4, column - 1 : column + 2]
        assert bool((around > 0).any()) is is_mapped


def test_robots_wait_at_a_door_and_explore_what_is_behind_it():
    from lidarium.agents.catalogue import make_policy
    from lidarium.evaluation.episodes.runner import run_episode

    env = ExplorationEnv(ROOMS, make_settings(robots=1, doors=1.0, horizon_s=120.0))
    # A seed with a door that opens when somebody comes.
    seed = next(seed for seed in range(20) if _kind(env, seed) == OPENS)
    run_episode(make_policy("nearest_frontier"), env, seed)
    assert env.scorer.coverage >= 0.99
    assert env.world.collisions.sum() == 0


def _kind(env, seed):
    env.reset(seed=seed)
    return env.simulation.population.doors_of(0)[0, DOOR_KIND]


def test_people_open_doors_too_and_no_leaf_shuts_on_them():
    env, door = robot_at_door(people=2)
    people = env.simulation.population.people_of(0)
    middle = middles_of(door[None])[0]
    widths, gaps = [], []
    for _ in range(400):
        env.step({"robot_0": np.zeros(2, np.float32)})
        if (np.hypot(*(people[:, [WALKER_X, WALKER_Y]] - middle).T) < 0.3).any():
            widths.append(door[DOOR_OPEN])
        (leaf,) = crowd_of(env.simulation.population).leaves
        gaps += [gap_to(leaf, person) for person in people] if door[DOOR_OPEN] < 1.0 else []
    assert len(widths) > 10
    assert min(widths) > 0.5
    assert min(gaps) > -1e-6


def gap_to(leaf, person):
    """Return the gap between a person and a leaf [m]."""
    along = leaf[2:] - leaf[:2]
    away = person[[WALKER_X, WALKER_Y]] - leaf[:2]
    share = np.clip(away @ along / max(along @ along, 1e-12), 0.0, 1.0)
    return np.hypot(*(away - share * along)) - person[WALKER_RADIUS]


def test_a_door_that_stays_shut_does_not_cut_off_a_start_of_the_floor():
    rooms = Floor("rooms", ROOMS.bounds, ROOMS.solids, starts=np.array([(1.0, 2.0, 0.0), (7.0, 2.0, 0.0)]))
    env = ExplorationEnv(rooms, make_settings(robots=2, doors=1.0, horizon_s=5.0))
    for seed in range(20):
        env.reset(seed=seed)
        assert env.simulation.population.doors_of(0)[0, DOOR_KIND] != STAYS_SHUT


@pytest.mark.parametrize(
    ("floor", "robots", "doors", "seed"), [("apartment", 3, 1.0, 4), ("building:3000005", 3, 0.5, 2)]
)
def test_a_door_that_stays_shut_does_not_cut_off_a_start_that_is_asked_for(floor, robots, doors, seed):
    settings = make_settings(robots=robots, doors=doors, horizon_s=5.0)
    starts = np.array(drawn_starts(floor, settings, seed))
    env = ExplorationEnv(floor, settings)
    env.reset(seed=seed, options={"starts": starts})
    shut = with_shut_doors(env.world.floors[0].body, _shut(env))
    check_starts(shut, settings.robot.radius, starts)


def test_doors_are_the_same_whether_drawn_starts_are_known_or_not():
    settings, generator = make_settings(robots=3, doors=1.0), np.random.default_rng(0)
    for _ in range(12):
        start = begin(generator, FloorChoice("set:test"), ResetOptions(), settings)
        given = (start.tables, settings.doors, settings.robot.radius, start.seed)
        np.testing.assert_array_equal(draw_doors(*given), draw_doors(*given, start.starts))


def _shut(env):
    doors = env.simulation.population.doors_of(0)
    return doors[doors[:, DOOR_KIND] == STAYS_SHUT]
