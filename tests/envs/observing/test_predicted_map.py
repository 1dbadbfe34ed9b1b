"""The observed prediction of the map around a robot."""

import numpy as np
import pytest
from compared_faces import compare_rows

import lidarium
from lidarium.envs.settings.observables import SENSED


def test_it_shows_what_is_known_and_what_is_probable():
    env = lidarium.parallel_env("apartment", robots=1, resolution=0.1, observe=["predicted_map"], starts="fixed")
    observations, _ = env.reset(seed=0)
    agent = env.agents[0]
    found = observations[agent]["predicted_map"]
    assert env.observation_space(agent)["predicted_map"].contains(found)
    assert found.shape == (160, 160)
    assert (found == 1.0).sum() > 50  # what the first scan has seen
    assert ((found > 0.0) & (found < 1.0)).any()
    whole = lidarium.ExplorationEnv.belief(env.unwrapped, agent).predicted_map
    assert (whole == 1.0).sum() == pytest.approx((found == 1.0).sum(), rel=0.3)
    assert np.isfinite(whole).all()


def test_batches_see_the_same():
    compare_rows("velocity", 2, 2, ["apartment"], observe=["predicted_map"], resolution=0.1)


def test_coarse_maps_have_fewer_squares():
    settings = lidarium.make_settings(resolution=0.5)
    assert SENSED["predicted_map"].box(settings).shape == (64, 64)
