"""Terms of the reward that kernels add up."""

import numpy as np
import pytest

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.rewards import RewardSettings
from lidarium.envs.simulation.rewards import AREA, CONTACT, ENERGY, TIME, add_rewards, reward_weights
from lidarium.mapping.grids.occupancy import OccupancySettings


def test_weights_are_of_a_cell_a_step_a_contact_and_a_metre():
    weights = RewardSettings(area=2.0, time=0.5, contact=3.0, energy=0.25)
    found = reward_weights(ExplorationSettings(reward=weights, occupancy=OccupancySettings(resolution=0.1)))
    assert found[AREA] == pytest.approx(2.0 * 0.01)
    assert found[TIME] == pytest.approx(0.5 * ExplorationSettings().time_step)
    assert (found[CONTACT], found[ENERGY]) == (3.0, 0.25)


def test_terms_make_up_the_reward_and_a_path_is_paid_for_once():
    generator = np.random.default_rng(6)
    weights, before = generator.uniform(0.0, 2.0, 4), np.zeros(3)
    terms, rewards, travelled = np.zeros((3, 4)), np.zeros(3), np.zeros(3)
    gained, touched = np.zeros(3), np.zeros(3)
    for _ in range(5):
        gains, contacts = generator.uniform(0.0, 9.0, 3), generator.integers(0, 2, 3).astype(np.uint8)
        travelled += generator.uniform(0.0, 1.0, 3)
        add_rewards(gains, contacts, travelled, weights, before, terms, rewards)
        gained, touched = gained + gains, touched + contacts
    assert np.allclose(terms[:, AREA], weights[AREA] * gained)
    assert np.allclose(terms[:, TIME], -5.0 * weights[TIME])
    assert np.allclose(terms[:, CONTACT], -weights[CONTACT] * touched)
    assert np.allclose(terms[:, ENERGY], -weights[ENERGY] * travelled)
    assert np.allclose(rewards, terms.sum(axis=1))
    assert np.array_equal(before, travelled)
