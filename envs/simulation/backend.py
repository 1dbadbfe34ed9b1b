"""The interface of worlds: a world moves the bodies of robots and senses for them.

Maps are not its business, nor is the score: it has bodies, sensors, and the truth. Row = episode * robots +
robot in all arrays over rows, which keep their place in memory for the life of a world.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.floor_cache import FloorTables


class World(Protocol):
    """Bodies and sensors of all episodes.

    Attributes
    ----------
    robots, episodes : int
        Size of a team, and number of episodes.
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot of a team.
    floors : list of FloorTables or None
        The floor of each episode.
    seeds, steps : (episodes,) uint64, (episodes,) int64
        Seeds of the noise, and the next step; -1 before the scan at the start.
    starts, poses, velocities : (rows, 3), (rows, 3), (rows, 2) float64
        True poses at the start and now [m, rad], true speeds and turn rates [m/s, rad/s].
    moves, flags, failed : (rows,) uint8, (rows,) int64, (rows,) uint8
        Whether a robot drives; its flags (``kernels.arrays``); whether it is dead (1), or the physics of its
        episode are broken (2).
    contacts, travelled, collisions : (rows,) uint8, float64, int64
        Whether a body touched anything in the last step, length of its path [m], how often it came into
        contact.
    faults : (rows, numbers) float64
        Faults of each robot (``disturbances.faults``).
    true_ranges : (rows, beams) float32
        The last scans without noise [m]; inf for no return, nan for an invalid beam.
    sensors : mapping of str to array over rows
        Measurements of the last step, by sensor name: ``scan`` (rows, beams) float32 [m], ``odometry``
        (rows, 3) float64 [m, rad], ``velocity`` (rows, 2) float64 [m/s, rad/s], ``bumper`` (rows, 3) int8.
    """

    robots: int
    episodes: int
    bodies: NDArray[np.float64]
    floors: list[FloorTables | None]
    seeds: NDArray[np.uint64]
    steps: NDArray[np.int64]
    starts: NDArray[np.float64]
    poses: NDArray[np.float64]
    velocities: NDArray[np.float64]
    moves: NDArray[np.uint8]
    flags: NDArray[np.int64]
    failed: NDArray[np.uint8]
    contacts: NDArray[np.uint8]
    travelled: NDArray[np.float64]
    collisions: NDArray[np.int64]
    faults: NDArray[np.float64]
    true_ranges: NDArray[np.float32]

    @property
    def attitudes(self) -> NDArray[np.float64]:
        """Height of the bases above the ground, roll and pitch, (rows, 3) [m, rad]; 0 in a plane world."""
        ...

    @property
    def sensors(self) -> Mapping[str, NDArray[Any]]:
        """Measurements of the last step, by sensor name."""
        ...

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        free: NDArray[np.bool_],
        seed: int,
    ) -> None:
        """Start an episode with robots at rest.

        Parameters
        ----------
        starts : (robots, 3) float64
            x, y, theta of each robot, headings in (-pi, pi] [m, rad].
        free : (rows, columns) bool
            Cells of the floor's raster that robots can reach.
        """
        ...

    def move_and_sense(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Drive the robots for one time step, then take their scans.

        Robots that have ended do not move or sense. ``steps`` is left alone: the simulation counts.

        Parameters
        ----------
        commands : (rows, 2) float64
            Wanted speed and turn rate [m/s, rad/s].
        runs : (episodes,) bool or None
            Which episodes take the step; all by default.
        """
        ...

    def show(self) -> bool:
        """Show the bodies in a window of the world's own; returns False without a window."""
        ...

    def close(self) -> None:
        """Release everything that is not an array; further calls do nothing, and ``place`` opens anew."""
        ...
