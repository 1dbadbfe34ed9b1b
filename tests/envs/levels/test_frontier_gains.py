"""What may be expected to be seen at frontiers: against a plain loop, alone and in batches."""

import math

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.levels.frontier_choices import expected_gain, ray_directions

OPTIONS = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m", "level": "frontier"}
OBSERVE = ["frontiers", "frontier_gains"]


def plain_gain(log_odds, row, column, reach):
    """Sum the unknown cells along each ray, each for its part of the ring."""
    area, rays = 0.0, ray_directions()
    for along_rows, along_columns in rays:
        steps = np.arange(1, reach + 1)
        at = np.floor([row + 0.5 + steps * along_rows, column + 0.5 + steps * along_columns]).astype(int)
        inside = ((at >= 0) & (at < np.array(log_odds.shape)[:, None])).all(axis=0)
        levels = np.where(inside, log_odds[tuple(np.where(inside, at, 0))], 1)
        open_until = np.argmax(levels > 0) if (levels > 0).any() else reach
        area += steps[:open_until][levels[:open_until] == 0].sum()
    return area * 2.0 * math.pi / len(rays)


def test_gains_are_those_of_a_plain_loop():
    generator = np.random.default_rng(3)
    for _ in range(30):
        log_odds = generator.choice(np.array([-20, 0, 0, 20], np.int8), (30, 40), p=[0.6, 0.2, 0.15, 0.05])
        row, column = generator.integers(30), generator.integers(40)
        for reach in (1, 7, 60):
            found = expected_gain(log_odds, row, column, ray_directions(), reach)
            assert found == pytest.approx(plain_gain(log_odds, row, column, reach))


def test_an_unknown_disc_is_seen_whole():
    log_odds = np.zeros((101, 101), np.int8)
    assert expected_gain(log_odds, 50, 50, ray_directions(), 40) == pytest.approx(math.pi * 40**2, rel=0.05)


def test_gains_are_observed_beside_the_frontiers():
    env = lidarium.parallel_env("apartment", observe=OBSERVE, **OPTIONS, starts="fixed")
    observations, _ = env.reset(seed=1)
    for _ in range(4):
        for agent, observation in observations.items():
            assert set(observation) == {"frontiers", "action_mask", "frontier_gains"}
            assert env.observation_space(agent).contains(observation)
            count = int(observation["action_mask"][:-1].sum())
            assert (observation["frontier_gains"][:count] > 0.0).all()
            assert not observation["frontier_gains"][count:].any()
        observations = env.step(dict.fromkeys(env.agents, 0))[0]


def test_rows_of_a_batch_expect_the_same():
    options = {key: value for key, value in OPTIONS.items() if key not in ("level", "robots")}
    compare_rows("frontier", 2, 12, ["apartment", "clinic"], observe=OBSERVE, seed=8, **options)


def test_frontiers_can_be_had_alone():
    env = lidarium.parallel_env("apartment", observe=["frontiers"], observation="flat", **OPTIONS, starts="fixed")
    assert env.observation_space("robot_0").shape == (33 + 32 * 4,)
    assert env.reset(seed=0)[0]["robot_0"].shape == (33 + 32 * 4,)


@pytest.mark.parametrize("name", ["frontiers", "frontier_gains", "action_mask"])
def test_other_levels_have_no_frontiers(name):
    for level in ("velocity", "waypoint"):
        with pytest.raises(ValueError, match=f"observe has {name!r}, which needs level='frontier'"):
            lidarium.parallel_env("apartment", **{**OPTIONS, "level": level, "observe": [name]})
        with pytest.raises(ValueError, match=f"observe has {name!r}, which needs level='frontier'"):
            lidarium.vector_env(1, "apartment", **{**OPTIONS, "level": level, "observe": [name]})
