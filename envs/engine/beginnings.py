"""Beginnings of episodes: floor, starts, seed and goal, drawn alike for one episode and for many."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.areas import around
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.envs.floors.starts import check_goal, check_starts, draw_starts
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum, ResetOptions, of_curriculum
from lidarium.envs.simulation.backends import BACKENDS
from lidarium.envs.simulation.kernels.floor_cache import FloorTables, floor_tables
from lidarium.envs.simulation.people.doors import NARROWEST_M, WIDEST_M, draw_doors, with_shut_doors
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.first_start import compile_listed

KERNELS_OF_RESET = Path(__file__).parent / "data" / "kernels_of_reset.json"
"""The kernels of a first reset that take long; ``scripts/dev/list_kernels.py reset`` writes it."""


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeStart:
    """Initial state of an episode.

    Attributes
    ----------
    floor : Floor
        The floor of the episode.
    tables : FloorTables
        Lookup tables of the floor for kernels.
    starts : (robots, 3) float64
        x, y, theta of each robot in the floor's frame [m, rad].
    seed : int
        Seed of the noise.
    goal : (x, y) or None
        In the floor's frame [m].
    """

    floor: Floor
    tables: FloorTables
    starts: NDArray[np.float64]
    seed: int
    goal: tuple[float, float] | None


def begin(
    generator: np.random.Generator, choice: FloorChoice, chosen: ResetOptions, settings: ExplorationSettings
) -> EpisodeStart:
    """Draw how an episode begins."""
    _compile_kernels()
    if chosen.goal is not None and not choice.has_goal:
        raise ValueError(
            f"option goal is {chosen.goal}, but the floor of the environment has no goal, and robots observe none; "
            "make the environment with a floor that has one, and each reset can replace it"
        )
    choice_here = choice if chosen.floor is None else choice.instead(chosen.floor)
    floor = choice_here.load(generator)
    if isinstance(chosen.starts, np.ndarray):
        floor = around(floor, chosen.starts)
    radius = settings.robot.radius
    _check_height(floor, settings.robot.height)
    tables = floor_tables(floor, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    starts, body, seed = chosen.starts, tables.body, None
    if settings.doors > 0.0:
        # Doors come from the seed of the episode, and robots do not start beyond one that stays shut.
        seed = int(generator.integers(2**63))
        doors = draw_doors(tables, settings.doors, radius, seed, starts if isinstance(starts, np.ndarray) else None)
        if not len(doors) and not choice_here.is_set:
            raise ValueError(
                f"doors is {settings.doors}, but floor {floor.name!r} has no opening of {NARROWEST_M} to {WIDEST_M} m "
                "between walls in which a door could hang; want doors=0 or a floor with rooms"
            )
        body = with_shut_doors(body, doors)
    if isinstance(starts, np.ndarray):
        check_starts(body, radius, starts)
    else:
        how = starts or settings.starts or ("drawn" if choice_here.is_set else "fixed")
        proposed = floor.starts[:0] if how == "drawn" else floor.starts
        starts = draw_starts(body, radius, settings.robots, generator, proposed)
    for number, fault in enumerate(settings.faults.schedule):
        if fault.place is not None:
            try:
                check_starts(body, radius, np.array([fault.place]))
            except ValueError as error:
                raise ValueError(f"the place of fault {number} does not fit robot {fault.robot}: {error}") from error
    goal = (chosen.goal or floor.goal) if choice.has_goal else None
    if goal is not None:
        check_goal(tables.body, goal)
    if seed is None:
        seed = int(generator.integers(2**63))
    return EpisodeStart(floor, tables, starts, seed, goal)


@cache
def _compile_kernels() -> None:
    """Compile the kernels of a reset in several processes, if most are not compiled yet; checked once in a process."""
    compile_listed(KERNELS_OF_RESET, "the first reset")


def _check_height(floor: Floor, height: float) -> None:
    """Refuse robots that would not fit below the ceiling."""
    if height >= floor.ceiling:
        raise ValueError(
            f"floor {floor.name!r} has its ceiling at {floor.ceiling:g} m, the robot is {height:g} m high; "
            "want a lower robot (robot.height) or a floor with a higher ceiling"
        )


def make_simulation(settings: ExplorationSettings, episodes: int = 1) -> Simulation:
    """Return the simulation of that many episodes, by the backend of the settings."""
    simulation = BACKENDS[settings.backend](settings, episodes)
    if simulation.scan_steps != settings.scan_steps:
        raise ValueError(
            f"backend {settings.backend!r} scans every {simulation.scan_steps} steps, scan_period_s asks for "
            f"{settings.scan_steps}; want scan_period_s None, or a backend that follows settings.scan_steps"
        )
    return simulation


def map_frames(beginning: EpisodeStart, settings: ExplorationSettings) -> NDArray[np.float64]:
    """Return the origin of each robot's map frame, shape (robots, 2) [m].

    It is in the frame of the robot's believed pose.
    """
    if not settings.known_starts:
        return np.zeros((settings.robots, 2))
    # The map frame begins at the corner of the cell in which the robot starts.
    cell = settings.occupancy.resolution
    origin = np.asarray(beginning.tables.laser.origin)
    return np.asarray(origin + np.floor((beginning.starts[:, :2] - origin) / cell) * cell)


def goal_of_robots(beginning: EpisodeStart, settings: ExplorationSettings) -> tuple[float, float]:
    """Return the goal as the robots know it, in the frame of their believed poses [m].

    nan if no goal is known.

    A robot that does not know its start does not know the goal either.
    """
    return beginning.goal if beginning.goal is not None and settings.known_starts else (np.nan, np.nan)


class Beginnings:
    """The draws of all episodes, a generator for each.

    Parameters
    ----------
    choice : FloorChoice
        The floor, or a set of which one is drawn.
    settings : ExplorationSettings
        Settings of every episode.
    episodes : int
        Number of these.
    curriculum : callable or None
        Options of ``reset`` by the number of an episode, counted over all as they begin.
    """

    def __init__(
        self,
        choice: FloorChoice,
        settings: ExplorationSettings,
        episodes: int,
        curriculum: Curriculum | None = None,
    ) -> None:
        self._choice, self._settings, self._curriculum = choice, settings, curriculum
        self._begun = 0
        self._generators: list[np.random.Generator | None] = [None] * episodes

    def draw(
        self,
        beginning: NDArray[np.int64],
        seeds: Sequence[int | None] | None,
        options: Mapping[int, ResetOptions],
    ) -> dict[int, EpisodeStart]:
        """Draw how episodes begin, before anything of them is changed.

        Parameters
        ----------
        beginning : (K,) int64
            Which episodes.
        """
        drawn: dict[int, EpisodeStart] = {}
        generators = self._generators.copy()
        for k, episode in enumerate(int(episode) for episode in beginning):
            seed = None if seeds is None else seeds[k]
            # Draw from a copy, so that nothing has been drawn if a later episode cannot begin.
            generator = copy.deepcopy(generators[episode])
            if seed is not None or generator is None:
                generator = np.random.default_rng(seed)
            chosen = of_curriculum(
                self._curriculum,
                self._begun + k,
                options.get(episode, ResetOptions()),
                self._settings.robots,
            )
            drawn[episode] = begin(generator, self._choice, chosen, self._settings)
            generators[episode] = generator
        self._generators = generators
        self._begun += len(drawn)
        return drawn
