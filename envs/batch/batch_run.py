"""The run of all episodes of a batch, by one kernel or step by step."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.batch.levels import Level
from lidarium.envs.batch.observation_buffers import Arrays
from lidarium.envs.batch.running import (
    DECIDES,
    SENSES,
    WAITS,
    Run,
    begin_decisions,
    follow_some,
    note_ends,
    run_parallel,
    run_serial,
)
from lidarium.envs.observations import ObservationWriter
from lidarium.envs.onboard.software import Software
from lidarium.envs.outcome.endings import Rules
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.work_queue import new_work


class BatchRun:
    """Runs the episodes of a batch for a step or a decision.

    Parameters
    ----------
    simulation : Simulation
        Of all episodes.
    settings : ExplorationSettings
        Of every episode.
    software : Software
        What runs on board.
    level : Level
        How actions become motion.
    rules : Rules
        What ends robots.
    writer : ObservationWriter
        What observations are written by.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        software: Software,
        level: Level,
        rules: Rules,
        writer: ObservationWriter,
    ) -> None:
        self._simulation, self._settings, self._robots = simulation, settings, settings.robots
        self._software, self._level, self._rules, self._writer = software, level, rules, writer
        episodes = np.arange(simulation.episodes)
        self._waiting = np.zeros(simulation.episodes * settings.robots, np.bool_)
        self._orders = [episodes, episodes[::-1].copy()]

    def run(
        self,
        modes: NDArray[np.int8],
        commands: NDArray[np.float64],
        seen: NDArray[np.bool_],
        observations: Arrays,
    ) -> None:
        """Run the episodes.

        Parameters
        ----------
        modes : (episodes,) int8
            What each episode does, see ``running``.
        commands : (rows, 2) float64
            Speeds and turn rates of episodes that take one step [m/s, rad/s].
        seen : (rows,) bool
            Whose observations are written.
        observations : dict of arrays
            Where to.
        """
        if self._software.is_staged:
            self._run_staged(modes.copy(), commands, seen, observations)
            return
        threads = self._simulation.use_threads()
        # To and fro: the maps of the episodes that ran last are in the caches yet.
        self._orders.reverse()
        run = run_parallel if threads > 1 else run_serial
        sources, observed = self._writer.arguments(observations)
        call = Run(
            self._simulation.table,
            self._robots,
            modes,
            commands,
            self._settings.decision_steps,
            self._waiting,
            seen,
            sources,
        )
        level, work = self._level, new_work(self._orders[0], threads)
        run(call, level.drives, level.following, self._rules, observed, work)
        self._writer.copy_sensors(observations, seen)

    def _run_staged(
        self,
        modes: NDArray[np.int8],
        commands: NDArray[np.float64],
        seen: NDArray[np.bool_],
        observations: Arrays,
    ) -> None:
        """Run episodes as the kernel does, step by step.

        What runs on board runs between the stages of a step; ``modes`` is used up.
        """
        level, table, robots = self._level, self._simulation.table, self._robots
        decides = modes == DECIDES
        left = np.where(decides, self._settings.decision_steps, 1)
        begin_decisions(decides, robots, level.drives, self._waiting)
        senses = modes == SENSES
        if senses.any():
            self._software.step(commands, moves_bodies=False, runs=senses)
            modes[senses] = WAITS
        while (runs := modes != WAITS).any():
            follow_some(runs & decides, robots, table, level.drives, level.following, commands)
            self._software.step(commands, runs=runs)
            note_ends(modes, robots, table, level.drives, self._rules, self._waiting)
            left[runs] -= 1
            modes[left == 0] = WAITS
        self._writer.write(observations, seen)
