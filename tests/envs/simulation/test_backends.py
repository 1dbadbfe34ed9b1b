"""What makes a simulation from settings, by name."""

import numpy as np
import pytest

from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.backends import BACKENDS, kinematic_world, make_kinematic, simulation_of
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation


@pytest.mark.parametrize("episodes", [1, 3])
def test_a_simulation_has_the_team_of_the_settings_in_each_episode(episodes):
    settings = make_settings(robots=2, lidar="lidar_360_6m", time_step=0.05)
    simulation = BACKENDS["kinematic"](settings, episodes)
    assert isinstance(simulation, KinematicSimulation)
    assert (simulation.robots, simulation.episodes) == (2, episodes)
    assert simulation.world.poses.shape == (2 * episodes, 3)
    assert simulation.ranges.shape == (2 * episodes, 180)
    assert np.array_equal(simulation.world.bodies, [robot.numbers for robot in settings.team])


def test_a_camera_is_mounted_where_the_settings_have_one():
    assert make_kinematic(make_settings(robots=1)).camera is None
    settings = make_settings(robots=1, camera="depth_64x48")
    assert simulation_of(kinematic_world(settings), settings).camera.camera == settings.camera


def test_unknown_backends_are_refused_with_those_that_are_known():
    with pytest.raises(ValueError, match="kinematic"):
        make_settings(backend="kinematik")
