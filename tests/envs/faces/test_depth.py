"""Depth in batches is the depth of lone environments, on any number of threads."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import lidarium

OPTIONS = {"robots": 2, "camera": "depth_64x48", "observe": ["pose", "depth"], "noise": "datasheet"}


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_sees_what_lone_environments_see(threads):
    batch = lidarium.vector_env(4, "apartment", threads=threads, **OPTIONS)
    observations, infos = batch.reset(seed=[3, 4, 5, 6])
    lone = [lidarium.parallel_env("apartment", **OPTIONS) for _ in range(4)]
    seen = [env.reset(seed=3 + k)[0] for k, env in enumerate(lone)]
    generator = np.random.default_rng(0)
    for _ in range(6):
        assert infos["camera"]["intrinsics"]["cx"].tolist() == [31.5] * 8
        for row in range(8):
            own = seen[row // 2][f"robot_{row % 2}"]
            assert (observations["depth"][row] == own["depth"]).all()
        actions = generator.uniform(-1.0, 1.0, (8, 2)).astype(np.float32)
        observations, _, _, _, infos = batch.step(actions)
        seen = [
            env.step({f"robot_{robot}": actions[2 * k + robot] for robot in range(2)})[0] for k, env in enumerate(lone)
        ]
    batch.close()


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_seeing(duplicate):
    env = lidarium.parallel_env("apartment", **OPTIONS)
    env.reset(seed=0)
    other = duplicate(env)
    actions = {agent: np.array([0.5, 0.2], np.float32) for agent in env.agents}
    (ours, *_), (theirs, *_) = env.step(actions), other.step(actions)
    for agent in actions:
        assert (ours[agent]["depth"] == theirs[agent]["depth"]).all()
        assert ours[agent]["depth"].any()


def test_the_id_observes_depth():
    env = gymnasium.make("lidarium/Exploration3D-v1", camera="depth_64x48", floor="apartment", horizon_s=5.0)
    assert env.observation_space["depth"].shape == (1, 48, 64)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()
