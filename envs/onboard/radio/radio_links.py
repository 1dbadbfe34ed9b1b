"""Who reaches whom by radio in an episode: robots each other, and the station."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.disturbances.faults import DEAD_RADIO, has_fault
from lidarium.envs.simulation.disturbances.radio import RADIO_STREAM, links, links_to

STATION_STREAM = 1
"""Separates the draws for the station's links from those of the robots.

The robots' draws are the same with and without the station.
"""


class RadioLinks:
    """The links of the robots of one episode.

    Parameters
    ----------
    world : World
        Where the robots are.
    settings : ExplorationSettings
        The team and its radio.
    episode : int
        Which episode of the world.

    Attributes
    ----------
    links : (robots, robots) bool
        Who reached whom when links were found last: sender, receiver.
    station_links : (robots,) bool
        Who reached the station, and was reached by it, when that was found last.
    """

    def __init__(self, world: World, settings: ExplorationSettings, episode: int) -> None:
        self._world, self._settings, self._episode = world, settings.radio, episode
        self._rows = range(episode * settings.robots, (episode + 1) * settings.robots)
        self._is_shadowed = settings.radio.shadowing > 0.0
        self.start(0)

    def start(self, seed: int) -> None:
        """Begin an episode without links; chance comes from ``seed``."""
        robots = len(self._rows)
        self._generator = np.random.default_rng([seed, RADIO_STREAM])
        self._station_generator = np.random.default_rng([seed, RADIO_STREAM, STATION_STREAM])
        self._chance, self._station_chance = np.zeros((robots, robots)), np.zeros(robots)
        self.links, self.station_links = np.zeros((robots, robots), np.bool_), np.zeros(robots, np.bool_)

    def find(self, step: int, *, draws: bool) -> None:
        """Find out which robots reach each other.

        The shadowing is drawn again where ``draws``.
        """
        if draws and self._is_shadowed:
            self._chance = self._generator.standard_normal(self._chance.shape)
        world, team = self._world, slice(self._rows.start, self._rows.stop)
        floor = world.floors[self._episode]
        assert floor is not None
        self.links = links(
            self._settings, world.poses[team], floor.laser, self._chance if self._is_shadowed else None
        )
        works = self._works(step)
        self.links &= works[:, None] & works[None, :]

    def find_station(self, *, draws: bool = False) -> None:
        """Find out which robots reach the place where the first of them started."""
        if draws and self._is_shadowed:
            self._station_chance = self._station_generator.standard_normal(len(self.station_links))
        world, team = self._world, slice(self._rows.start, self._rows.stop)
        floor = world.floors[self._episode]
        assert floor is not None
        is_linked = links_to(
            self._settings,
            world.poses[team],
            world.starts[self._rows.start],
            floor.laser,
            self._station_chance if self._is_shadowed else None,
        )
        self.station_links = is_linked & self._works(int(world.steps[self._episode]))

    def reached(self) -> NDArray[np.bool_]:
        """Return whom the station reaches, from robot to robot, (robots,)."""
        reached, known = self.station_links.copy(), np.zeros_like(self.station_links)
        while (reached != known).any():
            known = reached
            reached = known | self.links[known].any(axis=0)
        return reached

    def is_lost(self, *, is_of_station: bool) -> bool:
        """Draw whether a message is lost, one of the station or between robots."""
        generator = self._station_generator if is_of_station else self._generator
        return self._settings.loss > 0.0 and bool(generator.random() < self._settings.loss)

    def _works(self, step: int) -> NDArray[np.bool_]:
        """Return whose radio works, (robots,)."""
        world = self._world
        return np.array(
            [
                world.failed[row] == 0 and not has_fault(world.faults[row], DEAD_RADIO, step)
                for row in self._rows
            ]
        )
