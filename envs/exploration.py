"""The environment of a team of lidar robots (PettingZoo parallel API).

The team explores a floor.
"""

import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from lidarium.envs.agent_commands import AgentCommands
from lidarium.envs.agent_endings import AgentEndings
from lidarium.envs.agent_infos import AgentInfos
from lidarium.envs.agent_observations import AgentObservations, Observation
from lidarium.envs.episode_start import EpisodeStart, begin, make_simulation
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice, Floors
from lidarium.envs.observation_spaces import action_space, observation_space
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.software import Software
from lidarium.envs.outcome.scorer import TRACK_PERIOD_S, Scorer
from lidarium.envs.outcome.team_state import state_space, team_state
from lidarium.envs.radio.messages import Order
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum, checked_seed, of_curriculum, read_options
from lidarium.envs.station.reports import Station

if TYPE_CHECKING:
    from lidarium.envs.drawing.rendering import Scene


Outcome = tuple[
    dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]
"""Observations, rewards, terminations, truncations, infos, each by agent."""


class ExplorationEnv(ParallelEnv[str, Observation, NDArray[np.float32]]):
    """A team of lidar robots explores a floor.

    Parameters
    ----------
    floor : Floors
        A catalogue name, ``building:SEED``, ``set:NAME``, a file that the importers know, or a floor; or
        many, as `FloorChoice` takes them. Of many, each reset draws one.
    settings : ExplorationSettings
        Every knob.
    render_mode : str or None
        ``human`` (a window), ``rgb_array`` or None.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.
    curriculum : callable or None
        Takes the number of an episode, from 0 on, and returns options of ``reset`` for it; those that a reset
        gets itself go before.

    Attributes
    ----------
    operating : Operating
        The robots' operating states and orders.

    Notes
    -----
    Observations, actions, infos and endings are described in docs/reference/environments.md. ``reset`` takes
    the options ``floor``, ``starts`` (robots, 3) and ``goal`` (2,).

    Raises
    ------
    ValueError, FileNotFoundError
        Where the floor or an option cannot be used.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "lidarium_exploration_v0",
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
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is {render_mode!r}; want human, rgb_array or None")
        self.settings = settings or ExplorationSettings()
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.settings.time_step}
        self.render_mode = render_mode
        self.possible_agents = self.settings.agents
        self.agents: list[str] = []
        self._choice = FloorChoice(floor, image_resolution)
        self._curriculum, self._begun = curriculum, 0
        self.has_goal = self._choice.has_goal
        space = observation_space(self.settings, self.has_goal)
        self.observation_spaces: dict[str, spaces.Space[Any]] = {
            agent: copy.deepcopy(space) for agent in self.possible_agents
        }
        self.action_spaces: dict[str, spaces.Space[Any]] = {
            agent: action_space() for agent in self.possible_agents
        }
        self._rows = {agent: row for row, agent in enumerate(self.possible_agents)}
        self.simulation = make_simulation(self.settings)
        self.world, self.beliefs, self.score = (
            self.simulation.world,
            self.simulation.beliefs,
            self.simulation.score,
        )
        self._generator: np.random.Generator | None = None
        self._window: Any = None
        # A world with a window of its own draws itself.
        self._shows_itself = render_mode == "human" and self.world.show()
        self.floor: Floor | None = None
        self.goal: tuple[float, float] | None = None
        self.seed: int | None = None
        self.scorer = Scorer(self.simulation, self.settings)
        self.perception = Perception(self.simulation, self.settings, np.zeros((self.settings.robots, 2)))
        self._observations = AgentObservations(
            self.simulation, self.settings, self.has_goal, self.perception.poses
        )
        self._software = Software(self.perception, self.settings)
        # In the ideal world nothing runs on board beside the kernels, and nobody fails: asking would cost a
        # tenth of a step.
        self._step = self._software.step if self._software.is_staged else self.simulation.step
        self._meters = self.perception.meters = Meters(self.world, self.settings)
        self.station = Station(self.perception, self._meters)
        self.operating = self.station.operating
        parts = (self.simulation, self.settings)
        self._commands = AgentCommands(self.settings, self.operating)
        self._endings = AgentEndings(*parts, self._meters, self.operating)
        self._infos = AgentInfos(*parts, self.scorer, self.operating, self._meters)

    def belief(self, agent: str) -> Belief:
        """Return the handle on what an agent's onboard software knows.

        Raises
        ------
        ValueError
            Where there is no such agent.
        """
        if agent not in self._rows:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")
        return Belief(self.perception, self._rows[agent])

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations, the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions, the same object at each call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode.

        Parameters
        ----------
        seed : int or None
            Where all draws of this and the later episodes come from; None goes on with the generator of the
            last seed.
        options : dict or None
            ``floor``, ``starts`` (robots, 3) in the floor's frame [m, rad], or ``fixed`` or ``drawn``,
            ``goal`` (2,) [m]; others are
            ignored, but for known names misspelt.
        """
        chosen, seed = read_options(options, self.settings.robots), checked_seed(seed)
        if seed is not None or self._generator is None:
            self._generator = np.random.default_rng(seed)
        chosen = of_curriculum(self._curriculum, self._begun, chosen, self.settings.robots)
        beginning = begin(self._generator, self._choice, chosen, self.settings)
        self._begun += 1
        return self.start(beginning)

    def start(self, beginning: EpisodeStart) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode that begins as was drawn, or as one did before.

        Returns what ``reset`` returns.
        """
        self.seed, self.floor, self.goal = beginning.seed, beginning.floor, beginning.goal
        self.simulation.place(
            0, beginning.tables, beginning.starts, beginning.seed, self.settings.known_starts
        )
        self._observations.start(beginning)
        self._commands.values[:] = 0.0
        self.agents = self.possible_agents[:]
        self._endings.start(self.goal)
        self.perception.start(self.goal)
        self._software.start(0, beginning.seed)
        self._meters.start()
        self.station.start()
        self._step(self._commands.values, moves_bodies=False)
        self.scorer.start()
        infos = self._infos.of(self.agents)
        if self.render_mode == "human":
            self.render()
        return self._observations.of(self.agents), infos

    def step(self, actions: dict[str, Any]) -> Outcome:
        """Drive for one time step.

        Parameters
        ----------
        actions : dict
            For each live agent speed and turn rate as shares of its limits, within [-1, 1].

        Returns
        -------
        observations, rewards, terminations, truncations, infos : dict
            By agent. ``infos[agent]["truth"]`` is for scoring only; ``infos[agent]["ended_because"]`` says
            why an agent ended.
        """
        if not self.agents:
            if self.floor is None:
                raise RuntimeError("the environment was not reset; call reset() before step()")
            return {}, {}, {}, {}, {}
        self.drive(actions)
        return self.outcome()

    def drive(self, actions: dict[str, Any]) -> None:
        """Run one time step of the world without building observations.

        ``outcome`` returns what came of it.
        """
        self.drive_at(self._commands.take(self.agents, actions))

    def drive_at(self, commands: NDArray[np.float64]) -> None:
        """Run one time step at speeds and turn rates (robots, 2) [m/s, rad/s].

        No observations are built.

        Those of robots that are paused, or back out after a pause, are overwritten.
        """
        is_active = self.operating.is_active
        if is_active:
            self.operating.before_step(commands)
        self._step(commands)
        if is_active:
            self.operating.after_step()
        if self._meters.is_active:
            self._meters.advance()
        self.scorer.advance()

    @property
    def energy_j(self) -> NDArray[np.float64]:
        """What the robots have used of their batteries, (robots,) [J].

        0 where these have no limit.
        """
        return self._meters.used_j.copy()

    @property
    def stopping(self) -> dict[str, str]:
        """Agents that end at the next outcome, with the reasons that their policies gave."""
        return dict(self.operating.stopping)

    def outcome(self) -> Outcome:
        """Return what ``step`` returns for the time since the last outcome.

        Ended agents leave.
        """
        live = self.agents
        self.operating.is_interrupting = False
        observations = self._observations.of(live)
        rows, rewards_of_rows = self._rows, self.scorer.take_rewards()
        rewards = {agent: rewards_of_rows[rows[agent]] for agent in live}
        endings, is_truncated = self._endings.due(live)
        infos = self._infos.of(live)
        terminations, truncations = dict.fromkeys(live, False), dict.fromkeys(live, is_truncated)
        if endings or is_truncated:
            for agent in live:
                if agent in endings:
                    terminations[agent], truncations[agent] = True, False
                if agent in endings or is_truncated:
                    reason = endings.get(agent, "horizon")
                    infos[agent]["ended_because"] = self.scorer.ended_because[agent] = reason
                    self._endings.end(agent, reason)
                    infos[agent]["state"] = self.operating.states[rows[agent]].value
            self.agents = [] if is_truncated else [agent for agent in live if agent not in endings]
        if self.render_mode == "human":
            self.render()
        return observations, rewards, terminations, truncations, infos

    def ends_now(self) -> bool:
        """Whether the next outcome ends an agent, or a robot has paused by itself."""
        return bool(self._endings.count()) or self.operating.is_interrupting

    def stop(self, agent: str, reason: str) -> None:
        """End an agent at its next step, with a reason.

        Its policy gives the reason (such as ``no_frontier``).
        """
        if agent not in self.agents:
            raise ValueError(f"{agent} is not among the live agents {self.agents}")
        self.operating.stopping[agent] = reason

    def order(self, agent: str, order: Order) -> None:
        """Send an agent an order from the station.

        See docs/reference/station.md for what each does.

        It takes effect at once or, over a radio that is not ideal, when it arrives; one that does not reach
        the robot, or that the robot does not take, is noted in ``operating.events``. An agent that was given
        an order may be left out of the actions of later steps: it then goes on with its last order.

        Raises
        ------
        ValueError
            Where there is no such agent; one that has ended takes no order, which is no error.
        """
        if agent not in self._rows:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")
        self.operating.order(self._rows[agent], order)

    @property
    def state_space(self) -> spaces.Box:
        """The space of ``state``."""
        return state_space(self.settings)

    def state(self) -> NDArray[np.float32]:
        """Return the true state of the team with what it has seen; see `team_state`."""
        if self.floor is None:
            raise RuntimeError("the environment was not reset; call reset() before state()")
        return team_state(self.simulation, self.settings)

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the floor, what is explored, the robots and their scans.

        The result is an image (rows, columns, 3), or the window.
        """
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
        """Return what a frame shows of the environment."""
        from lidarium.envs.drawing.frame_parts import RECENT_S
        from lidarium.envs.drawing.rendering import Scene

        has_ended = [agent not in self.agents for agent in self.possible_agents]
        name = "" if self.floor is None else self.floor.name
        track = [poses for _, poses in self.scorer.track[-round(RECENT_S / TRACK_PERIOD_S) :]]
        return Scene(self.simulation, self.settings, name, has_ended, track)

    def close(self) -> None:
        """Close the window and the world, if they hold anything; closing again does nothing."""
        self.simulation.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        # A copy has no window.
        return {**self.__dict__, "_window": None}
