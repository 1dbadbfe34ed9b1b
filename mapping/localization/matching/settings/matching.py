"""Settings of matching scans with local maps, and of these maps."""

import math
from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Distance,
    Duration,
    FromZero,
    Length,
    Positive,
    Turn,
    above,
    check_settings,
    within,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchingSettings:
    """How scans are matched with the local map.

    Attributes
    ----------
    distance_m, angle : float
        A scan is matched after so much motion since the last one [m, rad].
    beam_interval_s : float
        Time between neighbouring beams; 0 for a scan taken at once [s].
    range_m : float
        Longest range that counts; a return beyond it says that the way there is free [m].
    spacing_m : float
        Returns that are nearer to each other than this count as one [m].
    points : int
        At most so many returns of a scan are matched.
    least_points : int
        With fewer returns than this (or an eighth of the beams, if that is less) a scan says nothing of the
        pose: they fit in many places.
    search_m, search_angle : float
        What the search around odometry reaches beyond its standard deviation [m, rad].
    search_deviations : float
        How many standard deviations of odometry the search reaches.
    blind_m, blind_angle : float
        What the search reaches where there is no odometry, or odometry leads nowhere [m, rad].
    wide_share : float
        A scan of fewer returns, as a share of the beams, is sought where odometry says it is and not beyond:
        it fits in many places.
    blind_overlap : float
        Share of the returns near what the local map has observed below which a match does not count where
        odometry led nowhere.
    evaluations : int
        At most so many placements, and blocks of them, are examined in such a search.
    explained_share : float
        Agreement of all returns, as a share of what matches have had of late, below which the search goes in
        all directions, and a match is doubtful.
    lost_evaluations : int
        The same of a search in all directions, where odometry explains too little of a scan.
    ambiguity : float
        A second place that agrees as well as this share of the best refutes what such a search finds.
    apart_m, apart_angle : float
        By how much two such places differ [m, rad].
    independent_points, independent_share : float
        As how many independent measurements the returns of a scan count, all of them at most and each:
        neighbouring ones err together.
    deviation : float
        Standard deviation of how far a return is from full agreement with the map, which is 1.
    surface_m : float
        Returns of a surface so near to one give its direction there, across which the return is moved; 0
        for the nearest two [m].
    unseen : float
        Square of the disagreement with which a return counts that lies in what the local map has not
        observed.
    least_score, least_overlap : float
        Agreement, and share of the returns near what the local map has observed, below which a match does not
        count.
    least_share : float
        The same for agreement as a share of what matches have had of late.
    most_contradiction : float
        Share of the returns in free space of the local map above which a match does not count.
    convincing_share : float
        Agreement, as a share of what matches have had of late, below which the search goes farther than
        odometry says.
    better_by : float
        By how much more a match that is found there has to agree.
    wide_after : int
        After so many scans in a row that do not match, the search goes as far as where there is no odometry.
    lost_after : int
        After so many scans in a row that do not match, a new local map is begun.
    lost_m, lost_angle : float
        Standard deviation of the motion into such a new local map [m, rad].
    """

    distance_m: Distance = 0.1
    angle: Turn = math.radians(5.0)
    beam_interval_s: Duration = 0.0
    range_m: Length = 20.0
    spacing_m: Annotated[float, within(1e-4, 100.0)] = 0.05
    points: Count = 350
    least_points: Count = 15
    search_m: Annotated[float, within(0.0, 50.0)] = 0.05
    search_angle: Turn = math.radians(1.0)
    search_deviations: Positive = 2.0
    blind_m: Annotated[float, above(0.0, 50.0)] = 1.2
    blind_angle: Angle = math.radians(50.0)
    wide_share: Positive = 0.08
    blind_overlap: Positive = 0.7
    evaluations: Count = 100_000
    explained_share: Positive = 0.35
    lost_evaluations: Count = 400_000
    ambiguity: Positive = 0.9
    apart_m: Length = 0.5
    apart_angle: Angle = math.radians(15.0)
    independent_points: Positive = 50.0
    independent_share: Positive = 0.15
    deviation: Positive = 0.2
    surface_m: Distance = 0.25
    unseen: FromZero = 0.3
    least_score: Positive = 0.15
    least_share: Positive = 0.5
    least_overlap: Positive = 0.2
    most_contradiction: Positive = 0.25
    convincing_share: Positive = 0.75
    better_by: Positive = 0.1
    wide_after: Count = 3
    lost_after: Count = 8
    lost_m: Length = 2.0
    lost_angle: Angle = 0.5

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)

    def weight(self, points: int) -> float:
        """Return how much full disagreement of all of so many points counts."""
        return min(self.independent_points, self.independent_share * points) / self.deviation**2


@dataclass(frozen=True, slots=True, kw_only=True)
class SubmapSettings:
    """Settings of local maps.

    Each scan enters two local maps that overlap by half, and is matched with the older one.

    Attributes
    ----------
    resolution : float
        Side of a cell [m].
    behind_m, behind_share : float
        As far behind the end of a beam, at least and as a share of its range, walls that other scans saw
        count as seen through [m, 1]; twice to three times the standard deviation of a range is right. A share
        of 0 does without.
    path_m : float
        Way driven, turns counted with a metre a radian, after which a local map is finished [m].
    least_scans : int
        A local map holds at least so many scans.
    """

    resolution: Annotated[float, within(1e-3, 10.0)] = 0.035
    behind_m: Distance = 0.025
    behind_share: FromZero = 0.025
    path_m: Positive = 16.0
    least_scans: Count = 10

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)
