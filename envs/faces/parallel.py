"""The environment of a team of lidar robots (PettingZoo parallel API)."""

import copy
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from lidarium.envs.engine.beginnings import EpisodeStart
from lidarium.envs.engine.engine import Engine
from lidarium.envs.engine.tally import TRACK_PERIOD_S, Tally
from lidarium.envs.engine.team_state import state_space, team_state
from lidarium.envs.faces.conventions import PLAIN, Conventions
from lidarium.envs.faces.team_rows import ACTIVE, TeamRows
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.driving.team_driver import TeamDriver
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order
from lidarium.envs.onboard.station.reports import Report
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum, checked_seed, read_options
from lidarium.mapping.merging.fusion import FusedMap

if TYPE_CHECKING:
    from lidarium.envs.drawing.rendering import Scene

Observation = dict[str, NDArray[Any]]

Outcome = tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]
"""Observations, rewards, terminations, truncations, infos, each by agent."""

_NAMES = {"velocity": "lidarium_exploration_v1"}
_FIRST = np.zeros(1, np.int64)


class ExplorationEnv(ParallelEnv[str, Any, Any]):
    """A team of lidar robots explores a floor: an engine of one episode, by agent.

    Observations, actions, infos and endings are described in docs/reference/environments.md. The environment is also
    the handle of the team that policies ask (`Team`).

    Parameters
    ----------
    floor : Floors, optional
        A catalogue name, ``building:SEED``, ``set:NAME``, a file that the importers know, or a floor; or many, as
        `FloorChoice` takes them. Of many, each reset draws one. The drawn ``apartment`` by default.
    settings : ExplorationSettings, optional
        All other options. The defaults of `ExplorationSettings` by default.
    render_mode : str, optional
        ``human`` (a window) or ``rgb_array``. Nothing is drawn by default.
    image_resolution : float, optional
        Side of a pixel [m] if the floor is a plain image.
    curriculum : callable, optional
        Takes the number of an episode, from 0 on, and returns options of ``reset`` for it; those that a reset gets
        itself go before.
    level : str, optional
        Type of an action: a name in the registry ``level``. ``velocity`` by default.
    conventions : Conventions, optional
        The forms of the results of ``reset`` and ``step``. Those of `Conventions` by default.

    Attributes
    ----------
    engine : Engine
        Steps the episode.
    simulation, world, beliefs, score : Simulation, World, Beliefs, Score
        Its simulation and the parts of that.
    perception : Perception
        The onboard software of the robots.
    operating : Operating
        The robots' operating states and orders.
    station : Station
        Receives the robots' reports and sends their orders.
    scorer : Tally
        The true coverage over time.
    floor, goal, seed
        Floor, goal and seed of the episode; ``seed`` is that of the noise.

    Raises
    ------
    ValueError, FileNotFoundError
        If the floor or an option cannot be used.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": _NAMES["velocity"],
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        floor: Floors = "apartment",
        settings: ExplorationSettings | None = None,
        render_mode: str | None = None,
        image_resolution: float | None = None,
        curriculum: Curriculum | None = None,
        level: str = "velocity",
        conventions: Conventions = PLAIN,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is {render_mode!r}; want human, rgb_array or None")
        self.settings = settings or ExplorationSettings()
        self.render_mode = render_mode
        self.possible_agents = self.settings.agents
        self.agents: list[str] = []
        self.engine = Engine(1, floor, self.settings, level, image_resolution, curriculum=curriculum, reports=True)
        self.simulation = self.engine.simulation
        self.world = self.simulation.world
        self.beliefs = self.simulation.beliefs
        self.score = self.simulation.score
        self.perception = self.engine.perception
        self.operating = self.engine.operating
        self.station = self.engine.stations[0]
        self.scorer = Tally(self.simulation, self.settings)
        self.has_goal = self.engine.has_goal
        self.floor: Floor | None = None
        self.goal: tuple[float, float] | None = None
        self.seed: int | None = None
        self.conventions = conventions
        self._index = {agent: row for row, agent in enumerate(self.possible_agents)}
        self._window: Any = None
        # A world with a window of its own draws itself.
        self._shows_itself = render_mode == "human" and self.world.show()
        self._is_closed = False
        self._rows = TeamRows(self.engine, conventions)
        self._named: dict[str, tuple[Any, list[Any]]] = {"state": (None, []), "order": (None, [])}
        self._note_level()

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; the episode is over, and the next begins with ``reset``.

        Parameters
        ----------
        name : str
            A name in the registry ``level``.
        shares_map : bool, optional
            Whether robots plan on the team's map, if it reaches them. True by default.
        decision_period_s : float, optional
            Longest time of a decision at the level of waypoints [s]. That of the settings by default.
        """
        self._rows.use_level(name, shares_map, decision_period_s)
        self.floor, self.agents = None, []
        self._note_level()

    def _note_level(self) -> None:
        name, level = self.engine.level_name, self.engine.level
        self.metadata = {
            **type(self).metadata,
            "name": _NAMES.get(name, f"lidarium_{name}_exploration_v1"),
            "render_fps": 1.0 / level.period_s,
        }
        agents = self.possible_agents
        self.observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: copy.deepcopy(self._rows.space) for agent in agents
        }
        self.action_spaces: dict[str, spaces.Space[Any]] = {
            agent: copy.deepcopy(self._rows.action_space) for agent in agents
        }

    @property
    def driver(self) -> TeamDriver | None:
        """Drives the robots to their targets; None if actions are speeds."""
        return self.engine.level.driver

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions, the same object at each call."""
        return self.action_spaces[agent]

    def columns(self, agent: str) -> tuple[tuple[str, int, int], ...]:
        """Return the columns of each key of an agent's observation in the flat form; see `flat_columns`."""
        self._row(agent)
        return self._rows.columns

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode.

        Parameters
        ----------
        seed : int, optional
            Seed of all draws of this and the later episodes. By default the generator of the last seed goes
            on.
        options : dict, optional
            ``floor``, ``starts`` (robots, 3) in the floor's frame [m, rad], or ``fixed`` or ``drawn``, ``goal`` (2,)
            [m]. Unknown options are ignored; likely typos raise an error.
        """
        self._check_open()
        chosen = read_options(options, self.settings.robots)
        self.engine.run(None, _FIRST, [checked_seed(seed)], {0: chosen})
        return self._begun()

    def start(self, beginning: EpisodeStart) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode with the same beginning as another one; returns the results of ``reset``."""
        self.engine.begin({0: beginning})
        return self._begun()

    def _begun(self) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        beginning = self.engine.starts[0]
        assert beginning is not None
        self.seed, self.floor, self.goal = beginning.seed, beginning.floor, beginning.goal
        self.agents = self.possible_agents[:]
        self.scorer.start()
        self._rows.came_out(~self.engine.live, is_step=False)
        observations, infos = self._observations(self.agents), self._infos(self.agents)
        if self.render_mode == "human":
            self.render()
        self.on_begin()
        return observations, infos

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Drive for one time step or decision.

        Parameters
        ----------
        actions : dict
            An action for each live agent, of its level: ``Stop`` ends the agent, an ``Order`` is sent to it, and at
            any level a ``Target`` or ``Route`` lets the onboard driver take the robot there. An agent that was given
            an order may be left out: it goes on with its last order.

        Returns
        -------
        observations, rewards, terminations, truncations, infos : dict
            By agent. ``infos[agent]["truth"]`` is for scoring only; ``infos[agent]["ended_because"]`` says why an
            agent ended.
        """
        self._check_open()
        if not self.agents:
            if self.floor is None:
                raise RuntimeError("the environment was not reset; call reset() before step()")
            return {}, {}, {}, {}, {}
        self._rows.step_each(self._rows.by_row(actions), after_step=self._after_step)
        return self._outcome()

    def _after_step(self, commands: NDArray[np.float64]) -> None:
        self.scorer.advance()
        self.on_step(commands)

    def drive_at(self, commands: NDArray[np.float64]) -> None:
        """Run one time step at speeds and turn rates (robots, 2) [m/s, rad/s]; no observations are built.

        Those of robots that are paused, or back out after a pause, are overwritten.
        """
        self.engine.step_at(commands, self._after_step)

    def outcome(self) -> Outcome:
        """Return the results of ``step`` for the time since the last outcome, after steps by ``drive_at``."""
        masked = ~self.engine.live
        self.engine.finish()
        self._rows.came_out(masked)
        return self._outcome()

    def _outcome(self) -> Outcome:
        engine, rows, live = self.engine, self._rows, self.agents
        observations, infos = self._observations(live), self._infos(live)
        rewards = self._by_agent(live, rows.rewards.tolist())
        if engine.has_endings or not engine.is_whole:
            terminations = self._by_agent(live, rows.terminated.tolist())
            truncations = self._by_agent(live, rows.truncated.tolist())
            if engine.has_endings:
                for row, reason in engine.ended_because.items():
                    self.scorer.ended_because[self.possible_agents[row]] = reason
            stays = self.conventions.ended_agents == "zeros" and bool(engine.live.any())
            self.agents = [agent for agent in live if stays or engine.live[self._index[agent]]]
        else:
            terminations, truncations = dict.fromkeys(live, False), dict.fromkeys(live, False)
        if self.render_mode == "human":
            self.render()
        self.on_outcome()
        return observations, rewards, terminations, truncations, infos

    def _observations(self, agents: Collection[str]) -> dict[str, Any]:
        return self._by_agent(agents, _split(self._rows.observations))

    def _by_agent(self, agents: Collection[str], rows: Sequence[Any]) -> dict[str, Any]:
        """Return the values of agents, from those of all rows."""
        if len(agents) == len(rows):
            return dict(zip(agents, rows))  # noqa: B905 (hot)
        return {agent: rows[self._index[agent]] for agent in agents}

    def _infos(self, agents: Collection[str]) -> dict[str, dict[str, Any]]:
        """Return the infos of agents, from those of all rows."""
        whole, form = self._rows.infos, self.conventions.infos
        if self.conventions.ended_agents == "zeros" and form != "none":
            active = self._rows.active
            whole = {**whole, ACTIVE: active.astype(np.float64) if form == "flat" else active}
        everyone, columns, masks = self.engine.everyone, {}, []
        for name, values in whole.items():
            if name[0] != "_":
                columns[name] = self._listed_info(name, values)
            elif values is not everyone:
                masks.append((name[1:], values))
        if not columns:
            return {agent: {} for agent in agents}
        infos = [dict(zip(columns, row)) for row in zip(*columns.values())]  # noqa: B905 (hot)
        for name, mask in masks:
            for row in np.flatnonzero(~mask):
                del infos[row][name]
        return self._by_agent(agents, infos)

    def _listed_info(self, name: str, values: Any) -> list[Any]:  # noqa: ANN401
        """Return an info of all rows as a list over rows."""
        if name in self._named:  # states and orders are the same object until one changes
            kept, listed = self._named[name]
            if kept is not values:
                listed = values.tolist()
                self._named[name] = values, listed
            return listed
        return _listed(values) if name != "camera" or self.conventions.infos != "full" else self._calibrations()

    def _calibrations(self) -> list[dict[str, Any]]:
        camera = self.simulation.camera
        assert camera is not None
        return [camera.camera.calibration for _ in self._index]

    def on_begin(self) -> None:
        """Do nothing, after an episode has begun; for subclasses that watch."""

    def on_step(self, commands: NDArray[np.float64]) -> None:
        """Do nothing, after a time step driven at ``commands`` (robots, 2) [m/s, rad/s]."""

    def on_outcome(self) -> None:
        """Do nothing, after rewards and endings, when ended agents have left."""

    def stop(self, agent: str, reason: str) -> None:
        """End an agent at its next step, with a reason of its policy, such as ``no_frontier``."""
        live = [each for each in self.agents if self.engine.live[self._index[each]]]
        if agent not in live:
            raise ValueError(f"{agent} is not among the live agents {live}")
        self.operating.stopping[self._index[agent]] = reason

    @property
    def stopping(self) -> dict[str, str]:
        """Agents that end at the next outcome, with the reasons that their policies gave."""
        return {self.possible_agents[row]: reason for row, reason in self.operating.stopping.items()}

    def order(self, agent: str, order: Order) -> None:
        """Send an agent an order from the station; see docs/reference/station.md for the types.

        It takes effect at once or, over a radio that is not ideal, when it arrives. An order that does not reach the
        robot, or that the robot does not take, is noted in ``operating.events``.

        Raises
        ------
        ValueError
            If the agent does not exist; an agent that has ended takes no order, which is not an error.
        """
        self.operating.order(self._row(agent), order)

    @property
    def level(self) -> str:
        """The action level."""
        return self.engine.level_name

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self.scorer.time

    @property
    def energy_j(self) -> NDArray[np.float64]:
        """The energy that the robots have used [J], (robots,); 0 if their batteries have no limit."""
        return self.engine.used_j

    def belief(self, agent: str) -> Belief:
        """Return the handle on the belief of an agent's onboard software.

        Raises
        ------
        ValueError
            If there is no such agent.
        """
        return Belief(self.perception, self._row(agent))

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of an agent's drive to its target."""
        return DriveState.IDLE if self.driver is None else self.driver.state(self._row(agent))

    def operating_state(self, agent: str) -> OperatingState:
        """Return whether an agent takes part in the work, as it knows itself."""
        return self.operating.states[self._row(agent)]

    def last_order(self, agent: str) -> Order | None:
        """Return the last order that an agent took, None if it took no order."""
        return self.operating.orders[self._row(agent)]

    def report(self, agent: str) -> Report | None:
        """Return the last report of an agent that reached the station, None if no report has."""
        return self.station.report(self._row(agent))

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        """Send an agent the map of others in its map frame; return whether that reached it."""
        return self.station.send_map(self._row(agent), others)

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        """Let an agent forget the walls along the trail of another; return whether that reached it."""
        return self.station.forget_walls(self._row(agent), trail)

    def action_masks(self, agent: str) -> NDArray[np.bool_]:
        """Return which actions an agent may choose now, (actions,); one that has ended may only stay.

        Raises
        ------
        AttributeError
            If the level has no mask.
        """
        masks = self._rows.masks
        if masks is None:
            raise AttributeError("action_masks are there at the level of frontiers only; use level='frontier'")
        return np.asarray(masks[self._row(agent)])

    def _row(self, agent: str) -> int:
        if agent not in self._index:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")
        return self._index[agent]

    @property
    def state_space(self) -> spaces.Box:
        """The space of ``state``."""
        return state_space(self.settings)

    def state(self) -> NDArray[np.float32]:
        """Return the true state of the team and its coverage; see `team_state`."""
        if self.floor is None:
            raise RuntimeError("the environment was not reset; call reset() before state()")
        return team_state(self.simulation, self.settings)

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the floor, the explored area, the robots and their scans: an image (rows, columns, 3) or the window."""
        from lidarium.envs.drawing.frame_window import FrameWindow
        from lidarium.envs.drawing.rendering import draw_frame

        if self.render_mode is None:
            return None
        if self.floor is None:
            raise RuntimeError("the environment was not reset; call reset() before render()")
        if self._shows_itself:
            return None
        frame = draw_frame(self.scene())
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = FrameWindow(f"lidarium: {self.floor.name}")
        self._window.show(frame)
        return None

    def scene(self) -> "Scene":
        """Return the content of a frame of the environment."""
        from lidarium.envs.drawing.frame_parts import RECENT_S
        from lidarium.envs.drawing.rendering import Scene

        has_ended = (~self.engine.live).tolist()
        name = "" if self.floor is None else self.floor.name
        track = [poses for _, poses in self.scorer.track[-round(RECENT_S / TRACK_PERIOD_S) :]]
        return Scene(self.simulation, self.settings, name, has_ended, track, prediction=self.engine.prediction())

    def close(self) -> None:
        """Close the window and the world, if they hold anything; closing again does nothing."""
        self._is_closed = True
        self.simulation.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError("the environment is closed; make a new one")

    def __getstate__(self) -> dict[str, Any]:
        # A copy has no window.
        return {**self.__dict__, "_window": None}


def _split(observations: Any) -> Any:  # noqa: ANN401
    """Return the observation of each row."""
    if type(observations) is not dict:
        return observations
    columns: Collection[Any] = observations.values()
    if dict in map(type, columns):
        columns = [_split(each) for each in columns]
    return [dict(zip(observations, row)) for row in zip(*columns)]  # noqa: B905 (hot)


def _listed(values: Any) -> list[Any]:  # noqa: ANN401
    """Return an info of all rows as a list over rows; values by name become a dict for each row."""
    if type(values) is dict:
        columns = [_listed(each) for each in values.values()]
        return [dict(zip(values, row)) for row in zip(*columns)]  # noqa: B905 (hot)
    listed: list[Any] = values.tolist() if values.ndim == 1 else list(values)
    return listed
