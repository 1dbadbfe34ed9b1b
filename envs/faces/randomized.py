"""Settings that are drawn for each episode (domain randomisation), alone and in batches."""

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.engine.team_state import ROBOT_NUMBERS, state_space, team_state
from lidarium.envs.faces.conventions import MASK
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.faces.team_rows import TeamRows
from lidarium.envs.faces.wrapper import TeamWrapper
from lidarium.envs.settings.draws import ROBOTS, Distributions, Draws
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import ResetOptions, checked_seed

SETTINGS_STREAM = 77
"""Separates the draws of settings from those of floors, starts and noise."""

OF_TEAMMATES = ("teammates", "messages")
"""Keys of observations with a row for each of the others."""


class RandomizedTeam(TeamWrapper):
    """Draws settings at each reset, and makes an environment of them.

    If ``robots`` is drawn, ``possible_agents`` are those of the largest team, and ``agents`` those of the episode.
    Observations of teammates have rows for the largest team, zeros behind those of the episode, and so has the state.

    Parameters
    ----------
    make : callable
        Takes settings and the number of the episode and returns the environment.
    settings : ExplorationSettings
        The settings that are not drawn.
    distributions : mapping
        From names of settings to `Distribution`.

    Attributes
    ----------
    drawn : dict
        The values that were drawn for this episode, by name.

    Raises
    ------
    ValueError
        If a name or a distribution is not valid, a draw is not a valid value of its setting, or draws change the
        spaces of observations or actions.
    """

    def __init__(
        self,
        make: Callable[[ExplorationSettings, int], Any],
        settings: ExplorationSettings,
        distributions: Distributions,
    ) -> None:
        self._draws = Draws(settings, distributions)
        self._make = make
        self._generator = np.random.default_rng(0)
        self._episode = 0
        self._has_begun = self._is_closed = False
        self._level: tuple[Any, ...] | None = None
        self.drawn = self._draws.draw(self._generator)
        self._draws.smallest(make, self.drawn)
        super().__init__(make(self._draws.settings_of(self.drawn), 0))
        self._pads = self._draws.sizes is not None
        self._note_largest()

    def _note_largest(self) -> None:
        """Take the agents and spaces of the largest team."""
        largest = self.env
        if self._draws.sizes is not None:
            self.drawn[ROBOTS] = self._draws.sizes[1]
            largest = self._made(self.drawn)
        self.possible_agents = largest.possible_agents
        agent = self.possible_agents[0]
        self._spaces: tuple[spaces.Space[Any], spaces.Space[Any]] = (
            largest.observation_space(agent),
            largest.action_space(agent),
        )
        self._state_space = largest.state_space

    def _made(self, drawn: Mapping[str, Any]) -> Any:  # noqa: ANN401
        made = self._make(self._draws.settings_of(drawn), self._episode)
        if self._level is not None:
            made.use_level(*self._level)
        return made

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; see ``ExplorationEnv.use_level``."""
        super().use_level(name, shares_map, decision_period_s)
        self._level = name, shares_map, decision_period_s
        self._note_largest()

    @property
    def minimum_robots(self) -> int:
        """The number of robots of the smallest team that is drawn."""
        return self.settings.robots if self._draws.sizes is None else self._draws.sizes[0]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, that of the largest team."""
        self._check_agent(agent)
        return self._spaces[0]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        self._check_agent(agent)
        return self._spaces[1]

    def _check_agent(self, agent: str) -> None:
        if agent not in self.possible_agents:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode of newly drawn settings; see ``ExplorationEnv.reset``."""
        if self._is_closed:
            raise RuntimeError("the environment is closed; make a new one")
        seed = checked_seed(seed)
        generator = copy.deepcopy(self._generator)
        if seed is not None:
            generator = np.random.default_rng((seed, SETTINGS_STREAM))
        elif not self._has_begun:
            generator = np.random.default_rng()
        drawn = self._draws.draw(generator)
        made, agent = self._made(drawn), self.possible_agents[0]
        _check_spaces(drawn, (made.observation_space(agent), made.action_space(agent)), self._spaces)
        own = int(generator.integers(2**31)) if seed is None else seed
        observations, infos = made.reset(own, options)
        # Until here a bad option leaves the episode before as it is.
        self.env.close()
        self.env, self.agents, self.settings = made, made.agents, made.settings
        self.drawn, self._generator, self._has_begun = drawn, generator, True
        self._episode += 1
        return self._padded(observations), infos

    def close(self) -> None:
        """Close the environment of the episode; none is made any more."""
        self._is_closed = True
        super().close()

    def step(self, actions: Any) -> Any:  # noqa: ANN401
        """Take a step or a decision."""
        observations, *others = super().step(actions)
        return (self._padded(observations), *others)

    def _padded(self, observations: dict[str, Any]) -> dict[str, Any]:
        if not self._pads:
            return observations
        return {agent: padded(each, self._spaces[0]) for agent, each in observations.items()}

    @property
    def state_space(self) -> spaces.Box:
        """The space of ``state``, that of the largest team."""
        space: spaces.Box = self._state_space
        return space

    def state(self) -> NDArray[np.float32]:
        """Return the true state of the team, zeros for robots that it lacks."""
        return _padded_state(super().state(), self.settings.robots, self._state_space)


class RandomizedRows:
    """The rows of many episodes, each with settings drawn as it begins; it has the face of `TeamRows`.

    Kernels have one choice of settings, so each episode is an engine of its own, and they are stepped one after the
    other. An episode is that of a `RandomizedTeam` with the same seed, to the bit. If the size of teams is drawn, each
    episode has rows for the largest team; rows of robots that it lacks are never active, and hold zeros, with a mask
    that allows them to stay alone.

    Parameters
    ----------
    episodes : int
        Number of episodes.
    make : callable
        Takes settings and the number of an episode and returns the `TeamRows` of one episode.
    settings : ExplorationSettings
        The settings that are not drawn.
    distributions : mapping
        From names of settings to `Distribution`.

    Attributes
    ----------
    drawn : list of dict
        The values that each episode has drawn, by name.
    parts : list of TeamRows
        The rows of each episode.
    """

    def __init__(
        self,
        episodes: int,
        make: Callable[[ExplorationSettings, int], TeamRows],
        settings: ExplorationSettings,
        distributions: Distributions,
    ) -> None:
        if isinstance(episodes, bool) or not isinstance(episodes, int | np.integer) or episodes < 1:
            raise ValueError(f"the number of episodes is {episodes!r}; want a whole number of at least 1")
        self._draws = Draws(settings, distributions)
        self._make = make
        self.episodes = int(episodes)
        sizes = self._draws.sizes
        self._pads = sizes is not None
        self.robots = settings.robots if sizes is None else sizes[1]
        self.rows = self.episodes * self.robots
        generator = np.random.default_rng(0)
        self.drawn = [self._draws.draw(generator) for _ in range(self.episodes)]
        self._draws.smallest(make, self.drawn[0])
        self.parts = [make(self._draws.settings_of(drawn), 0) for drawn in self.drawn]
        largest = self.parts[0]
        if self._pads:
            largest = make(self._draws.settings_of({**self.drawn[0], ROBOTS: self.robots}), 0)
        self.settings = largest.engine.settings
        self.space, self.action_space, self.columns = largest.space, largest.action_space, largest.columns
        self._absent = zeros_of(self.space, self.columns)
        self._generators: list[np.random.Generator | None] = [None] * self.episodes
        self._is_ready = np.zeros(self.episodes, np.bool_)
        self._begun = 0

    @property
    def is_ready(self) -> bool:
        """Whether every episode has begun at least once."""
        return bool(self._is_ready.all())

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """Which episodes have no live robot left, (episodes,)."""
        return np.array([part.engine.is_over[0] for part in self.parts])

    @property
    def live(self) -> NDArray[np.bool_]:
        """Which robots have not ended, (rows,)."""
        return self._together([part.engine.live for part in self.parts])

    def begin(
        self,
        chosen: NDArray[np.int64],
        seeds: Sequence[int | None] | None = None,
        options: Mapping[int, ResetOptions] | None = None,
        is_same_step: bool = False,
    ) -> None:
        """Begin episodes with newly drawn settings; see `TeamRows.begin`."""
        del is_same_step
        begun = [
            self._begun_part(episode, None if seeds is None else seeds[k], (options or {}).get(episode), k)
            for k, episode in enumerate(chosen.tolist())
        ]
        # Until here a bad option leaves all episodes as they are.
        for episode, (part, drawn, generator) in zip(chosen.tolist(), begun, strict=True):
            self.parts[episode].engine.simulation.close()
            self.parts[episode], self.drawn[episode], self._generators[episode] = part, drawn, generator
            self._is_ready[episode] = True
        self._begun += len(begun)

    def _begun_part(
        self, episode: int, seed: int | None, options: ResetOptions | None, before: int
    ) -> tuple[TeamRows, dict[str, Any], np.random.Generator]:
        """Make and reset the rows of an episode; return them, the drawn settings and the generator.

        ``before`` is the number of episodes that this reset began earlier.
        """
        generator = copy.deepcopy(self._generators[episode])
        if seed is not None:
            generator = np.random.default_rng((seed, SETTINGS_STREAM))
        elif generator is None:
            generator = np.random.default_rng()
        drawn = self._draws.draw(generator)
        part = self._make(self._draws.settings_of(drawn), self._begun + before)
        _check_spaces(drawn, (part.space, part.action_space), (self.space, self.action_space))
        own = int(generator.integers(2**31)) if seed is None else seed
        part.begin(np.zeros(1, np.int64), [own], None if options is None else {0: options})
        return part, drawn, generator

    def step(self, actions: Any, beginning: NDArray[np.int64]) -> None:  # noqa: ANN401
        """Run all live episodes for one step or decision, and begin others; see `TeamRows.step`."""
        rows = self.robots
        self._step(
            beginning,
            lambda episode, part: part.read(
                _of_rows(actions, slice(episode * rows, episode * rows + part.robots), self.rows)
            ),
            TeamRows.run,
        )

    def step_teams(self, teams: Sequence[Any], beginning: NDArray[np.int64]) -> None:
        """Run all live episodes by the actions of each team, by agent, and begin others."""
        if len(teams) != self.episodes:
            raise ValueError(f"actions are of {len(teams)} teams; want a dict for each of {self.episodes} episodes")
        self._step(beginning, lambda episode, part: part.read_each(part.by_row(teams[episode])), TeamRows.run_each)

    def _step(
        self,
        beginning: NDArray[np.int64],
        read: Callable[[int, TeamRows], Any],
        run: Callable[[TeamRows, Any], None],
    ) -> None:
        """Read the actions of all live episodes before any of them runs: a bad action changes nothing."""
        begins, actions = set(beginning.tolist()), dict[int, Any]()
        for episode in set(range(self.episodes)) - begins:
            try:
                actions[episode] = read(episode, self.parts[episode])
            except ValueError as error:
                raise ValueError(
                    f"in episode {episode}, whose rows begin with {episode * self.robots}: {error}"
                ) from error
        for episode in range(self.episodes):
            if episode in begins:
                self.begin(np.array([episode]))
            else:
                run(self.parts[episode], actions[episode])

    @property
    def rewards(self) -> NDArray[np.float64]:
        """Rewards of the last step, (rows,)."""
        return self._together([part.rewards for part in self.parts])

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Which robots have ended in the last step, (rows,)."""
        return self._together([part.terminated for part in self.parts])

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Which rows were cut in the last step, (rows,); those of robots that a team lacks end with it."""
        truncated = self._together([part.truncated for part in self.parts])
        return truncated | ~self._exists & np.repeat(self.is_over, self.robots)

    @property
    def active(self) -> NDArray[np.bool_]:
        """Which robots had not ended before the last step, (rows,)."""
        return self._together([part.active for part in self.parts])

    @property
    def _exists(self) -> NDArray[np.bool_]:
        return self._together([np.ones(part.rows, np.bool_) for part in self.parts])

    @property
    def observations(self) -> Any:  # noqa: ANN401
        """The observations of all rows."""
        return _joined([self._whole(part.observations, self._absent) for part in self.parts])

    def observation(self, row: int) -> Any:  # noqa: ANN401
        """Return the observation of one row, its own arrays."""
        episode, robot = divmod(row, self.robots)
        part = self.parts[episode]
        if robot >= part.robots:
            return copy.deepcopy(self._absent)
        found = part.observation(robot)
        return padded(found, self.space) if self._pads else found

    @property
    def infos(self) -> dict[str, Any]:
        """Infos of all rows; if an episode lacks one, its mask is False there."""
        infos = [
            {name: self._padded_info(values, part.rows) for name, values in part.infos.items()} for part in self.parts
        ]
        found = _joined_infos(infos, self.robots)
        if MASK in found:
            found[MASK][~self._exists, -1] = 1
            found[f"_{MASK}"] = np.ones(self.rows, np.bool_)
        return found

    def _padded_info(self, values: Any, rows: int) -> Any:  # noqa: ANN401
        if isinstance(values, Mapping):
            return {name: self._padded_info(each, rows) for name, each in values.items()}
        return _longer(values, self.robots) if rows < self.robots else values

    def _whole(self, seen: Any, absent: Any) -> Any:  # noqa: ANN401
        """Return the observations of an episode with rows for the largest team."""
        if not self._pads:
            return seen
        if isinstance(absent, Mapping):
            return {name: self._whole(seen[name], part) for name, part in absent.items()}
        whole = np.repeat(absent[None], self.robots, axis=0)
        whole[tuple(slice(size) for size in seen.shape)] = seen
        return whole

    def _together(self, parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([_longer(part, self.robots) for part in parts])

    @property
    def masks(self) -> NDArray[np.bool_] | None:
        """Which actions each row may choose now, (rows, actions); None if the level has no mask."""
        masks = [part.masks for part in self.parts]
        if masks[0] is None:
            return None
        found = self._together([each for each in masks if each is not None])
        found[~self._exists, -1] = True  # as in observations
        return found

    def states(self, episodes: NDArray[np.int64] | None = None) -> NDArray[np.float32]:
        """Return the true state of each team or of some episodes' teams, (episodes, numbers); see `team_state`."""
        space = state_space(self.settings)
        parts = self.parts if episodes is None else [self.parts[episode] for episode in episodes]
        return np.stack(
            [
                _padded_state(team_state(part.engine.simulation, part.engine.settings), part.robots, space)
                for part in parts
            ]
        )

    def scenes(self) -> list[Any]:
        """Return the scene of each episode, for pictures."""
        return [scene for part in self.parts for scene in part.engine.scenes()]

    def team(self, episode: int) -> EpisodeTeam:
        """Return the handle of an episode's team; it holds until the episode begins again."""
        return self.parts[episode].team(0)

    def close(self) -> None:
        """Release everything that the worlds hold beyond arrays."""
        for part in self.parts:
            part.engine.simulation.close()


