"""Trains a team by the values of its robots' choices: TorchRL's QMIX and VDN, from checkpoint to checkpoint.

References
----------
T. Rashid et al., "QMIX: monotonic value function factorisation for deep multi-agent reinforcement learning", 2018.
P. Sunehag et al., "Value-decomposition networks for cooperative multi-agent learning", 2018.
"""

import logging
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter
from torchrl import torchrl_logger
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import QMixer, QValueModule, VDNMixer
from torchrl.objectives import QMixerLoss, SoftUpdate, ValueEstimators

from lidarium.agents.zoo.network import MASK
from lidarium.envs.faces.team_rows import ACTIVE
from lidarium.envs.faces.vector_env import ExplorationVectorEnv
from lidarium.training.reinforcement.checkpoints import (
    Checkpoint,
    Learner,
    latest_checkpoint,
    restore,
    write_checkpoint,
)
from lidarium.training.reinforcement.frontier_policy import STATE, OptionRanking
from lidarium.training.settings import TeamSettings, ValueSettings

ROBOTS = "agents"
VALUES, CHOICE, CHOSEN, TOGETHER = (ROBOTS, "values"), (ROBOTS, "choice"), (ROBOTS, "chosen"), "together"

REWARD_UNIT = 10.0
"""Rewards of teams are learned in these units [m2]."""

STEEPNESS = 0.1
"""Initial cost of a metre of path, in these units: about 4 s of an exploration."""

STEEPEST = 10.0
"""Maximum norm of gradients."""


def learn_values(
    settings: TeamSettings,
    environment: ExplorationVectorEnv,
    network: OptionRanking,
    folder: Path,
    log: Path,
    begin_at: Callable[[int], int],
    measure: Callable[[Checkpoint], float],
    first: Checkpoint,
) -> Generator[Checkpoint, None, None]:
    """Learn from the last checkpoint in a folder on, or from the first one, and yield each checkpoint.

    After each checkpoint new episodes begin, and the replay buffer is emptied: a training that continues from a
    checkpoint has the same results as one that was never interrupted. ``begin_at`` returns the seed of the episodes
    after the checkpoint of a number; ``measure`` returns the next entry of the curve.
    """
    value, checkpoint = settings.value, latest_checkpoint(folder) or first
    mixer = _mixer(settings, environment)
    learned = [each for name, each in network.named_parameters() if not name.startswith("critic.")]
    learner = Learner(mixer, torch.optim.Adam([*learned, *mixer.parameters()], value.learning_rate))
    nn.init.constant_(network.steepness, STEEPNESS)
    if checkpoint.decisions:
        restore(folder, checkpoint, network, learner)
    torchrl_logger.setLevel(logging.WARNING)  # it tells of every memory that it makes
    writer = SummaryWriter(str(log))
    try:
        while checkpoint.decisions < value.whole_decisions:
            number = checkpoint.decisions // value.checkpoint
            torch.manual_seed(settings.seed + 1 + number)
            generator = np.random.default_rng([settings.seed, number])
            lost = _learn_on(value, environment, network, learner, begin_at(number), generator, checkpoint.decisions)
            decisions = checkpoint.decisions + value.checkpoint
            reached = measure(checkpoint)
            writer.add_scalar("train/loss", lost, decisions)
            writer.add_scalar("validation/coverage", reached, decisions)
            checkpoint = Checkpoint(decisions, [*checkpoint.curve, (decisions, reached)])
            write_checkpoint(folder, checkpoint, network, learner)
            yield checkpoint
    finally:
        writer.close()


