"""Many episodes as one Gymnasium vector environment.

It has a row for every robot of every episode.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lidarium.envs.batch.episodes import Arrays, EpisodeBatch
from lidarium.envs.batch.requests import episodes_of, options_of, seeds_of, settings_of
from lidarium.envs.floors.floor_choice import Floors

_NO_EPISODES = np.zeros(0, np.int64)

Step = tuple[Arrays, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class ExplorationVectorEnv(VectorEnv[Arrays, NDArray[Any], NDArray[Any]]):
    """Teams of lidar robots that explore floors (Gymnasium).

    Many episodes run in one kernel call.

    Row = episode * robots + robot. A robot that ends before its team returns terminated once; its row then
    repeats its last observation with reward 0 and ``infos["active"]`` False. When the last robot of an
    episode ends, the rows that repeat return truncated, and the next step begins the episode again whatever
    its actions (``AutoresetMode.NEXT_STEP``). Every row sees, earns and ends as the robot of an
    ``ExplorationEnv`` with the same seed, to the bit.

    Parameters
    ----------
    episodes : int
        How many episodes.
    floor : Floors
        As for ``lidarium.parallel_env``; of a set, each beginning draws one.
    level : str
        What an action is: ``velocity``, ``waypoint`` or ``frontier``.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.
    copy : bool
        Whether each step returns new arrays. Otherwise two sets take turns: what a step returns is
        overwritten by the step after the next one.
    render_mode : None
        Batches are not drawn.
    **options
        As for ``lidarium.parallel_env``; ``threads`` is that of the machine by default.

    Raises
    ------
    ValueError, FileNotFoundError
        Where an option cannot be used.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        episodes: int,
        floor: Floors = "apartment",
        level: str = "velocity",
        image_resolution: float | None = None,
        copy: bool = True,
        render_mode: None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        if render_mode is not None:
            raise ValueError(
                f"render_mode is {render_mode!r}; a batch is not drawn, use lidarium.parallel_env to look at "
                "an episode"
            )
        settings = settings_of(options)
        self.batch = EpisodeBatch(episodes, floor, settings, level, image_resolution, copy)
        self.settings, self.render_mode = settings, None
        self.num_envs = self.batch.rows
        self.single_observation_space, self.single_action_space = (
            self.batch.observation_space,
            self.batch.action_space,
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Begin episodes.

        Parameters
        ----------
        seed : int, sequence or None
            ``s`` gives episode e the seed s + e; a sequence has one entry per episode; None goes on with the
            episodes' generators.
        options : dict or None
            ``floor``, ``starts``, ``goal`` as for ``ExplorationEnv.reset``, one for all or a sequence with
            one per episode, and ``episodes`` (episodes,) bool: which ones begin, all by default. Others are
            ignored.
        """
        self._check_open()
        batch = self.batch
        chosen = episodes_of(options, batch.episodes)
        seeds = seeds_of(seed, batch.episodes)
        batch.run(
            None,
            chosen,
            [seeds[episode] for episode in chosen],
            options_of(options, chosen, batch.episodes, batch.robots),
        )
        return batch.observations, self._infos(batch.live.copy())

    def step(self, actions: NDArray[Any]) -> Step:
        """Run all episodes for one step (velocity) or decision.

        Those that are over begin again.

        Parameters
        ----------
        actions : (rows, ...) array
            An action a row; those of rows that repeat or begin again are ignored.
        """
        self._check_open()
        batch = self.batch
        if not batch.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before step()")
        if actions is None:
            raise ValueError("actions is None; want an action for each row, row = episode * robots + robot")
        if batch.is_whole:
            batch.run(actions, _NO_EPISODES)
            return (
                batch.observations,
                batch.rewards.copy(),
                batch.terminated,
                batch.truncated,
                self._infos(batch.everyone),
            )
        over = batch.is_over
        masked = ~batch.live & ~np.repeat(over, batch.robots)
        batch.run(actions, np.flatnonzero(over))
        truncated = batch.truncated
        if masked.any():
            truncated |= masked & np.repeat(batch.is_over, batch.robots)
        return batch.observations, batch.rewards.copy(), batch.terminated, truncated, self._infos(~masked)

    def _infos(self, active: NDArray[np.bool_]) -> dict[str, Any]:
        return {**self.batch.infos, "active": active, "_active": self.batch.everyone}

    def _check_open(self) -> None:
        if self.closed:
            raise RuntimeError("the environment is closed; make a new one")

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Give back what the worlds hold."""
        self.batch.simulation.close()


def make_vector_env(num_envs: int, **options: Any) -> ExplorationVectorEnv:  # noqa: ANN401
    """Make the batched form of the Gymnasium environments.

    It is for ``gymnasium.make_vec``: one robot an episode.

    Raises
    ------
    ValueError
        Where more than one robot is asked for, or an option cannot be used.
    """
    if options.setdefault("robots", 1) != 1:
        raise ValueError(
            f"robots is {options['robots']}; the Gymnasium form has one robot, use lidarium.vector_env for "
            "teams"
        )
    return ExplorationVectorEnv(num_envs, **options)
