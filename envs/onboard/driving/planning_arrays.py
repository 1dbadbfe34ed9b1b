"""What a plan is made from: the arrays of robots with their destinations."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Planning(NamedTuple):
    """What planning needs to know of the robots, their maps and the world.

    Attributes
    ----------
    robots : int
        Robots of a team.
    knows_teammates : bool
        Whether all teammates' poses are known at once.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Where they are not: of whom each robot heard lately, and where they were then [m, rad].
    radius : float
        Of every body [m].
    resolution : float
        Side of a map cell [m].
    tight : float
        Clearance below which a path ends in the middle of its last cell [m].
    farthest : float
        Clearance is measured up to this [m].
    limit, half_costs, roomy, least_clearance, preferred : as of ``Passage``
        How a body passes over a map; written out, because loops on threads take no tuples within tuples.
    records, sharing : (maps, 10) int64 and int
        Records of the maps that the robots plan on, and how many rows share one.
    memory : (pieces, 6) int64
        For searches, a piece for each thread.
    believed, origins, offsets : (rows, 3), (rows, 2), (rows, 2) float64
        Believed poses, lower left corners of the maps and origins of the map frames [m, rad].
    has_ended : (rows,) bool
        Which robots have ended and stand where they are.
    """

    robots: int
    knows_teammates: bool
    contact: NDArray[np.uint8]
    heard: NDArray[np.float64]
    radius: float
    resolution: float
    tight: float
    farthest: float
    limit: int
    half_costs: NDArray[np.int32]
    roomy: int
    least_clearance: float
    preferred: float
    records: NDArray[np.int64]
    sharing: int
    memory: NDArray[np.int64]
    believed: NDArray[np.float64]
    origins: NDArray[np.float64]
    offsets: NDArray[np.float64]
    has_ended: NDArray[np.bool_]


class Destination(NamedTuple):
    """Where a robot is to go.

    Attributes
    ----------
    row, column : int
        The cell to go to; outside of the map there is no path.
    x, y : float
        Where to end within that cell, if there is room [m]; nan for its centre.
    heading : float
        Wanted heading at the end [rad], nan for any.
    maximum_cost : float
        Most that the path may cost [m].
    """

    row: int
    column: int
    x: float
    y: float
    heading: float
    maximum_cost: float
