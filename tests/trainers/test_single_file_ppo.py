"""PPO in one file and MaskablePPO train robots on batches."""

import math

import numpy as np
import pytest
from trainer_scripts import ROOM, script


@pytest.fixture(autouse=True)
def one_thread():
    torch = pytest.importorskip("torch", reason="torch is not installed: extra [rl]")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("more", [{}, {"robots": 2, "stop_on_contact": True}], ids=str)
def test_ppo_in_one_file_trains(more):
    module = script("ppo", "torch", "rl")
    settings = module.Settings(updates=2, episodes=3, rollout=6, minibatch=8)
    reports = [report for report, _ in module.train({**ROOM, "robots": 1, **more}, settings)]
    assert len(reports) == 2
    assert all(math.isfinite(report.earned) for report in reports)
    assert 0.0 < reports[-1].coverage <= 1.0


def played_once(module, rollout):
    """Return a learner, and what it has played."""
    env = module.lidarium.vector_env(
        2, **{**module.ROBOT, **ROOM, "horizon_s": 4.0, "robots": 2, "stop_on_contact": True}
    )
    learner = module.Learner(env, module.Settings(rollout=rollout, discount=0.9, trace=0.8))
    return learner, *learner.play()


def test_rows_whose_action_is_ignored_are_left_out_of_learning():
    module = script("ppo", "torch", "rl")
    _, played, _ = played_once(module, 12)
    idle, ended = played.is_idle.numpy(), played.ended.numpy()
    assert idle.any()
    assert not idle[0].any()
    assert not played.rewards.numpy()[idle].any()
    # A row is idle in the step after it has ended, in which its episode begins again or goes on without it.
    assert idle[1:][ended[:-1]].all()


def test_advantages_are_those_of_a_plain_sum():
    module = script("ppo", "torch", "rl")
    learner, played, last = played_once(module, 12)
    found = learner.advantages(played, last).numpy()
    values = np.concatenate([played.values.numpy(), last.numpy()[None]])
    rewards, gone, ended, idle = (
        part.numpy() for part in (played.rewards, played.terminated, played.ended, played.is_idle)
    )
    for row in range(rewards.shape[1]):
        for first in np.flatnonzero(~idle[:, row]):
            total = 0.0
            for step in range(first, len(rewards)):
                if idle[step, row]:
                    break
                after = 0.0 if gone[step, row] else values[step + 1, row]
                error = rewards[step, row] + 0.9 * after - values[step, row]
                total += (0.9 * 0.8) ** (step - first) * error
                if ended[step, row]:
                    break
            assert found[first, row] == pytest.approx(total, abs=1e-4)


def test_maskable_ppo_trains():
    module = script("maskable_ppo", "sb3_contrib", "rl")
    model = module.make({**ROOM, "robots": 2}, episodes=2, rollout=6)
    assert module.train(model, 48) > 0.0
    assert model.num_timesteps == 48
