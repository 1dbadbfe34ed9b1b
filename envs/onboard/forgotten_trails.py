"""The trails of other robots, along which a robot forgets the walls of its map."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.planning.footprint import MARGIN_M, passed

STALE = -2
"""Instead of the step at which the maps of a team were last brought up to date: they are not any more."""


class ForgottenTrails:
    """The trails that the robots of all episodes have received, by row.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the maps; row = episode * robots + robot.
    settings : ExplorationSettings
        The team of every episode.
    poses : KnownPoses
        Origins of the robots' map frames.
    fresh_at : (episodes,) int64
        Step at which the maps of each team were last brought up to date; ``STALE`` if walls are forgotten.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        poses: KnownPoses,
        fresh_at: NDArray[np.int64],
    ) -> None:
        self._world, self._beliefs, self._settings = simulation.world, simulation.beliefs, settings
        self._poses, self._fresh_at = poses, fresh_at
        self._trails: list[list[NDArray[np.float64]]] = [[] for _ in range(settings.robots * simulation.episodes)]

    def start(self, rows: range) -> None:
        """Begin the episode of some rows: their robots have received no trails."""
        for row in rows:
            self._trails[row] = []

    def forget_walls(self, row: int, trail: NDArray[np.float64]) -> None:
        """Let a robot forget the walls along a trail.

        They may be images of the robot that drove there. The robot senses the place for itself.

        Parameters
        ----------
        trail : (N, 2) float64
            Trail of the other robot, in the map frame of this one [m]; cells that may show it at its last position
            are kept.
        """
        if trail.ndim != 2 or trail.shape[1] != 2 or not len(trail) or not np.isfinite(trail).all():
            raise ValueError(
                f"the trail has shape {trail.shape} and may not be finite; want places (N, 2) in metres, at least one"
            )
        self._trails[row].append(trail)
        self._forget(row, trail)

    def forget_again(self, row: int) -> None:
        """Forget the walls again along all trails that a robot has received.

        This is done after its map was rendered again.
        """
        for trail in self._trails[row]:
            self._forget(row, trail)

    def _forget(self, row: int, trail: NDArray[np.float64]) -> None:
        resolution, radius = self._settings.occupancy.resolution, float(self._world.bodies[:, 0].max())
        origin, whole = np.array(self._poses.origin_in_frame(row)), self._beliefs.log_odds[row]
        reach = radius + MARGIN_M + resolution
        low = np.clip(
            np.floor((trail.min(axis=0) - reach - origin) / resolution).astype(np.int64), 0, whole.shape[::-1]
        )
        high = np.clip(
            np.ceil((trail.max(axis=0) + reach - origin) / resolution).astype(np.int64),
            low,
            whole.shape[::-1],
        )
        (left, bottom), (right, top) = low.tolist(), high.tolist()
        part = whole[bottom:top, left:right]
        x, y = (origin + low * resolution).tolist()
        self._beliefs.forget(row, passed(part.shape, (x, y), trail, radius, resolution) & (part > 0), (bottom, left))
        self._fresh_at[row // self._settings.robots] = STALE
