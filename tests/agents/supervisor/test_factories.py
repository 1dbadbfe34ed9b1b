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


def led(policy, **settings):
    options = {"robots": 2, "resolution": 0.05, "stop_coverage": 0.99, "horizon_s": 600.0, **settings}
    env = ExplorationEnv("apartment:7", make_settings(**options))
    run_episode(policy, env, 0)
    return env, policy


def test_robots_that_predict_join_their_maps_and_explore_all_from_unknown_starts():
    first, second = (
        led(make_policy("supervised_predicted"), known_starts=False, localization="slam") for _ in range(2)
    )
    env, policy = first
    assert env.scorer.coverage >= 0.99
    assert [join.is_used for join in policy.joins if {join.a, join.b} == {"robot_0", "robot_1"}][-1]
    assert env.perception.received.has_merged_map(0) or env.perception.received.has_merged_map(1)
    assert policy.decided_by["predicted"] > 0
    np.testing.assert_array_equal(env.world.poses, second[0].world.poses)
    assert policy.decisions == second[1].decisions


def test_without_a_prediction_they_explore_as_supervised_tours_to_the_bit():
    (classic, _), (other, _) = (
        led(make_policy(name, **settings), known_starts=False)
        for name, settings in (("supervised_tours", {}), ("supervised_predicted", {"predictor": "nothing"}))
    )
    assert classic.scorer.time == other.scorer.time
    np.testing.assert_array_equal(classic.world.poses, other.world.poses)


def test_the_truth_bounds_a_team_under_a_supervisor_that_knows_its_starts():
    env, policy = led(make_policy("supervised_predicted", predictor="truth"))
    assert env.scorer.coverage >= 0.99
    assert policy.decided_by["predicted"] > 0
