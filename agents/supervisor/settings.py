"""Settings of the supervisor.

They are its periods, choices that the thesis leaves open, and extensions of it.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from lidarium.envs.onboard.station.joining import GROWTH_M2, OWN_M2, WALL_M
from lidarium.mapping.geometry.bounds import Count, Distance, FromZero, Length, above, check_settings
from lidarium.mapping.merging.settings import MODES

Assignment = Literal["pairs", "hungarian", "utility"]
Period = Annotated[float, above(0.0, 1e7)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SupervisorSettings:
    """How a supervisor merges maps and leads its robots.

    Attributes
    ----------
    period_s : float, default 10.0
        Simulated time between two decisions by the tree [s].
    merge_period_s : float, default 2.0
        Simulated time between two merges of the maps [s].
    searches_per_merge : int, default 2
        For how many pairs of maps a merge searches at most; the others wait for their turn. With a decision
        there is no search: it has work of its own.
    merge_resolution_m : float, default 0.05
        Maps are compared in cells of this side, or of theirs if that is more [m].
    confirmation_growth_m2 : float
        Two maps are joined only when they were found twice, the second time when they know so much more [m2].
    confirmation_own_m2 : float
        When two maps of little overlap are joined, each knows so much more than that [m2].
    confirmation_wall_m : float
        When two maps are joined, the walls that agree measure at most so much each in the mean, or the
        overlap is large; 0 for any length [m].
    same_goal_m : float, default 1.0
        Goals that lie nearer to each other than this are one [m].
    least_frontier_m : float, default 0.5
        Frontiers shorter than this are no goals [m].
    least_left_m : float, default 0.5
        The work of a group is done when no frontier of this length is left on its map within reach [m].
    unbalanced_share : float, default 0.5
        A robot whose share of the map is smaller than this part of its teammates' mean is sent to where there is
        more to map.
    enclosed_way_m, enclosed_gain_m2_per_m : float, default 10.0, 0.1
        A robot that has mapped less than this on each metre of its last way of this length is enclosed [m,
        m2/m].
    cost_weight : float, default 0.05
        Utility of a goal that a metre of way costs [1/m].
    sensor_range_m : float, default 5.6
        Range of view of a robot at its goal, and how far around the map there may be more of it [m].
    assignment : str
        Who is given goals: ``pairs`` those robots alone that the rules redirect, one after the other;
        ``hungarian`` all robots of a group at each decision, by the least sum of costs; ``utility`` likewise,
        best pair of robot and goal first.
    is_stop_final : bool, default False
        Whether a robot that the rules stop while its teammates work has ended; otherwise it stands by and
        goes on when there is a goal.
    avoids_rendezvous : bool, default False
        Whether robots are separated that are about to meet at goals near each other.
    rendezvous_m : float, default 3.0
        How near such goals are [m].
    returns_home : bool, default False
        Whether the robots drive to their starts when the work is done.
    battery_margin : float, default 0.0
        A robot turns back when its battery's charge is less than this many times the cost of the way home; 0
        for never.
    resumes_paused : bool, default False
        Whether a robot that has paused by itself, and reports a contact or an obstacle, is ordered
        to go on.
    pauses_idle : bool, default False
        Whether a robot that has no goal of its own while its teammates work is paused by an order, and
        ordered to resume when there is one; else its policy lets it wait.
    merging : str
        Rules by which maps are merged: ``default``, or ``thesis`` for those of the thesis as printed, by which maps
        are joined the first time that they are found.
    trusts_starts : bool, default False
        Whether robots that know how their frames lie in a common one are joined by that; nothing is searched
        for then.

    Raises
    ------
    ValueError
        If a setting cannot be used; it is named.
    """

    period_s: Period = 10.0
    merge_period_s: Period = 2.0
    searches_per_merge: Count = 2
    merge_resolution_m: Distance = 0.05
    confirmation_growth_m2: FromZero = GROWTH_M2
    confirmation_own_m2: FromZero = OWN_M2
    confirmation_wall_m: FromZero = WALL_M
    same_goal_m: Distance = 1.0
    least_frontier_m: Distance = 0.5
    least_left_m: Distance = 0.5
    unbalanced_share: FromZero = 0.5
    enclosed_way_m: Length = 10.0
    enclosed_gain_m2_per_m: FromZero = 0.1
    cost_weight: FromZero = 0.05
    sensor_range_m: Length = 5.6
    assignment: Assignment = "pairs"
    is_stop_final: bool = False
    avoids_rendezvous: bool = False
    rendezvous_m: Distance = 3.0
    returns_home: bool = False
    battery_margin: FromZero = 0.0
    resumes_paused: bool = False
    pauses_idle: bool = False
    merging: Literal["default", "thesis"] = "default"
    trusts_starts: bool = False

    def __post_init__(self) -> None:
        check_settings(self, "the supervisor")
        if self.assignment not in get_args(Assignment):
            raise ValueError(
                f"assignment of the supervisor is {self.assignment!r}; want one of {', '.join(get_args(Assignment))}"
            )
        if self.merging not in MODES:
            raise ValueError(f"merging of the supervisor is {self.merging!r}; want one of {', '.join(MODES)}")
        if self.pauses_idle and self.is_stop_final:
            raise ValueError(
                "pauses_idle and is_stop_final of the supervisor are both true; want one: robots without a "
                "goal are paused or have ended"
            )
