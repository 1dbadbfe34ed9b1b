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
from lidarium.training.reinforcement.masked_ppo import ExplorerPolicy
from lidarium.training.settings import PpoSettings, TrainingSettings

PLACES_PER_CHECKPOINT = 1000
"""Places behind each checkpoint begin so far apart."""


def learn(
    training: TrainingSettings, folder: Path, begin: Path | None, workers: int, log: Path
) -> Generator[Progress, None, None]:
    """Go on with a network by rewards, from its last checkpoint on."""
    settings, checkpoint = training.ppo, latest_checkpoint(folder) or Checkpoint(0, [])
    total = -(-settings.decisions // settings.checkpoint) * settings.checkpoint
    if checkpoint.decisions >= total:
        return
    yield Progress("rewards", checkpoint.decisions, total)
    environment = environments_of(training, workers)
    is_whole = False
    try:
        model = model_of(settings, environment, training.seed)
        model.set_logger(configure(str(log), ["tensorboard"]))
        policy = model.policy
        assert isinstance(policy, ExplorerPolicy)
        learner = Learner(policy.critic, policy.optimizer)
        if checkpoint.decisions:
            restore(folder, checkpoint, policy.network, learner)
            model.num_timesteps = checkpoint.decisions  # where TensorBoard's curves go on
        elif begin is not None:
            policy.network.set_weights(load_weights(begin))
        while checkpoint.decisions < total:
            number = checkpoint.decisions // settings.checkpoint
            reward = _learn_on(model, environment, training, number)
            decisions = checkpoint.decisions + settings.checkpoint
            checkpoint = Checkpoint(decisions, [*checkpoint.curve, (decisions, reward)])
            write_checkpoint(folder, checkpoint, policy.network, learner)
            yield Progress("rewards", decisions, total, {} if reward is None else {"reward": reward})
        is_whole = True
    except (EOFError, ConnectionError) as error:
        raise ValueError(
            "the process of an environment has ended: killed from outside, out of memory, or by an error "
            "printed above; the last checkpoint is kept, and the same command goes on from there"
        ) from error
    finally:
        _close(environment, is_whole)


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


def model_of(settings: PpoSettings, environment: VecEnv, seed: int) -> MaskablePPO:
    """Return a learner whose network is that of classic tours."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size")
        return MaskablePPO(
            ExplorerPolicy,
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
            device="cpu",
        )


def _learn_on(model: MaskablePPO, environment: VecEnv, training: TrainingSettings, number: int) -> float | None:
    """Learn up to the next checkpoint.

    New episodes begin and all draws are seeded again, so that a training that goes on from a checkpoint does the
    same as one that was never interrupted.
    """
    environment.env_method("begin_at", number * PLACES_PER_CHECKPOINT)
    model.set_random_seed(training.seed + 1 + number)
    model._last_obs = None  # learn() resets the environments
    model.ep_info_buffer = None
    model.learn(training.ppo.checkpoint, reset_num_timesteps=False)
    episodes: list[dict[str, float]] = list(model.ep_info_buffer or [])
    return float(np.mean([each["r"] for each in episodes])) if episodes else None
