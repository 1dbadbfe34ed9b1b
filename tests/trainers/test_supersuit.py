"""SuperSuit makes rows of a team for stable-baselines3, and stacks its frames."""

import numpy as np
import pytest
from trainer_scripts import ROOM, script

import lidarium

pytestmark = pytest.mark.filterwarnings("ignore")  # SuperSuit's vector environments have no render_mode


@pytest.fixture(scope="module")
def supersuit():
    return script("with_supersuit", "supersuit", "supersuit")


@pytest.mark.parametrize("more", [{}, {"stop_on_contact": True}, {"level": "frontier"}], ids=str)
def test_ppo_trains_rows_of_supersuit(supersuit, more):
    model = supersuit.train({**ROOM, **more}, steps=96, copies=2, rollout=24)
    assert model.num_timesteps == 96
    assert np.isfinite(model.logger.name_to_value["train/loss"])


def test_flat_observations_can_be_stacked(supersuit):
    team = lidarium.parallel_env(**ROOM, robots=2, observe=["velocity", "bumper"], observation="flat")
    env = supersuit.supersuit.frame_stack_v1(team, 3)
    observations, _ = env.reset(seed=0)
    assert observations["robot_0"].shape == (15,)
    assert env.observation_space("robot_0").contains(observations["robot_0"])
