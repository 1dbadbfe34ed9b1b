"""The rows of an engine in the forms of conventions; every face reads its results here."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.engine.engine import NO_EPISODES, AfterStep, Engine
from lidarium.envs.engine.team_state import team_state
from lidarium.envs.faces.conventions import (
    MASK,
    PLAIN,
    TEAM,
    Conventions,
    ObservationForm,
    flat_row_infos,
    shared_rewards,
)
from lidarium.envs.faces.messages import MESSAGES, MessageBoard, split_action, talking_space
from lidarium.envs.faces.sparse_routes import SparseRouter, routed
from lidarium.envs.faces.team import EpisodeTeam
from lidarium.envs.faces.team_exchange import CanTalk, MergedRows, MergingSettings
from lidarium.envs.onboard.radio.messages import Order, Route, Stop, Target
from lidarium.envs.onboard.station.operating import frozen
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import ResetOptions
from lidarium.registry import unknown

ACTIVE = "active"
"""Info: whether a robot had not ended before this step."""

_TOLD = {Stop, Order}

EachAction = tuple[Any, Mapping[int, Any], Collection[int]]
"""Actions that a level has read; orders and stops by row; rows that have an action."""


class TeamRows:
    """Begins and steps the episodes of an engine; results are arrays over rows in the forms of conventions.

    A robot that ends before its team is terminated once; its row then repeats its last observation with reward 0,
    and the info ``active`` is False. When the last robot of an episode ends, the rows that repeat are truncated. With
    ``ended_agents="zeros"`` rows of ended robots have observations of zeros instead, with a mask that allows them to
    stay alone, and all end with the last one.

    Parameters
    ----------
    engine : Engine
        The episodes.
    conventions : Conventions, optional
        The forms. Those of a plain environment by default.
    merging : MergingSettings, optional
        Settings of map merging. No merging by default.
    can_talk : (robots, robots) bool or callable, optional
        Which robots reach each other for merging, see `MergedMaps`. By default those that the radio connects.
    plans_sparsely : bool, optional
        Whether robots drive along routes on their sparse maps; see `SparsePlanning`. False by default.
    shares_map : bool, optional
        Whether these routes are planned on the map of the whole team. True by default.

    Attributes
    ----------
    space, action_space : Space
        Spaces of the observations and actions of a row.
    columns : tuple
        Columns of each key in the flat form; see ``flat_columns``.
    rewards : (rows,) float64
        Rewards of the last step.
    terminated, truncated, active : (rows,) bool
        Ends in the last step, and which robots had not ended before it.

    Raises
    ------
    ValueError
        If observations cannot take the form.
    """

    def __init__(
        self,
        engine: Engine,
        conventions: Conventions = PLAIN,
        merging: MergingSettings | None = None,
        can_talk: NDArray[np.bool_] | CanTalk | None = None,
        plans_sparsely: bool = False,
        shares_map: bool = True,
    ) -> None:
        self.engine = engine
        self.conventions = conventions
        self.rows, self.episodes, self.robots = engine.rows, engine.episodes, engine.robots
        self._names = engine.settings.agents
        self._robot_of = {agent: robot for robot, agent in enumerate(self._names)}
        self._keeps = conventions.ended_agents == "zeros"
        self._merged = None if merging is None else MergedRows(engine, merging, can_talk)
        self._router = SparseRouter(engine, shares_map) if plans_sparsely else None
        self._board: MessageBoard | None = None
        self._seen = np.ones(self.rows, np.bool_)
        self._kept = np.zeros(self.rows, np.bool_)
        self._endings = np.full(self.rows, None, object)
        self._numbers: dict[str, NDArray[np.float64]] = {}
        self.rewards = np.zeros(self.rows)
        self._nobody = frozen(np.zeros(self.rows, np.bool_))
        self.terminated, self.truncated = np.zeros(self.rows, np.bool_), np.zeros(self.rows, np.bool_)
        self.active = np.zeros(self.rows, np.bool_)
        if conventions.comm:
            self._board = MessageBoard(engine.perception, engine.settings, conventions.comm)
        self._use(self._form_of(engine.observation_space))

    def use_level(self, name: str, shares_map: bool, decision_period_s: float | None) -> None:
        """Let actions be those of another action level; if observations cannot take the form there, nothing changes.

        Parameters are those of `Engine.use_level`.
        """
        level = self.engine.made_level(name, shares_map, decision_period_s)
        if self._router is not None:
            routed(name, level)
        form = self._form_of(self.engine.space_at(level))
        self.engine.take_level(name, level)
        if self._router is not None:
            self._router = SparseRouter(self.engine, self._router.shares_map)
        self._use(form)

    def _form_of(self, space: spaces.Dict) -> ObservationForm:
        """Return the form of the observations of a level, with received messages and merged maps."""
        boxes = {} if self._merged is None else self._merged.boxes
        if self._board is not None:
            boxes = {**boxes, MESSAGES: self._board.box}
        return ObservationForm(spaces.Dict({**space.spaces, **boxes}), self.conventions)

    def _use(self, form: ObservationForm) -> None:
        """Take the spaces of the engine's level, in their form."""
        floats = self.conventions.comm
        self.action_space = self.engine.action_space
        if self._board is not None:
            self.action_space = talking_space(self.action_space, floats)
            self._sent = np.zeros((self.rows, floats))
            self._messages = self._board.table()
        self._form = form
        self.space = self._form.space
        self._is_plain = self._form.is_plain and not (self._keeps or floats or self._merged is not None)
        self.columns = self._form.columns

    def begin(
        self,
        chosen: NDArray[np.int64],
        seeds: Sequence[int | None] | None = None,
        options: Mapping[int, ResetOptions] | None = None,
        is_same_step: bool = False,
    ) -> None:
        """Begin episodes; see `Engine.run`."""
        self.engine.run(None, chosen, seeds, options, is_same_step)
        # Robots of other episodes that ended in the step before still show their last observations.
        masked = self._kept.copy()
        masked.reshape(self.episodes, self.robots)[chosen] = False
        self.came_out(masked, is_step=False)

    def step(self, actions: Any, beginning: NDArray[np.int64] = NO_EPISODES) -> None:  # noqa: ANN401
        """Run all live episodes for one step or decision by an array of actions, and begin others."""
        self.run(self.read(actions, beginning), beginning)

    def read(self, actions: Any, beginning: NDArray[np.int64] = NO_EPISODES) -> Any:  # noqa: ANN401
        """Return what an array of actions means, for `run`; messages are kept to be sent."""
        acting = self.engine.live
        if len(beginning):
            acting = acting.copy()
            acting.reshape(self.episodes, self.robots)[beginning] = False
        if self._board is not None:
            actions = self._without_messages(actions, acting)
        return self.engine.level.read_rows(actions, acting)

    def run(self, decoded: Any, beginning: NDArray[np.int64] = NO_EPISODES) -> None:  # noqa: ANN401
        """Run all live episodes by actions that were read, and begin others."""
        engine = self.engine
        masked = self._nobody if engine.is_whole else ~engine.live
        if len(beginning):
            masked = masked & ~np.repeat(engine.is_over, self.robots)
        engine.run(decoded, beginning)
        self.came_out(masked)

    def step_each(
        self,
        actions: Mapping[int, Any],
        beginning: NDArray[np.int64] = NO_EPISODES,
        after_step: AfterStep | None = None,
    ) -> None:
        """Run all live episodes by actions of rows, and begin others; see `by_row`."""
        self.run_each(self.read_each(actions), beginning, after_step)

    def read_each(self, actions: Mapping[int, Any]) -> EachAction:
        """Return the meaning of actions by row, for `run_each`; messages are kept to be sent."""
        engine, names = self.engine, self._names
        told: Mapping[int, Any] = {}
        if not _TOLD.isdisjoint(map(type, actions.values())):
            told = {row: action for row, action in actions.items() if type(action) in _TOLD}
            actions = {row: action for row, action in actions.items() if row not in told}
        if self._board is not None:
            self._sent[:] = 0.0
            rest = {}
            for row, action in actions.items():
                rest[row], self._sent[row] = split_action(
                    action, self.conventions.comm, engine.action_space, names[row % self.robots]
                )
            actions = rest
        return engine.level.read(actions, names), told, actions.keys()

    def run_each(
        self, read: EachAction, beginning: NDArray[np.int64] = NO_EPISODES, after_step: AfterStep | None = None
    ) -> None:
        """Run all live episodes by actions of rows that were read, and begin others."""
        engine = self.engine
        decoded, told, acting = read
        for row, action in told.items():
            if isinstance(action, Stop):
                engine.operating.stopping[row] = action.reason
            else:
                engine.operating.order(row, action)
        given = None
        if len(acting) < self.rows:
            given = np.zeros(self.rows, np.bool_)
            given[[*acting, *engine.operating.stopping]] = True
        masked = self._nobody if engine.is_whole else ~engine.live
        if len(beginning):
            masked = masked & ~np.repeat(engine.is_over, self.robots)
        engine.run(decoded, beginning, given=given, after_step=after_step)
        self.came_out(masked, given)

    def step_teams(self, teams: Sequence[Any], beginning: NDArray[np.int64] = NO_EPISODES) -> None:
        """Run all live episodes by the actions of each team, by agent, and begin others."""
        if len(teams) != self.episodes:
            raise ValueError(f"actions are of {len(teams)} teams; want a dict for each of {self.episodes} episodes")
        waiting = set(beginning.tolist())
        actions: dict[int, Any] = {}
        for episode, each in enumerate(teams):
            if episode not in waiting:
                actions |= self.by_row(each, episode)
        self.step_each(actions, beginning)

    def by_row(self, actions: Any, episode: int = 0) -> dict[int, Any]:  # noqa: ANN401
        """Return the actions of the live agents of an episode by row.

        An agent that was given an order may be left out: it goes on with that.

        Raises
        ------
        ValueError
            If these are not actions by agent, an agent is unknown, or one has no action.
        """
        if type(actions) is not dict or not actions.keys() <= self._robot_of.keys():
            _check_agents(actions, self._robot_of)
        engine, first = self.engine, episode * self.robots
        live, operating, takes_none = engine.live, engine.operating, engine.level.may_rest(episode)
        given = {}
        for agent, robot in self._robot_of.items():
            row = first + robot
            if not live[row]:
                continue
            action = actions.get(agent, self)
            if action is None and not takes_none:
                takes_none = any(isinstance(each, Target | Route) for each in actions.values())
            if action is self or (action is None and not takes_none):
                if row not in operating.stopping and not operating.is_addressed(row):
                    raise ValueError(f"no action for {agent}; step() needs one for every agent in env.agents")
                continue
            given[row] = action
        return given

    def came_out(self, masked: NDArray[np.bool_], spoke: NDArray[np.bool_] | None = None, is_step: bool = True) -> None:
        """Take in the results of a run; ``masked`` are the rows of robots that had ended before it."""
        engine = self.engine
        self._kept = masked
        self.active = engine.everyone if masked is self._nobody else ~masked
        if self._router is not None:
            self._router.start(np.flatnonzero(np.repeat(engine.world.steps <= 0, self.robots)))
        if self._board is not None or self._merged is not None:
            self.exchange(spoke)
        self.terminated, self.truncated = np.zeros(self.rows, np.bool_), np.zeros(self.rows, np.bool_)
        if engine.has_endings or (is_step and not engine.is_whole):
            self.terminated, self.truncated = engine.terminated, engine.truncated
            is_over = np.repeat(engine.is_over, self.robots)
            if self._keeps:
                self.terminated = (self.terminated | masked) & is_over
            else:
                self.truncated = self.truncated | masked & is_over
        self.rewards = engine.score.rewards.copy()
        self._infos = engine.infos
        share = self.conventions.team_reward
        if share:
            teams = (-1, self.robots)
            mixed = self.rewards
            if is_step:
                mixed = shared_rewards(engine.rewards.reshape(teams), engine.acted.reshape(teams), share).ravel()
            terms = {**engine.infos["reward_terms"], TEAM: mixed - engine.rewards}
            self.rewards = mixed
            self._infos = {**engine.infos, "reward_terms": terms}

    def _without_messages(self, actions: Any, acting: NDArray[np.bool_]) -> Any:  # noqa: ANN401
        """Return actions without their messages, which are kept to be sent; only those of ``acting`` rows are read."""
        rest, message = split_action(actions, self.conventions.comm, self.engine.action_space, "all rows", acting)
        if message.shape != self._sent.shape:
            raise ValueError(
                f"messages have shape {message.shape}; want {self._sent.shape}: one for each row = episode * "
                "robots + robot"
            )
        self._sent = np.where(acting[:, None], message, 0.0)
        return rest

    def exchange(self, spoke: NDArray[np.bool_] | None = None) -> None:
        """Let messages and maps be exchanged, after a run."""
        engine = self.engine
        began = np.asarray(engine.world.steps <= 0)
        self._seen = engine.acted | np.repeat(began, self.robots)
        if self._board is not None:
            self._board.exchange(self._sent, engine.acted if spoke is None else engine.acted & spoke)
            self._board.start(np.flatnonzero(began))
            self._messages = np.where(self._seen[:, None, None], self._board.table(), self._messages)
        if self._merged is not None:
            self._merged.exchange(self._seen, began)

    @property
    def observations(self) -> Any:  # noqa: ANN401
        """The observations of all rows: new arrays, or views of the engine's if it copies nothing."""
        arrays = self._with_more()
        blanks = self._keeps and bool(self._kept.any())
        if self.engine.copies or blanks:
            arrays = {name: array.copy() for name, array in arrays.items()}
        if blanks:
            _blank(arrays, self._kept)
        return dict(arrays) if self._is_plain else self._form.of(arrays, (self.rows,))

    def observation(self, row: int) -> Any:  # noqa: ANN401
        """Return the observation of one row, its own arrays."""
        arrays = {name: array[row].copy() for name, array in self._with_more().items()}
        if self._keeps and self._kept[row]:
            _blank(arrays, ...)
        return self._form.of(arrays)

    def _with_more(self) -> Mapping[str, NDArray[Any]]:
        """Return the observations including exchanged data."""
        if self._board is None and self._merged is None:
            return self.engine.observations
        more: dict[str, NDArray[Any]] = {} if self._merged is None else dict(self._merged.arrays)
        if self._board is not None:
            more[MESSAGES] = self._messages
        return {**self.engine.observations, **more}

    @property
    def infos(self) -> dict[str, Any]:
        """Infos of all rows, arrays with their masks, as Gymnasium's vector environments have them."""
        infos, everyone = self._infos, self.engine.everyone
        if self._merged is not None:
            infos = self._merged.infos(infos, self._seen)
        if self._router is not None:
            infos = {**infos, "route": np.array(self._router.reasons, object), "_route": everyone}
        form = self.conventions.infos
        if form == "flat":
            infos = flat_row_infos(infos, self.rows)
        elif form == "none":
            infos = {}
        if self._keeps:
            infos = self._with_ended(infos, form)
        if self._form.has_mask_apart:
            masks = self.engine.observations[MASK].copy()
            if self._keeps:
                _blank({MASK: masks}, self._kept)
            infos = {**infos, MASK: masks, f"_{MASK}": everyone}
        return infos

    def _with_ended(self, infos: dict[str, Any], form: str) -> dict[str, Any]:
        """Return infos in which robots that had ended keep their reason and their last numbers."""
        kept = self._kept
        for row, word in self.engine.ended_because.items():
            if self.engine.reasons[row]:
                self._endings[row] = word
        if form == "full":
            nobody = np.full(self.rows, None, object)
            of_live = {name: infos[name] & ~kept if name.startswith("_") else infos[name] for name in infos}
            of_live["ended_because"] = np.where(kept, self._endings, infos.get("ended_because", nobody))
            of_live["_ended_because"] = kept | infos.get("_ended_because", np.False_)
            return of_live
        if form == "flat":
            is_new = self.engine.acted | np.repeat(self.engine.world.steps <= 0, self.robots)
            for name, values in infos.items():
                if name.startswith("_"):
                    continue
                last = np.where(is_new, values, self._numbers.get(name, values))
                self._numbers[name] = last
                values[kept] = 0.0 if name.startswith("reward_terms.") else last[kept]
        return infos

    @property
    def settings(self) -> ExplorationSettings:
        """The settings of every episode."""
        return self.engine.settings

    @property
    def is_ready(self) -> bool:
        """Whether every episode has begun at least once."""
        return self.engine.is_ready

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """Which episodes have no live robot left, (episodes,)."""
        return self.engine.is_over

    @property
    def live(self) -> NDArray[np.bool_]:
        """Which robots have not ended, (rows,)."""
        return self.engine.live

    @property
    def masks(self) -> NDArray[np.bool_] | None:
        """Which actions each row may choose now, (rows, actions); None if the level has no mask.

        Robots that have ended may only stay.
        """
        masks = self.engine.observations.get(MASK)
        if masks is None:
            return None
        allowed = np.asarray(masks != 0)
        _blank({MASK: allowed}, ~self.engine.live)
        return allowed

    def states(self, episodes: NDArray[np.int64] | None = None) -> NDArray[np.float32]:
        """Return the true state of each team or of some episodes' teams, (episodes, numbers); see `team_state`."""
        engine, chosen = self.engine, range(self.episodes) if episodes is None else episodes.tolist()
        return np.stack([team_state(engine.simulation, engine.settings, episode) for episode in chosen])

    def scenes(self) -> list[Any]:
        """Return the scene of each episode, for pictures."""
        return self.engine.scenes()

    def team(self, episode: int) -> EpisodeTeam:
        """Return the handle of an episode's team."""
        return EpisodeTeam(self.engine, episode, self.observation, self.conventions)

    def close(self) -> None:
        """Release everything that the world holds beyond arrays."""
        self.engine.simulation.close()


def _blank(arrays: Mapping[str, NDArray[Any]], rows: Any) -> None:  # noqa: ANN401
    """Fill rows of observations with zeros; a mask allows to stay, since learners cannot draw from no action."""
    for name, array in arrays.items():
        array[rows] = 0
        if name == MASK:
            array[rows, -1] = 1


def _check_agents(actions: Any, agents: Collection[str]) -> None:  # noqa: ANN401
    """Check that actions are given by agent, and that there are such agents.

    Actions of agents that have ended are not an error: trainers continue to send them.

    Raises
    ------
    ValueError
        If these are no actions by agent, or an agent is unknown.
    """
    if not isinstance(actions, Mapping):
        raise ValueError(
            f"actions are a {type(actions).__name__}; want a dict with an action for each agent in "
            "env.agents, such as {agent: env.action_space(agent).sample() for agent in env.agents}"
        )
    for agent in actions:
        if agent not in agents:
            raise ValueError(f"actions have an {unknown('agent', agent, agents)}")
