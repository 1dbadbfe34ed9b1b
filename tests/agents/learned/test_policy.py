"""Tours of which somebody chooses the first leg."""

import numpy as np
import pytest

from lidarium.agents import make_policy
from lidarium.agents.learned.decision import choose_classic
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.agents.learned.network import load_weights, save_weights
from lidarium.agents.learned.policy import ChosenTours
from lidarium.agents.predicted.policy import PredictedTours
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode


def episode(policy, robots, seed=0, floor="apartment:7", **settings):
    options = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": 600.0, **settings}
    env = ExplorationEnv(floor, make_settings(robots=robots, **options))
    run_episode(policy, env, seed)
    return env


@pytest.mark.parametrize("robots", [1, 3])
def test_classic_choices_make_classic_tours_to_the_bit(robots):
    classic, chosen = episode(TourFrontier(), robots), episode(ChosenTours(choose_classic), robots)
    assert classic.scorer.time == chosen.scorer.time
    np.testing.assert_array_equal(classic.world.poses, chosen.world.poses)


@pytest.mark.parametrize(("predictor", "robots"), [("truth", 1), ("network", 3)])
def test_on_predicted_maps_choices_of_tours_are_predicted_tours_to_the_bit(predictor, robots):
    policies = PredictedTours(predictor), ChosenTours(choose_classic, predictor)
    predicted, chosen = (episode(policy, robots, floor="building:2000015") for policy in policies)
    assert predicted.scorer.time == chosen.scorer.time
    np.testing.assert_array_equal(predicted.world.poses, chosen.world.poses)
    counts = [policy.report().decided_by for policy in policies]
    assert counts[0] == counts[1]
    assert counts[0]["predicted"] > 0


def test_a_network_explores_on_the_maps_that_it_was_trained_on(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_weights(path, load_weights(), "network")
    assert make_policy("learned", weights=str(path)).predicts
    assert not make_policy("learned", weights=str(path), predictor="nothing").predicts
    assert make_policy("learned").predicts
    save_weights(path, load_weights())
    assert not make_policy("learned", weights=str(path)).predicts
    save_weights(path, load_weights(), "truht")
    with pytest.raises(ValueError, match="did you mean 'truth'"):
        make_policy("learned", weights=str(path))


def test_decisions_show_what_there_is():
    seen = []

    def choose(decision):
        seen.append(decision)
        return decision.classic

    episode(ChosenTours(choose), 3)
    assert seen
    for decision in seen:
        n = len(decision.scores)
        assert decision.options.shape == (n, len(OPTION_FEATURES))
        assert decision.teammates.shape == (2, len(TEAMMATE_FEATURES))
        assert decision.situation.shape == (len(SITUATION_FEATURES),)
        assert decision.mask.sum() > 1
        assert decision.scores[decision.mask].max() == 0.0
        assert all(np.isfinite(each).all() for each in (decision.options, decision.teammates, decision.situation))
    picked = [decision.teammates[:, list(TEAMMATE_FEATURES).index("has_picked")].sum() for decision in seen]
    assert set(picked) == {0.0, 1.0, 2.0}


def test_two_robots_never_pick_the_same():
    """Where all prefer the nearest option, later robots do not have what earlier ones picked."""
    path = list(OPTION_FEATURES).index("path")

    def nearest(decision):
        costs = np.where(decision.mask, decision.options[:, path], np.inf)
        return int(np.argmin(costs))

    class Watched(ChosenTours):
        def pick(self, agents, options):
            picks = super().pick(agents, options)
            taken = [each for each in picks if each is not None]
            assert len(set(taken)) == len(taken)
            assert all(options.is_reached[k, pick] for k, pick in enumerate(picks) if pick is not None)
            return picks

    env = episode(Watched(nearest), 3)
    assert env.scorer.coverage >= 0.99


def test_the_shipped_network_explores():
    env = episode(make_policy("learned"), 2)
    assert env.scorer.coverage >= 0.99


def test_a_network_works_where_starts_are_not_known():
    env = episode(make_policy("learned", shares_map=False), 2, known_starts=False)
    assert env.scorer.coverage >= 0.99


def test_unknown_settings_are_named():
    with pytest.raises(ValueError, match="kepd"):
        make_policy("learned", kepd=1.0)
    with pytest.raises(FileNotFoundError):
        make_policy("learned", weights="nowhere.safetensors")


def test_it_counts_how_often_it_departs_from_tours():
    def last(decision):
        return int(np.flatnonzero(decision.mask)[-1])

    counts = {}
    for choose in (choose_classic, last):
        policy = ChosenTours(choose)
        episode(policy, 2, horizon_s=60.0)
        counts[choose] = policy.report().decided_by
    assert set(counts[choose_classic]) == {"tours"}
    assert counts[last]["corrected"] > 0
