"""How a round body wants to pass, and what that costs on a grid."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.search.search_state import DIAGONAL, STRAIGHT, Passage


@dataclass(frozen=True, slots=True)
class Footprint:
    """How a round body wants to pass.

    Attributes
    ----------
    radius : float
        Least clearance [m].
    preferred : float
        Clearance [m] from which on a step costs no more than on open floor.
    penalty : float
        By how many times its length a step at the least clearance costs more; falls off with the square
        towards ``preferred``.

    Raises
    ------
    ValueError
        If ``radius`` is negative, ``preferred`` below it, or ``penalty`` outside [0, 1000].
    """

    radius: float = 0.18
    preferred: float = 0.33
    penalty: float = 3.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius <= self.preferred:
            raise ValueError(
                f"radius is {self.radius} m and preferred clearance {self.preferred} m; want 0 <= radius <= "
                "preferred"
            )
        if not 0.0 <= self.penalty <= 1000.0:
            raise ValueError(f"penalty is {self.penalty}; want 0 to 1000 times the length of a step")


@lru_cache(maxsize=64)
def passage_of(footprint: Footprint, resolution: float, limit: int) -> Passage:
    """Return how a body passes over a grid of cells of ``resolution`` [m].

    The grid's clearance field has this ``limit``.

    Raises
    ------
    ValueError
        If the footprint needs more clearance than the field knows.
    """
    least = limit_of(footprint.radius, resolution)
    if limit_of(footprint.preferred, resolution) > limit:
        raise ValueError(
            f"preferred clearance {footprint.preferred} m is beyond the largest one that the clearance field "
            "knows"
        )
    squared = limit - np.arange(limit + 1)
    clearance = np.sqrt(squared) * 0.5 * resolution
    room = max(footprint.preferred - footprint.radius, 1e-9)
    shortfall = np.clip((footprint.preferred - clearance) / room, 0.0, 1.0)
    factors = 1.0 + footprint.penalty * shortfall**2
    costs = np.rint(np.array([[STRAIGHT / 2], [DIAGONAL / 2]]) * factors).astype(np.int32)
    costs[:, squared < max(least, 1)] = 0
    costs.flags.writeable = False
    return Passage(
        limit, costs, limit - least - 2, footprint.radius / resolution, footprint.preferred / resolution
    )
