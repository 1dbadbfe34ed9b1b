"""All settings of localization in one place."""

from dataclasses import dataclass, field

from lidarium.mapping.localization.matching.settings.graph import (
    ClosureSettings,
    CompassSettings,
    GraphSettings,
)
from lidarium.mapping.localization.matching.settings.matching import MatchingSettings, SubmapSettings
from lidarium.mapping.localization.matching.settings.odometry import OdometryUncertainty


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
