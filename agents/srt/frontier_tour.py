"""Targets of robots without a goal: the shortest tour's first frontier.

The tour visits all frontiers that are left.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.intent import KEPT_NEAR, Intent
from lidarium.agents.srt.memories.memory import Legs, Memory, Place
from lidarium.agents.srt.motion.drive import Limits
from lidarium.agents.srt.senses import Senses
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.planning.touring.tours import shortest_tour

MOST = 14
"""Tours go past so many frontiers at most, the nearest ones."""

WAY_OF_SIZE = 1.0
"""Extra distance that a metre of frontier length is worth [m].

A robot drives so much farther to begin with a long frontier, as more is to be seen behind it.
"""

TEAMMATE_SPREAD = 5.0
"""Distance from a teammate's target within which frontiers cost more [m].

The added cost is by how much nearer they are.
"""

TEAMMATE_SAME = 1.0
"""What lies this near to what a teammate goes for is the teammate's [m]."""


def first_on_tour(
    memory: Memory,
    senses: Senses,
    limits: Limits,
    least: float,
    intent: Intent,
    of_teammates: Sequence[Place],
) -> tuple[Legs, Place] | None:
    """Return the path to the tour's first frontier, and what to observe there.

    The tour is the shortest one.

    A robot turns on the spot before it sets out, so the turn counts, too, as the way that it could have
    driven in the time.

    Parameters
    ----------
    memory : Memory
        What the robot remembers.
    senses, limits : Senses, Limits
        Where it is, and how fast it drives and turns.
    least : float
        Frontiers shorter than this are left out [m].
    intent : Intent
        What it went for last.
    of_mates : sequence of (2,) float64
        What teammates go for [m].

    Returns
    -------
    tuple or None
        The ends of the legs, and a place on the frontier; None where there is none in reach that is no
        teammate's.
    """
    frontiers = memory.frontiers(senses.pose[:2], least, MOST)
    if frontiers is None:
        return None
    to_teammates = np.array(
        [[math.dist(focus, teammate) for teammate in of_teammates] for focus in frontiers.focuses]
    ).min(axis=1, initial=math.inf)
    is_left = to_teammates >= TEAMMATE_SAME
    if not is_left.any():
        return None
    gap = frontiers.ahead - senses.pose[:2]
    turns = np.abs(
        [wrapped(float(angle)) for angle in np.arctan2(gap[:, 1], gap[:, 0]) - float(senses.pose[2])]
    )
    first = (
        frontiers.costs
        + turns * limits.speed / limits.turn_rate
        + np.maximum(TEAMMATE_SPREAD - to_teammates, 0.0)
    )
    first -= WAY_OF_SIZE * frontiers.sizes
    if intent.latest is not None:
        first -= intent.kept * _are_near(frontiers.cells, intent.latest)
    left = np.flatnonzero(is_left)
    tour = shortest_tour(first[left], frontiers.between(left))
    begin = int(left[tour[0]])
    return frontiers.legs(begin), frontiers.focuses[begin]


def _are_near(cells: Sequence[NDArray[np.float64]], latest: Place) -> NDArray[np.bool_]:
    return np.array([float(np.hypot(*(each - latest).T).min()) < KEPT_NEAR for each in cells])
