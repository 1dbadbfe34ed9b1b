"""Many episodes as one Gymnasium vector environment.

It has a row for every robot of every episode.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lidarium.envs.batch.episodes import EpisodeBatch
from lidarium.envs.batch.requests import episodes_of, options_of, seeds_of, settings_of
from lidarium.envs.batch.row_conventions import RowConventions
from lidarium.envs.conventions.conventions import split_options
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.outcome.team_state import state_space, team_state
from lidarium.envs.settings.reset_options import Curriculum

_NO_EPISODES = np.zeros(0, np.int64)

Step = tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class ExplorationVectorEnv(VectorEnv[Any, NDArray[Any], NDArray[Any]]):
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
    curriculum : callable or None
        As for ``lidarium.parallel_env``; episodes are counted over all as they begin.
    render_mode : str or None
        ``rgb_array``, for ``render`` and Gymnasium's ``RecordVideo``, or None.
    **options
        As for ``lidarium.parallel_env``; ``threads`` is that of the machine by default. ``merging``
        (``MergingSettings``) for the observations of ``MergedMaps``.

    Raises
    ------
    ValueError, FileNotFoundError
        Where an option cannot be used.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    def __init__(
        self,
        episodes: int,
        floor: Floors = "apartment",
        level: str = "velocity",
        image_resolution: float | None = None,
        copy: bool = True,
        render_mode: str | None = None,
        curriculum: Curriculum | None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        self.closed = True  # Gymnasium before 1.2 closes even what could not be made
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is {render_mode!r}; want rgb_array or None")
        merging = options.pop("merging", None)
        conventions, options = split_options(options)
        settings = settings_of(options)
        self.batch = EpisodeBatch(episodes, floor, settings, level, image_resolution, copy, curriculum)
        self.conventions = RowConventions(self.batch, conventions, merging)
        self.settings, self.render_mode = settings, render_mode
        period = settings.time_step if level == "velocity" else settings.decision_period_s
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / period}
        self.num_envs = self.batch.rows
        self.single_observation_space, self.single_action_space = (
            self.conventions.space,
            self.conventions.action_space,
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
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
        self.conventions.exchange()
        return self.conventions.observations(batch.observations), self._infos(batch.infos, batch.live.copy())

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
        actions = self.conventions.actions(actions)
        if batch.is_whole:
            batch.run(actions, _NO_EPISODES)
            return self._outcome(batch.truncated, batch.everyone)
        over = batch.is_over
        masked = ~batch.live & ~np.repeat(over, batch.robots)
        batch.run(actions, np.flatnonzero(over))
        truncated = batch.truncated
        if masked.any():
            truncated |= masked & np.repeat(batch.is_over, batch.robots)
        return self._outcome(truncated, ~masked)

    def _outcome(self, truncated: NDArray[np.bool_], active: NDArray[np.bool_]) -> Step:
        """Return what a step of the batch has brought, in the forms of the conventions."""
        batch = self.batch
        self.conventions.exchange()
        rewards, infos = self.conventions.rewards(batch.rewards, batch.acted, batch.infos)
        observations = self.conventions.observations(batch.observations)
        return observations, rewards, batch.terminated, truncated, self._infos(infos, active)

    def _infos(self, infos: dict[str, Any], active: NDArray[np.bool_]) -> dict[str, Any]:
        return {**self.conventions.infos(infos), "active": active, "_active": self.batch.everyone}

    @property
    def state_space(self) -> Box:
        """The space of the true state of each team."""
        return state_space(self.settings)

    def state(self) -> NDArray[np.float32]:
        """Return the true state of each team, (episodes, numbers); see `team_state`."""
        simulation = self.batch.simulation
        return np.stack([team_state(simulation, self.settings, k) for k in range(self.batch.episodes)])

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the episode of each row; robots of a team have the same picture.

        ``picture`` tiles one of each episode.
        """
        if self.render_mode is None:
            return None
        return tuple(frame for frame in self.batch.frames() for _ in range(self.batch.robots))

    def picture(self) -> NDArray[np.uint8]:
        """Draw all episodes side by side in one picture (rows, columns, 3)."""
        from lidarium.envs.drawing.batch_frames import tiled

        return tiled(self.batch.frames())

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
