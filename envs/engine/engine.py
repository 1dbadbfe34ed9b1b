"""The engine of all environments: episodes of a team, in arrays over rows = episodes x robots.

It has their beginnings, steps, endings, rewards, observations and infos. A single environment is an engine of one
episode; every face (PettingZoo, Gymnasium, stable-baselines3) hands actions to it and reads its arrays.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.engine.beginnings import (
    Beginnings,
    EpisodeStart,
    goal_of_robots,
    make_simulation,
    map_frames,
)
from lidarium.envs.engine.reward_terms import ExtraTerms
from lidarium.envs.engine.running import (
    Run,
    begin_decisions,
    follow_some,
    note_ends,
    run_parallel,
    run_serial,
)
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice, Floors
from lidarium.envs.levels import LEVELS
from lidarium.envs.levels.level import DECIDES, SENSES, STEPS, WAITS, Level, Turn
from lidarium.envs.observing.observables import ComputedObservations
from lidarium.envs.observing.rows import Rows
from lidarium.envs.observing.spaces import check_memory, observation_space
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.software import Software
from lidarium.envs.onboard.station.operating import Operating, frozen
from lidarium.envs.onboard.station.reports import Station
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import check_level
from lidarium.envs.settings.reset_options import Curriculum, ResetOptions
from lidarium.envs.simulation.endings import HORIZON, REASONS, make_rules, note_endings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.rewards import TERMS, TIME
from lidarium.mapping.kernels.interrupts import interruptible
from lidarium.mapping.kernels.views import table_of
from lidarium.mapping.kernels.work_queue import new_work

if TYPE_CHECKING:
    from lidarium.envs.drawing.prediction_layer import PredictionLayer
    from lidarium.envs.drawing.rendering import Scene

Arrays = dict[str, NDArray[Any]]

AfterStep = Callable[[NDArray[np.float64]], None]
"""Called after each time step with the commands (rows, 2) [m/s, rad/s]."""

NO_EPISODES = np.zeros(0, np.int64)


class Engine:
    """Episodes of one team and one choice of settings; floors may differ.

    Parameters
    ----------
    episodes : int
        Number of episodes.
    floor : Floors
        The floor, or floors of which each beginning draws one; see `FloorChoice`.
    settings : ExplorationSettings
        Settings of every episode.
    level : str, optional
        Type of an action: a name in the registry ``level``. ``velocity`` by default.
    image_resolution : float, optional
        Side of a pixel [m] if the floor is a plain image.
    copy : bool, optional
        Whether observations are new arrays at each step, the default; otherwise two sets of arrays take turns.
    curriculum : callable, optional
        Takes the number of an episode, counted over all as they begin, and returns options of its beginning.
    reports : bool, optional
        Whether robots report to a station. False by default: it costs time in each step if odometry is not ideal.

    Attributes
    ----------
    rows : int
        Episodes x robots.
    observation_space, action_space : Space
        Spaces of the observations and actions of one row.
    level : Level
        The level, which converts actions to motion.
    operating : Operating
        The robots' operating states and orders.
    stations : list of Station
        The station of each episode; empty without ``reports``.
    live, acted : (rows,) bool
        Which robots have not ended, and which took part in the last step.
    reasons : (rows,) int8
        Why robots ended in the last step, by number in ``endings.REASONS``, one beyond them for a policy's own words;
        0 if they did not.
    is_whole, has_endings : bool
        Whether all robots of all episodes are live, and whether one ended in the last step.
    infos : dict
        Further results of the last step, in arrays over rows.
    observations : dict of arrays
        The observations of the last step, one a row; rows that were not observed repeat their last one.
    floors : list of Floor
        The floor of each episode.
    starts : list of EpisodeStart
        Beginning of each episode.

    Raises
    ------
    ValueError
        If there are no episodes, or the level, the floor or a setting cannot be used.
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
        reports: bool = False,
    ) -> None:
        if isinstance(episodes, bool) or not isinstance(episodes, int | np.integer) or episodes < 1:
            raise ValueError(f"the number of episodes is {episodes!r}; want a whole number of at least 1")
        self.episodes = int(episodes)
        self.settings = settings
        self.robots = settings.robots
        self.rows = self.episodes * self.robots
        choice = FloorChoice(floor, image_resolution)
        self.has_goal = choice.has_goal
        check_memory(self.episodes, settings, self.has_goal)
        self._beginnings = Beginnings(choice, settings, self.episodes, curriculum)
        self.simulation = make_simulation(settings, self.episodes)
        self.world = self.simulation.world
        self.score = self.simulation.score
        self._offsets = np.zeros((self.rows, 2))
        self._goals = np.full((self.rows, 2), np.nan)
        self.perception = Perception(self.simulation, settings, self._offsets)
        self._prediction: PredictionLayer | None = None
        self._software = Software(self.perception, settings)
        # Without localizers and radios of their own on board, a step is that of the simulation alone.
        self._step = self._software.step if self._software.is_staged else self.simulation.step
        self.operating = Operating(self.perception, settings)
        self._meters = Meters(self.world, settings) if reports or settings.battery.is_limited else None
        self.perception.meters = self._meters
        self.stations: list[Station] = []
        if reports:
            meters = self._meters
            assert meters is not None
            self.stations = [
                Station(self.perception, meters, self.operating, episode) for episode in range(self.episodes)
            ]
        self._writer = ObservationWriter(
            self.simulation, settings, self._offsets, self._goals if choice.has_goal else None
        )
        named = Rows(self.simulation, settings, self.perception.poses)
        self._computed = ComputedObservations(named)
        self._extra = ExtraTerms(settings.reward.more, named)
        self._computes = bool(self._computed.boxes)
        self._has_extra = not self._extra.is_empty
        self._is_battery_limited = settings.battery.is_limited
        self._rules = make_rules(self.simulation, settings)
        self._tables: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
        self.live = self._rules.live
        self.acted = np.zeros(self.rows, np.bool_)
        self.reasons = np.zeros(self.rows, np.int8)
        self.infos: dict[str, Any] = {}
        self.is_whole = False
        self.has_endings = False
        self.ended_because: dict[int, str] = {}
        self.floors: list[Floor | None] = [None] * self.episodes
        self.starts: list[EpisodeStart | None] = [None] * self.episodes
        self.everyone = frozen(np.ones(self.rows, np.bool_))
        self._commands = np.zeros((self.rows, 2))
        self._waiting = np.zeros(self.rows, np.bool_)
        self._all_step = bytes([STEPS]) * self.episodes
        order = np.arange(self.episodes)
        self._orders = [order, order[::-1].copy()]
        self.copies = copy
        camera = self.simulation.camera
        self._calibration = None if camera is None else camera.camera.calibrations(self.rows)
        self.use_level(level)

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; episodes have to begin anew.

        ``shares_map`` and ``decision_period_s`` are those of `Level`.
        """
        self.take_level(name, self.made_level(name, shares_map, decision_period_s))

    def made_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> Level:
        """Return a level of this engine, which does not use it yet."""
        check_level(self.settings.observe, name)
        level = LEVELS[name](self.perception, self.settings, shares_map, decision_period_s)
        period = self.settings.scan_period_s
        if level.driver is not None and period is not None and period > level.period_s + 1e-9:
            raise ValueError(
                f"scan_period_s is {period} s, longer than a decision of {level.period_s} s at "
                f"level {name!r}; want at most that"
            )
        return level

    def space_at(self, level: Level) -> spaces.Dict:
        """Return the space of the observations of a row at a level."""
        return spaces.Dict({**observation_space(self.settings, self.has_goal).spaces, **level.boxes})

    def take_level(self, name: str, level: Level) -> None:
        """Take actions at a level; every episode has to be reset."""
        self.level: Level = level
        self.level_name = name
        self.operating.attach(self.level.driver, self.level.make_driver)
        self.floors[:] = [None] * self.episodes
        self.live[:], self.is_whole = False, False
        self.observation_space = self.space_at(level)
        self.action_space = self.level.action_space
        self._boxes = {**self._computed.boxes, **self.level.boxes}
        self._written = self._writer.kinds
        self._buffers = [self._new_buffers(), self._new_buffers()]
        self.observations: Arrays = self._buffers[0]

    @property
    def rewards(self) -> NDArray[np.float64]:
        """Reward of each row in the last step, (rows,)."""
        return self.score.rewards

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """Which episodes have no live robot left, (episodes,)."""
        return np.asarray(~self.live.reshape(self.episodes, self.robots).any(axis=1))

    @property
    def is_ready(self) -> bool:
        """Whether every episode has begun at least once."""
        return None not in self.floors

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Which robots ended in the last step other than by the horizon, (rows,)."""
        return np.asarray((self.reasons != 0) & (self.reasons != HORIZON))

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Which robots the horizon has cut in the last step, (rows,)."""
        return np.asarray(self.reasons == HORIZON)

    @property
    def used_j(self) -> NDArray[np.float64]:
        """The energy that robots have used [J], (rows,); 0 if their batteries have no limit."""
        return np.zeros(self.rows) if self._meters is None else self._meters.used_j.copy()

    def run(
        self,
        decoded: Any,  # noqa: ANN401
        beginning: NDArray[np.int64] = NO_EPISODES,
        seeds: Sequence[int | None] | None = None,
        options: Mapping[int, ResetOptions] | None = None,
        is_same_step: bool = False,
        given: NDArray[np.bool_] | None = None,
        after_step: AfterStep | None = None,
    ) -> None:
        """Begin some episodes and run the other live ones for one step or decision.

        Parameters
        ----------
        decoded : object or None
            Actions as `Level.read` or `Level.read_rows` returns them; None if nothing else is to run.
        beginning : (K,) int64, optional
            Which episodes begin. None by default.
        seeds : sequence of int, optional
            A seed for each of them; None goes on with the episode's own generator.
        options : mapping, optional
            Options by episode.
        is_same_step : bool, optional
            Whether this goes on with the step of the call before: its observations are then written over.
        given : (rows,) bool, optional
            Which robots decide; all that are live by default.
        after_step : callable, optional
            Called after each time step with the commands; episodes then run step by step.

        Raises
        ------
        ValueError
            If an option cannot be used; nothing has run then.
        """
        drawn = self._beginnings.draw(beginning, seeds, options or {}) if len(beginning) else {}
        self._run(decoded, drawn, is_same_step, given, after_step)

    def begin(self, starts: Mapping[int, EpisodeStart]) -> None:
        """Begin episodes as they were drawn, or as they began before."""
        self._run(None, starts, False, None, None)

    @interruptible
    def _run(
        self,
        decoded: Any,  # noqa: ANN401
        starts: Mapping[int, EpisodeStart],
        is_same_step: bool,
        given: NDArray[np.bool_] | None,
        after_step: AfterStep | None,
    ) -> None:
        # Most steps are of episodes of which none begins or has lost a robot: the rest costs nothing then.
        is_plain = decoded is not None and not starts and self.is_whole
        if is_plain:
            modes = np.frombuffer(self._all_step, np.int8).copy()
            acted = self.live.copy()
        else:
            modes = np.full(self.episodes, WAITS, np.int8)
            if decoded is not None:
                modes[~self.is_over] = STEPS
                modes[list(starts)] = WAITS
            acted = self.live & np.repeat(modes == STEPS, self.robots)
        if decoded is not None:
            chosen = acted if given is None else acted & given
            self.level.carry_out(decoded, Turn(acted, chosen, self._commands, modes, self.operating))
        seen = acted
        if starts:
            for episode, start in starts.items():
                self._place(episode, start)
                modes[episode] = SENSES
            self.is_whole = bool(self.live.all())
            seen = acted.copy()
            seen.reshape(self.episodes, self.robots)[list(starts)] = True
        self._turn_buffers(None if is_plain else seen, is_same_step)
        self.score.earned.fill(0.0)
        self._advance(modes, seen, after_step)
        for episode in starts:
            self._extra.start(episode)
        self._finish(acted, seen, is_plain)

    def step_at(self, commands: NDArray[np.float64], after_step: AfterStep | None = None) -> None:
        """Run one time step of all episodes at speeds and turn rates (rows, 2) [m/s, rad/s]; `finish` ends it."""
        self._tick(commands, None, after_step)

    def finish(self) -> None:
        """Observe, reward and end after steps by `step_at`."""
        acted = self.live.copy()
        self._turn_buffers(acted, False)
        self._writer.write(self.observations, acted)
        self._finish(acted, acted, self.is_whole)
        self.score.earned.fill(0.0)

    def _finish(self, acted: NDArray[np.bool_], seen: NDArray[np.bool_], is_plain: bool) -> None:
        """Complete observations, rewards, endings and infos after the episodes have run."""
        if self._computes:
            self._computed.write(self.observations, seen)
        terms = self._take_terms(acted, is_plain)
        self.acted = acted
        self._note_endings(acted)
        self._report(terms)
        if self.level.observes:
            live = self.live & seen
            if self.operating.is_active:
                live &= ~self.operating.held
            self.level.observe(acted, live, seen, self.observations, self.infos)

    def _place(self, episode: int, start: EpisodeStart) -> None:
        """Put the robots of an episode at their start poses."""
        rows = slice(episode * self.robots, (episode + 1) * self.robots)
        self.simulation.place(episode, start.tables, start.starts, start.seed, self.settings.known_starts)
        self.floors[episode] = start.floor
        self.starts[episode] = start
        self._offsets[rows] = map_frames(start, self.settings)
        self._goals[rows] = goal_of_robots(start, self.settings)
        self._rules.goals[episode] = np.nan if start.goal is None else start.goal
        self._rules.is_empty[rows] = False
        self._commands[rows] = 0.0
        self.live[rows] = True
        self.perception.start(start.goal, episode)
        self._software.start(episode, start.seed)
        if self._meters is not None:
            self._meters.start(episode)
        self.operating.start(episode)
        if self.stations:
            self.stations[episode].start()
        self.level.start(episode)

    def _advance(self, modes: NDArray[np.int8], seen: NDArray[np.bool_], after_step: AfterStep | None) -> None:
        """Run the episodes and write observations: all in one kernel call, or step by step."""
        is_stepped = (
            after_step is not None
            or self._software.is_staged
            or self.operating.is_active
            or (self._meters is not None and self._meters.is_active)
        )
        if is_stepped:
            self._run_stepwise(modes, after_step)
            self._writer.write(self.observations, seen)
        else:
            self.run_kernel(modes, self._commands, seen)

    def run_kernel(self, modes: NDArray[np.int8], commands: NDArray[np.float64], seen: NDArray[np.bool_]) -> None:
        """Run episodes by the kernel alone, without beginnings, endings and infos.

        ``modes`` (episodes,) int8 are the modes of the episodes, ``commands`` (rows, 2) are the speeds of those that
        take one step, ``seen`` (rows,) bool are the rows that are observed.
        """
        threads = self.simulation.use_threads()
        # To and fro: the maps of the episodes that ran last are still in the caches.
        self._orders.reverse()
        run = run_parallel if threads > 1 else run_serial
        sources, observed = self._writer.arguments(self.observations)
        call = Run(self.simulation.table, self.robots, modes, commands, self.level.steps, self._waiting, seen, sources)
        work = new_work(self._orders[0], threads)
        run(call, self.level.drives, self.level.following, self._rules, observed, work)
        self._writer.copy_sensors(self.observations, seen)

    def _run_stepwise(self, modes: NDArray[np.int8], after_step: AfterStep | None) -> None:
        """Run episodes as the kernel does, step by step; ``modes`` is used up."""
        commands, level, robots = self._commands, self.level, self.robots
        if modes.tobytes() == self._all_step:
            self._tick(commands, None, after_step)
            return
        table = self.simulation.table
        senses = modes == SENSES
        if senses.any():
            self._step(commands, moves_bodies=False, runs=senses)
            modes[senses] = WAITS
        self.operating.interrupting[:] = False
        decides = modes == DECIDES
        left = np.where(decides, level.steps, 1)
        begin_decisions(decides, robots, level.drives, self._waiting)
        while (runs := modes != WAITS).any():
            follow_some(runs & decides, robots, table, level.drives, level.following, commands)
            self._tick(commands, runs, after_step)
            note_ends(modes, robots, table, level.drives, self._rules, self._waiting)
            modes[self.operating.interrupting & decides] = WAITS
            left[runs] -= 1
            modes[left == 0] = WAITS

    def _tick(
        self, commands: NDArray[np.float64], runs: NDArray[np.bool_] | None, after_step: AfterStep | None
    ) -> None:
        """Run one time step of some episodes, or of all."""
        operating, meters = self.operating, self._meters
        is_active = operating.is_active
        if is_active:
            operating.before_step(commands, runs)
        self._step(commands, runs=runs)
        if is_active:
            operating.after_step(runs)
        if meters is not None and meters.is_active:
            meters.advance()
            if self._is_battery_limited:
                self._rules.is_empty[:] = meters.is_empty
        if after_step is not None:
            after_step(commands)

    def _take_terms(self, acted: NDArray[np.bool_], is_plain: bool) -> dict[str, NDArray[np.float64]]:
        """Return the value of each term of the reward in the step; add those that are not kernels.

        Rows that did not act have earned nothing; ``is_plain`` means that all did.
        """
        score = self.score
        rewards = score.rewards
        if self.level.passed_over is not None:
            idle = score.reward_weights[TIME] * np.repeat(self.level.passed_over, self.robots)
            rewards -= idle
            score.reward_terms[:, TIME] -= idle
        earned: dict[str, NDArray[np.float64]] = {}
        if self._has_extra:
            # Terms may count the steps that they are asked for: a beginning is none.
            nothing = dict.fromkeys(self._extra.names, np.zeros(self.rows))
            earned = self._extra.earned() if acted.any() else nothing
        for amounts in earned.values():
            rewards += amounts
        if not is_plain:
            rewards[~acted] = 0.0
            score.reward_terms[~acted] = 0.0
            earned = {name: np.where(acted, amounts, 0.0) for name, amounts in earned.items()}
        return {**dict(zip(TERMS, score.reward_terms.T.copy(), strict=True)), **earned}

    def _note_endings(self, acted: NDArray[np.bool_]) -> None:
        """Record why robots that took part in the step end, and stop them.

        Events in the world take precedence over reasons of their own. An empty battery takes the sensors and the
        radio of a robot as well.
        """
        if self._tables is None:
            self._tables = self.simulation.table, table_of(self._rules)
        world, rules = self._tables
        self.reasons = reasons = np.zeros(self.rows, np.int8)
        count = note_endings(world, self.robots, rules, reasons)
        stopping = self.operating.stopping
        if not count and not stopping:
            self.has_endings = False
            return
        if count:
            reasons[~acted] = 0
        words: dict[int, str] = {}
        for row in [row for row in stopping if acted[row]]:
            word = stopping.pop(row) or "stopped"
            if reasons[row] in (0, HORIZON):
                known = REASONS.index(word) if word in REASONS else HORIZON
                reasons[row] = len(REASONS) if known == HORIZON else known
                words[row] = word
        rows = np.flatnonzero(reasons)
        self.has_endings = len(rows) > 0
        if not self.has_endings:
            return
        self.is_whole = False
        self.live[rows] = False
        self.world.moves[rows] = 0
        self.world.flags[rows] |= ENDED
        named = {row: words.get(row) or REASONS[reasons[row]] for row in rows.tolist()}
        for row, word in named.items():
            if word == "battery":
                self.world.failed[row] = 1
        self.operating.end(named)
        self.ended_because = named

    def _report(self, terms: dict[str, NDArray[np.float64]]) -> None:
        """Put together the infos of the step: the truth, states, terms of the reward and endings."""
        everyone, score, operating = self.everyone, self.score, self.operating
        infos: dict[str, Any] = {
            "truth": {
                "pose": self.world.poses.copy(),
                "coverage": score.row_coverages(),
                "seen_cells": score.seen.copy(),
            },
            "_truth": everyone,
            "order": operating.order_names,
            "_order": everyone,
            "reward_terms": terms,
            "_reward_terms": everyone,
        }
        if self.has_endings:
            names = np.full(self.rows, None, object)
            for row, word in self.ended_because.items():
                names[row] = word
            infos["ended_because"] = names
            infos["_ended_because"] = self.reasons != 0
        infos["state"] = operating.state_names
        infos["_state"] = everyone
        if self._is_battery_limited:
            infos["energy_j"] = self.used_j
            infos["_energy_j"] = everyone
        if self._calibration is not None:
            infos["camera"] = self._calibration
            infos["_camera"] = everyone
        self.infos = infos

    def _new_buffers(self) -> Arrays:
        arrays: Arrays = {name: np.zeros(shape, dtype) for name, (shape, dtype) in self._written.items()}
        for name, box in self._boxes.items():
            arrays[name] = np.zeros((self.rows, *(box.shape or ())), box.dtype)
        return arrays

    def _turn_buffers(self, seen: NDArray[np.bool_] | None, is_same_step: bool) -> None:
        """Choose the arrays for the observations of this step; rows that are not seen repeat their last one.

        By default (None) all rows are seen.
        """
        before = self.observations
        if not is_same_step:
            self._buffers.reverse()
            self.observations = self._buffers[0]
        if seen is not None and self.observations is not before and not seen.all():
            for name, array in self.observations.items():
                array[~seen] = before[name][~seen]

    def prediction(self) -> "PredictionLayer | None":
        """Return the layer of pictures that shows predictions; None if no robot predicts."""
        if not self.perception.predicts:
            return None
        if self._prediction is None:
            from lidarium.envs.drawing.prediction_layer import PredictionLayer

            self._prediction = PredictionLayer()
        return self._prediction

    def scenes(self) -> list["Scene"]:
        """Return the content of a picture of each episode.

        Raises
        ------
        RuntimeError
            If an episode has not begun.
        """
        from lidarium.envs.drawing.rendering import Scene

        if not self.is_ready:
            raise RuntimeError("the environment was not reset; call reset() before render()")
        ended = ~self.live.reshape(self.episodes, self.robots)
        return [
            Scene(self.simulation, self.settings, floor.name, ended[episode].tolist(), [], episode, self.prediction())
            for episode, floor in enumerate(self.floors)
            if floor is not None
        ]

    def __getstate__(self) -> dict[str, Any]:
        # A copy's arrays lie elsewhere.
        return {**self.__dict__, "_tables": None, "_prediction": None}
