"""Which robots reach each other, directly or through others."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

CanTalk = Callable[[float, NDArray[np.float64]], NDArray[np.bool_]]
"""Takes the time [s] and the true poses (robots, 3).

Returns which robots reach each other, (robots, robots).
"""


def check_links(links: NDArray[Any], robots: int) -> NDArray[np.bool_]:
    """Return links as they count, in both directions, (robots, robots).

    Raises
    ------
    ValueError
        Where they are of another shape.
    """
    if links.shape != (robots, robots):
        raise ValueError(
            f"can_talk has shape {links.shape}; want ({robots}, {robots}): which robots reach each other"
        )
    found = np.asarray(links, np.bool_)
    return found | found.T


def clusters_of(agents: Sequence[str], links: NDArray[np.bool_]) -> list[list[str]]:
    """Return the robots that reach each other, some through others.

    Parameters
    ----------
    agents : sequence of str
        All of them.
    links : (robots, robots) bool
        Which reach each other, see `check_links`.
    """
    robots = len(agents)
    reached = links.astype(np.int64) + np.eye(robots, dtype=np.int64)
    for _ in range(robots.bit_length()):
        reached = ((reached @ reached) > 0).astype(np.int64)
    rows = {tuple(row) for row in (reached > 0).tolist()}
    return [
        [agent for agent, is_in in zip(agents, row, strict=True) if is_in]
        for row in sorted(rows, reverse=True)
    ]
