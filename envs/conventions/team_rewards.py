"""Rewards shared with the team."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

TEAM = "team"
"""The term of the reward that the team's share brings, beside those that make up a robot's own."""


def shared_rewards(
    rewards: NDArray[np.float64], acted: NDArray[np.bool_], share: float
) -> NDArray[np.float64]:
    """Return rewards of which a share is the mean over the team.

    Parameters
    ----------
    rewards : (episodes, robots) float64
        What each robot has earned in the step.
    acted : (episodes, robots) bool
        Who took part in it; the others earn nothing.
    share : float
        The share, 0 to 1.
    """
    counts = np.maximum(acted.sum(axis=1, keepdims=True), 1)
    means = np.where(acted, rewards, 0.0).sum(axis=1, keepdims=True) / counts
    return np.where(acted, (1.0 - share) * rewards + share * means, 0.0)


def shared_among(rewards: Mapping[str, float], share: float) -> dict[str, float]:
    """Return the rewards of the agents that took part in a step, a share of which is their mean."""
    if not rewards:
        return {}
    row = np.array(list(rewards.values()), np.float64)[None]
    mixed = shared_rewards(row, np.ones_like(row, np.bool_), share)[0]
    return dict(zip(rewards, mixed.tolist(), strict=True))
