"""How tours past frontiers are planned."""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.mapping.planning.frontiers.views import ViewRules
from lidarium.mapping.planning.touring.tours import TourWeights

Length = Annotated[float, within(0.0, 1000.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TourSettings:
    """How tours past frontiers are planned.

    Attributes
    ----------
    minimum_size : float
        Shorter frontiers are visited only when no others are left [m].
    least_gain : float
        So are those that show less than this [m2].
    most : int
        Tours pass so many frontiers at most: each robot in turn takes its nearest.
    kept_share : float
        A robot goes on to a frontier until less than this share of what it would show is left.
    kept : float
        What a robot drives to is left only for tours that are shorter by this [m].
    turn_length : float
        Length of path that a radian of turning costs at the start [m/rad].
    total, waiting : float
        Weight of the sum of all tours against the longest one, and of how long a square metre waits to be
        seen [1, 1/m2].
    around, spacing : float
        Views lie within the first of their frontiers, and the second apart [m].
    reach, depth : float
        Unknown space counts up to the first from a view, and up to the second behind what is known [m].
    view_share : float
        The view with the shortest path is taken among those that show this share of the best.
    """

    minimum_size: Length = 0.3
    least_gain: Annotated[float, within(0.0, 1e6)] = 0.4
    most: Annotated[int, within(1, 200)] = 30
    kept_share: Annotated[float, share()] = 0.15
    kept: Length = 1.0
    turn_length: Length = 0.25
    total: Annotated[float, within(0.0, 1e3)] = 0.1
    waiting: Annotated[float, within(0.0, 1e3)] = 0.05
    around: Annotated[float, above(0.0, 10.0)] = 1.0
    spacing: Annotated[float, above(0.0, 10.0)] = 0.3
    reach: Annotated[float, above(0.0, 30.0)] = 3.0
    depth: Annotated[float, above(0.0, 30.0)] = 1.5
    view_share: Annotated[float, share()] = 0.7

    def __post_init__(self) -> None:
        check_settings(self, "tours")

    def rules(self, range_max: float) -> ViewRules:
        """Return how views are measured by a laser that sees so far [m]."""
        return ViewRules(self.around, self.spacing, min(self.reach, range_max), self.depth, self.view_share)

    @property
    def weights(self) -> TourWeights:
        """What the tours of a team are weighed by."""
        return TourWeights(1.0, self.total, self.waiting)
