"""Train a team by TorchRL's PPO: decisions by frontiers with masks, a critic for all robots together.

Usage: python docs/how_to/trainers/with_torchrl.py
"""

from collections.abc import Iterator
from typing import Any

import torch
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs import PettingZooWrapper
from torchrl.modules import MaskedCategorical, MultiAgentMLP, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss, ValueEstimators

import lidarium

TEAM = {"robots": 2, "level": "frontier", "observe": ["frontiers"], "horizon_s": 60.0}
FORMS = {"observation": "flat", "action_mask": "beside", "infos": "none", "ended_agents": "zeros"}
GROUP = "robot"
SEEN, MASK = (GROUP, "observation", "observation"), (GROUP, "action_mask")


def make_env(options: dict[str, Any]) -> PettingZooWrapper:
    """Make the environment in TorchRL's form: tensors of all robots together, with the team's state."""
    team = lidarium.parallel_env(**{**TEAM, **FORMS, **options})
    return PettingZooWrapper(team, return_state=True, done_on_any=False)


def make_networks(env: PettingZooWrapper) -> tuple[ProbabilisticActor, TensorDictModule]:
    """Make one actor that all robots share, and a critic that sees what all of them see."""
    robots, inputs = env.observation_spec[SEEN].shape
    sizes = {"n_agents": robots, "share_params": True, "depth": 2, "num_cells": 64}
    logits = MultiAgentMLP(inputs, env.observation_spec[MASK].shape[-1], centralized=False, **sizes)
    values = MultiAgentMLP(inputs, 1, centralized=True, **sizes)
    actor = ProbabilisticActor(
        TensorDictModule(logits, [SEEN], [(GROUP, "logits")]),
        in_keys={"logits": (GROUP, "logits"), "mask": MASK},
        out_keys=[(GROUP, "action")],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=(GROUP, "log_prob"),
    )
    return actor, TensorDictModule(values, [SEEN], [(GROUP, "state_value")])


def make_loss(actor: ProbabilisticActor, critic: TensorDictModule) -> ClipPPOLoss:
    """Make the loss of PPO; its keys are those of the group of robots."""
    loss = ClipPPOLoss(actor, critic, entropy_coeff=0.01, normalize_advantage=True)
    names = ("action", "reward", "done", "terminated")
    keys = {name: (GROUP, name) for name in names}
    loss.set_keys(**keys, value=(GROUP, "state_value"), sample_log_prob=(GROUP, "log_prob"))
    loss.make_value_estimator(ValueEstimators.GAE, gamma=0.98, lmbda=0.95)
    return loss


def train(options: dict[str, Any], batches: int = 100, decisions: int = 1000) -> Iterator[float]:
    """Train; yield the mean reward of a decision in each batch.

    Parameters
    ----------
    options : dict
        Of ``lidarium.parallel_env``, such as ``floor``.
    batches, decisions : int
        How many batches, of how many decisions of the team.
    """
    env = make_env(options)
    actor, critic = make_networks(env)
    loss = make_loss(actor, critic)
    optimiser = torch.optim.Adam(loss.parameters(), 5e-4)
    collector = Collector(env, actor, frames_per_batch=decisions, total_frames=batches * decisions)
    for batch in collector:
        with torch.no_grad():
            loss.value_estimator(batch, params=loss.critic_network_params)
        for _ in range(4):
            for part in batch.reshape(-1)[torch.randperm(batch.numel())].split(256):
                losses = loss(part)
                total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
                optimiser.zero_grad()
                total.backward()
                torch.nn.utils.clip_grad_norm_(loss.parameters(), 1.0)
                optimiser.step()
        yield float(batch["next", GROUP, "reward"].mean())
    collector.shutdown()


if __name__ == "__main__":
    torch.manual_seed(0)
    for earned in train({"floor": "set:train"}):
        print(f"{earned:.3f} a decision")
