"""Map of a robot from its depth camera; queries use the robot's own map frame."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.sparse.exploring.ground import GroundCamera
from lidarium.mapping.sparse.exploring.navigation import PlannedRoute, SparseNavigation, on_ground
from lidarium.mapping.sparse.exploring.views import Sight, View


@dataclass(frozen=True, eq=False, slots=True)
class SparseBelief:
    """A sparse map with its graph and the ground that was seen, ready to be planned on.

    All positions are x, y in the map frame of the robot [m].

    Attributes
    ----------
    navigation : SparseNavigation
        The map, along axes of its own.
    frame : Transform
        Maps places of these axes into the map frame.
    camera : GroundCamera
        The camera by which it was made.
    corrections : int
        Number of corrections of the past trajectory, and of the map with it.
    """

    navigation: SparseNavigation
    frame: Transform
    camera: GroundCamera
    corrections: int

    @property
    def cell_m(self) -> float:
        """Side of the cells of seen ground [m]."""
        return self.navigation.ground.cell_m

    @property
    def seen_m2(self) -> float:
        """Area of the ground that was seen [m2]."""
        return self.navigation.ground.seen_m2

    @property
    def has_moved(self) -> bool:
        """Whether the robot has left the start of its map."""
        return len(self.navigation.trail) > 1

    def amid(self, places: NDArray[np.float64], half: float, height: float) -> "SparseBelief":
        """Return a copy with boxes around temporary obstacles at positions (B, 2).

        They reach ``half`` to each side, and up to ``height`` [m].
        """
        if len(places) == 0:
            return self
        own = on_ground(self._own(places))
        reach = np.array([half, half, 0.0])
        boxes = np.stack([own - reach, own + reach + (0.0, 0.0, height)], axis=1)
        return replace(self, navigation=self.navigation.amid(boxes))

    def hopeful(self, goal: NDArray[np.float64]) -> "SparseBelief":
        """Return a copy in which unknown ground, up to that around a goal (2,), counts as free."""
        return replace(self, navigation=self.navigation.hopeful(self._own(goal)))

    def route(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> PlannedRoute:
        """Plan a route from a place (2,) to another; its points are (P, 2)."""
        found = self.navigation.route(self._own(start), self._own(goal))
        return replace(found, points=self.frame.apply(found.points[:, :2]))

    def is_free(self, points: NDArray[np.float64]) -> bool:
        """Whether a route (P, 2) can be driven."""
        return self.navigation.is_free(self._own(points))

    def nearest_standing(self, place: NDArray[np.float64], within_m: float) -> NDArray[np.float64] | None:
        """Return the node nearest to a position (2,) within a distance [m], (2,); None if no node is."""
        node = self.navigation.nearest_standing(self._own(place), within_m)
        return None if node is None else self.frame.apply(node)

    def unknown_ground(self, least_m: float) -> list[NDArray[np.float64]]:
        """Return the borders of unknown ground of at least a length [m], as points (N, 2) each."""
        clusters, ground = self.navigation.unknown_ground(least_m), self.navigation.ground
        return [self.frame.apply(ground.centres(clusters.of(k))) for k in range(len(clusters))]

    def unknown_samples(self) -> NDArray[np.float64]:
        """Return samples of all unknown ground, (S, 2)."""
        return self.frame.apply(self.navigation.unknown_samples())

    def are_unknown(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (N, 2) lie on unknown ground, (N,) bool."""
        return self.navigation.ground.are_unknown(self._own(points))

    def best_view(self, pose: NDArray[np.float64], frontier: NDArray[np.float64], sight: Sight) -> View | None:
        """Return the best view of unknown ground (F, 2), for a robot at x, y, theta (3,).

        Its position is (2,) and the points it shows (K, 2); None if the robot cannot reach a sufficient view.
        """
        view = self.navigation.best_view(self._own_pose(pose), self._own(frontier), sight)
        return None if view is None else self._out(view)

    def nearest_view(self, pose: NDArray[np.float64], points: NDArray[np.float64], sight: Sight) -> View:
        """Return the view towards points (F, 2) from as near as a robot at x, y, theta (3,) can come."""
        return self._out(self.navigation.nearest_view(self._own_pose(pose), self._own(points), sight))

    def are_cut_off(self, pose: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (N, 2) a robot at x, y, theta (3,) could stand next to but cannot reach."""
        return self.navigation.are_cut_off(self._own_pose(pose), self._own(points))

    def _out(self, view: View) -> View:
        return replace(
            view,
            place=self.frame.apply(view.place[:2]),
            heading=view.heading + self.frame.theta,
            points=self.frame.apply(view.points[:, :2]),
        )

    def _own_pose(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([*self._own(pose[:2]), pose[2] - self.frame.theta])

    def _own(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.frame.inverse().apply(points)
