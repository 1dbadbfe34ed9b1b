"""Many decisions as arrays, for networks."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.decision import CROP_SIDE, Decision
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.agents.tours.planning import TourSettings

MOST_OPTIONS, MOST_TEAMMATES = TourSettings().most, 8
"""So many options and teammates of a decision are kept; there are no more of the first."""

PER_OPTION = ("options", "crops", "scores", "mask")
"""Arrays of decisions that have something for each option."""


@dataclass(frozen=True, slots=True)
class Decisions:
    """N decisions of up to n options as arrays; missing entries are zero.

    Attributes
    ----------
    options : (N, n, features) float32
        See ``Decision``, as all below.
    crops : (N, n, CROP_SIDE, CROP_SIDE) int8
    teammates : (N, MOST_TEAMMATES, features) float32
    situation : (N, features) float32
    scores : (N, n) float32
    mask : (N, n) bool
    counts : (N, 2) int64
        Numbers of options and of teammates.
    """

    options: NDArray[np.float32]
    crops: NDArray[np.int8]
    teammates: NDArray[np.float32]
    situation: NDArray[np.float32]
    scores: NDArray[np.float32]
    mask: NDArray[np.bool_]
    counts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.counts)

    def take(self, rows: NDArray[np.int64]) -> "Decisions":
        """Return the decisions of some rows."""
        return Decisions(*(getattr(self, field.name)[rows] for field in fields(self)))

    def narrowed(self, width: int) -> "Decisions":
        """Return the same decisions, none of which has more than that many options, in less memory."""
        parts = {name: np.ascontiguousarray(getattr(self, name)[:, :width]) for name in PER_OPTION}
        return replace(self, **parts)


def stacked(decisions: Sequence[Decision]) -> Decisions:
    """Return decisions as arrays, with room for ``MOST_OPTIONS``.

    Of more teammates than ``MOST_TEAMMATES`` the first ones are kept.
    """
    count = len(decisions)
    table = Decisions(
        np.zeros((count, MOST_OPTIONS, len(OPTION_FEATURES)), np.float32),
        np.zeros((count, MOST_OPTIONS, CROP_SIDE, CROP_SIDE), np.int8),
        np.zeros((count, MOST_TEAMMATES, len(TEAMMATE_FEATURES)), np.float32),
        np.zeros((count, len(SITUATION_FEATURES)), np.float32),
        np.zeros((count, MOST_OPTIONS), np.float32),
        np.zeros((count, MOST_OPTIONS), np.bool_),
        np.zeros((count, 2), np.int64),
    )
    for k, each in enumerate(decisions):
        n, m = len(each.options), min(len(each.teammates), MOST_TEAMMATES)
        table.options[k, :n], table.crops[k, :n] = each.options, each.crops
        table.teammates[k, :m], table.situation[k] = each.teammates[:m], each.situation
        table.scores[k, :n], table.mask[k, :n], table.counts[k] = each.scores, each.mask, (n, m)
    return table
