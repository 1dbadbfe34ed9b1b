"""TorchRL wraps teams and single robots, and trains a team as it is."""

import math

import pytest
from trainer_scripts import ROOM, script

import lidarium

pytestmark = pytest.mark.filterwarnings("ignore")  # PettingZoo of another version than TorchRL's own tests

SEES = ["scan", "velocity", "bumper"]


@pytest.fixture(scope="module")
def torchrl():
    return script("with_torchrl", "torchrl", "torchrl")


def test_ppo_of_torchrl_trains_a_team(torchrl):
    earned = list(torchrl.train(ROOM, batches=2, decisions=20))
    assert len(earned) == 2
    assert all(math.isfinite(each) for each in earned)


@pytest.mark.parametrize("infos", ["flat", "none"])
@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_a_team_passes_the_check_of_torchrl(torchrl, level, observation, infos):
    from torchrl.envs.utils import check_env_specs

    options = {**ROOM, "robots": 2, "observe": SEES, "level": level, "stop_on_contact": True}
    leaving = lidarium.parallel_env(**options, observation=observation, infos=infos)
    env = torchrl.PettingZooWrapper(leaving, return_state=True, use_mask=True, done_on_any=False)
    check_env_specs(env)
    assert env.rollout(200)["next", "done"][-1]
    staying = lidarium.parallel_env(**options, observation=observation, infos=infos, ended_agents="zeros")
    env = torchrl.PettingZooWrapper(staying, return_state=True, done_on_any=False)
    check_env_specs(env)
    assert env.rollout(200)["next", "done"][-1]


@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("name", ["Exploration", "WaypointExploration", "FrontierExploration"])
def test_single_robots_pass_the_check_of_torchrl(torchrl, name, observation):
    from torchrl.envs import GymEnv
    from torchrl.envs.utils import check_env_specs

    env = GymEnv(f"lidarium/{name}-v1", **ROOM, observe=SEES, observation=observation)
    check_env_specs(env)
    assert len(env.rollout(10)) >= 1
    env = GymEnv(f"lidarium/{name}-v1", **ROOM, observe=SEES, frame_skip=2)
    assert len(env.rollout(10)) >= 1
