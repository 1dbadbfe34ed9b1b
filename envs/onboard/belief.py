"""Read-only access of a policy to the belief of one robot."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.safety_stop import yielding_speed
from lidarium.envs.onboard.known_poses import Teammate
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.mapping.prediction.levels import factor_of, levels_of
from lidarium.mapping.prediction.predictors import PartialMap, make_predictor, predicted


class Belief:
    """Read-only handle on the belief of one robot.

    Its values are valid until the next step.

    All positions are in the robot's map frame: with known starts the floor's axes from the corner of its
    start cell.

    Parameters
    ----------
    perception : Perception
        The team's onboard software.
    row : int
        Which robot: episode * robots + robot.
    """

    def __init__(self, perception: Perception, row: int) -> None:
        self._perception, self._row = perception, row

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, theta as the localizer believes [m, rad], shape (3,)."""
        return self._perception.poses.pose_in_frame(self._row, self._row)

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Speed and turn rate as odometry measures them [m/s, rad/s], shape (2,)."""
        return np.array(self._perception.simulation.measured[self._row])

    @property
    def spread(self) -> NDArray[np.float64]:
        """Estimated standard deviation of the pose [m, m, rad], shape (3,).

        0 if it claims to know.
        """
        return self._perception.poses.spread(self._row)

    @property
    def radius(self) -> float:
        """Radius of the own body [m]."""
        return self._perception.settings.robot.radius

    @property
    def robot(self) -> Robot:
        """The own body and drive."""
        return self._perception.settings.robot

    @property
    def lidar(self) -> Lidar:
        """The own laser."""
        lidars = self._perception.settings.team_lidars
        return lidars[self._row % len(lidars)]

    @property
    def map(self) -> NavigationMap:
        """The own map."""
        return self._perception.own_map(self._row)

    @property
    def map_origin(self) -> tuple[float, float]:
        """Lower left corner of cell (0, 0) of the own and shared map [m].

        It is in the map frame.
        """
        return self._perception.poses.origin_in_frame(self._row)

    @property
    def frame(self) -> NDArray[np.float64]:
        """Origin of the map frame on the floor [m], shape (2,); zeros with unknown starts."""
        return np.array(self._perception.poses.offset(self._row))

    @property
    def shared_map(self) -> NavigationMap | None:
        """The team's map, if it reached this robot.

        With unknown starts None until the robot is sent the knowledge of others.
        """
        return self._perception.shared_map(self._row)

    @property
    def predicted_map(self) -> NDArray[np.float32]:
        """Probability that each square of the own map is free, by the network of the package, (rows, columns).

        Squares of 0.2 m begin at ``map_origin``; 1 and 0 where the map is known. It takes 12 ms for each 32 x 32 m.
        """
        navigation, self._perception.predicts = self.map, True
        factor = factor_of(navigation.resolution)
        side = factor * navigation.resolution
        found = predicted(make_predictor("network"), PartialMap(levels_of(navigation.log_odds, factor), side))
        assert found is not None
        return found

    @property
    def sparse_map(self) -> SparseBelief:
        """The own sparse map, ready to be planned on; it is made from when it is first asked for."""
        return self._perception.sparse_maps.belief(self._row, shares_map=False)

    @property
    def shared_sparse_map(self) -> SparseBelief:
        """The own sparse map and those of others as they have reached this robot; all robots make maps from now on.

        With known starts the radio brings them; with unknown starts they come when the maps of robots are joined.
        """
        return self._perception.sparse_maps.belief(self._row)

    @property
    def teammates(self) -> dict[str, Teammate]:
        """The known state of the teammates, by name."""
        return self._perception.poses.teammates(self._row)

    @property
    def energy_left_j(self) -> float | None:
        """The energy left in the battery [J]; None if it has no limit."""
        meters = self._perception.meters
        return None if meters is None else meters.left_j(self._row)

    def yielding(self, speed: float) -> float:
        """Return the share of a speed [m/s] at which to drive near the people in sight; 1 without any.

        The time that it costs counts as lost by yielding. Robots that drive to targets yield by themselves.
        """
        safety = self._perception.simulation.safety[self._row]
        return float(yielding_speed(safety, speed, speed)) / speed if speed else 1.0

    @property
    def goal(self) -> NDArray[np.float64] | None:
        """The goal in the map frame [m], shape (2,), or None."""
        return self._perception.poses.goal_of(self._row)
