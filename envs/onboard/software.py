"""Onboard steps between sensing and deciding: localization and radio.

They cover localization and radio.

In the ideal world the kernels of a step do all of it. Localizers and radios that are not kernels run here,
between and after the two stages of a step, robot by robot.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.exchange import CONTACT_S, NEVER
from lidarium.envs.settings.exploration import KERNEL_LOCALIZATIONS, ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.stepping import ranges_without_teammates
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.registry import make_localizer

LOCALIZER_STREAM = 0x6C6F6361
"""Sets the draws of localizers apart from others of the same seed."""


class Software:
    """Steps a world together with the robots' software that is not in kernels.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots, with their localizers and radios.
    settings : ExplorationSettings
        The team of every episode.

    Attributes
    ----------
    is_staged : bool
        Whether anything runs here; otherwise a step is that of the world alone.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings) -> None:
        self._perception, self._settings = perception, settings
        self._localizes = settings.localization not in KERNEL_LOCALIZATIONS
        self._beams = np.empty(settings.lidar.beams, np.float32)
        self._reckoned = np.zeros((perception.simulation.episodes * settings.robots, 3))
        has_camera = perception.simulation.camera is not None
        is_fused = perception.simulation.is_fused and not has_camera
        self.is_staged = self._localizes or bool(perception.exchanges) or not is_fused

    def start(self, episode: int, seed: int) -> None:
        """Begin an episode, after its robots were placed.

        All random draws use ``seed``.
        """
        robots = self._settings.robots
        if self._localizes:
            rows = slice(episode * robots, (episode + 1) * robots)
            self._reckoned[rows] = self._perception.simulation.odometry[rows]
            for robot, lidar in enumerate(self._settings.team_lidars):
                row = episode * robots + robot
                localizer = make_localizer(self._settings.localization, lidar, self._settings.localizer)
                draws = np.random.default_rng([seed, LOCALIZER_STREAM, robot])
                localizer.reset(self._perception.beliefs.believed[row].copy(), int(draws.integers(2**63)))
                self._perception.poses.localizers[row] = localizer
        if self._perception.exchanges:
            self._perception.exchanges[episode].start(seed)

    def step(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Run a step of the world, as ``Simulation.step``, and the onboard software."""
        simulation = self._perception.simulation
        simulation.step(commands, moves_bodies=moves_bodies, perceives=not self._localizes, runs=runs)
        if not self.is_staged:
            return
        perception = self._perception
        episodes = range(simulation.episodes) if runs is None else np.flatnonzero(runs).tolist()
        if self._localizes:
            for episode in episodes:
                self._localize(episode)
            simulation.perceive(runs)
        if perception.exchanges:
            for episode in episodes:
                self._exchange(episode)
        perception.sparse_maps.sense(runs)

    def _localize(self, episode: int) -> None:
        """Localize the robots of an episode."""
        simulation, robots = self._perception.simulation, self._settings.robots
        world = simulation.world
        time_s = float(world.steps[episode]) * self._settings.time_step
        localizers, believed = self._perception.poses.localizers, simulation.beliefs.believed
        rows = range(episode * robots, (episode + 1) * robots)
        live = [row for row in rows if localizers[row] is not None and not world.flags[row] & ENDED]
        # Teammates are sought in the scans from where the wheels say that the robots are now.
        moved = relative(self._reckoned[live], simulation.odometry[live])
        believed[live], self._reckoned[live] = composed(believed[live], moved), simulation.odometry[live]
        for row in live:
            localizer = localizers[row]
            assert localizer is not None
            ranges_without_teammates(simulation.table, row, robots, self._beams)
            believed[row] = localizer.localize(Sensing(time_s, simulation.odometry[row].copy(), self._beams.copy()))
            correction = localizer.take_correction()
            if correction is not None:
                simulation.render_again(row, correction.poses, correction.ranges)
                self._perception.trails.forget_again(row)
                self._perception.sparse_maps.correct(row, correction)

    def _exchange(self, episode: int) -> None:
        """Let the robots of an episode exchange messages.

        The kernels receive which teammates each robot has heard of lately.
        """
        world, settings, exchange = (
            self._perception.world,
            self._settings,
            self._perception.exchanges[episode],
        )
        exchange.step(self._perception.sparse_maps.shares(episode))
        if not settings.known_starts:
            return
        rows = slice(episode * settings.robots, (episode + 1) * settings.robots)
        age = int(world.steps[episode]) - exchange.heard_at
        self._perception.beliefs.contact[rows] = (exchange.heard_at != NEVER) & (
            age * settings.time_step <= CONTACT_S + settings.radio.latency_s
        )
        self._perception.beliefs.heard[rows] = exchange.heard.reshape(settings.robots, -1)
