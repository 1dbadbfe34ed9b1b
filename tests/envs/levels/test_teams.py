"""Environments of teams at a level, in the forms of conventions."""

import numpy as np
import pytest

from lidarium.envs.faces.conventions import Conventions
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.faces.randomized_team import RandomizedTeam
from lidarium.envs.faces.teams import TeamPlan, at_level, make_team
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.settings.making import make_settings


@pytest.mark.parametrize(
    ("level", "kind"),
    [("velocity", ExplorationEnv), ("waypoint", WaypointExploration), ("frontier", FrontierExploration)],
)
def test_a_level_has_its_environment(level, kind):
    env = make_team(TeamPlan("scene_room", level), {"robots": 2})
    assert type(env) is kind
    assert env.unwrapped.settings.robots == 2


def test_unknown_levels_and_what_a_level_lacks_are_refused():
    with pytest.raises(ValueError, match="level is 'thought'; want velocity, waypoint or frontier"):
        at_level(ExplorationEnv("scene_room", make_settings(robots=1)), "thought")
    with pytest.raises(ValueError, match="needs level='frontier'"):
        make_team(TeamPlan("scene_room"), {"robots": 1, "observe": ("scan", "frontier_gains")})


def test_conventions_and_draws_are_split_from_settings():
    flat = make_team(TeamPlan("scene_room"), {"robots": 1, "observation": "flat"})
    assert len(flat.observation_space("robot_0").shape) == 1
    drawn = make_team(TeamPlan("scene_room"), {"robots": 2, "randomize": {"time_step": (0.05, 0.1)}})
    assert isinstance(drawn, RandomizedTeam)


def test_the_curriculum_of_an_episode_is_asked_for_that_one_alone():
    asked = []

    def curriculum(number):
        asked.append(number)
        return {"starts": np.array([[1.0, 1.0, 0.0]])}

    plan, settings = TeamPlan("scene_room", curriculum=curriculum), make_settings(robots=1)
    env = plan.environment(settings, Conventions(), episode=7)
    for _ in range(2):
        env.reset(seed=0, options={"starts": "fixed"})
    assert asked == [7, 7]
