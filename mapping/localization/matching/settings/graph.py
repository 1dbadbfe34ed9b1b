"""Settings of closures, of the graph of poses, and of directions of walls."""

import math
from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import (
    Angle,
    Count,
    Counted,
    Duration,
    FromZero,
    Length,
    Positive,
    above,
    check_settings,
    within,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosureSettings:
    """How places seen before are recognised.

    Attributes
    ----------
    delay_s : float
        Time after which a closure acts [s].
    candidates : int
        At most so many finished local maps are tried with a scan.
    path_m : float
        Way driven since a local map was finished before it is tried [m].
    near_m : float
        A local map is tried where one of its scans was taken as near as this, besides the uncertainty [m].
    search_m, search_angle : float
        What the search reaches at least [m, rad].
    most_m, most_angle : float
        What the search reaches at most [m, rad].
    deviations : float
        How many standard deviations of the pose the search reaches.
    evaluations : int
        At most so many placements are examined in a search; one that is not over by then found nothing.
    least_score, least_overlap : float
        Agreement of a closure, and share of the returns near what the local map has observed.
    least_share : float
        Agreement of a closure as a share of what matches with growing local maps have had of late.
    most_contradiction : float
        Share of returns that may lie in free space of the local map.
    as_good : float
        Where the robot believes to be is where it is, if the scan agrees there by this share of what it does
        in the best place.
    ambiguity : float
        A second place that agrees as well as this share of the best refutes a closure.
    apart_m, apart_angle : float
        By how much two places differ [m, rad].
    least_deviation_m, least_deviation_angle : float
        No closure is better than this [m, rad].
    confirmed_beyond_m : float
        A closure that would move the robot by more is taken only together with others that say the same: less
        than the thickness of walls, since the other side of one resembles this side [m].
    confirmed_beyond_deviations : float
        So is one that would move it by more standard deviations of the way since; those have to be of at
        least two local maps.
    doubts_one_map : bool
        Whether those have to be of at least two local maps also where the way since allows the move.
    confirmations : int
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
    start_path_m : float
        Way driven, turns counted with a metre a radian, after which the first scan is laid on the map that
        has grown since, and where its walls run is surveyed [m].
    distance_m, angle : float
        Way and turn between nodes [m, rad].
    deviation_m, deviation_per_metre : float
        Standard deviation of the motion between neighbouring nodes: at least, and more for each metre [m,
        m/m].
    deviation_angle : float
        The same of its turn [rad].
    robust_scale : float
        Residual, in standard deviations, from which on a closure counts less (Cauchy).
    correct_beyond_m, correct_beyond_angle : float
        Closures that contradict the poses by less wait until others come [m, rad].
    waiting : int
        As many closures that wait are enough.
    iterations : int
        At most so many steps of Gauss and Newton.
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
    spacing_m : float
        Returns that are nearer to each other than this count as one [m].
    deviation_angle : float
        Standard deviation of the direction of a building's walls from place to place [rad].
    drift : float
        How much headings drift from node to node, as a share of the standard deviation of their matches:
        neighbouring scans are matched with one local map, and do not err each on its own.
    deviations : float
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
