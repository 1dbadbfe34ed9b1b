"""Named arrays over rows = episodes x robots, for observables and rewards of one's own."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.geometry.bounds import shown

FARTHEST = 1000.0
"""Bound of positions in observations [m]."""


class Rows:
    """State of all robots of all episodes, row = episode * robots + robot.

    The arrays are the simulation's own: read them, and keep copies. Attributes of the world that are not
    named here, such as ``poses``, are the world's.

    Parameters
    ----------
    simulation : Simulation
        Simulation of all episodes.
    settings : ExplorationSettings
        The team of every episode.
    poses : KnownPoses or None
        Poses of the robots and their teammates as known to them; None if no observable needs them.

    Attributes
    ----------
    settings : ExplorationSettings
        The team of every episode.
    robots, episodes : int
        Robots of a team, and number of episodes.
    """

    def __init__(self, simulation: Simulation, settings: ExplorationSettings, poses: KnownPoses | None = None) -> None:
        self._simulation, self._poses = simulation, poses
        self._world, self._beliefs, self._score = simulation.world, simulation.beliefs, simulation.score
        self.settings, self.robots, self.episodes = settings, settings.robots, simulation.episodes

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return an attribute of the world."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._world, name)

    @property
    def sensors(self) -> Mapping[str, NDArray[Any]]:
        """Measurements of the sensors, by name: ``scan``, ``odometry``, ``velocity``, ``bumper``."""
        return self._world.sensors

    @property
    def scan(self) -> NDArray[np.float32]:
        """Measured ranges [m], (rows, beams); inf for no return, nan if invalid."""
        return self._world.sensors["scan"]

    @property
    def bumper(self) -> NDArray[np.int8]:
        """Left, centre, right; 1 if pressed, (rows, 3)."""
        return self._world.sensors["bumper"]

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Speeds [m/s] and turn rates [rad/s] as the wheels measure, (rows, 2)."""
        return self._world.sensors["velocity"]

    @property
    def pose(self) -> NDArray[np.float64]:
        """Poses x, y [m], theta [rad] as the robots believe, each in its map frame, (rows, 3)."""
        pose = self._beliefs.believed.copy()
        if self._poses is not None:
            pose[:, :2] -= self._poses.offsets
        return pose

    @property
    def log_odds(self) -> list[NDArray[np.int8]]:
        """Maps of the robots, log-odds: 0 unknown, above 0 occupied, below free; one for each row."""
        return self._beliefs.log_odds

    @property
    def map_cell(self) -> NDArray[np.int64]:
        """Row and column of each robot's map in which it believes to be, (rows, 2)."""
        places = self._beliefs.believed[:, :2] - self._beliefs.origins
        return np.floor(places[:, ::-1] / self.settings.occupancy.resolution).astype(np.int64)

    @property
    def true_pose(self) -> NDArray[np.float64]:
        """True poses in the frame of the floor [m, rad], (rows, 3)."""
        return self._world.poses

    @property
    def true_velocity(self) -> NDArray[np.float64]:
        """True speeds [m/s] and turn rates [rad/s], (rows, 2)."""
        return self._world.velocities

    @property
    def contact(self) -> NDArray[np.uint8]:
        """Whether each body touches anything, (rows,)."""
        return self._world.contacts

    @property
    def travelled(self) -> NDArray[np.float64]:
        """Length of each robot's path [m], (rows,)."""
        return self._world.travelled

    @property
    def live(self) -> NDArray[np.bool_]:
        """Which robots have not ended, (rows,)."""
        return np.asarray((self._world.flags & ENDED) == 0)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which robots are dead, (rows,)."""
        return np.asarray(self._world.failed != 0)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Simulated time [s], (rows,)."""
        return np.repeat(np.maximum(self._world.steps, 0) * self.settings.time_step, self.robots)

    @property
    def coverage(self) -> NDArray[np.float64]:
        """True share of F that the team has seen, (rows,)."""
        return np.repeat(self._score.coverages(), self.robots)

    @property
    def seen_m2(self) -> NDArray[np.float64]:
        """Area of F that each robot has seen itself [m2], (rows,)."""
        return np.asarray(self._score.seen * self.settings.occupancy.resolution**2)

    @property
    def floor_m2(self) -> NDArray[np.float64]:
        """Area of F [m2], (rows,)."""
        return np.repeat(self._score.counted * self.settings.occupancy.resolution**2, self.robots)

    @property
    def is_covered(self) -> NDArray[np.bool_]:
        """Whether the team has seen ``stop_coverage`` of F, by default all of it, (rows,)."""
        wanted = self.settings.stop_coverage
        return np.asarray(self.coverage >= (1.0 if wanted is None else wanted))

    @property
    def teammates(self) -> NDArray[np.float64]:
        """Teammates as each robot knows them, (rows, robots - 1, 8); see ``KnownPoses.table``."""
        if self._poses is None:
            raise ValueError("teammates are known to observables only, not to rewards")
        return self._poses.table()


def check_finite(kind: str, name: str, values: NDArray[Any], rows: Rows) -> None:
    """Check that values of all rows, computed by a user's function, are finite numbers.

    Raises
    ------
    ValueError
        If one is not; it names the robot.
    """
    is_finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    if not is_finite.all():
        row = int(np.flatnonzero(~is_finite)[0])
        episode, robot = divmod(row, rows.robots)
        raise ValueError(
            f"{kind} {name!r} of robot_{robot}, episode {episode}, is {shown(values[row])}; want finite numbers"
        )
