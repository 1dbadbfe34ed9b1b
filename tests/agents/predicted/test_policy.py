"""Tours begun by what is predicted."""

import numpy as np
import pytest

from lidarium.agents import make_policy
from lidarium.agents.predicted.policy import PredictedTours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode


def episode(policy, robots, floor="apartment:7", **settings):
    options = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": 600.0, **settings}
    env = ExplorationEnv(floor, make_settings(robots=robots, **options))
    run_episode(policy, env, 0)
    return env


@pytest.mark.parametrize("robots", [1, 3])
def test_without_a_prediction_it_is_tour_frontier_to_the_bit(robots):
    classic, other = episode(make_policy("tour_frontier"), robots), episode(PredictedTours("nothing"), robots)
    assert classic.scorer.time == other.scorer.time
    np.testing.assert_array_equal(classic.world.poses, other.world.poses)


def test_the_truth_is_faster_on_a_floor_with_rooms_to_skip():
    classic = episode(make_policy("tour_frontier"), 1, "building:2000015")
    policy = PredictedTours("truth")
    known = episode(policy, 1, "building:2000015")
    assert known.scorer.coverage >= 0.99
    assert known.scorer.time < 0.9 * classic.scorer.time
    assert policy.report().decided_by["predicted"] > 0


def test_the_truth_needs_known_starts():
    with pytest.raises(ValueError, match="needs known starts"):
        episode(PredictedTours("truth", shares_map=False), 2, known_starts=False)


class Broken:
    def predict(self, partial):
        return np.full(partial.levels.shape, np.nan, np.float32)


def test_a_broken_predictor_stops_the_run_unless_told_otherwise():
    with pytest.raises(ValueError, match="predictor Broken returned nan"):
        episode(PredictedTours(Broken()), 1)
    with pytest.warns(UserWarning, match="go on without it: predictor Broken"):
        env = episode(PredictedTours(Broken(), falls_back=True), 1)
    assert env.scorer.time == episode(make_policy("tour_frontier"), 1).scorer.time


def test_what_cannot_be_set_is_named():
    with pytest.raises(ValueError, match="did you mean 'truth'"):
        PredictedTours("thruth")
    with pytest.raises(ValueError, match="falls_back"):
        PredictedTours("nothing", falls_back=1)
    with pytest.raises(FileNotFoundError):
        PredictedTours(weights="nowhere.safetensors")
