"""What a robot that explores by its depth camera is at, and whether it gets on with it."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.sparse_views import discs_around
from lidarium.envs.onboard.radio.messages import DriveState, Route
from lidarium.mapping.sparse.exploring.views import View

PATIENCE_S = 20.0
"""Time without motion after which a robot gives up what it wants to see [s]."""

STUCK_S, BLOCKED_S = 10.0, 3.0
"""Time without motion, or of a blocked path, after which something unknown is taken to stand there [s]."""

MOVED_M, TURNED = 0.1, 0.2
"""What counts as having moved [m, rad]."""

CLAIMED_M = 1.0
"""What is so near to what a robot is about to see is left to it [m]."""

OBSTACLE_S, OBSTACLE_M = 30.0, 0.1
"""How long, and how far to each side, something unknown is taken to stand there [s, m]."""


@dataclass(slots=True)
class Work:
    """What a robot is at.

    Attributes
    ----------
    view, route : View, Route or None
        What it is about to see, and how it comes there.
    is_last : bool
        Whether it only comes as near as it can, where it cannot come to see.
    corrections : int
        How often its past had been corrected when the route was planned.
    moved_s, pose : float, (3,) float64
        When it last moved, and where it was then [s, m, rad].
    blocked_s : float
        Since when its path is blocked [s]; inf where it is not.
    waits : bool
        Whether something to see is out of reach only for now, or more is still to be tried.
    ignored : list of (3,) float64
        Unknown ground that it has given up: x, y and radius of discs [m].
    obstacles : list of (float, (2,) float64)
        Where something is taken to stand, and until when [s, m].
    """

    view: View | None = None
    route: Route | None = None
    is_last: bool = False
    corrections: int = 0
    moved_s: float = 0.0
    pose: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    blocked_s: float = math.inf
    waits: bool = False
    ignored: list[NDArray[np.float64]] = field(default_factory=list)
    obstacles: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)

    @property
    def claimed(self) -> NDArray[np.float64]:
        """What it is about to see, as discs (N, 3) [m]."""
        return np.empty((0, 3)) if self.view is None else discs_around(self.view.points, CLAIMED_M)

    def begin(self, view: View, now: float, pose: NDArray[np.float64]) -> None:
        """Begin with a view, at a time [s] and x, y, theta (3,) [m, rad]."""
        self.view, self.moved_s, self.pose = view, now, pose

    def drop(self) -> None:
        """Leave the view alone."""
        self.view = self.route = None

    def watch(self, now: float, pose: NDArray[np.float64], state: DriveState) -> None:
        """Take in where the robot is now, and what its driving is about."""
        turned = abs(math.remainder(float(pose[2] - self.pose[2]), 2.0 * math.pi))
        has_moved = math.dist(pose[:2], self.pose[:2]) > MOVED_M or turned > TURNED
        if has_moved or state is DriveState.GIVING_WAY:
            self.moved_s, self.pose = now, pose
        self.blocked_s = min(self.blocked_s, now) if state is DriveState.BLOCKED else math.inf

    def is_in_vain(self, now: float) -> bool:
        """Whether the robot has not moved for too long."""
        return now - self.moved_s > PATIENCE_S

    def is_stuck(self, now: float) -> bool:
        """Whether something unknown must stand in the way."""
        return now - min(self.blocked_s, now) > BLOCKED_S or now - self.moved_s > STUCK_S

    def take_to_stand(self, place: NDArray[np.float64], now: float) -> None:
        """Take something unknown to stand at a place (2,) [m] for a while."""
        self.obstacles.append((now + OBSTACLE_S, place))
        self.blocked_s = math.inf

    def obstacles_at(self, now: float) -> NDArray[np.float64]:
        """Return where something is still taken to stand, (N, 2) [m]."""
        self.obstacles = [entry for entry in self.obstacles if entry[0] > now]
        return np.array([place for _, place in self.obstacles]).reshape(-1, 2)
