"""Each robot observes in its own map frame."""

import numpy as np
import pytest
from all_observed import ALL
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.agent_observations import AgentObservations
from lidarium.envs.engine.episode_start import EpisodeStart
from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.simulation.kernels.floor_cache import floor_tables

STARTS = np.array([[1.02, 2.03, 0.5], [1.51, 1.04, -1.0]])


def team(goal=None, **options):
    """Return what observes robots that have just started, and their environment."""
    env = lidarium.parallel_env(TWO_ROOMS, **{"robots": 2, "resolution": 0.05, "observe": ALL, **options})
    env.reset(seed=0, options={"starts": STARTS})
    settings = env.settings
    poses = KnownPoses(env.simulation, settings, np.zeros((2, 2)), [])
    made = AgentObservations(env.simulation, settings, goal is not None, poses)
    tables = floor_tables(TWO_ROOMS, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    made.start(EpisodeStart(TWO_ROOMS, tables, STARTS, 0, goal))
    return made, env


def test_poses_and_goals_are_within_the_frame_that_begins_at_the_cell_of_the_start():
    made, env = team(goal=(3.0, 1.0))
    assert made.offsets == pytest.approx(np.array([[1.0, 2.0], [1.5, 1.0]]))
    observed = made.of(env.agents)
    assert observed["robot_0"]["pose"] == pytest.approx([0.02, 0.03, 0.5])
    assert observed["robot_1"]["pose"] == pytest.approx([0.01, 0.04, -1.0])
    assert observed["robot_0"]["goal"] == pytest.approx([2.0, -1.0])
    assert observed["robot_1"]["goal"] == pytest.approx([1.5, 0.0])


def test_what_is_observed_is_that_of_the_settings_and_of_the_agents_asked_for():
    made, _ = team(observe=["scan", "velocity"])
    observed = made.of(["robot_1"])
    assert set(observed) == {"robot_1"}
    assert set(observed["robot_1"]) == {"scan", "velocity"}


def test_later_observations_leave_earlier_ones_as_they_are():
    made, env = team(observe=["pose"])
    before = made.of(env.agents)
    env.beliefs.believed[:, 0] += 1.0
    after = made.of(env.agents)
    assert before["robot_0"]["pose"] == pytest.approx([0.02, 0.03, 0.5])
    assert after["robot_0"]["pose"] == pytest.approx([1.02, 0.03, 0.5])


def test_who_does_not_know_its_start_knows_no_goal():
    made, env = team(goal=(3.0, 1.0), known_starts=False)
    assert not made.offsets.any()
    assert made.of(env.agents)["robot_0"]["goal"].tolist() == [0.0, 0.0]
