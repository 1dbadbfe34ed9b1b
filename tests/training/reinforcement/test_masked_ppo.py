"""The network as a policy of sb3-contrib's PPO with masks."""

from dataclasses import fields

import gymnasium
import numpy as np
import pytest
import torch
from drawn_decisions import drawn_decision
from gymnasium import spaces
from sb3_contrib import MaskablePPO

from lidarium.agents.learned.network import Network
from lidarium.training.decisions import MOST_OPTIONS, Decisions, stacked
from lidarium.training.reinforcement.choice_env import boxes
from lidarium.training.reinforcement.masked_ppo import ExplorerPolicy


class Drawn(gymnasium.Env):
    """Decisions drawn at random; an option is worth what it scores."""

    observation_space = spaces.Dict(boxes())
    action_space = spaces.Discrete(MOST_OPTIONS)

    def _draw(self):
        self.decision = drawn_decision(self.np_random, int(self.np_random.integers(2, 6)), 1)
        return rows_of(self.decision)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._draw(), {}

    def action_masks(self):
        mask = np.zeros(MOST_OPTIONS, np.bool_)
        mask[: len(self.decision.mask)] = self.decision.mask
        return mask

    def step(self, action):
        assert self.action_masks()[action], "the mask forbids it"
        reward = float(self.decision.scores[action])
        return self._draw(), reward, bool(self.np_random.random() < 0.2), False, {}


def rows_of(decision):
    table = stacked([decision])
    return {field.name: getattr(table, field.name)[0] for field in fields(Decisions)}


@pytest.fixture
def model():
    made = MaskablePPO(ExplorerPolicy, Drawn(), n_steps=16, batch_size=8, n_epochs=1, seed=0, device="cpu")
    with torch.no_grad():
        for parameter in made.policy.network.parameters():
            parameter += 0.05 * torch.randn_like(parameter)
    return made


def test_preferences_are_those_of_the_network(model):
    plain = Network(model.policy.network.weights())
    for seed in range(5):
        decision = drawn_decision(np.random.default_rng(seed), 5, 2)
        observation, _ = model.policy.obs_to_tensor(rows_of(decision))
        allowed = np.flatnonzero(decision.mask)
        with torch.no_grad():
            mask = np.zeros(MOST_OPTIONS, np.bool_)
            mask[allowed] = True
            found = model.policy.get_distribution(observation, mask).distribution.probs[0].numpy()
        preferences = plain.preferences(decision)[allowed]
        shares = np.exp(preferences - preferences.max())
        np.testing.assert_allclose(found[allowed], shares / shares.sum(), rtol=1e-3, atol=1e-5)
        assert found.sum() == pytest.approx(found[allowed].sum())


def test_predicted_is_what_is_preferred_of_what_the_mask_allows(model):
    plain = Network(model.policy.network.weights())
    for seed in range(5):
        decision = drawn_decision(np.random.default_rng(seed), 5, 2)
        rows = rows_of(decision)
        assert model.predict(rows, deterministic=True, action_masks=rows["mask"])[0] == plain(decision)
        for _ in range(10):
            drawn = model.predict(rows, deterministic=False, action_masks=rows["mask"])[0]
            assert rows["mask"][drawn]


def test_learning_obeys_masks_and_changes_network_and_critic(model):
    before, critic = (
        model.policy.network.weights(),
        [each.clone() for each in model.policy.critic.parameters()],
    )
    model.learn(32)
    after = model.policy.network.weights()
    assert any(not np.array_equal(array, after[name]) for name, array in before.items())
    assert any(not torch.equal(one, two) for one, two in zip(critic, model.policy.critic.parameters(), strict=True))


def test_values_have_no_gradient_in_the_network(model):
    observation, _ = model.policy.obs_to_tensor(rows_of(drawn_decision(np.random.default_rng(0))))
    model.policy.predict_values(observation).sum().backward()
    assert all(each.grad is None or not each.grad.any() for each in model.policy.network.parameters())
    assert any(each.grad is not None for each in model.policy.critic.parameters())


def test_the_optimizer_has_each_parameter_once(model):
    listed = [id(each) for group in model.policy.optimizer.param_groups for each in group["params"]]
    assert len(listed) == len(set(listed))
    wanted = {id(each) for part in (model.policy.network, model.policy.critic) for each in part.parameters()}
    assert set(listed) == wanted
