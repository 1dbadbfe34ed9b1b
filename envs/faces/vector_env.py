"""Many episodes as one Gymnasium vector environment, a row for every robot of every episode."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lidarium.envs.engine.engine import NO_EPISODES, Engine
from lidarium.envs.engine.team_state import state_space
from lidarium.envs.faces.randomized import RandomizedRows
from lidarium.envs.faces.requests import episodes_of, options_of, seeds_of
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.faces.team_rows import ACTIVE, TeamRows
from lidarium.envs.faces.teams import make_rows
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum

Step = tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class BatchFace:
    """Members of a batch that do not depend on the library whose interface it has."""

    batch: TeamRows | RandomizedRows
    settings: ExplorationSettings

    def __repr__(self) -> str:
        batch = self.batch
        return f"<{type(self).__name__}: {batch.rows} rows = {batch.episodes} episodes x {batch.robots} robots>"

    @property
    def engine(self) -> Engine:
        """The engine of all episodes; if settings are drawn, each has its own, see ``batch.parts``."""
        if isinstance(self.batch, RandomizedRows):
            raise AttributeError("episodes with drawn settings have an engine each; see batch.parts")
        return self.batch.engine

    @property
    def drawn(self) -> list[dict[str, Any]]:
        """The values that each episode has drawn, by name; empty if no settings are drawn."""
        batch = self.batch
        return batch.drawn if isinstance(batch, RandomizedRows) else [{} for _ in range(batch.episodes)]

    def team(self, episode: int) -> EpisodeTeam:
        """Return the handle of an episode's team, which policies ask; see ``Policy.reset``."""
        return self.batch.team(episode)

    @property
    def columns(self) -> tuple[tuple[str, int, int], ...]:
        """Columns of each key of an observation in the flat form; see `flat_columns`."""
        return self.batch.columns

    @property
    def state_space(self) -> Box:
        """The space of the true state of each team."""
        return state_space(self.settings)

    def state(self) -> NDArray[np.float32]:
        """Return the true state of each team, (episodes, numbers), for central critics; see `team_state`."""
        return self.batch.states()

    def _run(self, actions: Any, beginning: NDArray[np.int64]) -> None:  # noqa: ANN401
        """Run by actions of rows, or of each team by agent, and begin episodes."""
        is_by_agent = isinstance(actions, list) and all(isinstance(each, Mapping) for each in actions)
        (self.batch.step_teams if is_by_agent else self.batch.step)(actions, beginning)


