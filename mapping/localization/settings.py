"""All settings of localization in one place."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    Distance,
    Duration,
    FromZero,
    Length,
    Positive,
    Turn,
    above,
    check_settings,
    share,
    within,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryUncertainty:
    """By how much dead reckoning may err, in standard deviations.

    Attributes
    ----------
    distance_share : float
        Of a distance along and across it [m/m].
    turn_share : float
        Of a turn [rad/rad].
    turn_per_metre : float
        Of the heading over a distance [rad/m].
    distance_floor, turn_floor : float
        Of any motion at all [m, rad].
    distance_noise, turn_noise, turn_noise_of_distance : float
        Errors that differ each time, so that they cannot be learned: of a distance from its
        root, of a turn from its root, and of a turn from the root of the distance [m^(1/2), rad^(1/2),
        rad/m^(1/2)].
    fading : float
        Share of what it has learned of its wheels that a robot forgets in each metre or radian: tyres lose
        air, and floors differ.
    most_deviations : float
        Maximum correction of odometry, in the standard deviations above.
    """

    distance_share: Positive = 0.1
    turn_share: Positive = 0.1
    turn_per_metre: Positive = 0.05
    distance_floor: Positive = 0.005
    turn_floor: Positive = 0.002
    distance_noise: Positive = 0.03
    turn_noise: Positive = 0.04
    turn_noise_of_distance: Positive = 0.03
    fading: Annotated[float, share(has_maximum=False)] = 0.0005
    most_deviations: FromZero = 2.0

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)

    def covariance(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of a motion of a given size.

        In the frame in which the motion began [m, rad].
        """
        along = (self.distance_share * distance + self.distance_floor) ** 2
        heading = (self.turn_share * abs(turn) + self.turn_per_metre * distance + self.turn_floor) ** 2
        return np.diag([along, along, heading])

    def noise(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the random errors of a motion [m, rad].

        Random errors differ each time, for motions of the same size.
        """
        along = self.distance_noise**2 * abs(distance) + self.distance_floor**2
        heading = self.turn_noise**2 * abs(turn) + self.turn_noise_of_distance**2 * abs(distance) + self.turn_floor**2
        return np.diag([along, along, heading])


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchingSettings:
    """How scans are matched with the local map.

    Attributes
    ----------
    distance_m, angle : float
        A scan is matched after so much motion since the last one [m, rad].
    beam_interval_s : float, default 0.0
        Time between neighbouring beams; 0 for a scan taken at once [s].
    range_m : float, default 20.0
        Longest range that counts; beams with a return beyond it are free up to it [m].
    spacing_m : float, default 0.05
        Returns that are nearer to each other than this count as one [m].
    points : int, default 350
        Maximum number of matched returns of a scan.
    least_points : int, default 15
        With fewer returns than this (or an eighth of the beams, if that is less) a scan does not measure the
        pose: they fit in many places.
    search_m, search_angle : float
        Reach of the search around odometry beyond its standard deviation [m, rad].
    search_deviations : float, default 2.0
        How many standard deviations of odometry the search reaches.
    search_turn : float, default 0.0
        By how much more the search goes in heading, for each metre of way, if odometry leads nowhere: scans that
        are a metre apart may hide a turn [rad/m].
    blind_m, blind_angle : float
        Reach of the search if there is no odometry, or odometry leads nowhere [m, rad].
    wide_share : float, default 0.08
        A scan of fewer returns, as a share of the beams, is sought at the pose by odometry and not beyond:
        it fits in many places.
    blind_overlap : float, default 0.7
        Share of the returns near observed cells of the local map below which a match does not count if
        odometry led nowhere.
    known_overlap : float, default 0.5
        The same if a scan seems to see new ground where odometry led.
    clearer_overlap, clearer : float, default 0.4, 4.0
        The same if the little that is known there does not agree, and how many times as much of the scan has to agree
        elsewhere.
    evaluations : int, default 100000
        Maximum number of placements, and blocks of them, examined in such a search.
    explained_share : float, default 0.35
        Agreement of all returns, as a share of that of recent matches, below which the search goes in
        all directions, and a match is doubtful.
    lost_evaluations : int, default 400000
        The same of a search in all directions, if odometry explains too little of a scan.
    ambiguity : float, default 0.9
        A second place that agrees as well as this share of the best refutes what such a search finds.
    apart_m, apart_angle : float
        By how much two such places differ [m, rad].
    independent_points, independent_share : float, default 50.0, 0.15
        As how many independent measurements the returns of a scan count, all of them at most and each:
        neighbouring ones err together.
    deviation : float, default 0.2
        Standard deviation of how far a return is from full agreement with the map, which is 1.
    surface_m : float, default 0.25
        Returns of a surface so near to one give its direction there, across which the return is moved; 0
        for the nearest two [m].
    unseen : float, default 0.3
        Squared disagreement of a return that lies in cells that the local map has not
        observed.
    least_score, least_overlap : float, default 0.15, 0.2
        Agreement, and share of the returns near observed cells of the local map, below which a match does not
        count.
    least_share : float, default 0.5
        The same for agreement as a share of that of recent matches.
    most_contradiction : float, default 0.25
        Share of the returns in free space of the local map above which a match does not count.
    convincing_share : float, default 0.75
        Agreement, as a share of that of recent matches, below which the search goes farther than
        odometry says.
    better_by : float, default 0.1
        By how much more a match that is found there has to agree.
    wide_after : int, default 3
        Number of scans in a row without a match after which the search goes as far as without odometry.
    lost_after : int, default 8
        Number of scans in a row without a match after which a new local map is begun.
    lost_m, lost_angle : float, default 2.0, 0.5
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
    search_turn: FromZero = 0.0
    search_deviations: Positive = 2.0
    blind_m: Annotated[float, above(0.0, 50.0)] = 1.2
    blind_angle: Angle = math.radians(50.0)
    wide_share: Positive = 0.08
    blind_overlap: Positive = 0.7
    known_overlap: Positive = 0.5
    clearer_overlap: Positive = 0.4
    clearer: Positive = 4.0
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
        """Return the weight of full disagreement of all of a number of points."""
        return min(self.independent_points, self.independent_share * points) / self.deviation**2


@dataclass(frozen=True, slots=True, kw_only=True)
class SubmapSettings:
    """Settings of local maps.

    Each scan enters two local maps that overlap by half, and is matched with the older one.

    Attributes
    ----------
    resolution : float, default 0.035
        Side of a cell [m].
    behind_m, behind_share : float, default 0.025
        As far behind the end of a beam, at least and as a share of its range, walls that other scans saw
        count as seen through [m, 1]; twice to three times the standard deviation of a range is right. A share
        of 0 does without.
    path_m : float, default 16.0
        Way driven, turns counted with a metre a radian, after which a local map is finished [m].
    least_scans : int, default 10
        Minimum number of scans of a local map.
    """

    resolution: Annotated[float, within(1e-3, 10.0)] = 0.035
    behind_m: Distance = 0.025
    behind_share: FromZero = 0.025
    path_m: Positive = 16.0
    least_scans: Count = 10

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosureSettings:
    """How places seen before are recognised.

    Attributes
    ----------
    delay_s : float, default 1.0
        Time after which a closure acts [s].
    candidates : int, default 1
        Maximum number of finished local maps that are tried with a scan.
    path_m : float, default 10.0
        Way driven since a local map was finished before it is tried [m].
    near_m : float, default 4.0
        A local map is tried if one of its scans was taken as near as this, besides the uncertainty [m].
    search_m, search_angle : float
        Minimum reach of the search [m, rad].
    most_m, most_angle : float
        Maximum reach of the search [m, rad].
    deviations : float, default 2.5
        How many standard deviations of the pose the search reaches.
    evaluations : int, default 60000
        Maximum number of placements examined in a search; one that is not over by then found nothing.
    least_score, least_overlap : float, default 0.3, 0.75
        Agreement of a closure, and share of the returns near observed cells of the local map.
    least_share : float, default 0.85
        Agreement of a closure as a share of that of recent matches with growing local maps.
    most_contradiction : float, default 0.12
        Share of returns that may lie in free space of the local map.
    as_good : float, default 0.8
        Where the robot believes to be is where it is, if the scan agrees there by this share of what it does
        in the best place.
    ambiguity : float, default 0.9
        A second place that agrees as well as this share of the best refutes a closure.
    apart_m, apart_angle : float
        By how much two places differ [m, rad].
    least_deviation_m, least_deviation_angle : float
        No closure is better than this [m, rad].
    confirmed_beyond_m : float, default 0.15
        A closure that would move the robot by more is taken only together with others that say the same: less
        than the thickness of walls, since the other side of one resembles this side [m].
    confirmed_beyond_deviations : float, default 2.5
        So is one that would move it by more standard deviations of the way since; those have to be of at
        least two local maps.
    doubts_one_map : bool, default True
        Whether those have to be of at least two local maps also if the way since allows the move.
    confirmations : int, default 3
        How many have to agree.
    agree_m, agree_angle : float
        By how much they may differ [m, rad]; less than the thickness of walls, lest both sides of one agree.
    """

    delay_s: Duration = 1.0
    candidates: Counted = 1
    path_m: FromZero = 10.0
    near_m: Length = 4.0
    search_m: Annotated[float, above(0.0, 50.0)] = 0.25
    search_angle: Angle = math.radians(4.0)
    most_m: Annotated[float, above(0.0, 50.0)] = 4.0
    most_angle: Angle = math.radians(20.0)
    deviations: Positive = 2.5
    evaluations: Count = 60_000
    least_score: Positive = 0.3
    least_share: Positive = 0.85
    least_overlap: Positive = 0.75
    most_contradiction: Positive = 0.12
    as_good: Positive = 0.8
    ambiguity: Positive = 0.9
    apart_m: Length = 0.5
    apart_angle: Angle = math.radians(15.0)
    least_deviation_m: Length = 0.03
    least_deviation_angle: Angle = math.radians(0.4)
    confirmed_beyond_m: Length = 0.15
    confirmed_beyond_deviations: Positive = 2.5
    doubts_one_map: bool = True
    confirmations: Count = 3
    agree_m: Length = 0.1
    agree_angle: Angle = math.radians(3.0)

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSettings:
    """How the past is corrected.

    Attributes
    ----------
    start_path_m : float, default 7.0
        Way driven, turns counted with a metre a radian, after which the first scan is laid on the map that
        has grown since, and the directions of its walls are surveyed [m].
    distance_m, angle : float
        Way and turn between nodes [m, rad].
    deviation_m, deviation_per_metre : float, default 0.005, 0.01
        Standard deviation of the motion between neighbouring nodes: at least, and more for each metre [m,
        m/m].
    deviation_angle : float
        The same of its turn [rad].
    robust_scale : float, default 2.0
        Residual, in standard deviations, from which on a closure counts less (Cauchy).
    correct_beyond_m, correct_beyond_angle : float
        Closures that contradict the poses by less wait until others come [m, rad].
    waiting : int, default 20
        As many closures that wait are enough.
    iterations : int, default 10
        Maximum number of Gauss-Newton steps.
    """

    start_path_m: Positive = 7.0
    distance_m: Length = 0.5
    angle: Angle = math.radians(30.0)
    deviation_m: Length = 0.005
    deviation_per_metre: Positive = 0.01
    deviation_angle: Angle = math.radians(0.05)
    robust_scale: Positive = 2.0
    correct_beyond_m: Length = 0.05
    correct_beyond_angle: Angle = math.radians(1.0)
    waiting: Count = 20
    iterations: Count = 10

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassSettings:
    """Settings for correcting drift of headings by the directions of walls.

    Walls run in two directions in most buildings.

    Attributes
    ----------
    spacing_m : float, default 0.01
        Returns that are nearer to each other than this count as one [m].
    deviation_angle : float
        Standard deviation of the direction of a building's walls from place to place [rad].
    drift : float, default 0.4
        How much headings drift from node to node, as a share of the standard deviation of their matches:
        neighbouring scans are matched with one local map, and do not err each on its own.
    deviations : float, default 3.0
        A direction that contradicts the heading by more standard deviations does not count: not all walls run
        so.
    most_deviation : float
        Headings that are known less well than this are left alone: they may be off by more than walls can
        show [rad].
    """

    spacing_m: Annotated[float, within(1e-4, 100.0)] = 0.01
    deviation_angle: Angle = math.radians(0.1)
    drift: Positive = 0.4
    deviations: Positive = 3.0
    most_deviation: Positive = math.radians(3.0)

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)


MAX_REACH_M = 200.0
"""No laser of a local map reaches farther [m]."""

MAX_SUBMAP_CELLS = 8192
"""Most cells of a local map to each side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlamSettings:
    """How a robot finds its pose and map at the same time.

    Attributes
    ----------
    uses_odometry : bool, default True
        False if there is none: motion is then predicted to go on as before.
    uses_walls : bool, default True
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
        reach = min(self.matching.range_m, MAX_REACH_M) + 2.0 * self.submaps.path_m
        if reach > MAX_SUBMAP_CELLS * self.submaps.resolution:
            raise ValueError(
                f"a local map of {reach:g} m (matching.range_m and twice submaps.path_m) in cells of "
                f"{self.submaps.resolution:g} m is too large; want at most {MAX_SUBMAP_CELLS:,} cells to "
                "each side: a coarser submaps.resolution or a shorter submaps.path_m"
            )
