"""Sorts episodes into comparable groups, and into pairs.

The figures of the episodes in a group may be compared side by side.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import GENERATORS, SETS, floor_names
from lidarium.envs.floors.catalogue.real import COLLECTIONS
from lidarium.evaluation.analysis.episodes import Row, pair_key_of, variant_of
from lidarium.evaluation.episodes.stop_rules import STOP_REASON
from lidarium.evaluation.statistics import CensoredTimes
from lidarium.evaluation.suites.episodes_file import TIMINGS
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

_NAMES = ("seed", "key", "record")
"""Keys that identify a run and are not results."""


@dataclass(frozen=True, slots=True)
class Group:
    """Episodes with one set of settings, one number of robots and one floor set.

    Attributes
    ----------
    variant : str
        Name of the settings, empty if they have none.
    robots : int
        Number of robots.
    floor_set : str
        As `floor_set_of` names it.
    runs : dict
        Episodes by policy, policies in alphabetical order.
    horizon_s : float
        Time up to which times count: the horizon of the runs, by default the longest run of the group.
    """

    variant: str
    robots: int
    floor_set: str
    runs: dict[str, list[Row]]
    horizon_s: float

    @property
    def title(self) -> str:
        """Heading for people."""
        settings = "" if self.variant in ("", DEFAULT_VARIANT) else f"{self.variant}: "
        return f"{settings}{self.robots} robot{'s' if self.robots != 1 else ''}, {self.floor_set}"

    @property
    def slug(self) -> str:
        """Part of file names, unique to the group."""
        settings = ""
        if self.variant not in ("", DEFAULT_VARIANT):
            digest = hashlib.sha256(self.variant.encode("utf-8", "replace")).hexdigest()
            settings = f"{self.variant[:60]}_{digest[:8]}_"
        return "".join(letter if letter.isalnum() else "_" for letter in f"{settings}{self.robots}_{self.floor_set}")

    @property
    def floors(self) -> list[str]:
        """Names of the floors."""
        return sorted({str(row["floor"]) for rows in self.runs.values() for row in rows}, key=_natural)

    def on_floor(self, floor: str) -> dict[str, list[Row]]:
        """Return the episodes on one floor by policy."""
        return {policy: [row for row in rows if row["floor"] == floor] for policy, rows in self.runs.items()}


@dataclass(frozen=True, slots=True)
class _Reached:
    """When the runs of a policy reached a share of the floor.

    Attributes
    ----------
    times : (n,) float64
        When they did, or until when they had not [s].
    is_reached : (n,) bool
        Whether they did, up to the horizon.
    horizon_s : float
        Up to when times count [s].
    cut : int
        Number of runs that did not and were cut before the horizon: their times are unknown.
    """

    times: NDArray[np.float64]
    is_reached: NDArray[np.bool_]
    horizon_s: float
    cut: int

    @property
    def censored(self) -> CensoredTimes:
        """For restricted means; raises as `CensoredTimes`."""
        return CensoredTimes(self.times, self.is_reached, self.horizon_s)

    @property
    def is_cut(self) -> NDArray[np.bool_]:
        """Whether runs that did not reach the share were cut before the horizon."""
        return ~self.is_reached & (self.times < self.horizon_s)

    @property
    def or_never(self) -> NDArray[np.float64]:
        """The times, inf if the share was not reached."""
        return np.where(self.is_reached, self.times, np.inf)

    @property
    def up_to_horizon(self) -> NDArray[np.float64]:
        """The times, the horizon if the share was not reached."""
        return np.where(self.is_reached, self.times, self.horizon_s)


def grouped(rows: Iterable[Row]) -> list[Group]:
    """Return the groups, by settings, floor set and number of robots."""
    sorted_rows: dict[tuple[str, str, int], dict[str, list[Row]]] = {}
    for row in rows:
        runs = sorted_rows.setdefault((variant_of(row), floor_set_of(row["floor"]), row["robots"]), {})
        runs.setdefault(row["policy"], []).append(row)
    groups = []
    for (variant, floor_set, robots), runs in sorted(sorted_rows.items()):
        everything = [row for policy_rows in runs.values() for row in policy_rows]
        horizons = [row["horizon_s"] if row["horizon_s"] is not None else row["time_s"] for row in everything]
        groups.append(
            Group(
                variant,
                robots,
                floor_set,
                {policy: runs[policy] for policy in sorted(runs)},
                float(max(horizons)),
            )
        )
    return groups


def floor_set_of(floor: str) -> str:
    """Name the set that a floor belongs to.

    It is one of the catalogue's sets or collections, other generated floors, drawn floors, or files.
    """
    kind, _, seed = floor.partition(":")
    if kind in COLLECTIONS:
        return f"set:{kind}"
    if kind not in GENERATORS or not seed.isdigit():
        return "drawn floors" if floor in floor_names() else "floors from files"
    # A building is named by its kind, however it was requested.
    within = (name for name, (first, count) in SETS.items() if first <= int(seed) < first + count)
    return next((f"set:{name}" for name in within), "generated floors")


def times_to(rows: Sequence[Row], key: str, horizon_s: float) -> _Reached:
    """Return when runs reached a share of the floor.

    A run that missed it is never dropped. If it ended by itself, with nothing left to do, it would not have reached
    the share later either, and counts as not there at the horizon. If it was cut (by the horizon, by the user, by
    the physics, by a stop rule, or at a smaller share), it is censored then.
    """
    times, is_reached, cut = [], [], 0
    for row in rows:
        reached = row[key] is not None and row[key] <= horizon_s
        until = _end_of(row) if _is_cut(row) else horizon_s
        cut += not reached and until < horizon_s
        times.append(float(row[key]) if reached else until)
        is_reached.append(reached)
    return _Reached(np.array(times), np.array(is_reached, np.bool_), horizon_s, cut)


def paired(a: Iterable[Row], b: Iterable[Row]) -> tuple[list[Row], list[Row]]:
    """Return the runs of both that have a partner, in the same order.

    Partners are on the same floor, with the same starts and seed.
    """
    partners = {pair_key_of(row): row for row in b}
    pairs = [(row, partners[pair_key_of(row)]) for row in a if pair_key_of(row) in partners]
    return [first for first, _ in pairs], [second for _, second in pairs]


def repeats(rows: Iterable[Row]) -> int:
    """Return the number of runs that repeat another run on the same floor.

    Seed and wall time are not compared.

    If neither starts nor noise are drawn, a deterministic policy has the same result for every seed.
    """
    said = [
        json.dumps(
            {key: value for key, value in row.items() if key not in _NAMES and key not in TIMINGS},
            sort_keys=True,
        )
        for row in rows
    ]
    return len(said) - len(set(said))


def _end_of(row: Row) -> float:
    """Return the time up to which a run is known: its horizon, which may be no whole number of steps, or its end."""
    is_whole = "horizon" in row["ended_because"].values() and not row["interrupted"]
    return float(row["horizon_s"] if is_whole and row["horizon_s"] is not None else row["time_s"])


def _is_cut(row: Row) -> bool:
    return bool(row["interrupted"]) or any(
        reason in (None, "horizon", "physics", STOP_REASON, "covered") for reason in row["ended_because"].values()
    )


def _natural(name: str) -> tuple[str, int, str]:
    kind, _, number = name.partition(":")
    return kind, int(number) if number.isdigit() else -1, name
