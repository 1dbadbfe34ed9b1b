"""The depth cameras of a world, image by image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.faces import Faces
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.depth.frames import (
    Cameras,
    take_frames_parallel,
    take_frames_serial,
    view_numbers,
)
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.mapping.kernels.compilation import use_threads


class DepthSensor:
    """One depth camera on each robot of a world of any kind; row = episode * robots + robot.

    Parameters
    ----------
    world : World
        The world with the robots; their poses and attitudes are read when an image is taken.
    camera : DepthCamera
        The camera of every robot.
    time_step : float
        Length of a step [s].
    threads : int
        Threads that take images; the images do not depend on it.

    Attributes
    ----------
    camera : DepthCamera
        The camera of every robot.
    frames : (rows, image rows, image columns) float32
        The last image of each robot [m]; 0 if nothing was measured.
    taken_at : (rows,) int64
        Step of its episode in which each image was taken, -1 before the first.
    """

    def __init__(self, world: World, camera: DepthCamera, time_step: float, threads: int = 1) -> None:
        rows = world.robots * world.episodes
        self.camera, self.frames = camera, np.zeros((rows, camera.rows, camera.columns), np.float32)
        self.taken_at: NDArray[np.int64] = np.full(rows, -1)
        self._world, self._threads, self._period = world, threads, camera.period_steps(time_step)
        population = getattr(world, "population", None)
        self._crowd = () if population is None else (population.walkers, population.doors)
        self._faces: list[Faces | None] = [None] * world.episodes
        self._face_rows = np.zeros((world.episodes, 4), np.int64)
        noise = np.array([camera.noise_floor, camera.noise_share, camera.disparity_step])
        self._numbers = view_numbers(camera), camera.mount, noise

    def place(self, episode: int, floor: FloorTables) -> None:
        """Start an episode on a floor."""
        robots = self._world.robots
        self._faces[episode] = floor.faces
        self._point_at(episode)
        rows = slice(episode * robots, (episode + 1) * robots)
        self.frames[rows], self.taken_at[rows] = 0.0, -1

    def take(self, steps: NDArray[np.int64], runs: NDArray[np.bool_] | None = None) -> None:
        """Take the images that are due.

        Parameters
        ----------
        steps : (episodes,) int64
            The step that was taken; -1 for the start.
        runs : (episodes,) bool or None
            Which episodes took a step; all by default.
        """
        world = self._world
        is_due = (steps + 1) % self._period == 0
        if runs is not None:
            is_due &= runs
        takes = np.repeat(is_due, world.robots) & (world.flags & ENDED == 0)
        if not takes.any():
            return
        cameras = Cameras(
            world.poses,
            world.attitudes,
            world.bodies,
            self._face_rows,
            *self._numbers,
            world.seeds,
            steps,
            GAUSSIAN_TABLE,
            *self._crowd,
        )
        threads = use_threads(self._threads) if np.count_nonzero(takes) > 1 else 1
        take_frames = take_frames_parallel if threads > 1 else take_frames_serial
        take_frames(cameras, world.robots, takes, self.frames)
        self.taken_at[takes] = (np.repeat(steps, world.robots) + 1)[takes]

    def _point_at(self, episode: int) -> None:
        """Store the addresses of the faces of an episode, for kernels."""
        faces = self._faces[episode]
        if faces is not None:
            arrays = (faces.corners, faces.planes, faces.spheres)
            self._face_rows[episode] = (*(array.ctypes.data for array in arrays), len(faces))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for episode in range(len(self._faces)):
            self._point_at(episode)
