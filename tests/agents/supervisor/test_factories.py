"""Policies that are led by a station."""

import numpy as np
import pytest

from lidarium.agents import make_policy
from lidarium.agents.learned.network import _shapes, save_weights
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode


@pytest.fixture
def weights(tmp_path):
    generator = np.random.default_rng(0)
    drawn = {name: 0.1 * generator.normal(size=shape) for name, shape in _shapes().items()}
    path = tmp_path / "weights.safetensors"
    save_weights(path, {name: array.astype(np.float32) for name, array in drawn.items()})
    return str(path)


def test_ones_own_network_explores_under_a_supervisor(weights):
    policy = make_policy("supervised_learned", weights=weights, merge_period_s=5.0)
    settings = make_settings(robots=2, known_starts=False, resolution=0.1, horizon_s=60.0)
    env = ExplorationEnv("apartment:7", settings)
    run_episode(policy, env, 0)
    assert env.scorer.coverage > 0.5


def test_weights_that_are_not_there_are_named():
    with pytest.raises(FileNotFoundError, match=r"nowhere\.safetensors"):
        make_policy("supervised_learned", weights="nowhere.safetensors")
