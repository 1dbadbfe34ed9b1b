"""Tianshou trains a robot, and takes teams in turns."""

import numpy as np
import pytest
from trainer_scripts import ROOM, script

import lidarium

pytestmark = pytest.mark.filterwarnings("ignore")  # of Tianshou's own dependencies


@pytest.fixture(scope="module")
def tianshou():
    return script("with_tianshou", "tianshou", "tianshou")


def test_ppo_of_tianshou_trains_a_robot(tianshou):
    report = tianshou.train(ROOM, epochs=1, decisions=40, robots=2)
    assert report.train_step >= 40
    assert np.isfinite(report.best_reward)


def test_a_team_takes_turns_in_tianshou(tianshou):
    from tianshou.env import PettingZooEnv

    team = lidarium.env(
        **{k: v for k, v in ROOM.items() if k != "floor"},
        floor="scene_room",
        robots=2,
        level="frontier",
        observe=["frontiers"],
        observation="flat",
        action_mask="beside",
        infos="flat",
    )
    env = PettingZooEnv(team)
    seen, _ = env.reset(seed=0)
    names = set()
    for _ in range(6):
        names.add(seen["agent_id"])
        assert seen["obs"].shape == env.observation_space["observation"].shape
        seen, rewards, *_ = env.step(int(np.argmax(seen["mask"])))
        assert np.isfinite(rewards).all()
    assert names == {"robot_0", "robot_1"}
