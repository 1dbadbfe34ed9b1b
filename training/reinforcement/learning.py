"""Trains a network further by rewards: sb3-contrib's PPO with masks, from checkpoint to checkpoint.

J. Schulman et al., "Proximal policy optimization algorithms", 2017; masks: S. Huang and S. Ontanon, 2022.
"""

import warnings
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Env
from sb3_contrib import MaskablePPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

from lidarium.agents.learned.network import load_weights
from lidarium.training.places import Place, first_number, place_of
from lidarium.training.progress import Progress
from lidarium.training.reinforcement.checkpoints import (
    Checkpoint,
    Learner,
    latest_checkpoint,
    restore,
    write_checkpoint,
)
from lidarium.training.reinforcement.choice_env import ChoiceEnv
from lidarium.training.reinforcement.frontier_policy import FrontierPolicy
from lidarium.training.reinforcement.masked_ppo import ExplorerPolicy, RankingPolicy
from lidarium.training.settings import PpoSettings, TrainingSettings

PLACES_PER_CHECKPOINT = 1000
"""Places behind each checkpoint begin so far apart."""


def learn(
    training: TrainingSettings, folder: Path, begin: Path | None, workers: int, log: Path
) -> Generator[Progress, None, None]:
    """Go on with a network by rewards, from its last checkpoint on."""
    settings, last = training.ppo, latest_checkpoint(folder)
    done, total = 0 if last is None else last.decisions, settings.whole_decisions
    if done >= total:
        return
    yield Progress("rewards", done, total)
    environment = environments_of(training, workers)
    is_whole = False
    try:
        model = model_of(ExplorerPolicy, settings, environment, training.seed)
        if last is None and begin is not None:
            assert isinstance(model.policy, ExplorerPolicy)
            model.policy.network.set_weights(load_weights(begin))
        begin_at = partial(_begin_at, environment)
        first = Checkpoint(0, [])
        for checkpoint in learn_on(model, settings, training.seed, folder, log, begin_at, _mean_reward, first):
            reward = checkpoint.curve[-1][1]
            yield Progress("rewards", checkpoint.decisions, total, {} if reward is None else {"reward": reward})
        is_whole = True
    except (EOFError, ConnectionError) as error:
        raise ValueError(
            "the process of an environment has ended: killed from outside, out of memory, or by an error "
            "printed above; the last checkpoint is kept, and the same command goes on from there"
        ) from error
    finally:
        _close(environment, is_whole)


def learn_on(
    model: MaskablePPO,
    settings: PpoSettings,
    seed: int,
    folder: Path,
    log: Path,
    begin_at: Callable[[int], None],
    measure: Callable[[MaskablePPO, Checkpoint], float | None],
    first: Checkpoint,
) -> Generator[Checkpoint, None, None]:
    """Learn from the last checkpoint in a folder on, or from the first one, and yield each checkpoint.

    New episodes begin and all draws are seeded again behind each, so that a training that goes on from one does the
    same as one that was never interrupted: ``begin_at`` gets the number of the checkpoint. ``measure`` returns the
    next entry of the curve, when the network has learned on from a checkpoint.
    """
    model.set_logger(configure(str(log), ["tensorboard"]))
    policy, checkpoint = model.policy, latest_checkpoint(folder) or first
    assert isinstance(policy, ExplorerPolicy | FrontierPolicy)
    learner = Learner(policy.critic, policy.optimizer)
    if checkpoint.decisions:
        restore(folder, checkpoint, policy.network, learner)
        model.num_timesteps = checkpoint.decisions  # where TensorBoard's curves go on
    while checkpoint.decisions < settings.whole_decisions:
        number = checkpoint.decisions // settings.checkpoint
        model.set_random_seed(seed + 1 + number)
        begin_at(number)
        model._last_obs = None  # learn() resets the environments
        model.ep_info_buffer = None
        model.learn(settings.checkpoint, reset_num_timesteps=False)
        decisions = checkpoint.decisions + settings.checkpoint
        checkpoint = Checkpoint(decisions, [*checkpoint.curve, (decisions, measure(model, checkpoint))])
        write_checkpoint(folder, checkpoint, policy.network, learner)
        yield checkpoint


def _close(environment: VecEnv, is_whole: bool) -> None:
    """Close environments; if learning was broken off, end their processes.

    Of these some may have answered and others not: asked to close, they would be waited for without end.
    """
    if is_whole or not isinstance(environment, SubprocVecEnv):
        environment.close()
        return
    for process in environment.processes:
        process.terminate()
    for process in environment.processes:
        process.join()
    for remote in environment.remotes:
        remote.close()
    environment.closed = True


def environments_of(training: TrainingSettings, workers: int) -> VecEnv:
    """Return the environments of a training, in this process for one worker, else each in its own."""
    makers: list[Callable[[], Env[Any, Any]]] = [
        partial(_environment, training, k, training.ppo.environments) for k in range(training.ppo.environments)
    ]
    return DummyVecEnv(makers) if workers <= 1 else SubprocVecEnv(makers, start_method="spawn")


def _environment(training: TrainingSettings, first: int, step: int) -> Monitor[Any, Any]:
    return Monitor(ChoiceEnv(partial(_place, training), first, step))


def _place(training: TrainingSettings, number: int) -> Place:
    begin = first_number(training, len(training.rounds))
    return place_of(training, training.rounds[-1], begin + number)


def model_of(policy: type[RankingPolicy], settings: PpoSettings, environment: VecEnv, seed: int) -> MaskablePPO:
    """Return a learner whose network has not learned yet."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size")
        return MaskablePPO(
            policy,
            environment,
            learning_rate=settings.learning_rate,
            n_steps=settings.steps,
            batch_size=settings.batch,
            n_epochs=settings.epochs,
            gamma=settings.discount,
            gae_lambda=settings.trace,
            clip_range=settings.clip,
            ent_coef=settings.entropy,
            seed=seed,
            stats_window_size=settings.checkpoint,  # a checkpoint's curve is the mean of all its episodes
            device="cpu",
        )


def _begin_at(environment: VecEnv, number: int) -> None:
    """Let new episodes begin behind a checkpoint."""
    environment.env_method("begin_at", number * PLACES_PER_CHECKPOINT)


def _mean_reward(model: MaskablePPO, before: Checkpoint) -> float | None:
    """Return the mean reward of the episodes that ended since the last checkpoint, None if none ended."""
    del before
    episodes: list[dict[str, float]] = list(model.ep_info_buffer or [])
    return float(np.mean([each["r"] for each in episodes])) if episodes else None
