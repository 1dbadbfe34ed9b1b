"""Supervisors around batches of stable-baselines3."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from lidarium.agents.supervisor.wrappers import DIRECTED, Make, Supervisors, check_masks, with_orders
from lidarium.envs.faces.conventions import MASK
from lidarium.envs.faces.stable_baselines import ExplorationVecEnv


class SupervisedVecEnv(VecEnvWrapper):
    """A supervisor around each episode of a batch of stable-baselines3; see `SupervisedTeam`.

    ``infos[row]["directed"]`` is True for a robot under an order of the station. ``action_masks`` shows orders if
    ``masks_orders`` is set.

    Parameters
    ----------
    venv : ExplorationVecEnv
        The episodes, made by ``lidarium.sb3_vec_env`` with ``reports=True``.
    make, masks_orders
        As for `SupervisedTeam`.

    Attributes
    ----------
    supervisors : list of Supervised
        Those of the episodes.
    """

    def __init__(
        self,
        venv: Any,  # noqa: ANN401
        make: Make,
        masks_orders: bool = False,
    ) -> None:
        super().__init__(venv)
        self._batch: ExplorationVecEnv = venv
        self._stations = Supervisors(venv, make)
        self.supervisors = self._stations.each
        self._masks = masks_orders
        if masks_orders:
            check_masks(venv.observation_space)
        self._directed: NDArray[np.bool_] = np.zeros(venv.num_envs, np.bool_)

    def reset(self) -> Any:  # noqa: ANN401
        """Begin all episodes; see ``ExplorationVecEnv.reset``."""
        observations = self._direct(self.venv.reset())
        for row, info in enumerate(self.reset_infos):
            info[DIRECTED] = bool(self._directed[row])
        return observations

    def step_async(self, actions: Any) -> None:  # noqa: ANN401
        """Take the actions of robots without orders, and the orders of the others."""
        self._batch.step_async(self._stations.actions(actions))

    def step_wait(self) -> VecEnvStepReturn:
        """Run all episodes; those that are over begin again."""
        observations, rewards, dones, infos = self.venv.step_wait()
        observations = self._direct(observations)
        for row, info in enumerate(infos):
            info[DIRECTED] = bool(self._directed[row])
        return observations, rewards, dones, infos

    def _direct(self, observations: Any) -> Any:  # noqa: ANN401
        self._directed = self._stations.direct()
        return {**observations, MASK: with_orders(observations[MASK], self._directed)} if self._masks else observations

    @property
    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions each row may choose now, (rows, actions)."""
        masks = self._batch.action_masks
        return with_orders(masks, self._directed) if self._masks else masks

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:  # noqa: ANN401
        """Return rows of ``action_masks``, which sb3-contrib's MaskablePPO asks for."""
        if method_name != "action_masks":
            return self.venv.env_method(method_name, *method_args, indices=indices, **method_kwargs)
        masks = self.action_masks
        return [masks[row] for row in self._get_indices(indices)]
