"""The policies that are led by a station, with the bounds that they are compared with."""

from typing import Any

from lidarium.agents.frontier_policies import NearestFrontier
from lidarium.agents.policy import PerRobot
from lidarium.agents.supervisor.policy import Supervised


def supervised(**options: Any) -> Supervised:  # noqa: ANN401
    """Return nearest-frontier explorers under a supervisor.

    Options are those of ``SupervisorSettings``.
    """
    return Supervised(NearestFrontier(), **options)


def oracle_starts(**options: Any) -> Supervised:  # noqa: ANN401
    """Return supervised explorers that know their relative starts, as a bound.

    They are nearest-frontier explorers, as those of ``supervised``.
    """
    return Supervised(NearestFrontier(), **{"trusts_starts": True, **options})


def independent() -> PerRobot:
    """Return nearest-frontier explorers that know nothing of each other, as a bound."""
    return PerRobot(lambda: NearestFrontier(shares_map=False))
