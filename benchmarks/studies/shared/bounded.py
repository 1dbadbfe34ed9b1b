"""Teams whose bound is wanted: what they need that know the floor, from where explorers start."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.bounds.bound import known_floor_bound
from lidarium.evaluation.suites.starts import drawn_starts, starts_in


@dataclass(frozen=True, slots=True)
class Bounded:
    """A floor, a number of robots and their settings."""

    floor: str
    robots: int
    settings: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.floor} | {self.robots}"


def measure_bound(team: Bounded) -> dict[str, Any]:
    """Return what a team needs that knows the floor, None where it cannot see 99 %."""
    settings = make_settings(robots=team.robots, **team.settings)
    starts = drawn_starts(team.floor, settings, 0) or starts_in(team.floor, settings, 0)
    bound = known_floor_bound(team.floor, settings, starts)
    known = bound.time_s if math.isfinite(bound.time_s) else None
    return {"floor": team.floor, "robots": team.robots, "known_s": known}
