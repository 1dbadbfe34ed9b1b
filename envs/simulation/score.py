"""The score: the counted cells of a floor, the cells seen by each robot, and their reward."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.coverage import pack_bits
from lidarium.envs.simulation.rewards import TERMS
from lidarium.mapping.kernels.huge_pages import ArrayPool


def counted_cells(body_free: NDArray[np.bool_], multiple: int) -> NDArray[np.bool_]:
    """Return the map cells in which all world cells count.

    A map cell is ``multiple`` x ``multiple`` world cells.
    """
    rows, columns = (-(-size // multiple) * multiple for size in body_free.shape)
    padded = np.zeros((rows, columns), np.bool_)
    padded[: body_free.shape[0], : body_free.shape[1]] = body_free
    counted = np.ones((rows // multiple, columns // multiple), np.bool_)
    for i in range(multiple):
        for j in range(multiple):
            counted &= padded[i::multiple, j::multiple]
    return counted


class Score:
    """Masks, gains and rewards of all episodes; row = episode * robots + robot.

    Parameters
    ----------
    robots, episodes : int
        Size of a team, and number of episodes.
    weights : (4,) float64 or None
        Weight of each of ``rewards.TERMS``; 0 if None.

    Attributes
    ----------
    masks, team_masks, counted_masks : list of (rows, words) uint64
        Cells that each robot and each team have sensed, and F of each episode, as bits.
    seen, team_seen, counted : (rows,), (episodes,), (episodes,) int64
        Cells of F that each robot and each team have sensed, and the size of F.
    gains : (rows,) float64
        Cells credited to each robot in the last step.
    rewards : (rows,) float64
        Reward of each robot since this was last set to 0.
    reward_terms : (rows, 4) float64
        The same by ``rewards.TERMS``; before weights.
    earned : (rows * 5,) float64
        The memory of both.
    mask_rows : (rows, 5) int64
        Addresses of the masks (``masks`` of ``kernels.arrays``).
    """

    def __init__(self, robots: int, episodes: int, weights: NDArray[np.float64] | None = None) -> None:
        rows = robots * episodes
        self._robots, self._episodes = robots, episodes
        self.reward_weights = np.zeros(len(TERMS)) if weights is None else np.array(weights, np.float64)
        self.seen, self.gains = np.zeros(rows, np.int64), np.zeros(rows)
        # Rewards and their terms lie together, so that one call clears them.
        self.earned, self.rewarded = np.zeros(rows * (1 + len(TERMS))), np.zeros(rows)
        self._part_earned()
        self.team_seen, self.counted = np.zeros(episodes, np.int64), np.zeros(episodes, np.int64)
        self.masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * rows
        self.team_masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * episodes
        self.counted_masks: list[NDArray[np.uint64]] = [np.zeros((0, 1), np.uint64)] * episodes
        self.mask_rows, self.boxes = np.zeros((rows, 5), np.int64), np.zeros((rows, 4), np.int64)

    def _part_earned(self) -> None:
        """Make the rewards and their terms parts of one memory."""
        rows = self._robots * self._episodes
        self.rewards, self.reward_terms = self.earned[:rows], self.earned[rows:].reshape(rows, len(TERMS))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # Copies of parts are no parts of the copy.
        self._part_earned()

    def shared(self, free: NDArray[np.bool_], multiple: int, same: Sequence[int]) -> NDArray[np.uint64]:
        """Return F of a floor as bits, in the array of another episode that has the same.

        Parameters
        ----------
        free : (rows, columns) bool
            World cells that count.
        """
        counted = pack_bits(counted_cells(free, multiple))
        others = (self.counted_masks[other] for other in same)
        return next((mask for mask in others if np.array_equal(mask, counted)), counted)

    def place(self, episode: int, counted: NDArray[np.uint64], pages: ArrayPool) -> None:
        """Start an episode with F = ``counted`` (rows, words) and no cells seen."""
        self.counted_masks[episode] = counted
        self.team_masks[episode] = pages.blank(counted.shape, np.uint64)
        self.counted[episode] = int(np.bitwise_count(counted).sum())
        self.team_seen[episode] = 0
        rows = slice(episode * self._robots, (episode + 1) * self._robots)
        self.seen[rows], self.gains[rows] = 0, 0.0
        self.rewarded[rows], self.rewards[rows], self.reward_terms[rows] = 0.0, 0.0, 0.0

    def place_robot(self, row: int, pages: ArrayPool) -> None:
        """Give a robot an empty mask."""
        self.masks[row] = pages.blank(self.counted_masks[row // self._robots].shape, np.uint64)

    def point_at(self, row: int) -> None:
        """Store the addresses of a robot's masks, for kernels."""
        episode = row // self._robots
        counted, team = self.counted_masks[episode], self.team_masks[episode]
        self.mask_rows[row] = (
            self.masks[row].ctypes.data,
            team.ctypes.data,
            counted.ctypes.data,
            *counted.shape,
        )

    def coverage(self, episode: int) -> float:
        """Return the sensed share of F, ``C_free``."""
        return float(self.team_seen[episode] / max(int(self.counted[episode]), 1))

    def coverages(self) -> NDArray[np.float64]:
        """Return the sensed share of F of every episode, ``C_free``, shape (episodes,)."""
        return np.asarray(self.team_seen / np.maximum(self.counted, 1))

    def row_coverages(self) -> NDArray[np.float64]:
        """Return the coverage of the episode of each row."""
        if self._episodes > 1:
            return np.repeat(self.coverages(), self._robots)
        coverage = np.empty(self._robots)  # steps of a lone episode are short
        coverage.fill(self.team_seen.item(0) / max(self.counted.item(0), 1))
        return coverage
