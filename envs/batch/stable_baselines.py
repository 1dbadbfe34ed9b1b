"""Many episodes as one vector environment of stable-baselines3: the rows of ``ExplorationVectorEnv``, reset in the step that ends."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.batch.endings import HORIZON
from lidarium.envs.batch.episodes import Arrays, EpisodeBatch
from lidarium.envs.batch.requests import options_of
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings import make_settings
from lidarium.mapping.kernels import available_threads

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError('sb3_vec_env needs stable-baselines3; install it with: pip install "lidarium[rl]"') from error

Infos = list[dict[str, Any]]


class ExplorationVecEnv(VecEnv):
    """Teams of lidar robots explore floors, many episodes in one kernel call (stable-baselines3).

    Row = episode * robots + robot; one policy drives all rows. Where the last robot of an episode ends, the episode begins anew in
    the same step: ``dones`` is set for its rows that were not done before, or that repeat; ``infos[row]["terminal_observation"]`` is
    what the row saw last, and ``infos[row]["TimeLimit.truncated"]`` tells the horizon from an ending. A robot that ends before its
    team is done once, with its own last observation; its row then repeats that with reward 0 and ``infos[row]["active"]`` False, and
    is truncated when the episode ends.

    Parameters
    ----------
    episodes, floor, level, image_resolution, **options
        As for ``ExplorationVectorEnv``.

    Notes
    -----
    Observations are written into two sets of arrays that take turns: what a step returns is overwritten by the step after the next
    one. Replay and rollout buffers copy what they keep.
    """

    def __init__(
        self,
        episodes: int,
        floor: str | Path | Floor = "apartment",
        level: str = "velocity",
        image_resolution: float | None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        settings = make_settings(**{"threads": available_threads(), **options})
        self.batch = EpisodeBatch(episodes, floor, settings, level, image_resolution, copy=False)
        self.settings = settings
        self.render_mode = None
        self._actions: NDArray[Any] | None = None
        self._is_closed = False
        super().__init__(self.batch.rows, self.batch.observation_space, self.batch.action_space)

    def reset(self) -> Arrays:
        """Begin all episodes, with the seeds of ``seed`` and the options of ``set_options`` where they were called."""
        self._check_open()
        batch = self.batch
        firsts = range(0, batch.rows, batch.robots)
        # stable-baselines3 keeps a seed and options for every row; the first robot's are the episode's.
        options = {
            episode: options_of(self._options[first], np.array([0]), 1, batch.robots).get(0)
            for episode, first in enumerate(firsts)
            if self._options[first]
        }
        seeds = [self._seeds[first] for first in firsts]
        batch.run(None, np.arange(batch.episodes), seeds, {episode: chosen for episode, chosen in options.items() if chosen is not None})
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = self._row_infos()
        return batch.observations

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Give episode e the seed ``seed`` + e at the next reset; None draws one."""
        first = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        self._seeds = [first + row // self.batch.robots for row in range(self.num_envs)]
        return self._seeds

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of all rows; ``step_wait`` runs them."""
        self._check_open()
        if not self.batch.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before step()")
        self._actions = actions

    def step_wait(self) -> tuple[Arrays, NDArray[np.float32], NDArray[np.bool_], Infos]:
        """Run all episodes for one step (velocity) or decision, and begin those anew that are over."""
        if self._actions is None:
            raise RuntimeError("no actions were given; call step_async() before step_wait()")
        actions, self._actions = self._actions, None
        batch = self.batch
        masked = ~batch.live
        batch.run(actions, np.zeros(0, np.int64))
        over = np.flatnonzero(batch.is_over)
        is_over = np.repeat(batch.is_over, batch.robots)
        rewards = batch.rewards.astype(np.float32)
        truncated = (batch.reasons == HORIZON) | masked & is_over
        dones = (batch.reasons != 0) | masked & is_over
        infos = self._row_infos()
        for row, info in enumerate(infos):
            info["TimeLimit.truncated"] = bool(truncated[row])
            info["active"] = not masked[row]
            if dones[row]:
                info["terminal_observation"] = {name: array[row].copy() for name, array in batch.observations.items()}
        if len(over):
            self._begin_anew(over)
        return batch.observations, rewards, dones, infos

    def _begin_anew(self, over: NDArray[np.int64]) -> None:
        """Begin episodes in the step that ended them; the other rows keep what they see."""
        batch = self.batch
        batch.run(None, over, is_same_step=True)
        beginnings = self._row_infos()
        for row in np.flatnonzero(np.repeat(np.isin(np.arange(batch.episodes), over), batch.robots)):
            self.reset_infos[row] = beginnings[row]

    def _row_infos(self) -> Infos:
        """Return the batch's infos as a dict for each row."""
        truth, told = self.batch.infos["truth"], self.batch.infos
        names = [name for name in told if name != "truth" and not name.startswith("_")]
        infos: Infos = []
        for row in range(self.num_envs):
            info: dict[str, Any] = {"truth": {name: array[row] for name, array in truth.items()}, "active": True}
            for name in names:
                if told[f"_{name}"][row]:
                    info[name] = told[name][row]
            infos.append(info)
        return infos

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError("the environment is closed; make a new one")

    def close(self) -> None:
        """Close; nothing is held open."""
        self._is_closed = True

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of this environment once for each row."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:  # noqa: ANN401
        """Refuse: rows share everything."""
        raise AttributeError(f"{attr_name} cannot be set for single rows: all rows share one batch; make a new environment instead")

    def env_method(
        self,
        method_name: str,
        *method_args: Any,  # noqa: ANN401
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Refuse: rows are no environments of their own."""
        raise AttributeError(f"{method_name} cannot be called on single rows: all rows share one batch")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None) -> list[bool]:
        """Return False for each row: there are no environments below to be wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return no images: a batch is not drawn."""
        return [None] * self.num_envs
