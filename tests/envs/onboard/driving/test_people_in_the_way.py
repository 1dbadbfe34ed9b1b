"""A robot drives round a person who stands in its way, and waits if there is no room."""

import numpy as np
import pytest

from lidarium.agents.policy import Policy
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import (
    BY_PERSON,
    BY_ROBOT,
    WALKER_SPEED,
    WALKER_VX,
    WALKER_VY,
    WALKER_WAIT,
    WALKER_X,
    WALKER_Y,
)
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher


class DriveAlong(Policy):
    """Sends a robot along the middle of a hall."""

    level, observes = "waypoint", ()

    def __init__(self, y):
        self._y = y

    def reset(self, team, seed=0):
        self.team = team

    def act(self, observations):
        x, y = np.array([5.5, self._y]) - self.team.belief("robot_0").frame
        return {"robot_0": Target(float(x), float(y))}


class Statue(Watcher):
    """Lets the person stand in the middle of the hall, once the robot has seen the other end."""

    def __init__(self, y):
        self._y = y

    def begin(self, env):
        self.poses, self.walker = [], env.simulation.population.people_of(0)[0]
        self._stand(7.5)

    def step(self, env, commands):
        self.poses.append(env.world.poses[0].copy())
        if len(self.poses) == 8:
            self._stand(3.5)

    def _stand(self, x):
        self.walker[[WALKER_X, WALKER_Y, WALKER_VX, WALKER_VY]] = x, self._y, 0.0, 0.0
        self.walker[[WALKER_SPEED, WALKER_WAIT]] = 0.0, 1e6


@pytest.mark.parametrize(("width", "has_room"), [(1.8, True), (1.0, False)])
def test_a_robot_drives_round_who_stands_or_waits(width, has_room):
    y = 0.5 * width
    statue = Statue(y)
    settings = make_settings(robots=1, people=1, horizon_s=60.0, stop_coverage=None, resolution=0.05)
    env = WatchedExploration(Floor("hall", (0.0, 0.0, 8.0, width)), settings, watchers=[statue])
    run_episode(DriveAlong(y), env, 0, {"starts": [(1.0, y, 0.0)]})
    poses = np.array(statue.poses)
    assert statue.walker[WALKER_X] == 3.5
    assert bool(poses[-1, 0] > 5.3) is has_room
    assert bool(np.abs(poses[:, 1] - y).max() > 0.4) is has_room
    assert env.simulation.safety[0, [BY_ROBOT, BY_PERSON]].tolist() == [0.0, 0.0]
    if not has_room:
        assert np.ptp(poses[-50:, 0]) < 0.2