def _longer(values: NDArray[Any], rows: int) -> NDArray[Any]:
    """Return values with rows of zeros, or of None, behind them."""
    if len(values) == rows:
        return values
    whole = np.full((rows, *values.shape[1:]), None if values.dtype == object else 0, values.dtype)
    whole[: len(values)] = values
    return whole


def _of_rows(actions: Any, rows: slice, count: int) -> Any:  # noqa: ANN401
    """Return the actions of some rows, those of all being an array or arrays by name."""
    if isinstance(actions, Mapping):
        return {name: _of_rows(part, rows, count) for name, part in actions.items()}
    array = np.asarray(actions)
    if array.ndim == 0 or len(array) != count:
        raise ValueError(
            f"actions have shape {array.shape}; want one for each of the {count} rows, row = episode * robots + robot"
        )
    return array[rows]


def _joined(parts: Sequence[Any]) -> Any:  # noqa: ANN401
    """Return observations of all rows, those of each episode one after the other."""
    if isinstance(parts[0], Mapping):
        return {name: _joined([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(parts)


def _joined_infos(parts: Sequence[Mapping[str, Any]], rows: int) -> dict[str, Any]:
    """Return infos of all rows; if an episode lacks one, its mask is False there."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(name for part in parts for name in part):
        given = [part.get(name) for part in parts]
        example = next(each for each in given if each is not None)
        if isinstance(example, Mapping):
            found[name] = _joined_infos([{} if each is None else each for each in given], rows)
            continue
        absent = np.full((rows, *example.shape[1:]), None if example.dtype == object else 0, example.dtype)
        found[name] = np.concatenate([absent if each is None else each for each in given])
    return found


def _check_spaces(
    drawn: Mapping[str, Any],
    made: tuple[spaces.Space[Any], spaces.Space[Any]],
    wanted: tuple[spaces.Space[Any], spaces.Space[Any]],
) -> None:
    """Check that drawn settings leave the spaces of observations and actions unchanged.

    Raises
    ------
    ValueError
        If they do not.
    """
    if not _fits_into(made[0], wanted[0]) or made[1] != wanted[1]:
        raise ValueError(
            f"settings drawn are {drawn}; want some that leave the spaces of observations and actions as "
            "they are: learners have one for all episodes"
        )


def _fits_into(space: spaces.Space[Any], largest: spaces.Space[Any], key: str = "") -> bool:
    """Whether observations fit those of the largest team but for rows of teammates."""
    if isinstance(space, spaces.Dict) and isinstance(largest, spaces.Dict):
        return space.keys() == largest.keys() and all(
            _fits_into(part, largest[name], name) for name, part in space.items()
        )
    if key in OF_TEAMMATES and space.shape is not None and largest.shape is not None:
        return space.shape[0] <= largest.shape[0] and space.shape[1:] == largest.shape[1:]
    return space == largest


def padded(observation: Any, space: spaces.Space[Any]) -> Any:  # noqa: ANN401
    """Return an observation with zeros for the teammates that a team lacks."""
    if isinstance(space, spaces.Dict):
        return {name: padded(observation[name], part) for name, part in space.items()}
    if observation.shape == space.shape:
        return observation
    whole = np.zeros(space.shape or (), space.dtype)
    whole[: len(observation)] = observation
    return whole


def _padded_state(state: NDArray[np.float32], robots: int, space: spaces.Box) -> NDArray[np.float32]:
    """Return the state of a team of ``robots`` with zeros for those that it lacks."""
    own = robots * len(ROBOT_NUMBERS)
    lacking = np.zeros(len(space.low) - len(state), np.float32)
    return np.concatenate([state[:own], lacking, state[own:]])


def zeros_of(space: spaces.Space[Any], columns: tuple[tuple[str, int, int], ...] = ()) -> Any:  # noqa: ANN401
    """Return the observation of an absent robot: zeros, with a mask that allows it to stay alone.

    ``columns`` are those of the flat form, in which a mask may be.
    """
    if isinstance(space, spaces.Dict):
        found = {name: zeros_of(part) for name, part in space.spaces.items()}
        if MASK in found:
            found[MASK][-1] = 1
        return found
    zeros = np.zeros(space.shape or (), space.dtype)
    for name, _, last in columns:
        if name == MASK:
            zeros[last - 1] = 1
    return zeros
