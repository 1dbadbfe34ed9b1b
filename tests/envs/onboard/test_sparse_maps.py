"""Sparse maps are made from when they are asked for, together by robots that share what they know."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.geometry.rigid import Transform

HALL = Floor("hall", (0.0, 0.0, 6.0, 4.0), starts=np.array([[1.0, 2.0, 0.3], [1.0, 0.8, -0.2]]))
CAMERA = {"columns": 32, "rows": 24, "pitch": 0.35}


def team(floor=HALL, **options):
    env = lidarium.parallel_env(
        floor, **{"starts": "fixed", "robots": 2, "camera": CAMERA, "stop_coverage": None, "map_cells": 32, **options}
    )
    env.reset(seed=0)
    return env, env.perception.sparse_maps


def turn(env, steps=5):
    for _ in range(steps):
        env.step({agent: [0.0, 0.5] for agent in env.agents})


def test_only_maps_that_were_asked_for_are_made_until_the_episode_ends():
    env, maps = team()
    assert maps.made == {}
    mapper = maps.of(1)
    assert list(maps.made) == [1]
    assert maps.of(1) is mapper
    assert len(mapper.ground) == 1
    turn(env)
    assert len(mapper.ground) > 1
    maps.start([1])
    assert maps.made == {}
    assert maps.of(1) is not mapper


def test_robots_that_share_their_maps_have_common_axes_and_ground():
    env, maps = team()
    assert maps.of(0).axes == maps.of(1).axes
    alone, shared = maps.belief(0, shares_map=False), maps.belief(0)
    assert shared.seen_m2 > alone.seen_m2
    assert shared.seen_m2 == maps.belief(1).seen_m2
    # Each is answered in a frame of its own.
    gap = shared.frame.apply([0.0, 0.0]) - maps.belief(1).frame.apply([0.0, 0.0])
    assert gap == pytest.approx(env.perception.poses.offset(1) - env.perception.poses.offset(0))


def test_axes_are_those_of_the_walls_that_the_first_robot_saw():
    turned = Transform(3.0, 2.2, math.radians(30.0)).apply([[0.0, -2.0], [0.3, -2.0], [0.3, 2.0], [0.0, 2.0]])
    starts = np.array([[4.6, 2.0, 0.0], [1.6, 1.4, math.radians(30.0)]])
    slanted = Floor("slanted", HALL.bounds, (Solid(turned),), starts=starts)
    axes = []
    for order in ((0, 1), (1, 0)):
        maps = team(slanted)[1]
        first, second = (maps.of(row).axes for row in order)
        assert first == second
        axes.append(first)
    assert axes == pytest.approx([0.0, math.radians(30.0)], abs=0.03)


def test_robots_that_do_not_know_each_other_share_nothing():
    _, maps = team(known_starts=False)
    assert maps.belief(0).seen_m2 == maps.belief(0, shares_map=False).seen_m2
    assert list(maps.made) == [0, 1], "both make maps, to have them when they are joined"


def test_what_is_known_is_worked_out_again_only_where_a_map_has_changed():
    env, maps = team()
    before = maps.belief(0).navigation
    assert maps.belief(0).navigation.ground is before.ground
    turn(env)
    assert maps.belief(0).navigation.ground is not before.ground


def test_who_has_ended_or_whose_episode_does_not_run_takes_nothing_in():
    env, maps = team()
    mappers = [maps.of(row) for row in range(2)]
    env.world.flags[1] |= ENDED
    turn(env)
    assert len(mappers[0].ground) > 1
    assert len(mappers[1].ground) == 1
    count = len(mappers[0].trail), mappers[0].version
    for runs in (np.array([False]), np.array([True])):
        env.beliefs.believed[0, :2] += 0.5
        maps.sense(runs)
        has_changed = (len(mappers[0].trail), mappers[0].version) != count
        assert has_changed == bool(runs[0])


def test_a_robot_that_cannot_make_sparse_maps_is_told_why():
    for camera, words in ((None, "have no depth camera"), ({"pitch": -0.8}, "sees the ground only from")):
        _, maps = team(camera=camera)
        with pytest.raises(ValueError, match=words):
            maps.check()
    team()[1].check()
