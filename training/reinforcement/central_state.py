"""Shows a central critic the true state of the team, as MAPPO has it.

C. Yu et al., "The surprising effectiveness of PPO in cooperative multi-agent games", 2022.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from lidarium.envs.faces.stable_baselines import ExplorationVecEnv
from lidarium.training.reinforcement.frontier_policy import STATE


class CentralState(VecEnvWrapper):
    """Adds the true state of its team to the observation of each robot, as ``state``; actors must not see it."""

    def __init__(self, venv: VecEnv) -> None:
        assert isinstance(venv.unwrapped, ExplorationVecEnv)
        assert isinstance(venv.observation_space, spaces.Dict)
        self._teams = venv.unwrapped
        super().__init__(venv, spaces.Dict({**venv.observation_space.spaces, STATE: self._teams.state_space}))

    def reset(self) -> dict[str, NDArray[Any]]:
        """Begin all episodes."""
        return self._with_state(self.venv.reset())

    def step_wait(self) -> VecEnvStepReturn:
        """Run all episodes for one decision; last observations have the last state of the team."""
        observations, rewards, dones, infos = self.venv.step_wait()
        seen = self._with_state(observations)
        for row in np.flatnonzero(dones):
            last = infos[row].get("terminal_state", seen[STATE][row])  # if the robot alone has ended, teams go on
            infos[row]["terminal_observation"] = {**infos[row]["terminal_observation"], STATE: last}
        return seen, rewards, dones, infos

    def _with_state(self, observations: Any) -> dict[str, NDArray[Any]]:  # noqa: ANN401
        return {**observations, STATE: self._teams.state().repeat(self._teams.batch.robots, axis=0)}
