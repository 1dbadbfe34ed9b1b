"""The sums of a robot's own map and those that it has received."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.onboard.navigation import CLEARANCE_LIMIT, FLAGS, RECORD, NavigationMap
from lidarium.envs.onboard.radio.exchange import Exchange
from lidarium.envs.onboard.team_maps import sum_maps
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.merging.fusion import FusedMap, overlay
from lidarium.mapping.planning.clearance import limit_of, stamp_of
from lidarium.mapping.planning.frontiers.frontier_map import IGNORED


class ReceivedMaps:
    """Maps of the robots of all episodes combined with data from other robots.

    The data come by radio if the starts are known, otherwise from the station.

    Parameters
    ----------
    simulation : Simulation
        The simulation with the maps; row = episode * robots + robot.
    settings : ExplorationSettings
        The team of every episode.
    poses : KnownPoses
        Origins of the robots' map frames.
    exchanges : list of Exchange
        The radio traffic of each episode; none if the radio is ideal.

    Attributes
    ----------
    hears : bool
        Whether a robot's team map holds only data received by radio.
    adds_up : bool
        Whether robots plan on sums of their own map and received maps.
    records : (rows, 10) int64
        The sums as kernels see them, zeros if they do not exist yet.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        poses: KnownPoses,
        exchanges: list[Exchange],
    ) -> None:
        self._beliefs, self._settings, self._poses = simulation.beliefs, settings, poses
        self._exchanges, self._robots = exchanges, settings.robots
        rows = settings.robots * simulation.episodes
        self.hears = settings.known_starts and settings.robots > 1 and not settings.radio.is_ideal
        self.adds_up = self.hears
        self.records = np.zeros((rows, RECORD), np.int64)
        self._sums: list[NavigationMap | None] = [None] * rows
        self._others: list[NDArray[np.int8] | None] = [None] * rows

    def start(self, rows: range) -> None:
        """Begin the episode of some rows: their robots have received nothing."""
        for row in rows:
            navigation = self._sums[row]
            if navigation is not None:
                # A caller that still holds a map of the last episode may continue to read it.
                navigation.keep_record_in(np.zeros(RECORD, np.int64))
            self._sums[row], self._others[row] = None, None
            self.records[row] = 0
        self.adds_up = self.hears or any(others is not None for others in self._others)

    def has_sum(self, row: int) -> bool:
        """Whether there is a sum for a robot yet."""
        return self._sums[row] is not None

    def has_merged_map(self, row: int) -> bool:
        """Whether a robot has received a map of others."""
        return self._others[row] is not None

    def sum_of(self, row: int, own: NavigationMap | None) -> NavigationMap:
        """Return the sum of a robot's own map and those received.

        ``own`` is the robot's own map for navigation, None before there is one.
        """
        navigation = self._sums[row]
        if navigation is None:
            log_odds = np.zeros(self._beliefs.log_odds[row].shape, np.int8)
            navigation = NavigationMap(log_odds, self._settings.occupancy.resolution)
            navigation.keep_record_in(self.records[row])
            self._sums[row] = navigation
            _, rows, columns = self._beliefs.belief_rows[row, :3]
            self.sum_window(row, np.array([0, rows, 0, columns]))
            if not self.hears and own is not None and own.record[FLAGS] != 0:
                # Frontiers that the robot gave up on its own map are not tried again.
                navigation.frontiers.ignore(np.argwhere(own.frontiers.flags == IGNORED))
        return navigation

    def sum_window(self, row: int, window: NDArray[np.int64]) -> None:
        """Update the sum of the maps that a robot received, in a window (4,)."""
        episode, robot = divmod(row, self._robots)
        received = self._others[row]
        if self.hears:
            copies = self._exchanges[episode].copies[robot]
            held = [copy.ctypes.data for teammate, copy in enumerate(copies) if teammate != robot and copy.size]
        else:
            held = [] if received is None else [received.ctypes.data]
        beliefs = np.array(
            [(address, *self._beliefs.log_odds[row].shape) for address in (self._beliefs.belief_rows[row, 0], *held)],
            np.int64,
        )
        limit = limit_of(CLEARANCE_LIMIT, self._settings.occupancy.resolution)
        sum_maps(self.records[row], beliefs, limit, stamp_of(limit), window)

    def receive(self, row: int, others: FusedMap | None) -> None:
        """Give a robot that does not know its start the map of the others.

        It plans and explores on that map as on its own.
        """
        resolution = self._settings.occupancy.resolution
        if self._settings.known_starts:
            raise ValueError(
                "robots that know their starts have the team's map; want robots with unknown starts to be "
                "sent what others know"
            )
        if others is not None and others.resolution != resolution:
            raise ValueError(
                f"the map that is sent has cells of {others.resolution} m; want {resolution} m, as the robots' own maps"
            )
        if others is None and self._others[row] is None:
            return
        received = np.zeros(self._beliefs.log_odds[row].shape, np.int8)
        if others is not None:
            overlay(received, others, self._poses.origin_in_frame(row))
        before = self._others[row]
        is_other = received != 0 if before is None else received != before
        self._others[row], self.adds_up = received, True
        rows, columns = np.flatnonzero(is_other.any(axis=1)), np.flatnonzero(is_other.any(axis=0))
        if self._sums[row] is not None and len(rows):
            self.sum_window(row, np.array([rows[0], rows[-1] + 1, columns[0], columns[-1] + 1]))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for navigation, record in zip(self._sums, self.records, strict=True):
            if navigation is not None:
                navigation.keep_record_in(record)
