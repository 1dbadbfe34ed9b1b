"""The policies that are led by a station, with the bounds that they are compared with."""

from typing import Any

from lidarium.agents.catalogue import make_policy
from lidarium.agents.frontier.policies import NearestFrontier
from lidarium.agents.policy import PerRobot
from lidarium.agents.supervisor.policy import Supervised


def supervised(explorer: str = "nearest_frontier", **options: Any) -> Supervised:  # noqa: ANN401
    """Return explorers under a supervisor."""
    return Supervised(make_policy(explorer), **options)


def supervised_thesis(**options: Any) -> Supervised:  # noqa: ANN401
    """Return explorers under the supervisor of the thesis: its merging, periods and final stops."""
    thesis: dict[str, Any] = {"merging": "thesis", "merge_period_s": 1.0, "is_stop_final": True}
    policy = supervised(**{**thesis, **options})
    policy.decision_period_s = 1.0  # the station merges between decisions
    return policy


def supervised_tours(**options: Any) -> Supervised:  # noqa: ANN401
    """Return tour explorers under a supervisor; options as for ``supervised``."""
    return supervised("tour_frontier", **options)


def supervised_predicted(
    predictor: str = "network",
    weights: str = "",
    falls_back: bool = False,
    **options: Any,  # noqa: ANN401
) -> Supervised:
    """Return explorers on predicted maps under a supervisor; robots predict the map that they have been sent."""
    explorer = make_policy("predicted_tours", predictor=predictor, weights=weights, falls_back=falls_back)
    return Supervised(explorer, **options)


def supervised_learned(weights: str = "", **options: Any) -> Supervised:  # noqa: ANN401
    """Return trained explorers under a supervisor."""
    return Supervised(make_policy("learned", weights=weights), **options)


def oracle_starts(**options: Any) -> Supervised:  # noqa: ANN401
    """Return supervised explorers that know their relative starts, as a bound.

    They are nearest-frontier explorers, as those of ``supervised``.
    """
    return Supervised(NearestFrontier(), **{"trusts_starts": True, **options})


def independent() -> PerRobot:
    """Return nearest-frontier explorers that know nothing of each other, as a bound."""
    return PerRobot(lambda: NearestFrontier(shares_map=False))