def _learn_on(
    value: ValueSettings,
    environment: ExplorationVectorEnv,
    network: OptionRanking,
    learner: Learner,
    seed: int,
    generator: np.random.Generator,
    decisions: int,
) -> float:
    """Learn up to the next checkpoint; return the mean loss."""
    loss = _loss(network, learner.critic, value.discount)
    tracking = SoftUpdate(loss, tau=value.tracking)
    memory = TensorDictReplayBuffer(storage=LazyTensorStorage(value.kept), batch_size=value.batch)
    losses: list[float] = []
    observations, _ = environment.reset(seed=seed)
    before = _teams(environment, observations)
    for _ in range(value.checkpoint // environment.num_envs):
        choices = _choices(network, before, value.chance(decisions), generator)
        began = environment.batch.is_over.copy()
        observations, rewards, _, truncated, infos = environment.step(choices.ravel())
        after = _teams(environment, observations, infos[ACTIVE])
        teams, over = choices.shape, environment.batch.is_over
        is_cut = _cut_teams(truncated, infos[ACTIVE], teams)
        both: dict[Any, Any] = {**before, CHOICE: torch.from_numpy(choices), "next": TensorDict(after)}
        happened = TensorDict(both, [len(began)])
        happened["next", "reward"] = torch.from_numpy(
            (rewards.reshape(teams).sum(axis=1, keepdims=True) / REWARD_UNIT).astype(np.float32)
        )
        happened["next", "done"] = torch.from_numpy(over[:, None].copy())
        happened["next", "terminated"] = torch.from_numpy((over & ~is_cut)[:, None])
        memory.extend(happened[torch.from_numpy(~began)])  # teams that were over have only begun again
        before, decisions = after, decisions + environment.num_envs
        if len(memory) < value.batch:
            continue
        lost = loss(memory.sample())["loss"]
        learner.optimizer.zero_grad()
        lost.backward()
        nn.utils.clip_grad_norm_(list(loss.parameters()), STEEPEST)
        learner.optimizer.step()
        tracking.step()
        losses.append(float(lost.detach()))
    return float(np.mean(losses)) if losses else 0.0


def _cut_teams(truncated: NDArray[np.bool_], active: NDArray[np.bool_], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which teams were cut by time; rows of robots that ended before are truncated whatever ends the team."""
    return np.asarray((truncated & active).reshape(shape).any(axis=1), np.bool_)


def _mixer(settings: TeamSettings, environment: ExplorationVectorEnv) -> nn.Module:
    mixer: nn.Module = (
        VDNMixer(settings.robots, "cpu")
        if settings.algorithm == "vdn"
        else QMixer(environment.state_space.shape, settings.value.mixing, settings.robots, "cpu")
    )
    return mixer


def _loss(network: OptionRanking, mixer: nn.Module, discount: float) -> QMixerLoss:
    """Return the loss of a team's value, with target networks that are as the learned ones are now."""
    values = TensorDictSequential(
        TensorDictModule(_Values(network), [(ROBOTS, name) for name in _seen(network)], [VALUES]),
        QValueModule("categorical", VALUES, (ROBOTS, "allowed"), [CHOICE, VALUES, CHOSEN], strict_shape=False),
    )
    mixed = TensorDictModule(mixer, [CHOSEN, STATE] if mixer.needs_state else [CHOSEN], [TOGETHER])
    loss = QMixerLoss(values, mixed, action_space="categorical", loss_function="smooth_l1")
    loss.set_keys(action=CHOICE, action_value=VALUES, local_value=CHOSEN, global_value=TOGETHER)
    loss.make_value_estimator(ValueEstimators.TD0, gamma=discount)
    return loss


def _seen(network: OptionRanking) -> tuple[str, ...]:
    """Return what a network sees of an observation."""
    return *network.seen, MASK


class _Values(nn.Module):
    """The network's preferences as values, for robots of teams: (teams, robots, actions)."""

    def __init__(self, network: OptionRanking) -> None:
        super().__init__()
        self.network = network

    def forward(self, *seen: Tensor) -> Tensor:
        teams = seen[0].shape[:2]
        rows = {name: each.flatten(0, 1) for name, each in zip(_seen(self.network), seen, strict=True)}
        values = self.network.preferences(rows)
        return values.reshape(*teams, values.shape[1])


def _choices(
    network: OptionRanking, seen: dict[str, Any], chance: float, generator: np.random.Generator
) -> NDArray[np.int64]:
    """Return the choice of each robot, (teams, robots): the best one, or sometimes a random allowed one."""
    robots = seen[ROBOTS]
    with torch.no_grad():
        values = _Values(network)(*(robots[name] for name in _seen(network))).numpy()
    allowed = robots["allowed"].numpy()
    best = np.where(allowed, values, -np.inf).argmax(axis=2)
    drawn = np.where(allowed, generator.random(allowed.shape), -1.0).argmax(axis=2)
    return np.asarray(np.where(generator.random(best.shape) < chance, drawn, best), np.int64)


def _teams(
    environment: ExplorationVectorEnv, observations: dict[str, NDArray[Any]], active: NDArray[np.bool_] | None = None
) -> dict[str, Any]:
    """Return the observations of teams, (teams, robots, ...), and their true state; ended robots can only stay."""
    teams, robots = environment.batch.episodes, environment.batch.robots
    mask = observations[MASK].copy()
    if active is not None:
        mask[~active, :-1] = 0
    arrays = {**{name: each for name, each in observations.items() if name != MASK}, MASK: mask, "allowed": mask > 0}
    tensors = {
        name: torch.from_numpy(array.reshape(teams, robots, *array.shape[1:]).copy()) for name, array in arrays.items()
    }
    return {ROBOTS: TensorDict(tensors, [teams, robots]), STATE: torch.from_numpy(environment.state())}
