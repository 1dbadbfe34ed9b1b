"""A level of one's own, in one file, is an action of every face."""

import numpy as np
import pytest
from gymnasium import spaces
from linked_rooms import TWO_ROOMS

import lidarium

STEPS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, 0.0]])


@pytest.fixture(scope="module", autouse=True)
def compass():
    """A robot drives a metre to the east, north, west or south, or stays."""

    @lidarium.level("compass", "a metre to the east, north, west or south")
    class Compass(lidarium.WaypointLevel):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.action_space = spaces.Discrete(5)

        def read_rows(self, actions, live):
            here = self.perception.beliefs.believed[:, :2] - self.perception.offsets
            return self.ways_to(here + STEPS[np.asarray(actions, np.int64)], live)

    yield Compass
    lidarium.registry("level").unregister("compass")


def test_a_single_environment_and_a_batch_take_the_level():
    options = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m", "observe": ["scan", "pose"]}
    env = lidarium.parallel_env(TWO_ROOMS, level="compass", **{"starts": "fixed", **options})
    rows = lidarium.vector_env(2, TWO_ROOMS, level="compass", **{"starts": "fixed", **options})
    assert env.action_space("robot_0") == rows.single_action_space == spaces.Discrete(5)
    observations, _ = env.reset(seed=1)
    rows.reset(seed=1)
    for choice in (0, 1, 4):
        observations, _, _, _, infos = env.step(dict.fromkeys(env.agents, choice))
        seen, *_ = rows.step(np.full(4, choice))
        for row, agent in enumerate(observations):
            assert np.array_equal(seen["pose"][row], observations[agent]["pose"])
    assert "drive" in infos["robot_0"]
    with pytest.raises(ValueError, match=r"action of robot_0 is 9; want one of Discrete\(5\)"):
        env.step(dict.fromkeys(env.agents, 9))


def test_names_that_are_taken_or_unknown_are_refused():
    with pytest.raises(ValueError, match="level 'velocity' is registered already"):
        lidarium.level("velocity")(lidarium.WaypointLevel)
    with pytest.raises(ValueError, match="unknown level 'compas'; did you mean 'compass'"):
        lidarium.parallel_env(TWO_ROOMS, level="compas")
