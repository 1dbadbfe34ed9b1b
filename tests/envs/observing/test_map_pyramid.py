"""The pyramid of the known map: against a plain one, and against the observed map."""

import math

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.observing.map_pyramid import write_pyramid

OPTIONS = {"robots": 2, "lidar": "lidar_360_6m", "map_cells": 32}


def plain_pyramid(log_odds, row, column, levels, side):
    """Cut, pool and stack by whole arrays."""
    known = np.argwhere(log_odds != 0)
    reach = int(np.abs(known - (row, column)).max(initial=0))
    widest = max(math.ceil((reach + 1) / (side // 2)), 1)
    pictures = []
    for level in range(levels):
        scale = max(round(float(widest) ** (level / (levels - 1) if levels > 1 else 1.0)), 1)
        margin = scale * side
        padded = np.pad(log_odds.astype(int), margin)
        top, left = (value + margin - scale * (side // 2) for value in (row, column))
        cut = padded[top : top + scale * side, left : left + scale * side]
        tiers = np.where(cut > 0, 0, np.where(cut == 0, 127, 255))
        pictures.append(tiers.reshape(side, scale, side, scale).min(axis=(1, 3)))
    return np.array(pictures, np.uint8)


@pytest.mark.parametrize(("levels", "side"), [(1, 8), (2, 4), (3, 8), (5, 6)])
def test_pictures_are_those_of_a_plain_pyramid(levels, side):
    generator = np.random.default_rng(levels)
    for _ in range(15):
        log_odds = np.zeros((50, 64), np.int8)
        low, high = sorted(generator.integers(0, 50, 2))
        log_odds[low:high, 5:40] = generator.choice(np.array([-9, -9, 0, 9], np.int8), (high - low, 35))
        row, column = int(generator.integers(50)), int(generator.integers(64))
        pictures = np.empty((levels, side, side), np.uint8)
        write_pyramid(log_odds, row, column, pictures)
        assert np.array_equal(pictures, plain_pyramid(log_odds, row, column, levels, side))


def test_the_first_picture_is_the_map_and_the_last_shows_all_that_is_known():
    env = lidarium.parallel_env("apartment", observe=["map", "pyramid"], **OPTIONS, starts="fixed")
    observations, _ = env.reset(seed=1)
    for _ in range(20):
        for row, agent in enumerate(env.possible_agents):
            first, *_, last = observations[agent]["pyramid"]
            assert np.array_equal(first, observations[agent]["map"][0])
            walls = (env.beliefs.log_odds[row] > 0).any()
            assert (last == 0).any() == walls
        observations = env.step(dict.fromkeys(env.agents, np.array([0.5, 0.3], np.float32)))[0]


def test_rows_of_a_batch_see_the_same():
    compare_rows("velocity", 2, 15, ["apartment", "clinic"], observe=["pyramid"], pyramid_levels=4, seed=2)


def test_odd_sides_are_refused():
    with pytest.raises(ValueError, match="pyramid_cells is 31; want an even number"):
        lidarium.parallel_env("apartment", pyramid_cells=31)
