"""Values of views to robots that explore by depth cameras, and the borders that are left to them."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.belief import Belief
from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.mapping.sparse.exploring.views import Sight

FACING = 0.14
"""A robot that has arrived faces what it wants to see to within this angle [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewSettings:
    """How robots choose their views.

    Attributes
    ----------
    minimum_size : float, default 0.3
        Shorter borders of unknown ground are no frontiers [m].
    gain : float, default 0.3
        Length of path that a square metre of unknown ground in view is worth [m/m2].
    most_m2 : float, default 4.0
        Unknown ground in view of which more is worth nothing [m2].
    near_share : float, default 0.6
        Up to which share of the range within which it sees the ground a robot comes near to a frontier.
    """

    minimum_size: Annotated[float, above(0.0, 1000.0)] = 0.3
    gain: Annotated[float, within(0.0, 1000.0)] = 0.3
    most_m2: Annotated[float, above(0.0, 1e6)] = 4.0
    near_share: Annotated[float, share(has_minimum=False)] = 0.6

    def __post_init__(self) -> None:
        check_settings(self, "views")

    def sight_of(self, belief: Belief) -> Sight:
        """Return how a robot sees, and the values of views to it."""
        camera, robot = belief.sparse_map.camera, belief.robot
        # Towards its sides a camera sees the ground only from a little farther on.
        nearest = min(camera.nearest_m / math.cos(camera.half_angle), camera.farthest_m)
        return Sight(
            nearest=nearest,
            near=nearest + self.near_share * (camera.farthest_m - nearest),
            farthest=camera.farthest_m,
            half_angle=max(camera.half_angle - FACING, 0.5 * camera.half_angle),
            bearing=camera.bearing,
            low=camera.highest_m,
            height=camera.height_m,
            turn_cost=robot.cruise_speed / robot.max_turn_rate,
            gain=self.gain,
            most_m2=self.most_m2,
            least_m=self.minimum_size,
        )


def discs_around(points: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return discs x, y, radius (N, 3) around points (N, 2) [m]."""
    return np.column_stack([points, np.full(len(points), radius)])


def _are_within(points: NDArray[np.float64], discs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (N, 2) lie in one of discs (M, 3) [m], (N,) bool."""
    gaps = np.hypot(*(points[:, None] - discs[None, :, :2]).transpose(2, 0, 1))
    return np.asarray((gaps <= discs[:, 2]).any(axis=1))


def apart_from(borders: list[NDArray[np.float64]], discs: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return borders (N, 2) outside all discs (M, 3) [m]."""
    left = [border[~_are_within(border, discs)] for border in borders]
    return [border for border in left if len(border)]


def joined(borders: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the points of all borders, (N, 2) [m]."""
    return np.concatenate([np.empty((0, 2)), *borders])
