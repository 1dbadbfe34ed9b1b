"""A batch of episodes, in arrays over rows = episodes x robots.

It has their beginnings, steps, endings and observations.

What each row sees, earns and why it ends is what ``ExplorationEnv`` gives for the same seed, to the bit.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.batch.batch_run import BatchRun
from lidarium.envs.batch.beginnings import Beginnings
from lidarium.envs.batch.levels import make_level
from lidarium.envs.batch.observation_buffers import Arrays, ObservationBuffers
from lidarium.envs.batch.requests import count_of_episodes
from lidarium.envs.batch.row_infos import RowInfos
from lidarium.envs.batch.running import SENSES, STEPS, WAITS
from lidarium.envs.episode_start import EpisodeStart, goal_of_robots, make_simulation, map_frames
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice, Floors
from lidarium.envs.observation_spaces import observation_space
from lidarium.envs.observations import ObservationWriter
from lidarium.envs.observing.observables import ComputedObservations
from lidarium.envs.observing.rows import Rows
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.software import Software
from lidarium.envs.outcome.endings import HORIZON, make_rules, note_endings
from lidarium.envs.outcome.reward_terms import ExtraTerms
from lidarium.envs.scoring.rewards import TERMS
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum, ResetOptions
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.kernels.views import table_of


class EpisodeBatch:
    """Many episodes of one team size and one choice of settings; floors may differ.

    Parameters
    ----------
    episodes : int
        How many.
    floor : Floors
        As for ``ExplorationEnv``.
    settings : ExplorationSettings
        Of every episode.
    level : str
        What an action is: ``velocity``, ``waypoint`` or ``frontier``.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.
    copy : bool
        Whether observations are new arrays at each step; otherwise two sets of arrays take turns.
    curriculum : callable or None
        As for ``ExplorationEnv``; episodes are counted over all as they begin.

    Attributes
    ----------
    rows : int
        Episodes x robots.
    observation_space, action_space : Space
        Of one row.
    rewards : (rows,) float64
        What each row has earned in the last step.
    live : (rows,) bool
        Which robots have not ended.
    acted : (rows,) bool
        Which robots took part in the last step.
    reasons : (rows,) int8
        Why robots ended in the last step, by number in ``endings.REASONS``; 0 where they did not.
    is_whole : bool
        Whether all robots of all episodes are live.
    has_endings : bool
        Whether a robot ended in the last step.
    infos : dict
        What the last step reports beside, in arrays over rows.
    floors : list of Floor
        The floor of each episode.

    Raises
    ------
    ValueError
        Where there are no episodes, or the level, the floor or a setting cannot be used.
    """

    def __init__(
        self,
        episodes: int,
        floor: Floors,
        settings: ExplorationSettings,
        level: str = "velocity",
        image_resolution: float | None = None,
        copy: bool = True,
        curriculum: Curriculum | None = None,
    ) -> None:
        self.episodes, self.robots, self.settings = count_of_episodes(episodes), settings.robots, settings
        self.rows = self.episodes * self.robots
        if settings.battery.is_limited or settings.pauses_when_blocked:
            raise ValueError(
                f"capacity_j of the battery is {settings.battery.capacity_j}, pauses_when_blocked is "
                f"{settings.pauses_when_blocked}; "
                "want None and False: many episodes at once have no batteries and nobody to end a pause; or "
                "use lidarium.parallel_env"
            )
        choice = FloorChoice(floor, image_resolution)
        self._beginnings = Beginnings(choice, settings, self.episodes, curriculum)
        self.simulation = make_simulation(settings, self.episodes)
        self.world, self.score = self.simulation.world, self.simulation.score
        self._offsets, self._goals = np.zeros((self.rows, 2)), np.full((self.rows, 2), np.nan)
        self.perception = Perception(self.simulation, settings, self._offsets)
        self._software = Software(self.perception, settings)
        self.level = make_level(level, self.perception, settings)
        writer = ObservationWriter(
            self.simulation, settings, self._offsets, self._goals if choice.has_goal else None
        )
        named = Rows(self.simulation, settings, self.perception.poses)
        self._computed = ComputedObservations(named)
        self._extra = ExtraTerms(settings.reward.more, named)
        known = observation_space(settings, choice.has_goal).spaces
        self.observation_space = spaces.Dict({**known, **self.level.boxes})
        self.action_space = self.level.action_space
        self._buffers = ObservationBuffers(
            writer, self.rows, {**self._computed.boxes, **self.level.boxes}, copy
        )
        self.acted = np.zeros(self.rows, np.bool_)
        self.reasons = np.zeros(self.rows, np.int8)
        self.infos: dict[str, Any] = {}
        self.is_whole, self.has_endings = False, False
        self.floors: list[Floor | None] = [None] * self.episodes
        self._rules = make_rules(self.simulation, settings)
        self.live = self._rules.live
        self._commands = np.zeros((self.rows, 2))
        self._row_infos = RowInfos(self.simulation)
        self._run = BatchRun(self.simulation, settings, self._software, self.level, self._rules, writer)

    @property
    def observations(self) -> Arrays:
        """The observations of the last step, one a row, (rows, ...)."""
        return self._buffers.latest

    @property
    def everyone(self) -> NDArray[np.bool_]:
        """All true, (rows,); cannot be written to."""
        return self._row_infos.everyone

    @property
    def rewards(self) -> NDArray[np.float64]:
        """What each row has earned in the last step, (rows,)."""
        return self.score.rewards

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """Which episodes have no live robot left, (episodes,)."""
        return np.asarray(~self.live.reshape(self.episodes, self.robots).any(axis=1))

    @property
    def is_ready(self) -> bool:
        """Whether every episode has begun at least once."""
        return None not in self.floors

    def run(
        self,
        actions: NDArray[Any] | None,
        beginning: NDArray[np.int64],
        seeds: Sequence[int | None] | None = None,
        options: Mapping[int, ResetOptions] | None = None,
        is_same_step: bool = False,
    ) -> None:
        """Begin some episodes and run the other live ones for one step or decision.

        Parameters
        ----------
        actions : (rows, ...) array or None
            Actions of the live robots of the others; None where nothing else is to run.
        beginning : (K,) int64
            Which episodes begin.
        seeds : sequence of int or None
            A seed for each of them; None goes on with the episode's own generator.
        options : mapping or None
            Options by episode.
        is_same_step : bool
            Whether this goes on with the step of the call before: observations are then written over that
            one's.

        Raises
        ------
        ValueError
            Where an action or an option cannot be used; nothing has run then.
        """
        robots = self.robots
        # Most steps are of episodes of which none begins or has lost a robot: what concerns others costs
        # nothing then.
        begins = len(beginning) > 0
        is_plain = actions is not None and not begins and self.is_whole
        modes = np.full(self.episodes, STEPS if is_plain else WAITS, np.int8)
        if actions is not None and not is_plain:
            modes[~self.is_over] = STEPS
            modes[beginning] = WAITS
        acted = self.live.copy() if is_plain else self.live & np.repeat(modes == STEPS, robots)
        stopping = None if actions is None else self.level.take(actions, acted, self._commands, modes)
        if begins:
            for episode, start in self._beginnings.draw(beginning, seeds, options or {}).items():
                self._place(episode, start)
            self.is_whole = bool(self.live.all())
            self._row_infos.begin(np.repeat(np.isin(np.arange(self.episodes), beginning), robots))
            modes[beginning] = SENSES
        seen = acted
        if begins:
            seen = acted.copy()
            seen.reshape(self.episodes, robots)[beginning] = True
        self._buffers.turn(seen, is_same_step)
        self.score.rewards[:], self.score.reward_terms[:] = 0.0, 0.0
        self.run_kernel(modes, self._commands, seen)
        terms = self._take_terms(acted, is_plain)
        self.acted = acted
        self._note_endings(acted, stopping)
        self.infos = self._row_infos.of_step(terms, self.reasons, self.has_endings)
        self._computed.write(self.observations, seen)
        # Episodes that have not run in this call have nothing to be observed again.
        self.level.observe(self.acted, self.live & seen, seen, self.observations, self.infos)

    def _take_terms(self, acted: NDArray[np.bool_], is_plain: bool) -> dict[str, NDArray[np.float64]]:
        """Return what each term of the reward brought in the step, and add up those that are no kernels.

        Rows that did not act have earned nothing; ``is_plain`` says that all did.
        """
        earned = {} if self._extra.is_empty else self._extra.earned()
        for amounts in earned.values():
            self.score.rewards += amounts
        if not is_plain:
            self.score.rewards[~acted], self.score.reward_terms[~acted] = 0.0, 0.0
            earned = {name: np.where(acted, amounts, 0.0) for name, amounts in earned.items()}
        return {**dict(zip(TERMS, self.score.reward_terms.T.copy(), strict=True)), **earned}

    def _note_endings(self, acted: NDArray[np.bool_], stopping: NDArray[np.int8] | None) -> None:
        """Note why robots that took part in the step end, and let them stand.

        What happens to them counts before reasons of their own.
        """
        self.reasons = np.zeros(self.rows, np.int8)
        count = note_endings(self.simulation.table, self.robots, table_of(self._rules), self.reasons)
        if count:
            self.reasons[~acted] = 0
        if stopping is not None:
            own = acted & (stopping != 0) & ((self.reasons == 0) | (self.reasons == HORIZON))
            self.reasons[own] = stopping[own]
        self.has_endings = bool(self.reasons.any())
        if self.has_endings:
            ended = self.reasons != 0
            self.is_whole = False
            self.live[ended] = False
            self.world.moves[ended] = 0
            self.world.flags[ended] |= ENDED

    def run_kernel(
        self, modes: NDArray[np.int8], commands: NDArray[np.float64], seen: NDArray[np.bool_]
    ) -> None:
        """Run episodes by the kernel alone, without beginnings, endings and infos.

        ``run`` is made of it.

        Parameters
        ----------
        modes : (episodes,) int8
            What each episode does, see ``running``.
        commands : (rows, 2) float64
            Speeds and turn rates of episodes that take one step [m/s, rad/s].
        seen : (rows,) bool
            Whose observations are written.
        """
        self._run.run(modes, commands, seen, self.observations)

    def _place(self, episode: int, start: EpisodeStart) -> None:
        """Put the robots of an episode where they begin."""
        rows = slice(episode * self.robots, (episode + 1) * self.robots)
        self.simulation.place(episode, start.tables, start.starts, start.seed, self.settings.known_starts)
        self.floors[episode] = start.floor
        self._offsets[rows] = map_frames(start, self.settings)
        self._goals[rows] = goal_of_robots(start, self.settings)
        self._rules.goals[episode] = np.nan if start.goal is None else start.goal
        self._commands[rows], self.live[rows] = 0.0, True
        self._extra.start(episode)
        self.perception.start(start.goal, episode)
        self._software.start(episode, start.seed)
        self.level.start(episode)

    def frames(self) -> list[NDArray[np.uint8]]:
        """Draw each episode, all pictures of one size.

        Raises
        ------
        RuntimeError
            Where not every episode has begun.
        """
        from lidarium.envs.drawing.batch_frames import batch_frames
        from lidarium.envs.drawing.rendering import Scene

        if not self.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before render()")
        ended = ~self.live.reshape(self.episodes, self.robots)
        return batch_frames(
            [
                Scene(self.simulation, self.settings, floor.name, ended[episode].tolist(), [], episode)
                for episode, floor in enumerate(self.floors)
                if floor is not None
            ]
        )

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Which robots ended in the last step other than by the horizon, (rows,)."""
        return np.asarray((self.reasons != 0) & (self.reasons != HORIZON))

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Which robots the horizon has cut in the last step, (rows,)."""
        return np.asarray(self.reasons == HORIZON)
