"""Many episodes of which each draws settings of its own (domain randomisation)."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lidarium.envs.batch.requests import count_of_episodes, episodes_of, option_of, seeds_of
from lidarium.envs.batch.vector_env import ExplorationVectorEnv, Step
from lidarium.envs.conventions.conventions import split_options
from lidarium.envs.levels.randomized_team import (
    ROBOTS,
    SETTINGS_STREAM,
    Distributions,
    check_distributions,
    draw,
)
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings, set_values
from lidarium.envs.settings.reset_options import Curriculum, of_number


class RandomizedVectorEnv(VectorEnv[Any, NDArray[Any], NDArray[Any]]):
    """Episodes of teams, each with settings drawn as it begins (Gymnasium).

    Rows, seeds, resets and infos are those of ``ExplorationVectorEnv``; an episode is that of a
    ``RandomizedTeam`` with the same seed, to the bit. Kernels have one choice of settings, so each episode is
    a batch of its own, and they are stepped one after the other.

    Parameters
    ----------
    episodes : int
        How many.
    randomize : mapping
        From names of settings to distributions, as for ``lidarium.parallel_env``.
    curriculum : callable or None
        As for ``ExplorationVectorEnv``.
    **options
        As for ``ExplorationVectorEnv``, without ``render_mode`` and ``copy``.

    Attributes
    ----------
    drawn : list of dict
        What each episode has drawn, by name.

    Raises
    ------
    ValueError, TypeError
        Where an option cannot be used, or draws change the spaces or the size of teams.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012
    render_mode = None

    def __init__(
        self,
        episodes: int,
        randomize: Distributions,
        curriculum: Curriculum | None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        check_distributions(randomize)
        if ROBOTS in randomize:
            raise ValueError(
                "randomize has 'robots'; leave it out: teams of a batch have one size, use "
                "lidarium.parallel_env to draw it"
            )
        episodes = count_of_episodes(episodes)
        of_batch = {name: options.pop(name) for name in OF_BATCH if name in options}
        others = split_options(options)[1]
        self._forms = {name: options[name] for name in options if name not in others}
        self._fixed: ExplorationSettings = make_settings(**others)
        self._make = partial(ExplorationVectorEnv, 1, **of_batch, **self._forms)
        self._distributions, self._curriculum, self._begun = dict(randomize), curriculum, 0
        self.episodes, self.robots = episodes, self._fixed.robots
        self._generators: list[np.random.Generator | None] = [None] * episodes
        generator = np.random.default_rng(0)
        made = [self._made(generator) for _ in range(episodes)]
        self._parts = [part for part, _ in made]
        self.drawn = [drawn for _, drawn in made]
        self._is_ready = np.zeros(episodes, np.bool_)
        self.settings, self.conventions = self._fixed, self._parts[0].conventions
        self.num_envs = episodes * self.robots
        self.single_observation_space = self._parts[0].single_observation_space
        self.single_action_space = self._parts[0].single_action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def _made(self, generator: np.random.Generator) -> tuple[ExplorationVectorEnv, dict[str, Any]]:
        """Return a batch of one episode with settings that are drawn, and what was drawn."""
        drawn = {name: draw(each, generator) for name, each in self._distributions.items()}
        return self._make(settings=set_values(self._fixed, drawn)), drawn

    def _begin(
        self, episode: int, seed: int | None, options: Mapping[str, Any]
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode with new settings."""
        generator = self._generators[episode]
        if seed is not None:
            generator = np.random.default_rng((seed, SETTINGS_STREAM))
        elif generator is None:
            generator = np.random.default_rng()
        part, drawn = self._made(generator)
        spaces = part.single_observation_space, part.single_action_space
        if spaces != (self.single_observation_space, self.single_action_space):
            raise ValueError(
                f"settings drawn are {drawn}; want some that leave the spaces of observations and actions as "
                "they are: learners have one for all episodes"
            )
        own = int(generator.integers(2**31)) if seed is None else seed
        taught = of_number(self._curriculum, self._begun)
        outcome = part.reset(seed=own, options={**taught, **options})
        self._parts[episode].close()
        self._parts[episode], self.drawn[episode], self._generators[episode] = part, drawn, generator
        self._is_ready[episode] = True
        self._begun += 1
        return outcome

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; see ``ExplorationVectorEnv.reset``, but all of them begin."""
        chosen, seeds = episodes_of(options, self.episodes), seeds_of(seed, self.episodes)
        if len(chosen) < self.episodes:
            raise ValueError(
                "option episodes leaves some out; want all: episodes of drawn settings begin alike"
            )
        parts = [
            self._begin(episode, seeds[episode], option_of(options, episode, self.episodes))
            for episode in range(self.episodes)
        ]
        return together([seen for seen, _ in parts]), together_infos(
            [infos for _, infos in parts], self.robots
        )

    def step(self, actions: Any) -> Step:  # noqa: ANN401
        """Run all episodes for one step or decision; those that are over begin again."""
        if not self._is_ready.all():
            raise RuntimeError("the environment was not reset; call reset() before step()")
        steps = [self._step_part(episode, actions) for episode in range(self.episodes)]
        seen, rewards, terminated, truncated, infos = zip(*steps, strict=True)
        return (
            together(seen),
            np.concatenate(rewards),
            np.concatenate(terminated),
            np.concatenate(truncated),
            together_infos(infos, self.robots),
        )

    def _step_part(self, episode: int, actions: Any) -> Step:  # noqa: ANN401
        part = self._parts[episode]
        if part.batch.is_over[0]:
            seen, infos = self._begin(episode, None, {})
            nothing = np.zeros(self.robots, np.bool_)
            return seen, np.zeros(self.robots), nothing, nothing.copy(), infos
        rows = slice(episode * self.robots, (episode + 1) * self.robots)
        return part.step(_of_rows(actions, rows, self.num_envs))

    @property
    def state_space(self) -> Box:
        """The space of the true state of each team."""
        return self._parts[0].state_space

    def state(self) -> NDArray[np.float32]:
        """Return the true state of each team, (episodes, numbers)."""
        return np.concatenate([part.state() for part in self._parts])

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401
        """Give back what the worlds hold."""
        for part in self._parts:
            part.close()


OF_BATCH = ("floor", "level", "image_resolution", "merging")
"""Options that are neither settings nor conventions."""


def _of_rows(actions: Any, rows: slice, count: int) -> Any:  # noqa: ANN401
    """Return the actions of some rows, those of all being an array or arrays by name."""
    if isinstance(actions, Mapping):
        return {name: _of_rows(part, rows, count) for name, part in actions.items()}
    array = np.asarray(actions)
    if array.ndim == 0 or len(array) != count:
        raise ValueError(
            f"actions have shape {array.shape}; want one for each of the {count} rows, row = episode * "
            "robots + robot"
        )
    return array[rows]


def together(parts: Sequence[Any]) -> Any:  # noqa: ANN401
    """Return observations of all rows, those of each episode one after the other."""
    if isinstance(parts[0], Mapping):
        return {name: together([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(parts)


def together_infos(parts: Sequence[Mapping[str, Any]], rows: int) -> dict[str, Any]:
    """Return infos of all rows; where an episode lacks one, its mask is False there."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(name for part in parts for name in part):
        given = [part.get(name) for part in parts]
        example = next(each for each in given if each is not None)
        if isinstance(example, Mapping):
            found[name] = together_infos([{} if each is None else each for each in given], rows)
            continue
        absent = np.full((rows, *example.shape[1:]), None if example.dtype == object else 0, example.dtype)
        found[name] = np.concatenate([absent if each is None else each for each in given])
    return found
