"""A level of one's own, in one file, is an action of every face."""

import numpy as np
import pytest
from gymnasium import spaces
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.levels.frontier import FrontierLevel

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


@pytest.fixture
def registered():
    """Registers levels under a name for one test."""
    names = []

    def register(name, kind):
        names.append(name)
        return lidarium.level(name, "reads rows in its own way")(kind)

    yield register
    for name in names:
        lidarium.registry("level").unregister(name)


@pytest.mark.parametrize(
    ("base", "action", "read"),
    [
        (lidarium.VelocityLevel, np.array([0.4, 0.1], np.float32), lambda actions: 0.5 * actions),
        (lidarium.WaypointLevel, np.array([0.4, 0.1], np.float32), lambda actions: 0.5 * actions),
        (FrontierLevel, 3, lambda actions: 0 * actions),
    ],
)
def test_a_level_that_reads_rows_in_its_own_way_does_so_at_every_face(base, action, read, registered):
    class Own(base):
        def read_rows(self, actions, live):
            return super().read_rows(read(np.asarray(actions)), live)

    registered("own_way", Own)
    options = {"level": "own_way", "robots": 1, "observe": ["velocity"], "lidar": {"beams": 40}, "horizon_s": 20.0}
    env = lidarium.parallel_env("apartment", **options)
    rows, dicts = (lidarium.vector_env(1, "apartment", **options) for _ in range(2))
    for each in (env, rows, dicts):
        each.reset(seed=0)
    for _ in range(5):
        env.step({"robot_0": action})
        rows.step(np.array([action]))
        dicts.step([{"robot_0": action}])
    poses = [env.unwrapped.world.poses, rows.engine.world.poses, dicts.engine.world.poses]
    assert np.array_equal(poses[0], poses[1])
    assert np.array_equal(poses[0], poses[2])
    env.step({"robot_0": lidarium.Target(0.5, 0.0)})
    assert env.unwrapped.driver.target(0) == lidarium.Target(0.5, 0.0)


def test_actions_of_an_own_level_are_not_rounded(registered):
    class Three(lidarium.VelocityLevel):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.action_space = spaces.Discrete(3)

        def read_rows(self, actions, live):
            return super().read_rows(np.stack([0.1 * actions, 0.0 * actions], axis=1), live)

    registered("three_speeds", Three)
    env = lidarium.parallel_env("apartment", level="three_speeds", robots=1)
    env.reset(seed=0)
    for action in (1, 2.0, np.int8(1)):
        env.step({"robot_0": action})
    for action in (1.7, "2", [1, 2]):
        with pytest.raises(ValueError, match="action of robot_0 is"):
            env.step({"robot_0": action})
