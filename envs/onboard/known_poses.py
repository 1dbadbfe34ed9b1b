"""The poses that robots know: their own and those of their teammates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.radio.exchange import NEVER, Exchange
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.localization.localizer import Localizer


@dataclass(frozen=True, slots=True)
class Teammate:
    """State of a teammate as known to a robot.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta in the knowing robot's map frame [m, rad].
    age_s : float
        Age of this information [s].
    radius : float
        Radius of the body [m].
    has_ended : bool
        Whether it has ended and no longer moves.
    """

    pose: NDArray[np.float64]
    age_s: float
    radius: float
    has_ended: bool


class KnownPoses:
    """The believed poses of the robots of all episodes, in the frames of their maps.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the believed poses; row = episode * robots + robot.
    settings : ExplorationSettings
        The team of every episode.
    offsets : (rows, 2) float64
        Origin of each robot's map frame in the frame of its believed pose [m]; the environment's own array.
    exchanges : list of Exchange
        The radio traffic of each episode; none if the radio is ideal.

    Attributes
    ----------
    knows_teammates : bool
        Whether all teammates' poses are known at once.
    localizers : list of Localizer or None
        The localizer of each robot, by row; None if kernels localize.
    goals : list of tuple or None
        The goal of each episode in the frame of the floor (x, y) [m]; None without a goal.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        offsets: NDArray[np.float64],
        exchanges: list[Exchange],
    ) -> None:
        self._settings, self._offsets, self._exchanges = settings, offsets, exchanges
        self._world, self._beliefs, self._robots = simulation.world, simulation.beliefs, settings.robots
        # Without known starts no robot can locate another, whatever it hears.
        self._hears = settings.known_starts and settings.robots > 1 and not settings.radio.is_ideal
        self.knows_teammates = settings.known_starts and settings.radio.is_ideal
        self.localizers: list[Localizer | None] = [None] * (settings.robots * simulation.episodes)
        self.goals: list[tuple[float, float] | None] = [None] * simulation.episodes
        rows = settings.robots * simulation.episodes
        self._is_sent, self._targets = np.zeros(rows, np.bool_), np.zeros((rows, 2))

    @property
    def offsets(self) -> NDArray[np.float64]:
        """Origin of each robot's map frame in the frame of its believed pose [m], (rows, 2)."""
        return self._offsets

    def attach_targets(self, is_sent: NDArray[np.bool_], targets: NDArray[np.float64]) -> None:
        """Set the arrays with the targets of the robots.

        Parameters
        ----------
        is_sent : (rows,) bool
            Whether a robot has a target.
        targets : (rows, 2) float64
            The target in the robot's own map frame [m].
        """
        self._is_sent, self._targets = is_sent, targets

    def table(self) -> NDArray[np.float64]:
        """Return the known state of all robots' teammates, (rows, robots - 1, 8), in a new array.

        For each of the others in their order: x, y [m], theta [rad]; x, y of its target [m], and 1 if it is
        known; age of the pose [s], and 1 if that is known. Zeros if nothing is. All in the knowing robot's
        map frame. A target is known with a pose of this step.
        """
        robots, episodes = self._robots, len(self.goals)
        table = np.zeros((episodes, robots, robots, 8))
        teams, offsets = (episodes, robots, -1), self._offsets.reshape(episodes, robots, 1, 2)
        if self.knows_teammates:
            table[..., 0:3] = self._beliefs.believed.reshape(teams)[:, None]
            table[..., 7] = 1.0
        elif self._hears:
            for episode, exchange in enumerate(self._exchanges):
                is_known = exchange.heard_at != NEVER
                steps = int(self._world.steps[episode]) - exchange.heard_at
                table[episode, is_known, 0:3] = exchange.heard[is_known]
                table[episode, is_known, 6] = steps[is_known] * self._settings.time_step
                table[episode, is_known, 7] = 1.0
        is_now = (table[..., 7] > 0.0) & (table[..., 6] <= 0.0) & self._is_sent.reshape(episodes, 1, robots)
        targets = (self._targets + self._offsets).reshape(teams)[:, None]
        table[..., 3:5] = np.where(is_now[..., None], targets - offsets, 0.0)
        table[..., 5] = is_now
        table[..., 0:2] -= np.where(table[..., 7:] > 0.0, offsets, 0.0)
        others = ~np.eye(robots, dtype=np.bool_)
        return np.asarray(table[:, others].reshape(episodes * robots, robots - 1, 8))

    def offset(self, row: int) -> NDArray[np.float64]:
        """Return the origin of a robot's map frame [m], shape (2,).

        It is in the frame of the robot's believed pose.
        """
        return np.asarray(self._offsets[row])

    def pose_in_frame(self, of: int, to: int) -> NDArray[np.float64]:
        """Return the believed pose of a robot in a map frame, shape (3,).

        The frame is another robot's or its own.
        """
        x, y, theta = self._beliefs.believed[of]
        return np.array([x - self._offsets[to, 0], y - self._offsets[to, 1], theta])

    def origin_in_frame(self, row: int) -> tuple[float, float]:
        """Return the lower left corner of a robot's map in its map frame [m]."""
        x, y = self._beliefs.origins[row] - self._offsets[row]
        return float(x), float(y)

    def spread(self, row: int) -> NDArray[np.float64]:
        """Return the standard deviation of a robot's pose [m, m, rad], shape (3,).

        The robot's localizer reports it.
        """
        localizer = self.localizers[row]
        return np.zeros(3) if localizer is None else np.sqrt(np.maximum(np.diag(localizer.covariance), 0.0))

    def pose_known_to(self, row: int, other: int) -> NDArray[np.float64]:
        """Return the pose of a teammate as a robot knows it, shape (3,).

        It is in the frame of believed poses.
        """
        if self.knows_teammates:
            return np.asarray(self._beliefs.believed[other])
        return np.asarray(self._beliefs.heard[row].reshape(-1, 3)[other % self._robots])

    def teammates(self, row: int) -> dict[str, Teammate]:
        """Return the known state of a robot's teammates.

        With known starts and the ideal radio these are their current poses, otherwise the last reported ones.
        """
        if not self._settings.known_starts:
            return {}
        first = row // self._robots * self._robots
        if self._hears:
            return self._heard_teammates(row, first)
        return {
            agent: Teammate(
                self.pose_in_frame(other, row),
                0.0,
                self._settings.robot.radius,
                bool(self._world.flags[other] & ENDED),
            )
            for other, agent in enumerate(self._settings.agents, first)
            if other != row
        }

    def _heard_teammates(self, row: int, first: int) -> dict[str, Teammate]:
        """Return the state of the others as a robot heard it."""
        exchange, robot = self._exchanges[row // self._robots], row - first
        step, radius = int(self._world.steps[row // self._robots]), self._settings.robot.radius
        known = {}
        for teammate, agent in enumerate(self._settings.agents):
            if teammate != robot and exchange.heard_at[robot, teammate] != NEVER:
                x, y, theta = exchange.heard[robot, teammate]
                pose = np.array([x - self._offsets[row, 0], y - self._offsets[row, 1], theta])
                age_s = float(step - exchange.heard_at[robot, teammate]) * self._settings.time_step
                known[agent] = Teammate(pose, age_s, radius, bool(exchange.heard_ended[robot, teammate]))
        return known

    def goal_of(self, row: int) -> NDArray[np.float64] | None:
        """Return the goal in a robot's map frame.

        None without a goal, or if the robot does not know its start.
        """
        goal = self.goals[row // self._robots]
        if goal is None or not self._settings.known_starts:
            return None
        return np.asarray(goal - self._offsets[row])
