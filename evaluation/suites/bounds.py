"""Sets episodes beside what a team that knew the floor needs."""

import math
from dataclasses import replace
from typing import Any

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.evaluation.suites.trial import Trial

BOUND_COVERAGE = 0.99
"""Share of the floor that bounds are computed for."""


def beside_bound(
    trial: Trial, settings: ExplorationSettings, result: dict[str, Any], image_resolution: float | None
) -> dict[str, Any]:
    """Return how soon a team that knew the floor could have seen 99 %, and the episode's time over that."""
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.evaluation.bounds.bound import known_floor_bound

    starts = result["starts"]
    wanted = replace(settings, stop_coverage=BOUND_COVERAGE)
    bound = known_floor_bound(load_floor(trial.floor, image_resolution), wanted, starts).time_s
    reached = result["t99_s"]
    return {
        "bound_s": round(bound, 6) if math.isfinite(bound) else None,
        "t99_over_bound": round(reached / bound, 6) if reached is not None and math.isfinite(bound) else None,
    }
