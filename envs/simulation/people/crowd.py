"""People and doors of an episode at one time, for pictures, records and bags."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.arrays import (
    DOOR_END_Y,
    DOOR_KIND,
    DOOR_OPEN,
    NO_DOOR,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
)
from lidarium.envs.simulation.people.population import Population


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """People and doors at one time.

    Attributes
    ----------
    people : (people, 3) float64
        x, y and radius in the floor's frame [m].
    doors : (doors, 4) float64
        Ends x, y, x, y of the openings; leaves slide away to the first [m].
    opened : (doors,) float64
        Share by which each is open.
    """

    people: NDArray[np.float64]
    doors: NDArray[np.float64]
    opened: NDArray[np.float64]

    @property
    def leaves(self) -> NDArray[np.float64]:
        """Ends of the parts of the leaves within the openings, (doors, 4) [m]."""
        ends = self.doors.copy()
        ends[:, 2:] = self.doors[:, :2] + (1.0 - self.opened[:, None]) * (self.doors[:, 2:] - self.doors[:, :2])
        return ends


def crowd_of(population: Population | None, episode: int = 0) -> Crowd | None:
    """Return the people and doors of an episode now, copied; None if it has neither."""
    if population is None or (population.people == 0 and population.share == 0.0):
        return None
    doors = population.doors_of(episode)
    doors = doors[doors[:, DOOR_KIND] != NO_DOOR]
    people = population.people_of(episode)[:, [WALKER_X, WALKER_Y, WALKER_RADIUS]]
    return Crowd(people, doors[:, : DOOR_END_Y + 1].copy(), doors[:, DOOR_OPEN].copy())