class ExplorationVectorEnv(BatchFace, VectorEnv[Any, NDArray[Any], NDArray[Any]]):
    """Teams of lidar robots that explore floors (Gymnasium); many episodes run in one kernel call.

    Row = episode * robots + robot. A robot that ends before its team returns terminated once; its row then repeats
    its last observation with reward 0 and ``infos["active"]`` False. When the last robot of an episode ends, the rows
    that repeat return truncated, and the next step begins the episode again, independent of its actions
    (``AutoresetMode.NEXT_STEP``). Every row has the same observations, rewards and endings as the robot of a single
    environment with the same seed, to the bit.

    Parameters
    ----------
    episodes : int
        Number of episodes.
    floor : Floors, optional
        As for ``lidarium.parallel_env``, ``apartment`` by default; of a set, each beginning draws one.
    level : str, optional
        Type of an action: ``velocity`` by default, ``waypoint``, ``frontier`` or a registered one.
    image_resolution : float, optional
        Side of a pixel [m] if the floor is a plain image.
    copy : bool, optional
        Whether each step returns new arrays, True by default. Otherwise two sets take turns: the arrays that a step
        returns are overwritten by the step after the next one.
    render_mode : str, optional
        ``rgb_array``, for ``render`` and Gymnasium's ``RecordVideo``. Nothing is drawn by default.
    curriculum : callable, optional
        As for ``lidarium.parallel_env``; episodes are counted over all as they begin.
    autoreset_mode : AutoresetMode or str, optional
        When episodes that are over begin again: ``NextStep``, the default, or ``SameStep``: in the step that ends them;
        ``infos["final_obs"]`` and ``infos["final_info"]`` then have the last results of their rows.
    **options
        As for ``lidarium.parallel_env``; ``threads`` is that of the machine by default. ``merging``
        (``MergingSettings``) for merged maps, with ``can_talk`` as for `MergedMaps`; ``plans_sparsely=True`` for routes
        on sparse maps (`SparsePlanning`); ``shares_map=False`` if robots plan paths on their own maps alone;
        ``reports=True`` for stations, which supervised policies need. With ``randomize`` each episode is an engine of
        its own.

    Raises
    ------
    ValueError, FileNotFoundError
        If an option cannot be used.
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,  # noqa: ANN401
    ) -> None:
        self.closed = True  # Gymnasium before 1.2 also closes environments that could not be made
        self._resets_in_step = _mode(autoreset_mode) is AutoresetMode.SAME_STEP
        check_render_mode(render_mode)
        self.batch = make_rows(episodes, floor, options, level, image_resolution, copy, curriculum)
        self.settings = self.batch.settings
        self.render_mode = render_mode
        first = self.batch.parts[0] if isinstance(self.batch, RandomizedRows) else self.batch
        self.metadata = {
            **type(self).metadata,
            "render_fps": 1.0 / first.engine.level.period_s,
            "autoreset_mode": _mode(autoreset_mode),
        }
        self.num_envs = self.batch.rows
        self.single_observation_space = self.batch.space
        self.single_action_space = self.batch.action_space
        self.observation_space = batch_space(self.batch.space, self.num_envs)
        self.action_space = batch_space(self.batch.action_space, self.num_envs)
        self.closed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes.

        Parameters
        ----------
        seed : int or sequence, optional
            ``s`` gives episode e the seed s + e; a sequence has one entry per episode. By default the episodes'
            generators go on.
        options : dict, optional
            ``floor``, ``starts``, ``goal`` as for ``ExplorationEnv.reset``, one for all or a sequence with one per
            episode, and ``episodes`` (episodes,) bool: which ones begin, all by default; or Gymnasium's ``reset_mask``
            (rows,), the same for all robots of an episode. Others are ignored.
        """
        self._check_open()
        batch = self.batch
        chosen = episodes_of(options, batch.episodes, batch.robots)
        seeds = seeds_of(seed, batch.episodes)
        batch.begin(
            chosen,
            [seeds[episode] for episode in chosen],
            options_of(options, chosen, batch.episodes, batch.robots),
        )
        return batch.observations, self._infos()

    def step(self, actions: Any) -> Step:  # noqa: ANN401
        """Run all episodes for one step (velocity) or decision; those that are over begin again.

        Parameters
        ----------
        actions : (rows, ...) array or list of dict
            An action for each row; those of rows that repeat or begin again are ignored. At the level of waypoints an
            array of objects may hold ``Target``, ``Route`` and None. Or the actions of each episode by agent, as for
            ``ExplorationEnv.step``, as policies return them.
        """
        self._check_open()
        batch = self.batch
        if not batch.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before step()")
        if actions is None:
            raise ValueError("actions is None; want an action for each row, row = episode * robots + robot")
        is_next = not (self._resets_in_step or batch.live.all())
        beginning = np.flatnonzero(batch.is_over) if is_next else NO_EPISODES
        self._run(actions, beginning)
        ended = batch.rewards, batch.terminated, batch.truncated
        infos = self._begin_ended() if self._resets_in_step else self._infos()
        return batch.observations, *ended, infos

    def _begin_ended(self) -> dict[str, Any]:
        """Let episodes that are over begin again; return the infos with the last results of their rows."""
        batch, final = self.batch, self._infos()
        over = np.flatnonzero(batch.is_over)
        if not len(over):
            return final
        rows = np.repeat(batch.is_over, batch.robots)
        last = np.full(batch.rows, None, object)
        for row in np.flatnonzero(rows).tolist():
            last[row] = batch.observation(row)
        batch.begin(over, is_same_step=True)
        masked = {name: values & rows if name.startswith("_") else values for name, values in final.items()}
        return {
            **_of_both(final, self._infos(), rows),
            ACTIVE: final[ACTIVE],  # describes the step, as rewards do: learners leave inactive rows out of the loss
            "final_obs": last,
            "_final_obs": rows,
            "final_info": masked,
            "_final_info": rows,
        }

    def _infos(self) -> dict[str, Any]:
        return {**self.batch.infos, ACTIVE: self.batch.active, f"_{ACTIVE}": np.ones(self.num_envs, np.bool_)}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the episode of each row; robots of a team have the same picture. `picture` tiles one of each."""
        if self.render_mode is None:
            return None
        from lidarium.envs.drawing.batch_frames import batch_frames

        return tuple(frame for frame in batch_frames(self.batch.scenes()) for _ in range(self.batch.robots))

    def picture(self) -> NDArray[np.uint8]:
        """Draw all episodes side by side in one picture (rows, columns, 3)."""
        from lidarium.envs.drawing.batch_frames import batch_frames, tiled

        return tiled(batch_frames(self.batch.scenes()))

    def _check_open(self) -> None:
        if self.closed:
            raise RuntimeError("the environment is closed; make a new one")

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Release everything that the worlds hold beyond arrays."""
        self.batch.close()


def _of_both(before: Mapping[str, Any], now: Mapping[str, Any], rows: NDArray[np.bool_]) -> dict[str, Any]:
    """Return infos of which some rows are new, those whose episodes have begun again."""
    found: dict[str, Any] = {}
    for name in {**before, **now}:
        old, new = before.get(name), now.get(name)
        if isinstance(old, Mapping) or isinstance(new, Mapping):
            found[name] = _of_both(old or {}, new or {}, rows)
            continue
        like = old if new is None else new
        assert like is not None
        absent = np.full(like.shape, None if like.dtype == object else 0, like.dtype)
        is_new = rows.reshape(-1, *(1,) * (like.ndim - 1))
        found[name] = np.where(is_new, absent if new is None else new, absent if old is None else old)
    return found


def _mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        found = AutoresetMode(mode)
    except ValueError:
        found = AutoresetMode.DISABLED
    if found is AutoresetMode.DISABLED:
        raise ValueError(f"autoreset_mode is {mode!r}; want NextStep or SameStep")
    return found


def check_render_mode(render_mode: str | None) -> None:
    """Check the render mode of a batch."""
    if render_mode == "human":
        raise ValueError(
            "render_mode is 'human'; want rgb_array or None: a batch has no window, use lidarium.parallel_env"
        )
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode is {render_mode!r}; want rgb_array or None")


def make_vector_env(num_envs: int, **options: Any) -> ExplorationVectorEnv:  # noqa: ANN401
    """Make the batched form of the Gymnasium environments, for ``gymnasium.make_vec``: one robot an episode.

    Raises
    ------
    ValueError
        If more than one robot is asked for, or an option cannot be used.
    """
    if options.setdefault("robots", 1) != 1:
        raise ValueError(
            f"robots is {options['robots']}; the Gymnasium form has one robot, use lidarium.vector_env for teams"
        )
    return ExplorationVectorEnv(num_envs, **options)
