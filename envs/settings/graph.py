"""Settings of the level ``graph``: the nodes that robots move between.

References
----------
Defaults are those of DARE (Cao et al., "DARE: diffusion policy for autonomous robot exploration", ICRA 2025).
"""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, share, within


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSettings:
    """The lattice of nodes of the level ``graph``.

    Attributes
    ----------
    spacing : float
        Distance of the nodes along each axis [m].
    neighbours : int
        An edge leads to nodes up to this many spacings away along each axis, if the line between is known to be free.
    utility_share : float
        A node counts the frontiers within this share of the laser's range that are visible from it.
    least_utility : int
        A node with at most this many frontiers in view counts as having none, from then on.
    frontier_spacing : float
        Of the frontier cells in a square of this side one is counted [m].
    offers : int
        Maximum number of nodes that are observed, those with the shortest ways.
    """

    spacing: Annotated[float, above(0.0, 1e3)] = 4.0
    neighbours: Annotated[int, within(1, 8)] = 2
    utility_share: Annotated[float, share()] = 0.8
    least_utility: Annotated[int, within(0, 1_000_000)] = 1
    frontier_spacing: Annotated[float, above(0.0, 1e3)] = 1.6
    offers: Annotated[int, within(1, 4096)] = 400

    def __post_init__(self) -> None:
        check_settings(self, "the graph")
