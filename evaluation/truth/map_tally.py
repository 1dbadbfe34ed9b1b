"""Counts what the robots' maps know, in step with them.

Only what lies within reach of where a robot has been since is examined.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.coverage import pack_bits
from lidarium.evaluation.truth.beliefs import held_maps, shares_one_map
from lidarium.evaluation.truth.map_counts import LastVisit, count_maps, note_changes
from lidarium.evaluation.truth.team_counts import COUNTED, KNOWABLE, KNOWN, CountedMaps
from lidarium.evaluation.truth.true_map import Truth
from lidarium.mapping.grids.scan_integration import WORD


class MapTally:
    """What the maps of an episode know, counted in step with them.

    Parameters
    ----------
    env : ExplorationEnv
        The environment after its reset.
    truth : Truth
        What is true of its floor.

    Attributes
    ----------
    counts : (robots + 1, 3) int64
        In the last row the cells within those that can be known, and within F and its surface, that the
        team's map knows. Cells of F that are free: in the last row by the sum of the maps where all robots
        share it, else by each robot's own map in its row.
    shares : bool
        Whether all robots share the sum of the maps.
    sizes : (3,) int64
        All cells that can be known, of F and its surface, and of F.
    """

    def __init__(self, env: ExplorationEnv, truth: Truth) -> None:
        world, robots = env.world, env.settings.robots
        self._truth = np.stack([pack_bits(mask) for mask in (truth.knowable, truth.valid, truth.counted)])
        self.sizes = np.bitwise_count(self._truth).sum(axis=(1, 2), dtype=np.int64)
        rows, words = self._truth.shape[1:]
        self.counts = np.zeros((robots + 1, 3), np.int64)
        self._maps = CountedMaps(
            self._truth,
            np.zeros((robots + 1, rows, words, 2), np.uint64),
            np.zeros((rows, words), np.uint64),
            self.counts,
        )
        self._last = LastVisit(world.poses.copy(), world.travelled.copy(), env.beliefs.windows.copy())
        map_rows, map_columns = (0, 0) if env.settings.known_starts else env.beliefs.log_odds[0].shape
        self._signs = np.zeros((robots, map_rows, map_columns // WORD, 2), np.uint64)
        self.shares = shares_one_map(env)

    def note_step(self, env: ExplorationEnv) -> None:
        """Note where maps have changed; wanted after every step."""
        note_changes(env.beliefs.windows, self._last.changes)

    def take_in(self, env: ExplorationEnv) -> None:
        """Update the counts."""
        count_maps(env.simulation.table, 0, self.shares, self._maps, self._signs, self._last)
        if env.perception.hears:
            for robot, held in enumerate(held_maps(env)):
                self.counts[robot, COUNTED] = int(
                    np.bitwise_count(pack_bits(held < 0) & self._truth[COUNTED]).sum()
                )

    @property
    def known_shares(self) -> NDArray[np.float64]:
        """Return ``C_known`` of each robot's own map at the last update, (robots,).

        The last update is when the maps were taken in last.
        """
        known = np.bitwise_count(self._maps.bits[:-1, :, :, KNOWN] & self._truth[KNOWABLE]).sum(
            axis=(1, 2), dtype=np.int64
        )
        return np.asarray(known / max(int(self.sizes[KNOWABLE]), 1))
