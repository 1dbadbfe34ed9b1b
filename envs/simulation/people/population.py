"""The people and doors of all episodes of a world: drawn by the seed of an episode, moved by the kernels of a step."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.raster import Raster
from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    CLOSEST,
    DOOR_KIND,
    DOOR_NUMBERS,
    DOOR_OPEN,
    OPENS,
    PERSON_GAP,
    PERSON_HEIGHT_M,
    SAFETY_NUMBERS,
    STAYS_SHUT,
    WALKER_NUMBERS,
    WALKER_PLACE,
    WALKER_RADIUS,
    WALKER_SPEED,
    WALKER_WAIT,
    WALKER_X,
    WALKER_Y,
    WALKWAY_NUMBERS,
)
from lidarium.envs.simulation.kernels.doors import SENSOR_M
from lidarium.envs.simulation.kernels.floor_cache import LIMITLESS_BODY, FloorTables
from lidarium.envs.simulation.people.doors import MOST_DOORS, draw_doors, middles_of, with_shut_doors
from lidarium.envs.simulation.people.walkways import WIDEST_M, Walkways, walkways_of

RADII_M = (0.25, WIDEST_M)
"""Radii of people, drawn uniformly [m]."""

SPEED, SPEED_DEVIATION, SPEEDS = 1.3, 0.2, (0.7, 1.9)
"""Mean, standard deviation and bounds of the speeds at which people like to walk [m/s]."""

FROM_ROBOTS_M = 1.0
"""Gap that people keep to robots at the start [m]."""

PEOPLE_STREAM = 0x70656F70
"""Sets the draws of people apart from others of the same seed."""


def no_people(rows: int) -> NDArray[np.float64]:
    """Return ``safety`` of robots that have not met people, (rows, 11)."""
    safety = np.zeros((rows, SAFETY_NUMBERS))
    safety[:, [CLOSEST, PERSON_GAP]] = np.inf
    return safety


class Population:
    """People and doors of all episodes.

    Parameters
    ----------
    people : int
        Number of people in each episode.
    doors : float
        Share of the openings of a floor that have doors.
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot of a team.
    episodes, beams : int
        Number of episodes, and of beams of a scan.

    Attributes
    ----------
    walkers, walkways, doors, recognised, safety : array
        See ``kernels.arrays``.
    """

    def __init__(self, people: int, doors: float, bodies: NDArray[np.float64], episodes: int, beams: int) -> None:
        self.people, self.share, self._bodies, self._robots = people, doors, bodies, len(bodies)
        rows, most = len(bodies) * episodes, MOST_DOORS if doors > 0.0 else 0
        self.walkers = np.zeros((episodes * people, WALKER_NUMBERS))
        self.walkways = np.zeros((episodes, WALKWAY_NUMBERS), np.int64)
        self.doors = np.zeros((episodes * most, DOOR_NUMBERS))
        self.recognised = np.zeros((rows if most or people else 0, beams), np.uint8)
        self.safety = no_people(rows)
        self._ways: list[Walkways | None] = [None] * episodes

    def place(self, episode: int, floor: FloorTables, starts: NDArray[np.float64], seed: int) -> None:
        """Draw the doors and people of an episode; people keep away from robots at ``starts`` (robots, 3)."""
        rows = slice(episode * self._robots, (episode + 1) * self._robots)
        self.safety[rows] = no_people(self._robots)
        doors = self.doors_of(episode)
        if len(self.recognised):
            self.recognised[rows] = 0
        if self.share > 0.0:
            drawn = self.draw_doors(floor, starts, seed)
            doors[:] = 0.0
            doors[: len(drawn)] = drawn
            # A robot that starts in a doorway finds the door open.
            near = np.hypot(*(middles_of(doors)[:, None] - starts[:, :2]).T).T < SENSOR_M
            doors[near.any(axis=1) & (doors[:, DOOR_KIND] == OPENS), DOOR_OPEN] = 1.0
        if self.people:
            shut = doors[doors[:, DOOR_KIND] == STAYS_SHUT]
            ways = _walkways(floor.body, floor.floor, tuple(map(tuple, shut.tolist())))
            self._ways[episode] = ways
            self._point_at(episode)
            self.people_of(episode)[:] = self._draw_people(floor, ways, doors, starts, seed)

    def draw_doors(self, floor: FloorTables, starts: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
        """Return the doors of an episode from starts on a floor, (doors, 7); none if no opening has any."""
        if self.share == 0.0:
            return np.zeros((0, DOOR_NUMBERS))
        return draw_doors(floor, self.share, float(self._bodies[:, RADIUS].max()), seed, starts)

    def people_of(self, episode: int) -> NDArray[np.float64]:
        """Return the people of an episode, (people, 11); a view."""
        return self.walkers[episode * self.people : (episode + 1) * self.people]

    def doors_of(self, episode: int) -> NDArray[np.float64]:
        """Return the doors of an episode, (doors, 7), of kind 0 if unused; a view."""
        most = len(self.doors) // len(self.walkways)
        return self.doors[episode * most : (episode + 1) * most]

    def _draw_people(
        self,
        floor: FloorTables,
        ways: Walkways,
        doors: NDArray[np.float64],
        starts: NDArray[np.float64],
        seed: int,
    ) -> NDArray[np.float64]:
        generator = np.random.default_rng([seed, PEOPLE_STREAM])
        people = np.zeros((self.people, WALKER_NUMBERS))
        people[:, WALKER_RADIUS] = generator.uniform(*RADII_M, self.people)
        people[:, WALKER_SPEED] = np.clip(generator.normal(SPEED, SPEED_DEVIATION, self.people), *SPEEDS)
        side = ways.cell * floor.body.resolution
        rows, columns = np.nonzero(ways.walkable)
        cells = (np.stack([columns, rows], axis=1) + 0.5) * side + np.array(floor.body.origin)
        gaps = self._bodies[:, RADIUS] + WIDEST_M + FROM_ROBOTS_M
        for start, gap in zip(starts[:, :2], gaps, strict=True):
            cells = cells[np.hypot(*(cells - start).T) >= gap]
        for middle in middles_of(doors[doors[:, DOOR_KIND] > 0]):
            cells = cells[np.hypot(*(cells - middle).T) >= SENSOR_M]
        for k in range(self.people):
            if not len(cells):
                raise ValueError(
                    f"people is {self.people}, but only {k} fit on {_named(floor.floor)} a metre away from the "
                    "robots; want fewer people or a larger floor"
                )
            place = cells[int(generator.integers(len(cells)))]
            people[k, [WALKER_X, WALKER_Y]] = place
            cells = cells[np.hypot(*(cells - place).T) >= 2.0 * WIDEST_M + 0.05]
        people[:, WALKER_PLACE] = generator.integers(len(ways.places), size=self.people)
        people[:, WALKER_WAIT] = 0.0
        return people

    def _point_at(self, episode: int) -> None:
        """Store the addresses of the ways of an episode, for kernels."""
        ways = self._ways[episode]
        if ways is not None:
            self.walkways[episode] = ways.row

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for episode in range(len(self._ways)):
            self._point_at(episode)


@lru_cache(maxsize=32)
def _walkways(body: Raster, floor: Floor | None, doors: tuple[tuple[float, ...], ...]) -> Walkways:
    """Return the ways of people on a floor, of which ``body`` has the cells for robots; those used last are kept."""
    raster = body if floor is None else floor.raster(body.resolution, LIMITLESS_BODY, PERSON_HEIGHT_M)
    ways = walkways_of(with_shut_doors(raster, np.array(doors).reshape(-1, DOOR_NUMBERS)))
    if not len(ways.places):
        raise ValueError(f"no person fits on {_named(floor)}: no place is {2.0 * WIDEST_M:g} m wide; want people=0")
    return ways


def _named(floor: Floor | None) -> str:
    return "the floor" if floor is None else f"floor {floor.name!r}"
