"""What the experiments of supervised teams are to reach, and whether they did."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from lidarium.benchmarks.studies.supervisor.figures import (
    Row,
    chosen,
    has_false_merge,
    has_off_merge,
    has_wrong_merge,
    median,
    overlap_points,
    path_shares,
    time_ratios,
    time_shares,
)
from lidarium.benchmarks.studies.supervisor.suites import LARGE_M2, area_m2
from lidarium.evaluation.statistics import Interval, share_interval

SUPERVISED, TOLD = "supervised", "oracle_starts"
BUMPER = "bumper"
"""The suite of robots that pause; it is beside the others."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure besides what it is to be.

    `title`: what it is; `wanted`: what it is to be, for people; `found`: what it is; None if nothing was run for it;
    `is_reached`: whether the estimate is as wanted; `digits`: behind the point, for people; `robots`: size of the teams
    that it is about; None if it is about others, too; `missed_by`: where runs are counted that do something, those that
    do not do as is wanted.
    """

    title: str
    wanted: str
    found: Interval | None
    is_reached: bool
    digits: int = 2
    robots: int | None = None
    missed_by: tuple[Row, ...] = ()


def goals_of(rows: Mapping[str, Sequence[Row]], failing: Sequence[Row]) -> list[Goal]:
    """Return all figures."""
    teams, alone = rows["teams"], rows["one"]
    told = chosen(teams, TOLD)
    goals: list[Goal] = []
    for robots, share, stretch in ((2, 0.62, 0.58), (3, 0.48, 0.42)):
        led = chosen(teams, SUPERVISED, robots)
        title = f"time to 99 % with {robots} robots"
        goals.append(
            _at_most(f"{title} / one robot's", time_shares(led, alone), share, robots, f" (stretch {stretch})")
        )
        goals.append(_at_most(f"{title} / that of `{TOLD}`", time_ratios(led, told), 1.10, robots))
    for robots in (2, 3):
        goals += _path_goals(rows, robots)
    for robots in (2, 3):
        points = overlap_points(chosen(teams, SUPERVISED, robots), told)
        goals.append(
            _at_most(
                f"overlap at the end with {robots} robots, less that of `{TOLD}` [points]",
                points,
                8.0,
                robots,
                digits=1,
            )
        )
    merging = [row for name in rows if name != BUMPER for row in rows[name]]
    goals += _merge_goals([*merging, *failing])
    five = chosen(rows["five"], SUPERVISED)
    for name in ("p50", "p95"):
        milliseconds = [float(row["tick_ms"][name]) for row in five if row["tick_ms"][name] is not None]
        goals.append(_at_most(f"tick with 5 robots, {name} of a run [ms]", milliseconds, 150.0, 5, digits=0))
    lost = chosen(failing, SUPERVISED)
    goals.append(
        _share(
            "a robot fails at half time: runs in which the others cover 99 % of what it leaves", lost, is_covered, 1.0
        )
    )
    return goals


def _path_goals(rows: Mapping[str, Sequence[Row]], robots: int) -> list[Goal]:
    """Return how long the paths of a team may be, besides those of one robot."""
    scenario = [*rows["pairs"], *rows["three"]]
    flat = chosen(scenario, SUPERVISED, robots, lambda floor: floor == "apartment")
    large = chosen(rows["teams"], SUPERVISED, robots, lambda floor: area_m2(floor) >= LARGE_M2)
    title = f"way of {robots} robots / one robot's"
    return [
        _at_most(f"{title}, apartment", path_shares(flat, rows["alone"]), 1.30, robots),
        _at_most(f"{title}, floors over 300 m2", path_shares(large, rows["one"]), 1.15, robots),
    ]


def _merge_goals(every: Sequence[Row]) -> list[Goal]:
    """Return the shares of runs whose merges were wrong, of all runs that merge maps."""
    led = [row for row in every if row["supervisor"] is not None and row["robots"] > 1 and row["policy"] != TOLD]
    return [
        _share("runs in which a wrong merge was used", led, has_wrong_merge, 0.0),
        _share("runs with a merge that errs as much by the starts, drift included", led, has_off_merge, None),
        _share("runs with a merge that is not correct by `result.json`", led, has_false_merge, None),
    ]


def covered_by_others(row: Row) -> float:
    """Return the share of the reachable area that robots not failed covered.

    The area is what the others' bodies leave in reach.
    """
    covered = row["c_others_final"]
    return float(row["coverage_final"] if covered is None else covered)


def is_covered(row: Row) -> bool:
    """Whether the robots that have not failed covered 99 % of what is in reach.

    It is what the others' bodies leave in reach.
    """
    return covered_by_others(row) >= 0.99


def _at_most(title: str, values: Sequence[float], wanted: float, robots: int, more: str = "", digits: int = 2) -> Goal:
    found = median(values)
    return Goal(title, f"<= {wanted:g}{more}", found, found is not None and found.estimate <= wanted, digits, robots)


def _share(title: str, rows: Sequence[Row], holds: Callable[[Row], bool], wanted: float | None) -> Goal:
    """Return a share of runs [%], of which all or none are wanted.

    Without one that is wanted it is besides the others.
    """
    if not rows:
        return Goal(title, "-" if wanted is None else f"{100.0 * wanted:.0f} %", None, False)
    share = share_interval(sum(holds(row) for row in rows), len(rows))
    found = Interval(100.0 * share.estimate, 100.0 * share.low, 100.0 * share.high, share.confidence, share.size)
    if wanted is None:
        return Goal(f"{title} [%]", "-", found, True, 1)
    missed_by = tuple(row for row in rows if holds(row) != bool(wanted))
    return Goal(f"{title} [%]", f"{100.0 * wanted:.0f}", found, not missed_by, 1, missed_by=missed_by)
