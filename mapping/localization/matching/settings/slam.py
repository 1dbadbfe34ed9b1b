"""All settings of localization in one place."""

from dataclasses import dataclass, field

from lidarium.mapping.geometry.bounds import check_settings
from lidarium.mapping.localization.matching.settings.graph import (
    ClosureSettings,
    CompassSettings,
    GraphSettings,
)
from lidarium.mapping.localization.matching.settings.matching import MatchingSettings, SubmapSettings
from lidarium.mapping.localization.matching.settings.odometry import OdometryUncertainty

MOST_REACH_M = 200.0
"""No laser of a local map reaches farther [m]."""

MOST_SUBMAP_CELLS = 8192
"""Most cells of a local map to each side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlamSettings:
    """How a robot finds its pose and map at the same time.

    Attributes
    ----------
    uses_odometry : bool
        False where there is none: motion is then predicted to go on as before.
    uses_walls : bool
        Whether the directions of walls keep headings from drifting.
    odometry, matching, submaps, closures, graph, compass
        Settings of each stage.
    """

    uses_odometry: bool = True
    uses_walls: bool = True
    odometry: OdometryUncertainty = field(default_factory=OdometryUncertainty)
    matching: MatchingSettings = field(default_factory=MatchingSettings)
    submaps: SubmapSettings = field(default_factory=SubmapSettings)
    closures: ClosureSettings = field(default_factory=ClosureSettings)
    graph: GraphSettings = field(default_factory=GraphSettings)
    compass: CompassSettings = field(default_factory=CompassSettings)

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)
        reach = min(self.matching.range_m, MOST_REACH_M) + 2.0 * self.submaps.path_m
        if reach > MOST_SUBMAP_CELLS * self.submaps.resolution:
            raise ValueError(
                f"a local map of {reach:g} m (matching.range_m and twice submaps.path_m) in cells of "
                f"{self.submaps.resolution:g} m is too large; want at most {MOST_SUBMAP_CELLS:,} cells to "
                "each side: a coarser submaps.resolution or a shorter submaps.path_m"
            )
