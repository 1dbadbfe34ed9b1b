"""The kinematic world: bodies follow commands exactly, lasers scan the floor's cells."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import Lidar, by_robot
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.disturbances.faults import FAULT_NUMBERS, plan_faults
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE
from lidarium.envs.simulation.disturbances.odometry import RADIUS, WHEEL_NUMBERS, begin_wheels
from lidarium.envs.simulation.kernels.arrays import sensor_numbers, table_of_owners
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.stepping import move_and_sense
from lidarium.envs.simulation.people.population import Population


class KinematicWorld:
    """Robots that drive exactly as commanded, within the limits of their drives; a ``World``.

    Parameters
    ----------
    robots : sequence of Robot
        The team of every episode.
    lidar : Lidar or sequence of Lidar
        The laser of every robot, or of each in order; see ``by_robot``.
    time_step : float
        Length of a step [s].
    episodes : int
        Number of episodes.
    odometry : OdometrySettings
        Accuracy of the wheels' path measurement.
    has_odometry : bool
        Whether dead reckoning is kept, even if wheels measure exactly.
    faults : FaultSettings
        Faults of the robots.
    horizon_s : float or None
        For how long faults are drawn [s].
    scan_steps : int
        Steps from scan to scan.
    people : int
        Number of people.
    doors : float
        Share of the openings of a floor that have doors.

    Attributes
    ----------
    population : Population
        The people and doors.
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        lidar: Lidar | Sequence[Lidar],
        time_step: float = 0.1,
        episodes: int = 1,
        odometry: OdometrySettings = ODOMETRY["ideal"],
        has_odometry: bool = False,
        faults: FaultSettings = NO_FAULTS,
        horizon_s: float | None = None,
        scan_steps: int = 1,
        people: int = 0,
        doors: float = 0.0,
    ) -> None:
        self.robots, self.episodes, self.time_step = len(robots), episodes, time_step
        self.lidars = by_robot(lidar, self.robots)
        self._odometry, self._faults, self._horizon_s = odometry, faults, horizon_s
        self.bodies = np.stack([robot.numbers for robot in robots])
        rows = self.robots * episodes
        self.floors: list[FloorTables | None] = [None] * episodes
        self.floor_rows, self.frames = np.zeros((episodes, 10), np.int64), np.zeros((episodes, 3))
        self.seeds, self.steps = np.zeros(episodes, np.uint64), np.zeros(episodes, np.int64)
        self.starts, self.poses, self.velocities = (
            np.zeros((rows, 3)),
            np.zeros((rows, 3)),
            np.zeros((rows, 2)),
        )
        self.moves, self.flags = np.ones(rows, np.uint8), np.zeros(rows, np.int64)
        self.failed, self.faults = np.zeros(rows, np.uint8), np.zeros((rows, faults.capacity * FAULT_NUMBERS))
        self.bumpers, self.contacts = np.zeros((rows, 3), np.int8), np.zeros(rows, np.uint8)
        self.travelled, self.collisions = np.zeros(rows), np.zeros(rows, np.int64)
        self.ranges = np.full((rows, self.lidars[0].beams), np.inf, np.float32)
        self.true_ranges = np.full((rows, self.lidars[0].beams), np.inf, np.float32)
        is_plain = odometry.is_ideal and not has_odometry
        self.odometry_model = np.zeros(0) if is_plain else odometry.numbers
        self.wheels, self.odometry, self.driven = (
            np.zeros((rows, WHEEL_NUMBERS)),
            np.zeros((rows, 3)),
            np.zeros((rows, 2)),
        )
        # Wheels that measure exactly measure the true velocities.
        self.measured = self.velocities if is_plain else np.zeros((rows, 2))
        self.noise_table, self.sensor = GAUSSIAN_TABLE, sensor_numbers(self.lidars, time_step, 1.0, scan_steps)
        self.unit_vectors = np.concatenate([each.unit_vectors for each in self.lidars])
        self._everywhere = np.ones(episodes, np.bool_)
        self.population = Population(people, doors, self.bodies, episodes, self.lidars[0].beams)
        self._table = table_of_owners(self, self.population)

    @property
    def sensors(self) -> Mapping[str, NDArray[Any]]:
        """Measurements of the last step, by sensor name."""
        return {
            "scan": self.ranges,
            "odometry": self.odometry,
            "velocity": self.measured,
            "bumper": self.bumpers,
        }

    @property
    def attitudes(self) -> NDArray[np.float64]:
        """Height, roll and pitch of the bases, (rows, 3): 0, since the world is plane."""
        return np.zeros((self.robots * self.episodes, 3))

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        free: NDArray[np.bool_],
        seed: int,
    ) -> None:
        """Start an episode: robots at ``starts`` (robots, 3) of a floor, at rest, all draws from ``seed``."""
        rows = slice(episode * self.robots, (episode + 1) * self.robots)
        self.floors[episode], self.floor_rows[episode] = floor, floor.row
        self.frames[episode], self.seeds[episode] = floor.frame, seed
        # The scan at the start is taken before step 0.
        self.steps[episode] = -1
        self.starts[rows], self.poses[rows], self.velocities[rows] = starts, starts, 0.0
        self.bumpers[rows], self.contacts[rows], self.moves[rows] = 0, 0, 1
        self.ranges[rows], self.true_ranges[rows] = np.inf, np.inf
        self.travelled[rows], self.collisions[rows] = 0.0, 0
        self.wheels[rows] = begin_wheels(self._odometry, self.robots, seed)
        self.odometry[rows], self.measured[rows], self.failed[rows] = 0.0, 0.0, 0
        self.faults[rows] = self._plan_faults(floor, free, starts, seed)
        self.population.place(episode, floor, starts, seed)

    def move_and_sense(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Drive the robots for one time step, then take their scans; see ``World``."""
        chosen = self._everywhere if runs is None else runs
        move_and_sense(self._table, self.robots, commands, chosen, moves_bodies)

    def show(self) -> bool:
        """Return False: the world has no window of its own."""
        return False

    def close(self) -> None:
        """Do nothing: all is in arrays."""

    def _plan_faults(
        self, floor: FloorTables, free: NDArray[np.bool_], starts: NDArray[np.float64], seed: int
    ) -> NDArray[np.float64]:
        """Return the faults of an episode; kidnappings go to places that the robots could have reached."""
        if not self.faults.shape[1]:
            return np.zeros((self.robots, 0))
        x, y = floor.laser.origin
        room = np.asarray(scipy.ndimage.distance_transform_edt(free)) * floor.laser.resolution
        rows, columns = np.nonzero(room > self.bodies[:, RADIUS].max() + floor.laser.resolution)
        places = (np.stack([columns, rows], axis=1) + 0.5) * floor.laser.resolution + (x, y)
        somewhere = np.asarray(places if len(places) else starts[:, :2], np.float64)
        return plan_faults(self._faults, self.robots, seed, self.time_step, self._horizon_s, somewhere)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_table"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for episode, floor in enumerate(self.floors):
            if floor is not None:
                self.floor_rows[episode] = floor.row
        self._table = table_of_owners(self, self.population)
