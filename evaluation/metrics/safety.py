"""How often robots touch what they should not."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike


def collisions_per_km(collisions: int, lengths: ArrayLike) -> float | None:
    """Return collisions over the kilometres that the team drove.

    None where nobody moved.

    Parameters
    ----------
    collisions : int
        How often a contact began, all robots together.
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    driven = float(np.sum(np.asarray(lengths, np.float64)))
    return 1e3 * collisions / driven if driven > 0.0 else None


def collisions_per_episode(collisions: Sequence[int]) -> float | None:
    """Return the mean number of collisions of an episode; None without episodes.

    Parameters
    ----------
    collisions : sequence of int
        Collisions of each episode.
    """
    return float(np.mean(collisions)) if len(collisions) else None
