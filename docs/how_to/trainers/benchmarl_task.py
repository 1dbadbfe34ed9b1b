"""A task for BenchMARL: a team explores, for IPPO, MAPPO and the other algorithms.

Usage: python docs/how_to/trainers/benchmarl_task.py
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from benchmarl.algorithms import IppoConfig, MappoConfig
from benchmarl.algorithms.common import AlgorithmConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from benchmarl.utils import DEVICE_TYPING
from torchrl.envs import EnvBase, PettingZooWrapper

import lidarium

TEAM = {"robots": 2, "level": "frontier", "observe": ["frontiers"], "max_cycles": 600}
FORMS = {"observation": "flat", "infos": "none", "ended_agents": "zeros"}


class Exploration(PettingZooClass):
    """A team of lidar robots; ``config`` has options of ``lidarium.parallel_env``."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: DEVICE_TYPING
    ) -> Callable[[], EnvBase]:
        """Return what makes an environment."""
        mask = "inside" if self.supports_continuous_actions() else "beside"
        options = {**TEAM, **FORMS, "action_mask": mask, **self.config}
        return lambda: PettingZooWrapper(
            lidarium.parallel_env(**options), return_state=True, done_on_any=False, seed=seed, device=device
        )

    def supports_continuous_actions(self) -> bool:
        """Whether actions are speeds or waypoints."""
        return self.config.get("level", TEAM["level"]) != "frontier"

    def supports_discrete_actions(self) -> bool:
        """Whether actions are numbers of frontiers."""
        return not self.supports_continuous_actions()

    def has_state(self) -> bool:
        """Whether there is a state for critics of the team."""
        return True

    def has_render(self, env: EnvBase) -> bool:
        """Whether evaluations are filmed."""
        return self.config.get("render_mode") == "rgb_array"

    def max_steps(self, env: EnvBase) -> int:
        """Return the most steps of an episode."""
        return int(self.config.get("max_cycles", TEAM["max_cycles"]))

    @staticmethod
    def env_name() -> str:
        """Return the name under which BenchMARL files results."""
        return "lidarium"


def experiment(
    options: dict[str, Any],
    algorithm: AlgorithmConfig,
    seed: int = 0,
    config: Mapping[str, Any] = MappingProxyType({}),
) -> Experiment:
    """Return an experiment of BenchMARL; ``config`` has attributes of ``ExperimentConfig``."""
    chosen = ExperimentConfig.get_from_yaml()
    chosen.loggers, chosen.render, chosen.lr = ["csv"], False, 5e-4
    for name, value in config.items():
        setattr(chosen, name, value)
    network = MlpConfig.get_from_yaml()
    return Experiment(
        task=Exploration("EXPLORATION", options),
        algorithm_config=algorithm,
        model_config=network,
        critic_model_config=network,
        seed=seed,
        config=chosen,
    )


if __name__ == "__main__":
    for algorithm in (IppoConfig.get_from_yaml(), MappoConfig.get_from_yaml()):
        experiment({"floor": "set:train"}, algorithm, config={"max_n_frames": 100_000}).run()
