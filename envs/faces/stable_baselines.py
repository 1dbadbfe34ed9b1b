"""Many episodes as one vector environment of stable-baselines3.

It has the rows of ``ExplorationVectorEnv``, reset in the step that ends.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.engine.engine import NO_EPISODES
from lidarium.envs.faces.requests import options_of, seeds_of
from lidarium.envs.faces.team_rows import ACTIVE
from lidarium.envs.faces.teams import make_rows
from lidarium.envs.faces.vector_env import BatchFace, check_render_mode
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.settings.reset_options import Curriculum, ResetOptions, read_options
from lidarium.extras import install_command

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError(f"sb3_vec_env needs stable-baselines3: {install_command('rl')}") from error

Infos = list[dict[str, Any]]


class ExplorationVecEnv(BatchFace, VecEnv):
    """Teams of lidar robots that explore floors (stable-baselines3).

    Many episodes run in one kernel call.

    Row = episode * robots + robot; one policy drives all rows. A robot that ends before its team is done once; its
    row then repeats its last observation with reward 0 and ``infos[row]["active"]`` False. When the last robot of an
    episode ends, the repeating rows are done as well, truncated, and the episode begins again in the same step. In
    every row that is done, ``infos[row]["terminal_observation"]`` is the last observation of the robot, and
    ``infos[row]["TimeLimit.truncated"]`` tells the horizon from an ending of the robot itself. In all rows of an
    episode that is over, ``infos[row]["terminal_state"]`` is the last `state` of the team.

    Parameters
    ----------
    episodes, floor, level, image_resolution, curriculum, render_mode, **options
        As for ``ExplorationVectorEnv``.

    Notes
    -----
    Observations are written into two sets of arrays that take turns: the arrays that a step returns are overwritten
    by the step after the next one. Replay and rollout buffers copy the observations that they keep.

    Raises
    ------
    ValueError, FileNotFoundError
        If an option cannot be used.
    """

    def __init__(
        self,
        episodes: int,
        floor: Floors = "apartment",
        level: str = "velocity",
        image_resolution: float | None = None,
        curriculum: Curriculum | None = None,
        render_mode: str | None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        check_render_mode(render_mode)
        self.batch = make_rows(episodes, floor, options, level, image_resolution, False, curriculum)
        self.settings = self.batch.settings
        self.render_mode = render_mode
        self._actions: Any = None
        self._chosen: dict[int, ResetOptions] = {}
        self._is_closed = False
        super().__init__(self.batch.rows, self.batch.space, self.batch.action_space)

    def reset(self) -> Any:  # noqa: ANN401
        """Begin all episodes.

        It uses the seeds of ``seed`` and the options of ``set_options`` if they were called.
        """
        self._check_open()
        batch = self.batch
        batch.begin(np.arange(batch.episodes), self._seeds[:: batch.robots], self._chosen)
        self._actions = None
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = self._infos_of(np.arange(batch.rows))
        return batch.observations

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Give episode e the seed ``seed`` + e at the next reset; None draws one."""
        first = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        self._seeds = [one for one in seeds_of(first, self.batch.episodes) for _ in range(self.batch.robots)]
        return self._seeds

    def set_options(self, options: Sequence[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Set the options of the next reset.

        Parameters
        ----------
        options : dict, sequence of dict or None
            As for ``ExplorationVectorEnv.reset``; or a dict for each row, of which an episode takes that of
            its first robot.

        Raises
        ------
        ValueError
            If a sequence has another length, or an option has a bad value.
        """
        batch = self.batch
        if options is None or isinstance(options, dict):
            self._chosen = options_of(options, np.arange(batch.episodes), batch.episodes, batch.robots)
            return
        if len(options) != batch.rows:
            raise ValueError(
                f"options has {len(options)} entries; want one dict, or one for each of the {batch.rows} rows"
            )
        self._chosen = {
            episode: read_options(chosen, batch.robots) for episode, chosen in enumerate(options[:: batch.robots])
        }

    def _reset_options(self) -> None:
        self._chosen = {}

    def step_async(self, actions: Any) -> None:  # noqa: ANN401
        """Take the actions of all rows, or of each team by agent as in ``vector_env``; ``step_wait`` runs them."""
        self._check_open()
        if not self.batch.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before step()")
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], Infos]:
        """Run all episodes for one step (velocity) or decision.

        Episodes that are over begin again.
        """
        if self._actions is None:
            raise RuntimeError("no actions were given; call step_async() before step_wait()")
        actions, self._actions = self._actions, None
        batch = self.batch
        self._run(actions, NO_EPISODES)
        rewards, active = batch.rewards.astype(np.float32), batch.active
        truncated = batch.truncated
        dones = batch.terminated | truncated
        infos = self._infos_of(np.arange(batch.rows))
        for row, info in enumerate(infos):
            info["TimeLimit.truncated"] = bool(truncated[row])
            info[ACTIVE] = bool(active[row])
            if dones[row]:
                info["terminal_observation"] = batch.observation(row)
        over = np.flatnonzero(batch.is_over)
        if len(over):
            for episode, last in zip(over.tolist(), batch.states(over), strict=True):
                for row in range(episode * batch.robots, (episode + 1) * batch.robots):
                    infos[row]["terminal_state"] = last
            batch.begin(over, is_same_step=True)
            rows = (over[:, None] * batch.robots + np.arange(batch.robots)).ravel()
            for began, info in zip(rows.tolist(), self._infos_of(rows), strict=True):
                self.reset_infos[began] = info
        return batch.observations, rewards, dones, infos

    def _infos_of(self, rows: NDArray[np.int64]) -> Infos:
        """Return the infos as a dict for each of some rows."""
        infos = self.batch.infos
        names = [name for name in infos if not name.startswith("_")]
        return [
            {
                ACTIVE: True,
                **{name: _of_row(infos[name], row) for name in names if infos[f"_{name}"][row]},
            }
            for row in rows.tolist()
        ]

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError("the environment is closed; make a new one")

    def close(self) -> None:
        """Close the environment and release the worlds."""
        self.batch.close()
        self._is_closed = True

    @property
    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions each row may choose now, (rows, actions); only if the level has a mask."""
        masks = self.batch.masks
        if masks is None:
            raise AttributeError(
                "action_masks are there at the level of frontiers only; make the environment with level='frontier'"
            )
        return masks

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of this environment once for each row."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:  # noqa: ANN401
        """Refuse: rows share everything."""
        raise AttributeError(
            f"{attr_name} cannot be set for single rows: all rows share one batch; make a new environment instead"
        )

    def env_method(
        self,
        method_name: str,
        *method_args: Any,  # noqa: ANN401
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,  # noqa: ANN401
    ) -> list[Any]:
        """Return rows of ``action_masks``, which sb3-contrib's MaskablePPO asks for.

        Rows have no other methods.
        """
        if method_name != "action_masks":
            raise AttributeError(f"{method_name} cannot be called on single rows: all rows share one batch")
        masks = self.action_masks
        return [masks[row] for row in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None) -> list[bool]:
        """Return False for each row: there are no environments below to be wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of each episode, which ``render`` tiles; none for each row without a mode."""
        if self.render_mode is None:
            return [None] * self.num_envs
        from lidarium.envs.drawing.batch_frames import batch_frames

        return list(batch_frames(self.batch.scenes()))


def _of_row(values: Any, row: int) -> Any:  # noqa: ANN401
    """Return the entry of a row; of values by name, an entry of each."""
    return {name: _of_row(each, row) for name, each in values.items()} if isinstance(values, dict) else values[row]
