"""All settings of localization in one place."""

import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.checks import check_from_zero, check_positive


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
        What is different each time rather than the same, so that no one can learn it: of a distance from its
        root, of a turn from its root, and of a turn from the root of the distance [m^(1/2), rad^(1/2),
        rad/m^(1/2)].
    fading : float
        Share of what it has learned of its wheels that a robot forgets in each metre or radian: tyres lose
        air, and floors differ.
    most_deviations : float
        By at most so many of the standard deviations above a robot corrects its odometry.
    """

    distance_share: float = 0.1
    turn_share: float = 0.1
    turn_per_metre: float = 0.05
    distance_floor: float = 0.005
    turn_floor: float = 0.002
    distance_noise: float = 0.03
    turn_noise: float = 0.04
    turn_noise_of_distance: float = 0.03
    fading: float = 0.0005
    most_deviations: float = 2.0

    def __post_init__(self) -> None:
        _check_numbers(self, zero=("fading", "most_deviations"))
        if self.fading >= 1.0:
            raise ValueError(f"fading of OdometryUncertainty is {self.fading}; want a share below 1")

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
        heading = (
            self.turn_noise**2 * abs(turn)
            + self.turn_noise_of_distance**2 * abs(distance)
            + self.turn_floor**2
        )
        return np.diag([along, along, heading])


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchingSettings:
    """How scans are laid on the local map.

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
        At most so many placements, and blocks of them, are looked at in such a search.
    independent_points, independent_share : float
        As how many independent measurements the returns of a scan count, all of them at most and each:
        neighbouring ones err together.
    deviation : float
        Standard deviation of how far a return is from full agreement with the map, which is 1.
    surface_m : float
        Returns of a surface so near to one tell which way it runs there, across which the return is moved; 0
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

    distance_m: float = 0.1
    angle: float = math.radians(5.0)
    beam_interval_s: float = 0.0
    range_m: float = 20.0
    spacing_m: float = 0.05
    points: int = 350
    least_points: int = 15
    search_m: float = 0.05
    search_angle: float = math.radians(1.0)
    search_deviations: float = 2.0
    blind_m: float = 1.2
    blind_angle: float = math.radians(50.0)
    wide_share: float = 0.08
    blind_overlap: float = 0.7
    evaluations: int = 100_000
    independent_points: float = 50.0
    independent_share: float = 0.15
    deviation: float = 0.2
    surface_m: float = 0.25
    unseen: float = 0.3
    least_score: float = 0.15
    least_share: float = 0.5
    least_overlap: float = 0.2
    most_contradiction: float = 0.25
    convincing_share: float = 0.75
    better_by: float = 0.1
    wide_after: int = 3
    lost_after: int = 8
    lost_m: float = 2.0
    lost_angle: float = 0.5

    def __post_init__(self) -> None:
        _check_numbers(
            self,
            zero=(
                "beam_interval_s",
                "distance_m",
                "angle",
                "search_m",
                "search_angle",
                "surface_m",
                "unseen",
            ),
        )

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

    resolution: float = 0.035
    behind_m: float = 0.025
    behind_share: float = 0.025
    path_m: float = 16.0
    least_scans: int = 10

    def __post_init__(self) -> None:
        _check_numbers(self, zero=("behind_m", "behind_share"))


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
        At most so many placements are looked at in a search; one that is not over by then found nothing.
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
        than the thickness of walls, since the other side of one looks like this side [m].
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

    delay_s: float = 1.0
    candidates: int = 1
    path_m: float = 10.0
    near_m: float = 4.0
    search_m: float = 0.25
    search_angle: float = math.radians(4.0)
    most_m: float = 4.0
    most_angle: float = math.radians(20.0)
    deviations: float = 2.5
    evaluations: int = 60_000
    least_score: float = 0.3
    least_share: float = 0.85
    least_overlap: float = 0.75
    most_contradiction: float = 0.12
    as_good: float = 0.8
    ambiguity: float = 0.9
    apart_m: float = 0.5
    apart_angle: float = math.radians(15.0)
    least_deviation_m: float = 0.03
    least_deviation_angle: float = math.radians(0.4)
    confirmed_beyond_m: float = 0.15
    confirmed_beyond_deviations: float = 2.5
    doubts_one_map: bool = True
    confirmations: int = 3
    agree_m: float = 0.1
    agree_angle: float = math.radians(3.0)

    def __post_init__(self) -> None:
        _check_numbers(self, zero=("delay_s", "path_m", "candidates", "doubts_one_map"))


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

    start_path_m: float = 7.0
    distance_m: float = 0.5
    angle: float = math.radians(30.0)
    deviation_m: float = 0.005
    deviation_per_metre: float = 0.01
    deviation_angle: float = math.radians(0.05)
    robust_scale: float = 2.0
    correct_beyond_m: float = 0.05
    correct_beyond_angle: float = math.radians(1.0)
    waiting: int = 20
    iterations: int = 10

    def __post_init__(self) -> None:
        _check_numbers(self)


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
        that way.
    most_deviation : float
        Headings that are known less well than this are left alone: they may be off by more than walls can
        tell [rad].
    """

    spacing_m: float = 0.01
    deviation_angle: float = math.radians(0.1)
    drift: float = 0.4
    deviations: float = 3.0
    most_deviation: float = math.radians(3.0)

    def __post_init__(self) -> None:
        _check_numbers(self)


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


def _check_numbers(settings: Any, zero: tuple[str, ...] = ()) -> None:  # noqa: ANN401
    """Check that all numbers are positive, but those that may be zero."""
    whose = type(settings).__name__
    check_from_zero(settings, whose, zero)
    check_positive(settings, whose, (entry.name for entry in fields(settings) if entry.name not in zero))
