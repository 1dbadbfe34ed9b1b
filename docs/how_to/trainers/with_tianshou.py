"""Train one robot by PPO of Tianshou: decisions by frontiers.

Usage: python docs/how_to/trainers/with_tianshou.py
"""

from functools import partial
from typing import Any

import gymnasium
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.data.stats import InfoStats
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.discrete import DiscreteActor, DiscreteCritic
from torch.distributions import Categorical

ROBOT = {"observe": ["frontiers"], "horizon_s": 60.0, "observation": "flat", "infos": "flat"}


def train(options: dict[str, Any], epochs: int = 10, decisions: int = 10_000, robots: int = 4) -> InfoStats:
    """Train; return what Tianshou reports.

    Parameters
    ----------
    options : dict
        Of the environment, such as ``floor``.
    epochs, decisions : int
        How many epochs, of how many decisions.
    robots : int
        How many environments.
    """
    make = partial(gymnasium.make, "lidarium:lidarium/FrontierExploration-v1", **{**ROBOT, **options})
    envs, tests = DummyVectorEnv([make] * robots), DummyVectorEnv([make])
    env = make()
    nets = [Net(state_shape=env.observation_space.shape, hidden_sizes=[64, 64]) for _ in range(2)]
    actor = DiscreteActor(preprocess_net=nets[0], action_shape=env.action_space.n, softmax_output=False)
    policy = ProbabilisticActorPolicy(
        actor=actor, dist_fn=_of_logits, action_space=env.action_space, action_scaling=False
    )
    algorithm = PPO(policy=policy, critic=DiscreteCritic(preprocess_net=nets[1]), optim=AdamOptimizerFactory(lr=5e-4))
    collected = min(1000, decisions)
    return algorithm.run_training(
        OnPolicyTrainerParams(
            training_collector=Collector(algorithm, envs, VectorReplayBuffer(collected, robots)),
            test_collector=Collector(algorithm, tests),
            max_epochs=epochs,
            epoch_num_steps=decisions,
            collection_step_num_env_steps=collected,
            update_step_num_repetitions=4,
            test_in_training=False,
        )
    )


def _of_logits(logits: Any) -> Categorical:  # noqa: ANN401
    return Categorical(logits=logits)


if __name__ == "__main__":
    print(train({"floor": "set:train"}).best_reward)
